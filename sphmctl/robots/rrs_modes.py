"""All real assembly modes of the 3-RRS wrist: every platform pose that its crank angles allow.

The paper eliminates two coupler angles and gets a polynomial of degree 16 in the tangent of half
the third. Here the same elimination gives a trigonometric polynomial of degree 8 in the first
coupler's angle itself, which has no pole at 180 degrees: it is sampled on the circle, turned into
coefficients by a Fourier transform, and its 16 roots are polished by Newton's method.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots.geometry import wrap
from sphmctl.robots.rrs import (
    BASE_RADIUS_M,
    COUPLER_M,
    CRANK_M,
    PLATFORM_RADIUS_M,
    forward,
    platform_pose,
    solve_couplers,
)

Complexes = NDArray[np.complex128]

MOST_MODES = 16
DEGREE = 8  # of the trigonometric polynomial; 17 coefficients
SAMPLES = 64  # on the circle; more than the 17 needed, which averages rounding out
# Two coupler triples this close (rad) are one mode. At a double root Newton's method stops up to
# about the root of its rounding apart.
SAME_MODE_RAD = 1e-6


def assembly_modes(theta: ArrayLike) -> Floats:
    """All real assembly modes (..., 16, 4, 4) of crank angles (..., 3), NaN after the last.

    The built mode comes first where there is one (see `rrs.forward`), then the others by falling
    heave. Modes may put the platform upside down or legs through each other: the built machine
    reaches only those it can be taken apart for.
    """
    theta = np.asarray(theta, dtype=np.float64)
    triples = theta.reshape(-1, 3)
    built = forward(triples)
    out = np.full((len(triples), MOST_MODES, 4, 4), np.nan)
    for i, triple in enumerate(triples):
        modes = _modes_of_one(triple)
        distance = np.abs(modes - built[i]).max(axis=(1, 2))
        order = np.lexsort((-modes[:, 2, 3], ~(distance < 1e-6)))
        out[i, : len(modes)] = modes[order]
    return out.reshape(*theta.shape[:-1], MOST_MODES, 4, 4)


def _modes_of_one(theta: Floats) -> Floats:
    """The distinct modes (m, 4, 4) of one crank triple (3,), in no order."""
    r, z = BASE_RADIUS_M + CRANK_M * np.sin(theta), CRANK_M * np.cos(theta)
    phi1 = np.angle(coupler_roots(r, z))
    (cos2, sin2), (cos3, sin3) = (_follow(phi1, r, z, leg) for leg in (1, 2))
    # Both followers of each root, in all four pairs; complex ones start Newton's method nearby.
    phi2, phi3 = np.arctan2(sin2.real, cos2.real), np.arctan2(sin3.real, cos3.real)
    starts = np.stack(
        [np.tile(phi1, 4), np.repeat(phi2, 2, axis=0).ravel(), np.tile(phi3, (2, 1)).ravel()]
    )
    columns = np.ones(starts.shape[1])
    with np.errstate(all="ignore"):
        phi = solve_couplers(r[:, None] * columns, z[:, None] * columns, starts)
    distinct: list[Floats] = []
    for triple in phi[:, np.isfinite(phi).all(axis=0)].T:
        if all(np.abs(wrap(triple - other)).max() > SAME_MODE_RAD for other in distinct):
            distinct.append(triple)
    found = np.array(distinct[:MOST_MODES]).reshape(-1, 3).T
    return platform_pose(
        r[:, None] - COUPLER_M * np.cos(found), z[:, None] + COUPLER_M * np.sin(found)
    )


def _follow(phi1: Floats, r: Floats, z: Floats, leg: int) -> tuple[Complexes, ...]:
    """Cosine and sine, each (2, n), of both angles that coupler `leg` may have beside coupler 1."""
    a, b, c = _link(phi1, r, z, leg)
    square = a * a + b * b
    root = np.sqrt((square - c * c).astype(np.complex128)) * np.array([[1.0], [-1.0]])
    return (-a * c + b * root) / square, (-b * c - a * root) / square


def _link(phi1: Floats, r: Floats, z: Floats, leg: int) -> tuple[Floats, Floats, Floats]:
    """a, b, c of a cos(phi) + b sin(phi) + c = 0, which holds B_leg sqrt(3) d away from B_1."""
    r1, z1 = r[0] - COUPLER_M * np.cos(phi1), z[0] + COUPLER_M * np.sin(phi1)
    own = r[leg] ** 2 + z[leg] ** 2 + COUPLER_M**2 - 3.0 * PLATFORM_RADIUS_M**2
    return (
        -COUPLER_M * (2.0 * r[leg] + r1),
        2.0 * COUPLER_M * (z[leg] - z1),
        r1 * r1 + z1 * z1 + r1 * r[leg] - 2.0 * z1 * z[leg] + own,
    )


def coupler_roots(r: Floats, z: Floats) -> Complexes:
    """The 16 values of exp(i phi_1) that let legs 2 and 3 meet leg 1 and each other."""
    phi1 = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    (cos2, sin2), (cos3, sin3) = (_follow(phi1, r, z, leg) for leg in (1, 2))
    r2, z2 = r[1] - COUPLER_M * cos2[:, None], z[1] + COUPLER_M * sin2[:, None]
    r3, z3 = r[2] - COUPLER_M * cos3, z[2] + COUPLER_M * sin3
    gap = r2 * r2 + r3 * r3 + r2 * r3 + (z2 - z3) ** 2 - 3.0 * PLATFORM_RADIUS_M**2
    # The product over all pairs is free of roots; its denominators are known and cleared.
    product = gap.prod(axis=(0, 1))
    for leg in (1, 2):
        a, b, _ = _link(phi1, r, z, leg)
        product = product * (a * a + b * b) ** 2
    spectrum = np.fft.fft(product.real / np.abs(product).max())
    falling = np.concatenate([spectrum[DEGREE::-1], spectrum[: -DEGREE - 1 : -1]])
    return np.asarray(np.roots(falling), dtype=np.complex128)
