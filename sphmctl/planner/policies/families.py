"""Families of wrist poses that a policy leaves free: parameters to crank angles, row by row.

A family has one parameter per row (`LevelFamily`: the angle of all cranks; `TiltFamily`: the heave)
or three (`FreeFamily`: the crank angles), each within bounds in which the wrist always closes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats
from sphmctl.planner.policies.cost import THROUGH_RAD
from sphmctl.robots import rrs

FREE_SHARES = (0.08, 0.36, 0.64, 0.92)
"""Of each crank's range, in all 64 combinations: 34 degrees apart, a step that a crank makes in
0.1 s; the ends are left out for the margin."""

LINE_SHARES: Floats = np.linspace(0.0, 1.0, 17)
"""Of the range of a single parameter: heaves 2.6 mm apart, and both ends."""

Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Family(Protocol):
    """Wrist poses that a policy allows at each row.

    Attributes:
        low, high: bounds of the parameters, (n, d).
        step: the first step of the refinement.
        through_rad: how close to A5 = 0 a way may change A5's sign: the wrist can then be led
            through zero itself where it has the freedom.
    """

    @property
    def low(self) -> Floats: ...

    @property
    def high(self) -> Floats: ...

    @property
    def step(self) -> float: ...

    @property
    def through_rad(self) -> float: ...

    def cranks(self, rows: Rows, values: Floats) -> Floats:
        """Crank angles (..., 3) for parameters (..., d) at rows (...)."""

    def values(self, cranks: Floats) -> Floats:
        """Parameters (d,) of crank angles (3,) that belong to the family."""

    def shares(self, dense: bool) -> Floats:
        """Shares (k, d) of the bounds where the search begins; more when `dense`."""


@dataclass(frozen=True)
class FreeFamily:
    """All crank angles."""

    low: Floats
    high: Floats
    step: float = float(np.radians(12.0))
    through_rad: float = 0.02

    @staticmethod
    def of(count: int, ranges: Floats) -> FreeFamily:
        """For `count` rows, within joint ranges (9, 2)."""
        low, high = np.broadcast_to(ranges[6:].T[:, None], (2, count, 3))
        return FreeFamily(low, high)

    def cranks(self, rows: Rows, values: Floats) -> Floats:
        return values

    def values(self, cranks: Floats) -> Floats:
        return cranks

    def shares(self, dense: bool) -> Floats:
        one = tuple(np.linspace(0.0, 1.0, 7)) if dense else FREE_SHARES
        level = np.repeat(LINE_SHARES[::2, None], 3, axis=1)
        return np.vstack([list(product(one, repeat=3)), level])


@dataclass(frozen=True)
class LevelFamily:
    """Equal cranks."""

    low: Floats
    high: Floats
    step: float = float(np.radians(4.0))
    through_rad: float = THROUGH_RAD

    @staticmethod
    def of(count: int, ranges: Floats) -> LevelFamily:
        """For `count` rows, within joint ranges (9, 2)."""
        low, high = ranges[6:, 0].max(), ranges[6:, 1].min()
        return LevelFamily(np.full((count, 1), low), np.full((count, 1), high))

    def cranks(self, rows: Rows, values: Floats) -> Floats:
        return np.repeat(values, 3, axis=-1)

    def values(self, cranks: Floats) -> Floats:
        return cranks[:1]

    def shares(self, dense: bool) -> Floats:
        return np.linspace(0.0, 1.0, 65)[:, None] if dense else LINE_SHARES[:, None]


@dataclass(frozen=True)
class TiltFamily:
    """A given tilt at any heave.

    Attributes:
        direction, tilt: (n,), rad.
        limits: of the cranks, (3, 2).
    """

    low: Floats
    high: Floats
    direction: Floats
    tilt: Floats
    limits: Floats
    step: float = 1e-3
    through_rad: float = THROUGH_RAD

    def cranks(self, rows: Rows, values: Floats) -> Floats:
        cranks = rrs.inverse(self.direction[rows], self.tilt[rows], values[..., 0])
        return np.clip(cranks, *self.limits.T)  # the heave's bounds hold to rounding

    def values(self, cranks: Floats) -> Floats:
        return rrs.forward(cranks)[2:3, 3]

    def shares(self, dense: bool) -> Floats:
        return np.linspace(0.0, 1.0, 65)[:, None] if dense else LINE_SHARES[:, None]
