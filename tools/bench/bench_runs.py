"""Runs the octagon on the emulated cell three ways, and prints how wrist and arm kept together.

Run `python tools/bench/bench_runs.py`, about a minute: on the virtual clock; in real time with the
emulators in the daemon's process; in real time against `sphmctl emulate` in another process. The
figures come from the machine's true joints, as summary.json and truth.csv hold them. Not a test.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sphmctl import planner
from sphmctl.config import load_cell
from sphmctl.daemon import assess
from sphmctl.motion import Floats
from sphmctl.pathfile import load_path
from tools.bench.harness import SPHMCTL, Row, markdown, served

COMMAND = "python tools/bench/bench_runs.py"
PATH = Path(__file__).parents[2] / "configs" / "paths" / "octagon.yaml"
SEED = 1
RUN_LIMIT_S = 180.0
"""The octagon takes 20 s; approach, report and a busy machine the rest."""

MAX_SKEW_MS, MAX_CRANK_DEG, MAX_TOOL_MM = 10.0, 0.5, 1.0
"""What the octagon must keep on the virtual clock; in real time it is printed beside it."""


@dataclass(frozen=True)
class Figures:
    """One run, judged by the true joints."""

    name: str
    p50_ms: float
    p99_ms: float
    max_ms: float
    share: float
    crank_deg: float
    tool_mm: float
    duration_s: float

    def line(self) -> str:
        """As a line of the printed table."""
        return (
            f"{self.name:22} {self.p50_ms:6.2f} {self.p99_ms:6.2f} {self.max_ms:6.2f} "
            f"{self.share:6.2f} {self.crank_deg:8.3f} {self.tool_mm:8.3f} {self.duration_s:8.2f}"
        )


def known(value: float | None) -> float:
    """NaN for what is not known."""
    return float("nan") if value is None else value


def run(arguments: list[str], folder: Path) -> dict[str, Any]:
    """One `sphmctl run`; its summary, which may be that of a run that stopped halfway.

    Raises:
        RuntimeError: it did not begin.
    """
    command = [SPHMCTL, "run", str(PATH), "--json", "--runs-dir", str(folder), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=RUN_LIMIT_S, check=False)
    summary: dict[str, Any] = json.loads(done.stdout or "{}")
    if "outcome" not in summary:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    return summary


def named(name: str, summary: dict[str, Any]) -> str:
    """The run's name, and why it stopped if it did."""
    return name if summary["outcome"] == "completed" else f"{name} ({summary['cause']})"


def emulated_run(name: str, arguments: list[str], folder: Path) -> Figures:
    """A run whose summary knows the true joints."""
    summary = run(["--dry-run", "--seed", str(SEED), *arguments], folder)
    skew = summary["skew_ms"]
    return Figures(
        named(name, summary),
        known(skew["p50"]),
        known(skew["p99"]),
        known(skew["max"]),
        known(skew["share_counted"]),
        known(summary["max_crank_error_deg"]),
        known((summary["true_tracking"] or {}).get("max_tcp_mm")),
        summary["duration_s"],
    )


def foreign_run(name: str, folder: Path) -> Figures:
    """A run as on a real cell, against another process that records the truth."""
    truth_file, cell_file = folder / "truth.csv", folder / "cell.yaml"
    emulate = [SPHMCTL, "emulate", "--json", "--seed", str(SEED), "--truth", str(truth_file)]
    with served(emulate) as ready:
        cell_file.write_text(
            "version: 1\n"
            "name: other-process\n"
            f"arm: {{driver: kvp, host: {ready['kvp_host']}, port: {ready['kvp_port']}}}\n"
            f"wrist: {{driver: dynamixel, port: {ready['wrist_port']}, board_id: null}}\n"
        )
        summary = run(["--cell", str(cell_file), "--yes", "--speed", "100"], folder)
    rows = np.loadtxt(truth_file, delimiter=",", skiprows=1)
    times = rows[:, 0] + ready["start_monotonic_s"]
    within = (summary["begin_monotonic_s"] <= times) & (times <= summary["end_monotonic_s"])
    return judge(
        named(name, summary),
        rows[within],
        cell_file,
        summary["duration_s"],
        summary["outcome"] == "completed",
    )


def judge(name: str, rows: Floats, cell_file: Path, duration_s: float, complete: bool) -> Figures:
    """The figures of a run from its true joints: rows of time, s, and nine angles, deg."""
    cell = load_cell(cell_file)
    plan = planner.plan(load_path(PATH), cell, 1.0)
    t, joints = rows[:, 0] - rows[0, 0], rows[:, 1:]
    skew = assess.skew(plan.t, np.degrees(plan.joints), t, joints)
    off = assess.tracking(plan, joints, mount_yaw_rad=cell.mount_yaw_rad, complete=complete)
    return Figures(
        name,
        known(skew.p50_ms),
        known(skew.p99_ms),
        known(skew.max_ms),
        skew.share_counted,
        known(skew.max_crank_error_deg),
        known(off.max_tcp_mm),
        duration_s,
    )


def attempted(name: str, way: Callable[[], Figures]) -> Figures:
    """A run's figures; those of one that did not begin are not known, and the table stays whole."""
    try:
        figures = way()
    except RuntimeError as error:
        print(error)
        nan = known(None)
        figures = Figures(f"{name} (did not begin)", nan, nan, nan, nan, nan, nan, nan)
    print(figures.line(), flush=True)
    return figures


def rows_of(virtual: Figures, others: list[Figures]) -> list[Row]:
    """The table's rows: what the octagon must keep, and what it kept."""

    def row(what: str, unit: str, name: str, limit: float | None) -> Row:
        value = getattr(virtual, name)
        beside = ", ".join(f"{getattr(run, name):.2f} {run.name}" for run in others)
        aim = "" if limit is None else f" (aim: at most {limit:g} {unit})"
        figure = f"octagon, {what}, virtual clock{aim}"
        return Row(figure, f"{value:.2f} {unit}", f"{beside}" or "-", None, None, COMMAND)

    return [
        row("skew, 99 %", "ms", "p99_ms", MAX_SKEW_MS),
        row("largest crank error", "deg", "crank_deg", MAX_CRANK_DEG),
        row("true tool point from the plan", "mm", "tool_mm", MAX_TOOL_MM),
        row("duration", "s", "duration_s", None),
    ]


def measure(real_time: bool = True) -> list[Row]:
    """Run and print; returns the table's rows."""
    print("octagon: skew ms 50 %, 99 %, max; share counted; crank deg; tool mm; duration s")
    with tempfile.TemporaryDirectory(prefix="sphmctl-bench-") as name:
        folder = Path(name)
        virtual = attempted(
            "virtual clock", lambda: emulated_run("virtual clock", ["--virtual"], folder)
        )
        others: list[Figures] = []
        if real_time:
            one, two = "in one process", "in two processes"
            others.append(attempted(one, lambda: emulated_run(one, [], folder)))
            others.append(attempted(two, lambda: foreign_run(two, folder)))
    return rows_of(virtual, others)


def main() -> None:
    """Print the figures and the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--virtual-only", action="store_true", help="leave out real time")
    options = parser.parse_args()
    print(markdown(measure(not options.virtual_only)))


if __name__ == "__main__":
    main()
