"""A motion along a path over time: pieces of constant acceleration, smoothed to bound the jerk.

The smoothed motion is the mean of the pieces' s over the last `filter_s` seconds (a box filter): on
the same path, its acceleration a ramp where the pieces' jumps, and longer by the filter. At every
stop the pieces rest for as long, so that no mean reaches across a stop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.track import Indices

SEARCH_STEPS = 80
"""Of the search for the time of an s: 53 halvings find the last digit, most need 5 steps."""


@dataclass(frozen=True)
class Pieces:
    """K pieces of constant acceleration from rest to rest, and the filter over them.

    Attributes:
        t, s, speed, area: at the pieces' ends, (K + 1,); area is the integral of s from 0.
        acceleration: of each piece, (K,).
        filter_s: length of the box; 0 leaves the pieces as they are.
    """

    t: Floats
    s: Floats
    speed: Floats
    area: Floats
    acceleration: Floats
    filter_s: float

    @property
    def duration_s(self) -> float:
        """From rest to rest."""
        return float(self.t[-1]) + self.filter_s

    def at(self, t_s: Floats) -> tuple[Floats, Floats, Floats]:
        """s, speed and acceleration (m,) at times (m,); at rest before and after."""
        t = np.clip(t_s, 0.0, self.duration_s)
        if self.filter_s == 0.0:
            _, s, speed, acceleration = self._raw(t)
            return self.s[0] + s, np.maximum(speed, 0.0), np.where(t_s == t, acceleration, 0.0)
        now, before = self._raw(t), self._raw(t - self.filter_s)
        area, s, speed = ((a - b) / self.filter_s for a, b in zip(now[:3], before[:3], strict=True))
        where = np.clip(self.s[0] + area, self.s[0], self.s[-1])
        where[t >= self.duration_s] = self.s[-1]
        return where, np.maximum(s, 0.0), speed

    def jerk(self, t_s: Floats) -> Floats:
        """Third derivative (m,) at times (m,), of a filtered motion."""
        inside = (t_s >= 0.0) & (t_s <= self.duration_s)
        change = self._raw(t_s)[3] - self._raw(t_s - self.filter_s)[3]
        return np.asarray(np.where(inside, change / self.filter_s, 0.0))

    def _raw(self, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Area, s, speed and acceleration of the pieces, s counted from their begin."""
        piece = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        begin = self.t[piece]
        past = np.clip(t - begin, 0.0, self.t[piece + 1] - begin)
        s, v, a = self.s[piece] - self.s[0], self.speed[piece], self.acceleration[piece]
        after = np.maximum(t - self.t[-1], 0.0) * (self.s[-1] - self.s[0])
        area = self.area[piece] + past * (s + past * (v / 2.0 + past * a / 6.0)) + after
        moves = (t >= 0.0) & (t <= self.t[-1])
        return area, s + past * (v + past * a / 2.0), v + past * a, np.where(moves, a, 0.0)

    def when(self, s: Floats) -> Floats:
        """The times (m,) at which s (m,) are reached: Newton's steps, halvings where they stray."""
        marks = np.unique(np.concatenate([self.t, self.t + self.filter_s]))
        there = np.maximum.accumulate(self.at(marks)[0])
        place = np.clip(np.searchsorted(there, s, side="right") - 1, 0, len(marks) - 2)
        low, high = marks[place], marks[place + 1]
        rise = there[place + 1] - there[place]
        share = np.divide(s - there[place], rise, out=np.zeros_like(s), where=rise > 0.0)
        t = low + np.clip(share, 0.0, 1.0) * (high - low)
        close = 4.0 * np.finfo(np.float64).eps * (self.s[-1] - self.s[0])
        left = np.arange(len(s))
        for _ in range(SEARCH_STEPS):
            here, speed, _ = self.at(t[left])
            miss = here - s[left]
            left, miss, speed = (x[np.abs(miss) > close] for x in (left, miss, speed))
            if not len(left):
                break
            now = t[left]
            low[left] = np.where(miss < 0.0, now, low[left])
            high[left] = np.where(miss > 0.0, now, high[left])
            with np.errstate(divide="ignore"):
                step = now - miss / speed
            stray = ~((step > low[left]) & (step < high[left]))
            t[left] = np.where(stray, (low[left] + high[left]) / 2.0, step)
        return np.where(s <= self.s[0], 0.0, np.where(s >= self.s[-1], self.duration_s, t))

    def slowed(self, factor: float) -> Pieces:
        """The same motion, `factor` times as long."""
        return Pieces(
            self.t * factor,
            self.s,
            self.speed / factor,
            self.area * factor,
            self.acceleration / factor**2,
            self.filter_s * factor,
        )


def make_pieces(s: Floats, squared: Floats, stops: Indices, filter_s: float) -> Pieces:
    """The pieces between rows s (N + 1,) passed at squared speeds (N + 1,); rests at `stops`."""
    speed = np.sqrt(squared)
    step = np.diff(s)
    took = 2.0 * step / (speed[1:] + speed[:-1])
    acceleration = np.diff(squared) / (2.0 * step)
    if filter_s > 0.0:
        took = np.insert(took, stops, filter_s)
        acceleration = np.insert(acceleration, stops, 0.0)
        s, speed = np.insert(s, stops, s[stops]), np.insert(speed, stops, 0.0)
    return _pieces(took, s, speed, acceleration, filter_s)


def _pieces(took: Floats, s: Floats, v: Floats, a: Floats, filter_s: float) -> Pieces:
    t = np.append(0.0, np.cumsum(took))
    inside = took * ((s[:-1] - s[0]) + took * (v[:-1] / 2.0 + took * a / 6.0))
    return Pieces(t, s, v, np.append(0.0, np.cumsum(inside)), a, filter_s)
