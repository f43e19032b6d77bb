"""The slow way from where the robot stands to a plan's begin: one move of all nine joints."""

from __future__ import annotations

import numpy as np

from sphmctl.config import Cell
from sphmctl.errors import InfeasibleError, Problem
from sphmctl.motion import Floats, Plan
from sphmctl.pathfile import Move, Point, Speed, Wrist
from sphmctl.planner.blocks import Draft, add_direct
from sphmctl.planner.legs import Direct, Setup
from sphmctl.planner.places import joint_problem, range_problems
from sphmctl.planner.sampling import knots, named, sample

MEASURED_TOLERANCE_RAD = float(np.radians(0.15))
"""How far measured joints may be beyond their range: servo steps of 0.09 degrees, and rounding."""


def approach(start: Floats, goal: Floats, cell: Cell, speed_share: float) -> Plan:
    """A plan of one block from measured joints (9,) to a plan's first joints (9,).

    Its tool is the platform centre, in the arm's base frame. No knot when the arm stands there.

    Args:
        speed_share: share (0, 1] of every joint's speed and acceleration limit.

    Raises:
        InfeasibleError: the start is beyond a range by more than measuring explains, or the goal
            at all.
    """
    setup = Setup(
        np.eye(4),
        np.eye(4),
        cell.mount_yaw_rad,
        cell.ranges_rad,
        cell.speeds_rad_s,
        cell.accelerations_rad_s2,
    )
    draft = Draft()
    draft.problems += range_problems("the approach's end", goal, setup.ranges)
    wider = setup.ranges + MEASURED_TOLERANCE_RAD * np.array([-1.0, 1.0])
    for joint in np.flatnonzero((start < wider[:, 0]) | (start > wider[:, 1])):
        value, (low, high) = float(start[joint]), setup.ranges[joint]
        limit = float(low if value < low else high)
        draft.problems.append(
            joint_problem("where the robot stands", int(joint), value, limit, "angle")
        )
    percent = speed_share * 100.0
    speed = Speed(joint_percent=percent, joint_acceleration_percent=percent)
    move = Move(1, 1, "ptp", Point("start"), 0.0, speed, Wrist())
    if not draft.problems:
        ends = np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64)
        add_direct(draft, Direct(setup, move, *ends), 1.0)
    if draft.problems:
        raise _refusal(draft.problems)
    rows = sample(draft.blocks, setup, np.array(start, dtype=np.float64))
    return Plan(
        "approach",
        rows.t,
        rows.joints,
        rows.tool,
        knots(draft.blocks, rows),
        named(draft.blocks, rows, ""),
        (),
        setup.tool,
        setup.base,
    )


def _refusal(problems: list[Problem]) -> InfeasibleError:
    return InfeasibleError(problems[0].message, problems[0].where, tuple(problems))
