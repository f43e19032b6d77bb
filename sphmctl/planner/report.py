"""Whether a path can be driven, and by how much: the margins of every joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.config import Cell
from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Path
from sphmctl.planner.ideal import ideal
from sphmctl.planner.plan import Outcome, draw_up
from sphmctl.planner.sampling import Samples, rates, where
from sphmctl.planner.timelaw import FILTER_S


@dataclass(frozen=True)
class Margin:
    """How near one joint comes to its limits, and where.

    Attributes:
        range_deg: smallest distance to an end of its range.
        speed_share, acceleration_share: peak as a share of the limit.
    """

    joint: str
    range_deg: float
    range_where: str
    speed_share: float
    speed_where: str
    acceleration_share: float
    acceleration_where: str


@dataclass(frozen=True)
class Closeness:
    """The smallest margin (or largest load) of one kind, and where; see `checks.Margin`."""

    name: str
    value: float
    unit: str
    where: str
    beyond: bool


@dataclass(frozen=True)
class CheckReport:
    """The verdict on a path.

    Attributes:
        duration_s: None when it is not feasible.
        margins: of the nine joints, as the controller drives; empty when it is not feasible.
        closeness: to bodies, singular poses and the servos' load.
        without_stops: how long a drive without stops would take, and what rules it.
    """

    feasible: bool
    duration_s: float | None
    problems: tuple[Problem, ...]
    margins: tuple[Margin, ...]
    closeness: tuple[Closeness, ...] = ()
    knots: int | None = None
    without_stops: str = ""


def check(path: Path, cell: Cell, speed: float = 1.0) -> CheckReport:
    """Plan a path and tell the verdict. Raises InvalidError as `plan` does."""
    outcome = draw_up(path, cell, speed)
    made = outcome.made
    if made is None:
        return CheckReport(False, None, outcome.problems, ())
    fast = ideal(outcome.blocks, speed, FILTER_S)
    return CheckReport(
        True,
        made.driven_s,
        (),
        _margins(outcome, made.rows),
        tuple(
            Closeness(m.name, m.value, m.unit, where(outcome.blocks, made.rows, m.row), m.beyond)
            for m in made.margins
        ),
        len(made.plan.knots),
        fast.message if isinstance(fast, Problem) else fast.summary(),
    )


def _margins(outcome: Outcome, rows: Samples) -> tuple[Margin, ...]:
    low, high = outcome.setup.ranges.T
    room = np.degrees(np.minimum(rows.joints - low, high - rows.joints))
    speed, acceleration = rates(rows.t, rows.joints)
    return tuple(
        Margin(
            name,
            *_worst(outcome, rows, -room[:, joint], -1.0, 0),
            *_worst(outcome, rows, np.abs(speed[:, joint]), outcome.setup.speeds[joint], 1),
            *_worst(
                outcome, rows, np.abs(acceleration[:, joint]), outcome.setup.accelerations[joint], 0
            ),
        )
        for joint, name in enumerate(JOINT_NAMES)
    )


def _worst(
    outcome: Outcome, rows: Samples, values: Floats, unit: float, offset: int
) -> tuple[float, str]:
    """The largest value in units, and the place of its row."""
    if not len(values):
        return 0.0, "the start"
    row = int(values.argmax())
    return float(values[row] / unit), where(outcome.blocks, rows, row + offset)
