"""How far joints are from singular poses: the wrist's two kinds, told apart, and the arm's three.

The wrist closes three loops, g_i = |B_i - B_(i+1)|^2 - 3 d^2 = 0, in the couplers' elevations phi
and the cranks theta: A dphi + C dtheta = 0. Where A is singular the couplers, and the platform with
them, can move although all cranks stand still: a parallel singularity, and control is lost. Where
crank and coupler of a leg are in line the crank can move although the platform stands still: a
serial singularity; the leg cannot lift at that instant, but holds, and a path may pass. (Types 2
and 1 of Gosselin and Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans.
Robotics and Automation 6, 1990.) Metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs
from sphmctl.robots.kr6_model import FOREARM_ANGLE_RAD

LEVEL_MIDDLE: Floats = np.radians([60.0, 60.0, 60.0])
"""To which the parallel margin is scaled: level, all cranks at the middle of their range."""

AFTER = [1, 2, 0]


@dataclass(frozen=True)
class Margins:
    """Distances from singular poses, each (n,); 0 is singular. NaN where the wrist does not close.

    Attributes:
        parallel: of the wrist: the smallest singular value of A over that at LEVEL_MIDDLE. It says
            how much less play at the cranks the platform forgives than there.
        serial_rad: of the wrist: the smallest angle between crank and coupler of one leg.
        wrist_rad: of the arm: A5 from 0, where axes 4 and 6 are in line.
        elbow_rad: of the arm: how far it is from stretched, or folded, from axis 2 to wrist centre.
        shoulder_m: of the arm: the wrist centre's distance from axis 1.
    """

    parallel: Floats
    serial_rad: Floats
    wrist_rad: Floats
    elbow_rad: Floats
    shoulder_m: Floats


@dataclass(frozen=True)
class Loops:
    """The wrist's loop equations at some poses.

    Attributes:
        phi: couplers' elevations from inwards, (n, 3).
        A: derivatives of the loops by the couplers' elevations, m2, (n, 3, 3).
        C: derivatives of the loops by the crank angles, m2, (n, 3, 3).
    """

    phi: Floats
    A: Floats
    C: Floats


def margins(joints: ArrayLike) -> Margins:
    """Distances of joints (n, 9) from singular poses."""
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    cranks, run = runs(q[:, 6:])
    equations = loops(cranks)
    bend = np.abs(q[:, 2] - FOREARM_ANGLE_RAD)
    centre = kr6.wrist_centre(kr6.forward(q[:, :6]))
    return Margins(
        (_least_singular_value(equations.A) / MIDDLE_VALUE_M2)[run],
        _from_line(knee_angles(cranks, equations.phi)).min(axis=1)[run],
        np.abs(q[:, 4]),
        np.minimum(bend, np.abs(np.pi - bend)),
        np.hypot(centre[:, 0], centre[:, 1]),
    )


def runs(rows: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Rows (k, m) without those that repeat the one before; and which of them each was, (n,).

    A wrist that keeps its pose is looked at once.
    """
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return rows[new], np.cumsum(new) - 1


def loops(cranks: ArrayLike) -> Loops:
    """The loop equations (see `Loops`) of crank angles (n, 3) on the built assembly."""
    theta = np.atleast_2d(np.asarray(cranks, dtype=np.float64))
    T = rrs.forward(theta)
    B = T[:, :3, 3:] + rrs.PLATFORM_RADIUS_M * (T[:, :3, :2] @ rrs.LEG_DIRECTIONS)
    r, z = (B[:, :2] * rrs.LEG_DIRECTIONS).sum(axis=1), B[:, 2]
    r_knee = rrs.BASE_RADIUS_M + rrs.CRANK_M * np.sin(theta)
    z_knee = rrs.CRANK_M * np.cos(theta)
    phi = np.arctan2(z - z_knee, r_knee - r)
    # dg_i = (2 r_i + r_j) dr_i + (2 r_j + r_i) dr_j + 2 (z_i - z_j) (dz_i - dz_j), j after i.
    s, dz = r[:, AFTER], z - z[:, AFTER]
    by_r, by_r_after, by_z = 2.0 * r + s, 2.0 * s + r, 2.0 * dz

    def derivatives(dr: Floats, dz: Floats) -> Floats:
        """Of the loops, by the angle that moves each ball joint by dr, dz."""
        out = np.zeros((len(theta), 3, 3))
        for i, j in enumerate(AFTER):
            out[:, i, i] = by_r[:, i] * dr[:, i] + by_z[:, i] * dz[:, i]
            out[:, i, j] = by_r_after[:, i] * dr[:, j] - by_z[:, i] * dz[:, j]
        return out

    A = derivatives(rrs.COUPLER_M * np.sin(phi), rrs.COUPLER_M * np.cos(phi))
    C = derivatives(rrs.CRANK_M * np.cos(theta), -rrs.CRANK_M * np.sin(theta))
    return Loops(phi, A, C)


def knee_angles(cranks: ArrayLike, phi: Floats) -> Floats:
    """Angles (n, 3) from the crank's direction to the coupler's; 0 where they are in line.

    The crank points sin(theta) outwards and cos(theta) up, the coupler -cos(phi) and sin(phi).
    """
    return np.asarray(np.pi / 2.0 + np.asarray(cranks, dtype=np.float64) - phi)


def _from_line(angle: Floats) -> Floats:
    """How far angles are from 0 and from half a turn, whichever is nearer."""
    return np.asarray(np.abs(np.arcsin(np.sin(angle))))


def _least_singular_value(matrices: Floats) -> Floats:
    """Of each matrix (n, 3, 3); NaN where it has no numbers."""
    out = np.full(len(matrices), np.nan)
    whole = np.isfinite(matrices).all(axis=(1, 2))
    out[whole] = np.linalg.svd(matrices[whole], compute_uv=False)[:, -1]
    return out


MIDDLE_VALUE_M2 = float(_least_singular_value(loops(LEVEL_MIDDLE).A)[0])
