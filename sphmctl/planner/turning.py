"""How the tool is turned along a way: one class per rule, all exact functions of the arc length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.spline import Track
from sphmctl.robots.geometry import angle_between


class Turning(Protocol):
    """The tool's orientation along a way."""

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """Rotations (n, 3, 3) at arc lengths s (n,), where the way has points p, tangents t."""


@dataclass(frozen=True)
class Held:
    """One orientation (3, 3) all along."""

    rotation: Floats

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """The same everywhere."""
        return np.broadcast_to(self.rotation, (len(s_m), 3, 3))


@dataclass(frozen=True)
class Between:
    """The shortest turn from one orientation to another, at a constant rate; never half a turn."""

    begin: Floats
    end: Floats
    length_m: float

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """The share of the turn that s is of the length."""
        angle = float(angle_between(self.begin, self.end))
        D = self.begin.T @ self.end
        axis = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
        norm = float(np.linalg.norm(axis))
        if norm == 0.0:
            return np.broadcast_to(self.begin, (len(s_m), 3, 3))
        return np.asarray(self.begin @ about(axis / norm, s_m / self.length_m * angle))


@dataclass(frozen=True)
class Heading:
    """Turns about a normal as the way's direction does, seen along the normal.

    Attributes:
        rotation: (3, 3), where the tangent is `tangent` (3,).
        normal: unit vector, (3,).
    """

    rotation: Floats
    tangent: Floats
    normal: Floats

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """`rotation`, turned by the angle from `tangent` to t about the normal."""
        n, begin = self.normal, self.tangent
        sine = t @ np.cross(n, begin)
        cosine = t @ begin - (t @ n) * float(begin @ n)
        return np.asarray(about(n, np.arctan2(sine, cosine)) @ self.rotation)


@dataclass(frozen=True)
class RoundAxis:
    """Turns about a cylinder's axis as the point goes round it.

    Attributes:
        rotation: (3, 3), where the point is `begin` (3,).
        centre: a point on the axis, (3,).
        axis: unit vector, (3,).
    """

    rotation: Floats
    begin: Floats
    centre: Floats
    axis: Floats

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """`rotation`, turned by the angle from `begin` to p about the axis."""
        x = self.begin - self.centre
        x = x - (x @ self.axis) * self.axis
        out = p - self.centre
        angle = np.arctan2(out @ np.cross(self.axis, x), out @ x)
        return np.asarray(about(self.axis, angle) @ self.rotation)


@dataclass(frozen=True)
class RoundCentre:
    """Turns the shortest way as the direction from a sphere's centre does; never by half a turn."""

    rotation: Floats
    begin: Floats
    centre: Floats

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """`rotation`, turned by the shortest turn from the begin's direction to p's."""
        return np.asarray(
            shortest(_unit(self.begin - self.centre), _unit(p - self.centre)) @ self.rotation
        )


@dataclass(frozen=True)
class Woven:
    """Quaternions along a track, brought to length 1."""

    track: Track

    def at(self, s_m: Floats, p: Floats, t: Floats) -> Floats:
        """The track's rotations."""
        return to_rotation(self.track.at(s_m)[0])


def about(axis: Floats, angle_rad: Floats) -> Floats:
    """Rotations (n, 3, 3) by angles (n,) about a unit vector (3,) (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    part = np.asarray(angle_rad)[:, None, None]
    half = np.sin(part / 2.0)
    return np.asarray(np.eye(3) + np.sin(part) * K + 2.0 * half * half * (K @ K))


def shortest(begin: Floats, ends: Floats) -> Floats:
    """Rotations (n, 3, 3) that take a unit vector (3,) the shortest way to others (n, 3)."""
    v = np.cross(begin, ends)
    K = np.zeros((len(v), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    K -= np.swapaxes(K, 1, 2)
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + ends @ begin)[:, None, None])


def to_quaternion(R: Floats) -> Floats:
    """Quaternions w, x, y, z (n, 4) of rotations (n, 3, 3), each in its neighbour's half."""
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    a, b, c = R[:, 2, 1], R[:, 0, 2], R[:, 1, 0]
    d, e, f = R[:, 1, 2], R[:, 2, 0], R[:, 0, 1]
    # Four times the products of the components; the row of the largest is the accurate one.
    rows = np.stack(
        [
            np.stack([1.0 + xx + yy + zz, a - d, b - e, c - f], axis=1),
            np.stack([a - d, 1.0 + xx - yy - zz, c + f, b + e], axis=1),
            np.stack([b - e, c + f, 1.0 - xx + yy - zz, a + d], axis=1),
            np.stack([c - f, b + e, a + d, 1.0 - xx - yy + zz], axis=1),
        ],
        axis=1,
    )
    largest = np.argmax(np.stack([rows[:, i, i] for i in range(4)], axis=1), axis=1)
    q = rows[np.arange(len(R)), largest]
    q = _unit(q)
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(q * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def to_rotation(q: Floats) -> Floats:
    """Rotations (n, 3, 3) of quaternions (n, 4) of any length but 0."""
    w, x, y, z = _unit(q).T
    R = np.empty((len(q), 3, 3))
    R[:, 0, 0], R[:, 0, 1], R[:, 0, 2] = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
    )
    R[:, 1, 0], R[:, 1, 1], R[:, 1, 2] = (
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
    )
    R[:, 2, 0], R[:, 2, 1], R[:, 2, 2] = (
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )
    return R


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
