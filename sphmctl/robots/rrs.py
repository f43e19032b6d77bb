"""The 3-RRS wrist on the flange: crank angles to platform pose and back, on the built assembly.

Metres and radians. Wrist frame: origin O6 on the flange axis, z outward, x towards leg 1. Platform
frame: origin O7 at the centre of the three ball joints B_i, x (the paper's u) towards B_1. Crank
angle 0 holds the crank along the outward normal, 90 degrees level and pointing away from the axis.
Legs stand at 0, 120 and 240 degrees. Other assembly modes are in `rrs_modes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.errors import InfeasibleError, InvalidError
from sphmctl.motion import Floats

# Lengths: Elsamanty et al., Appl. Sci. 2023, 13, 2088, section 2.
BASE_RADIUS_M = 0.056  # k: axis to the base joints A_i
PLATFORM_RADIUS_M = 0.056  # d: O7 to the ball joints B_i
CRANK_M = 0.025  # l1: the active link
COUPLER_M = 0.061  # l2: the passive link

RANGES: Floats = np.radians([[0.0, 120.0]] * 3)  # the paper's Table 1
# rad/s; the XL430-W250's no-load speed at 12 V, 61 rpm: ROBOTIS e-manual, "Specifications".
MAX_SPEED: Floats = np.full(3, 61.0 * 2.0 * np.pi / 60.0)
# rad/s2; an estimate, for ROBOTIS prints none. To be measured on the cell.
MAX_ACCELERATION: Floats = np.full(3, 60.0)

LEG_ANGLES: Floats = np.radians([0.0, 120.0, 240.0])
LEG_DIRECTIONS: Floats = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES)])

# A point this far (m) beyond a leg's reach, or beside its plane, stands on the edge: rounding of
# poses given in mm with six decimals.
REACH_TOLERANCE_M = 1e-9
# Newton's method stops after a step below this (rad): its error is then that step squared.
LAST_STEP_RAD = 1e-8
# Six steps were the most for 20,000 random crank triples in range; this leaves room beyond it.
MOST_STEPS = 16
# A platform tilted by less (sine) is level and leans nowhere: rounding, 3e-16 with equal cranks,
# must not invent a direction. It moves a ball joint by 6e-17 m, no more than rounding does.
LEVEL_SINE = 1e-15
CLOSED_M2 = 1e-14  # what may remain of |B_i - B_j|^2 - 3 d^2: 1e-13 m in a distance


def forward(theta: ArrayLike) -> Floats:
    """Platform poses (..., 4, 4) in the wrist frame of crank angles (..., 3).

    The three coupler angles are found by Newton's method, each started where its leg alone would
    hold a level platform; that leads to the built assembly (couplers leaning inwards, platform
    outward). NaN where the mechanism does not close.
    """
    theta = np.asarray(theta, dtype=np.float64)
    if theta.shape[-1:] != (3,):
        raise InvalidError(f"crank angles have shape {theta.shape}; the last dimension must be 3")
    cranks = np.moveaxis(theta, -1, 0)
    r_crank = BASE_RADIUS_M + CRANK_M * np.sin(cranks)
    z_crank = CRANK_M * np.cos(cranks)
    with np.errstate(all="ignore"):
        phi = solve_couplers(r_crank, z_crank, np.arccos((r_crank - PLATFORM_RADIUS_M) / COUPLER_M))
        T = platform_pose(r_crank - COUPLER_M * np.cos(phi), z_crank + COUPLER_M * np.sin(phi))
        built = (np.sin(phi) > 0.0).all(axis=0) & (T[..., 2, 2] > 0.0)
    T[~built] = np.nan
    return T


def forward_checked(theta: ArrayLike) -> Floats:
    """As `forward`, but a crank triple on which the wrist does not close is an InfeasibleError."""
    T = forward(theta)
    broken = np.isnan(T[..., 0, 0])
    if broken.any():
        triple = np.degrees(np.asarray(theta, dtype=np.float64)[broken][0])
        cranks = ", ".join(f"{angle:g}" for angle in triple)
        raise InfeasibleError(
            f"the wrist does not close at crank angles {cranks} degrees; it closes everywhere "
            "within 0 to 120 degrees"
        )
    return T


def solve_couplers(r_crank: Floats, z_crank: Floats, phi: Floats) -> Floats:
    """Coupler elevations (3, ...), measured from inwards, that keep the B_i sqrt(3) d apart.

    Args:
        r_crank: distance of each crank's end from the axis, m, (3, ...).
        z_crank: its height over the base plane, m, (3, ...).
        phi: where Newton's method starts, (3, ...).

    Returns:
        NaN where it does not converge. Legs i and i + 1 stand 120 degrees apart, so
        |B_i - B_j|^2 = r_i^2 + r_j^2 + r_i r_j + (z_i - z_j)^2.
    """
    for _ in range(MOST_STEPS):
        step, residual = newton_step(r_crank, z_crank, phi)
        phi = phi - step
        if not (np.abs(step) > LAST_STEP_RAD).any():
            break
    closed = (np.abs(residual) < CLOSED_M2).all(axis=0) | (np.abs(step) < LAST_STEP_RAD).all(axis=0)
    return np.where(closed, phi, np.nan)


def newton_step(r_crank: Floats, z_crank: Floats, phi: Floats) -> tuple[Floats, Floats]:
    """What Newton's method takes off phi, and what |B_i - B_(i+1)|^2 exceeds 3 d^2 by."""
    after = [1, 2, 0]
    cosine, sine = COUPLER_M * np.cos(phi), COUPLER_M * np.sin(phi)
    r, z = r_crank - cosine, z_crank + sine
    s, dz = r[after], z - z[after]
    residual = r * r + s * s + r * s + dz * dz - 3.0 * PLATFORM_RADIUS_M**2
    # Each equation holds two unknowns: p by its own angle, q by the next leg's.
    p = (2.0 * r + s) * sine + 2.0 * dz * cosine
    q = (2.0 * s + r) * sine[after] - 2.0 * dz * cosine[after]
    return _solve_cyclic(p, q, residual), residual


def _solve_cyclic(p: Floats, q: Floats, b: Floats) -> Floats:
    """x of p_i x_i + q_i x_(i+1) = b_i for i = 0, 1, 2, counted in a circle."""
    numerator = np.stack(
        [
            b[0] * p[1] * p[2] - q[0] * b[1] * p[2] + q[0] * q[1] * b[2],
            b[1] * p[2] * p[0] - q[1] * b[2] * p[0] + q[1] * q[2] * b[0],
            b[2] * p[0] * p[1] - q[2] * b[0] * p[1] + q[2] * q[0] * b[1],
        ]
    )
    return np.asarray(numerator / (p[0] * p[1] * p[2] + q[0] * q[1] * q[2]))


def platform_pose(r: Floats, z: Floats) -> Floats:
    """The pose (..., 4, 4) of a platform with its ball joints at r, z (3, ...) in leg planes."""
    half_root = np.sqrt(3.0) / 2.0
    T = np.zeros((*r.shape[1:], 4, 4))
    p = np.stack([r[0] - 0.5 * (r[1] + r[2]), half_root * (r[1] - r[2]), z.sum(axis=0)]) / 3.0
    u = (np.stack([r[0], np.zeros_like(r[0]), z[0]]) - p) / PLATFORM_RADIUS_M
    v = np.stack([0.5 * (r[2] - r[1]), half_root * (r[1] + r[2]), z[1] - z[2]]) / (
        2.0 * half_root * PLATFORM_RADIUS_M
    )
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        T[..., i, 0], T[..., i, 1] = u[i], v[i]
        T[..., i, 2] = u[j] * v[k] - u[k] * v[j]
        T[..., i, 3] = p[i]
    T[..., 3, 3] = 1.0
    return T


def tilt_of(T: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Tilt direction (where the normal leans), tilt and heave (m) of platform poses (..., 4, 4)."""
    T = np.asarray(T, dtype=np.float64)
    sine = np.hypot(T[..., 0, 2], T[..., 1, 2])
    direction = np.where(sine < LEVEL_SINE, 0.0, np.arctan2(T[..., 1, 2], T[..., 0, 2]))
    return direction, np.asarray(np.arctan2(sine, T[..., 2, 2])), np.asarray(T[..., 2, 3])


def inverse(direction: ArrayLike, tilt: ArrayLike, heave_m: ArrayLike) -> Floats:
    """Crank angles (..., 3) that tilt the platform to a heave, on the built working mode.

    The orientation is Rz(s) Ry(t) Rz(-s) with s the direction and t the tilt. The leg planes force
    u_y = v_x, O7_x = d (u_x - v_y) / 2 and O7_y = -d u_y (the paper's constraint equations of the
    3-RRS), which puts B_i at r = d (1 - (1 - cos t)(1/2 + cos(2 s + a))), a the leg's angle.

    Returns:
        NaN where a leg does not reach; ranges are not applied.
    """
    s, t, h = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64)[..., None] for x in (direction, tilt, heave_m))
    )
    loss = 2.0 * np.sin(t / 2.0) ** 2 * (0.5 + np.cos(2.0 * s + LEG_ANGLES))
    r = PLATFORM_RADIUS_M * (1.0 - loss)
    z = h - PLATFORM_RADIUS_M * np.sin(t) * np.cos(s - LEG_ANGLES)
    return _whole(_crank_angles(r, z)[0])


def inverse_pose(T: ArrayLike) -> Floats:
    """Crank angles (..., 3) of platform poses (..., 4, 4), on the built working mode.

    NaN where the pose is not one of a 3-RRS (a ball joint more than REACH_TOLERANCE_M beside its
    leg's plane) or a leg does not reach; ranges are not applied.
    """
    r, z = _ball_joints(T)
    return _whole(_crank_angles(r, z)[0])


def inverse_modes(T: ArrayLike) -> Floats:
    """All working modes (..., 8, 3): each leg with its knee outwards (the built one) or inwards.

    Mode 0 is the built one; bit i of the mode's number turns the knee of leg i + 1 inwards. All of
    NaN where `inverse_pose` is.
    """
    outwards, inwards = _crank_angles(*_ball_joints(T))
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return _whole(np.where(bits, inwards[..., None, :], outwards[..., None, :]))


def _ball_joints(T: ArrayLike) -> tuple[Floats, Floats]:
    """Distance from the axis and height, each (..., 3), of the ball joints in their leg planes."""
    T = np.asarray(T, dtype=np.float64)
    if T.shape[-2:] != (4, 4):
        raise InvalidError(f"platform poses have shape {T.shape}; the last must be 4 x 4")
    B = T[..., :3, 3:] + PLATFORM_RADIUS_M * (T[..., :3, :2] @ LEG_DIRECTIONS)
    x, y = LEG_DIRECTIONS
    beside = np.abs(B[..., 1, :] * x - B[..., 0, :] * y)
    r = B[..., 0, :] * x + B[..., 1, :] * y
    return np.where(beside <= REACH_TOLERANCE_M, r, np.nan), B[..., 2, :]


def _crank_angles(r: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Crank angles with the knee outwards, and inwards, of legs whose ball joints are at r, z.

    The angle between crank and the line to B_i comes from the cosine rule by its half angle: at
    crank 0, where crank and coupler are in line, its cosine would lose half of the digits.
    """
    x = r - BASE_RADIUS_M
    reach = np.hypot(x, z)
    stretched = CRANK_M + COUPLER_M - reach
    folded = reach - (COUPLER_M - CRANK_M)
    with np.errstate(invalid="ignore"):
        reachable = (stretched >= -REACH_TOLERANCE_M) & (folded >= -REACH_TOLERANCE_M)
    opposite = np.maximum(stretched, 0.0) * (COUPLER_M - CRANK_M + reach)
    adjacent = np.maximum(folded, 0.0) * (CRANK_M + COUPLER_M + reach)
    knee = np.where(reachable, 2.0 * np.arctan2(np.sqrt(opposite), np.sqrt(adjacent)), np.nan)
    line = np.arctan2(x, z)
    return line + knee, line - knee


def _whole(theta: Floats) -> Floats:
    """A triple with one missing crank angle is missing altogether."""
    return np.where(np.isnan(theta).any(axis=-1, keepdims=True), np.nan, theta)
