"""Compares the KRL program that is commonly published for KUKAVARPROXY with ours, on one emulator.

Run `python tools/bench/published.py`, two minutes on an idle machine: the octagon's knots by an
endless PTP to one global variable (`krl/`), and by `firmware/krc` under the daemon. In virtual
time, so that it prints the same each time. Not a test.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from statistics import median

import numpy as np

from tools.bench import published_figures as figures
from tools.bench import published_runs as runs
from tools.bench.harness import Row
from tools.bench.published_figures import Path, Stop
from tools.bench.published_runs import BY_PRESENT, BY_SILENCE, OURS, Form

COMMAND = "python tools/bench/published.py"

SEEDS = 5

EXACT, BLENDED = "PUB_EXACT", "PUB_BLENDED"

DENSE_S = 0.05
"""Between two points of the dense stream: a usual rate of such clients, 20 in a second."""

REDUCED = 0.3
"""An override that somebody reduces, as a share of the one the comparison has."""


@dataclass(frozen=True)
class Speeds:
    """Overrides for the published program, whose only speed is the controller's.

    Attributes:
        enough_percent: the least at which no block takes longer than planned.
        planned_percent: the largest at which the flange is never faster than planned.
    """

    enough_percent: int
    planned_percent: int


def speeds() -> Speeds:
    """Both from the true motion at override 100, where the exact form drives knot by knot."""
    plan = runs.octagon()
    drive = runs.drive(Form("", EXACT), 1)
    taken_s = figures.moving_times_s(drive)
    planned_s = np.diff(plan.t[[0, *(knot.sample for knot in plan.knots)]])
    if figures.lost_points(drive) or len(taken_s) != len(planned_s):
        raise RuntimeError("at override 100 the published program did not drive knot by knot")
    share = figures.planned_mm_s(plan) / figures.path_of(drive, plan).speed_mm_s
    longest = float((np.array(taken_s) / planned_s).max())
    return Speeds(math.ceil(100.0 * longest), math.floor(100.0 * share))


def forms() -> tuple[Form, ...]:
    """What is compared."""
    speed = speeds()
    planned, reduced = speed.planned_percent, round(speed.enough_percent * REDUCED)
    return (
        Form("ours"),
        Form("exact, full speed", EXACT),
        Form("exact, just fast enough", EXACT, speed.enough_percent),
        Form("exact, the plan's speed", EXACT, planned),
        Form("blended, full speed", BLENDED),
        Form("blended, just fast enough", BLENDED, speed.enough_percent),
        Form("blended, the plan's speed", BLENDED, planned),
        Form("blended, full speed, a point every 50 ms", BLENDED, 100, DENSE_S),
        Form("ours, override reduced to 30 %", OURS, round(100 * REDUCED), aside=True),
        Form("exact, just fast enough, override reduced to 30 %", EXACT, reduced, aside=True),
    )


@dataclass(frozen=True)
class Job:
    """One run; `way` is empty for one that nobody stops."""

    form: Form
    seed: int
    stop_tau_s: float | None = None
    way: str = ""


def job_of(job: Job) -> Path | Stop:
    """Do it, and judge it."""
    drive = runs.drive(job.form, job.seed, job.stop_tau_s, job.way)
    return figures.stop_of(drive) if job.way else figures.path_of(drive, runs.octagon())


def jobs_of(form: Form, seeds: int) -> list[Job]:
    """With each seed a whole run, and for each way to stop one in the middle of another block."""
    middles_s = runs.middles_s()
    if form.aside:
        return [Job(form, 1)]
    jobs = [Job(form, seed) for seed in range(1, seeds + 1)]
    ways = [BY_SILENCE] if form.program == OURS else [BY_SILENCE, BY_PRESENT]
    for way in ways:
        for k in range(seeds):
            place_s = float(middles_s[(2 * k + 1) * len(middles_s) // (2 * seeds)])
            jobs.append(Job(form, k + 1, place_s, way))
    return jobs


@dataclass(frozen=True)
class Result:
    """One form over all seeds; ours has one way to stop."""

    form: Form
    paths: list[Path]
    stops: dict[str, list[Stop]]

    @property
    def name(self) -> str:
        """With whose it is."""
        return self.form.name if self.form.program == OURS else f"published, {self.form.name}"


def results_of(every: Sequence[Form], seeds: int) -> list[Result]:
    """Run all, on all processors."""
    jobs = [job for form in every for job in jobs_of(form, seeds)]
    found = {form: Result(form, [], {}) for form in every}
    # Forked: the plan, which is made by now, need not be made in each process.
    with ProcessPoolExecutor(mp_context=get_context("fork")) as pool:
        for job, figure in zip(jobs, pool.map(job_of, jobs), strict=True):
            result = found[job.form]
            if isinstance(figure, Path):
                result.paths.append(figure)
            else:
                result.stops.setdefault(job.way, []).append(figure)
    return list(found.values())


def both(values: Sequence[float], digits: int = 1) -> str:
    """Median and worst."""
    middle, worst = f"{median(values):.{digits}f}", f"{max(values):.{digits}f}"
    return middle if middle == worst else f"{middle} / {worst}"


COLUMNS: tuple[tuple[str, Callable[[Path], float], int], ...] = (
    ("points lost", lambda p: p.lost, 0),
    ("of", lambda p: p.points, 0),
    ("blocks without way", lambda p: p.repeated, 0),
    ("time s", lambda p: p.time_s, 2),
    ("off the path mm", lambda p: p.off_mm, 2),
    ("off at equal times mm", lambda p: p.late_mm, 0),
    ("fastest mm/s", lambda p: p.speed_mm_s, 0),
)

STOP_COLUMNS: tuple[tuple[str, Callable[[Stop], float]], ...] = (
    ("deg", lambda stop: stop.way_deg),
    ("s", lambda stop: stop.rest_s),
)


def path_table(results: Sequence[Result]) -> str:
    """What became of the points and the path."""
    lines = [
        [result.name]
        + [both([value(path) for path in result.paths], digits) for _, value, digits in COLUMNS]
        for result in results
    ]
    return table(["median / worst", *(name for name, _, _ in COLUMNS)], lines)


def stop_table(results: Sequence[Result]) -> str:
    """What a stop did: the published client's two ways, our one in both places."""
    ways = (BY_SILENCE, BY_PRESENT)
    lines = []
    for result in results:
        if not result.stops:
            continue
        line = [result.name]
        for way in ways:
            stops = result.stops.get(way, result.stops[BY_SILENCE])
            line += [both([value(stop) for stop in stops], 2) for _, value in STOP_COLUMNS]
        lines.append(line)
    head = [f"client {way}, {name}" for way in ways for name, _ in STOP_COLUMNS]
    return table(["after a stop, median / worst", *head], lines)


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def measure(seeds: int = SEEDS) -> list[Row]:
    """Run and print; returns the rows for the table of all benchmarks."""
    results = results_of(forms(), seeds)
    overrides = {r.form.name: r.form.override_percent for r in results if r.form.program != OURS}
    print("overrides:", ", ".join(f"{name} {value} %" for name, value in overrides.items()))
    print(f"seeds: {seeds}\n")
    print(path_table(results))
    print()
    print(stop_table(results))
    ours, theirs = (
        results[0],
        next(r for r in results if r.name.endswith("exact, the plan's speed")),
    )
    way = [median(s.way_deg for s in r.stops[BY_SILENCE]) for r in (ours, theirs)]
    lost = [median(p.lost for p in r.paths) for r in (ours, theirs)]
    name = theirs.name
    return [
        Row("knots lost", f"{lost[0]:g}", f"{lost[1]:g}, {name}", None, None, COMMAND),
        Row(
            "motion after a stop",
            f"{way[0]:.2f} deg",
            f"{way[1]:.2f} deg, {name}",
            way[0] / way[1],
            1.0,
            COMMAND,
        ),
    ]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, choices=range(1, 21), metavar="N")
    measure(parser.parse_args().seeds)


if __name__ == "__main__":
    main()
