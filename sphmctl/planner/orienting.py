"""Orientation rules of the path file on a way: how the tool stands at its begin, and goes on."""

from __future__ import annotations

import numpy as np

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.pathfile import Orientation
from sphmctl.planner.shapes import APART_M, Spot, Way
from sphmctl.planner.turning import Heading, Held, RoundAxis, RoundCentre, Turning, shortest

LOOKS = 64
"""Places on each smooth piece of a short way at which a rule is tried; of a long one fewer."""

LOOKS_LIMIT = 4096
"""Places on a way in all."""

OPPOSITE = -1.0 + 1e-4
"""Cosine; directions closer to opposite have no shortest turn between them."""

STEEP_SINE = 1e-3
"""A way closer to the normal that it is to turn about has no direction seen along it."""


def aligned(rule: Orientation, way: Way, now: Floats, tangent: Floats | None) -> Floats:
    """The orientation (3, 3) at a way's begin, for a tool that stands as `now`.

    Args:
        tangent: of the way before, whose direction the tool followed too, (3,), or None.
    """
    p, t, _ = way.at(np.zeros(1))
    if rule.rule == "tangent" and tangent is not None and not isinstance(way, Spot):
        turned: Floats = Heading(now, tangent, _normal(way, now)).at(np.zeros(1), p, t)[0]
        return turned
    if rule.rule != "normal_to":
        return now
    wanted = _against(rule, p)
    if float(wanted[0] @ now[:, 2]) < OPPOSITE:
        raise InvalidError(
            f"the tool's z points away from the {rule.surface}; turn the tool at the begin, or "
            "work from the other side"
        )
    return np.asarray(shortest(now[:, 2], wanted)[0] @ now)


def turning(rule: Orientation, way: Way, begin: Floats) -> Turning:
    """The orientation along a way whose begin it is (3, 3), for all rules but "interpolated"."""
    if rule.rule == "fixed" or isinstance(way, Spot):
        return Held(begin)
    p, t = _looks(way)
    if rule.rule == "tangent":
        normal = _normal(way, begin)
        if np.linalg.norm(np.cross(t, normal), axis=1).min() < STEEP_SINE:
            raise InvalidError(
                "the path runs along the normal that the tool is to turn about; use another "
                "orientation rule here"
            )
        return Heading(begin, t[0], normal)
    wanted = _against(rule, p)
    if rule.surface == "plane":
        return Held(begin)
    centre = np.array(rule.centre_mm) / 1000.0
    if rule.surface == "cylinder":
        return RoundAxis(begin, p[0], centre, _unit(np.array(rule.axis)))
    if (wanted @ wanted[0]).min() < OPPOSITE:
        raise InvalidError("the path comes to the sphere's other side; split it in two moves")
    return RoundCentre(begin, p[0], centre)


def _normal(way: Way, tool: Floats) -> Floats:
    """What the tool turns about: the way's own normal, or the tool's z for a straight way."""
    return np.asarray(tool[:, 2] if way.normal is None else way.normal)


def _against(rule: Orientation, p: Floats) -> Floats:
    """Where the tool's z should point at points (n, 3): against the surface's outward normal."""
    if rule.surface == "plane":
        return np.broadcast_to(-_unit(np.array(rule.axis)), p.shape)
    out = p - np.array(rule.centre_mm) / 1000.0
    if rule.surface == "cylinder":
        axis = _unit(np.array(rule.axis))
        out = out - (out @ axis)[:, None] * axis
    size = np.linalg.norm(out, axis=1)
    if size.min() < APART_M:
        name = "centre" if rule.surface == "sphere" else "axis"
        raise InvalidError(
            f"the path meets the {rule.surface}'s {name}, where it has no normal; move one of them"
        )
    return np.asarray((out if rule.inside else -out) / size[:, None])


def _looks(way: Way) -> tuple[Floats, Floats]:
    """Points and tangents (n, 3) along a way."""
    joints = way.joints_m
    count = max(2, min(LOOKS, LOOKS_LIMIT // (len(joints) - 1)))
    share = np.linspace(0.0, 1.0, count, endpoint=False)
    s = np.append((joints[:-1, None] + share * np.diff(joints)[:, None]).ravel(), joints[-1])
    p, t, _ = way.at(s)
    return p, t


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v))
