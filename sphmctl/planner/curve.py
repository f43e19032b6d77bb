"""Polynomial curves driven by arc length: splines, rounded polylines, corners.

A curve is a chain of polynomial pieces in u from 0 to 1. Arc length is integrated by Gauss and
Legendre's rule over intervals cut so small that it is exact to rounding, and inverted by Newton's
method; so points lie on the polynomials themselves, and s is their arc length to about 1e-15 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.planner.spline import smooth_slopes

Indices: TypeAlias = NDArray[np.intp]

NODES = 8
"""Points of the rule on one interval; exact for polynomials of degree 15."""

LENGTH_TOLERANCE = 1e-13
"""Relative; an interval whose halves differ more from the whole is cut in two."""

HALVINGS = 24
"""A piece that needs more has a cusp."""

NEWTON_STEPS = 20
"""A handful is enough for any curve without a cusp."""

NEWTON_TOLERANCE = 1e-8
"""Relative error before the last step, which squares it."""

CHUNK = 2048
"""Rows integrated at a time, whose intermediate values stay in the processor's cache."""

SLOWEST_SHARE = 1e-3
"""Of a piece's mean |dp/du|: slower, the curve all but stands there and turns on the spot."""

SHORTEST_M = 1e-14
"""A straight piece shorter than this between two corners is rounding."""

_X, _W = np.polynomial.legendre.leggauss(NODES)
_X, _W = (_X + 1.0) / 2.0, _W / 2.0


@dataclass(frozen=True)
class Curve:
    """A chain of polynomial pieces by arc length.

    Attributes:
        coefficients: of rising powers of u, (m, degree + 1, 3).
        piece: which piece an interval lies in, (k,).
        low, high: u at its ends, (k,).
        ends_m: arc length at the intervals' ends, (k + 1,).
        joints_m: arc length at the pieces' ends, (m + 1,).
    """

    coefficients: Floats
    piece: Indices
    low: Floats
    high: Floats
    ends_m: Floats
    joints_m: Floats

    @staticmethod
    def of(coefficients: Floats) -> Curve:
        """Measure a chain of pieces. Raises InvalidError where it turns on the spot."""
        count = len(coefficients)
        straight = ~np.any(coefficients[:, 2:], axis=(1, 2))
        piece = np.flatnonzero(straight)
        zero, one = np.zeros(len(piece)), np.ones(len(piece))
        done = [(piece, zero, one, np.linalg.norm(coefficients[piece, 1], axis=1))]
        piece = np.flatnonzero(~straight)
        low, high = np.zeros(len(piece)), np.ones(len(piece))
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            whole = _length(coefficients[piece], low, high)
            halves = _length(coefficients[piece], low, middle)
            halves = halves + _length(coefficients[piece], middle, high)
            rough = np.abs(halves - whole) > LENGTH_TOLERANCE * np.maximum(halves, SHORTEST_M)
            fine = ~rough
            done.append((piece[fine], low[fine], high[fine], halves[fine]))
            piece, low, high = (
                np.concatenate([piece[rough]] * 2),
                np.concatenate([low[rough], middle[rough]]),
                np.concatenate([middle[rough], high[rough]]),
            )
            if not len(piece):
                break
        if len(piece):
            raise InvalidError(_on_the_spot(coefficients[piece[0]], low[0]))
        pieces, lows, highs, lengths = (
            np.concatenate(column) for column in zip(*done, strict=True)
        )
        order = np.lexsort((lows, pieces))
        pieces = pieces[order]
        ends = np.concatenate([[0.0], np.cumsum(lengths[order])])
        joints = ends[np.searchsorted(pieces, np.arange(count + 1))]
        made = Curve(coefficients, pieces, lows[order], highs[order], ends, joints)
        made._check()
        return made

    @property
    def length_m(self) -> float:
        """Arc length of the whole."""
        return float(self.ends_m[-1])

    @property
    def normal(self) -> Floats | None:
        """Normal of the plane that fits the curve best; None for a straight line."""
        points = self.coefficients[:, 0]
        points = np.concatenate([points, points + self.coefficients[:, 1]])
        _, size, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        return None if size[1] < 1e-6 * size[0] else np.asarray(axes[2])

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents and their derivatives by arc length, (n, 3) each, at s (n,)."""
        i = np.clip(np.searchsorted(self.ends_m, s_m, "right") - 1, 0, len(self.piece) - 1)
        c = self.coefficients[self.piece[i]]
        u = self._parameter(c, i, s_m)[:, None]
        p, v, a = _derivatives(c, u)
        speed = np.linalg.norm(v, axis=1)[:, None]
        t = v / speed
        bend = (a - np.sum(a * t, axis=1)[:, None] * t) / speed**2
        return p, t, bend

    def _parameter(self, c: Floats, i: Indices, s_m: Floats) -> Floats:
        low, high = self.low[i], self.high[i]
        wanted = np.maximum(s_m - self.ends_m[i], 0.0)
        length = self.ends_m[i + 1] - self.ends_m[i]
        u = np.minimum(low + (high - low) * wanted / length, high)
        rows = np.flatnonzero(np.any(c[:, 2:], axis=(1, 2)))
        for _ in range(NEWTON_STEPS if len(rows) else 0):
            over = _length(c[rows], low[rows], u[rows]) - wanted[rows]
            speed = np.linalg.norm(_derivatives(c[rows], u[rows, None])[1], axis=1)
            u[rows] = np.clip(u[rows] - over / speed, low[rows], high[rows])
            rows = rows[np.abs(over) > NEWTON_TOLERANCE * length[rows]]
            if not len(rows):
                break
        return u

    def _check(self) -> None:
        """No cusp: nowhere may the point stand while u runs on."""
        u = np.linspace(0.0, 1.0, 9)
        c = np.repeat(self.coefficients, len(u), axis=0)
        v = _derivatives(c, np.tile(u, len(self.coefficients))[:, None])[1]
        speed = np.linalg.norm(v, axis=1).reshape(-1, len(u))
        slow = speed < SLOWEST_SHARE * speed.mean(axis=1, keepdims=True)
        if slow.any():
            piece, step = (int(x[0]) for x in np.nonzero(slow))
            raise InvalidError(_on_the_spot(self.coefficients[piece], u[step]))


def _derivatives(c: Floats, u: Floats) -> tuple[Floats, Floats, Floats]:
    """Values, first and second derivatives (n, 3) of polynomials c (n, k, 3) at u (n, 1)."""
    p, v, a = c[:, -1], np.zeros_like(c[:, 0]), np.zeros_like(c[:, 0])
    for power in range(c.shape[1] - 2, -1, -1):
        a = a * u + 2.0 * v
        v = v * u + p
        p = p * u + c[:, power]
    return p, v, a


def _length(c: Floats, low: Floats, high: Floats) -> Floats:
    """Arc length (n,) of polynomials c (n, k, 3) between two u (n,)."""
    lengths = np.empty(len(low))
    for first in range(0, len(low), CHUNK):
        rows = slice(first, first + CHUNK)
        lengths[rows] = _chunk_length(c[rows], low[rows], high[rows])
    return lengths


def _chunk_length(c: Floats, low: Floats, high: Floats) -> Floats:
    u = low[:, None] + (high - low)[:, None] * _X
    total = np.zeros_like(u)
    for axis in range(3):
        v = np.zeros_like(u)
        for power in range(c.shape[1] - 1, 0, -1):
            v = v * u + power * c[:, power, axis, None]
        total += v * v
    return np.asarray((np.sqrt(total) @ _W) * (high - low))


def _on_the_spot(c: Floats, u: float) -> str:
    x, y, z = 1000.0 * _derivatives(c[None], np.array([[u]]))[0][0]
    return (
        f"the curve turns back on the spot near x {x:.1f}, y {y:.1f}, z {z:.1f} mm; add points, so "
        "that it has room to turn"
    )


def spline(points_m: Floats, closed: bool) -> Curve:
    """The C2 cubic spline through points (n, 3) by chord length; closed: ends at its begin."""
    h = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    x = np.concatenate([[0.0], np.cumsum(h)])
    slopes = smooth_slopes(x, points_m, closed)
    a, b = points_m[:-1], points_m[1:]
    p, q = h[:, None] * slopes[:-1], h[:, None] * slopes[1:]
    return Curve.of(np.stack([a, p, 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q], axis=1))


def quintic(a: Floats, va: Floats, aa: Floats, b: Floats, vb: Floats, ab: Floats) -> Floats:
    """Coefficients (n, 6, 3) from points, first and second derivatives (n, 3) at both ends."""
    d = b - a
    return np.stack(
        [
            a,
            va,
            0.5 * aa,
            10.0 * d - 6.0 * va - 4.0 * vb - 1.5 * aa + 0.5 * ab,
            -15.0 * d + 8.0 * va + 7.0 * vb + 1.5 * aa - ab,
            6.0 * d - 3.0 * va - 3.0 * vb - 0.5 * aa + 0.5 * ab,
        ],
        axis=1,
    )


def reach_share(before: Floats, behind: Floats) -> Floats:
    """|dp/du| (n,) at the ends of a corner between tangents (n, 3), as a share of its cuts.

    Found by trial: with it a corner's sharpest bend is within 1.3 times that of the circle which
    touches both sides at the cuts up to 90 degrees, and twice it at 135.
    """
    apart = np.linalg.norm(behind - before, axis=1)
    turn = 2.0 * np.arcsin(np.clip(apart / 2.0, 0.0, 1.0))
    return np.asarray(1.8 - 0.4 * turn / np.pi)


def rounded(points_m: Floats, cuts_m: Floats) -> tuple[Curve, Floats]:
    """A polyline (n, 3) whose inner corners are rounded from cuts (n - 2,) before and behind them.

    Returns:
        The curve, with curvature zero where a corner begins and ends, and the arc length of each of
        the polyline's points (n,): of the corners' middles.
    """
    way = np.diff(points_m, axis=0)
    length = np.linalg.norm(way, axis=1)
    t = way / length[:, None]
    cut = np.concatenate([[0.0], cuts_m, [0.0]])
    begin, end = points_m[:-1] + cut[:-1, None] * t, points_m[1:] - cut[1:, None] * t
    pieces = np.zeros((2 * len(way) - 1, 6, 3))
    pieces[0::2, 0], pieces[0::2, 1] = begin, (length - cut[:-1] - cut[1:])[:, None] * t
    still = np.zeros((len(cuts_m), 3))
    reach = cuts_m[:, None] * reach_share(t[:-1], t[1:])[:, None]
    pieces[1::2] = quintic(end[:-1], reach * t[:-1], still, begin[1:], reach * t[1:], still)
    keep = np.ones(len(pieces), dtype=bool)
    keep[2:-1:2] = (length - cut[:-1] - cut[1:])[1:-1] > SHORTEST_M
    keep[1::2] = cuts_m > 0.0
    curve = Curve.of(pieces[keep])
    after = np.concatenate([[0], np.cumsum(keep)])  # pieces kept before each one
    s = curve.joints_m
    corner = 2 * np.arange(len(cuts_m)) + 1
    middles = (s[after[corner]] + s[after[corner + 1]]) / 2.0
    return curve, np.concatenate([[0.0], middles, [curve.length_m]])
