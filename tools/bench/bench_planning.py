"""Times planning as the arm's controller drives: the octagon, and polylines of many points.

Run `python tools/bench/bench_planning.py`; CPU time of this process, the least of a few repeats,
files read before. Not a test.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path as FilePath

import numpy as np

from sphmctl.config import emulated_cell
from sphmctl.pathfile import Path, load_path
from sphmctl.planner import plan
from tools.bench.harness import Row, markdown

OCTAGON = FilePath(__file__).parents[2] / "configs" / "paths" / "octagon.yaml"
REPEATS, QUICK_REPEATS = 3, 1
COMMAND = "python tools/bench/bench_planning.py"

OCTAGON_AIM_S = 0.3
POINTS, POLYLINE_AIM_S = 10_000, 5.0

TIMES, GROWTH_AIM = 10, 1.2
"""So many times the points may take so much more than as many times the time."""

TURN_POINTS = 314.16
"""Points of a turn of the polyline: about 1 mm apart on a radius of 50 mm."""

HEAD = """version: 1
name: scan
tool: octagon_pen
speed: {tcp_mm_s: 100, tcp_mm_s2: 500}
wrist: {policy: fixed, cranks_deg: [60, 60, 60]}
moves:
"""


def polyline(points: int, folder: FilePath) -> Path:
    """Coils of a slowly changing radius and height, as a path file with its CSV."""
    a = 2.0 * np.pi * np.arange(points + 1) / TURN_POINTS
    radius = 50.0 + 8.0 * np.sin(a / 7.3)
    rows = np.column_stack(
        [560.0 + radius * np.cos(a), radius * np.sin(a), 80.0 + 20.0 * np.sin(a / 5.1)]
    )
    np.savetxt(
        folder / "scan.csv", rows, "%.6f", delimiter=",", header="x_mm,y_mm,z_mm", comments=""
    )
    first = ", ".join(f"{x:.6f}" for x in rows[0])
    file = folder / "scan.yaml"
    file.write_text(
        f"{HEAD}  - ptp: {{pose: [{first}, 180, 0, 180]}}\n  - polyline: {{csv: scan.csv}}\n"
    )
    return load_path(file)


def planning_s(path: Path, repeats: int) -> float:
    """CPU time of planning, the least of some repeats."""
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        plan(path, emulated_cell())
        spent.append(time.process_time() - begin)
    return min(spent)


def measure(repeats: int = REPEATS, large: bool = True) -> list[Row]:
    """The table's rows."""
    octagon_s = planning_s(load_path(OCTAGON), repeats + 1)  # the first one warms up
    rows = [_row("the octagon", octagon_s, OCTAGON_AIM_S)]
    with tempfile.TemporaryDirectory() as name:
        folder = FilePath(name)
        some_s = planning_s(polyline(POINTS, folder), repeats)
        rows.append(_row(f"a polyline of {POINTS} points", some_s, POLYLINE_AIM_S))
        if large:
            many_s = planning_s(polyline(TIMES * POINTS, folder), 1)
            name = f"a polyline of {TIMES * POINTS} points"
            rows.append(_row(name, many_s, GROWTH_AIM * TIMES * some_s))
    return rows


def _row(name: str, ours_s: float, aim_s: float) -> Row:
    print(f"planning {name}: {ours_s:.2f} s", flush=True)
    title = f"planning {name}: CPU time"
    return Row(title, f"{ours_s:.2f} s", f"{aim_s:.3g} s", ours_s / aim_s, 1.0, COMMAND)


def main() -> None:
    """Print the figures and the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help="the least of so many")
    print(markdown(measure(parser.parse_args().repeats)))


if __name__ == "__main__":
    main()
