"""`export urdf` and `export mjcf`: files that other programs load, with the cell's tool and yaw."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import pytest

from sphmctl.robots.export import mjcf, urdf
from tests.cli.rig import Sphmctl

CELL = """\
version: 1
name: turned
arm: {driver: emulated}
wrist: {driver: emulated, mount_yaw_deg: 30}
tools: {pin: [0, 0, 40, 0, 0, 0]}
"""


def test_the_urdf_has_the_cells_tool_and_mount_yaw(sphmctl: Sphmctl, tmp_path: Path) -> None:
    cell = tmp_path / "turned.yaml"
    cell.write_text(CELL)
    told = sphmctl("export", "urdf", "--out", "a.urdf", "--tool", "pin", "--cell", cell, "--json")
    assert (told.code, told.err) == (0, "")
    assert told.document == {"format": "urdf", "out": "a.urdf", "tool": "pin", "cell": "turned"}
    text = (tmp_path / "a.urdf").read_text()
    origins = {
        joint.get("name"): origin.attrib
        for joint in ElementTree.fromstring(text).iter("joint")
        if (origin := joint.find("origin")) is not None
    }
    assert origins["tool_mount"]["xyz"] == "0 0 0.04"
    assert float(origins["wrist_mount"]["rpy"].split()[2]) == pytest.approx(0.5235987756)
    assert text != urdf()


def test_without_a_tool_and_a_cell_the_models_are_the_plain_ones(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    told = sphmctl("export", "urdf", "--out", "a.urdf")
    assert (told.code, told.out) == (0, "a.urdf: urdf, cell emulated, tool none\n")
    assert (tmp_path / "a.urdf").read_text() == urdf()
    assert sphmctl("export", "mjcf", "--out", "a.xml").code == 0
    assert (tmp_path / "a.xml").read_text() == mjcf()
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml")).nu == 9


def test_what_cannot_be_written_is_told(sphmctl: Sphmctl, tmp_path: Path) -> None:
    told = sphmctl("export", "mjcf", "--out", "absent/a.xml", "--json")
    assert told.code == 3
    assert "make the folder first" in told.error["message"]
    told = sphmctl("export", "mjcf", "--out", "a.xml", "--tool", "pen", "--json")
    assert told.code == 3
    assert 'no tool "pen"' in told.error["message"]
    assert list(tmp_path.iterdir()) == []
