"""What the wrist can do in closed form: heaves for a tilt, the steepest tilt in a direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import rrs

STEEPEST_RAD = float(np.radians(60.0))
"""No direction allows more: a sixth of a turn moves the legs' ends by twice the cranks' reach."""

HALVINGS = 30
"""Of the bracket around the steepest tilt: to 1e-9 rad."""


def heave_range(
    direction: ArrayLike, tilt: ArrayLike, ranges: ArrayLike = rrs.RANGES
) -> tuple[Floats, Floats]:
    """Lowest and highest heave, m, at which the cranks can hold a tilt; low > high where none.

    The orientation settles each ball joint's distance r from the axis (see `rrs.inverse`), so that
    the highest and the lowest crank angle bound its height, and with it the heave.
    """
    limits = np.asarray(ranges, dtype=np.float64)
    s, t = np.broadcast_arrays(
        np.asarray(direction, dtype=np.float64)[..., None],
        np.asarray(tilt, dtype=np.float64)[..., None],
    )
    loss = 2.0 * np.sin(t / 2.0) ** 2 * (0.5 + np.cos(2.0 * s + rrs.LEG_ANGLES))
    x = rrs.PLATFORM_RADIUS_M * (1.0 - loss) - rrs.BASE_RADIUS_M
    beside = rrs.PLATFORM_RADIUS_M * np.sin(t) * np.cos(s - rrs.LEG_ANGLES)
    # A crank turned further in than in line with its coupler would be on another working mode.
    straight = np.arcsin(np.clip(x / (rrs.CRANK_M + rrs.COUPLER_M), -1.0, 1.0))
    high = _height(np.maximum(limits[:, 0], straight), x)
    low = _height(np.maximum(limits[:, 1], straight), x)
    return (low + beside).max(axis=-1), (high + beside).min(axis=-1)


def _height(crank: Floats, x: Floats) -> Floats:
    """Height of a ball joint at x (distance from the axis less the base's radius), m."""
    across = rrs.CRANK_M * np.sin(crank) - x
    root = np.sqrt(np.maximum(rrs.COUPLER_M**2 - across * across, 0.0))
    return np.asarray(rrs.CRANK_M * np.cos(crank) + root)


def steepest_tilt(direction: ArrayLike, ranges: ArrayLike = rrs.RANGES) -> Floats:
    """The largest tilt, rad, for which there is a heave, with all smaller ones possible too."""
    towards = np.asarray(direction, dtype=np.float64)
    low, high = np.zeros(towards.shape), np.full(towards.shape, STEEPEST_RAD)
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        lowest, highest = heave_range(towards, middle, ranges)
        low, high = np.where(lowest <= highest, [middle, high], [low, middle])
    return low
