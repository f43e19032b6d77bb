"""The chain forward for one set of joints, in plain floats: numpy costs fifteen times as much.

The control cycle asks for one pose at a time. The formulas are those of `kr6`, `rrs` and `chain`,
where they are explained; the tests hold the two together.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, cos, nan, sin, sqrt

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_M,
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)
from sphmctl.robots.rrs import (
    BASE_RADIUS_M,
    CLOSED_M2,
    COUPLER_M,
    CRANK_M,
    LAST_STEP_RAD,
    MOST_STEPS,
    PLATFORM_RADIUS_M,
)

Row = tuple[float, float, float, float]
Rows = tuple[Row, Row, Row, Row]
Triple = tuple[float, float, float]

LAST_ROW: Row = (0.0, 0.0, 0.0, 1.0)
NOWHERE: Rows = ((nan, nan, nan, nan),) * 4
SQUARED_SIDE_M2 = 3.0 * PLATFORM_RADIUS_M**2  # between two ball joints
HALF_ROOT = 0.5 * sqrt(3.0)


def forward(q: Sequence[float], mount_yaw: float, adapter_m: float) -> Floats:
    """The platform's pose (4, 4) of nine joints; NaN where the wrist does not close."""
    try:
        arm = _mount(q, mount_yaw, adapter_m)
    except ValueError:  # an infinite angle
        return np.array(NOWHERE)
    return np.asarray(np.array(arm) @ np.array(_platform(q[6:])))


def _mount(q: Sequence[float], mount_yaw: float, adapter_m: float) -> Rows:
    """The wrist's frame on the flange, in the arm's base frame."""
    a1, a2, a3, a4, a5, a6 = q[:6]
    c1, s1, cb, sb = cos(a1), sin(a1), cos(a2 + a3), sin(a2 + a3)
    c4, s4, c5, s5 = cos(a4), sin(a4), cos(a5), sin(a5)
    # Turning by the mount yaw about the flange's z is turning A6 back by it.
    c6, s6 = cos(a6 - mount_yaw), sin(a6 - mount_yaw)
    columns = (
        (-s5 * c6, -c4 * s6 - s4 * c5 * c6, s4 * s6 - c4 * c5 * c6),
        (-s5 * s6, c4 * c6 - s4 * c5 * s6, -s4 * c6 - c4 * c5 * s6),
        (c5, -s4 * s5, -c4 * s5),
    )
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = [
        (
            c1 * (cb * x + sb * z) + s1 * y,
            c1 * y - s1 * (cb * x + sb * z),
            cb * z - sb * x,
        )
        for x, y, z in columns
    ]
    radius = AXIS2_FORWARD_M + UPPER_ARM_M * cos(a2) + FOREARM_M * cb + FOREARM_OFFSET_M * sb
    height = AXIS2_HEIGHT_M - UPPER_ARM_M * sin(a2) - FOREARM_M * sb + FOREARM_OFFSET_M * cb
    reach_m = FLANGE_M + adapter_m
    return (
        (xx, yx, zx, c1 * radius + reach_m * zx),
        (xy, yy, zy, reach_m * zy - s1 * radius),
        (xz, yz, zz, height + reach_m * zz),
        LAST_ROW,
    )


def _platform(cranks: Sequence[float]) -> Rows:
    """The platform in the wrist's frame."""
    try:
        r_crank = [BASE_RADIUS_M + CRANK_M * sin(crank) for crank in cranks]
        z_crank = [CRANK_M * cos(crank) for crank in cranks]
        phi = _close(r_crank, z_crank)
    except (ValueError, ZeroDivisionError):
        return NOWHERE
    if phi is None or not all(sin(angle) > 0.0 for angle in phi):
        return NOWHERE
    r0, r1, r2 = (r - COUPLER_M * cos(angle) for r, angle in zip(r_crank, phi, strict=True))
    z0, z1, z2 = (z + COUPLER_M * sin(angle) for z, angle in zip(z_crank, phi, strict=True))
    px, py, pz = (r0 - 0.5 * (r1 + r2)) / 3.0, HALF_ROOT * (r1 - r2) / 3.0, (z0 + z1 + z2) / 3.0
    d = PLATFORM_RADIUS_M
    ux, uy, uz = (r0 - px) / d, -py / d, (z0 - pz) / d
    across = 2.0 * HALF_ROOT * d
    vx, vy, vz = 0.5 * (r2 - r1) / across, HALF_ROOT * (r1 + r2) / across, (z1 - z2) / across
    wz = ux * vy - uy * vx
    if not wz > 0.0:
        return NOWHERE
    return (
        (ux, vx, uy * vz - uz * vy, px),
        (uy, vy, uz * vx - ux * vz, py),
        (uz, vz, wz, pz),
        LAST_ROW,
    )


def _close(r_crank: Sequence[float], z_crank: Sequence[float]) -> Triple | None:
    """The couplers' elevations that close the wrist, by Newton's method; None if it does not."""
    r0c, r1c, r2c = r_crank
    z0c, z1c, z2c = z_crank
    f0, f1, f2 = (acos((r - PLATFORM_RADIUS_M) / COUPLER_M) for r in r_crank)
    error = step = 0.0
    for _ in range(MOST_STEPS):
        c0, c1, c2 = COUPLER_M * cos(f0), COUPLER_M * cos(f1), COUPLER_M * cos(f2)
        s0, s1, s2 = COUPLER_M * sin(f0), COUPLER_M * sin(f1), COUPLER_M * sin(f2)
        r0, r1, r2 = r0c - c0, r1c - c1, r2c - c2
        d0, d1, d2 = z0c + s0 - z1c - s1, z1c + s1 - z2c - s2, z2c + s2 - z0c - s0
        b0 = r0 * r0 + r1 * r1 + r0 * r1 + d0 * d0 - SQUARED_SIDE_M2
        b1 = r1 * r1 + r2 * r2 + r1 * r2 + d1 * d1 - SQUARED_SIDE_M2
        b2 = r2 * r2 + r0 * r0 + r2 * r0 + d2 * d2 - SQUARED_SIDE_M2
        p0, q0 = (2 * r0 + r1) * s0 + 2 * d0 * c0, (2 * r1 + r0) * s1 - 2 * d0 * c1
        p1, q1 = (2 * r1 + r2) * s1 + 2 * d1 * c1, (2 * r2 + r1) * s2 - 2 * d1 * c2
        p2, q2 = (2 * r2 + r0) * s2 + 2 * d2 * c2, (2 * r0 + r2) * s0 - 2 * d2 * c0
        determinant = p0 * p1 * p2 + q0 * q1 * q2
        x0 = (b0 * p1 * p2 - q0 * b1 * p2 + q0 * q1 * b2) / determinant
        x1 = (b1 * p2 * p0 - q1 * b2 * p0 + q1 * q2 * b0) / determinant
        x2 = (b2 * p0 * p1 - q2 * b0 * p1 + q2 * q0 * b1) / determinant
        f0, f1, f2 = f0 - x0, f1 - x1, f2 - x2
        error, step = max(abs(b0), abs(b1), abs(b2)), max(abs(x0), abs(x1), abs(x2))
        if step <= LAST_STEP_RAD:
            break
    return (f0, f1, f2) if error < CLOSED_M2 or step < LAST_STEP_RAD else None
