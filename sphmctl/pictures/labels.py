"""Where the labels of points go: off the lines, the dots, each other and the frame's edge.

Knows pixels only. Each label takes, in turn, the best of some places about its point.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sphmctl.motion import Floats

LETTER, HEIGHT = 8.6, 14.0
"""Size of a letter in bold 13 px type, on the generous side."""

GAPS = (5.0, 10.0, 16.0, 24.0)
"""From a point to its label's box; the first that is free is taken."""

WAYS = 16
"""Directions about the point."""

STEP = 2.0
"""Lines are looked at every so many pixels."""

DOT = 4.0
"""Half the size of what a dot takes."""

ON_LINE, ON_OTHER = 10.0, 100.0
"""What it costs to lie on a line; on a dot, on another label, or beyond the frame."""


def settle(
    spots: Floats, words: Sequence[str], lines: Sequence[Floats], room: tuple[float, ...]
) -> Floats:
    """Centres (m, 2) of the labels.

    Args:
        spots: the points, (m, 2).
        lines: each (n, 2); NaN interrupts one.
        room: left, top, right and bottom of where labels may be.
    """
    ink = np.concatenate([np.empty((0, 2)), *(_inked(line) for line in lines)])
    angle = 2.0 * np.pi * np.arange(WAYS) / WAYS
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = ways / np.abs(ways).max(axis=1)[:, None]  # on a box about the point
    middle = spots.mean(axis=0)
    found = np.empty_like(spots)
    halves = np.array([[len(word) * LETTER / 2.0, HEIGHT / 2.0] for word in words])
    for i, (spot, half) in enumerate(zip(spots, halves, strict=True)):
        away = spot - middle
        away = away / (np.linalg.norm(away) or 1.0)
        offsets = [square * (half + gap) for gap in GAPS]
        places = spot + np.concatenate(offsets)
        cost = np.repeat(0.5 * np.arange(len(GAPS)), WAYS) - 0.4 * np.tile(ways @ away, len(GAPS))
        low, high = np.array(room[:2]) + half, np.array(room[2:]) - half
        cost += ON_OTHER * np.any((places < low) | (places > high), axis=1)
        cost += ON_LINE * _covered(places, half, ink, np.full(2, 1.5))
        cost += ON_OTHER * _covered(places, half, spots, np.full(2, DOT))
        cost += ON_OTHER * _covered(places, half, found[:i], halves[:i])
        found[i] = places[cost.argmin()]
    return found


def _covered(places: Floats, half: Floats, others: Floats, reach: Floats) -> Floats:
    """Whether a box of half a size at places (k, 2) meets any of the others (n, 2), as 0 or 1."""
    apart = np.abs(places[:, None] - others[None])
    within = np.all(apart < half + reach, axis=2)
    return np.asarray(np.any(within, axis=1), dtype=np.float64)


def _inked(line: Floats) -> Floats:
    """Points of a line at most STEP apart; lone points too."""
    whole = np.all(np.isfinite(line), axis=1)
    both = whole[1:] & whole[:-1]
    begin, extent = line[:-1][both], np.diff(line, axis=0)[both]
    counts = np.ceil(np.linalg.norm(extent, axis=1) / STEP).astype(int) + 1
    row = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = within / counts[row]
    return np.concatenate([line[whole], begin[row] + share[:, None] * extent[row]])
