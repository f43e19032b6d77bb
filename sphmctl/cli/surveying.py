"""What the command `workspace` computes and writes, in mm and degrees.

Imported when it runs, for it brings numpy with it.
"""

from __future__ import annotations

import contextlib
import csv
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from sphmctl.cli.columns import JOINT_COLUMNS, POSE_COLUMNS
from sphmctl.cli.common import whole_file
from sphmctl.config import Cell
from sphmctl.errors import InvalidError, UsageError
from sphmctl.motion import Floats
from sphmctl.robots import sphm
from sphmctl.robots.geometry import matrix_to_abc
from sphmctl.robots.sphm import workspace_capability as capability
from sphmctl.robots.sphm.workspace import Plane, Region, Robot, Survey
from sphmctl.robots.sphm.workspace import survey as survey_of
from sphmctl.robots.sphm.workspace_slices import marked

MAP_CELL_M = 0.050
"""Of the capability map's grid."""

MAP_COLUMNS = (
    "horizontal_mm",
    "z_mm",
    "kuka_share_percent",
    "hybrid_share_percent",
    "kuka_lean_deg",
    "hybrid_lean_deg",
    "kuka_free",
    "hybrid_free",
)
CSV_BLOCK = 10_000
"""Rows formatted at once."""


@dataclass(frozen=True)
class Choice:
    """The command's options."""

    samples: int
    seed: int
    plane: Plane
    tool: str
    plot: Path | None
    csv: Path | None
    map: Path | None


def survey(cell: Cell, choice: Choice) -> dict[str, Any]:
    """The command's document; writes the files asked for, each whole or not at all.

    Raises:
        UsageError: two of them are the same file.
        InvalidError: one cannot be written, or there is no such tool.
    """
    files = [path.resolve() for path in (choice.plot, choice.csv, choice.map) if path]
    if len(set(files)) < len(files):
        raise UsageError("give --plot, --csv and --map each its own file", "command line")
    try:
        tool = cell.tool_matrix(choice.tool)
    except InvalidError as problem:
        raise InvalidError(problem.message, "--tool") from None
    robot = Robot(cell.ranges_rad, tool, cell.mount_yaw_rad, cell.obstacle_bodies)
    with contextlib.ExitStack() as stack:
        streams = [
            None if path is None else stack.enter_context(whole_file(path))
            for path in (choice.plot, choice.csv, choice.map)
        ]
        begun = time.perf_counter()
        found = survey_of(robot, choice.plane, choice.samples, choice.seed)
        elapsed_s = time.perf_counter() - begun
        document = _document(cell, choice, found, elapsed_s)
        plot, samples, table = streams
        if plot is not None or table is not None:
            able = capability.capability(robot, choice.plane, found.grid(MAP_CELL_M))
            if plot is not None:
                from sphmctl.pictures import workspace as pictures

                plot.write(pictures.picture(found, able, _notes(document)))
            if table is not None:
                _write_map(table, found, able)
        if samples is not None:
            _write_samples(samples, robot, found)
    return document


def _document(cell: Cell, choice: Choice, found: Survey, elapsed_s: float) -> dict[str, Any]:
    ratio = _ratio_percent(found.hybrid, found.arm)
    sampled = _ratio_percent(found.sampled_hybrid, found.sampled_arm)
    return {
        "plane": choice.plane,
        "tool": choice.tool,
        "cell": cell.name,
        "kuka": _region(found.arm),
        "hybrid": _region(found.hybrid),
        "ratio_percent": ratio,
        "samples": choice.samples,
        "seed": choice.seed,
        "elapsed_s": elapsed_s,
        "monte_carlo": {
            "kept": len(found.cloud.free),
            "free": int(found.cloud.free.sum()),
            "kuka": _region(found.sampled_arm),
            "hybrid": _region(found.sampled_hybrid),
            "ratio_percent": sampled,
            "kuka_free": _region(found.free_arm),
            "hybrid_free": _region(found.free_hybrid),
            "ratio_free_percent": _ratio_percent(found.free_hybrid, found.free_arm),
            "bias": {
                **_bias("kuka", found.sampled_arm, found.arm),
                **_bias("hybrid", found.sampled_hybrid, found.hybrid),
                "ratio_points": sampled - ratio,
            },
        },
    }


def _region(region: Region) -> dict[str, Any]:
    return {
        "horizontal_mm": [1e3 * end for end in region.horizontal_m],
        "z_mm": [1e3 * end for end in region.z_m],
        "area_mm2": 1e6 * region.area_m2,
    }


def _ratio_percent(hybrid: Region, arm: Region) -> float:
    return 100.0 * hybrid.area_m2 / arm.area_m2 if arm.area_m2 else float("nan")


def _bias(name: str, sampled: Region, exact: Region) -> dict[str, Any]:
    def ends(ours: tuple[float, float], true: tuple[float, float]) -> list[float]:
        return [1e3 * (a - b) for a, b in zip(ours, true, strict=True)]

    return {
        f"{name}_horizontal_mm": ends(sampled.horizontal_m, exact.horizontal_m),
        f"{name}_z_mm": ends(sampled.z_m, exact.z_m),
        f"{name}_area_percent": 100.0 * (sampled.area_m2 / exact.area_m2 - 1.0),
    }


def _notes(document: dict[str, Any]) -> tuple[str, ...]:
    """Lines of figures for the picture."""

    def line(name: str, part: dict[str, Any]) -> str:
        (left, right), (low, high) = part["horizontal_mm"], part["z_mm"]
        area = part["area_mm2"] / 1e6
        return f"{name}: {left:.1f} to {right:.1f} mm, z {low:.1f} to {high:.1f} mm, {area:.3f} m²"

    sampled = document["monte_carlo"]
    hybrid = line(f"Hybrid, tool {document['tool']}", document["hybrid"])
    marks = (
        f"Samples: {sampled['free']} free of collisions of {sampled['kept']}; cells of 20 mm that "
        f"they mark: {sampled['ratio_percent']:.2f} % of the arm's, free of collisions "
        f"{sampled['ratio_free_percent']:.2f} %"
    )
    ratio = f"{document['ratio_percent']:.2f} % of the arm's"
    return line("Arm alone", document["kuka"]), f"{hybrid}, {ratio}", marks


def _write_samples(stream: TextIO, robot: Robot, found: Survey) -> None:
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*JOINT_COLUMNS, *POSE_COLUMNS, "collides"])
    cloud = found.cloud
    for start in range(0, len(cloud.free), CSV_BLOCK):
        joints = cloud.joints[start : start + CSV_BLOCK]
        T = sphm.forward(joints, robot.tool, robot.mount_yaw)
        abc = np.degrees(matrix_to_abc(T[:, :3, :3]))
        numbers = np.hstack([np.degrees(joints), 1e3 * T[:, :3, 3], abc])
        for row, free in zip(numbers.tolist(), cloud.free[start:].tolist(), strict=False):
            writer.writerow([*(f"{value:z.6f}" for value in row), 0 if free else 1])


def _write_map(stream: TextIO, found: Survey, able: capability.Capability) -> None:
    """One row for each cell that the hybrid or the arm reaches."""
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(MAP_COLUMNS)
    cloud, grid, pair = found.cloud, able.grid, (able.arm, able.hybrid)
    shares: list[Floats] = [100.0 * capability.share(reached) for reached in pair]
    leans: list[Floats] = [np.degrees(capability.lean(reached)) for reached in pair]
    free = [
        marked(points, found.mirrored, grid)
        for points in (cloud.flange_m[cloud.arm_free], cloud.point_m[cloud.free])
    ]
    reached = able.arm.any(axis=-1) | able.hybrid.any(axis=-1)
    for column, row in np.argwhere(reached).tolist():
        numbers = [1e3 * grid.horizontal_m[column], 1e3 * grid.z_m[row]]
        numbers += [values[column, row] for values in (*shares, *leans)]
        told = ["" if np.isnan(value) else f"{value:z.3f}" for value in numbers]
        writer.writerow([*told, *(int(cells[column, row]) for cells in free)])
