"""Steps that would be too fast are shortened: a path's axes, and T1's 250 mm/s."""

from __future__ import annotations

from sphmctl.emulators.motion.contours import ToolPath
from sphmctl.emulators.motion.figures import SAFE_SPEED_MM_S, SPEED_DEG_S, STEP_S, Joints, Options
from sphmctl.emulators.motion.frames import Frame, Pose, length, minus, plus, turned
from sphmctl.emulators.motion.kinematics import forward
from sphmctl.emulators.motion.run import Run, joints_at

ROUNDING = 1.0 + 1e-7

ATTEMPTS = 12
"""To shorten a step; each is exact but for the path's curvature, great at a singularity."""


def fitting_step(
    run: Run, ahead_s: float, near_deg: Joints, reduced: bool
) -> tuple[float, Joints, int | None]:
    """The step's own time, shortened where limits ask; the axes after it; the axis too fast.

    Args:
        run: where the arm is.
        ahead_s: own time that the step would take.
        near_deg: the axes before it.
        reduced: whether flange and tool centre keep T1's limit.
    """
    joints_deg = joints_at(run, run.t_s + ahead_s, near_deg)
    path = isinstance(run.contour, ToolPath) or (
        run.follower is not None and isinstance(run.follower.contour, ToolPath)
    )
    slowed: int | None = None
    if not path and not reduced:
        return ahead_s, joints_deg, slowed
    here = forward(near_deg) if reduced else None
    for _ in range(ATTEMPTS):
        factor, axis = _fastest_axis(near_deg, joints_deg) if path else (0.0, 0)
        if factor > ROUNDING:
            slowed = axis
        if here is not None:
            factor = max(factor, _reduced_speed_factor(here, joints_deg, run.tool))
        if factor <= ROUNDING:
            break
        ahead_s /= factor
        joints_deg = joints_at(run, run.t_s + ahead_s, near_deg)
    return ahead_s, joints_deg, slowed


def coasted(joints_deg: Joints, speed_deg_s: Joints, options: Options) -> tuple[Joints, Joints]:
    """Axes and speeds one step later in a STOP 0: each axis brakes by itself."""
    after: list[float] = []
    for v, a, share in zip(
        speed_deg_s, options.acceleration_deg_s2, options.coast_percent, strict=True
    ):
        left = max(0.0, abs(v) - a * share / 100.0 * STEP_S)
        after.append(left if v > 0.0 else -left)
    way = [(v + w) / 2.0 * STEP_S for v, w in zip(speed_deg_s, after, strict=True)]
    return tuple([q + d for q, d in zip(joints_deg, way, strict=True)]), tuple(after)


def _fastest_axis(before_deg: Joints, after_deg: Joints) -> tuple[float, int]:
    """The greatest axis speed as a multiple of the machine's, and its axis (from 0)."""
    worst, which = 0.0, 0
    for axis in range(6):
        factor = abs(after_deg[axis] - before_deg[axis]) / (SPEED_DEG_S[axis] * STEP_S)
        if factor > worst:
            worst, which = factor, axis
    return worst, which


def _reduced_speed_factor(before: Pose, after_deg: Joints, tool: Frame) -> float:
    """Speed of flange and tool centre since the flange `before`, over T1's limit."""
    after = forward(after_deg)
    centre = (tool[0], tool[1], tool[2])
    flange_mm = length(minus(after[0], before[0]))
    tool_mm = length(
        minus(plus(after[0], turned(after[1], centre)), plus(before[0], turned(before[1], centre)))
    )
    return max(flange_mm, tool_mm) / (SAFE_SPEED_MM_S * STEP_S)
