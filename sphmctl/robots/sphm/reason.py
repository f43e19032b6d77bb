"""Why a tool pose has no answer within the limits: one problem with joint, value and limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots import kr6
from sphmctl.robots.geometry import TURN
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FOREARM_LENGTH_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.chain import RANGES9, flange_target


def why_not(
    T: ArrayLike,
    wrist: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
    where: str = "",
) -> Problem | None:
    """What keeps one tool pose (4, 4) from being reached, or None when nothing does.

    Without `wrist` the cranks are taken at the middle of their range. Of several branches the one
    that misses by least is named. Values are degrees or mm, as the message says.
    """
    bounds = np.asarray(limits, dtype=np.float64)
    middle = bounds[6:].mean(axis=1)
    cranks = middle if wrist is None else np.asarray(wrist, dtype=np.float64)
    joints = np.concatenate([bounds[:6].mean(axis=1), cranks])
    if np.isnan(kr6.snap_to_range(joints, bounds)).any():
        return _beyond(joints, bounds, where)
    target = flange_target(T, cranks, tool, mount_yaw)
    branches = kr6.inverse(target)
    branches = branches[~np.isnan(branches[:, 0])]
    if len(branches) == 0:
        return _out_of_reach(target, where)
    # The turn nearest to the middle of a range is the one that misses it by least.
    arm = branches + TURN * np.round((bounds[:6].mean(axis=1) - branches) / TURN)
    excess = np.maximum(bounds[:6, 0] - arm, arm - bounds[:6, 1]).max(axis=1)
    best = np.concatenate([arm[np.argmin(excess)], cranks])
    if np.isnan(kr6.snap_to_range(best, bounds)).any():
        return _beyond(best, bounds, where)
    return None


def _beyond(joints: Floats, bounds: Floats, where: str) -> Problem:
    """The joint (of nine) that is furthest beyond its range."""
    low, high = bounds.T
    joint = int(np.argmax(np.maximum(low - joints, joints - high)))
    value, lowest, highest = np.degrees([joints[joint], low[joint], high[joint]])
    limit = lowest if value < lowest else highest
    name = JOINT_NAMES[joint]
    return Problem(
        where,
        name,
        float(value),
        float(limit),
        f"{name} would have to be {value:.3f} degrees; its range is {lowest:g} to {highest:g}",
    )


def _out_of_reach(target: Floats, where: str) -> Problem:
    """The arm's wrist centre is too far from axis 2, or too close to it."""
    x, y, z = kr6.wrist_centre(target)
    distance = np.hypot(np.hypot(x, y) - AXIS2_FORWARD_M, z - AXIS2_HEIGHT_M) * 1e3
    nearest = (UPPER_ARM_M - FOREARM_LENGTH_M) * 1e3
    furthest = (UPPER_ARM_M + FOREARM_LENGTH_M) * 1e3
    far = bool(distance > (nearest + furthest) / 2.0)
    limit = furthest if far else nearest
    return Problem(
        where,
        "",
        float(distance),
        float(limit),
        f"the arm's wrist centre would be {distance:.3f} mm from axis 2; the arm reaches from "
        f"{nearest:.3f} to {furthest:.3f} mm",
    )
