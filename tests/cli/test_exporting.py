"""`export urdf` and `export mjcf`: files that other programs load, with the cell's tool and yaw."""

from __future__ import annotations

import math
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
NARROW = """\
version: 1
name: narrow
arm: {driver: emulated}
wrist: {driver: emulated}
limits:
  a1: {range_deg: [-100, 90], speed_deg_s: 180}
  a2: {range_deg: [-80, 10]}
  theta7: {range_deg: [20, 50], speed_deg_s: 90}
  theta8: {range_deg: [70, 100], speed_deg_s: 90}
  theta9: {speed_deg_s: 90}
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


def test_the_models_have_the_limits_that_the_cell_sets(sphmctl: Sphmctl, tmp_path: Path) -> None:
    cell = tmp_path / "narrow.yaml"
    cell.write_text(NARROW)
    assert sphmctl("export", "urdf", "--out", "a.urdf", "--cell", cell).code == 0
    limits = {
        joint.get("name"): {key: float(value) for key, value in limit.attrib.items()}
        for joint in ElementTree.parse(tmp_path / "a.urdf").getroot().iter("joint")
        if (limit := joint.find("limit")) is not None
    }
    assert limits["A1"] == pytest.approx(
        {"lower": -1.7453292520, "upper": 1.5707963268, "velocity": 3.1415926536, "effort": 0.0}
    )
    assert limits["A3"]["upper"] == pytest.approx(math.radians(156.0))
    assert limits["heave"]["velocity"] == pytest.approx(0.025 * math.pi / 2.0)
    # At 50 and 70 degrees the cranks are closest to level, and no lower the heave can be held.
    assert limits["heave"]["lower"] > 0.045

    assert sphmctl("export", "mjcf", "--out", "a.xml", "--cell", cell).code == 0
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml"))
    wanted = {"A1": (-100, 90), "A2": (-80, 10), "theta7": (20, 50), "theta8": (70, 100)}
    for joint, ends in wanted.items():
        for range_ in (model.joint(joint).range, model.actuator(joint).ctrlrange):
            assert range_ == pytest.approx([math.radians(end) for end in ends])
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for leg in (1, 2, 3):  # closed, though the cranks cannot all stand at 60 degrees
        apart = data.site(f"coupler_end_{leg}").xpos - data.site(f"ball_{leg}").xpos
        assert abs(apart).max() < 1e-9
    assert math.degrees(data.joint("theta8").qpos[0]) == pytest.approx(70.0)


def test_what_cannot_be_written_is_told(sphmctl: Sphmctl, tmp_path: Path) -> None:
    told = sphmctl("export", "mjcf", "--out", "absent/a.xml", "--json")
    assert told.code == 3
    assert "make the folder first" in told.error["message"]
    told = sphmctl("export", "mjcf", "--out", "a.xml", "--tool", "pen", "--json")
    assert told.code == 3
    assert 'no tool "pen"' in told.error["message"]
    assert list(tmp_path.iterdir()) == []
