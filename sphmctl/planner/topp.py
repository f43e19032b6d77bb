"""Time-optimal speed along a track: TOPP-RA with each limit kept at both ends of every interval.

H. Pham and Q.-C. Pham, A New Approach to Time-Optimal Path Parameterization Based on Reachability
Analysis, IEEE Transactions on Robotics 34 (2018) 645. With x the squared speed along the path,
a joint's acceleration in an interval of length h from x to y is q' (y - x) / 2h + q'' x at its
begin and q' (y - x) / 2h + q'' y at its end: each limit is |c x + d y| <= A, linear in (x, y).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.track import Track

CHUNK = 1024
"""Intervals worked on at once: their lines stay in the processor's cache."""

TOOL_SIDES = 24
"""The tool's acceleration must lie in this polygon inside its circle. Its corners lie along the
path and square to it, so straight lines and steady turns lose nothing, and others at most
1 - cos(pi / 24) = 0.9 %."""

SAMPLE_S = 0.004
"""The stream's step: a speed that jumps at a joint of shapes is an acceleration over this time."""

SHORTEST_S = 0.001
"""Where nothing limits the speed, the whole path would take this long."""

TINY = 1e-12
"""Least share of d by c: a limit that does not depend on y is one that hardly does."""

STRAIGHT = 1e-6
"""Share of its acceleration that the tool may take across its path and still be on a line."""

PEAK_STEPS = 50
"""Of the search for the highest speed: each crosses to another pair of lines, most need 4."""


@dataclass(frozen=True)
class Bounds:
    """What a path may do, SI; infinite means no limit.

    Attributes:
        joint_speeds: rad/s, (9,).
        joint_accelerations: rad/s2, (9,).
        tool_speed: m/s, for the whole path or per interval between two rows, (n - 1,).
        tool_acceleration: m/s2, of the tool point, along and across the path together; likewise.
    """

    joint_speeds: Floats
    joint_accelerations: Floats
    tool_speed: float | Floats = np.inf
    tool_acceleration: float | Floats = np.inf


@dataclass(frozen=True)
class Caps:
    """Bounds per interval of a track, lowered where the sampled stream went beyond them.

    Attributes:
        joint_speeds, joint_accelerations: (9,).
        tool_speed, tool_acceleration: (N,).
        speed_share, acceleration_share: what each interval may use of them, (N,).
    """

    joint_speeds: Floats
    joint_accelerations: Floats
    tool_speed: Floats
    tool_acceleration: Floats
    speed_share: Floats
    acceleration_share: Floats

    @staticmethod
    def of(bounds: Bounds, track: Track) -> Caps:
        """The bounds on each of the track's intervals, all of them to be used in full."""
        count = len(track.rows) - 1
        speed, acceleration = (
            np.broadcast_to(np.asarray(limit, dtype=np.float64), count)[track.given]
            for limit in (bounds.tool_speed, bounds.tool_acceleration)
        )
        full = np.ones(len(track.given))
        joints = bounds.joint_speeds, bounds.joint_accelerations
        return Caps(joints[0], joints[1], speed, acceleration, full, full)

    def lowered(self, speed: Floats, acceleration: Floats) -> Caps:
        """The same with shares divided by these, (N,)."""
        return replace(
            self,
            speed_share=self.speed_share / speed,
            acceleration_share=self.acceleration_share / acceleration,
        )


@dataclass(frozen=True)
class Speeds:
    """Squared speeds (N + 1,) at a track's rows.

    Attributes:
        caps: what they were made for.
        ceiling: the highest within the speed limits.
        controllable: the highest from which the end can still be reached at rest.
        x: the highest that also the begin leads to.
    """

    caps: Caps
    ceiling: Floats
    controllable: Floats
    x: Floats


def fastest(track: Track, caps: Caps, last: Speeds | None = None) -> Speeds:
    """The highest speeds, at rest at both ends and at the stops.

    Args:
        last: speeds for other caps; where these did not change they are taken over.
    """
    ceiling = speed_ceiling(track, caps)
    parts = [slice(low, low + CHUNK) for low in range(0, len(track.given), CHUNK)]
    same = [last is not None and _same(part, caps, ceiling, last) for part in parts]
    controllable = _backward(track, caps, ceiling, parts, same, last)
    return Speeds(
        caps, ceiling, controllable, _forward(track, caps, controllable, parts, same, last)
    )


def _same(part: slice, caps: Caps, ceiling: Floats, last: Speeds) -> bool:
    rows = slice(part.start, part.stop + 1)
    return np.array_equal(ceiling[rows], last.ceiling[rows]) and np.array_equal(
        caps.acceleration_share[part], last.caps.acceleration_share[part]
    )


def speed_ceiling(track: Track, caps: Caps) -> Floats:
    """Highest squared speed (N + 1,) that the speed limits allow at each row."""
    joints = np.abs(track.first[:, :, :-3])
    point = np.linalg.norm(track.first[:, :, -3:], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.min(np.where(joints > 0.0, caps.joint_speeds / joints, np.inf), axis=2)
        v = np.minimum(v, np.where(point > 0.0, caps.tool_speed / point, np.inf))
    v = np.minimum(v * caps.speed_share, (track.s[-1] - track.s[0]) / SHORTEST_S)
    row = np.minimum(np.append(v[0], np.inf), np.append(np.inf, v[1]))
    row[1:-1] = np.minimum(row[1:-1], _over_bends(track, caps))
    row[[0, -1]] = 0.0
    row[track.stops] = 0.0
    return np.asarray(row**2)


def _over_bends(track: Track, caps: Caps) -> Floats:
    """Highest speed (N - 1,) at inner rows where the slope itself jumps."""
    bend = np.abs(track.first[0, 1:] - track.first[1, :-1])
    share = np.minimum(caps.acceleration_share[1:], caps.acceleration_share[:-1]) * SAMPLE_S
    allowed = np.maximum(caps.tool_acceleration[1:], caps.tool_acceleration[:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        joints = np.where(bend[:, :-3] > 0.0, caps.joint_accelerations / bend[:, :-3], np.inf)
        point = np.linalg.norm(bend[:, -3:], axis=1)
        tool = np.where(point > 0.0, allowed / point, np.inf)
    return np.asarray(np.minimum(joints.min(axis=1), tool) * share)


@dataclass(frozen=True)
class _Lines:
    """Limits |a u + b x| <= A of r intervals at both their ends, m of each; u is acceleration."""

    a: Floats
    b: Floats
    limit: Floats
    half: Floats

    def solved_for_y(self) -> tuple[Floats, Floats]:
        """P and R, each (r, 2 m), of -P <= y + R x <= P."""
        c, d, limit = self.flat()
        least = TINY * np.abs(c) + np.finfo(np.float64).tiny
        d = np.where(np.abs(d) < least, least, d)
        with np.errstate(over="ignore"):  # both 0: no limit at all
            return limit / np.abs(d), c / d

    def flat(self) -> tuple[Floats, Floats, Floats]:
        """c, d and A, each (r, 2 m), of |c x + d y| <= A."""
        a = self.a * self.half[:, None]
        c = np.hstack([self.b[0] - a[0], -a[1]])
        d = np.hstack([a[0], self.b[1] + a[1]])
        return c, d, np.hstack([self.limit, self.limit])

    def near(self, x: Floats) -> _Lines:
        """Without the limits that nothing can reach at squared speeds up to x (r + 1,)."""
        ends = np.stack([x[:-1], x[1:]])[:, :, None]
        a, bent = np.abs(self.a), np.abs(self.b) * ends
        with np.errstate(divide="ignore", invalid="ignore"):
            hardest = np.where(a > 0.0, (self.limit + bent) / a, np.inf).min(
                axis=(0, 2), initial=np.inf
            )
            reached = np.where(a > 0.0, a * hardest[:, None], 0.0) + bent
        use = (reached >= self.limit).any(axis=(0, 1))
        return _Lines(self.a[:, :, use], self.b[:, :, use], self.limit[:, use], self.half)


def _lines(track: Track, caps: Caps, part: slice) -> _Lines:
    """The limits of joints and tool in some intervals."""
    first, second = track.first[:, part], track.second[:, part]
    moving = np.asarray(first.any(axis=(0, 1)))
    use = np.flatnonzero(moving[:-3] & np.isfinite(caps.joint_accelerations))
    a, b = first[:, :, use], second[:, :, use]
    limit = np.broadcast_to(caps.joint_accelerations[use], a.shape[1:])
    tool = caps.tool_acceleration[part]
    if moving[-3:].any() and np.isfinite(tool).any():
        tool_a, tool_b, inside = _tool_lines(first[:, :, -3:], second[:, :, -3:])
        a, b = np.concatenate([a, tool_a], axis=2), np.concatenate([b, tool_b], axis=2)
        limit = np.hstack([limit, np.broadcast_to(inside * tool[:, None], tool_a.shape[1:])])
    rows = slice(part.start, part.stop + 1)
    share = caps.acceleration_share[part, None]
    return _Lines(a, b, limit * share, 0.5 / np.diff(track.s[rows]))


def _tool_lines(first: Floats, second: Floats) -> tuple[Floats, Floats, float]:
    """Slope and bend of the tool's way (2, r, k) towards the sides of the polygon, their radius."""
    speed = np.linalg.norm(first, axis=2, keepdims=True)
    along = np.divide(first, speed, out=np.zeros_like(first), where=speed > 0.0)
    forward = np.sum(second * along, axis=2, keepdims=True)
    across = np.linalg.norm(second - forward * along, axis=2, keepdims=True)
    if not across.any():
        return speed, forward, 1.0
    angle = (np.arange(TOOL_SIDES // 2) + 0.5) * 2.0 * np.pi / TOOL_SIDES
    a, b = speed * np.cos(angle), forward * np.cos(angle) + across * np.sin(angle)
    return a, b, float(np.cos(np.pi / TOOL_SIDES))


def _peak(lines: _Lines, x_cap: Floats, y_cap: Floats) -> Floats:
    """Largest x (r,) up to x_cap for which some y from 0 to y_cap keeps every limit.

    The room for y is a concave function of x: Newton's steps from above end at its last zero.
    """
    P, R = lines.solved_for_y()
    x = x_cap.copy()
    if not P.shape[1]:
        return x
    left = np.arange(len(x))
    for _ in range(PEAK_STEPS):
        shift = R * x[left, None]
        rows = np.arange(len(left))
        top, bottom = P - shift, -P - shift
        upper, lower = top.argmin(axis=1), bottom.argmax(axis=1)
        high, low = top[rows, upper], bottom[rows, lower]
        fall = np.where(high < y_cap, R[rows, upper], 0.0) - np.where(
            low > 0.0, R[rows, lower], 0.0
        )
        room = np.minimum(high, y_cap) - np.maximum(low, 0.0)
        over = (room < -TINY * (np.abs(high) + np.abs(low))) & (fall > 0.0)
        if not over.any():
            break
        left, P, R, y_cap = left[over], P[over], R[over], y_cap[over]
        x[left] = np.maximum(x[left] + room[over] / fall[over], 0.0)
    return x


def _backward(
    track: Track,
    caps: Caps,
    ceiling: Floats,
    parts: list[slice],
    same: list[bool],
    last: Speeds | None,
) -> Floats:
    """Largest squared speed (N + 1,) from which the path's end can still be reached at rest."""
    out = ceiling.copy()
    for part, unchanged in zip(reversed(parts), reversed(same), strict=True):
        x = out[part.start : part.stop + 1]
        if unchanged and last is not None and x[-1] == last.controllable[part.start + len(x) - 1]:
            x[:] = last.controllable[part.start : part.stop + 1]
            continue
        lines = _lines(track, caps, part)
        x[:-1] = _peak(lines, x[:-1], x[1:])
        c, d, limit = lines.near(x).flat()
        # Of the lines above x only those that rise with y can hold it below its peak.
        rising = c * d < 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.where(rising, limit / np.abs(c), np.inf)
            slope = np.where(rising, -d / c, 0.0)
        x[:] = _swept(level[::-1], slope[::-1], x[::-1])[::-1]
    return out


def _forward(
    track: Track,
    caps: Caps,
    controllable: Floats,
    parts: list[slice],
    same: list[bool],
    last: Speeds | None,
) -> Floats:
    """The largest squared speed (N + 1,) at each row after the largest at the one before."""
    out = controllable.copy()
    for part, unchanged in zip(parts, same, strict=True):
        rows = slice(part.start, part.stop + 1)
        x = out[rows]
        if (
            unchanged
            and last is not None
            and x[0] == last.x[part.start]
            and np.array_equal(x[1:], last.controllable[rows][1:])
        ):
            x[:] = last.x[rows]
            continue
        P, R = _lines(track, caps, part).near(x).solved_for_y()
        x[:] = _swept(P, -R, x)
    return out


def _swept(level: Floats, slope: Floats, highest: Floats) -> list[float]:
    """Row by row the least of `highest` (r + 1,) and of all level + slope x (r, k) of the last."""
    x = float(highest[0])
    out = [x]
    for top, levels, slopes in zip(
        highest[1:].tolist(), level.tolist(), slope.tolist(), strict=True
    ):
        for a, b in zip(levels, slopes, strict=True):
            y = a + b * x
            if y < top:
                top = y
        x = max(0.0, top)
        out.append(x)
    return out
