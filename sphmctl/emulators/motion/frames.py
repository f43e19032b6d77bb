"""Poses as a place in mm and a unit quaternion, and KUKA's X, Y, Z, A, B, C. Plain floats."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Pose = tuple[Vector, Quaternion]
Frame = tuple[float, float, float, float, float, float]
"""X, Y, Z in mm; A, B, C in degrees, turns about Z, Y', X''."""

NULL_FRAME: Frame = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)


def times(p: Quaternion, q: Quaternion) -> Quaternion:
    """The turn q, then p."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def reverse(q: Quaternion) -> Quaternion:
    """The opposite turn."""
    return q[0], -q[1], -q[2], -q[3]


def turned(q: Quaternion, v: Vector) -> Vector:
    """`v` turned by `q`: v + 2 w (u x v) + 2 u x (u x v)."""
    w, x, y, z = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def about(axis: Vector, angle_rad: float) -> Quaternion:
    """The turn by an angle about a unit vector."""
    s = math.sin(angle_rad / 2.0)
    return math.cos(angle_rad / 2.0), axis[0] * s, axis[1] * s, axis[2] * s


def axis_angle(q: Quaternion) -> tuple[Vector, float]:
    """Unit axis and angle, 0..pi; the axis of no turn is x."""
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    s = math.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    if s < 1e-12:
        return (1.0, 0.0, 0.0), 0.0
    return (q[1] / s, q[2] / s, q[3] / s), 2.0 * math.atan2(s, q[0])


def chained(a: Pose, b: Pose) -> Pose:
    """KRL's a : b."""
    return plus(a[0], turned(a[1], b[0])), times(a[1], b[1])


def inverted(a: Pose) -> Pose:
    """KRL's INV_POS."""
    back = reverse(a[1])
    x, y, z = turned(back, a[0])
    return (-x, -y, -z), back


def pose_of(frame: Frame) -> Pose:
    """From X, Y, Z, A, B, C: the turn is Rz(A) Ry(B) Rx(C)."""
    a, b, c = (math.radians(angle) for angle in frame[3:])
    turn = times(about((0, 0, 1), a), times(about((0, 1, 0), b), about((1, 0, 0), c)))
    return (frame[0], frame[1], frame[2]), turn


def frame_of(pose: Pose) -> Frame:
    """To X, Y, Z, A, B, C; at B = +-90 with A = 0, one of the many right answers."""
    x, y, z = (turned(pose[1], e) for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    level = math.hypot(x[0], x[1])
    b = math.atan2(-x[2], level)
    if level < 1e-9:
        a, c = 0.0, math.atan2(-z[1], y[1])
    else:
        a, c = math.atan2(x[1], x[0]), math.atan2(y[2], z[2])
    return (*pose[0], math.degrees(a), math.degrees(b), math.degrees(c))


def plus(u: Vector, v: Vector) -> Vector:
    """u + v."""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


def minus(u: Vector, v: Vector) -> Vector:
    """u - v."""
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def scaled(v: Vector, factor: float) -> Vector:
    """v times a number."""
    return v[0] * factor, v[1] * factor, v[2] * factor


def dot(u: Vector, v: Vector) -> float:
    """u . v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    """u x v."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def length(v: Vector) -> float:
    """|v|."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
