"""What the wrist's servos hold at rest: the weight of platform and payload, by virtual work.

No acceleration, no friction, no weight of cranks: what a servo holds for as long as a pose lasts.
Metres, kilograms, newton metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs
from sphmctl.robots.sphm.singular import loops, runs

GRAVITY_M_S2 = 9.80665
"""Standard gravity."""

STALL_TORQUE_NM = 1.4
"""XL430-W250 at 11.1 V, the supply it is meant for (1.5 at 12 V): ROBOTIS e-manual."""

HOLDING_SHARE = 0.2
"""Share of the stall torque that may be held: "stable motions are possible with robots designed for
loads with 1/5 or less of the stall torque", ROBOTIS e-manual."""

HOLDING_TORQUE_NM = HOLDING_SHARE * STALL_TORQUE_NM

PLATFORM_KG = 0.10
"""Platform with ball joints and half of each coupler: a guess, a disc of aluminium 112 mm wide and
3 mm thick with 20 g of joints. To be weighed on the cell."""


@dataclass(frozen=True)
class Payload:
    """What the platform carries: mass and its centre on the platform's frame (3,), m."""

    mass_kg: float
    centre_m: tuple[float, float, float]


def holding_torques(joints: ArrayLike, payload: Payload, mount_yaw: float = 0.0) -> Floats:
    """Torques (n, 3) that the servos have to hold at joints (n, 9), about their cranks' sense.

    The derivative of the weight's potential by each crank angle, the arm standing still. NaN where
    the wrist does not close.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    up = kr6.forward(q[:, :6])[:, 2, :3]  # the base's z on the flange's axes
    c, s = np.cos(mount_yaw), np.sin(mount_yaw)
    up = np.stack([c * up[:, 0] + s * up[:, 1], c * up[:, 1] - s * up[:, 0], up[:, 2]], axis=1)
    cranks, run = runs(q[:, 6:])
    mass_kg = PLATFORM_KG + payload.mass_kg
    centre_m = np.asarray(payload.centre_m) * payload.mass_kg / mass_kg
    return np.asarray(
        mass_kg * GRAVITY_M_S2 * np.einsum("nij,ni->nj", point_jacobian(cranks, centre_m)[run], up)
    )


def point_jacobian(cranks: ArrayLike, point_m: ArrayLike) -> Floats:
    """How a point (3,) of the platform moves in the wrist's frame by each crank, m/rad, (n, 3, 3).

    From the loop equations: dphi = -A^-1 C dtheta moves the ball joints, and these the platform as
    `rrs.platform_pose` has it.
    """
    theta = np.atleast_2d(np.asarray(cranks, dtype=np.float64))
    equations, T = loops(theta), rrs.forward(theta)
    out = np.full((len(theta), 3, 3), np.nan)
    whole = np.isfinite(T[:, 0, 0])
    dphi = -np.linalg.solve(equations.A[whole], equations.C[whole])  # (n, leg, crank)
    phi, theta, T = equations.phi[whole, :, None], theta[whole, :, None], T[whole]
    own = np.eye(3)
    dr = rrs.COUPLER_M * np.sin(phi) * dphi + rrs.CRANK_M * np.cos(theta) * own
    dz = rrs.COUPLER_M * np.cos(phi) * dphi - rrs.CRANK_M * np.sin(theta) * own
    x, y = rrs.LEG_DIRECTIONS
    dB = np.stack([dr * x[:, None], dr * y[:, None], dz], axis=1)  # (n, xyz, leg, crank)
    dp = dB.mean(axis=2)
    du = (dB[:, :, 0] - dp) / rrs.PLATFORM_RADIUS_M
    dv = (dB[:, :, 1] - dB[:, :, 2]) / (np.sqrt(3.0) * rrs.PLATFORM_RADIUS_M)
    u, v = T[:, :3, :1], T[:, :3, 1:2]
    dw = np.cross(du, v, axis=1) + np.cross(u, dv, axis=1)
    a, b, c = np.asarray(point_m, dtype=np.float64)
    out[whole] = dp + a * du + b * dv + c * dw
    return out
