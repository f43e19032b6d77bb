"""Times 200,000 workspace samples with the collision filter; prints Tables 3 and 4 beside ours.

Run `python tools/bench/bench_workspace.py`. On a busy machine the clock says little, so processor
time stands beside it, and how long the same machine takes for a fixed piece of numpy. Not a test.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sphmctl.config import emulated_cell
from sphmctl.robots.sphm.workspace import Plane, Region, Robot, survey
from sphmctl.robots.sphm.workspace_sampling import sample
from tools.bench.harness import Row, markdown

SAMPLES = 200_000
SEED = 1
THREADS = 2
AIM_S = 5.0
"""200,000 samples with the filter on two cores."""

REFERENCE_ROUNDS = 400
"""So many sines of an array of SAMPLES: about as long as the sampling takes."""

TABLES = Path(__file__).parents[2] / "tests" / "vectors" / "workspace_tables3_4.csv"
CALL = f"sphmctl workspace --samples {SAMPLES} --json"
COMMAND = "python tools/bench/bench_workspace.py"
PLANES: tuple[Plane, ...] = ("a1_0", "a1_90")


def robot() -> Robot:
    """The packaged cell's, with the tool that the paper's tables have."""
    return Robot(tool=emulated_cell().tool_matrix("face"))


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Seconds by the clock, and of all cores."""
    clock_s, processor_s = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - clock_s, time.process_time() - processor_s


def command() -> tuple[float, float]:
    """The same of the command with its start, cuts and extents."""
    before, clock_s = os.times(), time.perf_counter()
    subprocess.run([sys.executable, "-m", *CALL.split()], check=True, stdout=subprocess.DEVNULL)
    clock_s, after = time.perf_counter() - clock_s, os.times()
    user_s = after.children_user - before.children_user
    return clock_s, user_s + after.children_system - before.children_system


def measure() -> list[Row]:
    """The command's and its sampling's time by the clock and of the processor, as table rows."""
    angles = np.random.default_rng(SEED).uniform(-3.0, 3.0, SAMPLES)
    ours = robot()
    clock_s, processor_s = timed(lambda: sample(ours, "a1_0", SAMPLES, SEED, THREADS))
    _, one_s = timed(lambda: sample(ours, "a1_0", SAMPLES, SEED, 1))
    _, sines_s = timed(lambda: [np.sin(angles) for _ in range(REFERENCE_ROUNDS)])
    whole_s, all_s = command()
    name = f"workspace: {SAMPLES} samples, collisions"
    by_clock = f"{clock_s:.2f} s by the clock, {processor_s:.2f} s of {THREADS} threads"
    sines = f"{sines_s:.2f} s, numpy: {REFERENCE_ROUNDS * SAMPLES:.0e} sines"
    whole = f"{whole_s:.2f} s by the clock, {all_s:.2f} s of all cores"
    return [
        Row("workspace: the command", whole, f"{AIM_S:g} s", whole_s / AIM_S, 1.0, CALL),
        Row(name, by_clock, f"{AIM_S:g} s", clock_s / AIM_S, 1.0, COMMAND),
        Row(f"{name}, one thread", f"{one_s:.2f} s", sines, one_s / sines_s, None, COMMAND),
    ]


def tables() -> list[tuple[str, ...]]:
    """Tables 3 and 4 with the areas: printed, ours, and as samples alone have it."""
    with TABLES.open() as file:
        printed = list(csv.DictReader(file))
    lines: list[tuple[str, ...]] = []
    for plane, pair in zip(PLANES, (printed[:2], printed[2:]), strict=True):
        found = survey(robot(), plane, SAMPLES, SEED, THREADS)
        arm, hybrid = (found.arm, found.sampled_arm), (found.hybrid, found.sampled_hybrid)
        for row, (ours, sampled), (base, sampled_base) in zip(
            pair, (arm, hybrid), (arm, arm), strict=True
        ):
            their = [row[key] for key in row if key.endswith("_mm")]
            spans = f"{their[0]} to {their[1]}", f"{their[2]} to {their[3]}"
            percent = f"{float(row['area_percent_of_kuka']):.2f}"
            name = f"{plane} {row['robot']}"
            lines += [
                (name, "paper", *spans, percent),
                (name, "ours", *_spans(ours), _percent(ours, base)),
                (name, "samples", *_spans(sampled), _percent(sampled, sampled_base)),
            ]
    return lines


def _spans(region: Region) -> tuple[str, str]:
    (left, right), (low, high) = region.horizontal_m, region.z_m
    return f"{1e3 * left:.1f} to {1e3 * right:.1f}", f"{1e3 * low:.1f} to {1e3 * high:.1f}"


def _percent(region: Region, base: Region) -> str:
    return f"{100.0 * region.area_m2 / base.area_m2:.2f}"


def main() -> None:
    """Print both tables."""
    print("| plane, robot | whose | horizontal, mm | z, mm | area, % of the arm's |")
    print("| --- | --- | --- | --- | --- |")
    for line in tables():
        print("| " + " | ".join(line) + " |")
    print()
    print(markdown(measure()))


if __name__ == "__main__":
    main()
