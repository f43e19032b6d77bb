"""From a path to a plan, or to the reasons why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from sphmctl.config import Cell
from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import Plan
from sphmctl.pathfile import Path
from sphmctl.planner.blocks import Block
from sphmctl.planner.checks import Margin, Surroundings, examine
from sphmctl.planner.ideal import Ideal, ideal
from sphmctl.planner.legs import Setup
from sphmctl.planner.sampling import Samples, knots, named, sample, verify, where
from sphmctl.planner.timelaw import FILTER_S
from sphmctl.planner.walk import walk

Timing: TypeAlias = Literal["stops", "optimal"]

PROBLEM_LIMIT = 20
"""Problems that are told; after these the reader mends and asks again."""

DURATION_LIMIT_S = 3600.0
"""One hour; 900,000 samples."""

SPEED_LIMIT = 1.5
"""Highest share of a path's own speed, as the override of the tools people know."""


@dataclass(frozen=True)
class Outcome:
    """What planning gave.

    Attributes:
        plan, rows: None when there are problems.
        margins: how near the path comes to bodies, singular poses and the servos' load.
        binding: what binds at each row, one of `timelaw.LABELS`; None for the controller's timing.
    """

    setup: Setup
    blocks: list[Block]
    problems: tuple[Problem, ...]
    plan: Plan | None
    rows: Samples | None
    margins: tuple[Margin, ...] = ()
    binding: tuple[str, ...] | None = None


def plan(path: Path, cell: Cell, speed: float = 1.0, timing: Timing = "stops") -> Plan:
    """Time-stamped joints and arm knots for a path, all checked against every limit.

    Args:
        speed: share of the path's own speed: the same path, `1 / speed` times as long.
        timing: "stops" as the arm's controller drives it, from knot to knot; "optimal" as fast as
            joints and tool allow, with the jerk bounded: what a continuous drive would do.

    Raises:
        InfeasibleError: with all problems found, each with place, joint, value and limit.
        InvalidError: the cell has no such tool or frame, or the speed is not a share.
    """
    outcome = draw_up(path, cell, speed, timing)
    if outcome.plan is None:
        first, *more = outcome.problems
        also = f" (and {len(more)} more problems)" if len(more) > 1 else ""
        also = " (and one more problem)" if len(more) == 1 else also
        place = f"{path.file}, {first.where}" if first.where else path.file
        raise InfeasibleError(first.message + also, place, outcome.problems)
    return outcome.plan


def draw_up(
    path: Path,
    cell: Cell,
    speed: float = 1.0,
    timing: Timing = "stops",
    filter_s: float = FILTER_S,
) -> Outcome:
    """As `plan`, but problems are part of the answer."""
    if not 0.001 <= speed <= SPEED_LIMIT:
        raise InvalidError(
            f"speed {speed * 100:g} % is out of range; give 0.1 to {SPEED_LIMIT:.0%}"
        )
    setup = _setup(path, cell)
    walker = walk(path, setup, speed)
    draft = walker.draft
    if draft.problems or walker.start is None:
        return Outcome(setup, draft.blocks, _told(draft.problems), None, None)
    blocks, notes = draft.blocks, list(draft.notes)
    driven_s = sum(block.duration_s for block in blocks)
    fast: Ideal | None = None
    if timing == "optimal":
        answer = ideal(blocks, speed, filter_s)
        if isinstance(answer, Problem):
            return Outcome(setup, blocks, (answer,), None, None)
        fast, blocks = answer, answer.blocks
        notes.append(answer.summary())
    duration_s = sum(block.duration_s for block in blocks)
    if duration_s > DURATION_LIMIT_S:
        message = (
            f"the plan would last {duration_s:.0f} s; at most {DURATION_LIMIT_S:.0f} s is allowed"
        )
        problem = Problem("", "", duration_s, DURATION_LIMIT_S, message)
        return Outcome(setup, blocks, (problem,), None, None)
    rows = sample(blocks, setup, walker.start)
    problems = verify(blocks, rows, setup, speed)
    found = examine(rows.joints, Surroundings.of(cell, setup.tool))
    for row in found.problems:
        problems.append(replace(row.problem, where=where(blocks, rows, row.row)))
    if problems:
        return Outcome(setup, blocks, _told(problems), None, None)
    first = path.moves[0].point
    stops = knots(blocks, rows)
    summary = f"{len(stops)} knots in all, each an exact stop of the arm"
    if fast is not None:
        summary += f": {driven_s:.2f} s as its controller drives"
    made = Plan(
        name=path.name,
        t=rows.t,
        joints=rows.joints,
        tool=rows.tool,
        knots=stops,
        points=named(blocks, rows, first.name if first else ""),
        notes=(*notes, summary),
        tool_on_platform=setup.tool,
        base_in_world=setup.base,
    )
    binding = None if fast is None else tuple(fast.binding(rows.t))
    return Outcome(setup, blocks, (), made, rows, found.margins, binding)


def _setup(path: Path, cell: Cell) -> Setup:
    """The robot as the path uses it; an unknown tool or frame is told with its line."""
    line = path.tool_line
    try:
        cell.tool_matrix(path.tool)
        line = path.base_line
        return Setup.of(path, cell)
    except InvalidError as problem:
        raise InvalidError(problem.message, f"{path.file}, line {line}") from None


def _told(problems: list[Problem]) -> tuple[Problem, ...]:
    """The problems without repetition, in order."""
    return tuple(dict.fromkeys(problems))[:PROBLEM_LIMIT]
