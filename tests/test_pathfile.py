"""Path files: what they mean, and what they refuse."""

from __future__ import annotations

import csv
import math
from pathlib import Path as FilePath
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sphmctl.errors import InvalidError
from sphmctl.pathfile import Path, Speed, load_path

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
