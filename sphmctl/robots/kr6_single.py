"""The arm's closed-form inverse for one pose, in plain floats: numpy costs ten times as much there.

The formulas are those of `kr6`, where they are explained; the tests hold the two together.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, nan, pi, sin, sqrt

from sphmctl.robots.kr6_model import (
    A2_MIDDLE_RAD,
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_ANGLE_RAD,
    FOREARM_LENGTH_M,
    REACH_TOLERANCE_M,
    SHOULDER_RADIUS_M,
    SINGULAR_SINE,
    UPPER_ARM_M,
)

Joints = tuple[float, float, float, float, float, float]

TURN = 2.0 * pi
A2_LOW, A2_HIGH = A2_MIDDLE_RAD - pi, A2_MIDDLE_RAD + pi
ARM_SUM_M, ARM_DIFFERENCE_M = UPPER_ARM_M + FOREARM_LENGTH_M, UPPER_ARM_M - FOREARM_LENGTH_M
UNREACHABLE: Joints = (nan, nan, nan, nan, nan, nan)


def inverse(T: Sequence[Sequence[float]], near: Sequence[float] | None) -> list[Joints]:
    """The eight branches of one flange pose (4 x 4, m), in the order of `kr6.inverse`."""
    (xx, yx, zx, px), (xy, yy, zy, py), (xz, yz, zz, pz), _ = T
    px, py, pz = px - FLANGE_M * zx, py - FLANGE_M * zy, pz - FLANGE_M * zz
    near_a1, near_a4 = (near[0], near[3]) if near is not None else (0.0, 0.0)
    radius = hypot(px, py)
    facing = near_a1 if radius < SHOULDER_RADIUS_M else -atan2(py, px)
    c1, s1 = cos(facing), sin(facing)
    # The flange's axes turned back by A1: level (along the arm) and across.
    xl, yl, zl = c1 * xx - s1 * xy, c1 * yx - s1 * yy, c1 * zx - s1 * zy
    xa, ya, za = s1 * xx + c1 * xy, s1 * yx + c1 * yy, s1 * zx + c1 * zy
    away = facing - pi if facing > 0.0 else facing + pi
    out: list[Joints] = []
    for a1, side in ((facing, 1.0), (away, -1.0)):
        x, h = side * radius - AXIS2_FORWARD_M, pz - AXIS2_HEIGHT_M
        distance = hypot(x, h)
        beyond, inside = ARM_SUM_M - distance, distance - ARM_DIFFERENCE_M
        if not (beyond >= -REACH_TOLERANCE_M and inside >= -REACH_TOLERANCE_M):
            out += [UNREACHABLE] * 4
            continue
        bend = 2.0 * atan2(
            sqrt(max(beyond, 0.0) * (ARM_SUM_M + distance)),
            sqrt(max(inside, 0.0) * (distance + ARM_DIFFERENCE_M)),
        )
        to_centre = atan2(h, x)
        lead = atan2(FOREARM_LENGTH_M * sin(bend), UPPER_ARM_M + FOREARM_LENGTH_M * cos(bend))
        for psi, elbow in ((bend, lead), (-bend, -lead)):
            a3 = FOREARM_ANGLE_RAD + psi
            a2 = -to_centre - elbow
            if a2 <= A2_LOW:
                a2 += TURN
            elif a2 > A2_HIGH:
                a2 -= TURN
            cb, sb = cos(a2 + a3), sin(a2 + a3)
            up = cb * side
            down = sb * side
            m10, m20 = side * za, down * zl + cb * zz
            sine = hypot(m10, m20)
            if sine < SINGULAR_SINE:
                c4, s4 = cos(near_a4), sin(near_a4)
            else:
                c4, s4 = -m20 / sine, -m10 / sine
            a4 = atan2(s4, c4)
            a5 = atan2(-s4 * m10 - c4 * m20, up * zl - sb * zz)
            a6 = atan2(
                s4 * (down * xl + cb * xz) - c4 * side * xa,
                c4 * side * ya - s4 * (down * yl + cb * yz),
            )
            a4 = pi if a4 == -pi else a4
            a6 = pi if a6 == -pi else a6
            out.append((a1, a2, a3, a4, a5, a6))
            flip4 = a4 - pi if a4 > 0.0 else a4 + pi
            flip6 = a6 - pi if a6 > 0.0 else a6 + pi
            out.append(
                (a1, a2, a3, flip4 if flip4 > -pi else pi, -a5, flip6 if flip6 > -pi else pi)
            )
    return out
