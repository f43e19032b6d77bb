"""Blocks: the pieces of a plan between two stops of the arm, with time law and knot."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move, Speed
from sphmctl.planner.chord import TOLERANCE_M, Leg, knot_limit, split
from sphmctl.planner.legs import Direct
from sphmctl.planner.places import joint_problem
from sphmctl.planner.timing import (
    LIMIT_SHARE,
    SLOWEST_SHARE,
    Limits,
    Slice,
    TooFast,
    Trapezoid,
    fastest,
)
from sphmctl.planner.way import Way
from sphmctl.robots import kr6

STILL_RAD = 1e-7
"""An arm that moves less does not move: rounding, far below what the controller resolves."""

LEAST_SHARE = 1e-4
"""Lowest $VEL_AXIS and $ACC_AXIS, as a share: KRL takes no 0, and a slower arm would creep."""

STRAIGHT_PER_M = 1e-3
"""A path that bends less is straight."""

BEND_SHARE = 0.7
"""Of the tool's acceleration, for what goes across a bend and for what goes along: together they
stay within the whole."""

EVEN_LEAST = 16
"""Steps of a block at least, for its derivatives."""

NO_TOOL_LIMITS = (math.inf, math.inf)
"""Speed and acceleration of a tool that follows no path."""


@dataclass(frozen=True)
class Block:
    """One piece of a leg, from rest to rest.

    Attributes:
        leg: None for a rest.
        u: shares of the leg at begin and end.
        law: progress within the block; None for a rest.
        rest_s: how long it rests; 0 for a motion.
        velocity, acceleration: of the knot that ends it; None when the arm does not move in it.
        asked: the tool's speed (m/s) and acceleration (m/s2) on its path, at most.
        name: of the point at its end; "" for none.
    """

    move: Move
    leg: Leg | None
    u: tuple[float, float]
    law: Trapezoid | Slice | None
    rest_s: float = 0.0
    velocity: float | None = None
    acceleration: float | None = None
    asked: tuple[float, float] = NO_TOOL_LIMITS
    name: str = ""

    @property
    def duration_s(self) -> float:
        """From rest to rest, or the rest itself."""
        return self.rest_s if self.law is None else self.law.duration_s


@dataclass
class Draft:
    """What is collected while the moves are walked through."""

    blocks: list[Block] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def add_way(draft: Draft, way: Way, title: str, scale: float) -> None:
    """Cut a way into blocks and time them."""
    joints = way.joints
    if np.abs(joints - joints[0]).max() < STILL_RAD:
        return
    parts = split(way)
    if parts is None:
        draft.problems.append(_too_many_knots(way))
        return
    u, names = way.u, {row: name for name, row in way.marks}
    for begin, end in pairwise(parts.edges):
        here = _even(way, begin, end)
        name = names.get(end, "")
        tool = _tool_limits(way, begin, end)
        _add_block(draft, way, (float(u[begin]), float(u[end])), here, scale, name, *tool)
    draft.notes.append(
        f"{title}: {parts.count} knot{'s' if parts.count > 1 else ''}, chord error "
        f"{parts.error_m * 1000.0:.2f} mm"
    )


def _even(way: Way, begin: int, end: int) -> Floats:
    """Joints (k, 9) of a block at equal steps."""
    if way.straight:
        return np.asarray(way.joints[begin : end + 1])
    count = max(end - begin, EVEN_LEAST)
    s = np.linspace(way.s[begin], way.s[end], count + 1)
    rows = slice(begin, end + 1)
    return np.stack([np.interp(s, way.s[rows], column[rows]) for column in way.joints.T], axis=1)


def _too_many_knots(way: Way) -> Problem:
    """The way is refused for the axis that turns most sharply on it."""
    slope = np.diff(way.joints[:, :6], axis=0) / np.diff(way.s)[:, None]
    bend = np.abs(np.diff(slope, axis=0))
    row, joint = np.unravel_index(np.argmax(bend), bend.shape)
    name = JOINT_NAMES[joint]
    message = (
        f"keeping the tool within {TOLERANCE_M * 1000:g} mm of the path would take more than "
        f"{knot_limit(way)} stops, because {name} turns too sharply there"
    )
    return Problem(way.where(float(way.u[row + 1])), name, None, None, message)


def add_direct(draft: Draft, leg: Direct, scale: float) -> None:
    """One block straight through joint space, at the move's share of the joints' limits."""
    if np.abs(leg.end_joints - leg.begin_joints).max() < STILL_RAD:
        return
    joints, pose = leg.at(np.linspace(0.0, 1.0, 65))
    if np.isnan(pose).any():
        where = leg.where(float(np.isnan(pose).any(axis=(1, 2)).argmax()) / 64.0)
        draft.problems.append(
            Problem(where, "theta7", None, None, "the wrist does not close at these crank angles")
        )
        return
    point = leg.move.point
    _add_block(draft, leg, (0.0, 1.0), joints, scale, point.name if point else "")


def add_rest(draft: Draft, move: Move, scale: float) -> None:
    """A rest, as long as the speed makes it."""
    draft.blocks.append(Block(move, None, (0.0, 0.0), None, move.dwell_s / scale))


def _add_block(
    draft: Draft,
    leg: Leg,
    u: tuple[float, float],
    joints: Floats,
    scale: float,
    name: str,
    asked: tuple[float, float] = NO_TOOL_LIMITS,
    room: tuple[float, float] = NO_TOOL_LIMITS,
) -> None:
    """Time one block along joints (n, 9) at equal steps, and match the controller's law to it.

    Args:
        asked: the tool's speed (m/s) and acceleration (m/s2).
        room: what bends leave of them along the path.
    """
    move = leg.move_at(u[1])
    length_m = leg.length_m * (u[1] - u[0])
    moved = np.abs(joints[-1, :6] - joints[0, :6])
    arm_moves = bool(moved.max() >= STILL_RAD)
    velocity = float((moved / kr6.MAX_SPEED).max())
    acceleration = float((moved / kr6.MAX_ACCELERATION).max())
    limits = _limits(leg, length_m, room, (velocity, acceleration) if arm_moves else None)
    law = fastest(joints, limits)
    if isinstance(law, TooFast):
        where = leg.where(u[0] + law.w * (u[1] - u[0]))
        draft.problems.append(joint_problem(where, law.joint, law.value, law.limit, law.what))
        return
    law = law.scaled(scale)
    if arm_moves:
        # However slow the plan: ramps no longer than the controller's lowest acceleration makes.
        law = replace(law, acceleration=max(law.acceleration, LEAST_SHARE / acceleration))
    if not arm_moves:
        draft.blocks.append(Block(move, leg, u, law, asked=asked, name=name))
        return
    velocity, acceleration = velocity * law.speed, acceleration * law.acceleration
    if min(velocity, acceleration) < LEAST_SHARE:
        message = (
            f"the arm would have to creep at {min(velocity, acceleration) * 100:.3g} % of its "
            f"speed or acceleration; at least {LEAST_SHARE * 100:g} % is possible: move faster"
        )
        where = leg.where(u[0])
        draft.problems.append(Problem(where, "", min(velocity, acceleration), LEAST_SHARE, message))
        return
    knot = min(velocity, 1.0), min(acceleration, 1.0)
    block = Block(move, leg, u, law, 0.0, *knot, asked=asked, name=name)
    draft.blocks.append(block)


def _tool_limits(way: Way, begin: int, end: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Tool speed (m/s) and acceleration (m/s2) asked for between two rows; what bends leave."""
    if way.length_m == 0.0:
        return NO_TOOL_LIMITS, NO_TOOL_LIMITS
    speed, acceleration = (float(values[begin : end + 1].min()) for values in way.asked)
    bend = float(way.bends[begin:end].max())
    if bend < STRAIGHT_PER_M:
        return (speed, acceleration), (speed, acceleration)
    across = BEND_SHARE * acceleration
    return (speed, acceleration), (min(speed, math.sqrt(across / bend)), across)


def _limits(
    leg: Leg,
    length_m: float,
    asked: tuple[float, float],
    controller: tuple[float, float] | None,
) -> Limits:
    """What tool, controller and joints allow in one block."""
    speed, floor, acceleration = float("inf"), 0.0, float("inf")
    speeds, accelerations = leg.setup.speeds, leg.setup.accelerations
    if controller is not None:
        speed, acceleration = 1.0 / controller[0], 1.0 / controller[1]
    if length_m > 0.0:
        wanted = asked[0] / length_m
        speed, floor = min(speed, wanted), SLOWEST_SHARE * wanted
        acceleration = min(acceleration, asked[1] / length_m)
    else:
        speeds, accelerations = shares_of(leg.move_at(0.0).speed, speeds, accelerations)
    return Limits(speed, floor, acceleration, speeds, accelerations)


def shares_of(speed: Speed, speeds: Floats, accelerations: Floats) -> tuple[Floats, Floats]:
    """Joint limits (9,) that a move leaves which is not driven along a path of the tool."""
    # A share below LIMIT_SHARE leaves room already: it is not to be narrowed twice.
    part = min(speed.joint_percent / 100.0 / LIMIT_SHARE, 1.0)
    ramps = min(speed.joint_acceleration_percent / 100.0 / LIMIT_SHARE, 1.0)
    return speeds * part, accelerations * ramps
