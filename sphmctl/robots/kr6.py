"""KUKA KR 6 R900 sixx: forward kinematics, and the closed-form inverse with all its branches.

Metres and radians. Joints are KUKA's axis angles A1..A6; the flange frame has z outward, and
poses are those of the flange in the arm's base frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import kr6_single
from sphmctl.robots.geometry import TURN
from sphmctl.robots.kr6_model import (
    A2_MIDDLE_RAD,
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_ANGLE_RAD,
    FOREARM_LENGTH_M,
    FOREARM_M,
    FOREARM_OFFSET_M,
    MAX_ACCELERATION,
    MAX_SPEED,
    RANGE_TOLERANCE_RAD,
    RANGES,
    REACH_TOLERANCE_M,
    SHOULDER_RADIUS_M,
    SINGULAR_SINE,
    UPPER_ARM_M,
)

__all__ = [
    "MAX_ACCELERATION",
    "MAX_SPEED",
    "RANGES",
    "forward",
    "inverse",
    "inverse_in_range",
    "snap_to_range",
    "wrist_centre",
]

BLOCK = 2048  # poses per piece: the work arrays then stay in the processor's cache
SIDE: Floats = np.array([1.0, -1.0])[:, None, None]  # facing the point, turned away from it
# Whole turns of A4 and of A6 that the ranges may hold beside the principal angle.
TURNS: Floats = TURN * np.array([0.0, -1.0, 1.0])


def forward(q: ArrayLike) -> Floats:
    """Flange poses (..., 4, 4) of axis angles (..., 6).

    R = Rz(-A1) Ry(A2 + A3) Rx(-A4) Ry(A5) Rx(-A6) Ry(90 deg); axes and lengths as in the URDF that
    `kr6_model` names, which is the paper's D-H table with theta1 = 180 deg - A1,
    theta2 = A2 - 90 deg, theta3 = A3 - 90 deg.
    """
    q = np.asarray(q, dtype=np.float64)
    if q.shape[-1:] != (6,):
        raise InvalidError(f"arm joints have shape {q.shape}; the last dimension must be 6")
    a1, a2, a3, a4, a5, a6 = np.moveaxis(q, -1, 0)
    c1, s1, cb, sb = np.cos(a1), np.sin(a1), np.cos(a2 + a3), np.sin(a2 + a3)
    c4, s4, c5, s5, c6, s6 = np.cos(a4), np.sin(a4), np.cos(a5), np.sin(a5), np.cos(a6), np.sin(a6)
    # The flange's x, y and z seen from the forearm.
    columns = (
        (-s5 * c6, -c4 * s6 - s4 * c5 * c6, s4 * s6 - c4 * c5 * c6),
        (-s5 * s6, c4 * c6 - s4 * c5 * s6, -s4 * c6 - c4 * c5 * s6),
        (c5, -s4 * s5, -c4 * s5),
    )
    T = np.zeros((*q.shape[:-1], 4, 4))
    for j, (x, y, z) in enumerate(columns):
        level = cb * x + sb * z
        T[..., 0, j] = c1 * level + s1 * y
        T[..., 1, j] = c1 * y - s1 * level
        T[..., 2, j] = cb * z - sb * x
    radius = AXIS2_FORWARD_M + UPPER_ARM_M * np.cos(a2) + FOREARM_M * cb + FOREARM_OFFSET_M * sb
    height = AXIS2_HEIGHT_M - UPPER_ARM_M * np.sin(a2) - FOREARM_M * sb + FOREARM_OFFSET_M * cb
    T[..., 0, 3] = c1 * radius + FLANGE_M * T[..., 0, 2]
    T[..., 1, 3] = -s1 * radius + FLANGE_M * T[..., 1, 2]
    T[..., 2, 3] = height + FLANGE_M * T[..., 2, 2]
    T[..., 3, 3] = 1.0
    return np.asarray(T + 0.0)  # + 0.0 turns -0.0 into 0.0, for whoever prints it


def wrist_centre(T: ArrayLike) -> Floats:
    """Where axes 4, 5 and 6 meet, (..., 3) m, for flange poses (..., 4, 4)."""
    T = np.asarray(T, dtype=np.float64)
    return np.asarray(T[..., :3, 3] - FLANGE_M * T[..., :3, 2])


def inverse(T: ArrayLike, near: ArrayLike | None = None) -> Floats:
    """All eight branches of the closed-form inverse; ranges are not applied.

    Branches count up as shoulder (facing the point, turned away from it) x elbow (up, down) x wrist
    (A5 >= 0, A5 <= 0). A4 and A6 lie within (-pi, pi], A2 within half a turn of the middle of its
    range. Where A5 = 0 only the sum of A4 and A6 is real: A4 is then that of `near`, or 0, and A6
    takes the rest. With the wrist centre on axis 1, A1 is that of `near`, or 0.

    Args:
        T: flange poses, (..., 4, 4).
        near: axis angles that settle what a singular pose leaves open, broadcast to (..., 6).

    Returns:
        (..., 8, 6); NaN where the wrist centre is out of reach by more than REACH_TOLERANCE_M.
    """
    T = np.asarray(T, dtype=np.float64)
    if T.shape[-2:] != (4, 4):
        raise InvalidError(f"flange poses have shape {T.shape}; the last dimensions must be 4 x 4")
    if T.ndim == 2:
        hint = None if near is None else np.asarray(near, dtype=np.float64).tolist()
        return np.array(kr6_single.inverse(T.tolist(), hint))
    flat = T.reshape(-1, 4, 4)
    hints = np.zeros(6) if near is None else np.asarray(near, dtype=np.float64)
    hints = np.broadcast_to(hints, (*T.shape[:-2], 6)).reshape(-1, 6)
    out = np.empty((len(flat), 8, 6))
    with np.errstate(invalid="ignore"):
        for i in range(0, len(flat), BLOCK):
            out[i : i + BLOCK] = _branches(flat[i : i + BLOCK], hints[i : i + BLOCK])
    return out.reshape(*T.shape[:-2], 8, 6)


def _branches(T: Floats, near: Floats) -> Floats:
    """The branches (n, 8, 6) of poses (n, 4, 4); inside, axes are shoulder, elbow, wrist, pose."""
    xyz = np.ascontiguousarray(T[:, :3, :].transpose(2, 1, 0))  # flange x, y, z, p; component; pose
    px, py, pz = xyz[3] - FLANGE_M * xyz[2]
    radius = np.hypot(px, py)
    facing = np.where(radius < SHOULDER_RADIUS_M, near[:, 0], -np.arctan2(py, px))
    c1, s1 = np.cos(facing), np.sin(facing)
    a2, a3 = _upper_joints(SIDE * radius - AXIS2_FORWARD_M, pz - AXIS2_HEIGHT_M)
    # The flange's axes turned back by A1, then by A2 + A3: what the wrist has to do.
    level = SIDE * (c1 * xyz[:3, 0] - s1 * xyz[:3, 1])[:, None, None]
    across = SIDE * (s1 * xyz[:3, 0] + c1 * xyz[:3, 1])[:, None, None]
    cb, sb = np.cos(a2 + a3), np.sin(a2 + a3)
    down = sb * level + cb * xyz[:3, 2][:, None, None]
    along = cb * level[2] - sb * xyz[2, 2]
    a4, a5, a6 = _wrist_joints(across, down, along, near[:, 3])

    out = np.empty((6, 2, 2, 2, len(T)))
    out[0, 0] = np.where(np.isnan(a3[0]), np.nan, facing)[:, None]
    away = np.where(facing > 0.0, facing - np.pi, facing + np.pi)
    out[0, 1] = np.where(np.isnan(a3[1]), np.nan, away)[:, None]
    out[1], out[2] = a2[:, :, None], a3[:, :, None]
    out[3, :, :, 0], out[3, :, :, 1] = a4, np.where(a4 > 0.0, a4 - np.pi, a4 + np.pi)
    out[4, :, :, 0], out[4, :, :, 1] = a5, -a5
    out[5, :, :, 0], out[5, :, :, 1] = a6, np.where(a6 > 0.0, a6 - np.pi, a6 + np.pi)
    wrapped = out[3::2]
    wrapped[wrapped == -np.pi] = np.pi
    return out.reshape(6, 8, -1).transpose(2, 1, 0)


def _upper_joints(x_m: Floats, h_m: Floats) -> tuple[Floats, Floats]:
    """A2 and A3, each (2, 2, n), that bring the wrist centre to x, h, seen from axis 2.

    The angle between upper arm and forearm is taken by its half angle, which keeps its precision
    where the arm is stretched.
    """
    distance = np.hypot(x_m, h_m)
    beyond = UPPER_ARM_M + FOREARM_LENGTH_M - distance
    inside = distance - (UPPER_ARM_M - FOREARM_LENGTH_M)
    reachable = (beyond >= -REACH_TOLERANCE_M) & (inside >= -REACH_TOLERANCE_M)
    opposite = np.maximum(beyond, 0.0) * (UPPER_ARM_M + FOREARM_LENGTH_M + distance)
    adjacent = np.maximum(inside, 0.0) * (distance + UPPER_ARM_M - FOREARM_LENGTH_M)
    bend = np.where(reachable, 2.0 * np.arctan2(np.sqrt(opposite), np.sqrt(adjacent)), np.nan)
    lead = np.arctan2(
        FOREARM_LENGTH_M * np.sin(bend), UPPER_ARM_M + FOREARM_LENGTH_M * np.cos(bend)
    )
    up_down = np.array([1.0, -1.0])[:, None]
    a2 = -np.arctan2(h_m, x_m) - up_down * lead
    a2 -= TURN * np.round((a2 - A2_MIDDLE_RAD) / TURN)
    return a2, FOREARM_ANGLE_RAD + up_down * bend


def _wrist_joints(
    across: Floats, down: Floats, along: Floats, near_a4: Floats
) -> tuple[Floats, Floats, Floats]:
    """A4, A5 >= 0 and A6 from the flange's axes as the forearm sees them.

    A6 is read off after turning back by A4, so that pose and joints agree however noisy A4 is.
    """
    sine = np.hypot(across[2], down[2])
    singular = sine < SINGULAR_SINE
    sine = np.where(singular, 1.0, sine)
    c4 = np.where(singular, np.cos(near_a4), -down[2] / sine)
    s4 = np.where(singular, np.sin(near_a4), -across[2] / sine)
    a5 = np.arctan2(-s4 * across[2] - c4 * down[2], along)
    a6 = np.arctan2(s4 * down[0] - c4 * across[0], c4 * across[1] - s4 * down[1])
    return np.arctan2(s4, c4), a5, a6


def inverse_in_range(
    T: ArrayLike, ranges: ArrayLike = RANGES, near: ArrayLike | None = None
) -> Floats:
    """Every set of axis angles within the ranges, whole turns of A4 and A6 included.

    Args:
        T: flange poses, (..., 4, 4).
        ranges: lowest and highest angle of each axis, (6, 2); the ranges' ends belong to them.
        near: see `inverse`.

    Returns:
        (..., K, 6) with the answers first and NaN rows after them; K is the largest number of
        answers of one pose, at least 1.
    """
    limits = np.asarray(ranges, dtype=np.float64)
    q = inverse(T, near)
    q = q - TURN * np.round((q - limits.mean(axis=1)) / TURN)
    turned = np.repeat(q[..., None, :], 9, axis=-2)  # (..., branch, turns of A4 and A6, joint)
    turned[..., 3] += np.repeat(TURNS, 3)
    turned[..., 5] += np.tile(TURNS, 3)
    answers = snap_to_range(turned.reshape(*q.shape[:-2], 72, 6), limits)
    missing = np.isnan(answers).any(axis=-1)
    order = np.argsort(missing, axis=-1, kind="stable")
    count = max(1, int((~missing).sum(axis=-1).max(initial=0)))
    answers = np.take_along_axis(answers, order[..., :count, None], axis=-2)
    answers[np.isnan(answers).any(axis=-1)] = np.nan
    return answers


def snap_to_range(q: Floats, ranges: Floats) -> Floats:
    """Joints (..., n) beyond their range by rounding put on its edge, by more made NaN."""
    low, high = ranges[:, 0], ranges[:, 1]
    inside = (q >= low - RANGE_TOLERANCE_RAD) & (q <= high + RANGE_TOLERANCE_RAD)
    return np.where(inside, np.clip(q, low, high), np.nan)
