"""Checks of joints beyond ranges and rates: collisions, singular poses, the servos' static load.

They know rows only; whoever calls puts a row's place into the problem's `where`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.config import Cell
from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots.sphm import bodies, load, singular
from sphmctl.robots.sphm.bodies import Obstacle
from sphmctl.robots.sphm.load import Payload

SMALLEST_PARALLEL = 0.05
"""Control counts as lost below this share of the wrist's stiffness at the middle of its range: play
at the cranks then shows twenty times at the platform. Within 0 to 120 degrees it is above 0.2."""

TOUCH_M = 1e-9
"""Bodies that overlap by less than rounding only touch."""


@dataclass(frozen=True)
class Surroundings:
    """What the checks need to know beside the joints.

    Attributes:
        tool: the tool's frame on the platform, m, (4, 4).
        mount_yaw: leg 1 against the flange's x axis, rad.
    """

    tool: Floats
    mount_yaw: float
    obstacles: tuple[Obstacle, ...]
    payload: Payload

    @staticmethod
    def of(cell: Cell, tool: Floats) -> Surroundings:
        """What a cell gives, with a tool's frame on the platform."""
        obstacles, payload = cell.obstacle_bodies, cell.payload.on_platform()
        return Surroundings(tool, cell.mount_yaw_rad, obstacles, payload)


@dataclass(frozen=True)
class RowProblem:
    """A problem, its `where` still empty, and the row that it is worst in."""

    row: int
    problem: Problem


@dataclass(frozen=True)
class Margin:
    """How close the rows come to a limit.

    Attributes:
        name: what is looked at, in words.
        value: the smallest margin, or the largest load; see `unit`.
        unit: "mm", "degrees", "of the middle pose", "of the servo's holding torque".
        row: where that is.
        beyond: the value is a lower bound, for more was not looked at.
        title: what is looked at, whichever part comes closest.
        values: of each row, (n,).
        limit: beyond this a path is refused; None where the margin is only told.
    """

    name: str
    value: float
    unit: str
    row: int
    beyond: bool
    title: str
    values: Floats
    limit: float | None


@dataclass(frozen=True)
class Findings:
    """What the checks found in some rows."""

    problems: tuple[RowProblem, ...]
    margins: tuple[Margin, ...]


def examine(joints: Floats, around: Surroundings) -> Findings:
    """Check joints (n, 9), n at least 1; rows on which the wrist does not close are passed over."""
    parts = (
        _collisions(
            bodies.clearances(joints, around.tool, around.mount_yaw),
            bodies.PAIRS,
            "the robot itself",
        ),
        _collisions(
            bodies.obstacle_clearances(joints, around.obstacles, around.tool, around.mount_yaw),
            bodies.obstacle_pairs(around.obstacles),
            "obstacles",
        ),
        _singular(joints),
        _load(joints, around),
    )
    return Findings(
        tuple(problem for part in parts for problem in part.problems),
        tuple(margin for part in parts for margin in part.margins),
    )


def _collisions(gaps: Floats, pairs: tuple[tuple[str, str], ...], what: str) -> Findings:
    """From gaps (n, pairs): a problem for each pair that overlaps, and the smallest gap of all."""
    if not pairs:
        return Findings((), ())
    gaps = np.nan_to_num(gaps, nan=np.inf)
    rows, least = gaps.argmin(axis=0), gaps.min(axis=0)
    problems = []
    for column in np.flatnonzero(least < -TOUCH_M):
        ours, other = pairs[column]
        overlap_mm = -1000.0 * float(least[column])
        verb = "reach" if ours in ("servos", "legs") else "reaches"
        # Bodies are capsules: within a box no more than their radius is measured.
        message = (
            f"the {ours} {verb} at least {overlap_mm:.1f} mm into the {other}; to touch is the most"
        )
        problem = Problem("", "", -overlap_mm, 0.0, message)
        problems.append(RowProblem(int(rows[column]), problem))
    title, nearest = f"gap to {what}", int(least.argmin())
    name = f"{title}: {pairs[nearest][0]} and {pairs[nearest][1]}"
    far = what == "the robot itself" and bool(least[nearest] >= bodies.FAR_M)
    near_mm = 1000.0 * gaps.min(axis=1)
    value, row = 1000.0 * float(least[nearest]), int(rows[nearest])
    if what == "the robot itself":
        title += f", up to {1000.0 * bodies.FAR_M:g} mm"
    margin = Margin(name, value, "mm", row, far, title, near_mm, 0.0)
    return Findings(tuple(problems), (margin,))


def _singular(joints: Floats) -> Findings:
    """The margins of `singular`; only lost control is a problem, for the rest may be passed."""
    found = singular.margins(joints)
    margins = [
        _least(name, values, unit, limit)
        for name, values, unit, limit in (
            (
                "wrist from a parallel singularity",
                found.parallel,
                "of the middle pose",
                SMALLEST_PARALLEL,
            ),
            ("wrist from a serial singularity", np.degrees(found.serial_rad), "degrees", None),
            ("A5 from 0", np.degrees(found.wrist_rad), "degrees", None),
            ("elbow from stretched or folded", np.degrees(found.elbow_rad), "degrees", None),
            ("wrist centre from axis 1", found.shoulder_m * 1000.0, "mm", None),
        )
    ]
    lost = margins[0]
    if lost.value >= SMALLEST_PARALLEL:
        return Findings((), tuple(margins))
    message = (
        f"the cranks would lose control of the platform: {lost.value:.3f} of the hold they have at "
        f"mid-range; at least {SMALLEST_PARALLEL:g} is needed"
    )
    problem = Problem("", JOINT_NAMES[6], lost.value, SMALLEST_PARALLEL, message)
    return Findings((RowProblem(lost.row, problem),), tuple(margins))


def _load(joints: Floats, around: Surroundings) -> Findings:
    """The largest static load, and a problem for each servo that could not hold its own."""
    torques = np.abs(load.holding_torques(joints, around.payload, around.mount_yaw))
    torques = np.nan_to_num(torques, nan=0.0)
    rows, most = torques.argmax(axis=0), torques.max(axis=0)
    problems = []
    for leg in np.flatnonzero(most > load.HOLDING_TORQUE_NM):
        name, value = JOINT_NAMES[6 + leg], float(most[leg])
        message = (
            f"{name} would have to hold {value:.3f} Nm; at most {load.HOLDING_TORQUE_NM:.3g} is "
            f"allowed, {load.HOLDING_SHARE:.0%} of its servo's stall torque"
        )
        problem = Problem("", name, value, load.HOLDING_TORQUE_NM, message)
        problems.append(RowProblem(int(rows[leg]), problem))
    worst = int(most.argmax())
    shares = torques.max(axis=1) / load.HOLDING_TORQUE_NM
    row, unit = int(rows[worst]), "of the servo's holding torque"
    name, title = f"static load of {JOINT_NAMES[6 + worst]}", "largest static load of a servo"
    margin = Margin(name, float(shares[row]), unit, row, False, title, shares, 1.0)
    return Findings(tuple(problems), (margin,))


def _least(name: str, values: Floats, unit: str, limit: float | None) -> Margin:
    """The smallest of values (n,), rows without numbers passed over."""
    values = np.nan_to_num(values, nan=np.inf)
    row = int(values.argmin())
    return Margin(name, float(values[row]), unit, row, False, name, values, limit)
