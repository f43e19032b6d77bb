"""When a path is where: as fast as joints and tool allow, then smoothed to bound the jerk.

`time_law` takes the joints over s and gives the motion s(t). It looks at its own stream every
4 ms; where this goes beyond a bound it lowers the bound thereabouts and solves again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.jerk import Pieces, make_pieces
from sphmctl.planner.overrun import look
from sphmctl.planner.topp import Bounds, Caps, fastest
from sphmctl.planner.track import Indices, Track, make_track

FILTER_S = 0.024
"""Length of the box filter: two cycles of 12 ms of the arm's interpolator."""

EXCESS = 1.002
"""Share of a bound that the stream may take: 0.5 % are allowed, the rest is for sampling."""

PATIENT_ROUNDS = 3
"""After these the bounds are lowered by more than the excess, so that it ends."""

ROUNDS = 12
"""Solutions tried before what is left over is taken off the speed of the whole path."""

BINDS = 0.98
"""From this share on a bound counts as what rules the motion."""

NOTHING, SMOOTHING = "none", "smoothing"

LABELS = (
    *(f"{name} {kind}" for kind in ("speed", "acceleration") for name in (*JOINT_NAMES, "tool")),
    SMOOTHING,
    NOTHING,
)
"""What can bind; `TimeLaw.binding` numbers them."""

__all__ = ["FILTER_S", "LABELS", "Bounds", "Stuck", "TimeLaw", "time_law"]


@dataclass(frozen=True)
class Stuck:
    """No law exists: at this row the joint ("A1" .. "theta9", "tool") may not move, but must.

    Attributes:
        kind: "speed" or "acceleration".
        limit: rad/s or m/s, and so on.
    """

    row: int
    joint: str
    kind: str
    limit: float


@dataclass(frozen=True)
class TimeLaw:
    """A motion along a path, from rest to rest.

    Attributes:
        optimal_s: how long it would take without jerk limit.
        stretch: how much slower the whole path is than its bounds ask for; 1 but in odd cases.
        rounds: how often it was solved.
    """

    track: Track
    caps: Caps
    pieces: Pieces
    optimal_s: float
    stretch: float
    rounds: int

    @property
    def duration_s(self) -> float:
        """From rest to rest, the filter included."""
        return self.pieces.duration_s

    def s(self, t_s: Floats) -> Floats:
        """Where the motion is at times (m,); it stands before 0 and after its end."""
        return self.pieces.at(t_s)[0]

    def sample(self, t_s: Floats) -> tuple[Floats, Floats, Floats]:
        """s and its first and second derivative by time, each (m,), at times (m,)."""
        return self.pieces.at(t_s)

    def t(self, s: Floats) -> Floats:
        """When s (m,) is reached; where the motion stops, when it goes on."""
        return self.pieces.when(s)

    @cached_property
    def use(self) -> Floats:
        """Share of each bound that is used at each row, (n, 20): speeds, then accelerations."""
        return np.asarray(self._along[1][self.track.rows])

    @cached_property
    def binding(self) -> Indices:
        """Which of LABELS rules the motion at each row, (n,)."""
        return self._binding(self.use)

    @cached_property
    def _along(self) -> tuple[Floats, Floats]:
        """Times (N + 1,), and use of the bounds (N + 1, 20), at the track's own rows."""
        t = self.pieces.when(self.track.s)
        _, speed, acceleration = self.pieces.at(t)
        ends = np.stack([acceleration[:-1], acceleration[1:]])
        if self.pieces.filter_s == 0.0:  # it jumps at the rows
            ends[:] = self.pieces.at((t[1:] + t[:-1]) / 2.0)[2]
        return t, _use(self.track, self.caps, speed, ends)

    def _binding(self, use: Floats) -> Indices:
        worst = use.argmax(axis=1)
        free = LABELS.index(SMOOTHING if self.pieces.filter_s > 0.0 else NOTHING)
        return np.where(use[np.arange(len(worst)), worst] >= BINDS, worst, free)

    def shares(self) -> list[tuple[str, float]]:
        """How much of the time each of LABELS binds, the most first."""
        if self.duration_s == 0.0:
            return []
        t, use = self._along
        half = np.diff(t) / 2.0
        owned = np.append(half, 0.0) + np.append(0.0, half)
        time_s = np.bincount(self._binding(use), owned, minlength=len(LABELS)) / owned.sum()
        return [(LABELS[i], float(time_s[i])) for i in np.argsort(-time_s) if time_s[i] > 0.0]

    def summary(self) -> str:
        """`12.31 s (12.21 s without jerk limit); A2 acceleration binds 41 % of the time, ...`."""
        head = f"{self.duration_s:.2f} s ({self.optimal_s:.2f} s without jerk limit)"
        told = [f"{name} {share:.0%}" for name, share in self.shares() if share >= 0.005]
        if not told:
            return head
        told[0] = told[0].replace(f" {told[0].split()[-1]}", f" binds {told[0].split()[-1]}")
        return f"{head}; {', '.join(told)} of the time"

    def slowed(self, factor: float) -> TimeLaw:
        """The same motion, `factor` times as long."""
        return replace(
            self,
            pieces=self.pieces.slowed(factor),
            optimal_s=self.optimal_s * factor,
            stretch=self.stretch * factor,
        )


def time_law(
    joints: Floats,
    s: Floats,
    tool: Floats,
    bounds: Bounds,
    joints_of_shapes: Sequence[int] = (),
    stops: Sequence[int] = (),
    filter_s: float = FILTER_S,
) -> TimeLaw | Stuck:
    """The quickest motion along a path, from rest to rest.

    Args:
        joints: rad, (n, 9).
        s: strictly rising, (n,): arc length, or whatever else runs along the path.
        tool: the tool point, m, (n, 3).
        joints_of_shapes: rows where curvature jumps; derivatives do not look across them.
        stops: rows at which everything must stand for an instant.
        filter_s: length of the box filter; 0 for no jerk limit.

    Raises:
        ValueError: a value is not finite, s does not rise, or the arrays do not fit together.
    """
    _examine(joints, s, tool, filter_s)
    values = np.hstack([joints, tool])
    if s[0] == s[-1]:
        return _standing(values, s)
    track = make_track(values, s, joints_of_shapes, stops)
    caps = Caps.of(bounds, track)
    stuck = _forbidden(track, caps)
    return stuck if stuck is not None else _solved(track, caps, filter_s)


def _examine(joints: Floats, s: Floats, tool: Floats, filter_s: float) -> None:
    if joints.shape != (len(s), 9) or tool.shape != (len(s), 3) or not len(s):
        raise ValueError(f"joints {joints.shape}, s {s.shape} and tool {tool.shape} do not fit")
    fine = np.isfinite(joints).all(axis=1) & np.isfinite(tool).all(axis=1) & np.isfinite(s)
    if not fine.all():
        raise ValueError(f"row {int(fine.argmin())} is not finite")
    rise = np.diff(s)
    if len(s) > 1 and s[0] != s[-1] and rise.min() <= 0.0:
        raise ValueError(f"s does not rise after row {int(rise.argmin())}")
    if not 0.0 <= filter_s < np.inf:
        raise ValueError(f"a filter of {filter_s} s is none")


def _standing(values: Floats, s: Floats) -> TimeLaw:
    """The law of a path without length: over at once."""
    two, none = np.array([s[0], s[0]]), np.zeros(2)
    flat = np.zeros((2, 1, values.shape[1]))
    index = np.zeros(1, dtype=np.intp)
    track = Track(two, values[[0, 0]], flat, flat, index[:0], index, np.zeros(len(s), np.intp))
    free, one = np.full(9, np.inf), np.ones(1)
    caps = Caps(free, free, free[:1], free[:1], one, one)
    return TimeLaw(track, caps, Pieces(none, two, none, none, none[:1], 0.0), 0.0, 1.0, 0)


def _forbidden(track: Track, caps: Caps) -> Stuck | None:
    """Where something has to move whose bound is 0."""
    moves = np.any(track.first != 0.0, axis=0)
    moving = np.column_stack([moves[:, :-3], moves[:, -3:].any(axis=1)])
    for kind, joints, tool in (
        ("speed", caps.joint_speeds, caps.tool_speed),
        ("acceleration", caps.joint_accelerations, caps.tool_acceleration),
    ):
        limits = np.column_stack([np.broadcast_to(joints, (len(tool), 9)), tool])
        bad = moving & ~(limits > 0.0)
        if bad.any():
            interval, who = np.argwhere(bad)[0]
            limit = float(limits[interval, who])
            return Stuck(int(track.given[interval]), (*JOINT_NAMES, "tool")[who], kind, limit)
    return None


def _solved(track: Track, caps: Caps, filter_s: float) -> TimeLaw:
    """Solve, look at the stream, lower the bounds where it went beyond them, and again."""
    speeds, optimal_s, rounds = fastest(track, caps), 0.0, 0
    while True:
        pieces = make_pieces(track.s, speeds.x, track.stops, filter_s)
        optimal_s = optimal_s or float(pieces.t[-1]) - filter_s * len(track.stops)
        rounds += 1
        use = look(track, pieces, caps)
        fast, hard = float(use.speed.max()), float(use.acceleration.max())
        law = TimeLaw(track, caps, pieces, optimal_s, 1.0, rounds)
        if fast <= EXCESS and hard <= EXCESS:
            return law
        if rounds == ROUNDS:
            return law.slowed(max(fast, float(np.sqrt(hard))))
        push = max(1.0, rounds / PATIENT_ROUNDS)
        caps = caps.lowered(_excess(use.speed) ** push, _excess(use.acceleration) ** push)
        speeds = fastest(track, caps, speeds)


def _excess(use: Floats) -> Floats:
    return np.where(use > EXCESS, use, 1.0)


def _use(track: Track, caps: Caps, speed: Floats, acceleration: Floats) -> Floats:
    """Shares (N + 1, 20) of the bounds; accelerations (2, N) are at the intervals' ends."""
    v = np.stack([speed[:-1], speed[1:]])[:, :, None]
    rate = np.abs(track.first * v)
    force = np.abs(track.first * acceleration[:, :, None] + track.second * v**2)
    point_rate, point_force = (np.linalg.norm(x[:, :, -3:], axis=2) for x in (rate, force))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = [
            rate[:, :, :-3] / caps.joint_speeds,
            (point_rate / caps.tool_speed)[:, :, None],
            force[:, :, :-3] / caps.joint_accelerations,
            (point_force / caps.tool_acceleration)[:, :, None],
        ]
    begin, end = np.nan_to_num(np.concatenate(shares, axis=2), nan=0.0)
    out = np.zeros((len(speed), begin.shape[1]))
    out[:-1] = begin
    out[1:] = np.maximum(out[1:], end)
    return out
