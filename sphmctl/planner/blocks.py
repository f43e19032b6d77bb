"""Blocks: the pieces of a plan between two stops of the arm, with time law and knot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move, Speed
from sphmctl.planner.chord import TOLERANCE_M, Leg, knot_limit, split
from sphmctl.planner.legs import Direct
from sphmctl.planner.pace import NO_TOOL_LIMITS, Pace
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

SPEED_LIMIT = 1.5
"""Highest share of a path's own speed, as the override of the tools people know."""

NOTHING_MOVES = "nothing moves by as much as 1 um; left out"
"""Of a move to where the robot stands."""

EVEN_LEAST = 16
"""Steps of a block at least, for its derivatives."""


@dataclass(frozen=True)
class Block:
    """One piece of a leg, from rest to rest.

    Attributes:
        leg: None for a rest.
        u: shares of the leg at begin and end.
        law: progress within the block; None for a rest, and for what the controller cannot drive.
        rest_s: how long it rests; 0 for a motion.
        velocity, acceleration: of the knot that ends it; None when the arm does not move in it.
        name: of the point at its end; "" for none.
    """

    move: Move
    leg: Leg | None
    u: tuple[float, float]
    law: Trapezoid | Slice | None
    rest_s: float = 0.0
    velocity: float | None = None
    acceleration: float | None = None
    name: str = ""

    @property
    def duration_s(self) -> float:
        """From rest to rest, or the rest itself."""
        return self.rest_s if self.law is None else self.law.duration_s


@dataclass(frozen=True)
class Creep:
    """A block that is too slow for the arm's controller.

    Attributes:
        velocity: $VEL_AXIS that it would need, as a share, at the path's own speed.
    """

    where: str
    velocity: float


@dataclass
class Draft:
    """What is collected while the moves are walked through.

    Attributes:
        problems: why nothing can drive the path.
        too_many: why the arm's controller cannot, which stops at knots; creeps: likewise.
        too_fast: some joint cannot follow the rows of a way at any sensible speed.
    """

    blocks: list[Block] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    too_many: list[Problem] = field(default_factory=list)
    creeps: list[Creep] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    too_fast: bool = False

    @property
    def refusals(self) -> list[Problem]:
        """Why the arm's controller cannot drive it, at any speed."""
        return self.problems + self.too_many

    def extend(self, other: Draft) -> None:
        """Add what another one collected after this one."""
        self.blocks += other.blocks
        self.problems += other.problems
        self.too_many += other.too_many
        self.creeps += other.creeps
        self.notes += other.notes
        self.too_fast = self.too_fast or other.too_fast

    def undrivable(self, scale: float) -> list[Problem]:
        """Why the arm's controller cannot drive it at a share of the path's own speed."""
        if not self.creeps:
            return self.too_many
        return [*self.too_many, _creeping(min(self.creeps, key=lambda at: at.velocity), scale)]


def add_way(draft: Draft, way: Way, title: str, scale: float) -> None:
    """Cut a way into blocks and time them."""
    joints = way.joints
    if np.abs(joints - joints[0]).max() < STILL_RAD:
        draft.notes.append(f"{title}: {NOTHING_MOVES}")
        return
    pace, u, names = Pace.of(way), way.u, {row: name for name, row in way.marks}

    def took_s(begin: int, end: int) -> float:
        length_m = way.length_m * float(u[end] - u[begin])
        law = _law(way, length_m, _even(way, begin, end), pace.between(begin, end))
        return math.inf if isinstance(law, TooFast) else law.duration_s

    parts = split(way, pace, took_s)
    if parts is None:
        draft.too_many.append(_too_many_knots(way))
        edges = sorted({0, len(u) - 1, *names})
        draft.blocks += [_untimed(way, u[a], u[b], names.get(b, "")) for a, b in pairwise(edges)]
        return
    for begin, end in pairwise(parts.edges):
        here, room = _even(way, begin, end), pace.between(begin, end)
        shares = float(u[begin]), float(u[end])
        _add_block(draft, way, shares, here, scale, names.get(end, ""), room)
    draft.notes.append(
        f"{title}: {parts.count} knot{'s' if parts.count > 1 else ''}, chord error "
        f"{parts.error_m * 1000.0:.2f} mm"
    )


def _untimed(way: Way, begin: float, end: float, name: str) -> Block:
    """A piece of a way that the arm's controller does not drive."""
    return Block(way.move_at(float(end)), way, (float(begin), float(end)), None, name=name)


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
        draft.notes.append(f"{leg.move.title}: {NOTHING_MOVES}")
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
    room: tuple[float, float] = NO_TOOL_LIMITS,
) -> None:
    """Time one block along joints (n, 9) at equal steps, and match the controller's law to it.

    Args:
        room: tool speed (m/s) and acceleration (m/s2) that bends leave along the path.
    """
    move = leg.move_at(u[1])
    law = _law(leg, leg.length_m * (u[1] - u[0]), joints, room)
    if isinstance(law, TooFast):
        where = leg.where(u[0] + law.w * (u[1] - u[0]))
        draft.problems.append(joint_problem(where, law.joint, law.value, law.limit, law.what))
        draft.too_fast = True
        return
    full, law, shares = law, law.scaled(scale), _shares(joints)
    if shares is None:
        draft.blocks.append(Block(move, leg, u, law, name=name))
        return
    velocity, acceleration = shares[0] * law.speed, shares[1] * law.acceleration
    if velocity < LEAST_SHARE:
        draft.creeps.append(Creep(leg.where(u[0]), shares[0] * full.speed))
    if acceleration < LEAST_SHARE:
        # However slow the plan: ramps no longer than the controller's lowest acceleration makes.
        law, acceleration = replace(law, acceleration=LEAST_SHARE / shares[1]), LEAST_SHARE
    knot = min(velocity, 1.0), min(acceleration, 1.0)
    draft.blocks.append(Block(move, leg, u, law, 0.0, *knot, name=name))


def _shares(joints: Floats) -> tuple[float, float] | None:
    """Of the arm's top speed and acceleration, what joints (n, 9) passed at 1/s and 1/s2 take.

    None where the arm does not move.
    """
    moved = np.abs(joints[-1, :6] - joints[0, :6])
    if moved.max() < STILL_RAD:
        return None
    return float((moved / kr6.MAX_SPEED).max()), float((moved / kr6.MAX_ACCELERATION).max())


def _creeping(creep: Creep, scale: float) -> Problem:
    """What the slowest block would need, and the least speed at which it needs enough."""
    velocity, least = creep.velocity * scale, LEAST_SHARE / creep.velocity
    message = (
        f"the arm would have to creep at {_percent(velocity, math.floor)} % of its speed, and its "
        f"controller takes {LEAST_SHARE * 100:g} % at least: "
    )
    if least <= SPEED_LIMIT:
        message += f"the least speed for this path is {_percent(least, math.ceil)} % of its own"
    else:
        message += f"ask for {_percent(least / 100.0, math.ceil)} times the speed there"
    return Problem(creep.where, "", velocity, LEAST_SHARE, message)


def _percent(share: float, rounded: Callable[[float], int]) -> str:
    """A share in percent, three digits of it, rounded down or up."""
    digit = 10.0 ** (math.floor(math.log10(share * 100.0)) - 2)
    return f"{rounded(share * 100.0 / digit) * digit:.3g}"


def _law(
    leg: Leg, length_m: float, joints: Floats, room: tuple[float, float]
) -> Trapezoid | TooFast:
    """The quickest law of a block along joints (n, 9) at equal steps."""
    return fastest(joints, _limits(leg, length_m, room, _shares(joints)))


def _limits(
    leg: Leg,
    length_m: float,
    room: tuple[float, float],
    controller: tuple[float, float] | None,
) -> Limits:
    """What tool, controller and joints allow in one block."""
    speed, floor, acceleration = float("inf"), 0.0, float("inf")
    speeds, accelerations = leg.setup.speeds, leg.setup.accelerations
    if controller is not None:
        speed, acceleration = 1.0 / controller[0], 1.0 / controller[1]
    if length_m > 0.0:
        wanted = room[0] / length_m
        speed, floor = min(speed, wanted), SLOWEST_SHARE * wanted
        acceleration = min(acceleration, room[1] / length_m)
    else:
        speeds, accelerations = shares_of(leg.move_at(0.0).speed, speeds, accelerations)
    return Limits(speed, floor, acceleration, speeds, accelerations)


def shares_of(speed: Speed, speeds: Floats, accelerations: Floats) -> tuple[Floats, Floats]:
    """Joint limits (9,) that a move leaves which is not driven along a path of the tool."""
    # A share below LIMIT_SHARE leaves room already: it is not to be narrowed twice.
    part = min(speed.joint_percent / 100.0 / LIMIT_SHARE, 1.0)
    ramps = min(speed.joint_acceleration_percent / 100.0 / LIMIT_SHARE, 1.0)
    return speeds * part, accelerations * ramps
