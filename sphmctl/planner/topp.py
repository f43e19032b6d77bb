"""Time-optimal speed along a track: TOPP-RA with each limit kept at both ends of every interval.

H. Pham and Q.-C. Pham, A New Approach to Time-Optimal Path Parameterization Based on Reachability
Analysis, IEEE Transactions on Robotics 34 (2018) 645. With x the squared speed along the path,
a joint's acceleration in an interval of length h from x to y is q' (y - x) / 2h + q'' x at its
begin and q' (y - x) / 2h + q'' y at its end: each limit is |c x + d y| <= A, linear in (x, y).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.track import Track

CHUNK = 4096
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
        tool = [
            np.broadcast_to(np.asarray(limit, dtype=np.float64), count)[track.given]
            for limit in (bounds.tool_speed, bounds.tool_acceleration)
        ]
        full = np.ones(len(track.given))
        return Caps(bounds.joint_speeds, bounds.joint_accelerations, *tool, full, full)


def fastest(track: Track, caps: Caps) -> Floats:
    """Squared speed (N + 1,) at the track's rows, at rest at both ends and at its stops."""
    ceiling = speed_ceiling(track, caps)
    return _forward(track, caps, _backward(track, caps, ceiling))


def speed_ceiling(track: Track, caps: Caps) -> Floats:
    """Highest squared speed (N + 1,) that the speed limits allow at each row."""
    steepest = np.abs(track.first).max(axis=0)
    joints = steepest[:, :-3]
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.min(np.where(joints > 0.0, caps.joint_speeds / joints, np.inf), axis=1)
        point = np.linalg.norm(track.first[:, :, -3:], axis=2).max(axis=0)
        v = np.minimum(v, np.where(point > 0.0, caps.tool_speed / point, np.inf))
    v = np.minimum(v * caps.speed_share, (track.s[-1] - track.s[0]) / SHORTEST_S)
    row = np.minimum(np.append(v, np.inf), np.append(np.inf, v))
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


def _lines(track: Track, caps: Caps, part: slice) -> tuple[Floats, Floats, Floats]:
    """c, d and A, each (r, m), of the limits |c x + d y| <= A in some intervals."""
    moving = np.any(track.values != track.values[0], axis=0)
    use = np.flatnonzero(moving[:-3] & np.isfinite(caps.joint_accelerations))
    first, second = track.first[:, part], track.second[:, part]
    a, b = first[:, :, use], second[:, :, use]
    limit = np.broadcast_to(caps.joint_accelerations[use], a.shape[1:])
    if np.any(moving[-3:]) and np.isfinite(caps.tool_acceleration[part]).any():
        tool_a, tool_b = _tool_lines(first[:, :, -3:], second[:, :, -3:])
        a, b = np.concatenate([a, tool_a], axis=2), np.concatenate([b, tool_b], axis=2)
        inside = caps.tool_acceleration[part, None] * np.cos(np.pi / TOOL_SIDES)
        limit = np.hstack([limit, np.broadcast_to(inside, tool_a.shape[1:])])
    limit = limit * caps.acceleration_share[part, None]
    half = 0.5 / np.diff(track.s)[part, None]
    c = np.hstack([b[0] - a[0] * half, -a[1] * half])
    d = np.hstack([a[0] * half, b[1] + a[1] * half])
    return c, d, np.hstack([limit, limit])


def _tool_lines(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Slope and bend of the tool's way (2, r, 3) towards each side of the polygon."""
    speed = np.linalg.norm(first, axis=2, keepdims=True)
    along = np.divide(first, speed, out=np.zeros_like(first), where=speed > 0.0)
    forward = np.sum(second * along, axis=2, keepdims=True)
    across = np.linalg.norm(second - forward * along, axis=2, keepdims=True)
    angle = (np.arange(TOOL_SIDES // 2) + 0.5) * 2.0 * np.pi / TOOL_SIDES
    return speed * np.cos(angle), forward * np.cos(angle) + across * np.sin(angle)


def _solved_for_y(c: Floats, d: Floats, limit: Floats) -> tuple[Floats, Floats]:
    """P and R of -P <= y + R x <= P."""
    least = TINY * np.abs(c) + np.finfo(np.float64).tiny
    d = np.where(np.abs(d) < least, least, d)
    return limit / np.abs(d), c / d


def _peak(c: Floats, d: Floats, limit: Floats, x_cap: Floats, y_cap: Floats) -> Floats:
    """Largest x (r,) for which any y from 0 to y_cap keeps all lines: y eliminated by pairs."""
    P, R = (each.T for each in _solved_for_y(c, d, limit))
    x = x_cap.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        for top in range(len(P)):
            gap = np.abs(R[top + 1 :] - R[top])
            meet = np.where(gap > 0.0, (P[top + 1 :] + P[top]) / gap, np.inf)
            x = np.minimum(x, meet.min(axis=0, initial=np.inf))
        edge = np.where(R > 0.0, P / R, np.where(R < 0.0, -(y_cap + P) / R, np.inf))
    return np.asarray(np.minimum(x, edge.min(axis=0, initial=np.inf)))


def _parts(count: int) -> list[slice]:
    return [slice(low, min(low + CHUNK, count)) for low in range(0, count, CHUNK)]


def _backward(track: Track, caps: Caps, ceiling: Floats) -> Floats:
    """Largest squared speed (N + 1,) from which the path's end can still be reached at rest."""
    out = ceiling.copy()
    k = 0.0
    for part in reversed(_parts(len(track.given))):
        c, d, limit = _lines(track, caps, part)
        peak = _peak(c, d, limit, ceiling[part], ceiling[part.start + 1 : part.stop + 1])
        # Of the lines above x only those that rise with y can hold it below its peak.
        rising = c * d < 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.where(rising, limit / np.abs(c), np.inf)
            slope = np.where(rising, -d / c, 0.0)
        for row in range(part.stop - part.start - 1, -1, -1):
            k = min(float(peak[row]), float((level[row] + slope[row] * k).min(initial=np.inf)))
            out[part.start + row] = k
    return out


def _forward(track: Track, caps: Caps, controllable: Floats) -> Floats:
    """The largest squared speed (N + 1,) at each row after the largest at the one before."""
    out = controllable.copy()
    x = 0.0
    for part in _parts(len(track.given)):
        P, R = _solved_for_y(*_lines(track, caps, part))
        for row in range(part.stop - part.start):
            highest = float((P[row] - R[row] * x).min(initial=np.inf))
            x = max(min(float(out[part.start + row + 1]), highest), 0.0)
            out[part.start + row + 1] = x
    return out
