"""How the arm's joints must follow small motions of the cranks while the tool stays where it is."""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots import rrs
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    FLANGE_M,
    FOREARM_M,
    FOREARM_OFFSET_M,
    SINGULAR_SINE,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm import chain

# By this much (rad) each crank is moved to see how the platform follows. One step of Newton's
# method closes the wrist again; it errs by the square, and rounding by 1e-16 over this.
SMALL_RAD = 1e-7


def joint_slopes(joints: Floats, mount_yaw: float) -> tuple[Floats, Floats]:
    """How the arm follows the cranks with the tool at rest, at joints (9, n).

    Returns:
        Derivatives of A1 to A6 by each crank, (6, 3, n), and of the wrist centre's distance from
        axis 2, (3, n), m/rad. Large, or without meaning, where the arm is singular; but numbers.
    """
    motion = -_platform_motions(joints[6:])
    c, s = np.cos(mount_yaw), np.sin(mount_yaw)
    x, y = motion[0::3].copy(), motion[1::3].copy()
    motion[0::3], motion[1::3] = c * x - s * y, s * x + c * y
    # From the point in the wrist's origin to the one in the flange's.
    motion[0] -= chain.ADAPTER_M * motion[4]
    motion[1] += chain.ADAPTER_M * motion[3]
    return arm_slopes(joints[:6], motion)


def _platform_motions(cranks: Floats) -> Floats:
    """The platform's motion (6, 3, n) by each crank, of crank angles (3, n), in the wrist's frame.

    The rows are the velocity of the platform's point in the wrist's origin, and its turning.
    """
    T = rrs.forward(cranks.T)
    R, p = T[:, :3, :3].transpose(1, 2, 0), T[:, :3, 3].T
    out = np.empty((6, *cranks.shape))
    for leg, moved in enumerate(_moved_platforms(cranks, R, p)):
        dR = (moved[:, :3, :3].transpose(1, 2, 0) - R) / SMALL_RAD
        turning = 0.5 * _cross(R, dR).sum(axis=1)
        out[:3, leg] = (moved[:, :3, 3].T - p) / SMALL_RAD - _cross(turning, p)
        out[3:, leg] = turning
    return out


def _moved_platforms(cranks: Floats, R: Floats, p: Floats) -> list[Floats]:
    """Platform poses (n, 4, 4) with one crank after the other moved by SMALL_RAD."""
    legs = [
        p + rrs.PLATFORM_RADIUS_M * (R[:, 0] * cosine + R[:, 1] * sine)
        for cosine, sine in rrs.LEG_DIRECTIONS.T
    ]
    ball_r = np.stack(
        [B[0] * c + B[1] * s for B, (c, s) in zip(legs, rrs.LEG_DIRECTIONS.T, strict=True)]
    )
    ball_z = np.stack([B[2] for B in legs])
    r, z = _crank_ends(cranks)
    phi = np.arctan2(ball_z - z, r - ball_r)
    out = []
    for leg in range(3):
        moved = cranks.copy()
        moved[leg] += SMALL_RAD
        r, z = _crank_ends(moved)
        closed = phi - rrs.newton_step(r, z, phi)[0]
        out.append(
            rrs.platform_pose(
                r - rrs.COUPLER_M * np.cos(closed), z + rrs.COUPLER_M * np.sin(closed)
            )
        )
    return out


def _crank_ends(cranks: Floats) -> tuple[Floats, Floats]:
    return rrs.BASE_RADIUS_M + rrs.CRANK_M * np.sin(cranks), rrs.CRANK_M * np.cos(cranks)


def arm_slopes(arm: Floats, twists: Floats) -> tuple[Floats, Floats]:
    """Joint speeds of the arm that move its flange by twists, and the wrist centre's way outwards.

    Args:
        arm: axis angles, (6, n).
        twists: velocity of the flange's origin, and its turning, both as the flange sees them,
            (6, k, n).

    Returns:
        Speeds of A1 to A6, (6, k, n), and of the wrist centre's distance from axis 2, (k, n). Where
        the arm is singular they are large, or without meaning, but numbers.
    """
    (s2, sb, s4, s5, s6), (c2, cb, c4, c5, c6) = _sines(arm)
    vx, vy, vz, wx, wy, wz = twists
    vx, vy = vx - FLANGE_M * wy, vy + FLANGE_M * wx  # of the wrist centre
    # Of the flange's axes seen from the forearm, as in kr6.forward.
    x = (-s5 * c6, -c4 * s6 - s4 * c5 * c6, s4 * s6 - c4 * c5 * c6)
    y = (-s5 * s6, c4 * c6 - s4 * c5 * s6, -s4 * c6 - c4 * c5 * s6)
    z = (c5, -s4 * s5, -c4 * s5)
    v = [x[i] * vx + y[i] * vy + z[i] * vz for i in range(3)]
    w = [x[i] * wx + y[i] * wy + z[i] * wz for i in range(3)]
    outwards, upwards = cb * v[0] + sb * v[2], cb * v[2] - sb * v[0]
    forearm_r, forearm_z = (
        FOREARM_M * cb + FOREARM_OFFSET_M * sb,
        FOREARM_OFFSET_M * cb - FOREARM_M * sb,
    )
    from_2_r, from_2_z = UPPER_ARM_M * c2 + forearm_r, forearm_z - UPPER_ARM_M * s2
    a1 = -v[1] / _not_zero(AXIS2_FORWARD_M + from_2_r)
    # Turning about axis 2 or 3 by one moves the wrist centre by (z, -r), both from that axis.
    determinant = _not_zero(from_2_r * forearm_z - from_2_z * forearm_r)
    a2 = -(forearm_r * outwards + forearm_z * upwards) / determinant
    a3 = (from_2_r * outwards + from_2_z * upwards) / determinant
    # What the wrist's joints have to turn, seen from the forearm, then from behind A4.
    pitch, yaw = a2 + a3, -a1
    wrist = (w[0] + sb * yaw, w[1] - pitch, w[2] - cb * yaw)
    a5 = c4 * wrist[1] - s4 * wrist[2]
    a6 = (s4 * wrist[1] + c4 * wrist[2]) / _not_zero(s5)
    a4 = -wrist[0] - a6 * c5
    reach = (from_2_r * outwards + from_2_z * upwards) / np.hypot(from_2_r, from_2_z)
    return np.stack([a1, a2, a3, a4, a5, a6]), reach


def _sines(arm: Floats) -> tuple[Floats, Floats]:
    """Sine and cosine of A2, A2 + A3, A4, A5, A6."""
    angles = arm[1:].copy()
    angles[1] += arm[1]
    return np.sin(angles), np.cos(angles)


def _not_zero(x: Floats) -> Floats:
    """To divide by."""
    return np.where(np.abs(x) < SINGULAR_SINE, SINGULAR_SINE, x)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of vectors (3, ...)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
