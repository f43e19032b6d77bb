"""Flange from axes and axes from flange of the KR 6 R900 sixx, in closed form and plain floats.

Lengths and axis directions: kuka_kr6_support/urdf/kr6r900sixx_macro.xacro of
ros-industrial/kuka_experimental, from KUKA's "Spez KR AGILUS sixx V12".
"""

from __future__ import annotations

import math

from sphmctl.emulators.motion.figures import RANGE_DEG, Joints
from sphmctl.emulators.motion.frames import (
    Frame,
    Pose,
    Quaternion,
    Vector,
    chained,
    inverted,
    pose_of,
    times,
    turned,
)

SHOULDER_MM, HEIGHT_MM = 25.0, 400.0
UPPER_MM = 455.0
FOREARM_MM, FOREARM_UP_MM = 420.0, 35.0
FLANGE_MM = 80.0

REACH_MM = math.hypot(FOREARM_MM, FOREARM_UP_MM)
BEND = math.atan2(FOREARM_UP_MM, FOREARM_MM)
"""A3 (rad) at which the wrist's centre is in line with A2 and A3."""

REACH_SLACK = 1e-9
"""By which the elbow's cosine may pass 1: rounding at the stretched arm."""

SINGULAR = 1e-9
"""sin(A5) below which A4 and A6 are the same axis."""

OUTWARD: Quaternion = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
"""Ry(90): the flange's Z points away from the arm."""


def forward(joints_deg: Joints) -> Pose:
    """The flange on the robot's base."""
    a1, a2, a3, a4, a5, a6 = (math.radians(q) / 2.0 for q in joints_deg)
    pitch = a2 + a3
    c1, s1, cp, sp = math.cos(a1), -math.sin(a1), math.cos(pitch), math.sin(pitch)
    # Rz(-A1) Ry(A2 + A3), then the wrist's Rx(-A4) Ry(A5) Rx(-A6).
    arm = (c1 * cp, -s1 * sp, c1 * sp, s1 * cp)
    c4, s4, c5, s5 = math.cos(a4), -math.sin(a4), math.cos(a5), math.sin(a5)
    wrist = times((c4 * c5, s4 * c5, c4 * s5, s4 * s5), (math.cos(a6), -math.sin(a6), 0.0, 0.0))
    turn = times(arm, times(wrist, OUTWARD))
    cosine, sine = math.cos(2 * pitch), math.sin(2 * pitch)
    way = SHOULDER_MM + UPPER_MM * math.cos(2 * a2) + FOREARM_MM * cosine + FOREARM_UP_MM * sine
    up = HEIGHT_MM - UPPER_MM * math.sin(2 * a2) - FOREARM_MM * sine + FOREARM_UP_MM * cosine
    x, y, z = turned(turn, (0.0, 0.0, FLANGE_MM))
    return (way * (c1 * c1 - s1 * s1) + x, way * 2 * c1 * s1 + y, up + z), turn


def status_and_turn(joints_deg: Joints) -> tuple[int, int]:
    """S and T of a POS (KUKA system integrators' manual, "Status and Turn").

    S: bit 0 the wrist's centre behind A1, bit 1 the elbow's branch, bit 2 A5 negative.
    T: one bit for each negative axis angle.
    """
    shoulder, pitch = math.radians(joints_deg[1]), math.radians(joints_deg[1] + joints_deg[2])
    way = SHOULDER_MM + UPPER_MM * math.cos(shoulder)
    way += FOREARM_MM * math.cos(pitch) + FOREARM_UP_MM * math.sin(pitch)
    elbow = math.radians(joints_deg[2]) >= BEND
    status = int(way < 0.0) | int(elbow) << 1 | int(joints_deg[4] < 0.0) << 2
    return status, sum(1 << axis for axis in range(6) if joints_deg[axis] < 0.0)


def inverse(
    flange: Pose, status: int, near_deg: Joints, wrist: bool | None = None
) -> Joints | None:
    """The axes for a flange pose; None where the arm does not reach.

    Args:
        flange: on the robot's base.
        status: S of a POS: bit 0 rear, bit 1 the elbow's branch, bit 2 A5 negative.
        near_deg: full turns of A4 and A6 are chosen nearest to these axes.
        wrist: True: A5's sign by `near_deg`, not by `status`.
    """
    (px, py, pz), (w, i, j, k) = flange
    zx, zy, zz = 2 * (i * k + w * j), 2 * (j * k - w * i), 1 - 2 * (i * i + j * j)
    cx, cy, up = px - FLANGE_MM * zx, py - FLANGE_MM * zy, pz - FLANGE_MM * zz - HEIGHT_MM
    side = -1.0 if status & 1 else 1.0
    yaw = math.atan2(side * cy, side * cx)
    way = side * math.hypot(cx, cy) - SHOULDER_MM
    cosine = (way * way + up * up - UPPER_MM**2 - REACH_MM**2) / (2.0 * UPPER_MM * REACH_MM)
    if abs(cosine) > 1.0 + REACH_SLACK:
        return None
    elbow = math.acos(max(-1.0, min(1.0, cosine))) * (-1.0 if status & 2 else 1.0)
    a2 = math.atan2(REACH_MM * math.sin(elbow), UPPER_MM + REACH_MM * math.cos(elbow))
    a2 -= math.atan2(up, way)
    a3 = BEND - elbow
    c1, s1, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(a2 + a3), math.sin(a2 + a3)
    # Columns of the turn before the wrist, against the flange's: Rx(-A4) Ry(A5) Rx(-A6).
    along, out, down = zx * c1 * cp + zy * s1 * cp - zz * sp, zy * c1 - zx * s1, 0.0
    down = zx * c1 * sp + zy * s1 * sp + zz * cp
    yx, yy, yz = 2 * (i * j - w * k), 1 - 2 * (i * i + k * k), 2 * (j * k + w * i)
    tilt = math.hypot(out, down)
    if tilt < SINGULAR:
        turn = math.atan2(yx * c1 * sp + yy * s1 * sp + yz * cp, yy * c1 - yx * s1)
        ends = (math.degrees(-yaw), math.degrees(a2), math.degrees(a3))
        return _arm(ends, (near_deg[3], 0.0, math.degrees(-turn) - near_deg[3]), near_deg)
    xx, xy, xz = 1 - 2 * (j * j + k * k), 2 * (i * j + w * k), 2 * (i * k - w * j)
    a4 = -math.degrees(math.atan2(out, -down))
    a5 = math.degrees(math.atan2(tilt, along))
    a6 = -math.degrees(
        math.atan2(yx * c1 * cp + yy * s1 * cp - yz * sp, -(xx * c1 * cp + xy * s1 * cp - xz * sp))
    )
    ends = (math.degrees(-yaw), math.degrees(a2), math.degrees(a3))
    straight = _arm(ends, (a4, a5, a6), near_deg)
    flipped = _arm(ends, (a4 + 180.0, -a5, a6 + 180.0), near_deg)
    if wrist is None:
        return flipped if status & 4 else straight
    return min(straight, flipped, key=lambda q: _apart(q, near_deg))


def _arm(ends: Vector, wrist: Vector, near_deg: Joints) -> Joints:
    a4 = wrist[0] + 360.0 * round((near_deg[3] - wrist[0]) / 360.0)
    a6 = wrist[2] + 360.0 * round((near_deg[5] - wrist[2]) / 360.0)
    a2 = ends[1] + 360.0 * round((near_deg[1] - ends[1]) / 360.0)
    return ends[0], a2, ends[2], a4, wrist[1], a6


def _apart(q: Joints, near_deg: Joints) -> float:
    return abs(q[3] - near_deg[3]) + abs(q[4] - near_deg[4]) + abs(q[5] - near_deg[5])


def tool_centre(joints_deg: Joints, tool: Frame) -> Pose:
    """The tool's frame on the robot's base."""
    return chained(forward(joints_deg), pose_of(tool))


def axes_of(
    target: Frame,
    tool: Frame,
    base: Frame,
    near_deg: Joints,
    status: int | None = None,
    turn: int | None = None,
) -> Joints | None:
    """The axes of a POS, as PTP needs them; None where the arm does not reach.

    Args:
        target: of the tool in `base`.
        tool: on the flange.
        base: on the robot's base.
        near_deg: the point before: without S its status is kept, without T the shortest way
            is taken.
        status: S, see `status_and_turn`.
        turn: T: bit n set for a negative axis n + 1; ignored where that
            is outside the software limits.
    """
    flange = chained(chained(pose_of(base), pose_of(target)), inverted(pose_of(tool)))
    kept = status_and_turn(near_deg)[0] if status is None else status
    joints_deg = inverse(flange, kept, near_deg)
    if joints_deg is None or turn is None:
        return joints_deg
    wanted = list(joints_deg)
    for axis in (3, 5):
        if (wanted[axis] < 0.0) != bool(turn >> axis & 1):
            other = wanted[axis] % 360.0 - 360.0 * (turn >> axis & 1)
            if RANGE_DEG[axis][0] <= other <= RANGE_DEG[axis][1]:
                wanted[axis] = other
    return tuple(wanted)
