"""The commands `check` and `plan`: whether a path can be driven, and the plan that does it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put, whole_file
from sphmctl.errors import UsageError

INFEASIBLE_EXIT = 4

TimingOption = Annotated[
    str,
    typer.Option(
        help="stops: as the arm's controller drives, from knot to knot. optimal: the quickest "
        "without its stops, jerk bounded, which the controller cannot drive yet; that takes 24 ms "
        "longer from each rest of the path to the next, so where these are close it may last "
        "longer than stops, with no such bound.",
    ),
]

PathArgument = Annotated[Path, typer.Argument(metavar="PATH", help="The path file.")]
SpeedOption = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        help="Scale the plan in time, same path. Else the cell's speed_percent; real cells 10.",
    ),
]


def check(
    path: PathArgument,
    speed: SpeedOption = None,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Tell whether a path can be driven, in what time, and how near to the limits.

    Nothing moves. The whole plan is checked against reach, and against ranges,
    speeds and accelerations of all nine joints and of the tool. Exit code 4
    when it cannot be driven, with place, joint, value and limit.

    Example: sphmctl check configs/paths/octagon.yaml --speed 50
    """
    from dataclasses import asdict

    from sphmctl import planner
    from sphmctl.pathfile import load_path

    chosen = cell_of(cell)
    percent = chosen.plan_speed_percent if speed is None else speed
    report = planner.check(load_path(path), chosen, percent / 100.0)
    put(as_json, asdict(report), _show_report)
    return 0 if report.feasible else INFEASIBLE_EXIT


def plan(
    path: PathArgument,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write the plan's rows as CSV.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Draw path, joints, speeds, margins and what binds."),
    ] = None,
    view: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Write a page that shows the robot moving in 3D."),
    ] = None,
    timing: TimingOption = "stops",
    speed: SpeedOption = None,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Write a path's plan as CSV, as a drawing, or as a page with the robot in 3D.

    Nothing moves. Give at least one of the three files; each is written whole or
    not at all, and replaces one of that name. The page opens in any browser,
    without network. The columns of the CSV are t_s, a1_deg to a6_deg, theta7_deg
    to theta9_deg, x_mm, y_mm, z_mm, a_deg, b_deg, c_deg in the path's base frame,
    and knot, the number of the stop that the arm makes there; it stays empty with
    --timing optimal, which does not stop. --json also tells what binds how long.
    Exit code 4 when the path cannot be driven.

    Example: sphmctl plan configs/paths/octagon.yaml --out octagon.csv
    """
    from contextlib import ExitStack

    from sphmctl import pictures, planner
    from sphmctl.pathfile import load_path, sources

    files = {"out": out, "plot": plot, "view": view}
    given = [file.resolve() for file in files.values() if file]
    if not given or len(set(given)) < len(given):
        raise UsageError("give --out, --plot or --view, each with its own file", "command line")
    if timing not in planner.TIMINGS:
        raise UsageError(f"{timing!r}: give {' or '.join(planner.TIMINGS)}", "--timing")
    chosen = cell_of(cell)
    percent = chosen.plan_speed_percent if speed is None else speed
    wanted = load_path(path)
    made_from = {file.resolve() for file in [*sources(wanted).values(), *([cell] if cell else [])]}
    lost = next((str(file) for file in given if file in made_from), None)
    if lost is not None:
        raise UsageError("the plan is made from this file; give another name", lost)
    limits = pictures.Limits(chosen.ranges_rad, chosen.speeds_rad_s, chosen.accelerations_rad_s2)
    with ExitStack() as opened:
        streams = {
            kind: opened.enter_context(whole_file(file)) for kind, file in files.items() if file
        }
        outcome = planner.outcome(wanted, chosen, percent / 100.0, timing)
        made = outcome.plan
        if "out" in streams:
            streams["out"].write(planner.plan_csv(made))
        if "plot" in streams:
            margins = [pictures.Margin(m.title, m.unit, m.values, m.limit) for m in outcome.margins]
            binding = pictures.Binding(outcome.binding, outcome.shares)
            drawn = pictures.plot(made, limits, binding, outcome.asked, margins)
            streams["plot"].write(drawn)
        if "view" in streams:
            frames = wanted.tool or "O7", wanted.base if isinstance(wanted.base, str) else "base"
            around = chosen.obstacle_bodies
            page = pictures.view(
                made, limits, chosen.mount_yaw_rad, outcome.binding, around, frames
            )
            streams["view"].write(page)
    document = {
        "name": made.name,
        **{kind: str(file) if file else None for kind, file in files.items()},
        "duration_s": made.duration_s,
        "speed_percent": percent,
        "timing": timing,
        "rows": len(made.t),
        "knots": len(made.knots),
        "binding": [
            {"label": label, "share_percent": 100.0 * share} for label, share in outcome.shares
        ],
        "points": [
            {"name": point.name, "t_s": float(made.t[point.sample])} for point in made.points
        ],
        "notes": list(made.notes),
    }
    put(as_json, document, _show_plan)
    return 0


def _show_report(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not document["feasible"]:
        for problem in document["problems"]:
            where = f"{problem['where']}: " if problem["where"] else ""
            print(f"{where}{problem['message']}")
        count = len(document["problems"])
        print(f"not feasible: {count} problem{'s' if count > 1 else ''}")
        return
    table = Table(title="how near each joint comes to its limits", title_justify="left")
    table.add_column("joint")
    table.add_column("to range end, deg", justify="right")
    table.add_column("at", overflow="fold")
    table.add_column("speed, %", justify="right")
    table.add_column("acceleration, %", justify="right")
    for margin in document["margins"]:
        table.add_row(
            margin["joint"],
            f"{margin['range_deg']:.3f}",
            margin["range_where"],
            f"{100.0 * margin['speed_share']:.1f}",
            f"{100.0 * margin['acceleration_share']:.1f}",
        )
    console.print(table)
    near = Table(title="how near the path comes", title_justify="left")
    near.add_column("to", overflow="fold")
    near.add_column("at least", justify="right", overflow="fold")
    near.add_column("at", overflow="fold")
    for item in document["closeness"]:
        more = "more than " if item["beyond"] else ""
        near.add_row(
            item["name"], f"{more}{round(item['value'], 6):.4g} {item['unit']}", item["where"]
        )
    console.print(near)
    count = document["knots"]
    stops = f"the {count} stops" if count > 1 else "the one stop" if count else "stops"
    console.print(f"without {stops}: {document['without_stops']}", markup=False)
    print(f"feasible: {document['duration_s']:.2f} s")


def _show_plan(document: dict[str, Any]) -> None:
    for note in document["notes"]:
        print(note)
    for kind in ("plot", "view"):
        if document[kind]:
            print(document[kind])
    told = f"{document['rows']} rows, {document['duration_s']:.2f} s"
    print(f"{document['out']}: {told}" if document["out"] else told)
