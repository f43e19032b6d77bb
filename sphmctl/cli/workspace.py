"""The command `workspace`: where the arm alone and the hybrid can reach in a vertical plane."""

from __future__ import annotations

from enum import StrEnum
from math import isnan
from pathlib import Path
from typing import Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put

SAMPLES = 200_000
MOST_SAMPLES = 2_000_000
"""These take 600 MB; a Raspberry Pi has not much more to spare."""


class PlaneName(StrEnum):
    """Where axis 1 stands."""

    A1_0 = "a1_0"
    A1_90 = "a1_90"


def workspace(
    samples: Annotated[
        int, typer.Option(min=1, max=MOST_SAMPLES, help="Random poses of all nine joints.")
    ] = SAMPLES,
    seed: Annotated[int, typer.Option(min=0, help="The same seed draws the same samples.")] = 1,
    plane: Annotated[
        PlaneName,
        typer.Option(help="The arm's plane with axis 1 at 0, or at -90 and 90 degrees together."),
    ] = PlaneName.A1_0,
    tool: Annotated[
        str, typer.Option(metavar="NAME", help="The tool of the cell whose point is followed.")
    ] = "face",
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw clouds, cuts and capability maps, as SVG."),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the samples: joints, pose, collides (0 or 1)."),
    ] = None,
    capability: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="Write as CSV which ways can be pointed where."),
    ] = None,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Workspace of the arm alone (its flange) and of the hybrid (a tool's point), cut by a plane.

    Extents are found by optimisation over the joints, free of collisions; areas
    are those of the exact cut, which knows the joints' ranges but no collisions.
    Beside them stands what the random samples show by themselves: how far they
    get, the cells of 20 mm that they mark, the same of those that collide with
    nothing, and how much that is off (the bias).

    The map has squares of 50 mm: the share of 48 directions in the plane that
    can be pointed to, how far one may lean from straight down either way, both
    in poses that touch nothing, and whether a free sample lies there (1 or 0).

    The cell gives the joints' ranges, the wrist's mount, tools and obstacles.

    Example: sphmctl workspace --plane a1_90 --plot workspace.svg

    Example: sphmctl workspace --samples 20000 --seed 7 --csv samples.csv --json
    """
    from sphmctl.cli import surveying

    chosen = surveying.Choice(samples, seed, plane.value, tool, plot, csv, capability)
    put(as_json, surveying.survey(cell_of(cell), chosen), _show)
    return 0


def _show(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    title = f"{document['plane']}, tool {document['tool']}, cell {document['cell']}"
    table = Table(title=title, title_justify="left")
    for name in ("", "horizontal, mm", "z, mm", "area, m2"):
        table.add_column(name, justify="right" if name else "left")
    sampled = document["monte_carlo"]
    for name, part in (
        ("arm alone", document["kuka"]),
        ("hybrid", document["hybrid"]),
        ("arm alone, samples", sampled["kuka"]),
        ("hybrid, samples", sampled["hybrid"]),
        ("arm alone, free samples", sampled["kuka_free"]),
        ("hybrid, free samples", sampled["hybrid_free"]),
    ):
        spans = [
            "none" if isnan(part[key][0]) else f"{part[key][0]:.1f} to {part[key][1]:.1f}"
            for key in ("horizontal_mm", "z_mm")
        ]
        table.add_row(name, *spans, f"{part['area_mm2'] / 1e6:.4f}")
    console = Console()
    console.print(table)
    bias = sampled["bias"]
    console.print(
        f"hybrid by arm: {document['ratio_percent']:.2f} % of the area; samples "
        f"{sampled['ratio_percent']:.2f} %, free samples {sampled['ratio_free_percent']:.2f} %\n"
        f"bias of the samples' areas: arm {bias['kuka_area_percent']:+.2f} %, hybrid "
        f"{bias['hybrid_area_percent']:+.2f} %; of the ratio {bias['ratio_points']:+.2f} points\n"
        f"{sampled['kept']} of {document['samples']} samples in the plane, {sampled['free']} free "
        f"of collisions; {document['elapsed_s']:.1f} s",
        highlight=False,
        soft_wrap=True,
    )
