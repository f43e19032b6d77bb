"""How fast the path's own wish and its bends let the tool go, and where that changes abruptly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.contour import Indices
from sphmctl.planner.way import Way

STRAIGHT_PER_M = 1e-3
"""A path that bends less is straight."""

BEND_SHARE = 0.7
"""Of the tool's acceleration, for what goes across a bend and for what goes along: together they
stay within the whole."""

ABRUPT = 1.1
"""Ratio of two neighbouring pieces' speeds or accelerations from which on a stop between them may
be worth its time."""

NO_TOOL_LIMITS = (np.inf, np.inf)
"""Speed and acceleration of a tool that follows no path."""


@dataclass(frozen=True)
class Pace:
    """What the tool may do on a way with rows s (n,).

    Attributes:
        speed, acceleration: along the way, between two rows, m/s and m/s2, (n - 1,).
        steps: inner rows at which they change abruptly, ascending.
    """

    s: Floats
    speed: Floats
    acceleration: Floats
    steps: Indices

    @staticmethod
    def of(way: Way) -> Pace:
        """The pace of a way; no limits and no steps where the tool point stands."""
        if way.length_m == 0.0:
            free = np.full(len(way.s) - 1, np.inf)
            return Pace(way.s, free, free, np.empty(0, dtype=np.intp))
        speed, acceleration = way.asked
        bent = way.bends >= STRAIGHT_PER_M
        along = np.where(bent, BEND_SHARE, 1.0) * acceleration
        with np.errstate(divide="ignore"):
            over = np.sqrt(BEND_SHARE * acceleration / way.bends)
        speed = np.where(bent, np.minimum(speed, over), speed)
        rows = np.searchsorted(way.s, way.contour.joints_m)
        least = np.stack([np.minimum.reduceat(v, rows[:-1]) for v in (speed, acceleration)])
        ratio = least[:, 1:] / least[:, :-1]
        abrupt = np.maximum(ratio, 1.0 / ratio).max(axis=0) > ABRUPT
        return Pace(way.s, speed, along, rows[1:-1][abrupt])

    def between(self, begin: int, end: int) -> tuple[float, float]:
        """Speed and acceleration that are allowed all the way between two rows."""
        part = slice(begin, end)
        return float(self.speed[part].min()), float(self.acceleration[part].min())

    def best_step(self, begin: int, end: int) -> int | None:
        """The step between two rows at which a stop takes least, as far as the tool rules."""
        low, high = np.searchsorted(self.steps, [begin + 1, end])
        inner = self.steps[low:high]
        if not len(inner):
            return None
        at, part = inner - begin, slice(begin, end)
        before = [np.minimum.accumulate(v[part])[at - 1] for v in (self.speed, self.acceleration)]
        behind = [
            np.minimum.accumulate(v[part][::-1])[::-1][at] for v in (self.speed, self.acceleration)
        ]
        took_s = _rest_to_rest_s(self.s[inner] - self.s[begin], *before)
        took_s += _rest_to_rest_s(self.s[end] - self.s[inner], *behind)
        return int(inner[took_s.argmin()])


def _rest_to_rest_s(length: Floats, speed: Floats, acceleration: Floats) -> Floats:
    """The time of trapezoids of speed (k,)."""
    peak = np.minimum(speed, np.sqrt(length * acceleration))
    return np.asarray(length / peak + peak / acceleration)
