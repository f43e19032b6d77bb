"""The commands `export urdf` and `export mjcf`: the robot's model for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put, whole_file

if TYPE_CHECKING:
    from sphmctl.config import Cell
    from sphmctl.motion import Floats

app = typer.Typer(
    name="export",
    no_args_is_help=True,
    help="The robot's model for other programs: URDF, and MJCF with the wrist's loops closed.",
)

OutOption = Annotated[
    Path, typer.Option(metavar="FILE", help="The file to write, whole or not at all.")
]
ToolOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="A tool of the cell; else the platform's centre is the tip."),
]


@app.callback()
def export() -> None:
    """The robot's model for other programs: URDF, and MJCF with the wrist's loops closed."""


@app.command("urdf")
def urdf(
    out: OutOption, tool: ToolOption = None, cell: CellOption = None, as_json: JsonOption = False
) -> int:
    """Write the robot as URDF, its platform on a virtual chain of three joints.

    The joints A1 to A6 are KUKA's angles. URDF knows no loops: the platform moves by heave,
    direction and tilt instead of crank angles, and joints that mimic these give it its sideways
    shift. The comment in the file has the formulas, sphmctl.robots.export.joint_values the values.
    Ranges and speeds are the cell's; the platform's follow from the cranks'.

    Example: sphmctl export urdf --out sphm.urdf --tool octagon_pen
    """
    from sphmctl.robots import export

    def text(at: Floats | None, of: Cell) -> str:
        return export.urdf(at, of.mount_yaw_rad, of.ranges_rad, of.speeds_rad_s)

    return _write("urdf", text, out, tool, cell, as_json)


@app.command("mjcf")
def mjcf(
    out: OutOption, tool: ToolOption = None, cell: CellOption = None, as_json: JsonOption = False
) -> int:
    """Write the robot as MJCF for MuJoCo, with nine position drives and the legs' loops closed.

    Begin a simulation at the key "home": from the straight legs of joint angles 0 the loops may
    close the wrong way. Masses of links are guesses, and gravity is taken off the robot. Ranges
    are the cell's.

    Example: sphmctl export mjcf --out sphm.xml --tool octagon_pen
    """
    from sphmctl.robots import export

    def text(at: Floats | None, of: Cell) -> str:
        return export.mjcf(at, of.mount_yaw_rad, of.ranges_rad)

    return _write("mjcf", text, out, tool, cell, as_json)


def _write(
    kind: str,
    text: Callable[[Floats | None, Cell], str],
    out: Path,
    tool: str | None,
    cell: Path | None,
    as_json: bool,
) -> int:
    chosen = cell_of(cell)
    at = None if tool is None else chosen.tool_matrix(tool)
    with whole_file(out) as stream:
        stream.write(text(at, chosen))
    document = {"format": kind, "out": str(out), "tool": tool, "cell": chosen.name}
    put(as_json, document, _show)
    return 0


def _show(document: dict[str, Any]) -> None:
    tool = document["tool"] or "none"
    print(f"{document['out']}: {document['format']}, cell {document['cell']}, tool {tool}")
