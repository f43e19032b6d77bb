"""A path as its timing sees it: joints and tool point over s, with derivatives on both sides.

Where two shapes meet, the second derivative jumps; so each interval between two rows has its own
derivatives at both of its ends, taken from rows of its own shape only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats

Indices = NDArray[np.intp]

STENCIL = 5
"""Rows that a derivative is taken from: error of order 4 in the first, 3 in the second."""

LEAST_INTERVALS = 32
"""Intervals between two stops, at least: one alone would begin and end at rest and never move."""

STILL = 1e-9
"""A joint (rad) or tool point (m) that moves less on the whole path stands still: rounding."""


@dataclass(frozen=True)
class Track:
    """N intervals of a path; k columns, the joints and then x, y, z of the tool point.

    Attributes:
        s: the intervals' ends, strictly rising, (N + 1,).
        values: (N + 1, k).
        first: derivative by s at each interval's begin [0] and end [1], (2, N, k).
        second: second derivative, (2, N, k).
        stops: the rows of zero speed in the middle, ascending.
        given: the interval as the caller numbers them, (N,); long ones may have been divided.
        rows: the caller's rows, (n,), as rows of `s`.
    """

    s: Floats
    values: Floats
    first: Floats
    second: Floats
    stops: Indices
    given: Indices
    rows: Indices

    def at(self, s: Floats) -> tuple[Floats, Indices]:
        """Values (m, k) at s (m,), by cubics through values and slopes; and the intervals (m,)."""
        interval = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        share = (s - self.s[interval]) / (self.s[interval + 1] - self.s[interval])
        begin, m0, c2, c3, _ = _cubic(self, interval)
        u = share[:, None]
        return begin + u * (m0 + u * (c2 + u * c3)), interval


def make_track(values: Floats, s: Floats, joints: Sequence[int], stops: Sequence[int]) -> Track:
    """The track of values (n, k) at s (n,), n >= 2, cut at rows `joints` and `stops`."""
    n = len(s)
    still = np.ptp(values, axis=0) < STILL
    values = np.where(still, values[:1], values)
    inner = np.asarray(sorted({row for row in (*joints, *stops) if 0 < row < n - 1}), dtype=np.intp)
    halts = np.asarray(sorted({row for row in stops if 0 < row < n - 1}), dtype=np.intp)
    own = np.sort(np.concatenate([np.arange(n), inner]))
    first, second = _derivatives(values[own], s[own], np.flatnonzero(np.diff(own) == 0) + 1)
    begin = np.flatnonzero(np.diff(own))
    ends = np.stack([begin, begin + 1])
    every = np.arange(n)
    coarse = Track(s, values, first[ends], second[ends], halts, every[:-1], every)
    return _divided(coarse)


def _derivatives(values: Floats, s: Floats, cuts: Indices) -> tuple[Floats, Floats]:
    """First and second derivative (e, k) of rows, each from rows of its own piece between cuts."""
    edges = np.concatenate([[0], cuts, [len(s)]])
    sizes = np.diff(edges)
    begins, size = np.repeat(edges[:-1], sizes), np.repeat(sizes, sizes)
    first, second = np.zeros_like(values), np.zeros_like(values)
    for count in range(2, STENCIL + 1):
        rows = np.flatnonzero(np.minimum(size, STENCIL) == count)
        if not len(rows):
            continue
        low = np.clip(rows - count // 2, begins[rows], begins[rows] + size[rows] - count)
        near = low[:, None] + np.arange(count)
        away = s[near] - s[rows, None]
        scale = np.abs(away).max(axis=1, keepdims=True)
        # Weights that differentiate every polynomial through these rows exactly.
        powers = (away / scale)[:, None, :] ** np.arange(count)[None, :, None]
        wanted = np.zeros((count, 2))
        wanted[1, 0] = 1.0
        if count > 2:
            wanted[2, 1] = 2.0
        weights = np.linalg.solve(powers, np.broadcast_to(wanted, (len(rows), count, 2)))
        # Differences to the row itself: a joint that stands still has derivatives of exactly 0.
        apart = values[near] - values[rows, None]
        both = np.matmul(weights.transpose(0, 2, 1), apart)
        first[rows] = both[:, 0] / scale
        second[rows] = both[:, 1] / scale**2
    return first, second


def _cubic(track: Track, interval: Indices) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Four coefficients (m, k) by the share of an interval passed, and the intervals' lengths."""
    step = (track.s[interval + 1] - track.s[interval])[:, None]
    begin = track.values[interval]
    rise = track.values[interval + 1] - begin
    m0, m1 = track.first[0, interval] * step, track.first[1, interval] * step
    return begin, m0, 3.0 * rise - 2.0 * m0 - m1, m0 + m1 - 2.0 * rise, step


def _divided(track: Track) -> Track:
    """The same track with LEAST_INTERVALS between any two stops."""
    counts = np.diff(np.concatenate([[0], track.stops, [len(track.s) - 1]]))
    parts = np.repeat(-(-LEAST_INTERVALS // counts), counts)
    if parts.max() == 1:
        return track
    rows = np.concatenate([[0], np.cumsum(parts)])
    owner = np.repeat(np.arange(len(parts)), parts)
    begin, m0, c2, c3, step = _cubic(track, owner)
    part = np.arange(len(owner)) - rows[owner]
    low, high = part / parts[owner], (part + 1) / parts[owner]
    u, ends = low[:, None], np.stack([low, high])[:, :, None]
    first = (m0 + ends * (2.0 * c2 + 3.0 * ends * c3)) / step
    second = (2.0 * c2 + 6.0 * ends * c3) / step**2
    s = track.s[owner] + low * (track.s[owner + 1] - track.s[owner])
    return Track(
        np.append(s, track.s[-1]),
        np.concatenate([begin + u * (m0 + u * (c2 + u * c3)), track.values[-1:]]),
        first,
        second,
        rows[track.stops],
        owner,
        rows,
    )
