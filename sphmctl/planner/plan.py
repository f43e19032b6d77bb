"""From a path to a plan, or to the reasons why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sphmctl.config import Cell
from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import Floats, Knot, Plan
from sphmctl.pathfile import Path
from sphmctl.planner.blocks import SPEED_LIMIT, Block
from sphmctl.planner.checks import Margin, Surroundings, examine
from sphmctl.planner.ideal import ideal
from sphmctl.planner.legs import Setup
from sphmctl.planner.ruling import Shares, asked, stop_ruling
from sphmctl.planner.sampling import Samples, knots, named, sample, verify, where
from sphmctl.planner.timelaw import FILTER_S
from sphmctl.planner.walk import Walker, walks

TIMINGS = ("stops", "optimal")
"""As the arm's controller drives it, from knot to knot, with no bound on the jerk; or as fast as
joints and tool allow with the jerk bounded, which is what a drive without stops would do. The bound
costs `timelaw.FILTER_S` from each rest to the next: where rests are close, more than the stops."""

PROBLEM_LIMIT = 20
"""Problems that are told; after these the reader mends and asks again."""

DURATION_LIMIT_S = 3600.0
"""One hour; 900,000 samples."""

FINER = (1, 5, 20)
"""Rows to each usual one, tried while these are too coarse: a sampled curve turns at each of its
points within a few rows, whose differences then show more or less than the joints do."""

WORTH = 0.98
"""A plan with finer rows replaces one that takes so much longer."""


@dataclass(frozen=True)
class Made:
    """A plan and what was learnt on the way to it.

    Attributes:
        rows: the plan's rows, with their blocks.
        margins: how near the path comes to bodies, singular poses and the servos' load.
        driven_s: what the arm's controller takes, which stops at every knot; None if it cannot.
        binding: what rules each row, one of `timelaw.LABELS` or `ruling.REST`.
        shares: how much of the time each of these does, the most first.
        asked: the tool's speed (m/s) and acceleration (m/s2) that each row may have, (n, 2).
    """

    plan: Plan
    rows: Samples
    margins: tuple[Margin, ...]
    driven_s: float | None
    binding: tuple[str, ...]
    shares: Shares
    asked: Floats


@dataclass(frozen=True)
class Outcome:
    """What planning gave: a plan, or the problems that are in its way.

    Attributes:
        coarse: finer rows may do better: a joint cannot follow these; the quickest law keeps the
            limits at them and not between them; or it takes longer than the blocks, which stop.
    """

    setup: Setup
    blocks: list[Block]
    problems: tuple[Problem, ...]
    made: Made | None
    coarse: bool = False

    @property
    def duration_s(self) -> float:
        """Of the plan; for ever where there is none."""
        return math.inf if self.made is None else float(self.made.rows.t[-1])


def plan(path: Path, cell: Cell, speed: float = 1.0, timing: str = "stops") -> Plan:
    """Time-stamped joints and arm knots for a path, all checked against every limit.

    Args:
        speed: share of the path's own speed: the same path, `1 / speed` times as long.
        timing: one of TIMINGS.

    Raises:
        InfeasibleError: with all problems found, each with place, joint, value and limit.
        InvalidError: the cell has no such tool or frame, or the speed is not a share.
    """
    return outcome(path, cell, speed, timing).plan


def outcome(path: Path, cell: Cell, speed: float = 1.0, timing: str = "stops") -> Made:
    """A plan and what was learnt on the way to it; raises as `plan` does."""
    drawn = draw_up(path, cell, speed, timing)
    if drawn.made is None:
        first, *more = drawn.problems
        also = f" (and {len(more)} more problems)" if len(more) > 1 else ""
        also = " (and one more problem)" if len(more) == 1 else also
        place = f"{path.file}, {first.where}" if first.where else path.file
        raise InfeasibleError(first.message + also, place, drawn.problems)
    return drawn.made


def draw_up(
    path: Path,
    cell: Cell,
    speed: float = 1.0,
    timing: str = "stops",
    filter_s: float = FILTER_S,
) -> Outcome:
    """As `outcome`, but problems are part of the answer.

    Args:
        filter_s: what bounds the jerk of the optimal timing; 0 leaves it free.
    """
    if not 0.001 <= speed <= SPEED_LIMIT:
        raise InvalidError(
            f"speed {speed * 100:g} % is out of range; give 0.1 to {SPEED_LIMIT:.0%}"
        )
    setup = _setup(path, cell)
    around = Surroundings.of(cell, setup.tool)
    best: Outcome | None = None
    for finer in FINER:
        # Another branch of the start may pass where the nearest one does not.
        found: list[Outcome] = []
        for walker in walks(path, setup, speed, finer):
            found.append(_timed(path, walker, around, timing, filter_s))
            if found[-1].made is not None:
                break
        if best is None or found[-1].duration_s < WORTH * best.duration_s:
            best = found[-1] if found[-1].made else found[0]
        elif best.made is not None:
            break
        if not any(outcome.coarse for outcome in found):
            break
    assert best is not None  # there is at least one walk
    return best


def _timed(
    path: Path, walker: Walker, around: Surroundings, timing: str, filter_s: float
) -> Outcome:
    """Time and check what was walked."""
    draft, setup, speed = walker.draft, walker.setup, walker.scale
    undrivable = draft.undrivable(speed)
    problems = draft.problems + (undrivable if timing == "stops" else [])
    if problems or walker.start is None:
        # One closer look tells whether it is the rows.
        coarse = draft.too_fast and walker.finer == FINER[0]
        return Outcome(setup, draft.blocks, _told(problems), None, coarse)
    blocks, fast = draft.blocks, None
    if timing == "optimal":
        answer = ideal(blocks, speed, filter_s)
        if isinstance(answer, Problem):
            return Outcome(setup, blocks, (answer,), None)
        fast, blocks = answer, answer.blocks
        if undrivable:
            blocks = [replace(block, velocity=None, acceleration=None) for block in blocks]
    if _duration_s(blocks) > DURATION_LIMIT_S:
        return Outcome(setup, blocks, (_too_long(_duration_s(blocks)),), None)
    rows = sample(blocks, setup, walker.start)
    found = examine(rows.joints, around)
    near = [
        replace(p.problem, where=where(blocks, rows, p.row) if p.row else path.moves[0].where)
        for p in found.problems
    ]
    beyond = verify(blocks, rows, setup, speed)
    if beyond + near:
        coarse = fast is not None and not near
        return Outcome(setup, blocks, _told(beyond + near), None, coarse)
    driven_s = None if undrivable else _duration_s(draft.blocks)
    stops = knots(blocks, rows)
    told = _stops_told(len(stops))
    if fast is None:
        binding, shares = stop_ruling(blocks, rows, speed)
    else:
        driven = f"as its controller drives {_duration_s(draft.blocks):.2f} s: {told}"
        if undrivable:
            reason = f"{undrivable[0].where}: {undrivable[0].message}"
            driven = f"its controller cannot drive it ({reason})"
        told = f"without stops {fast.summary()}; {driven}"
        # The quickest law passes the knots: they are none of this plan's stops.
        stops = ()
        binding, shares = fast.binding(rows.t), fast.shares()
    made = _made(path, setup, blocks, rows, stops, (*draft.notes, told))
    tool = asked(blocks, rows, speed)
    slow = fast is not None and driven_s is not None and fast.optimal_s > driven_s
    result = Made(made, rows, found.margins, driven_s, binding, shares, tool)
    return Outcome(setup, blocks, (), result, slow)


def _stops_told(count: int) -> str:
    """How often the arm's controller stops, in words."""
    if not count:
        return "the arm does not move"
    if count == 1:
        return "1 knot in all, an exact stop of the arm"
    return f"{count} knots in all, each an exact stop of the arm"


def _too_long(duration_s: float) -> Problem:
    message = f"the plan would last {duration_s:.0f} s; at most {DURATION_LIMIT_S:.0f} s is allowed"
    return Problem("", "", duration_s, DURATION_LIMIT_S, message)


def _duration_s(blocks: list[Block]) -> float:
    return sum(block.duration_s for block in blocks)


def _made(
    path: Path,
    setup: Setup,
    blocks: list[Block],
    rows: Samples,
    stops: tuple[Knot, ...],
    notes: tuple[str, ...],
) -> Plan:
    first = path.moves[0].point
    return Plan(
        name=path.name,
        t=rows.t,
        joints=rows.joints,
        tool=rows.tool,
        knots=stops,
        points=named(blocks, rows, first.name if first else ""),
        notes=notes,
        tool_on_platform=setup.tool,
        base_in_world=setup.base,
    )


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
