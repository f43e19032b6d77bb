"""Ways of the tool point by arc length, and shapes: a way with the tool's orientation on it.

Straight lines, and arcs, circles and helices by their formulas; curves are in curve.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.planner.turning import Turning
from sphmctl.robots.geometry import from_parts

RADIUS_LIMIT_M = 100.0
"""Three points on a flatter arc lie on a line, as far as their millimetres can tell."""

APART_M = 1e-6
"""Points closer than this are one."""


class Way(Protocol):
    """A curve of the tool point, by arc length.

    Attributes:
        joints_m: where its pieces begin and end, from 0 to the length.
    """

    @property
    def length_m(self) -> float:
        """How long it is."""

    @property
    def joints_m(self) -> Floats:
        """Arc lengths between which it is smooth."""

    @property
    def normal(self) -> Floats | None:
        """Normal of its plane or axis; None when it has none."""

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents and their derivatives by arc length, (n, 3) each, at s (n,)."""


@dataclass(frozen=True)
class Segment:
    """A straight line between two points (3,)."""

    begin: Floats
    end: Floats

    normal = None

    @property
    def length_m(self) -> float:
        """How long it is."""
        return float(np.linalg.norm(self.end - self.begin))

    @property
    def joints_m(self) -> Floats:
        """Its ends."""
        return np.array([0.0, self.length_m])

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents, no bend."""
        share = s_m[:, None] / self.length_m
        p = (1.0 - share) * self.begin + share * self.end
        t = np.broadcast_to((self.end - self.begin) / self.length_m, p.shape)
        return p, t, np.zeros_like(p)


@dataclass(frozen=True)
class Coil:
    """An arc, a circle or a helix: p = centre + r (cos f x + sin f y) + rise f z.

    Attributes:
        centre: of the circle that it begins on, (3,).
        x, y, normal: unit vectors, (3,); x points to its begin.
        angle_rad: how far it turns; the sense of y is positive.
        rise_m: along the normal per radian of |f|.
    """

    centre: Floats
    x: Floats
    y: Floats
    normal: Floats
    radius_m: float
    angle_rad: float
    rise_m: float = 0.0

    @property
    def _pace(self) -> float:
        """Arc length per radian."""
        return float(np.hypot(self.radius_m, self.rise_m))

    @property
    def length_m(self) -> float:
        """How long it is."""
        return self._pace * abs(self.angle_rad)

    @property
    def joints_m(self) -> Floats:
        """Its ends and its quarters, so that no row of a grid misses a turn."""
        quarters = int(np.ceil(abs(self.angle_rad) / (np.pi / 2.0) - 1e-9))
        return np.linspace(0.0, self.length_m, max(quarters, 1) + 1)

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents and their derivatives by arc length."""
        turned = (s_m / self._pace)[:, None]
        sense = np.sign(self.angle_rad)
        cosine, sine = np.cos(turned), sense * np.sin(turned)
        r, pace = self.radius_m, self._pace
        out = cosine * self.x + sine * self.y
        p = self.centre + r * out + self.rise_m * turned * self.normal
        across = sense * (cosine * self.y - sine * self.x)
        return p, (r * across + self.rise_m * self.normal) / pace, -r / pace**2 * out


@dataclass(frozen=True)
class Spot:
    """No way at all: the tool point stands while the tool turns or the wrist moves.

    Its length is nominal, to have something to count along.
    """

    point: Floats
    length_m: float

    normal = None

    @property
    def joints_m(self) -> Floats:
        """Its ends."""
        return np.array([0.0, self.length_m])

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """The point; no direction."""
        p = np.broadcast_to(self.point, (len(s_m), 3))
        return p, np.zeros_like(p), np.zeros_like(p)


@dataclass(frozen=True)
class Shape:
    """A way and the tool's orientation along it."""

    way: Way
    turning: Turning

    @property
    def length_m(self) -> float:
        """How long the way is."""
        return self.way.length_m

    def pose(self, s_m: Floats) -> Floats:
        """Tool poses in the path's base (n, 4, 4) at arc lengths s (n,)."""
        return self.follow(s_m)[0]

    def follow(self, s_m: Floats) -> tuple[Floats, Floats]:
        """Tool poses (n, 4, 4) and unit tangents (n, 3) at arc lengths s (n,)."""
        p, t, _ = self.way.at(s_m)
        return from_parts(self.turning.at(s_m, p, t), p), t


def arc(begin: Floats, via: Floats, end: Floats, full: bool = False) -> Coil:
    """The arc, or the full circle, from one point through another to a third; (3,) each.

    Raises:
        InvalidError: points that coincide or lie on a line.
    """
    for one, other in ((begin, via), (via, end), (begin, end)):
        if np.linalg.norm(one - other) < APART_M:
            raise InvalidError(f"{_mm(one)} is there twice; the three points must differ")
    a, b = via - begin, end - begin
    n = np.cross(a, b)
    square = float(n @ n)
    size = np.linalg.norm(a) * np.linalg.norm(b) * np.linalg.norm(a - b)
    if size >= 2.0 * RADIUS_LIMIT_M * np.sqrt(square):
        raise InvalidError(
            f"{_mm(begin)}, {_mm(via)} and {_mm(end)} lie on a line; move the middle one off it, "
            "or use 'lin'"
        )
    to_centre = np.cross((a @ a) * b - (b @ b) * a, n) / (2.0 * square)
    made = _coil(begin, begin + to_centre, n / np.sqrt(square), 2.0 * np.pi)
    if full:
        return made
    spoke = end - made.centre
    angle = float(np.arctan2(spoke @ made.y, spoke @ made.x)) % (2.0 * np.pi)
    return _coil(begin, made.centre, made.normal, angle)


def helix(begin: Floats, centre: Floats, normal: Floats, angle_rad: float, pitch_m: float) -> Coil:
    """A turn about the axis through `centre` along `normal`; pitch 0 makes a circle.

    Raises:
        InvalidError: the begin stands on the axis.
    """
    n = normal / np.linalg.norm(normal)
    foot = centre + n * float((begin - centre) @ n)
    if np.linalg.norm(begin - foot) < APART_M:
        raise InvalidError(
            f"the begin {_mm(begin)} stands on the axis; move the centre {_mm(centre)} off it"
        )
    return _coil(begin, foot, n, angle_rad, pitch_m / (2.0 * np.pi))


def _coil(begin: Floats, centre: Floats, n: Floats, angle_rad: float, rise_m: float = 0.0) -> Coil:
    spoke = begin - centre
    radius = float(np.linalg.norm(spoke))
    x = spoke / radius
    return Coil(centre, x, np.cross(n, x), n, radius, angle_rad, rise_m)


def _mm(p: Floats) -> str:
    return "[" + ", ".join(f"{1000.0 * value:.6g}" for value in p) + "]"
