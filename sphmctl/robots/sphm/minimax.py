"""The best step where the smallest of several linear functions is to grow, in a box, many at once.

The simplex method in three unknowns and a level, with an own basis for every column of the arrays:
each is a small linear programme, and numpy solves thousands of them in a dozen steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats

# Six to eight exchanges are usual. When stopped early, the step is still within the box.
MOST_EXCHANGES = 24
# A multiplier above this counts as none, and a constraint approached slower than this as parallel:
# rounding of numbers of the order of one.
NO_MULTIPLIER, PARALLEL = -1e-9, 1e-12
BOX: Floats = np.concatenate([np.eye(3, 4), -np.eye(3, 4)])[:, :, None]


def best_steps(
    values: Floats, slopes: Floats, low: Floats, high: Floats, tilt: Floats | None = None
) -> Floats:
    """Steps d (3, n) that make min_i(values_i + slopes_i d) + tilt d as large as the box lets them.

    Args:
        values: (k, n).
        slopes: (k, 3, n).
        low, high: the box, low <= 0 <= high, (3, n).
        tilt: (3, n); None for nothing.
    """
    count, n = values.shape
    column = np.arange(n)
    towards = slopes[values.argmin(axis=0), :, column].T
    if tilt is not None:
        towards = towards + tilt
    # Start in the corner of the box that looks best; what is lowest there is the fourth constraint.
    corner = towards > 0.0
    d = np.where(corner, high, low)
    level = values + slopes[:, 0] * d[0] + slopes[:, 1] * d[1] + slopes[:, 2] * d[2]
    lowest = level.argmin(axis=0)
    slack = np.concatenate([level - level[lowest, column], high - d, d - low])
    rows = np.empty((count + 6, 4, n))
    rows[:count, :3], rows[:count, 3], rows[count:] = -slopes, 1.0, BOX
    sides = count + np.arange(3)[:, None] + np.where(corner, 0, 3)
    active = np.concatenate([sides, lowest[None]])
    inverse = _first_inverse(np.where(corner, 1.0, -1.0), slopes[lowest, :, column].T)
    for _ in range(MOST_EXCHANGES):
        multipliers = (
            inverse[3] if tilt is None else inverse[3] + (tilt[:, None] * inverse[:3]).sum(0)
        )
        leaving = multipliers.argmin(axis=0)
        done = ~(multipliers[leaving, column] < NO_MULTIPLIER)
        if done.all():
            break
        edge = inverse[:, leaving, column]
        rate = -_apply(rows, edge)
        rate[active, column] = 0.0
        rate[active[leaving, column], column] = -1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            length = np.where(rate > PARALLEL, slack / rate, np.inf)
        entering = length.argmin(axis=0)
        done |= ~np.isfinite(length[entering, column])
        way = np.where(done, 0.0, length[entering, column])
        d = d - way * edge[:3]
        slack = np.maximum(slack - way * rate, 0.0)
        _exchange(inverse, edge, rows[entering, :, column].T, leaving, done)
        keep = active[leaving, column]
        active[leaving, column] = np.where(done, keep, entering)
    return d


def _apply(rows: Floats, edge: Floats) -> Floats:
    """Each row (k, 4, n) times the edge (4, n)."""
    product: Floats = rows[:, 0] * edge[0]
    for i in (1, 2, 3):
        product += rows[:, i] * edge[i]
    return product


def _first_inverse(sides: Floats, slope: Floats) -> Floats:
    """Of three sides of the box (signs (3, n)) and a function's row (-slope, 1), (4, 4, n)."""
    inverse = np.zeros((4, 4, sides.shape[1]))
    for i in range(3):
        inverse[i, i], inverse[3, i] = sides[i], slope[i] * sides[i]
    inverse[3, 3] = 1.0
    return inverse


def _exchange(
    inverse: Floats, edge: Floats, row: Floats, leaving: NDArray[np.intp], done: NDArray[np.bool_]
) -> None:
    """Put `row` in the place of the leaving one, in the inverse of the active rows."""
    column = np.arange(row.shape[1])
    weight = (row[:, None] * inverse).sum(axis=0)
    pivot = np.where(done, 1.0, weight[leaving, column])
    weight[leaving, column] -= 1.0
    inverse -= edge[:, None] * np.where(done, 0.0, weight / pivot)
