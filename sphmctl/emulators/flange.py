"""Where the KR 6 R900 sixx's flange is, as `$POS_ACT` says it with `$TOOL` and `$BASE` null.

Lengths and axis directions: kuka_kr6_support/urdf/kr6r900sixx_macro.xacro of
ros-industrial/kuka_experimental, from KUKA's "Spez KR AGILUS sixx V12".
"""

from __future__ import annotations

import math

Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
Vector = tuple[float, float, float]

CHAIN: tuple[tuple[Vector, str, int], ...] = (
    ((0.0, 0.0, 400.0), "z", -1),
    ((25.0, 0.0, 0.0), "y", 1),
    ((455.0, 0.0, 0.0), "y", 1),
    ((0.0, 0.0, 35.0), "x", -1),
    ((420.0, 0.0, 0.0), "y", 1),
    ((80.0, 0.0, 0.0), "x", -1),
)
"""For each joint: offset from the previous joint, mm, its axis, and the sign of KUKA's angle."""

WRIST_LINK = 5
"""The wrist's centre is the origin of the fifth joint's frame, where A4, A5 and A6 meet."""

ELBOW_STRETCHED_DEG = math.degrees(math.atan2(35.0, 420.0))
"""A3 at which the wrist's centre is in line with A2 and A3: there the elbow's branch changes."""


def flange_pose(joints_deg: tuple[float, ...]) -> tuple[float, float, float, float, float, float]:
    """X, Y, Z in mm and KUKA's A, B, C (Z-Y'-X'') in degrees of the flange on the robot's base."""
    position, turn, _ = _forward(joints_deg)
    a = math.atan2(turn[1][0], turn[0][0])
    b = math.atan2(-turn[2][0], math.hypot(turn[0][0], turn[1][0]))
    c = math.atan2(turn[2][1], turn[2][2])
    if math.hypot(turn[0][0], turn[1][0]) < 1e-9:
        # B = +-90: only a sum of A and C is there; A = 0 is one of the many right answers.
        a, c = 0.0, math.atan2(-turn[1][2], turn[1][1])
    return (*position, math.degrees(a), math.degrees(b), math.degrees(c))


def status_and_turn(joints_deg: tuple[float, ...]) -> tuple[int, int]:
    """S and T of a POS (KUKA system integrators' manual, "Status and Turn").

    S: bit 0 the wrist's centre behind A1, bit 1 the elbow's branch, bit 2 A5 negative.
    T: one bit for each negative axis angle.
    """
    _, _, wrist = _forward(joints_deg)
    a1 = math.radians(-joints_deg[0])
    behind = wrist[0] * math.cos(a1) + wrist[1] * math.sin(a1) < 0.0
    elbow = joints_deg[2] >= ELBOW_STRETCHED_DEG
    status = int(behind) | int(elbow) << 1 | int(joints_deg[4] < 0.0) << 2
    return status, sum(1 << axis for axis in range(6) if joints_deg[axis] < 0.0)


def _forward(joints_deg: tuple[float, ...]) -> tuple[Vector, Matrix, Vector]:
    position: Vector = (0.0, 0.0, 0.0)
    turn: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    wrist = position
    for link, (offset, axis, sign) in enumerate(CHAIN, start=1):
        position = _add(position, _turned(turn, offset))
        if link == WRIST_LINK:
            wrist = position
        turn = _product(turn, _rotation(axis, math.radians(sign * joints_deg[link - 1])))
    # The flange's Z points away from the arm.
    return position, _product(turn, _rotation("y", math.pi / 2)), wrist


def _rotation(axis: str, angle: float) -> Matrix:
    c, s = math.cos(angle), math.sin(angle)
    if axis == "x":
        return ((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c))
    if axis == "y":
        return ((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


def _turned(m: Matrix, v: Vector) -> Vector:
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in m)
    return x, y, z


def _add(u: Vector, v: Vector) -> Vector:
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


def _product(m: Matrix, n: Matrix) -> Matrix:
    columns = [_turned(m, (n[0][k], n[1][k], n[2][k])) for k in range(3)]
    x, y, z = ((columns[0][row], columns[1][row], columns[2][row]) for row in range(3))
    return x, y, z
