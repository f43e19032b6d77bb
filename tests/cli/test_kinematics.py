"""`fk --joints` and `ik --pose`: against the paper's table, its D-H product, and bad input."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.cli import machine
from tests.cli.rig import TABLE_5, Sphmctl, listed, read_csv

JOINTS = [10.0, -60.0, 80.0, 20.0, 40.0, 30.0, 50.0, 70.0, 90.0]
RANGES = [(-170, 170), (-190, 45), (-120, 156), (-185, 185), (-120, 120), (-350, 350)]
RANGES += [(0, 120)] * 3


def angle_deg(R: machine.Matrix, S: machine.Matrix) -> float:
    """The angle between two orientations."""
    return float(np.degrees(np.arccos(min(1.0, (np.trace(R[:3, :3].T @ S[:3, :3]) - 1.0) / 2.0))))


@pytest.mark.parametrize("row", range(8))
def test_fk_of_table_5_lands_where_the_paper_says(sphmctl: Sphmctl, row: int) -> None:
    printed = [float(text) for text in list(read_csv(TABLE_5)[row].values())[1:]]
    told = sphmctl("fk", "--joints", listed(printed[:9]), "--tool", "octagon_pen", "--json")
    assert told.code == 0
    distance = np.linalg.norm(np.subtract(told.document["position_mm"], printed[9:12]))
    assert distance < 4.6
    if row < 4:
        reached = machine.abc_rotation(*told.document["abc_deg"])
        assert angle_deg(reached, machine.abc_rotation(*printed[12:])) < 0.05


@pytest.mark.parametrize("seed", range(8))
def test_fk_is_the_product_of_the_papers_tables(sphmctl: Sphmctl, seed: int) -> None:
    low, high = np.array(RANGES).T
    joints = np.random.default_rng(seed).uniform(low, high).tolist()
    told = sphmctl("fk", "--joints", listed(joints), "--json").document
    wrist = told["wrist"]
    on_base = machine.platform(wrist["heave_mm"], wrist["tilt_deg"], wrist["tilt_direction_deg"])
    assert machine.coupler_lengths(on_base, joints[6:]) == pytest.approx([61.0] * 3, abs=1e-9)
    expected = machine.wrist_base(joints) @ on_base
    np.testing.assert_allclose(told["matrix"], expected, atol=1e-8)
    assert told["position_mm"] == pytest.approx(expected[:3, 3].tolist(), abs=1e-8)
    again = machine.abc_rotation(*told["abc_deg"])
    np.testing.assert_allclose(again[:3, :3], expected[:3, :3], atol=1e-10)


def test_equal_cranks_hold_the_platform_level_at_the_papers_heave(sphmctl: Sphmctl) -> None:
    for crank, heave_mm in ((0, 86.00), (30, 81.36), (60, 69.53), (90, 55.64), (120, 44.53)):
        joints = f"0,-90,90,0,0,0,{crank},{crank},{crank}"
        wrist = sphmctl("fk", "--joints", joints, "--json").document["wrist"]
        assert wrist["heave_mm"] == pytest.approx(heave_mm, abs=0.005)
        assert (wrist["tilt_deg"], wrist["tilt_direction_deg"]) == pytest.approx((0.0, 0.0))


def test_a_tool_and_the_mount_yaw_of_the_cell_take_part(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(
        "version: 1\nname: turned\narm: {driver: emulated}\n"
        "wrist: {driver: emulated, mount_yaw_deg: 30}\ntools: {knife: [1, 2, 3, 10, 20, 30]}\n"
    )
    told = sphmctl("fk", "--joints", listed(JOINTS), "--tool", "knife", "--json").document
    wrist = told["wrist"]
    expected = (
        machine.wrist_base(JOINTS)
        @ machine.rotation("z", 30.0)
        @ machine.platform(wrist["heave_mm"], wrist["tilt_deg"], wrist["tilt_direction_deg"])
        @ machine.shift(1.0, 2.0, 3.0)
        @ machine.abc_rotation(10.0, 20.0, 30.0)
    )
    np.testing.assert_allclose(told["matrix"], expected, atol=1e-8)
    pose = [*told["position_mm"], *told["abc_deg"]]
    options = ("--tool", "knife", "--wrist", "50,70,90", "--near", listed(JOINTS), "--json")
    answer = sphmctl("ik", "--pose", listed(pose), *options).document["solutions"][0]
    assert answer["joints_deg"] == pytest.approx(JOINTS, abs=1e-8)


@pytest.mark.parametrize("wrist", ["60,60,60", "50,70,90", "0,0,0", "120,120,120", "auto"])
def test_every_answer_of_ik_puts_the_tool_at_the_pose(sphmctl: Sphmctl, wrist: str) -> None:
    pose = [500.0, 30.0, 300.0, 170.0, 10.0, 175.0]
    told = sphmctl(
        "ik", "--pose", listed(pose), "--tool", "octagon_pen", "--wrist", wrist, "--json"
    )
    assert told.code == 0
    found = told.document["solutions"]
    assert len(found) >= 2
    margins = [item["margin_deg"] for item in found]
    assert margins == sorted(margins, reverse=True)
    for item in found:
        joints = item["joints_deg"]
        room = min(
            min(value - low, high - value)
            for value, (low, high) in zip(joints, RANGES, strict=True)
        )
        assert item["margin_deg"] == pytest.approx(room, abs=1e-9)
        if wrist != "auto":
            assert listed(joints[6:]) == listed([float(word) for word in wrist.split(",")])
        back = sphmctl("fk", "--joints", listed(joints), "--tool", "octagon_pen", "--json").document
        assert back["position_mm"] == pytest.approx(pose[:3], abs=1e-6)
        reached = machine.abc_rotation(*back["abc_deg"])
        np.testing.assert_allclose(reached, machine.abc_rotation(*pose[3:]), atol=1e-9)


def test_near_puts_the_nearest_answer_first(sphmctl: Sphmctl) -> None:
    pose = "500,30,300,170,10,175"
    free = sphmctl("ik", "--pose", pose, "--wrist", "60,60,60", "--json").document["solutions"]
    wanted = free[-1]["joints_deg"]
    near = sphmctl(
        "ik", "--pose", pose, "--wrist", "60,60,60", "--near", listed(wanted), "--json"
    ).document["solutions"]
    assert near[0]["joints_deg"] == pytest.approx(wanted, abs=1e-9)
    apart = [np.linalg.norm(np.subtract(item["joints_deg"], wanted)) for item in near]
    assert all(first <= second + 1e-9 for first, second in pairwise(apart))


def test_near_may_be_measured_a_servo_step_beyond_a_limit(sphmctl: Sphmctl) -> None:
    options = ("--pose", "500,30,300,170,10,175", "--json", "--near")
    assert sphmctl("ik", *options, "0,-60,90,0,40,0,120.1,60,60").code == 0
    told = sphmctl("ik", *options, "0,-60,90,0,40,0,120.2,60,60")
    assert told.code == 4
    assert told.error["message"] == "theta7 is 120.2 degrees; its range is 0 to 120"


def test_people_get_tables_without_colours(sphmctl: Sphmctl) -> None:
    told = sphmctl("fk", "--joints", "0,-90,90,0,0,0,90,90,90")
    assert "55.6417 mm" in told.out
    assert "\x1b" not in told.out
    told = sphmctl("ik", "--pose", "500,30,300,170,10,175", "--wrist", "60,60,60")
    assert "theta9 margin" in told.out
    assert "best first" in told.out
    assert max(len(line) for line in told.out.splitlines()) <= 80


@pytest.mark.parametrize(
    ("joints", "code", "words"),
    [
        ("171,0,0,0,0,0,0,0,0", 4, "A1 is 171 degrees; its range is -170 to 170"),
        ("0,0,0,0,0,0,0,-0.01,0", 4, "theta8 is -0.01 degrees; its range is 0 to 120"),
        ("1,2,3", 3, "3 numbers; give 9"),
        ("1,2,3,4,5,6,7,8,9,10", 3, "10 numbers; give 9"),
        ("0,0,0,0,0,0,0,0,nan", 3, "give 9 finite ones"),
        ("0,0,0,0,0,0,0,0,inf", 3, "give 9 finite ones"),
        ("0,0,zero,0,0,0,0,0,0", 3, "'0,0,zero,0,0,0,0,0,0' is not a list of numbers"),
        ("", 3, "is not a list of numbers"),
    ],
)
def test_joints_that_cannot_be_are_refused(
    sphmctl: Sphmctl, joints: str, code: int, words: str
) -> None:
    told = sphmctl("fk", "--joints", joints, "--json")
    assert told.code == code
    assert words in told.error["message"]
    assert told.error["where"] == "--joints"
    assert told.err == f"sphmctl: --joints: {told.error['message']}\n"


def test_no_limits_computes_joints_beyond_their_range(sphmctl: Sphmctl) -> None:
    joints = [200.0, 60.0, 170.0, 190.0, 130.0, 360.0, 130.0, 130.0, 130.0]
    told = sphmctl("fk", "--joints", listed(joints), "--no-limits", "--json")
    assert told.code == 0
    on_base = machine.platform(told.document["wrist"]["heave_mm"], 0.0, 0.0)
    assert machine.coupler_lengths(on_base, joints[6:]) == pytest.approx([61.0] * 3, abs=1e-9)
    expected = machine.wrist_base(joints) @ on_base
    np.testing.assert_allclose(told.document["matrix"], expected, atol=1e-8)


def test_the_cells_narrower_range_counts(sphmctl: Sphmctl, tmp_path: Path) -> None:
    cell = tmp_path / "narrow.yaml"
    cell.write_text(
        "version: 1\nname: narrow\narm: {driver: emulated}\nwrist: {driver: emulated}\n"
        "limits: {a1: {range_deg: [-5, 5]}, theta7: {range_deg: [50, 70]}}\n"
    )
    told = sphmctl("fk", "--joints", listed(JOINTS), "--cell", cell, "--json")
    assert told.error["message"] == "A1 is 10 degrees; its range is -5 to 5"
    told = sphmctl(
        "ik", "--pose", "500,200,300,180,0,180", "--wrist", "60,60,60", "--cell", cell, "--json"
    )
    assert told.code == 4
    assert told.error["message"].startswith("A1 would have to be -2")
    assert told.error["message"].endswith("its range is -5 to 5")
    told = sphmctl("ik", "--pose", "500,0,300,180,0,180", "--cell", cell, "--json")
    assert 50.0 <= told.document["solutions"][0]["joints_deg"][6] <= 70.0


@pytest.mark.parametrize(
    ("options", "code", "where", "words"),
    [
        (("--pose", "1500,0,300,180,0,180", "--wrist", "60,60,60"), 4, "--pose", "mm from axis 2"),
        (("--pose", "1500,0,300,180,0,180"), 4, "--pose", "no wrist pose reaches it"),
        (("--pose", "0,0,0,0,0,0", "--wrist", "60,60,60"), 4, "--pose", "would"),
        (("--pose", "1e300,0,300,180,0,180"), 3, "--pose", "x_mm 1e+300 is out of range"),
        (("--pose", "500,0,300,180,0,-721"), 3, "--pose", "at most 720 degrees is allowed"),
        (("--pose", "500,0,300"), 3, "--pose", "3 numbers; give 6"),
        (("--pose", "500,0,300,180,0,nan"), 3, "--pose", "finite"),
        (("--pose", "500,0,300,180,0,180", "--wrist", "60,60"), 3, "--wrist", "give 3"),
        (("--pose", "500,0,300,180,0,180", "--wrist", "level"), 3, "--wrist", "'level'"),
        (
            ("--pose", "500,0,300,180,0,180", "--wrist", "60,60,121"),
            4,
            "--wrist",
            "theta9 is 121 degrees; its range is 0 to 120",
        ),
        (("--pose", "500,0,300,180,0,180", "--near", "1,2"), 3, "--near", "give 9"),
        (("--pose", "500,0,300,180,0,180", "--tool", "pen"), 3, "--tool", "no tool"),
        (
            ("--pose", "500,0,300,180,0,180", "--cell", "absent.yaml"),
            3,
            "absent.yaml",
            "there is no such file",
        ),
        ((), 2, "command line", "give either --pose, or --csv IN with --out OUT"),
        (("--csv", "poses.csv"), 2, "command line", "go together"),
        (("--pose", "500,0,300,180,0,180", "--out", "x"), 2, "command line", "go together"),
        (
            ("--pose", "500,0,300,180,0,180", "--csv", "a", "--out", "b"),
            2,
            "command line",
            "either",
        ),
    ],
)
def test_what_ik_cannot_do_is_told_in_one_sentence(
    sphmctl: Sphmctl, options: tuple[str, ...], code: int, where: str, words: str
) -> None:
    told = sphmctl("ik", *options, "--json")
    assert told.code == code
    assert told.error["where"] == where
    assert words in told.error["message"]
    assert told.err == f"sphmctl: {where}: {told.error['message']}\n"


def test_an_unknown_tool_is_told_with_the_nearest_name(sphmctl: Sphmctl) -> None:
    told = sphmctl("fk", "--joints", "0,-90,90,0,0,0,0,0,0", "--tool", "octagon-pen", "--json")
    assert told.code == 3
    assert "did you mean 'octagon_pen'?" in told.error["message"]
