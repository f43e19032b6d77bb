"""The machine a second time, from the paper alone, to test the command line against.

Elsamanty et al., Appl. Sci. 2023, 13, 2088: the arm as the product of its D-H table, the wrist by
its constraint equations (tilt without torsion, and the platform's shift). Shares nothing with the
package. Millimetres and degrees.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

# a, d, alpha of the six joints. Its theta1 is 180 - A1, theta2 is A2 - 90 and stands in the table
# with 90 added, theta3 is A3 - 90; the others are A4, A5, A6.
DH = (
    (-25.0, 400.0, 90.0),
    (-455.0, 0.0, 0.0),
    (-35.0, 0.0, -90.0),
    (0.0, -420.0, 90.0),
    (0.0, 0.0, -90.0),
    (0.0, -99.0, 180.0),
)
PLATFORM_MM = 56.0
CRANK_MM, COUPLER_MM = 25.0, 61.0


def rotation(axis: str, angle_deg: float) -> Matrix:
    """A rotation about x, y or z, as 4 x 4."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    R = np.eye(4)
    R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
    return R


def shift(x: float, y: float, z: float) -> Matrix:
    """A translation."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def wrist_base(joints_deg: list[float]) -> Matrix:
    """The wrist's base plane O6 in the arm's base, by the D-H table."""
    a1, a2, a3, a4, a5, a6 = joints_deg[:6]
    T = np.eye(4)
    for (a, d, alpha), theta in zip(DH, (180.0 - a1, a2, a3 - 90.0, a4, a5, a6), strict=True):
        T = T @ rotation("z", theta) @ shift(a, 0.0, d) @ rotation("x", alpha)
    return T


def platform(heave_mm: float, tilt_deg: float, direction_deg: float) -> Matrix:
    """The platform on the wrist's base plane: tilt without torsion, and the shift it brings."""
    R = rotation("z", direction_deg) @ rotation("y", tilt_deg) @ rotation("z", -direction_deg)
    x = PLATFORM_MM * (R[0, 0] - R[1, 1]) / 2.0
    return shift(x, -PLATFORM_MM * R[1, 0], heave_mm) @ R


def coupler_lengths(T: Matrix, cranks_deg: list[float]) -> list[float]:
    """How long the three couplers would have to be between crank ends and platform."""
    lengths = []
    for leg, crank in enumerate(cranks_deg):
        ball = T @ rotation("z", 120.0 * leg) @ np.array([PLATFORM_MM, 0.0, 0.0, 1.0])
        out = CRANK_MM * math.sin(math.radians(crank))
        up = CRANK_MM * math.cos(math.radians(crank))
        end = rotation("z", 120.0 * leg) @ np.array([PLATFORM_MM + out, 0.0, up, 1.0])
        lengths.append(float(np.linalg.norm(ball - end)))
    return lengths


def abc_rotation(a_deg: float, b_deg: float, c_deg: float) -> Matrix:
    """KUKA's A, B, C: Rz(A) Ry(B) Rx(C)."""
    return rotation("z", a_deg) @ rotation("y", b_deg) @ rotation("x", c_deg)
