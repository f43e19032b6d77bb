"""`fk --csv` and `ik --csv`: row for row, continuous, other columns kept, whole or not at all."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
import pytest

from sphmctl.cli import columns
from sphmctl.cli.columns import JOINT_COLUMNS, POSE_COLUMNS
from sphmctl.motion import Floats
from sphmctl.robots import sphm
from sphmctl.robots.geometry import matrix_to_abc
from tests.cli import machine
from tests.cli.rig import TABLE_5, Sphmctl, read_csv

JOINT_HEADER = ",".join(JOINT_COLUMNS)
POSE_HEADER = ",".join(POSE_COLUMNS)
GOOD_JOINTS = "0,-90,90,0,40,0,60,60,60"
GOOD_POSE = "500,0,300,180,0,180"
FAR_POSE = "1500,0,300,180,0,180"


def table(path: Path, names: tuple[str, ...]) -> Floats:
    """Columns of a file as numbers; NaN for what is empty."""
    return np.array([[float(row[name] or "nan") for name in names] for row in read_csv(path)])


def write(path: Path, header: str, rows: list[str]) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def wave(count: int) -> Floats:
    """Joints along a smooth path that passes A5 = 0 and turns A6 far, cranks fixed."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    middle = np.array([10.0, -60.0, 95.0, 30.0, 0.0, 0.0, 60.0, 50.0, 70.0])
    swing = np.array([20.0, 10.0, 15.0, 5.0, 25.0, 320.0, 0.0, 0.0, 0.0])
    return np.asarray(middle + swing * np.sin(2.0 * np.pi * t * [1, 2, 1, 3, 1.7, 1, 0, 0, 0]))


def test_table_5_as_a_file_lands_where_the_paper_says(sphmctl: Sphmctl, tmp_path: Path) -> None:
    out = tmp_path / "poses.csv"
    told = sphmctl("fk", "--csv", TABLE_5, "--out", out, "--tool", "octagon_pen", "--json")
    assert told.code == 0
    assert told.document == {"rows": 8, "answered": 8, "out": str(out)}
    assert out.read_text().splitlines()[0] == TABLE_5.read_text().splitlines()[0]
    assert [row["point"] for row in read_csv(out)] == list("ABCDEFGH")
    reached, printed = table(out, POSE_COLUMNS), table(TABLE_5, POSE_COLUMNS)
    assert np.linalg.norm(reached[:, :3] - printed[:, :3], axis=1).max() < 4.6
    assert (reached != printed).any(axis=1).all()


def test_the_rows_of_a_file_are_what_single_calls_give(sphmctl: Sphmctl, tmp_path: Path) -> None:
    joints = np.random.default_rng(1).uniform([-170, -190, -120] + [-100] * 3 + [0] * 3, 40, (5, 9))
    rows = [",".join(map(str, row)) for row in joints.tolist()]
    source, out = write(tmp_path / "in.csv", JOINT_HEADER, rows), tmp_path / "out.csv"
    assert sphmctl("fk", "--csv", source, "--out", out).code == 0
    for row, text in zip(table(out, POSE_COLUMNS), rows, strict=True):
        single = sphmctl("fk", "--joints", text, "--json").document
        assert row.tolist() == pytest.approx([*single["position_mm"], *single["abc_deg"]], abs=1e-8)


def test_other_columns_are_carried_through_as_they_are(sphmctl: Sphmctl, tmp_path: Path) -> None:
    header = f'label, a1_deg ,{",".join(JOINT_COLUMNS[1:])},"a, note",t_s'
    rows = [f'"p,1",{GOOD_JOINTS},"said ""yes"" – ü",0.10', "", f"p2,{GOOD_JOINTS},,"]
    source, out = write(tmp_path / "in.csv", header, rows), tmp_path / "out.csv"
    told = sphmctl("fk", "--csv", source, "--out", out)
    assert told.out == f"{out}: 2 rows, 2 with an answer\n"
    kept = read_csv(out)
    assert list(kept[0]) == ["label", *JOINT_COLUMNS, "a, note", "t_s", *POSE_COLUMNS]
    assert (kept[0]["label"], kept[0]["a, note"], kept[0]["t_s"]) == (
        "p,1",
        'said "yes" – ü',
        "0.10",
    )
    assert (kept[1]["label"], kept[1]["t_s"]) == ("p2", "")


def test_a_path_is_followed_continuously_through_the_singular_pose(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    joints = wave(400)
    rows = [",".join(map(str, row)) for row in joints.tolist()]
    source = write(tmp_path / "joints.csv", JOINT_HEADER, rows)
    poses, out = tmp_path / "poses.csv", tmp_path / "again.csv"
    tool = ("--tool", "octagon_pen")
    assert sphmctl("fk", "--csv", source, "--out", poses, *tool).code == 0
    options = ("--wrist", "60,50,70", "--near", rows[0], "--json")
    told = sphmctl("ik", "--csv", poses, "--out", out, *tool, *options)
    assert told.document["answered"] == 400
    np.testing.assert_allclose(table(out, JOINT_COLUMNS), joints, atol=1e-5)
    back = tmp_path / "back.csv"
    assert sphmctl("fk", "--csv", out, "--out", back, *tool).code == 0
    apart_mm = table(back, POSE_COLUMNS)[:, :3] - table(poses, POSE_COLUMNS)[:, :3]
    assert np.abs(apart_mm).max() < 1e-6


def test_without_near_the_whole_path_decides_on_the_branch(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    rows = [",".join(map(str, row)) for row in wave(300).tolist()]
    source = write(tmp_path / "joints.csv", JOINT_HEADER, rows)
    poses, out = tmp_path / "poses.csv", tmp_path / "again.csv"
    sphmctl("fk", "--csv", source, "--out", poses)
    assert sphmctl("ik", "--csv", poses, "--out", out, "--wrist", "60,50,70").code == 0
    assert np.abs(np.diff(table(out, JOINT_COLUMNS), axis=0)).max() < 10.0


def test_rows_without_an_answer_stay_empty_and_the_first_is_told(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    rows = [f"a,{GOOD_POSE}", "b,,,,,,", f"c,{FAR_POSE}", f"d,{FAR_POSE}", f"e,{GOOD_POSE}"]
    source, out = write(tmp_path / "in.csv", f"id,{POSE_HEADER}", rows), tmp_path / "out.csv"
    for wrist in ("60,60,60", "auto"):
        told = sphmctl("ik", "--csv", source, "--out", out, "--wrist", wrist, "--json")
        assert (told.code, told.document["rows"], told.document["answered"]) == (0, 5, 2)
        assert f"rows without an answer: 2; the first, {source}, line 4: " in told.err
        assert "mm from axis 2" in told.err
        assert [row["id"] for row in read_csv(out)] == list("abcde")
        missing = np.isnan(table(out, JOINT_COLUMNS))
        assert missing.all(axis=1).tolist() == [False, True, True, True, False]
        assert missing.any(axis=1).tolist() == [False, True, True, True, False]
    back = tmp_path / "back.csv"
    told = sphmctl("fk", "--csv", out, "--out", back, "--json")
    assert (told.code, told.document["rows"], told.document["answered"]) == (0, 5, 2)


def test_auto_goes_on_from_row_to_row(sphmctl: Sphmctl, tmp_path: Path) -> None:
    rows = [f"{x},100,200,180,10,180" for x in range(400, 424, 2)]
    source, out = write(tmp_path / "in.csv", POSE_HEADER, rows), tmp_path / "out.csv"
    told = sphmctl("ik", "--csv", source, "--out", out, "--tool", "octagon_pen", "--json")
    assert told.document["answered"] == len(rows)
    joints = table(out, JOINT_COLUMNS)
    assert np.abs(np.diff(joints, axis=0)).max() < 3.0
    for row, text in zip(joints, rows, strict=True):
        told = sphmctl("fk", "--joints", ",".join(map(str, row)), "--tool", "octagon_pen", "--json")
        wanted = [float(word) for word in text.split(",")]
        assert told.document["position_mm"] == pytest.approx(wanted[:3], abs=1e-6)
        reached = machine.abc_rotation(*told.document["abc_deg"])
        np.testing.assert_allclose(reached, machine.abc_rotation(*wanted[3:]), atol=1e-9)


def test_auto_leads_the_wrist_over_a_whole_path_round_a_row_that_nothing_reaches(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    y = np.linspace(-300.0, 300.0, 601)
    poses = np.column_stack([450.0 + 0.0 * y, y, 250.0 + 0.0 * y, 180.0 + 0.05 * y])
    rows = [",".join(map(str, row)) + ",15,180" for row in poses.tolist()]
    rows[400] = FAR_POSE
    source, out = write(tmp_path / "in.csv", POSE_HEADER, rows), tmp_path / "out.csv"
    told = sphmctl("ik", "--csv", source, "--out", out, "--json")
    assert told.document["answered"] == len(rows) - 1
    joints = table(out, JOINT_COLUMNS)
    # A millimetre and 0.05 degrees a row; an arm's joint 0.3 m from the tool turns by 0.2 degrees.
    assert np.nanmax(np.abs(np.diff(joints[:400], axis=0))) < 2.0
    assert np.nanmax(np.abs(np.diff(joints[401:], axis=0))) < 2.0


def test_poses_that_are_no_path_are_searched_together(sphmctl: Sphmctl, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    low, high = np.degrees(sphm.RANGES9).T
    joints = rng.uniform(low, high, (400, 9))
    source = write(
        tmp_path / "j.csv", JOINT_HEADER, [",".join(map(str, row)) for row in joints.tolist()]
    )
    poses, out, back = (tmp_path / name for name in ("poses.csv", "out.csv", "back.csv"))
    sphmctl("fk", "--csv", source, "--out", poses)
    told = sphmctl("ik", "--csv", poses, "--out", out, "--json")
    assert told.document["answered"] == 400
    sphmctl("fk", "--csv", out, "--out", back)
    apart_mm = table(back, POSE_COLUMNS)[:, :3] - table(poses, POSE_COLUMNS)[:, :3]
    assert np.abs(apart_mm).max() < 1e-5


def test_a_long_path_begins_on_the_branch_that_the_whole_path_wants(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    rows = [",".join(map(str, row)) for row in wave(3000).tolist()]
    source = write(tmp_path / "joints.csv", JOINT_HEADER, rows)
    poses, out = tmp_path / "poses.csv", tmp_path / "again.csv"
    sphmctl("fk", "--csv", source, "--out", poses)
    told = sphmctl("ik", "--csv", poses, "--out", out, "--wrist", "60,50,70", "--json")
    assert told.document["answered"] == 3000
    found = np.radians(table(out, JOINT_COLUMNS))
    T = sphm.forward(np.radians(wave(3000)))
    slow = sphm.inverse_along(T, np.radians([60.0, 50.0, 70.0]))
    # The first pose has A5 = 0, which leaves A4 open: from the second on it is settled.
    np.testing.assert_allclose(found[1:], slow[1:], atol=1e-6)


def test_poses_that_are_no_path_are_answered_each_near_the_one_before(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    joints = np.random.default_rng(3).uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (1500, 9))
    joints[:, 6:] = np.radians([60.0, 50.0, 70.0])
    T = sphm.forward(joints)
    T[700, 2, 3] += 5.0
    abc_deg = np.degrees(matrix_to_abc(T[:, :3, :3]))
    poses = np.hstack([T[:, :3, 3] * 1000.0, abc_deg])
    rows = [",".join(map(str, row)) for row in poses.tolist()]
    source, out = write(tmp_path / "in.csv", POSE_HEADER, rows), tmp_path / "out.csv"
    for near in ((), ("--near", ",".join(map(str, np.degrees(joints[0]).tolist())))):
        options = ("--wrist", "60,50,70", "--json", *near)
        told = sphmctl("ik", "--csv", source, "--out", out, *options)
        assert told.document["answered"] == 1499
        assert "line 702" in told.err
        found = np.radians(table(out, JOINT_COLUMNS))
        assert np.isnan(found[700]).all()
        kept = np.arange(1500) != 700
        np.testing.assert_allclose(sphm.forward(found[kept]), T[kept], atol=1e-9)
        assert (found[kept] >= sphm.RANGES9[:, 0] - 1e-9).all()
        assert (found[kept] <= sphm.RANGES9[:, 1] + 1e-9).all()
        steps = np.abs(np.diff(found[kept], axis=0)).max(axis=1)
        free = sphm.inverse_best(T[kept], joints[0, 6:])
        assert np.median(steps) < np.median(np.abs(np.diff(free, axis=0)).max(axis=1))
    np.testing.assert_allclose(found[0], joints[0], atol=1e-8)


def test_quotation_marks_in_the_middle_of_a_file_keep_every_place(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    rows = [f"a,{GOOD_JOINTS}", f'"b\nc",{GOOD_JOINTS}', f"d,{GOOD_JOINTS}"]
    source, out = write(tmp_path / "in.csv", f"id,{JOINT_HEADER}", rows), tmp_path / "out.csv"
    assert sphmctl("fk", "--csv", source, "--out", out).code == 0
    assert [row["id"] for row in read_csv(out)] == ["a", "b\nc", "d"]
    write(source, f"id,{JOINT_HEADER}", [*rows, "e,0,x,0,0,0,0,0,0,0"])
    told = sphmctl("fk", "--csv", source, "--out", out, "--json")
    assert told.error["where"] == f"{source}, line 6, column a2_deg"
    source.write_bytes(source.read_bytes().replace(b"\n", b"\r\n").replace(b"x", b"0"))
    assert sphmctl("fk", "--csv", source, "--out", out).code == 0
    assert [row["id"] for row in read_csv(out)] == ["a", "b\r\nc", "d", "e"]


def test_a_file_may_be_written_over_itself(sphmctl: Sphmctl, tmp_path: Path) -> None:
    source = write(tmp_path / "one.csv", JOINT_HEADER, [GOOD_JOINTS])
    assert sphmctl("fk", "--csv", source, "--out", source).code == 0
    assert list(read_csv(source)[0]) == [*JOINT_COLUMNS, *POSE_COLUMNS]
    assert [path.name for path in tmp_path.iterdir()] == ["one.csv"]


def test_a_link_keeps_pointing_and_a_device_stays_a_device(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    source = write(tmp_path / "in.csv", JOINT_HEADER, [GOOD_JOINTS])
    link, target = tmp_path / "link.csv", tmp_path / "target.csv"
    link.symlink_to(target)
    assert sphmctl("fk", "--csv", source, "--out", link).code == 0
    assert link.is_symlink()
    assert len(read_csv(target)) == 1
    assert sphmctl("fk", "--csv", source, "--out", "/dev/null").code == 0
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_a_table_without_rows_stays_one(sphmctl: Sphmctl, tmp_path: Path) -> None:
    source, out = write(tmp_path / "in.csv", POSE_HEADER, []), tmp_path / "out.csv"
    for wrist in ("auto", "60,60,60"):
        assert sphmctl("ik", "--csv", source, "--out", out, "--wrist", wrist).code == 0
        assert out.read_text() == f"{POSE_HEADER},{JOINT_HEADER}\n"


@pytest.mark.parametrize(
    ("content", "code", "where", "words"),
    [
        (b"", 3, "", "the file is empty"),
        (b"\n\n", 3, "", "the file is empty"),
        (b"a1_deg;a2_deg\n0;0\n", 3, ", line 1", "the column a1_deg is missing"),
        (f"{JOINT_HEADER[:-11]}\n".encode(), 3, ", line 1", "the column theta9_deg is missing"),
        (f"{JOINT_HEADER},a1_deg\n".encode(), 3, ", line 1", "'a1_deg' is there twice"),
        (f"{JOINT_HEADER}\n1,2,3\n".encode(), 3, ", line 2", "3 fields, but line 1 names 9"),
        (
            f"{JOINT_HEADER}\n\n{GOOD_JOINTS}\n{GOOD_JOINTS},1\n".encode(),
            3,
            ", line 4",
            "10 fields",
        ),
        (
            f"{JOINT_HEADER}\n0,left,0,0,0,0,0,0,0\n".encode(),
            3,
            ", line 2, column a2_deg",
            "'left' is not a finite number; give degrees",
        ),
        (
            f"{JOINT_HEADER}\n0,0,0,nan,0,0,0,0,0\n".encode(),
            3,
            ", line 2, column a4_deg",
            "'nan' is not a finite number",
        ),
        (
            f"{JOINT_HEADER}\n{GOOD_JOINTS}\n0,0,0,0,-inf,0,0,0,0\n".encode(),
            3,
            ", line 3, column a5_deg",
            "'-inf' is not a finite number",
        ),
        (f"{JOINT_HEADER}\n0,0,0,0,0,0,0,0,\n".encode(), 3, ", line 2, column theta9_deg", "''"),
        (
            f"{JOINT_HEADER}\n{GOOD_JOINTS}\n0,-90,90,0,0,0,0,0,120.001\n".encode(),
            4,
            ", line 3, column theta9_deg",
            "theta9 is 120.001 degrees; its range is 0 to 120",
        ),
        (f"{JOINT_HEADER}\n{GOOD_JOINTS}".encode() + b"\xff", 3, "", "not UTF-8"),
        (f'{JOINT_HEADER}\n"0"1,0,0,0,0,0,0,0,0\n'.encode(), 3, ", line 2", "not valid CSV"),
        (f'{JOINT_HEADER}\n"0,0\n'.encode(), 3, ", line 2", "not valid CSV"),
        (f"{JOINT_HEADER}\n".encode() + b"\0" * 9, 3, ", line 2", ""),
    ],
)
def test_a_wrong_table_is_refused_with_its_place_and_nothing_is_written(
    sphmctl: Sphmctl, tmp_path: Path, content: bytes, code: int, where: str, words: str
) -> None:
    source, out = tmp_path / "in.csv", tmp_path / "out.csv"
    source.write_bytes(content)
    out.write_text("as it was")
    told = sphmctl("fk", "--csv", source, "--out", out, "--json")
    assert told.code == code
    assert told.error["where"] == f"{source}{where}"
    assert words in told.error["message"]
    assert out.read_text() == "as it was"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.csv", "out.csv"]


def test_a_number_that_no_pose_can_have_is_refused_with_its_place(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    source = write(tmp_path / "in.csv", POSE_HEADER, [GOOD_POSE, "500,0,300,180,0,1e9"])
    told = sphmctl("ik", "--csv", source, "--out", tmp_path / "out.csv", "--json")
    assert told.code == 3
    assert told.error["where"] == f"{source}, line 3, column c_deg"
    assert told.error["message"] == "c_deg 1e+09 is out of range; at most 720 degrees is allowed"


def test_no_limits_computes_a_file_beyond_the_ranges(sphmctl: Sphmctl, tmp_path: Path) -> None:
    source = write(tmp_path / "in.csv", JOINT_HEADER, ["180,-90,90,0,0,0,130,130,130"])
    out = tmp_path / "out.csv"
    assert sphmctl("fk", "--csv", source, "--out", out).code == 4
    assert not out.exists()
    assert sphmctl("fk", "--csv", source, "--out", out, "--no-limits").code == 0
    assert table(out, POSE_COLUMNS)[0, 0] < -500.0


def test_files_that_cannot_be_read_or_written_are_named(sphmctl: Sphmctl, tmp_path: Path) -> None:
    source = write(tmp_path / "in.csv", JOINT_HEADER, [GOOD_JOINTS])
    for given, out, where, words in (
        ("absent.csv", "out.csv", "absent.csv", "there is no such file"),
        (tmp_path, "out.csv", tmp_path, "the file cannot be read: Is a directory"),
        (f"{source}/x", "out.csv", f"{source}/x", "the file cannot be read: Not a directory"),
        (source, "absent/out.csv", "absent/out.csv", "make the folder first"),
        (source, tmp_path, tmp_path, "this is a folder; name a file"),
        (source, "/dev/full", "/dev/full", "the file cannot be written: No space left"),
    ):
        told = sphmctl("fk", "--csv", given, "--out", out, "--json")
        assert told.code == 3
        assert told.error["where"] == str(where)
        assert words in told.error["message"]
        assert [path.name for path in tmp_path.iterdir()] == ["in.csv"]


def test_a_file_with_endless_rows_is_refused(
    sphmctl: Sphmctl, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(columns, "MOST_ROWS", 3)
    source = write(tmp_path / "in.csv", JOINT_HEADER, [GOOD_JOINTS] * 3)
    assert sphmctl("fk", "--csv", source, "--out", "out.csv").code == 0
    write(source, JOINT_HEADER, [GOOD_JOINTS] * 4)
    told = sphmctl("fk", "--csv", source, "--out", "out.csv", "--json")
    assert told.error["message"] == "more than 3 rows; split the file"
