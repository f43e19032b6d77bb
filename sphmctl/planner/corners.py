"""Blended corners: from one shape into the next along a curve that touches both and keeps bends.

The corner is a polynomial of fifth degree with point, tangent and bend of the two shapes where it
leaves them. Orientation (as a quaternion) and wrist keep their values and rates there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.pathfile import Move
from sphmctl.planner import curve
from sphmctl.planner.drawing import BLENDED_RAD, HALF_TURN_SLACK_RAD, Part
from sphmctl.planner.shapes import Shape
from sphmctl.planner.spline import Track
from sphmctl.planner.turning import Woven, to_quaternion

STEP_M = 1e-6
"""For rates of the orientation: differences over it err by 1e-10 rad/m from rounding."""

BEND_SHARE = 0.5
"""Of a neighbour's radius that a corner may take: it stays a corner, and does not loop."""

ROUNDING_M = 1e-12
"""By which a corner may seem to reach further than its blend."""

TRIES = 10
"""Halvings of a corner that reaches too far."""

LOOKS = 65
"""Places on a corner at which its distance from the corner's point is measured."""


@dataclass(frozen=True)
class Corner:
    """A rounded corner.

    Attributes:
        cut_m: how far before the end of one shape it begins, and after the other's begin it ends.
        behind: the move that comes after it.
        wrist: the wrist's track along it, or None.
    """

    shape: Shape
    cut_m: float
    behind: Move
    wrist: Track | None


@dataclass(frozen=True)
class Rate:
    """A tool's orientation as a quaternion (4,), and its derivative by arc length."""

    quaternion: Floats
    slope: Floats


def pose_rate(shape: Shape, s_m: float) -> Rate:
    """Orientation and its rate on a shape at s, from inside the shape at its ends."""
    low = min(max(s_m - STEP_M, 0.0), shape.length_m - 2.0 * STEP_M)
    s = low + STEP_M * np.arange(3)
    q = to_quaternion(shape.pose(np.append(s_m, s))[:, :3, :3])
    # Derivative at s_m of the parabola through the three.
    x = (s_m - s[1]) / STEP_M
    weights = np.array([x - 0.5, -2.0 * x, x + 0.5]) / STEP_M
    return Rate(q[0], weights @ q[1:])


def corner(before: Part, behind: Part, one: Track | None, other: Track | None) -> Corner:
    """The corner between two parts, as large as the blend and both of them allow.

    Raises:
        InvalidError: the path turns back there.
    """
    end = before.shape.length_m
    p, t, bend = before.shape.way.at(np.array([end]))
    _, on, bend_on = behind.shape.way.at(np.zeros(1))
    if float(t[0] @ on[0]) < np.cos(BLENDED_RAD):
        raise _none("the path turns back")
    blend_m = before.move.blend_mm / 1000.0
    cut = min(blend_m, _room(before, -1), _room(behind, 0))
    sharpest = max(float(np.linalg.norm(bend)), float(np.linalg.norm(bend_on)))
    if sharpest > 0.0:
        cut = min(cut, BEND_SHARE / sharpest)
    for _ in range(TRIES):
        try:
            way = _way(before.shape, behind.shape, cut)
        except InvalidError:
            cut /= 2.0
            continue
        points = way.at(np.linspace(0.0, way.length_m, LOOKS))[0]
        if np.linalg.norm(points - p, axis=1).max() <= blend_m + ROUNDING_M:
            break
        cut /= 2.0
    else:
        raise _none("no smooth curve fits")
    q = _quaternions(before, behind, cut, way.length_m)
    wrist = None
    if one is not None and other is not None:
        (a, at_a), (b, at_b) = one.at(np.array([end - cut])), other.at(np.array([cut]))
        ends = np.array([0.0, way.length_m])
        wrist = Track(ends, np.concatenate([a, b]), np.concatenate([at_a, at_b]))
    return Corner(Shape(way, Woven(q)), cut, behind.move, wrist)


def _room(part: Part, piece: int) -> float:
    """How much of a part a corner may take: half of it, or its whole first or last piece."""
    size = np.diff(part.shape.way.joints_m)
    return float(min(part.shape.length_m / 2.0, size[piece]))


def _way(before: Shape, behind: Shape, cut: float) -> curve.Curve:
    a, t, bend = before.way.at(np.array([before.length_m - cut]))
    b, on, bend_on = behind.way.at(np.array([cut]))
    reach = cut * float(curve.reach_share(t, on)[0])
    return curve.Curve.of(
        curve.quintic(a, reach * t, reach**2 * bend, b, reach * on, reach**2 * bend_on)
    )


def _quaternions(before: Part, behind: Part, cut: float, length: float) -> Track:
    one = pose_rate(before.shape, before.shape.length_m - cut)
    other = pose_rate(behind.shape, cut)
    cosine = float(one.quaternion @ other.quaternion)
    if abs(cosine) < np.sin(HALF_TURN_SLACK_RAD / 2.0):
        raise _none("the tool turns by half a turn")
    sign = np.sign(cosine)
    return Track(
        np.array([0.0, length]),
        np.stack([one.quaternion, sign * other.quaternion]),
        np.stack([one.slope, sign * other.slope]),
    )


def _none(why: str) -> InvalidError:
    return InvalidError(
        f"its corner with the next move cannot be blended: {why} there; leave 'blend_mm' out"
    )
