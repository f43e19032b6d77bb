"""Times the time law beside toppra on the same rows: duration of the motion, and CPU time.

Run `python tools/bench/bench_timing.py`; one thread, the least CPU time of a few repeats, the two
taking turns. Not a test; toppra has wheels for x86-64 only.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from itertools import pairwise

from sphmctl.motion import Floats
from sphmctl.planner.timelaw import FILTER_S, TimeLaw, time_law
from sphmctl.planner.topp import Bounds
from tests.planner.timing_paths import Way, bounds, octagon, rounded_square, stream_use, waves
from tests.planner.toppra_oracle import toppra_duration_s
from tools.bench.harness import Row, markdown

REPEATS, QUICK_REPEATS = 3, 1
COMMAND = "python tools/bench/bench_timing.py"

SLOWER = 1.05
"""Our duration without jerk limit by toppra's, at most."""

CPU_AIM = 1.0
"""Our CPU time by toppra's, at most."""

LARGE = ((30_000, 1.5), (100_000, 5.0))
"""Rows, and the CPU time for them, s, jerk limit and its rounds included."""


@dataclass(frozen=True)
class Case:
    """One path, resolved before anything is timed; toppra drives it from stop to stop."""

    name: str
    way: Way
    limits: Bounds
    stops: tuple[int, ...] = ()
    arc_length: bool = False
    joints: Floats = field(init=False)
    tool: Floats = field(init=False)

    def __post_init__(self) -> None:
        joints, tool = self.way.at(self.way.s)
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "tool", tool)

    def law(self, filter_s: float) -> TimeLaw:
        """Ours."""
        way = self.way
        law = time_law(self.joints, way.s, self.tool, self.limits, way.cuts, self.stops, filter_s)
        assert isinstance(law, TimeLaw)
        return law

    def toppra_s(self) -> float:
        """Toppra's duration."""
        s, point = self.way.s, self.tool[:, :2]
        parts = [slice(a, b + 1) for a, b in pairwise((0, *self.stops, len(s) - 1))]
        return sum(
            toppra_duration_s(
                self.joints[part], s[part], self.limits, point[part] if self.arc_length else None
            )
            for part in parts
        )


def cases() -> list[Case]:
    """The octagon as the paper drives it and as fast as it goes, a square, random joints."""
    sides, square = octagon(0.001), rounded_square(0.02, 0.2, 0.001)
    return [
        Case("octagon at 100 mm/s", sides, bounds(0.1, 0.5), sides.cuts, arc_length=True),
        Case("octagon at the joints' limits", sides, bounds(), sides.cuts),
        Case("square with round corners", square, bounds()),
        *(Case(f"random joints, {rows} rows", waves(1, rows), bounds()) for rows in (1000, 3000)),
    ]


def measure(repeats: int = REPEATS) -> list[Row]:
    """The table's rows; prints what the jerk limit costs and what binds."""
    rows = []
    for case in cases():
        ours, theirs = [], []
        for _ in range(repeats):
            started = time.process_time()
            law = case.law(0.0)
            between = time.process_time()
            toppra_s = case.toppra_s()
            ours.append(between - started)
            theirs.append(time.process_time() - between)
        rows.append(row("duration", case, law.duration_s, toppra_s, SLOWER))
        if not case.arc_length:  # else toppra's circle of tool acceleration is finer than ours
            rows.append(row("CPU time", case, min(ours), min(theirs), CPU_AIM))
        smooth = case.law(FILTER_S)
        use = stream_use(smooth, case.way, case.limits).max()
        print(f"{case.name}: {smooth.summary()}; {use:.4f} of a limit at most", flush=True)
    return rows + [large(count, aim_s, repeats) for count, aim_s in LARGE]


def row(what: str, case: Case, ours_s: float, theirs_s: float, aim: float) -> Row:
    """One comparison."""
    name = f"timing, {case.name}: {what}"
    return Row(
        name, f"{ours_s:.4f} s", f"{theirs_s:.4f} s, toppra", ours_s / theirs_s, aim, COMMAND
    )


def large(count: int, aim_s: float, repeats: int) -> Row:
    """The CPU time of many rows, with jerk limit."""
    case = Case("", waves(1, count), bounds())
    spent = []
    for _ in range(repeats):
        started = time.process_time()
        case.law(FILTER_S)
        spent.append(time.process_time() - started)
    name, ours_s = f"timing, {count} rows, jerk-limited: CPU time", min(spent)
    return Row(name, f"{ours_s:.2f} s", f"{aim_s:g} s", ours_s / aim_s, 1.0, COMMAND)


def main() -> None:
    """Print the figures and the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help="the least of so many")
    print(markdown(measure(parser.parse_args().repeats)))


if __name__ == "__main__":
    main()
