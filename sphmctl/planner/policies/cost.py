"""What `Auto` compares ways by: joint travel in the time it takes each joint, and closeness to
limits and singular poses. Never a reason to refuse.
"""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.legs import Setup
from sphmctl.robots.geometry import angle_between
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    FOREARM_ANGLE_RAD,
    FOREARM_M,
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)

REFERENCE_RAD = 0.1
"""Joints are compared by how long each needs for such a move from rest to rest: it takes axis 2
0.24 s, a crank 0.08 s, so that the wrist does what it can for axes 1 to 3."""

LEVER_M = 0.2
"""Of the tool about the arm's wrist centre, roughly: a turn of the tool counts as so long a way."""

SHORTEST_M = 1e-5
"""Rows closer together count as so far apart: standing still costs nothing, a jump very much."""

RANGE_MARGIN_RAD = float(np.radians(5.0))
ELBOW_MARGIN_RAD = float(np.radians(10.0))
A5_MARGIN_RAD = float(np.radians(5.0))
SHOULDER_MARGIN_M = 0.05
"""Where closeness begins to cost: to a joint's range, to the stretched arm, to A5 = 0, and of the
wrist centre to axis 1."""

CLOSENESS = 100.0
"""What standing on a limit or in a singular pose costs per metre of way: about as much as 4 rad of
axis 2 per metre."""

THROUGH_RAD = 1e-6
"""A passage of A5 = 0 this close is one through it: 0.3 um of the tool, and rounding of path files
that give degrees with six decimals."""

TINY = 1e-12
"""Keeps divisions apart from zero."""


def way(target: Floats, s_m: Floats) -> Floats:
    """How far each tool pose (n, 4, 4) at arc length s_m is along the way, turns included; (n,)."""
    turn = angle_between(target[:-1, :3, :3], target[1:, :3, :3])
    return np.concatenate([[0.0], np.cumsum(np.diff(s_m) + LEVER_M * turn)])


def seconds_per_rad(setup: Setup) -> Floats:
    """Weights (9,) of the joints: time for REFERENCE_RAD alone, from rest to rest, over it."""
    ramp_s = np.minimum(
        setup.speeds / setup.accelerations, np.sqrt(REFERENCE_RAD / setup.accelerations)
    )
    return np.asarray((1.0 / (ramp_s * setup.accelerations)) + ramp_s / REFERENCE_RAD)


def closeness(q: Floats, ranges: Floats) -> Floats:
    """Cost per metre (...) of standing close to limits and singular poses, joints (..., 9)."""
    a2, beta, a5 = q[..., 1], q[..., 1] + q[..., 2], q[..., 4]
    near = np.minimum(q - ranges[:, 0], ranges[:, 1] - q) / RANGE_MARGIN_RAD
    total = np.square(np.clip(1.0 - near, 0.0, 1.0)).sum(axis=-1)
    radius = (
        AXIS2_FORWARD_M
        + UPPER_ARM_M * np.cos(a2)
        + FOREARM_M * np.cos(beta)
        + FOREARM_OFFSET_M * np.sin(beta)
    )
    for distance in (
        np.abs(np.sin(a5)) / np.sin(A5_MARGIN_RAD),
        np.abs(np.sin(q[..., 2] - FOREARM_ANGLE_RAD)) / np.sin(ELBOW_MARGIN_RAD),
        np.abs(radius) / SHOULDER_MARGIN_M,
    ):
        total = total + np.square(np.clip(1.0 - distance, 0.0, 1.0))
    return np.asarray(CLOSENESS * total)


def swing(
    a: Floats, b: Floats, length_m: Floats, setup: Setup, through_rad: float = THROUGH_RAD
) -> Floats:
    """What A4 and A6 cost between joints (..., 9) and (..., 9) where they pass A5 = 0.

    Seen from the forearm the flange's axis stands at m = sin A5 (cos A4, sin A4). Where m passes
    zero at a distance d, A4 swings round by the angle u between both m as seen from zero; its
    square, integrated over the length l, is |b - a| / (l d) (u + sin u cos u) / 2 on either side of
    the closest point. A change of A5's sign is continuous only
    through zero itself, which counts as reached within `through_rad`.
    """
    (ax, ay), (bx, by) = aside(a), aside(b)
    x, y = bx - ax, by - ay
    span = np.maximum(np.hypot(x, y), TINY)
    before, after = -(ax * x + ay * y) / span, (bx * x + by * y) / span
    distance = np.maximum(np.abs(ax * by - ay * bx) / span, TINY)
    over = a[..., 4] * b[..., 4] < 0.0
    u1, u2 = np.arctan2(before, distance), np.arctan2(after, distance)
    integral = (u1 + u2 + np.sin(2.0 * u1) / 2.0 + np.sin(2.0 * u2) / 2.0) / 2.0
    weight = np.square(seconds_per_rad(setup)[[3, 5]]).sum()
    added = (
        weight
        * span
        / length_m
        * np.where((before > 0.0) & (after > 0.0), integral / distance, 0.0)
    )
    through = np.where(distance <= through_rad, 0.0, np.inf)
    return np.asarray(np.where(over, through, added))


def aside(q: Floats) -> Floats:
    """The flange's axis square to the forearm, (2, ...), for joints (..., 9)."""
    return np.asarray(np.sin(q[..., 4]) * np.stack([np.cos(q[..., 3]), np.sin(q[..., 3])]))


def along(q: Floats, way_m: Floats, setup: Setup) -> float:
    """Cost of joints (n, 9) at `way_m` (n,): squared weighted travel per metre, and closeness."""
    if len(q) < 2:
        return float(closeness(q, setup.ranges).sum())
    length = np.maximum(np.diff(way_m), SHORTEST_M)
    travel = np.square(np.diff(q, axis=0) * seconds_per_rad(setup)).sum(axis=1) / length
    near = closeness(q, setup.ranges)
    return float(travel.sum() + ((near[1:] + near[:-1]) / 2.0) @ length)
