"""Blocks: the pieces of a plan between two stops of the arm, with time law and knot."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move
from sphmctl.planner.chord import KNOT_LIMIT, TOLERANCE_M, Curve, Leg, split
from sphmctl.planner.legs import Direct, Line
from sphmctl.planner.places import RANGE_TOLERANCE_RAD, joint_problem, place
from sphmctl.planner.timing import LIMIT_SHARE, SLOWEST_SHARE, Limits, TooFast, Trapezoid, fastest
from sphmctl.robots import kr6, sphm
from sphmctl.robots.geometry import angle_between

STILL_RAD = 1e-7
"""An arm that moves less does not move: rounding, far below what the controller resolves."""

LEAST_SHARE = 1e-4
"""Lowest $VEL_AXIS and $ACC_AXIS, as a share: KRL takes no 0, and a slower arm would creep."""

JUMP_RAD = 0.2
"""A joint that moves so far between two points of a line is looked at closer."""

CLOSER = 14
"""Halvings of the distance between two points before a jump counts as one: to 0.1 um."""

HALF_TURN_SLACK_RAD = 1e-3
"""A turn this close to half a turn has no shortest way."""


@dataclass(frozen=True)
class Block:
    """One piece of a leg, from rest to rest.

    Attributes:
        leg: None for a rest.
        u: shares of the leg at begin and end.
        law: progress within the block; None for a rest.
        rest_s: how long it rests; 0 for a motion.
        velocity, acceleration: of the knot that ends it; None when the arm does not move in it.
        last: whether its end is the move's.
    """

    move: Move
    leg: Leg | None
    u: tuple[float, float]
    law: Trapezoid | None
    rest_s: float = 0.0
    velocity: float | None = None
    acceleration: float | None = None
    last: bool = True

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


def add_line(draft: Draft, move: Move, line: Line, title: str, scale: float) -> Floats | None:
    """Cut a line into blocks and time them; the joints (9,) at its end, or None where it fails."""
    curve = Curve.of(line)
    if not _drivable(draft, move, curve):
        return None
    joints = curve.joints
    if np.abs(joints - joints[0]).max() < STILL_RAD:
        return np.array(joints[-1])
    parts = split(curve)
    if parts is None:
        draft.problems.append(_too_many_knots(move, curve))
        return None
    for begin, end in pairwise(parts.edges):
        u = (float(curve.u[begin]), float(curve.u[end]))
        _add_block(draft, move, curve, u, joints[begin : end + 1], scale)
    draft.notes.append(
        f"{title}: {parts.count} knot{'s' if parts.count > 1 else ''}, chord error "
        f"{parts.error_m * 1000.0:.2f} mm"
    )
    return np.array(joints[-1])


def _too_many_knots(move: Move, curve: Curve) -> Problem:
    """The line is refused for the axis that turns most sharply on it."""
    bend = np.abs(np.diff(curve.joints[:, :6], n=2, axis=0))
    row, joint = np.unravel_index(np.argmax(bend), bend.shape)
    name = JOINT_NAMES[joint]
    message = (
        f"keeping the tool within {TOLERANCE_M * 1000:g} mm of the line would take more than "
        f"{KNOT_LIMIT} stops, because {name} turns too sharply there"
    )
    where = place(move, float(curve.u[row + 1]), curve.line.length_m)
    return Problem(where, name, None, None, message)


def add_direct(draft: Draft, move: Move, leg: Direct, scale: float) -> None:
    """One block straight through joint space, at the move's share of the joints' limits."""
    if np.abs(leg.end_joints - leg.begin_joints).max() < STILL_RAD:
        return
    joints, pose = leg.at(np.linspace(0.0, 1.0, 65))
    if np.isnan(pose).any():
        where = place(move, float(np.isnan(pose).any(axis=(1, 2)).argmax()) / 64.0, 0.0)
        draft.problems.append(
            Problem(where, "theta7", None, None, "the wrist does not close at these crank angles")
        )
        return
    _add_block(draft, move, leg, (0.0, 1.0), joints, scale)


def add_rest(draft: Draft, move: Move, scale: float) -> None:
    """A rest, as long as the speed makes it."""
    draft.blocks.append(Block(move, None, (0.0, 0.0), None, move.dwell_s / scale))


def _drivable(draft: Draft, move: Move, curve: Curve) -> bool:
    """Whether the arm can follow a line at all: turn, reach, ranges, no jump. Says why not."""
    leg, before = curve.line, len(draft.problems)
    turn = float(angle_between(leg.begin[:3, :3], leg.end[:3, :3]))
    if turn > np.pi - HALF_TURN_SLACK_RAD:
        message = "the tool turns by half a turn, which has no shortest way; add a point between"
        draft.problems.append(Problem(move.where, "tool", float(np.degrees(turn)), 180.0, message))
        return False
    lost = np.isnan(curve.joints[:, 0])
    if lost.any():
        row = int(lost.argmax())
        where = place(move, float(curve.u[row]), leg.length_m)
        draft.problems.append(_lost(leg, curve, row, where))
        return False
    jump, torn = _jump(move, curve)
    low, high = leg.setup.ranges.T
    joints = curve.joints[: torn + 1]  # what comes after a jump is on another branch
    excess = np.maximum(low - joints, joints - high)
    for joint in np.flatnonzero((excess > RANGE_TOLERANCE_RAD).any(axis=0)):
        first = int((excess[:, joint] > RANGE_TOLERANCE_RAD).argmax())
        value = float(joints[int(excess[:, joint].argmax()), joint])
        limit = float(low[joint] if value < low[joint] else high[joint])
        where = place(move, float(curve.u[first]), leg.length_m)
        draft.problems.append(joint_problem(where, int(joint), value, limit, "angle"))
    if jump is not None:
        draft.problems.append(jump)
    return len(draft.problems) == before


def _lost(leg: Line, curve: Curve, row: int, where: str) -> Problem:
    """Why there is no answer at one point of a line."""
    setup, cranks = leg.setup, leg.cranks(curve.u[row : row + 1])[0]
    pose = setup.base @ curve.pose[row]
    reason = sphm.why_not(pose, cranks, setup.tool, setup.ranges, setup.mount_yaw, where)
    return reason or Problem(where, "", None, None, "the wrist does not close")


def _jump(move: Move, curve: Curve) -> tuple[Problem | None, int]:
    """Look closer where a joint moves far between two points: is it fast there, or torn?

    Returns:
        What is wrong, and the last point before it; None and the last point of all.
    """
    end_row = len(curve.u) - 1
    steps = np.abs(np.diff(curve.joints, axis=0)).max(axis=1)
    row = int(steps.argmax())
    if steps[row] <= JUMP_RAD:
        return None, end_row
    low, high = float(curve.u[row]), float(curve.u[row + 1])
    begin, end = curve.joints[row], curve.joints[row + 1]
    for _ in range(CLOSER):
        middle = (low + high) / 2.0
        reached = curve.line.at(np.array([middle]), begin)[0][0]
        if np.abs(reached - begin).max() > np.abs(end - reached).max():
            high, end = middle, reached
        else:
            low, begin = middle, reached
    joint = int(np.abs(end - begin).argmax())
    value = float(np.degrees(abs(end[joint] - begin[joint])))
    if value <= np.degrees(JUMP_RAD):
        return None, end_row
    name = JOINT_NAMES[joint]
    message = (
        f"{name} would have to turn {value:.4g} degrees at once: the line passes a "
        "singularity of the arm; lead it round, or use ptp"
    )
    return Problem(place(move, low, curve.line.length_m), name, value, 0.0, message), row


def _add_block(
    draft: Draft, move: Move, leg: Leg, u: tuple[float, float], joints: Floats, scale: float
) -> None:
    """Time one block along joints (n, 9) at equal steps, and match the controller's law to it."""
    length_m = leg.length_m * (u[1] - u[0])
    moved = np.abs(joints[-1, :6] - joints[0, :6])
    arm_moves = bool(moved.max() >= STILL_RAD)
    velocity = float((moved / kr6.MAX_SPEED).max())
    acceleration = float((moved / kr6.MAX_ACCELERATION).max())
    limits = _limits(move, leg, length_m, (velocity, acceleration) if arm_moves else None)
    law = fastest(joints, limits)
    if isinstance(law, TooFast):
        where = place(move, u[0] + law.w * (u[1] - u[0]), leg.length_m)
        draft.problems.append(joint_problem(where, law.joint, law.value, law.limit, law.what))
        return
    law = law.scaled(scale)
    if arm_moves:
        # However slow the plan: ramps no longer than the controller's lowest acceleration makes.
        law = Trapezoid(law.speed, max(law.acceleration, LEAST_SHARE / acceleration))
    last = u[1] == 1.0
    if not arm_moves:
        draft.blocks.append(Block(move, leg, u, law, last=last))
        return
    velocity, acceleration = velocity * law.speed, acceleration * law.acceleration
    if min(velocity, acceleration) < LEAST_SHARE:
        message = (
            f"the arm would have to creep at {min(velocity, acceleration) * 100:.3g} % of its "
            f"speed or acceleration; at least {LEAST_SHARE * 100:g} % is possible: move faster"
        )
        where = place(move, u[0], leg.length_m)
        draft.problems.append(Problem(where, "", min(velocity, acceleration), LEAST_SHARE, message))
        return
    block = Block(move, leg, u, law, 0.0, min(velocity, 1.0), min(acceleration, 1.0), last)
    draft.blocks.append(block)


def _limits(
    move: Move, leg: Leg, length_m: float, controller: tuple[float, float] | None
) -> Limits:
    """What tool, controller and joints allow in one block."""
    speed, floor, acceleration = float("inf"), 0.0, float("inf")
    speeds, accelerations = leg.setup.speeds, leg.setup.accelerations
    if controller is not None:
        speed, acceleration = 1.0 / controller[0], 1.0 / controller[1]
    if length_m > 0.0:
        wanted = move.speed.tcp_mm_s / 1000.0 / length_m
        speed, floor = min(speed, wanted), SLOWEST_SHARE * wanted
        acceleration = min(acceleration, move.speed.tcp_mm_s2 / 1000.0 / length_m)
    else:
        # A share below LIMIT_SHARE leaves room already: it is not to be narrowed twice.
        speeds = speeds * min(move.speed.joint_percent / 100.0 / LIMIT_SHARE, 1.0)
        share = move.speed.joint_acceleration_percent / 100.0
        accelerations = accelerations * min(share / LIMIT_SHARE, 1.0)
    return Limits(speed, floor, acceleration, speeds, accelerations)
