"""`plan --plot` and `--view`: pictures of a plan beside its CSV, or without it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.cli.rig import OCTAGON, Sphmctl

PATH = """\
version: 1
name: short
tool: octagon_pen
speed: {tcp_mm_s: 50, tcp_mm_s2: 200}
points:
  A: {pose: [520, 0, 100, 180, 0, 180], cranks_deg: [100, 100, 100]}
  B: {pose: [500, 20, 100, 180, 0, 180], cranks_deg: [90, 95, 100]}
moves:
  - ptp: A
  - lin: B
"""

CELL = """\
version: 1
name: boxed
arm: {driver: emulated}
wrist: {driver: emulated, mount_yaw_deg: 0}
limits: {a1: {range_deg: [-20, 20]}}
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.yaml"
    path.write_text(PATH)
    return path


def test_all_three_files_are_written_in_one_go(
    sphmctl: Sphmctl, short: Path, tmp_path: Path
) -> None:
    wanted = ("--out", "a.csv", "--plot", "a.svg", "--view", "a.html")
    told = sphmctl("plan", short, *wanted, "--json")
    assert (told.code, told.err) == (0, "")
    document = told.document
    assert [document[kind] for kind in ("out", "plot", "view")] == ["a.csv", "a.svg", "a.html"]
    names = ["a.csv", "a.html", "a.svg", "short.yaml"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    drawn = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert "short" in " ".join(drawn.itertext())
    assert "short: plan in 3D" in (tmp_path / "a.html").read_text()


def test_a_picture_alone_is_told_by_its_name(sphmctl: Sphmctl, short: Path) -> None:
    told = sphmctl("plan", short, "--plot", "a.svg")
    assert told.code == 0
    assert told.out.splitlines()[-2] == "a.svg"
    assert "None" not in told.out
    assert sphmctl("plan", short, "--plot", "a.svg", "--json").document["out"] is None


def test_the_page_has_the_limits_of_the_cell(sphmctl: Sphmctl, short: Path, tmp_path: Path) -> None:
    cell = tmp_path / "boxed.yaml"
    cell.write_text(CELL)
    assert sphmctl("plan", short, "--view", "a.html", "--cell", cell).code == 0
    found = re.search(r'id="plan">(.*?)</script>', (tmp_path / "a.html").read_text())
    assert found is not None
    assert json.loads(found[1])["ranges"][0] == [-20.0, 20.0]


@pytest.mark.parametrize("files", [(), ("--plot", "a.svg", "--view", "./a.svg")])
def test_no_file_and_one_file_for_two_things_are_refused(
    sphmctl: Sphmctl, short: Path, files: tuple[str, ...]
) -> None:
    told = sphmctl("plan", short, *files, "--json")
    assert told.code == 2
    assert "each with its own file" in told.error["message"]
    assert [path.name for path in short.parent.iterdir()] == ["short.yaml"]


def test_what_a_plan_is_made_from_is_not_written_over(sphmctl: Sphmctl, tmp_path: Path) -> None:
    for name in ("polyline.yaml", "polyline.csv"):
        (tmp_path / name).write_bytes((OCTAGON.parent / name).read_bytes())
    cell = tmp_path / "lab.yaml"
    cell.write_bytes((OCTAGON.parents[1] / "cells" / "lab.yaml").read_bytes())
    for name in ("polyline.yaml", "polyline.csv", "lab.yaml"):
        before = (tmp_path / name).read_bytes()
        told = sphmctl("plan", "polyline.yaml", "--cell", cell, "--out", name, "--json")
        assert told.code == 2
        assert "give another name" in told.error["message"]
        assert (tmp_path / name).read_bytes() == before


def test_a_path_that_cannot_be_driven_leaves_no_picture(sphmctl: Sphmctl, short: Path) -> None:
    short.write_text(PATH.replace("[500, 20", "[1500, 20"))
    assert sphmctl("plan", short, "--plot", "a.svg", "--view", "a.html").code == 4
    assert [path.name for path in short.parent.iterdir()] == ["short.yaml"]


@pytest.mark.parametrize("timing", ["stops", "optimal"])
def test_the_drawing_shows_what_binds_the_tools_speed_and_every_margin(
    sphmctl: Sphmctl, short: Path, tmp_path: Path, timing: str
) -> None:
    cell = tmp_path / "walled.yaml"
    wall = "obstacles: {planes: {wall: {point_mm: [0, 900, 0], normal: [0, -1, 0]}}}\n"
    cell.write_text(CELL.replace("limits:", wall + "limits:"))
    wanted = ("--plot", "a.svg", "--cell", cell, "--timing", timing)
    assert sphmctl("plan", short, *wanted).code == 0
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    panels = {g.get("aria-label"): g for g in root.iter("{http://www.w3.org/2000/svg}g")}
    for title in (
        "Tool speed",
        "Tool acceleration",
        "Gap to the robot itself, up to 20 mm",
        "Gap to obstacles",
        "Wrist from a parallel singularity",
        "Wrist from a serial singularity",
        "A5 from 0",
        "Elbow from stretched or folded",
        "Wrist centre from axis 1",
        "Largest static load of a servo",
    ):
        assert panels[title].find("{http://www.w3.org/2000/svg}path") is not None
    words = " ".join(root.itertext())
    assert "What binds" in words
    assert re.search(r"tool acceleration \d+%", words)


def test_the_page_names_tool_base_and_walls(sphmctl: Sphmctl, short: Path, tmp_path: Path) -> None:
    cell = tmp_path / "walled.yaml"
    wall = "obstacles: {planes: {wall: {point_mm: [0, 900, 0], normal: [0, -1, 0]}}}\n"
    cell.write_text(CELL.replace("limits:", wall + "limits:"))
    assert sphmctl("plan", short, "--view", "a.html", "--cell", cell).code == 0
    page = (tmp_path / "a.html").read_text()
    assert "Tool octagon_pen in world" in page
    found = re.search(r'id="plan">(.*?)</script>', page)
    assert found is not None
    assert [plane["name"] for plane in json.loads(found[1])["planes"]] == ["wall"]
