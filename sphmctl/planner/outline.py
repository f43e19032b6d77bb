"""From moves to contours: where the tool runs on, and where the arm stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.pathfile import Move
from sphmctl.planner.contour import Contour, Span
from sphmctl.planner.corners import Corner, corner, pose_rate
from sphmctl.planner.drawing import (
    SPOT_LEAST_M,
    SPOT_M_RAD,
    Forward,
    Part,
    Stand,
    blend_of,
    draw,
)
from sphmctl.planner.shapes import Shape, Spot
from sphmctl.planner.spline import Track, chain
from sphmctl.planner.turning import Between
from sphmctl.planner.wrists import OPEN, group, wrist_track
from sphmctl.robots.geometry import angle_between

SMOOTH_RAD = 1e-4
"""A tangent that turns less is no corner: rounding to 0.001 mm does as much to 10 mm."""

GAP_RAD = 1e-7
"""Orientations that differ less are one."""

RATE_LIMIT = 0.01
"""Rates per metre (of the tool's quaternion, of the wrist) that differ less run on: at 0.1 m/s a
jump of 0.001 rad/s, a hundredth of what the slowest joint gains in 4 ms."""

LEAST_M = 1e-9
"""What two corners leave of a way between them, if less than this, is rounding."""


@dataclass
class _Run:
    """Parts that become one contour.

    Attributes:
        wrists: the wrist's track on each part; None for policies without.
        blends: whether a corner is rounded behind each part but the last.
    """

    parts: list[Part]
    wrists: list[Track | None]
    blends: list[bool]


def contours(
    file: str,
    moves: Sequence[Move],
    begin: Floats,
    forward: Forward,
    begin_cranks_rad: Floats | None = None,
) -> tuple[Contour, ...]:
    """What consecutive moves along a path draw, cut where the arm must stand.

    Args:
        file: the path file's name, for messages.
        moves: of the kinds that draw (`Move.draws`), one after the other.
        begin: tool pose in the base, (4, 4), where the first one begins.
        forward: tool poses in the base (n, 4, 4) of joints (n, 9), for points given so.
        begin_cranks_rad: cranks (3,) there, or None if they are not known yet.

    Raises:
        InvalidError: the points give no such shape, or no blend; with file, line and column.
        InfeasibleError: the tool would have to turn by half a turn.
    """
    stand = Stand(begin)
    outline = _Outline(file, begin, OPEN)
    if begin_cranks_rad is not None:
        outline.now = np.append(begin_cranks_rad, 0.0)
    for move in moves:
        try:
            parts = draw(move, stand, forward)
        except InvalidError as problem:
            raise _placed(problem, file, move) from None
        for part in parts:
            outline.add(part)
        stand = parts[-1].stand
    outline.close()
    return tuple(outline.found)


def _placed(problem: InvalidError, file: str, move: Move) -> InvalidError:
    where = problem.where or f"{file}, line {move.line}, column {move.column}"
    return InvalidError(f"{move.title}: {problem.message}", where)


@dataclass
class _Outline:
    """The contours found, and the run of parts that will be the next one.

    Attributes:
        pose: of the tool where the next part begins, (4, 4).
        now: the wrist's values there, or OPEN.
    """

    file: str
    pose: Floats
    now: Floats
    found: list[Contour] = field(default_factory=list)
    run: _Run | None = None

    def add(self, part: Part) -> None:
        """Add a part to the run, or close the run and begin another."""
        run, wrist = self.run, wrist_track(part, self.now)
        if run is not None:
            blend = self._blended(run.parts[-1], part)
            same = group(run.parts[-1].move.wrist) == group(part.move.wrist)
            if blend or (same and _smooth(run.parts[-1], part, run.wrists[-1], wrist)):
                run.parts.append(part)
                run.wrists.append(wrist)
                run.blends.append(blend)
                self._go_on(part, wrist)
                return
            self.close()
        self._change_on_the_spot(run, part, wrist)
        self.run = _Run([part], [wrist], [])
        self._go_on(part, wrist)

    def _go_on(self, part: Part, wrist: Track | None) -> None:
        """The values at the end of a part are those at the next one's begin, if known."""
        self.pose = part.stand.pose
        self.now = OPEN if wrist is None else wrist.values[-1]
        if len(self.now) == len(OPEN) and self.now[3] > 0.0:
            self.now = OPEN

    def _blended(self, before: Part, part: Part) -> bool:
        """Whether the corner before a part is to be rounded."""
        blend = before.last and blend_of(before.move) > 0.0
        if blend:
            try:
                _check_blend(before, part)
            except InvalidError as problem:
                raise _placed(problem, self.file, before.move) from None
        return blend

    def close(self) -> None:
        """Make the run a contour."""
        if self.run is None:
            return
        run, corners = self.run, []
        for i, blend in enumerate(run.blends):
            try:
                neighbours = run.parts[i], run.parts[i + 1], run.wrists[i], run.wrists[i + 1]
                corners.append(corner(*neighbours) if blend else None)
            except InvalidError as problem:
                raise _placed(problem, self.file, run.parts[i].move) from None
        self.found.append(_contour(run, corners))
        self.run = None

    def _change_on_the_spot(self, run: _Run | None, part: Part, wrist: Track | None) -> None:
        """What tool and wrist must change before a part, while the tool point stands."""
        end, begin = self.pose, part.shape.pose(np.zeros(1))[0]
        angle = float(angle_between(end[:3, :3], begin[:3, :3]))
        move, jump, values = part.move, 0.0, None
        if wrist is not None:
            values = wrist.values[[0, 0]]
            last = None if run is None else run.wrists[-1]
            if last is not None and last.values.shape[1] == values.shape[1] != len(OPEN):
                values[0] = last.values[-1]
                jump = float(np.abs(values[1] - values[0]).max())
        if max(angle, jump) < GAP_RAD:
            return
        length = max(SPOT_M_RAD * max(angle, jump), SPOT_LEAST_M)
        shape = Shape(Spot(end[:3, 3], length), Between(end[:3, :3], begin[:3, :3], length))
        span = Span(shape, 0.0, length, (move,), (part.offset_m, part.offset_m))
        track = None if values is None else Track.monotone(np.array([0.0, length]), values)
        self.found.append(Contour((span,), move.wrist.policy, track, True))


def _check_blend(before: Part, behind: Part) -> None:
    one, other = before.move.wrist, behind.move.wrist
    if group(one) != group(other):
        raise InvalidError(
            f"its corner with the next move cannot be blended: the wrist policy changes there from "
            f"'{one.policy}' to '{other.policy}'; leave 'blend_mm' out"
        )
    if before.still or behind.still:
        raise InvalidError(
            "its corner with the next move cannot be blended: the tool stands in one of them; "
            "leave 'blend_mm' out"
        )


def _smooth(before: Part, behind: Part, one: Track | None, other: Track | None) -> bool:
    """Whether the tool runs from one part on to the next without a corner of any kind."""
    if before.still or behind.still:
        return False
    end, begin = np.array([before.shape.length_m]), np.zeros(1)
    (pose,), (t,) = before.shape.follow(end)
    (following,), (on,) = behind.shape.follow(begin)
    if np.linalg.norm(on - t) > SMOOTH_RAD:
        return False
    if angle_between(pose[:3, :3], following[:3, :3]) > GAP_RAD:
        return False
    rate, then = pose_rate(before.shape, float(end[0])), pose_rate(behind.shape, 0.0)
    sign = np.sign(rate.quaternion @ then.quaternion)
    if np.abs(rate.slope - sign * then.slope).max() > RATE_LIMIT:
        return False
    if one is None or other is None:
        return True
    (value, slope), (value_on, slope_on) = one.at(end), other.at(begin)
    return bool(
        np.abs(value - value_on).max() < GAP_RAD and np.abs(slope - slope_on).max() < RATE_LIMIT
    )


def _contour(run: _Run, corners: list[Corner | None]) -> Contour:
    """A run with its corners rounded."""
    spans: list[Span] = []
    wrists: list[Track] = []
    begins: list[float] = []
    marks: list[tuple[str, float]] = []
    pins: list[tuple[float, Move, Floats]] = []
    s = 0.0

    def add(span: Span, wrist: Track | None) -> None:
        nonlocal s
        spans.append(span)
        begins.append(s)
        if wrist is not None:
            wrists.append(wrist)
        s += span.length_m

    behind = [None, *corners]
    ahead = [*corners, None]
    for part, wrist, one, other in zip(run.parts, run.wrists, behind, ahead, strict=True):
        begin, end = _ends(part, one, other)
        at = s
        if end - begin > LEAST_M:
            along = (part.offset_m + begin, part.offset_m + end)
            span = Span(part.shape, begin, end - begin, (part.move,), along)
            add(span, wrist.part(begin, end) if wrist is not None else None)
        inside = [(name, at + x - begin) for name, x in part.marks if begin <= x <= end]
        marks += inside
        pins += [(at + x - begin, part.move, q) for x, q in part.pins if begin <= x <= end]
        if other is not None:
            along = (part.offset_m + end, other.cut_m)
            moves = (part.move, other.behind)
            if part.marks and part.marks[-1][1] > end:
                marks.append((part.marks[-1][0], s + other.shape.length_m / 2.0))
            add(Span(other.shape, 0.0, other.shape.length_m, moves, along), other.wrist)
    policies = {part.move.wrist.policy for part in run.parts}
    policy = policies.pop() if len(policies) == 1 else "cranks"
    track = chain(wrists, begins) if wrists else None
    return Contour(tuple(spans), policy, track, run.parts[0].still, tuple(marks), tuple(pins))


def _ends(part: Part, one: Corner | None, other: Corner | None) -> tuple[float, float]:
    """Arc lengths of a part between the corners that round its ends."""
    return (
        0.0 if one is None else one.cut_m,
        part.shape.length_m - (0.0 if other is None else other.cut_m),
    )
