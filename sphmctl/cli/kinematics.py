"""The commands `fk` and `ik`: nine joints to the tool's pose and back, one or a file of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put
from sphmctl.errors import UsageError

CsvOption = Annotated[
    Path | None, typer.Option("--csv", metavar="IN", help="Take a CSV file, row for row.")
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="OUT", help="With --csv: the file to write, whole or not at all."
    ),
]
ToolOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="A tool of the cell, e.g. octagon_pen. Else the platform centre O7."
    ),
]


def fk(
    joints: Annotated[
        str | None,
        typer.Option(metavar="J1,...,J9", help="A1 to A6, theta7 to theta9, degrees, by commas."),
    ] = None,
    csv: CsvOption = None,
    out: OutOption = None,
    tool: ToolOption = None,
    no_limits: Annotated[
        bool, typer.Option("--no-limits", help="Compute joints beyond their range too.")
    ] = False,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Forward kinematics: where nine joint angles put the tool.

    Gives the pose in the arm's base frame, in mm and KUKA's A, B, C in
    degrees, and how the wrist stands.

    With --csv the columns a1_deg to a6_deg, theta7_deg to theta9_deg are
    read, and x_mm, y_mm, z_mm, a_deg, b_deg, c_deg are added, or replaced
    where there are such already. Other columns are carried through; a row
    whose nine joints are all empty gets no pose.

    Example: sphmctl fk --joints 0,-90,90,0,90,0,60,60,60 --tool octagon_pen

    Example: sphmctl fk --csv joints.csv --out poses.csv
    """
    _one_or_file("--joints", joints, csv, out)
    from sphmctl.cli import solving
    from sphmctl.cli.robot import Robot

    robot = Robot.of(cell_of(cell), tool)
    if csv is not None and out is not None:
        put(as_json, solving.forward_file(robot, csv, out, no_limits), _show_file)
    else:
        put(as_json, solving.forward(robot, joints or "", no_limits), _show_pose)
    return 0


def ik(
    pose: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z,A,B,C", help="In the arm's base frame, mm and degrees."),
    ] = None,
    csv: CsvOption = None,
    out: OutOption = None,
    tool: ToolOption = None,
    wrist: Annotated[
        str,
        typer.Option(
            metavar="T7,T8,T9 or auto",
            help="The three crank angles, degrees. auto: far from all limits and near to --near.",
        ),
    ] = "auto",
    near: Annotated[
        str | None,
        typer.Option(metavar="J1,...,J9", help="Joints to stay near to, degrees: nearest first."),
    ] = None,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Inverse kinematics: every set of nine joints that puts the tool at a pose.

    The arm has six joints, so the wrist's three are free: give them, or let
    auto choose. Answers come best first: nearest to --near, else farthest
    from their limits. Exit code 4 and the reason when there is none.

    With --csv the columns x_mm, y_mm, z_mm, a_deg, b_deg, c_deg are read, and
    a1_deg to a6_deg, theta7_deg to theta9_deg are added or replaced: one
    answer a row, going on from the row before where it can, empty where there
    is none. 100,000 rows take two seconds with a fixed wrist. auto seeks
    the wrist's pose over a whole path, and for each pose by itself where the
    rows are none: then 1,000 rows take some seconds.

    Example: sphmctl ik --pose 500,0,300,180,0,180 --wrist 60,60,60

    Example: sphmctl ik --csv poses.csv --out joints.csv --wrist auto
    """
    _one_or_file("--pose", pose, csv, out)
    from sphmctl.cli import solving
    from sphmctl.cli.robot import Robot

    robot = Robot.of(cell_of(cell), tool)
    free = solving.Free.of(robot, wrist, near)
    if csv is not None and out is not None:
        put(as_json, solving.inverse_file(robot, free, csv, out), _show_file)
    else:
        put(as_json, solving.inverse(robot, free, pose or ""), _show_solutions)
    return 0


def _one_or_file(name: str, value: str | None, source: Path | None, out: Path | None) -> None:
    if (value is None) == (source is None):
        raise UsageError(f"give either {name}, or --csv IN with --out OUT", "command line")
    if (source is None) != (out is None):
        raise UsageError("--csv IN and --out OUT go together", "command line")


def _show_pose(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="the tool in the arm's base frame", title_justify="left")
    for name in ("x", "y", "z"):
        table.add_column(f"{name}, mm", justify="right")
    for name in ("A", "B", "C"):
        table.add_column(f"{name}, deg", justify="right")
    numbers_shown = [*document["position_mm"], *document["abc_deg"]]
    table.add_row(*(f"{value:z.4f}" for value in numbers_shown))
    wrist = document["wrist"]
    console = Console()
    console.print(table)
    console.print(
        f"wrist: heave {wrist['heave_mm']:.4f} mm, tilt {wrist['tilt_deg']:.4f} deg towards "
        f"{wrist['tilt_direction_deg']:.4f} deg",
        highlight=False,
    )


def _show_solutions(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    from sphmctl.motion import JOINT_NAMES

    found = document["solutions"]
    answers = "1 answer" if len(found) == 1 else f"{len(found)} answers, best first"
    # Ten columns of seven characters stand within the 80 of a terminal only without borders.
    table = Table(title=f"{answers}; degrees", title_justify="left", box=None, padding=(0, 1, 0, 0))
    for name in (*JOINT_NAMES, "margin"):
        table.add_column(name, justify="right", no_wrap=True)
    for item in found:
        table.add_row(*(f"{value:z.2f}" for value in (*item["joints_deg"], item["margin_deg"])))
    Console().print(table)


def _show_file(document: dict[str, Any]) -> None:
    print(f"{document['out']}: {document['rows']} rows, {document['answered']} with an answer")
