"""Known crank angles: the arm's branch that follows the path, and why none does.

The arm is solved in closed form at every row, so that forward kinematics of a row is its target to
rounding. Rows between which a joint moves far are looked at on a finer grid: is the way between
only steep, or torn?
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.legs import NO_RANGES, Setup, turn_between
from sphmctl.planner.places import RANGE_TOLERANCE_RAD, joint_problem
from sphmctl.planner.policies import cost
from sphmctl.planner.policies.outcome import Outcome, Reason, Resolved, Unresolved
from sphmctl.robots import sphm
from sphmctl.robots.geometry import TURN, from_parts

JUMP_RAD = 0.2
"""A joint that moves so far between two rows is looked at closer."""

FINER = (16, 256, 4096)
"""Rows between two rows, tried one after the other: rows 0.5 mm apart are then 0.1 um apart."""

MOST_MENDS = 64
"""Steep places on one path that are looked at closer; a path with more has rows too far apart."""

ARRIVAL_RAD = 1e-6
"""How close the first and last row must come to joints that are given for them."""

ENOUGH_RAD = float(np.radians(10.0))
"""Margins of the arm to its ranges beyond this count as equal; the shorter way is then better."""


@dataclass(frozen=True)
class Task:
    """What is to be resolved.

    Attributes:
        target: tool poses in the arm's base frame, (n, 4, 4).
        way_m: how far the tool has come at each row, its turns included, (n,); see `cost.way`.
        setup: the robot.
        start: joints (9,) of the first row, None for free.
        end: joints (9,) of the last row, None for free.
    """

    target: Floats
    way_m: Floats
    setup: Setup
    start: Floats | None = None
    end: Floats | None = None


def resolve_cranks(task: Task, cranks: Floats) -> Outcome:
    """Joints for crank angles (n, 3) that are known, on the best branch if there is no start.

    Best is: without a reason against it (else the one that comes furthest), then the larger margin
    of the arm up to 10 degrees, then the least travel.
    """
    if task.start is not None:
        begin = np.concatenate([task.start[:6], cranks[0]])
        return _judged(task, cranks, _from(task, cranks, 0, begin))
    setup = task.setup
    walked = sphm.branches_along(task.target, cranks, setup.tool, setup.mount_yaw)
    if len(walked) == 0:
        return Unresolved(_lost(task, cranks, 0))
    middle = setup.ranges.mean(axis=1)
    best: tuple[tuple[float, ...], Outcome] | None = None
    for joints in walked:
        inside = (np.nanmin(joints, axis=0) + np.nanmax(joints, axis=0)) / 2.0
        turned = joints + TURN * np.round((middle - inside) / TURN)
        if task.end is not None:
            turned = turned + TURN * np.round((task.end - turned[-1]) / TURN)
        outcome = _judged(task, cranks, turned)
        rank = _rank(task, outcome)
        if best is None or rank < best[0]:
            best = rank, outcome
    assert best is not None  # there is at least one branch
    return best[1]


def _rank(task: Task, outcome: Outcome) -> tuple[float, ...]:
    """The lowest is best."""
    if isinstance(outcome, Unresolved):
        return 1.0, -float(outcome.row)
    arm = outcome.joints[:, :6]
    margin = float(sphm.margin_of(arm, task.setup.ranges[:6]).min())
    return 0.0, -round(min(margin, ENOUGH_RAD), 6), outcome.cost


def _from(task: Task, cranks: Floats, row: int, begin: Floats) -> Floats:
    """Joints from a row on, nearest to `begin` (9,) and then to the row before; no ranges."""
    setup = task.setup
    return sphm.inverse_along(
        task.target[row:], cranks[row:], begin, setup.tool, NO_RANGES, setup.mount_yaw
    )


def _judged(task: Task, cranks: Floats, joints: Floats) -> Outcome:
    """Whether joints (n, 9) that were followed without ranges will do."""
    joints, steep, torn = _mended(task, cranks, joints)
    reasons: list[Reason] = []
    missing = np.isnan(joints[:, 0])
    whole = int(missing.argmax()) if missing.any() else len(joints)
    if whole < len(joints):
        reasons += _lost(task, cranks, whole)
    if torn is not None and torn.row < whole:
        reasons, whole = [torn], torn.row + 1  # what comes after is on another branch
    reasons += _beyond(task, joints[:whole])
    reasons += _ends(task, joints, whole)
    if reasons:
        return Unresolved(tuple(sorted(reasons, key=lambda reason: reason.row)))
    kept = np.clip(joints, *task.setup.ranges.T)
    return Resolved(kept, tuple(steep), cost.along(kept, task.way_m, task.setup))


def _mended(task: Task, cranks: Floats, joints: Floats) -> tuple[Floats, list[int], Reason | None]:
    """Joints, corrected where finer rows lead to another branch; steep rows; the first tear."""
    steep: list[int] = []
    row = -1
    for _ in range(MOST_MENDS):
        with np.errstate(invalid="ignore"):
            far = np.abs(np.diff(joints[row + 1 :], axis=0)).max(axis=1, initial=0.0) > JUMP_RAD
        if not far.any():
            return joints, steep, None
        row += 1 + int(far.argmax())
        reached, torn = _closer(task, cranks, row, joints)
        if torn is not None:
            return joints, steep, torn
        steep.append(row)
        if np.abs(reached - joints[row + 1]).max() > ARRIVAL_RAD:
            joints = np.vstack([joints[: row + 1], _from(task, cranks, row + 1, reached)])
    return joints, steep, _torn(row, joints[row], joints[row + 1])


def _closer(task: Task, cranks: Floats, row: int, joints: Floats) -> tuple[Floats, Reason | None]:
    """Joints (9,) of the next row by finer and finer rows between; the tear where there is one."""
    begin, end = task.target[row], task.target[row + 1]
    setup, q = task.setup, joints[row : row + 2]
    for count in FINER:
        u = np.linspace(0.0, 1.0, count + 1)
        place = begin[:3, 3] + u[:, None] * (end[:3, 3] - begin[:3, 3])
        pose = from_parts(turn_between(begin[:3, :3], end[:3, :3], u), place)
        pose[-1] = end
        between = cranks[row] + u[:, None] * (cranks[row + 1] - cranks[row])
        between[-1] = cranks[row + 1]
        q = sphm.inverse_along(pose, between, joints[row], setup.tool, NO_RANGES, setup.mount_yaw)
        with np.errstate(invalid="ignore"):
            steps = np.abs(np.diff(q, axis=0)).max(axis=1)
        if (steps <= JUMP_RAD).all():
            return q[-1], None
    widest = int(np.nan_to_num(steps, nan=np.inf).argmax())
    return q[-1], _torn(row, q[widest], q[widest + 1])


def _torn(row: int, begin: Floats, end: Floats) -> Reason:
    """A joint would have to jump between a row and the next."""
    apart = np.nan_to_num(np.abs(end - begin))
    joint = int(apart.argmax())
    value = float(np.degrees(apart[joint]))
    name = JOINT_NAMES[joint]
    message = (
        f"{name} would have to turn {value:.4g} degrees at once, to another branch of the arm: "
        "the path passes a singularity; lead it round, or use ptp"
    )
    return Reason(row, Problem("", name, value, 0.0, message))


def _lost(task: Task, cranks: Floats, row: int) -> tuple[Reason, ...]:
    """Why there is no answer at a row."""
    setup = task.setup
    reason = sphm.why_not(task.target[row], cranks[row], setup.tool, setup.ranges, setup.mount_yaw)
    closed = "the wrist does not close at these crank angles"
    return (Reason(row, reason or Problem("", "theta7", None, None, closed)),)


def _beyond(task: Task, joints: Floats) -> list[Reason]:
    """Each joint beyond its range, with the first row at which it is, and how far it goes."""
    low, high = task.setup.ranges.T
    excess = np.maximum(low - joints, joints - high)
    found = []
    for joint in np.flatnonzero((excess > RANGE_TOLERANCE_RAD).any(axis=0)):
        first = int((excess[:, joint] > RANGE_TOLERANCE_RAD).argmax())
        value = float(joints[int(excess[:, joint].argmax()), joint])
        limit = float(low[joint] if value < low[joint] else high[joint])
        found.append(Reason(first, joint_problem("", int(joint), value, limit, "angle")))
    return found


def _ends(task: Task, joints: Floats, whole: int) -> list[Reason]:
    """Whether the first and last row stand where they have to."""
    found = []
    for row, wanted, verb in ((0, task.start, "begins"), (len(joints) - 1, task.end, "arrives")):
        if wanted is None or row >= whole:
            continue
        apart = np.abs(joints[row] - wanted)
        joint = int(apart.argmax())
        if apart[joint] > ARRIVAL_RAD:
            name = JOINT_NAMES[joint]
            value, limit = (float(np.degrees(q[joint])) for q in (joints[row], wanted))
            message = (
                f"the path {verb} with {name} at {value:.6g} degrees, not at {limit:.6g}: it is "
                "another branch or another wrist pose; use ptp between"
            )
            found.append(Reason(row, Problem("", name, value, limit, message)))
    return found
