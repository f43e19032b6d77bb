"""`check` and `plan`: the verdict with its numbers, the CSV, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sphmctl import planner
from tests.cli import machine
from tests.cli.rig import OCTAGON, Sphmctl, read_csv

JOINTS = [f"a{axis}_deg" for axis in range(1, 7)] + [f"theta{leg}_deg" for leg in (7, 8, 9)]
POSE = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"]
RANGES = [(-170, 170), (-190, 45), (-120, 156), (-185, 185), (-120, 120), (-350, 350)]
RANGES += [(0, 120)] * 3

SHORT = """\
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
  - dwell_s: 0.2
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """A path of one short line and a rest."""
    path = tmp_path / "short.yaml"
    path.write_text(SHORT)
    return path


def changed(path: Path, old: str, new: str) -> Path:
    """The path file with one thing changed."""
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


def test_the_octagon_is_feasible_with_its_cranks_on_their_limits(sphmctl: Sphmctl) -> None:
    told = sphmctl("check", OCTAGON, "--json")
    document = told.document
    assert (told.code, told.err) == (0, "")
    assert document["feasible"] is True
    assert document["problems"] == []
    # 962 mm at 100 mm/s, and every one of its stops costs time.
    assert 9.62 < document["duration_s"] < 25.0
    assert [margin["joint"] for margin in document["margins"]] == [
        *(f"A{axis}" for axis in range(1, 7)),
        *(f"theta{leg}" for leg in (7, 8, 9)),
    ]
    for margin in document["margins"]:
        assert 0.0 <= margin["speed_share"] <= 1.0
        assert 0.0 <= margin["acceleration_share"] <= 1.0
        on_limit = margin["joint"].startswith("theta")
        assert margin["range_deg"] == pytest.approx(0.0, abs=1e-6) if on_limit else 10.0
        assert "move" in margin["range_where"]


def test_the_plan_is_on_the_line_within_all_ranges(
    sphmctl: Sphmctl, short: Path, tmp_path: Path
) -> None:
    out = tmp_path / "plan.csv"
    told = sphmctl("plan", short, "--out", out, "--json")
    assert told.code == 0
    document, rows = told.document, read_csv(out)
    assert list(rows[0]) == ["t_s", *JOINTS, *POSE, "knot"]
    assert (document["name"], document["rows"]) == ("short", len(rows))
    t_s = np.array([float(row["t_s"]) for row in rows])
    assert t_s[0] == 0.0
    assert (np.diff(t_s) > 0.0).all()
    assert document["duration_s"] == pytest.approx(t_s[-1])
    length_mm = np.hypot(20.0, 20.0)
    assert t_s[-1] >= length_mm / 50.0 + 50.0 / 200.0 + 0.2 - 1e-9
    low, high = np.array(RANGES).T
    joints = np.array([[float(row[name]) for name in JOINTS] for row in rows])
    assert ((joints >= low - 1e-6) & (joints <= high + 1e-6)).all()
    assert joints[0, 6:].tolist() == pytest.approx([100.0, 100.0, 100.0])
    assert joints[-1, 6:].tolist() == pytest.approx([90.0, 95.0, 100.0])
    knots = [row["knot"] for row in rows if row["knot"]]
    assert knots == [str(number + 1) for number in range(document["knots"])]
    assert knots
    points = [point["name"] for point in document["points"]]
    assert (points[0], points[-1]) == ("A", "B")


def test_the_plans_joints_and_its_poses_agree_with_the_paper(
    sphmctl: Sphmctl, short: Path, tmp_path: Path
) -> None:
    sphmctl("plan", short, "--out", tmp_path / "plan.csv")
    rows = read_csv(tmp_path / "plan.csv")
    for row in (rows[0], rows[len(rows) // 3], rows[-1]):
        joints = [float(row[name]) for name in JOINTS]
        pose = [float(row[name]) for name in POSE]
        tool = machine.shift(*pose[:3]) @ machine.abc_rotation(*pose[3:])
        # The pen's 58.9 mm taken off, the platform must stand where the three couplers hold it.
        platform = tool @ machine.shift(0.0, 0.0, -58.9)
        on_base = np.linalg.inv(machine.wrist_base(joints)) @ platform
        assert machine.coupler_lengths(on_base, joints[6:]) == pytest.approx([61.0] * 3, abs=1e-6)
        assert pose[0] + pose[1] == pytest.approx(520.0, abs=1e-6)
        assert pose[2] == pytest.approx(100.0, abs=1e-6)


def test_speed_scales_the_time_and_not_the_path(
    sphmctl: Sphmctl, short: Path, tmp_path: Path
) -> None:
    full = sphmctl("check", short, "--json").document["duration_s"]
    half = sphmctl("check", short, "--speed", 50, "--json").document["duration_s"]
    assert half == pytest.approx(2.0 * full)
    told = sphmctl("plan", short, "--out", "half.csv", "--speed", 50, "--json").document
    assert (told["speed_percent"], told["duration_s"]) == (50.0, pytest.approx(half))
    cell = tmp_path / "real.yaml"
    cell.write_text(
        "version: 1\nname: real\narm: {driver: kvp, host: 127.0.0.1}\nwrist: {driver: emulated}\n"
    )
    slow = sphmctl("check", short, "--cell", cell, "--json").document["duration_s"]
    assert slow == pytest.approx(10.0 * full)


def test_people_get_a_table_and_a_sentence(sphmctl: Sphmctl, short: Path) -> None:
    told = sphmctl("check", short)
    assert "theta9" in told.out
    assert told.out.splitlines()[-1].startswith("feasible: ")
    assert "\x1b" not in told.out
    assert max(len(line) for line in told.out.splitlines()) <= 80
    told = sphmctl("plan", short, "--out", "plan.csv")
    assert "an exact stop of the arm" in told.out
    assert told.out.splitlines()[-1].startswith("plan.csv: ")


@pytest.mark.parametrize(
    ("old", "new", "joint", "words"),
    [
        ("A: {pose: [520, 0,", "A: {pose: [1520, 0,", "", "mm from axis 2"),
        ("cranks_deg: [90, 95, 100]", "cranks_deg: [90, 125, 100]", "theta8", "120"),
        ("cranks_deg: [100, 100, 100]", "cranks_deg: [100, -1, 100]", "theta8", "-1"),
        ("{pose: [500, 20, 100,", "{pose: [-500, 20, 100,", "A3", "at most 156 is allowed"),
        ("20, 100, 180, 0, 180]", "20, 100, 180, 0, 0]", "tool", "half a turn"),
    ],
)
def test_a_path_that_cannot_be_driven_gets_a_verdict_and_no_plan(
    sphmctl: Sphmctl, short: Path, old: str, new: str, joint: str, words: str
) -> None:
    changed(short, old, new)
    told = sphmctl("check", short, "--json")
    assert told.code == 4
    assert told.err == ""
    assert told.document["feasible"] is False
    assert told.document["duration_s"] is None
    problem = told.document["problems"][0]
    assert set(problem) == {"where", "joint", "value", "limit", "message"}
    assert problem["where"].startswith("line ")
    assert problem["joint"] == joint
    assert words in problem["message"]
    shown = sphmctl("check", short)
    assert (shown.code, shown.err) == (4, "")
    assert f"{problem['where']}: {problem['message']}\n" in shown.out
    assert "not feasible: " in shown.out
    refused = sphmctl("plan", short, "--out", "plan.csv", "--json")
    assert refused.code == 4
    assert refused.error["where"] == f"{short}, {problem['where']}"
    assert refused.error["message"].startswith(problem["message"])
    assert [path.name for path in short.parent.iterdir()] == ["short.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("name: short", "nmae: short", "line 2, column 1", "did you mean 'name'?"),
        ("version: 1", "version: 2", "line 1, column 10", "2 is not 1"),
        ("[520, 0, 100", "[520, .nan, 100", "line 6, column 19", "finite"),
        ("[520, 0, 100", "[520, 0", "line 6", "5 numbers; give 6"),
        ("- lin: B", "- lin: C", "line 10", 'no point "C"'),
        ("tool: octagon_pen", "tool: pen", "line 3", 'no tool "pen"'),
        ("  - ptp: A\n", "", "line 9", "a path begins with 'ptp"),
        ("moves:", "moves: [", "line", "not valid YAML"),
    ],
)
@pytest.mark.parametrize("command", [("check",), ("plan", "--out", "plan.csv")])
def test_a_wrong_path_file_is_refused_with_line_and_reason(
    sphmctl: Sphmctl,
    short: Path,
    command: tuple[str, ...],
    old: str,
    new: str,
    line: str,
    words: str,
) -> None:
    changed(short, old, new)
    told = sphmctl(*command, short, "--json")
    assert told.code == 3
    assert told.error["where"].startswith(f"{short}, {line}")
    assert words in told.error["message"]
    assert told.err == f"sphmctl: {told.error['where']}: {told.error['message']}\n"
    assert [path.name for path in short.parent.iterdir()] == ["short.yaml"]


@pytest.mark.parametrize("percent", ["0", "-5", "nan", "inf", "1000"])
def test_a_speed_that_is_none_is_refused(sphmctl: Sphmctl, short: Path, percent: str) -> None:
    told = sphmctl("check", short, "--speed", percent, "--json")
    assert told.code == 3
    assert f"speed {percent} % is out of range" in told.error["message"]


def test_files_that_are_not_there_are_named(sphmctl: Sphmctl, short: Path) -> None:
    told = sphmctl("check", "absent.yaml", "--json")
    assert (told.code, told.error["where"]) == (3, "absent.yaml")
    told = sphmctl("check", short.parent, "--json")
    assert (told.code, told.error["where"]) == (3, str(short.parent))
    told = sphmctl("check", short, "--cell", "absent.yaml", "--json")
    assert (told.code, told.error["where"]) == (3, "absent.yaml")
    told = sphmctl("plan", short, "--out", "absent/plan.csv", "--json")
    assert (told.code, told.error["where"]) == (3, "absent/plan.csv")
    assert "make the folder first" in told.error["message"]


def test_a_plan_replaces_the_old_file_only_when_it_is_whole(
    sphmctl: Sphmctl, short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "plan.csv"
    out.write_text("as it was")

    def interrupted(plan: object) -> str:
        assert len(list(tmp_path.iterdir())) == 3  # the path, the old plan, the part of the new
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(planner, "plan_csv", interrupted)
        assert sphmctl("plan", short, "--out", out).code == 130
    assert out.read_text() == "as it was"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.csv", "short.yaml"]
    assert sphmctl("plan", short, "--out", out).code == 0
    assert read_csv(out)[0]["t_s"] == "0"


def test_the_optimal_timing_takes_less_along_the_same_path_and_says_what_binds(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    driven = sphmctl("plan", OCTAGON, "--out", "driven.csv", "--json").document
    told = sphmctl("plan", OCTAGON, "--out", "ideal.csv", "--timing", "optimal", "--json")
    ideal = told.document
    assert (driven["timing"], ideal["timing"]) == ("stops", "optimal")
    assert ideal["duration_s"] < driven["duration_s"]
    assert "of the time binds: tool speed" in ideal["notes"][-1]
    assert f"as its controller drives {driven['duration_s']:.2f} s" in ideal["notes"][-1]
    assert told.err == ""


def test_the_optimal_timing_claims_no_stop_of_the_arm(sphmctl: Sphmctl, tmp_path: Path) -> None:
    counts = {}
    for timing in ("stops", "optimal"):
        files = ("--out", "a.csv", "--plot", "a.svg", "--view", "a.html")
        document = sphmctl("plan", OCTAGON, *files, "--timing", timing, "--json").document
        rows = read_csv(tmp_path / "a.csv")
        t_s = np.array([float(row["t_s"]) for row in rows])
        place = np.array([[float(row[name]) for name in POSE[:3]] for row in rows])
        speed = np.linalg.norm(np.diff(place, axis=0), axis=1) / np.diff(t_s)
        knots = [k for k, row in enumerate(rows) if row["knot"]]
        assert all(speed[k - 1] < 3.0 for k in knots)  # half a row's braking at 500 mm/s2
        headline = f"{document['duration_s']:.2f} s, {len(knots) or 'no'} stops of the arm"
        assert headline in (tmp_path / "a.svg").read_text()
        assert headline in (tmp_path / "a.html").read_text()
        assert len(knots) == document["knots"]
        counts[timing] = len(knots)
        claims = [note for note in document["notes"] if "exact stop" in note]
        assert all(timing == "stops" or "as its controller drives" in note for note in claims)
    assert counts == {"stops": 34, "optimal": 0}


RESTING = SHORT.replace("dwell_s: 0.2", "dwell_s: 1.5") + "  - lin: A\n"


@pytest.mark.parametrize("timing", ["stops", "optimal"])
def test_what_binds_is_told_in_shares_that_make_up_the_whole_time(
    sphmctl: Sphmctl, tmp_path: Path, timing: str
) -> None:
    path = tmp_path / "resting.yaml"
    path.write_text(RESTING)
    document = sphmctl("plan", path, "--out", "a.csv", "--timing", timing, "--json").document
    shares = {item["label"]: item["share_percent"] for item in document["binding"]}
    assert sum(shares.values()) == pytest.approx(100.0)
    assert shares["rest"] == pytest.approx(100.0 * 1.5 / document["duration_s"], abs=1e-6)
    assert shares["tool acceleration"] > 10.0
    assert list(shares.values()) == sorted(shares.values(), reverse=True)


def test_a_path_of_one_point_is_told_without_stops(sphmctl: Sphmctl, tmp_path: Path) -> None:
    path = tmp_path / "one.yaml"
    path.write_text(RESTING.split("  - lin: B")[0])
    told = sphmctl("plan", path, "--out", "a.csv", "--plot", "a.svg", "--view", "a.html")
    assert told.out.splitlines()[0] == "the arm does not move"
    assert "0.00 s, no stops of the arm" in (tmp_path / "a.svg").read_text()
    checked = sphmctl("check", path).out
    assert "0 stops" not in checked
    assert "0 knots" not in told.out
    assert sphmctl("plan", path, "--out", "a.csv", "--json").document["binding"] == []


def test_the_help_says_what_the_jerk_bound_of_the_optimal_timing_costs(sphmctl: Sphmctl) -> None:
    told = " ".join(sphmctl("plan", "--help").out.replace("│", " ").split())
    assert "24 ms longer from each rest" in told
    assert "may last longer than stops" in told


def test_a_timing_that_does_not_exist_is_refused(sphmctl: Sphmctl, short: Path) -> None:
    told = sphmctl("plan", short, "--out", "plan.csv", "--timing", "best", "--json")
    assert told.code == 2
    assert told.error["message"] == "'best': give stops or optimal"


def test_a_check_tells_closeness_and_what_a_drive_without_stops_would_take(
    sphmctl: Sphmctl, short: Path
) -> None:
    document = sphmctl("check", short, "--json").document
    names = [near["name"] for near in document["closeness"]]
    assert any("gap to the robot itself" in name for name in names)
    assert any("parallel singularity" in name for name in names)
    assert any("static load" in name for name in names)
    assert all(near["where"].startswith(("line ", "the start")) for near in document["closeness"])
    assert document["knots"] > 0
    assert "without jerk limit" in document["without_stops"]
