"""The run's folder: rows and events are on disk at once, and nothing is overwritten."""

from __future__ import annotations

import json
import math
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from sphmctl.daemon.record import (
    FEEDBACK_COLUMNS,
    Events,
    RowFile,
    feedback_row,
    new_folder,
    write_truth,
)
from sphmctl.errors import InvalidError

NOW = datetime(2026, 1, 2, 3, 4, 5)


def test_a_folder_is_named_by_time_and_path_and_never_used_twice(tmp_path: Path) -> None:
    names = [new_folder(tmp_path / "runs", "octagon", NOW).name for _ in range(3)]
    stem = "20260102-030405-octagon"
    assert names == [stem, f"{stem}-2", f"{stem}-3"]


@pytest.mark.parametrize(
    ("name", "folder"),
    [("two sides", "two-sides"), ("../../etc", "..-..-etc"), ("a/b", "a-b"), ("", "path")],
)
def test_a_folder_stays_inside_the_runs(tmp_path: Path, name: str, folder: str) -> None:
    made = new_folder(tmp_path, name, NOW)
    assert made == tmp_path / f"20260102-030405-{folder}"
    assert made.parent == tmp_path


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InvalidError, match="cannot be made: Not a directory; give a folder"):
        new_folder(tmp_path / "file", "octagon", NOW)


def test_a_hundred_runs_in_a_second_are_the_most(tmp_path: Path) -> None:
    for _ in range(100):
        new_folder(tmp_path, "a", NOW)
    with pytest.raises(InvalidError, match="exists already"):
        new_folder(tmp_path, "a", NOW)


def test_each_row_is_on_disk_when_the_call_returns(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    rows = RowFile(path, ("t_s", "x"))
    assert path.read_text() == "t_s,x\n"
    rows.row([0.0, 1.5])
    assert path.read_text() == "t_s,x\n0.000000,1.500000\n"
    rows.row([0.01, -1e-9])
    assert path.read_text().endswith("\n0.010000,-0.000000\n")
    rows.close()
    rows.close()


def test_what_is_not_known_stays_empty(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    rows = RowFile(path, ("t_s", "x", "y"))
    rows.row([1.0, math.nan, 2.0])
    rows.close()
    assert path.read_text().splitlines()[1] == "1.000000,,2.000000"


def test_a_file_that_exists_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    path.write_text("precious")
    with pytest.raises(FileExistsError):
        RowFile(path, ("t_s",))
    assert path.read_text() == "precious"


def test_a_row_of_feedback_is_in_degrees_and_millimetres() -> None:
    tool = np.eye(4)
    tool[:3, 3] = 0.1, -0.2, 0.3
    # A turn of 90 degrees about z is KUKA's A = 90.
    tool[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    joints = np.radians(np.arange(9.0))
    row = feedback_row(1.25, joints, tool, 1.5)
    assert len(row) == len(FEEDBACK_COLUMNS)
    wanted = [1.25, *range(9), 100.0, -200.0, 300.0, 90.0, 0.0, 0.0, 1.5]
    assert row == pytest.approx(wanted, abs=1e-9)
    assert FEEDBACK_COLUMNS[:3] == ("t_s", "a1_deg", "a2_deg")
    assert FEEDBACK_COLUMNS[7:12] == ("theta7_deg", "theta8_deg", "theta9_deg", "x_mm", "y_mm")


def test_a_silent_servo_leaves_its_crank_and_the_pose_empty(tmp_path: Path) -> None:
    joints = np.zeros(9)
    joints[8] = math.nan
    rows = RowFile(tmp_path / "f.csv", FEEDBACK_COLUMNS)
    rows.row(feedback_row(0.0, joints, np.full((4, 4), math.nan), 0.0))
    rows.close()
    cells = (tmp_path / "f.csv").read_text().splitlines()[1].split(",")
    assert cells[9:16] == [""] * 7
    assert cells[8] == "0.000000"


def test_each_event_is_one_json_line_on_disk_at_once(tmp_path: Path) -> None:
    now = [100.0]
    path = tmp_path / "events.jsonl"
    told: list[str] = []
    events = Events(path, lambda: now[0], lambda name, fields: told.append(name))
    now[0] = 101.25
    events.add("fault", message='a "quoted" µ')
    lines = path.read_text().splitlines()
    assert len(lines) == 1
    assert json.loads(lines[0]) == {"t_s": 1.25, "message": 'a "quoted" µ', "event": "fault"}
    events.add("stand")
    assert len(path.read_text().splitlines()) == 2
    events.close()
    events.close()
    events.add("after the end")
    assert told == ["fault", "stand", "after the end"]
    assert len(path.read_text().splitlines()) == 2
    assert [name for _, name, _ in events.history] == told


def test_a_full_disk_does_not_keep_events_from_being_told() -> None:
    told: list[str] = []
    events = Events(Path("/dev/full"), lambda: 0.0, lambda name, fields: told.append(name))
    events.add("fault", message="m")
    events.add("standing")
    assert told == ["events not recorded any more", "fault", "standing"]
    events.close()


def test_truth_has_time_and_nine_joints(tmp_path: Path) -> None:
    write_truth(tmp_path / "truth.csv", [(0.0, *[1.0] * 9), (0.004, *[2.0] * 9)])
    lines = (tmp_path / "truth.csv").read_text().splitlines()
    assert lines[0] == (
        "t_s,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,theta7_deg,theta8_deg,theta9_deg"
    )
    assert lines[2].split(",") == ["0.004000", *["2.000000"] * 9]
