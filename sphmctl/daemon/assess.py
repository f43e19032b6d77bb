"""How well a run followed its plan: progress, skew, tracking and named points. Computation only.

Joints are degrees here, as the run's files hold them; the plan's arrays stay radians and metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats, Plan
from sphmctl.robots import geometry, sphm

AHEAD_S = 1.0
"""How far ahead of its last place the arm is sought on the plan: as the definition of skew says."""

DEAD_BAND_DEG = 0.044
"""Half a servo step: no command can place a crank better than this, so that skew leaves it out."""

COUNTED_DEG_S = 10.0
"""Planned crank speed from which skew counts: below, the dead band alone is over 4 ms."""

STANDING_DEG_S = 0.1
"""Below this largest joint speed the arm stands: a ramp of 500 deg/s2 passes it in 0.2 ms."""

TIE = 1e-9
"""Distances closer than this are equal, deg or mm: far over rounding, far under any reading."""

NEAR_POINT_S = 0.5
"""A named point is looked for among the rows within this plan time of it: half a typical side."""

THIRDS = 24
"""Steps of the search on a segment, each to two thirds: 6e-5 of it, 0.24 us of a 4 ms sample."""

Norm = Callable[[Floats], Floats]
"""Length of each column of a (k, m) array of differences, shape (m,)."""


@dataclass(frozen=True)
class Skew:
    """How far wrist and arm were apart in time; None where no instant counted.

    Attributes:
        share_counted: instants that counted, as a share of all.
        max_crank_error_deg: over all instants; None without any.
    """

    p50_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    share_counted: float
    max_crank_error_deg: float | None


@dataclass(frozen=True)
class SkewTrace:
    """Skew and crank error at each instant.

    Attributes:
        tau_s: plan time, shape (m,).
        crank_error_deg: true less planned at tau, shape (m, 3).
        skew_ms: shape (m,), NaN where it does not count.
    """

    tau_s: Floats
    crank_error_deg: Floats
    skew_ms: Floats


@dataclass(frozen=True)
class Tracking:
    """Largest distance between the measured path and the planned one; None without a row."""

    max_joint_deg: float | None
    max_tcp_mm: float | None


@dataclass(frozen=True)
class PointResult:
    """A named point: required against reached. Poses are x, y, z (mm), a, b, c (deg).

    Attributes:
        reached: None if the run never came near it, and with it both errors.
    """

    name: str
    required: tuple[float, ...]
    reached: tuple[float, ...] | None
    position_error_mm: float | None
    angle_error_deg: float | None


def progress(plan_t: Floats, plan_deg: Floats, rows_deg: Floats) -> Floats:
    """The plan time of each row: where the plan is nearest, by the largest joint difference.

    It is sought from the last row's time to `AHEAD_S` later, so that it never goes back: first
    among the plan's samples, then on the lines to both neighbours. The earliest of equals counts;
    on a way out and back along one line, places are equal although their samples are not.

    Args:
        plan_t: s, shape (n,), strictly rising.
        plan_deg: joints at these times, shape (n, k); the six arm joints for tau.
        rows_deg: the same joints of each row, in order, shape (m, k).

    Returns:
        s, shape (m,).
    """
    return _walk(plan_t, plan_deg, rows_deg, _largest)


def skew(plan_t: Floats, plan_joints_deg: Floats, truth_t: Floats, truth_deg: Floats) -> Skew:
    """The figures of one run. Joints are A1..A6, theta7..theta9, shapes (n, 9) and (m, 9)."""
    return skew_figures(skew_trace(plan_t, plan_joints_deg, truth_t, truth_deg))


def skew_figures(trace: SkewTrace) -> Skew:
    """The percentiles and extremes of a trace."""
    if trace.tau_s.size == 0:
        return Skew(None, None, None, 0.0, None)
    worst_deg = float(np.abs(trace.crank_error_deg).max())
    counted = trace.skew_ms[~np.isnan(trace.skew_ms)]
    if counted.size == 0:
        return Skew(None, None, None, 0.0, worst_deg)
    p50, p99 = np.percentile(counted, [50.0, 99.0])
    share = counted.size / trace.tau_s.size
    return Skew(float(p50), float(p99), float(counted.max()), share, worst_deg)


def skew_trace(
    plan_t: Floats, plan_joints_deg: Floats, truth_t: Floats, truth_deg: Floats
) -> SkewTrace:
    """How late or early the cranks are at each instant, seen from where the arm is.

    With e the crank errors against the plan at tau, v the planned crank velocities there and
    s = |v| / sqrt(3), skew is |e.v| / (v.v) less `DEAD_BAND_DEG` / s, and not below 0. An instant
    counts when s is at least `COUNTED_DEG_S` and the true arm moves.
    """
    tau = progress(plan_t, plan_joints_deg[:, :6], truth_deg[:, :6])
    cranks = plan_joints_deg[:, 6:]
    error = truth_deg[:, 6:] - _at(plan_t, cranks, tau)
    v = _at(plan_t, np.gradient(cranks, plan_t, axis=0), tau)
    s = np.linalg.norm(v, axis=1) / np.sqrt(3.0)
    counted = (s >= COUNTED_DEG_S) & _moving(truth_t, truth_deg[:, :6])
    skew_ms = np.full(tau.shape, np.nan)
    e, v, s = error[counted], v[counted], s[counted]
    late_s = np.abs((e * v).sum(axis=1)) / (v * v).sum(axis=1) - DEAD_BAND_DEG / s
    skew_ms[counted] = 1000.0 * np.maximum(late_s, 0.0)
    return SkewTrace(tau, error, skew_ms)


def tracking(
    plan: Plan, rows_deg: Floats, *, mount_yaw_rad: float = 0.0, complete: bool = True
) -> Tracking:
    """The farthest that the measured joints, and the tool point, were from the plan's.

    Each row counts with its distance from the plan, and each sample of the plan with its distance
    from the measured path, both in order: a cut corner or a skipped side counts in full. The place
    on the plan is sought with all nine joints, so that the wrist may also move by itself.

    Args:
        plan: the plan.
        rows_deg: measured joints in order, shape (m, 9).
        mount_yaw_rad: of the wrist on the flange, as the cell says.
        complete: whether the run should have reached the plan's end; False leaves out what comes
            after the last row's place.
    """
    if rows_deg.shape[0] == 0:
        return Tracking(None, None)
    joints_deg = np.degrees(plan.joints)
    tool_mm = 1000.0 * plan.tool[:, :3, 3]
    reached_mm = 1000.0 * tool_in_base(plan, rows_deg, mount_yaw_rad)[:, :3, 3]
    return Tracking(
        _farthest(plan.t, joints_deg, rows_deg, _largest, complete),
        _farthest(plan.t, tool_mm, reached_mm, _euclidean, complete),
    )


def required(plan: Plan, rows_deg: Floats) -> Floats:
    """What the plan asks of all nine joints where the arm is in each row, deg, shape (m, 9)."""
    joints_deg = np.degrees(plan.joints)
    return _at(plan.t, joints_deg, progress(plan.t, joints_deg[:, :6], rows_deg[:, :6]))


def tool_in_base(plan: Plan, rows_deg: Floats, mount_yaw_rad: float = 0.0) -> Floats:
    """The tool's pose in the path's base frame for joints (m, 9), deg: m, shape (m, 4, 4)."""
    tool = sphm.forward(np.radians(rows_deg), plan.tool_on_platform, mount_yaw_rad)
    return geometry.invert(plan.base_in_world) @ tool


def named_points(
    plan: Plan, rows_deg: Floats, *, mount_yaw_rad: float = 0.0
) -> tuple[PointResult, ...]:
    """Each named point with the pose that came nearest to it, in the order of the plan.

    The pose is sought on the straight joint lines between the rows (m, 9), deg, that are within
    `NEAR_POINT_S` of the point and nearer to it than to its neighbours in plan time.
    """
    tau = progress(plan.t, np.degrees(plan.joints), rows_deg)
    reached_m = tool_in_base(plan, rows_deg, mount_yaw_rad)[:, :3, 3]
    when = np.unique(plan.t[[point.sample for point in plan.points]])
    middles = np.concatenate([[-np.inf], 0.5 * (when[1:] + when[:-1]), [np.inf]])
    results = []
    for point in plan.points:
        pose, at_s = plan.tool[point.sample], plan.t[point.sample]
        here = np.searchsorted(when, at_s)
        low, high = middles[here], middles[here + 1]
        near = np.flatnonzero((np.abs(tau - at_s) <= NEAR_POINT_S) & (low <= tau) & (tau <= high))
        reached = None
        if near.size:
            gap_m = np.linalg.norm(reached_m[near] - pose[:3, 3], axis=1)
            row = int(near[np.argmin(gap_m)])
            joints = _nearest_joints(rows_deg, reached_m, row, pose[:3, 3])
            reached = tool_in_base(plan, joints[None], mount_yaw_rad)[0]
        results.append(_compare(point.name, pose, reached))
    return tuple(results)


def _compare(name: str, pose: Floats, reached: Floats | None) -> PointResult:
    if reached is None:
        return PointResult(name, _pose_mm_deg(pose), None, None, None)
    error_mm = 1000.0 * float(np.linalg.norm(reached[:3, 3] - pose[:3, 3]))
    error_deg = float(np.degrees(geometry.angle_between(reached[:3, :3], pose[:3, :3])))
    return PointResult(name, _pose_mm_deg(pose), _pose_mm_deg(reached), error_mm, error_deg)


def _nearest_joints(rows_deg: Floats, reached_m: Floats, row: int, target_m: Floats) -> Floats:
    """The joints between `row` and its neighbours whose tool point is nearest the target, (9,)."""
    ends = np.array([max(row - 1, 0), min(row + 1, len(rows_deg) - 1)])
    share, gap = _on_segments(
        np.broadcast_to(target_m[:, None], (3, 2)),
        reached_m[[row]].T,
        reached_m[ends].T,
        _euclidean,
    )
    side = int(np.argmin(gap))
    return np.asarray(rows_deg[row] + share[side] * (rows_deg[ends[side]] - rows_deg[row]))


def _pose_mm_deg(pose: Floats) -> tuple[float, ...]:
    abc_deg = np.degrees(geometry.matrix_to_abc(pose[:3, :3]))
    return (*(1000.0 * pose[:3, 3]).tolist(), *abc_deg.tolist())


def _largest(difference: Floats) -> Floats:
    return np.asarray(np.abs(difference).max(axis=0))


def _euclidean(difference: Floats) -> Floats:
    return np.asarray(np.sqrt((difference * difference).sum(axis=0)))


def _at(t: Floats, values: Floats, tau: Floats) -> Floats:
    """Columns of `values` (n, k) over `t` at `tau`, straight between samples: (m, k)."""
    return np.stack([np.interp(tau, t, column) for column in values.T], axis=1)


def _moving(t: Floats, arm_deg: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether the arm moves before or after each row."""
    moving = np.zeros(t.size, dtype=np.bool_)
    fast = np.abs(np.diff(arm_deg, axis=0)).max(axis=1, initial=0.0) > STANDING_DEG_S * np.diff(t)
    moving[1:] |= fast
    moving[:-1] |= fast
    return moving


def _walk(plan_t: Floats, plan: Floats, rows: Floats, norm: Norm) -> Floats:
    """The plan time nearest to each row, in order: see `progress`."""
    columns = np.ascontiguousarray(plan.T)
    targets = np.ascontiguousarray(rows.T)
    ends = np.searchsorted(plan_t, plan_t + AHEAD_S, side="right").tolist()
    nearest, limit = np.zeros(len(rows), dtype=np.intp), np.zeros(len(rows), dtype=np.intp)
    # Two samples of one place are this far apart at most; half of it is how much one looks nearer.
    margin = 0.5 * norm(np.diff(columns)).max(initial=0.0) + TIE
    here = 0
    for row in range(len(rows)):
        limit[row] = ends[here] - 1
        gap = norm(columns[:, here : ends[here]] - targets[:, row : row + 1])
        here += _first_minimum(gap, margin)
        nearest[row] = here
    before = np.maximum(nearest - 1, 0)
    after = np.minimum(nearest + 1, limit)
    at = columns[:, nearest]
    # Both lines are walked forward in time, so that the earliest of equals is found on either.
    back, back_gap = _on_segments(targets, columns[:, before], at, norm)
    ahead, ahead_gap = _on_segments(targets, at, columns[:, after], norm)
    step_back, step_ahead = plan_t[nearest] - plan_t[before], plan_t[after] - plan_t[nearest]
    tau = np.where(
        ahead_gap < back_gap - TIE,
        plan_t[nearest] + ahead * step_ahead,
        plan_t[before] + back * step_back,
    )
    return np.maximum.accumulate(tau) if tau.size else tau


def _first_minimum(gap: Floats, margin: float) -> int:
    """The first local minimum within `margin` of the smallest; where it is flat, its start."""
    # Plain numbers: the smallest is nearly always one of the first, where arrays cost more.
    way = gap[: int(gap.argmin()) + 1].tolist()
    here = next(i for i, distance in enumerate(way) if distance <= way[-1] + margin)
    for i in range(here + 1, len(way)):
        if way[i] > way[i - 1] + TIE:
            break
        if way[i] < way[here] - TIE:
            here = i
    return here


def _on_segments(target: Floats, a: Floats, b: Floats, norm: Norm) -> tuple[Floats, Floats]:
    """Where between a and b the target is nearest, as a share of the way, and how far: (m,) each.

    Arrays are (k, m). The distance is convex along a line: a search by thirds finds its first
    minimum.
    """
    start, way = a - target, b - a
    low, high = np.zeros(target.shape[1]), np.ones(target.shape[1])
    for _ in range(THIRDS):
        third = (high - low) / 3.0
        left, right = low + third, high - third
        keep_left = norm(start + left * way) <= norm(start + right * way)
        high = np.where(keep_left, right, high)
        low = np.where(keep_left, low, left)
    gap, end_gap = norm(start + low * way), norm(start + way)
    return np.where(end_gap < gap, 1.0, low), np.minimum(gap, end_gap)


def _farthest(plan_t: Floats, plan: Floats, rows: Floats, norm: Norm, complete: bool) -> float:
    """The larger of: rows from the plan, samples of the plan from the measured path."""
    tau = _walk(plan_t, plan, rows, norm)
    off_plan = norm((rows - _at(plan_t, plan, tau)).T).max()
    # The measured path passes a sample between the rows before and after it in plan time.
    wanted = np.ones(plan_t.size, dtype=np.bool_) if complete else plan_t <= tau[-1]
    after = np.minimum(np.searchsorted(tau, plan_t[wanted]), len(rows) - 1)
    before = np.maximum(after - 1, 0)
    _, unvisited = _on_segments(plan[wanted].T, rows[before].T, rows[after].T, norm)
    return float(max(off_plan, unvisited.max()))
