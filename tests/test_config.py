"""Cell files: what they hold, what they refuse, and that they come back as they went."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from sphmctl.config import Cell, dump, emulated_cell, load_cell
from sphmctl.errors import InvalidError
from sphmctl.robots.sphm.bodies import Box, Plane
from sphmctl.robots.sphm.load import Payload

CELLS = Path(__file__).parents[1] / "configs" / "cells"
LAB = (CELLS / "lab.yaml").read_text()


def cell_of(tmp_path: Path, text: str) -> Cell:
    file = tmp_path / "cell.yaml"
    file.write_text(text)
    return load_cell(file)


def test_the_shipped_cells_load() -> None:
    assert load_cell(CELLS / "emulated.yaml") == emulated_cell()
    lab = load_cell(CELLS / "lab.yaml")
    assert (lab.arm.driver, lab.arm.host, lab.arm.tcp_port) == ("kvp", "127.0.0.1", 7000)
    assert lab.wrist.baud == 1_000_000
    assert lab.emulated_devices == ()
    assert lab.plan_speed_percent == 10


def test_a_cell_without_a_speed_starts_at_100_emulated_and_at_10_real(tmp_path: Path) -> None:
    assert emulated_cell().plan_speed_percent == 100
    assert cell_of(tmp_path, LAB.replace("speed_percent: 10", "")).plan_speed_percent == 10
    mixed = LAB.replace("speed_percent: 10", "").replace("driver: dynamixel", "driver: emulated")
    lines = [line for line in mixed.splitlines() if "/dev/serial" not in line]
    mixed_cell = cell_of(tmp_path, "\n".join(lines))
    assert mixed_cell.emulated_devices == ("wrist",)
    assert mixed_cell.plan_speed_percent == 10


def test_a_dry_run_emulates_both_devices_and_keeps_limits_tools_and_frames() -> None:
    lab = load_cell(CELLS / "lab.yaml")
    dry = lab.for_dry_run()
    assert dry.emulated_devices == ("arm", "wrist")
    assert (dry.limits, dry.tools, dry.frames) == (lab.limits, lab.tools, lab.frames)
    assert dry.wrist.zero_ticks == lab.wrist.zero_ticks


def test_a_dumped_cell_loads_back_equal(tmp_path: Path) -> None:
    lab = load_cell(CELLS / "lab.yaml")
    for cell in (lab, lab.for_dry_run(), emulated_cell()):
        assert cell_of(tmp_path, dump(cell)) == cell
    assert yaml.safe_load(dump(lab))["limits"] == {
        "a1": {"range_deg": [-100.0, 100.0], "speed_deg_s": 180.0}
    }


def test_limits_default_to_the_machine_and_narrow_it() -> None:
    own, lab = emulated_cell(), load_cell(CELLS / "lab.yaml")
    np.testing.assert_allclose(
        np.degrees(own.ranges_rad),
        [[-170, 170], [-190, 45], [-120, 156], [-185, 185], [-120, 120], [-350, 350]]
        + [[0, 120]] * 3,
    )
    np.testing.assert_allclose(
        np.degrees(own.speeds_rad_s), [360, 300, 360, 381, 388, 615, 366, 366, 366]
    )
    np.testing.assert_allclose(
        own.accelerations_rad_s2, [21.7, 6.89, 31.4, 133, 136, 268, 60, 60, 60]
    )
    np.testing.assert_allclose(np.degrees(lab.ranges_rad[0]), [-100, 100])
    np.testing.assert_allclose(np.degrees(lab.speeds_rad_s[0]), 180)
    np.testing.assert_allclose(lab.accelerations_rad_s2, own.accelerations_rad_s2)


def test_tools_and_frames_become_matrices_in_metres() -> None:
    cell = emulated_cell()
    np.testing.assert_allclose(cell.tool_matrix("octagon_pen")[:3, 3], [0, 0, 0.0589])
    np.testing.assert_allclose(cell.tool_matrix(None), np.eye(4))
    np.testing.assert_allclose(cell.frame_matrix("world"), np.eye(4))
    # Rz(90) Ry(0) Rx(90): x to y, y to z, z to x.
    turned = cell.frame_matrix((1000.0, 0.0, 0.0, 90.0, 0.0, 90.0))
    np.testing.assert_allclose(
        turned, [[0, 0, 1, 1], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], atol=1e-15
    )
    with pytest.raises(InvalidError, match="no tool \"octagon_pn\" \\(did you mean 'octagon_pen'"):
        cell.tool_matrix("octagon_pn")
    with pytest.raises(InvalidError, match='no frame "table"; known are world'):
        cell.frame_matrix("table")


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        (
            "range_deg: [-100, 100]",
            "range_deg: [-171, 100]",
            "line 21, column 19",
            "wider than the machine's own [-170, 170]",
        ),
        ("range_deg: [-100, 100]", "range_deg: [10, 10]", "line 21", "should be [lowest, highest]"),
        ("range_deg: [-100, 100]", "range_deg: [10]", "line 21", "should be [lowest, highest]"),
        (
            "speed_deg_s: 180",
            "speed_deg_s: 361",
            "line 21, column 45",
            "361 is more than the machine's own 360",
        ),
        ("speed_deg_s: 180", "speed_deg_s: 0", "line 21", "greater than or equal to 0.001"),
        ("a1: {", "theta6: {", "line 21, column 3", "limits.theta6: this key is not known"),
        (
            "[1365, 1365, 1365]",
            "[1365, 1365, 2731]",
            "line 17, column 28",
            "the ticks 2731 to 4096; they should stay within 0 to 4095",
        ),
        (
            "direction: [1, 1, 1]",
            "direction: [1, 0, 1]",
            "line 18, column 18",
            "0 should be 1 or -1",
        ),
        (
            "zero_ticks: [1365, 1365, 1365]",
            "zero_ticks: [1365, 1365]",
            "line 17",
            "one for each leg",
        ),
        ("ids: [1, 2, 3]", "ids: [1, 1, 3]", "line 15, column 8", "different ids"),
        ("ids: [1, 2, 3]", "ids: [1, 2, 253]", "line 15, column 15", "253 is no servo id"),
        ("driver: kvp ", "driver: kpv ", "line 5, column 11", "did you mean 'kvp'?"),
        ("driver: kvp ", "driver: emulated ", "line 6, column 9", "an emulated arm has no 'host'"),
        ("host: 127.0.0.1", "# none", "line 5", "needs 'host'"),
        (
            "port: 7000",
            "port: 0",
            "line 7, column 9",
            "arm.port: 0 should be greater than or equal to 1",
        ),
        ("baud: 1000000", "baud: 1000001", "line 14, column 9", "1000001 is not 9600"),
        ("version: 1", "version: 2", "line 2, column 10", "version: 2 is not 1"),
        ("speed_percent: 10", "speed_percent: 101", "line 22", "less than or equal to 100"),
        ("[0, 0, 58.9, 0, 0, 0]", "[0, 0, 58.9]", "line 24, column 16", "has 3 numbers; give 6"),
        (
            "[0, 0, 58.9, 0, 0, 0]",
            "[0, 0, 58900, 0, 0, 0]",
            "line 24, column 23",
            "58900 is out of range",
        ),
        ("world: [0, 0, 0, 0, 0, 0]", "world: [0, 0, 0, 0, 0, 999]", "line 27", "999 is no angle"),
    ],
)
def test_a_wrong_cell_is_refused_with_its_place(
    tmp_path: Path, old: str, new: str, place: str, words: str
) -> None:
    assert old in LAB
    with pytest.raises(InvalidError) as caught:
        cell_of(tmp_path, LAB.replace(old, new, 1))
    assert place in str(caught.value)
    assert words in str(caught.value)


def test_falling_ticks_are_right_when_they_stay_in_range(tmp_path: Path) -> None:
    text = LAB.replace("[1365, 1365, 1365]", "[1365, 4095, 2730]").replace(
        "[1, 1, 1]", "[-1, -1, 1]"
    )
    assert cell_of(tmp_path, text).wrist.direction == (-1, -1, 1)


SURROUNDED = (
    LAB
    + """
obstacles:
  boxes:
    table: {size_mm: [800, 600, 40], pose: [600, 0, -20, 90, 0, 0]}
  planes:
    wall: {point_mm: [0, 900, 0], normal: [0, -2, 0]}
payload: {mass_kg: 0.3, centre_mm: [0, 5, 40]}
"""
)


def test_obstacles_and_payload_become_bodies_in_metres(tmp_path: Path) -> None:
    cell = cell_of(tmp_path, SURROUNDED)
    table, wall = cell.obstacle_bodies
    assert isinstance(table, Box)
    assert isinstance(wall, Plane)
    assert (table.name, wall.name) == ("table", "wall")
    np.testing.assert_allclose(table.half_m, [0.4, 0.3, 0.02])
    np.testing.assert_allclose(table.pose[:3, 3], [0.6, 0.0, -0.02])
    np.testing.assert_allclose(table.pose[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(wall.point_m, [0.0, 0.9, 0.0])
    np.testing.assert_allclose(wall.normal, [0.0, -1.0, 0.0])
    assert cell.payload.on_platform() == Payload(0.3, (0.0, 0.005, 0.04))
    assert cell_of(tmp_path, dump(cell)) == cell


def test_a_cell_without_obstacles_has_none_and_carries_a_pen() -> None:
    assert emulated_cell().obstacle_bodies == ()
    assert emulated_cell().payload.on_platform() == Payload(0.05, (0.0, 0.0, 0.03))


def test_what_the_sample_cell_shows_in_comments_loads(tmp_path: Path) -> None:
    shown = re.sub(r"^# (?=obstacles:|payload:|  )", "", LAB, flags=re.MULTILINE)
    cell = cell_of(tmp_path, shown)
    assert [obstacle.name for obstacle in cell.obstacle_bodies] == ["table", "wall"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("planes:", "plane:", "obstacles.plane: this key is not known (did you mean 'planes'?)"),
        ("size_mm", "size_m", "this key is not known (did you mean 'size_mm'?)"),
        ("normal:", "normals:", "this key is not known (did you mean 'normal'?)"),
        ("mass_kg", "mass_g", "this key is not known (did you mean 'mass_kg'?)"),
        ("obstacles:", "obstacle:", "this key is not known (did you mean 'obstacles'?)"),
        ("[800, 600, 40]", "[800, 600]", "has 2 numbers; give 3: the box's size along x, y, z"),
        ("[800, 600, 40]", "[800, 0, 40]", "0 is no size; give more than 0"),
        ("[0, -2, 0]", "[0, 0, 0]", "[0, 0, 0] is no direction; up is [0, 0, 1]"),
        ("point_mm: [0, 900, 0]", "point_mm: [0, 90000, 0]", "90000 is out of range"),
        ("wall: {", "table: {", "the name 'table' is taken by a box; give another"),
        ("mass_kg: 0.3", "mass_kg: 300", "should be less than or equal to 6"),
    ],
)
def test_wrong_obstacles_and_payloads_are_refused(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    assert old in SURROUNDED
    before, _, after = SURROUNDED.rpartition(old)
    with pytest.raises(InvalidError) as caught:
        cell_of(tmp_path, before + new + after)
    assert words in str(caught.value)
