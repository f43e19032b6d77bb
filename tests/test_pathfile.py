"""Path files: what they mean, and what they refuse."""

from __future__ import annotations

import csv
import math
import time
from pathlib import Path as FilePath
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sphmctl.errors import InvalidError
from sphmctl.pathfile import (
    Arc,
    Circle,
    Helix,
    Orientation,
    Path,
    Point,
    Polyline,
    Speed,
    Spline,
    Wrist,
    inputs,
    load_path,
)

PATHS = FilePath(__file__).parents[1] / "configs" / "paths"

SAMPLE = """\
version: 1
name: sample
tool: octagon_pen
base: world
speed: {tcp_mm_s: 100, tcp_mm_s2: 500, joint_percent: 20, joint_acceleration_percent: 20}
wrist: cranks
points:
  A: {pose: [623.563, 0.0049, 0, -179.9995, 0, 180], cranks_deg: [120, 120, 120]}
  home: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}
moves:
  - ptp: home
  - ptp: A
  - lin: {pose: [583.523, 107.6, 0, -169, 0, 180], cranks_deg: [90, 90, 90], speed: {tcp_mm_s: 50}}
  - dwell_s: 0.5
"""

# The first columns of Table 5 of the paper: name, x, y in mm, and the crank angle of all legs.
TABLE_5 = """\
A,623.563,0.0049,120
B,583.523,107.628,90
C,470.077,159.941,60
D,358.786,117.551,30
E,310.334,0.0043,0
F,358.789,-117.54,30
G,470.08,-159.93,60
H,583.525,-107.61,90
"""


def path_of(tmp_path: FilePath, text: str) -> Path:
    file = tmp_path / "path.yaml"
    file.write_text(text)
    return load_path(file)


def test_the_sample_reads_as_it_is_written(tmp_path: FilePath) -> None:
    path = path_of(tmp_path, SAMPLE)
    assert (path.name, path.tool, path.base) == ("sample", "octagon_pen", "world")
    assert [move.kind for move in path.moves] == ["ptp", "ptp", "lin", "dwell_s"]
    assert path.moves[0].point == path.points["home"]
    assert path.moves[1].speed == Speed(100, 500, 20, 20)
    assert path.moves[2].speed == Speed(50, 500, 20, 20)
    assert path.moves[3].dwell_s == 0.5
    assert [move.where for move in path.moves] == [
        "line 11, move 1 (ptp to home)",
        "line 12, move 2 (ptp to A)",
        "line 13, move 3 (lin)",
        "line 14, move 4 (dwell 0.5 s)",
    ]


def test_speed_and_wrist_may_stand_beside_a_named_point(tmp_path: FilePath) -> None:
    text = SAMPLE.replace(
        "- ptp: A", "- lin: A\n    speed: {tcp_mm_s2: 5}\n    wrist: {policy: fixed}"
    )
    move = path_of(tmp_path, text).moves[1]
    assert move.speed == Speed(100, 5, 20, 20)
    assert move.wrist.policy == "fixed"


def test_the_octagon_is_the_papers(tmp_path: FilePath) -> None:
    path = load_path(PATHS / "octagon.yaml")
    rows = list(csv.reader(TABLE_5.splitlines()))
    for name, x, y, crank in rows:
        point = path.points[name]
        assert point.pose is not None
        assert point.pose[:3] == (float(x), float(y), 0.0)
        assert point.pose[4:] == (0.0, 180.0)
        heading = math.degrees(math.atan2(float(y), float(x))) + 180.0
        assert abs((point.pose[3] - heading + 180.0) % 360.0 - 180.0) < 1e-6
        assert point.cranks_deg == (float(crank),) * 3
    order = [move.point.name for move in path.moves if move.point]
    assert order == list("ABCDEFGHA")
    assert [move.kind for move in path.moves] == ["ptp"] + ["lin"] * 8
    assert path.moves[1].speed.tcp_mm_s == 100
    assert path.moves[1].speed.tcp_mm_s2 == 500


def test_the_octagon_of_joints_is_the_papers() -> None:
    path = load_path(PATHS / "octagon_joints.yaml")
    assert [move.kind for move in path.moves] == ["ptp"] * 9
    assert [move.point.name for move in path.moves if move.point] == list("ABCDEFGHA")
    assert path.points["A"].joints_deg == (0.08, -23.78, 93.75, 0, 18.86, -0.03, 120, 120, 120)
    assert path.points["E"].joints_deg == (0.08, -33.47, 143.07, 0.03, -22.52, -0.03, 0, 0, 0)
    assert path.points["H"].joints_deg == (10.23, -26.26, 98.28, 0, 19.15, -0.03, 90, 90, 90)


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        (
            "tcp_mm_s: 50",
            "tcp_mms: 50",
            "line 13, column 86",
            "lin.speed.tcp_mms: this key is not known (did you mean 'tcp_mm_s'?)",
        ),
        ("tcp_mm_s: 50", "tcp_mm_s: -50", "line 13", "-50 should be greater than or equal to 0.1"),
        ("tcp_mm_s: 50", "tcp_mm_s: 50 mm", "line 13", '"50 mm" should be a number'),
        ("[90, 90, 90]", "[90, 90]", "line 13, column 64", "has 2 numbers; give 3"),
        (
            "[90, 90, 90]",
            "[90, x, 90]",
            "line 13, column 69",
            'cranks_deg[2]: "x" should be a number',
        ),
        (
            "cranks_deg: [90, 90, 90], ",
            "",
            "line 13, column 10",
            "policy 'cranks' needs 'cranks_deg'",
        ),
        ("- ptp: A", "- ptp: B", "line 12, column 10", 'there is no point "B"; known are A, home'),
        ("- ptp: A", "- ptp: hom", "line 12", "did you mean 'home'?"),
        (
            "- ptp: A",
            "- arcs: A",
            "line 12, column 5",
            "moves[2].arcs: this key is not known (did you mean 'arc'?)",
        ),
        ("- ptp: A", "- ptp: 3", "line 12, column 10", "3 should be a point's name"),
        ("- ptp: A", "- ptp: {point: A}", "line 12", "write the point's name itself"),
        ("- ptp: A", "- ptp: A\n    lin: A", "line 12, column 5", "a move is one of"),
        ("- ptp: A", "- {}", "line 12", "a move is one of"),
        ("- ptp: home", "- lin: home", "line 11, column 5", "a path begins with 'ptp: ...'"),
        ("- dwell_s: 0.5", "- dwell_s: 0", "line 14", "should be greater than 0"),
        ("- dwell_s: 0.5", "- dwell_s: 0.5\n    wrist: auto", "line 14", "a rest takes neither"),
        (
            "speed: {tcp_mm_s: 50}}",
            "wrist: auto}\n    wrist: fixed",
            "line 14",
            "'wrist' is given twice",
        ),
        ("wrist: cranks", "wrist: cranked", "line 6, column 8", "did you mean 'cranks'?"),
        (
            "wrist: cranks",
            "wrist: {policy: auto, cranks_deg: [1, 2, 3]}",
            "line 6",
            "only the policy 'fixed'",
        ),
        ("base: world", "base: [1, 2, 3]", "line 4, column 7", "has 3 numbers; give 6"),
        ("base: world", "base: 7", "line 4", "a frame's name or six numbers"),
        ("  home: {", "  A: {", "line 9, column 3", "the key 'A' was given before, in line 8"),
        ("home: {joints", "home: {cranks_deg: [1, 2, 3], joints", "line 9", "leave this out"),
        (
            "home: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}",
            "home: {}",
            "line 9",
            "either 'pose' or 'joints_deg'",
        ),
        ("name: sample", "name: ../../etc", "line 2, column 7", "is no name"),
        ("version: 1", "version: 7", "line 1, column 10", "version: 7 is not 1"),
        ("version: 1\n", "", "line 1, column 1", "version: this key is missing"),
        ("623.563", "623563", "line 8, column 14", "out of range"),
    ],
)
def test_a_wrong_path_is_refused_with_its_place(
    tmp_path: FilePath, old: str, new: str, place: str, words: str
) -> None:
    assert old in SAMPLE
    with pytest.raises(InvalidError) as caught:
        path_of(tmp_path, SAMPLE.replace(old, new, 1))
    assert place in str(caught.value)
    assert words in str(caught.value)


EVERY_KIND = """\
version: 1
name: kinds
wrist: level
orientation: fixed
points:
  A: {pose: [500, 0, 100, 180, 0, 180]}
  B: {pose: [550, 50, 100, 180, 0, 180], cranks_deg: [60, 60, 60]}
moves:
  - ptp: A
  - arc: {via: [520, 40, 100], to: B, blend_mm: 5}
  - circle: {via: [A, [520, 0, 100, 0, 0, 0]]}
  - circle: {centre: A, normal: [0, 0, 2]}
  - helix: {centre: [500, 0, 0], normal: [0, 0, 1], turn_deg: -720, pitch_mm: 12.5}
    orientation: tangent
  - spline: {through: [[1, 2, 3], {pose: [4, 5, 6, 7, 8, 9]}, B], closed: true}
    wrist: {heave_mm: [60, 80], tilt_deg: 5, tilt_turns: -3}
  - spline: {through: [B, A], wrist: {policy: level, heave_mm: 70}}
    orientation: {normal_to: sphere, centre: [1, 2, 3], inside: true}
  - polyline: {csv: rows.csv, blend_mm: 2.5}
  - lin: {pose: [500, 0, 100, 180, 0, 180], orientation: {normal_to: plane, normal: [0, 0, 1]}}
"""

ROWS = """\
x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,theta7_deg,theta8_deg,theta9_deg
500,0,100,180,0,180,60,60,60

510,1.5,100,180,1,180,61,62,63
520,3e0,100,180,2,180,62,64,66
"""


def kinds_of(tmp_path: FilePath, text: str = EVERY_KIND, rows: str = ROWS) -> Path:
    (tmp_path / "rows.csv").write_text(rows)
    return path_of(tmp_path, text)


def test_every_kind_of_move_reads_as_it_is_written(tmp_path: FilePath) -> None:
    path = kinds_of(tmp_path)
    arc, three, round_a, coil, closed, opened, line, last = path.moves[1:]
    assert arc.course == Arc(Point("", xyz_mm=(520, 40, 100)))
    assert (arc.point, arc.blend_mm, arc.column) == (path.points["B"], 5, 5)
    assert arc.title == "move 2 (arc to B)"
    assert three.course == Circle((path.points["A"], Point("", (520, 0, 100, 0, 0, 0))))
    assert (three.point, three.title) == (None, "move 3 (circle)")
    assert round_a.course == Helix(path.points["A"], (0, 0, 2), 360.0, 0.0)
    centre = Point("", xyz_mm=(500, 0, 0))
    assert coil.course == Helix(centre, (0, 0, 1), -720.0, 12.5)
    assert (coil.orientation.rule, arc.orientation.rule) == ("tangent", "fixed")
    assert isinstance(closed.course, Spline)
    assert [point.pose for point in closed.course.through][1] == (4, 5, 6, 7, 8, 9)
    assert (closed.course.closed, closed.point) == (True, None)
    assert closed.wrist == Wrist("motion", None, (60, 80), (5, 5), -3, 0)
    assert opened.point == path.points["A"]
    assert opened.wrist == Wrist("level", None, (70, 70))
    assert opened.orientation == Orientation("normal_to", "sphere", (1, 2, 3), inside=True)
    assert last.orientation == Orientation("normal_to", "plane", axis=(0, 0, 1))
    assert isinstance(line.course, Polyline)
    assert line.course.lines.tolist() == [2, 4, 5]
    assert line.course.xyz_mm.tolist() == [[500, 0, 100], [510, 1.5, 100], [520, 3, 100]]
    assert line.course.abc_deg is not None
    assert line.course.abc_deg[:, 1].tolist() == [0, 1, 2]
    assert line.course.cranks_deg is not None
    assert line.course.cranks_deg[2].tolist() == [62, 64, 66]
    assert [move.draws for move in path.moves] == [False] + [True] * 8


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("via: [520, 40, 100]", "via: [520, 40]", "line 10, column 16", "give 3: x, y, z in mm"),
        ("via: [520, 40, 100], ", "", "line 10", "arc.via: this key is missing"),
        ("to: B", "too: B", "line 10", "arc.too: this key is not known (did you mean 'to'?)"),
        ("to: B", "to: D", "line 10, column 36", 'there is no point "D"; known are A, B'),
        ("via: [A, [520", "via: [A, B, [520", "line 11", "via"),
        ("via: [A, [520, 0, 100, 0, 0, 0]]", "centre: A", "line 11", "'centre' and 'normal'"),
        ("normal: [0, 0, 2]", "normal: [0, 0, 0]", "line 12, column 33", "has no direction"),
        ("normal: [0, 0, 2]", "normal: up", "line 12", "should be a list"),
        ("turn_deg: -720", "turn_deg: 0", "line 13", "0 degrees is no turn"),
        ("pitch_mm: 12.5", "pitch_mm: -3", "line 13, column 79", "-3 is no pitch; give the rise"),
        ("[[1, 2, 3], {pose", "[7, {pose", "line 15", "7 should be a point's name, [x, y, z]"),
        ("[[1, 2, 3], {pose: [4, 5, 6, 7, 8, 9]}, B]", "[B]", "line 15", "at least two points"),
        ("orientation: tangent", "orientation: tangnt", "line 14", "did you mean 'tangent'?"),
        ("orientation: fixed", "orientation: normal_to", "line 4", "write {normal_to: plane"),
        ("normal_to: sphere", "normal_to: spere", "line 18", "did you mean 'sphere'?"),
        ("centre: [1, 2, 3], inside", "inside", "line 18", "a sphere needs 'centre'"),
        ("normal_to: plane, normal", "normal_to: plane, axis", "line 20", "a plane"),
        ("tilt_turns: -3", "tilt_turn: -3", "line 16", "did you mean 'tilt_turns'?"),
        ("heave_mm: [60, 80], tilt", "tilt", "line 16", "a wrist motion needs 'heave_mm' and"),
        ("heave_mm: [60, 80]", "heave_mm: [60, 70, 80]", "line 16", "[at the begin, at the end]"),
        (
            "{policy: level, heave_mm: 70}",
            "{policy: level, tilt_deg: 7}",
            "line 17",
            "takes no 'til",
        ),
        ("{policy: level, heave_mm: 70}", "{policy: tilt, heave_mm: 7}", "line 17", "'heave_mm'"),
        ("  - ptp: A", "  - ptp: A\n    blend_mm: 3", "line 10", "'ptp' takes none"),
        ("blend_mm: 5", "blend_mm: 0", "line 10", "greater than 0"),
        ("csv: rows.csv", "csv: no.csv", "line 19, column 21", "no.csv: there is no such file"),
        ("csv: rows.csv", "csv: /dev/zero", "line 19, column 21", "larger than 64 MB"),
    ],
)
def test_a_wrong_move_is_refused_with_its_place(
    tmp_path: FilePath, old: str, new: str, place: str, words: str
) -> None:
    assert old in EVERY_KIND
    with pytest.raises(InvalidError) as caught:
        kinds_of(tmp_path, EVERY_KIND.replace(old, new, 1))
    assert place in str(caught.value)
    assert words in str(caught.value)


def test_a_blend_needs_a_move_to_blend_into(tmp_path: FilePath) -> None:
    for end in ("", "  - dwell_s: 1\n", "  - ptp: A\n"):
        with pytest.raises(InvalidError, match=r"moves\[9\]: a corner is blended into the next"):
            kinds_of(tmp_path, EVERY_KIND.replace("normal: [0, 0, 1]}}", "normal: [0, 0, 1]}, "
                     "blend_mm: 3}") + end)  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("y_mm", "y", "line 1, column 2", '"y" is no column of a polyline'),
        ("x_mm,y_mm", "x_mm,x_mm", "line 1, column 2", "x_mm is there twice"),
        (",theta9_deg", "", "line 1", "the column theta9_deg is missing"),
        ("1.5,100", "1.5x,100", "line 4, column 2", 'y_mm: "1.5x" should be a number'),
        ("1.5,100", "1.5,,100", "line 4", "the row has 10 values; the first line names 9 columns"),
        ("1.5,100", "nan,100", "line 4, column 2", "y_mm: nan is no number"),
        ("1.5,100", "1_5,100", "line 4, column 2", 'y_mm: "1_5" should be a number'),
        ("3e0,100", "3e9,100", "line 5, column 2", "at most 10000 is allowed"),
        ("520,3e0", "510,1.5", "line 5", "the same place as line 4"),
        (ROWS[ROWS.index("500") :], "", "line 19, column 21", "there is no row of points"),
        (ROWS, "", "line 19, column 21", "the file is empty; its first line should be x_mm"),
    ],
)
def test_a_wrong_table_is_refused_with_line_and_column(
    tmp_path: FilePath, old: str, new: str, place: str, words: str
) -> None:
    with pytest.raises(InvalidError) as caught:
        kinds_of(tmp_path, rows=ROWS.replace(old, new, 1))
    assert f"{place}: " in str(caught.value)
    assert words in str(caught.value)


def test_the_policy_cranks_needs_their_columns(tmp_path: FilePath) -> None:
    text = (
        "version: 1\nname: t\nmoves:\n  - ptp: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}\n"
    )
    text += "  - polyline: {csv: rows.csv}\n"
    kinds_of(tmp_path, text)
    with pytest.raises(InvalidError, match=r"needs the columns theta7_deg, theta8_deg"):
        kinds_of(tmp_path, text, "x_mm,y_mm,z_mm\n1,2,3\n")


def test_a_hundred_thousand_rows_load_well_under_a_second(tmp_path: FilePath) -> None:
    rows = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n"
    rows += "".join(f"{i * 0.01:.4f},{i % 7}.25,100,180,0,180\n" for i in range(100_000))
    begin = time.process_time()
    course = kinds_of(tmp_path, rows=rows).moves[7].course
    assert time.process_time() - begin < 1.0  # 0.15 s on a machine of its own
    assert isinstance(course, Polyline)
    assert len(course.xyz_mm) == 100_000


leaves = (
    st.none() | st.booleans() | st.integers(-9, 999) | st.floats(width=16) | st.text(max_size=4)
)
junk = st.recursive(
    leaves,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
)
PLACES: list[tuple[str | int, ...]] = [
    ("version",), ("name",), ("tool",), ("base",), ("speed",), ("speed", "tcp_mm_s"), ("wrist",),
    ("points",), ("points", "A"), ("points", "A", "pose"), ("points", "A", "pose", 2),
    ("points", "home", "joints_deg"), ("moves",), ("moves", 0), ("moves", 0, "ptp"),
    ("moves", 2, "lin"),
    ("moves", 2, "lin", "cranks_deg"), ("moves", 2, "lin", "speed"), ("moves", 3, "dwell_s"),
]  # fmt: skip


@settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.sampled_from(PLACES), junk)
def test_junk_in_any_place_is_read_or_refused_in_one_sentence(
    tmp_path: FilePath, place: tuple[str | int, ...], value: object
) -> None:
    content: Any = yaml.safe_load(SAMPLE)
    inside = content
    for step in place[:-1]:
        inside = inside[step]
    inside[place[-1]] = value
    told: InvalidError | None = None
    try:
        path_of(tmp_path, yaml.safe_dump(content, allow_unicode=True))
    except InvalidError as problem:
        told = problem
    if told is not None:
        assert "\n" not in told.message
        assert "path.yaml" in told.where


def test_what_a_path_was_read_from_is_kept_under_the_names_it_gives(tmp_path: FilePath) -> None:
    home = tmp_path / "paths"
    (home / "tables").mkdir(parents=True)
    rows = "x_mm,y_mm,z_mm,theta7_deg,theta8_deg,theta9_deg\n1,2,3,60,60,60\n"
    for table in (home / "tables" / "near.csv", tmp_path / "far.csv"):
        table.write_text(rows)
    file = home / "mine.yaml"
    moves = "".join(
        f"  - polyline: {{csv: {name}}}\n" for name in ("tables/near.csv", "../far.csv")
    )
    file.write_text(
        "version: 1\nname: t\nmoves:\n"
        f"  - ptp: {{pose: [500, 0, 300, 180, 0, 180], cranks_deg: [60, 60, 60]}}\n{moves}"
    )
    path = load_path(file)
    assert inputs(path) == {
        "path.yaml": file.read_bytes(),
        "tables/near.csv": rows.encode(),
        "far.csv": rows.encode(),
    }
    file.unlink()
    with pytest.raises(InvalidError, match=r"mine\.yaml: the file cannot be read"):
        inputs(path)
