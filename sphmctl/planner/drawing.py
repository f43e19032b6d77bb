"""Draws moves: the shape of each, piece by piece where a polyline has corners to stop at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import Floats
from sphmctl.pathfile import Arc, Circle, Helix, Move, Point, Polyline, Spline
from sphmctl.planner import curve, shapes
from sphmctl.planner.orienting import aligned, turning
from sphmctl.planner.shapes import APART_M, Segment, Shape, Spot, Way
from sphmctl.planner.spline import Track
from sphmctl.planner.turning import Between, Held, Turning, Woven, to_quaternion
from sphmctl.robots.geometry import abc_to_matrix, angle_between

Forward: TypeAlias = Callable[[Floats], Floats]
"""Tool poses in the path's base (n, 4, 4) of joints (n, 9)."""

HALF_TURN_SLACK_RAD = 1e-3
"""A turn this close to half a turn has no shortest way."""

SPOT_M_RAD = 0.1
"""Nominal length of a turn on the spot: as if the point were as far from the turn's axis."""

SPOT_LEAST_M = 0.01
"""Nominal length of a wrist motion on the spot."""

FIRST_ROW_M = 1e-5
"""A polyline's first row this close to the present point is that point: files have 3 decimals."""

SMOOTH_VERTEX_RAD = float(np.radians(20.0))
"""A polyline that turns less at a point is taken for a sampled curve, and rounded there."""

ROUNDING_M = 5e-5
"""How far such a rounding may pass beside the point: a tenth of what a path is to keep."""

LEAST_BLEND_M = 1e-5
"""A smaller blend is none: its corner would be passed at a crawl, below 2 mm/s at 500 mm/s2, and an
exact stop takes less."""

BLENDED_RAD = float(np.radians(175.0))
"""A corner that turns further turns back, and has no room for a blend."""


@dataclass(frozen=True)
class Stand:
    """Where the drawing has come to.

    Attributes:
        pose: tool in the base, (4, 4).
        tangent: of a way whose direction the tool follows, (3,); None without one.
    """

    pose: Floats
    tangent: Floats | None = None


@dataclass(frozen=True)
class Part:
    """What is drawn of one move without a corner.

    Attributes:
        offset_m: how far along the move it begins.
        total_m: the move's length.
        cranks: arc lengths (k,) and crank angles (k, 3) there, where the path gives them.
        marks: named points and their arc lengths.
        pins: arc lengths at which the path gives all nine joints, (9,) rad.
        last: the move ends with it.
    """

    move: Move
    shape: Shape
    offset_m: float
    total_m: float
    cranks: tuple[Floats, Floats]
    marks: tuple[tuple[str, float], ...]
    last: bool
    pins: tuple[tuple[float, Floats], ...] = ()

    @property
    def stand(self) -> Stand:
        """Where it ends."""
        pose, tangent = self.shape.follow(np.array([self.shape.length_m]))
        follows = self.move.orientation.rule == "tangent" and not self.still
        return Stand(pose[0], tangent[0] if follows else None)

    @property
    def still(self) -> bool:
        """Whether the tool point stands."""
        return isinstance(self.shape.way, Spot)


@dataclass(frozen=True)
class _Goal:
    """A point to come by, its values resolved: all but the place is None where not given."""

    name: str
    xyz: Floats
    rotation: Floats | None
    cranks: Floats | None
    joints: Floats | None = None


def draw(move: Move, begin: Stand, forward: Forward) -> list[Part]:
    """What one move draws from where the tool stands.

    Raises:
        InvalidError: the points give no such shape.
        InfeasibleError: the tool would have to turn by half a turn.
    """
    if isinstance(move.course, Polyline):
        return _polyline(move, move.course, begin)
    start = begin.pose[:3, 3]
    goals: list[_Goal] = []
    match move.course:
        case Arc(via):
            assert move.point is not None  # every arc has its end
            goals = [_goal(move.point, forward)]
            way: Way = shapes.arc(start, _goal(via, forward).xyz, goals[-1].xyz)
        case Circle((one, two)):
            way = shapes.arc(start, _goal(one, forward).xyz, _goal(two, forward).xyz, True)
        case Helix(centre, normal, turn_deg, pitch_mm):
            middle, angle = _goal(centre, forward).xyz, float(np.radians(turn_deg))
            way = shapes.helix(start, middle, np.array(normal), angle, pitch_mm / 1000.0)
        case Spline(through, closed):
            goals = [_goal(point, forward) for point in through]
            way = _spline(start, goals, closed)
            if closed:
                goals.append(_Goal("", start, begin.pose[:3, :3], None))
        case None:
            assert move.point is not None  # every line has its end
            goals = [_goal(move.point, forward)]
            way = Segment(start, goals[-1].xyz)
    at = way.joints_m[1:] if isinstance(move.course, Spline) else np.array([way.length_m])
    if way.length_m < APART_M and not goals:
        raise InvalidError("it is shorter than 0.001 mm; give a larger angle, or leave it out")
    if way.length_m < APART_M:
        way, at = _spot(start, begin, goals[-1])
    rotation = aligned(move.orientation, way, begin.pose[:3, :3], begin.tangent)
    turn = _turning(move, way, rotation, at, goals)
    marks = tuple((goal.name, float(s)) for goal, s in zip(goals, at, strict=False) if goal.name)
    told = [(s, goal.cranks) for s, goal in zip(at, goals, strict=False)]
    known = [(s, values) for s, values in told if values is not None]
    cranks = np.array([s for s, _ in known]), np.array([c for _, c in known]).reshape(-1, 3)
    pins = tuple(
        (float(s), goal.joints)
        for s, goal in zip(at, goals, strict=False)
        if goal.joints is not None
    )
    return [Part(move, Shape(way, turn), 0.0, way.length_m, cranks, marks, True, pins)]


def blend_of(move: Move) -> float:
    """How far from its corners a move may be rounded, m; 0 for exact stops there."""
    blend_m = move.blend_mm / 1000.0
    return blend_m if blend_m >= LEAST_BLEND_M else 0.0


def _goal(point: Point, forward: Forward) -> _Goal:
    if point.joints_deg is not None:
        joints = np.radians(point.joints_deg)
        pose = forward(joints[None])[0]
        return _Goal(point.name, pose[:3, 3], pose[:3, :3], joints[6:], joints)
    cranks = None if point.cranks_deg is None else np.radians(point.cranks_deg)
    if point.pose is None:
        assert point.xyz_mm is not None  # a point has one of the three
        return _Goal(point.name, np.array(point.xyz_mm) / 1000.0, None, cranks)
    xyz = np.array(point.pose[:3]) / 1000.0
    return _Goal(point.name, xyz, abc_to_matrix(np.radians(point.pose[3:])), cranks)


def _spline(start: Floats, goals: list[_Goal], closed: bool) -> curve.Curve:
    points = np.array([start, *(goal.xyz for goal in goals)] + ([start] if closed else []))
    same = np.linalg.norm(np.diff(points, axis=0), axis=1) < APART_M
    if same.any():
        x, y, z = 1000.0 * points[int(same.argmax())]
        raise InvalidError(
            f"[{x:.6g}, {y:.6g}, {z:.6g}] is there twice in a row; leave it out once"
            + (" ('closed' goes back to the begin by itself)" if closed and same[-1] else "")
        )
    return curve.spline(points, closed)


def _spot(start: Floats, begin: Stand, goal: _Goal) -> tuple[Spot, Floats]:
    turn = 0.0
    if goal.rotation is not None:
        turn = float(angle_between(begin.pose[:3, :3], goal.rotation))
    length = max(SPOT_M_RAD * turn, SPOT_LEAST_M)
    return Spot(start, length), np.array([length])


def _turning(move: Move, way: Way, begin: Floats, at: Floats, goals: list[_Goal]) -> Turning:
    """The tool's orientation on a way, from `begin` (3, 3) on."""
    if move.orientation.rule != "interpolated":
        return turning(move.orientation, way, begin)
    rotations = [begin]
    for goal in goals:
        rotations.append(rotations[-1] if goal.rotation is None else goal.rotation)
    _check_turns(move, np.array(rotations))
    if len(goals) <= 1:
        return Between(begin, rotations[-1], way.length_m)
    q = to_quaternion(np.array(rotations))
    closed = isinstance(move.course, Spline) and move.course.closed
    return Woven(Track.smooth(np.append(0.0, at), q, closed and bool(q[0] @ q[-1] > 0.0)))


def _check_turns(move: Move, rotations: Floats) -> None:
    turns = angle_between(rotations[:-1], rotations[1:])
    if len(turns) and turns.max() > np.pi - HALF_TURN_SLACK_RAD:
        message = "the tool turns by half a turn, which has no shortest way; add a point between"
        value = float(np.degrees(turns.max()))
        problem = Problem(move.where, "tool", value, 180.0, message)
        raise InfeasibleError(message, move.where, (problem,))


def _polyline(move: Move, rows: Polyline, begin: Stand) -> list[Part]:
    """The polyline's parts between the points at which it must stop."""
    xyz = np.concatenate([begin.pose[None, :3, 3], rows.xyz_mm / 1000.0])
    R = begin.pose[None, :3, :3]
    if rows.abc_deg is not None:
        R = np.concatenate([R, abc_to_matrix(np.radians(rows.abc_deg))])
    first = 1
    if np.linalg.norm(xyz[1] - xyz[0]) < FIRST_ROW_M:
        if len(xyz) == 2:
            raise InvalidError(f"{rows.file} holds only the present point; add rows")
        xyz, first = np.delete(xyz, 1, axis=0), 2
        R = R[1:] if len(R) > 1 else R
    if len(R) > 1 and move.orientation.rule == "interpolated":
        _check_turns(move, R)
    cuts, stops = _corners(xyz, blend_of(move))
    edges = [0, *stops, len(xyz) - 1]
    parts: list[Part] = []
    offset, stand = 0.0, Stand(begin.pose.copy(), begin.tangent)
    stand.pose[:3, :3] = R[0]
    for low, high in pairwise(edges):
        way, at = curve.rounded(xyz[low : high + 1], cuts[low : high - 1])
        rotation = aligned(move.orientation, way, stand.pose[:3, :3], stand.tangent)
        if move.orientation.rule != "interpolated":
            turn = turning(move.orientation, way, rotation)
        elif len(R) > 1:
            turn = Woven(Track.monotone(at, to_quaternion(R[low : high + 1])))
        else:
            turn = Held(rotation)
        known = (np.empty(0), np.empty((0, 3)))
        if rows.cranks_deg is not None:
            known = at[1:], np.radians(rows.cranks_deg[low + first - 1 : high + first - 1])
        part = Part(move, Shape(way, turn), offset, 0.0, known, (), high == edges[-1])
        parts.append(part)
        offset, stand = offset + way.length_m, part.stand
    return [replace(part, total_m=offset) for part in parts]


def _corners(xyz: Floats, blend_m: float) -> tuple[Floats, list[int]]:
    """Cuts (n - 2,) at the inner points of a polyline (n, 3), and the points to stop at."""
    way = np.diff(xyz, axis=0)
    length = np.linalg.norm(way, axis=1)
    t = way / length[:, None]
    apart = np.linalg.norm(np.diff(t, axis=0), axis=1)
    turn = 2.0 * np.arcsin(np.clip(apart / 2.0, 0.0, 1.0))
    cuts = np.minimum(length[:-1], length[1:]) / 2.0
    if blend_m > 0.0:
        cuts, sharp = np.minimum(cuts, blend_m), turn > BLENDED_RAD
    else:
        # The corner's middle is d (16 - 5 f) / 32 |t1 - t0| from the point, f its reach's share.
        beside = (16.0 - 5.0 * curve.reach_share(t[:-1], t[1:])) / 32.0 * apart
        with np.errstate(divide="ignore"):
            cuts = np.minimum(cuts, ROUNDING_M / beside)
        sharp = turn > SMOOTH_VERTEX_RAD
    cuts[turn < 1e-12] = 0.0
    return cuts, [int(i) + 1 for i in np.flatnonzero(sharp)]
