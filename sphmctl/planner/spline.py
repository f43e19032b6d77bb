"""Values over a rising parameter: slopes of smooth and of monotone cubics, and tracks made of them.

A track is a chain of cubics between knots, each given by values and slopes at its ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats


def smooth_slopes(x: Floats, y: Floats, closed: bool = False) -> Floats:
    """Slopes (n, m) at x (n,) with which the cubics through y (n, m) are C2.

    The ends are free (no second derivative there), or meet: then y[0] must equal y[-1].
    """
    h = np.diff(x)
    d = np.diff(y, axis=0) / h[:, None]
    if len(h) == 1:
        return np.stack([d[0], d[0]])
    if not closed:
        low = np.concatenate([[0.0], h[1:], [1.0]])
        main = np.concatenate([[2.0], 2.0 * (h[:-1] + h[1:]), [2.0]])
        high = np.concatenate([[1.0], h[:-1], [0.0]])
        inner = 3.0 * (h[1:, None] * d[:-1] + h[:-1, None] * d[1:])
        return _solve(low, main, high, np.concatenate([3.0 * d[:1], inner, 3.0 * d[-1:]]))
    before, h_before = np.roll(d, 1, axis=0), np.roll(h, 1)
    right = 3.0 * (h[:, None] * before + h_before[:, None] * d)
    slopes = _solve_round(h, 2.0 * (h_before + h), h_before, right)
    return np.concatenate([slopes, slopes[:1]])


def monotone_slopes(x: Floats, y: Floats) -> Floats:
    """Slopes (n, m) with which the cubics through y (n, m) overshoot none of its values.

    Steffen, Astron. Astrophys. 239 (1990) 443, equation 11; the ends take the chord's slope. Two
    points give a straight line.
    """
    h = np.diff(x)[:, None]
    d = np.diff(y, axis=0) / h
    slopes = np.concatenate([d[:1], d[-1:]]) if len(d) == 1 else np.empty_like(y)
    slopes[0], slopes[-1] = d[0], d[-1]
    if len(d) > 1:
        mean = np.abs(d[:-1] * h[1:] + d[1:] * h[:-1]) / (h[:-1] + h[1:])
        least = np.minimum(np.minimum(np.abs(d[:-1]), np.abs(d[1:])), 0.5 * mean)
        slopes[1:-1] = (np.sign(d[:-1]) + np.sign(d[1:])) * least
    return slopes


def _solve(low: Floats, main: Floats, high: Floats, right: Floats) -> Floats:
    """Thomas's algorithm for a tridiagonal system, (n,) three times, and right sides (n, m)."""
    a, c, count = low.tolist(), high.tolist(), len(main)
    pivots = main.tolist()
    factors = [0.0] * count
    for i in range(1, count):
        factors[i] = a[i] / pivots[i - 1]
        pivots[i] -= factors[i] * c[i - 1]
    answers = []
    for column in right.T.tolist():
        for i in range(1, count):
            column[i] -= factors[i] * column[i - 1]
        column[-1] /= pivots[-1]
        for i in range(count - 2, -1, -1):
            column[i] = (column[i] - c[i] * column[i + 1]) / pivots[i]
        answers.append(column)
    return np.array(answers).T


def _solve_round(low: Floats, main: Floats, high: Floats, right: Floats) -> Floats:
    """The same where the first and the last row are neighbours too (Sherman and Morrison)."""
    corner = -main[0]
    changed = main.copy()
    changed[0] -= corner
    changed[-1] -= high[-1] * low[0] / corner
    extra = np.zeros(len(main))
    extra[0], extra[-1] = corner, high[-1]
    both = _solve(low, changed, high, np.column_stack([right, extra]))
    y, z = both[:, :-1], both[:, -1]
    share = (y[0] + low[0] / corner * y[-1]) / (1.0 + z[0] + low[0] / corner * z[-1])
    return np.asarray(y - z[:, None] * share)


@dataclass(frozen=True)
class Track:
    """Values over arc length, continuous with their slopes.

    Attributes:
        s_m: knots, rising, (k,).
        values, slopes: at the knots, (k, m).
    """

    s_m: Floats
    values: Floats
    slopes: Floats

    @staticmethod
    def monotone(s_m: Floats, values: Floats) -> Track:
        """Through values (k, m) without overshoot; linear between two."""
        return Track(s_m, values, monotone_slopes(s_m, values))

    @staticmethod
    def smooth(s_m: Floats, values: Floats, closed: bool = False) -> Track:
        """Through values (k, m) with continuous second derivatives."""
        return Track(s_m, values, smooth_slopes(s_m, values, closed))

    def at(self, s_m: Floats) -> tuple[Floats, Floats]:
        """Values and slopes (n, m) at s (n,)."""
        i = np.clip(np.searchsorted(self.s_m, s_m, "right") - 1, 0, len(self.s_m) - 2)
        h = (self.s_m[i + 1] - self.s_m[i])[:, None]
        u = (s_m[:, None] - self.s_m[i][:, None]) / h
        v = 1.0 - u
        a, b = self.values[i], self.values[i + 1]
        p, q = self.slopes[i], self.slopes[i + 1]
        value = a * v * v * (1.0 + 2.0 * u) + b * u * u * (3.0 - 2.0 * u)
        value += h * (p * u * v * v - q * u * u * v)
        slope = 6.0 * u * v * (b - a) / h + p * v * (1.0 - 3.0 * u) + q * u * (3.0 * u - 2.0)
        return value, slope

    def part(self, begin_m: float, end_m: float) -> Track:
        """The same values from one s to another, which then count from 0."""
        inner = self.s_m[(self.s_m > begin_m) & (self.s_m < end_m)]
        s = np.concatenate([[begin_m], inner, [end_m]])
        return Track(s - begin_m, *self.at(s))


def chain(tracks: list[Track], begins_m: list[float]) -> Track:
    """Tracks one after the other, each from its place on; neighbours agree where they meet."""
    s = [track.s_m + begin for track, begin in zip(tracks, begins_m, strict=True)]
    keep = [slice(1 if i else 0, None) for i in range(len(tracks))]
    return Track(
        np.concatenate([x[k] for x, k in zip(s, keep, strict=True)]),
        np.concatenate([track.values[k] for track, k in zip(tracks, keep, strict=True)]),
        np.concatenate([track.slopes[k] for track, k in zip(tracks, keep, strict=True)]),
    )
