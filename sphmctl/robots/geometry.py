"""Rotations and poses as arrays: KUKA's A, B, C to matrices and back, inverses, angles between.

Metres and radians; every function takes arrays with any leading dimensions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats

TURN = 2.0 * np.pi

# Below this cosine of B the angles A and C turn about one axis and only their sum or difference is
# real: 1e-10 lies far above the rounding of a matrix (1e-16) and far below any stated accuracy.
GIMBAL_COSINE = 1e-10


def wrap(angle_rad: ArrayLike) -> Floats:
    """The same angles within (-pi, pi]."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    wrapped = angle - TURN * np.round(angle / TURN)
    return np.where(wrapped <= -np.pi, np.pi, wrapped)


def abc_to_matrix(abc_rad: ArrayLike) -> Floats:
    """R = Rz(A) Ry(B) Rx(C), KUKA's Z-Y'-X'' order; (..., 3) -> (..., 3, 3)."""
    abc = np.asarray(abc_rad, dtype=np.float64)
    (ca, cb, cc), (sa, sb, sc) = np.moveaxis(np.cos(abc), -1, 0), np.moveaxis(np.sin(abc), -1, 0)
    R = np.empty((*abc.shape, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = (
        ca * cb,
        ca * sb * sc - sa * cc,
        ca * sb * cc + sa * sc,
    )
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = (
        sa * cb,
        sa * sb * sc + ca * cc,
        sa * sb * cc - ca * sc,
    )
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = -sb, cb * sc, cb * cc
    return R


def matrix_to_abc(R: ArrayLike) -> Floats:
    """A, B, C of a rotation (..., 3, 3), with B within +-90 degrees; at B = +-90, C is 0."""
    R = np.asarray(R, dtype=np.float64)
    cosine_b = np.hypot(R[..., 0, 0], R[..., 1, 0])
    gimbal = cosine_b < GIMBAL_COSINE
    a = np.where(
        gimbal,
        np.arctan2(-R[..., 0, 1], R[..., 1, 1]),
        np.arctan2(R[..., 1, 0], R[..., 0, 0]),
    )
    b = np.arctan2(-R[..., 2, 0], cosine_b)
    # C is read off after turning back by A, so that the product stays exact close to the gimbal.
    ca, sa = np.cos(a), np.sin(a)
    c = np.arctan2(
        sa * R[..., 0, 2] - ca * R[..., 1, 2],
        ca * R[..., 1, 1] - sa * R[..., 0, 1],
    )
    return np.stack([a, b, np.where(gimbal, 0.0, c)], axis=-1) + 0.0  # + 0.0 turns -0.0 into 0.0


def pose_matrix(xyz_m: ArrayLike, abc_rad: ArrayLike) -> Floats:
    """Homogeneous pose from a position (..., 3), m, and KUKA's A, B, C (..., 3), rad."""
    xyz = np.asarray(xyz_m, dtype=np.float64)
    return from_parts(abc_to_matrix(abc_rad), xyz)


def from_parts(R: Floats, p_m: Floats) -> Floats:
    """Homogeneous pose (..., 4, 4) from a rotation (..., 3, 3) and a position (..., 3)."""
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], p_m.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p_m
    T[..., 3, 3] = 1.0
    return T


def invert(T: ArrayLike) -> Floats:
    """The inverse of rigid poses (..., 4, 4)."""
    T = np.asarray(T, dtype=np.float64)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    return from_parts(Rt, -(Rt @ T[..., :3, 3:])[..., 0])


def angle_between(R1: ArrayLike, R2: ArrayLike) -> Floats:
    """The angle, 0 to pi, of the one rotation that takes R1 to R2; accurate for tiny angles too."""
    D = np.swapaxes(np.asarray(R1, dtype=np.float64), -1, -2) @ np.asarray(R2, dtype=np.float64)
    twice_sine = np.sqrt(
        (D[..., 2, 1] - D[..., 1, 2]) ** 2
        + (D[..., 0, 2] - D[..., 2, 0]) ** 2
        + (D[..., 1, 0] - D[..., 0, 1]) ** 2
    )
    return np.asarray(np.arctan2(twice_sine, np.trace(D, axis1=-2, axis2=-1) - 1.0))
