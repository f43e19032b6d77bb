"""The time law of one block: from rest to rest over a way of 1, with S-shaped ramps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

BISECTIONS = 40
"""Halvings of a ramp's time: below rounding for ramps of seconds."""


@dataclass(frozen=True)
class Profile:
    """A trapezoid of speed whose acceleration builds up and fades linearly in `smooth_s`.

    It is a trapezoid with the ramp `peak / acceleration`, smoothed by a moving average over
    `smooth_s`; so a block takes 1 / peak + peak / acceleration + smooth_s.

    Attributes:
        peak: speed of the cruise, 1/s.
        acceleration: 1/s2.
        smooth_s: time in which the acceleration builds up.
        rise_s: time from rest to `peak`; the end is the beginning reversed.
        duration_s: time of the whole way.
    """

    peak: float
    acceleration: float
    smooth_s: float
    rise_s: float
    duration_s: float

    @classmethod
    def plan(cls, speed: float, acceleration: float, filter_s: float) -> Profile:
        """The fastest one within `speed` (1/s) and `acceleration` (1/s2); both may be infinite."""
        if math.isinf(speed):
            return cls(0.0, 0.0, 0.0, 0.0, 0.0)
        peak = min(speed, _triangle_peak(acceleration, filter_s))
        smooth_s = min(filter_s, peak / acceleration)
        rise_s = peak / acceleration + smooth_s
        return cls(peak, acceleration, smooth_s, rise_s, 1.0 / peak + rise_s)

    def at(self, t_s: float) -> tuple[float, float, float]:
        """Way, speed and acceleration `t_s` after the start; before and after it rests."""
        left_s = self.duration_s - t_s
        if left_s <= 0.0:
            return 1.0, 0.0, 0.0
        if t_s < self.rise_s:
            return self._ramp(t_s) if t_s > 0.0 else (0.0, 0.0, 0.0)
        if left_s < self.rise_s:
            way, speed, acceleration = self._ramp(left_s)
            return 1.0 - way, speed, -acceleration
        return self.peak * (t_s - self.rise_s / 2.0), self.peak, 0.0

    def _ramp(self, t_s: float) -> tuple[float, float, float]:
        a, w = self.acceleration, self.smooth_s
        if t_s < w:
            x = a * t_s / w
            return x * t_s * t_s / 6.0, x * t_s / 2.0, x
        u = self.rise_s - t_s
        if u > w:
            return a * (t_s * (t_s - w) / 2.0 + w * w / 6.0), a * (t_s - w / 2.0), a
        x = a * u / w if w > 0.0 else 0.0
        way = self.peak * (self.rise_s / 2.0 - u) + x * u * u / 6.0
        return way, self.peak - x * u / 2.0, x

    def time_to(self, way: float) -> float:
        """The time after which `way` is covered; the whole duration for 1 and more."""
        if way <= 0.0:
            return 0.0
        if way >= 1.0:
            return self.duration_s
        return _bisect(lambda t_s: self.at(t_s)[0] - way, self.duration_s)

    def ramp_time_to_speed(self, share: float) -> float:
        """The time after which the beginning has `share` of `peak`."""
        return _bisect(lambda t_s: self.at(t_s)[1] - share * self.peak, self.rise_s)


def _triangle_peak(acceleration: float, filter_s: float) -> float:
    """The speed at which the two ramps alone cover the whole way.

    They do when 1 / peak = rise; with a rise of twice the ramp while that is below the filter.
    """
    peak = math.sqrt(acceleration / 2.0)
    if peak / acceleration <= filter_s:
        return peak
    return acceleration * (math.sqrt(filter_s**2 + 4.0 / acceleration) - filter_s) / 2.0


def _bisect(rising: Callable[[float], float], high: float) -> float:
    low = 0.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        if rising(middle) < 0.0:
            low = middle
        else:
            high = middle
    return high
