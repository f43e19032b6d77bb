"""The paper's octagon as a plan, held against an independent model of arm, wrist and controller."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.motion import Plan
from sphmctl.pathfile import load_path
from sphmctl.planner import check, plan, plan_csv
from tests.planner.oracle import (
    ACCELERATIONS_RAD_S2,
    SPEEDS_DEG_S,
    aside_mm,
    controller_block_s,
    pen_mm,
)

PATHS = FilePath(__file__).parents[2] / "configs" / "paths"
CORNERS_MM = np.array(
    [
        [623.563, 0.0049, 0],
        [583.523, 107.628, 0],
        [470.077, 159.941, 0],
        [358.786, 117.551, 0],
        [310.334, 0.0043, 0],
        [358.789, -117.54, 0],
        [470.08, -159.93, 0],
        [583.525, -107.61, 0],
        [623.563, 0.0049, 0],
    ]
)


@pytest.fixture(scope="module")
def octagon() -> Plan:
    return plan(load_path(PATHS / "octagon.yaml"), emulated_cell())


def side_of(octagon: Plan) -> list[tuple[int, int, int]]:
    """(side, first sample, last sample) of the eight sides."""
    marks = [point.sample for point in octagon.points]
    return [(i, begin, end) for i, (begin, end) in enumerate(pairwise(marks))]


def test_it_goes_round_from_a_to_a_in_good_time_and_says_its_knots(octagon: Plan) -> None:
    assert [point.name for point in octagon.points] == list("ABCDEFGHA")
    print(f"{octagon.duration_s:.3f} s, {len(octagon.knots)} knots", *octagon.notes, sep="\n")
    assert 12.0 < octagon.duration_s + 0.012 * len(octagon.knots) <= 22.0
    assert octagon.notes[0].startswith("A to B (move 2): 4 knots, chord error 0.19 mm")
    assert 30 <= len(octagon.knots) <= 40


def test_every_sample_stands_on_its_side_pen_down(octagon: Plan) -> None:
    worst = 0.0
    joints = np.degrees(octagon.joints)
    assert np.ptp(joints[:, 6:], axis=1).max() < 1e-9
    for side, begin, end in side_of(octagon):
        for row in range(begin, end + 1):
            tip, direction = pen_mm(joints[row])
            worst = max(worst, aside_mm(tip, CORNERS_MM[side], CORNERS_MM[side + 1]))
            np.testing.assert_allclose(direction, [0, 0, -1], atol=1e-9)
            np.testing.assert_allclose(tip, octagon.tool[row, :3, 3] * 1000, atol=1e-6)
    assert worst < 1e-6


def test_the_cranks_run_linearly_in_arc_length_and_touch_their_limits(octagon: Plan) -> None:
    expected = [120, 90, 60, 30, 0, 30, 60, 90, 120]
    for side, begin, end in side_of(octagon):
        here = octagon.tool[begin : end + 1, :3, 3] * 1000
        along = np.linalg.norm(here - CORNERS_MM[side], axis=1)
        share = along / np.linalg.norm(CORNERS_MM[side + 1] - CORNERS_MM[side])
        wanted = expected[side] + share * (expected[side + 1] - expected[side])
        cranks = np.degrees(octagon.joints[begin : end + 1, 6:])
        np.testing.assert_allclose(cranks, np.tile(wanted[:, None], 3), atol=1e-6)
    assert np.degrees(octagon.joints[:, 6:]).max() == pytest.approx(120, abs=1e-9)
    assert np.degrees(octagon.joints[:, 6:]).min() == pytest.approx(0, abs=1e-9)


def test_joints_and_tool_keep_every_limit_by_differentiation(octagon: Plan) -> None:
    dt = np.diff(octagon.t)
    assert dt.max() <= 0.0042
    assert dt.min() > 1e-4
    speed = np.diff(octagon.joints, axis=0) / dt[:, None]
    gap = (dt[1:] + dt[:-1])[:, None] / 2
    acceleration = np.diff(speed, axis=0) / gap
    assert np.all(np.abs(np.degrees(speed)) <= SPEEDS_DEG_S)
    assert np.all(np.abs(acceleration) <= ACCELERATIONS_RAD_S2 * 1.001)
    tool = np.diff(octagon.tool[:, :3, 3] * 1000, axis=0) / dt[:, None]
    assert np.linalg.norm(tool, axis=1).max() <= 100.001
    assert np.linalg.norm(tool, axis=1).max() > 99.9
    assert np.linalg.norm(np.diff(tool, axis=0) / gap, axis=1).max() <= 500.5


def test_it_passes_a5_zero_twice_with_a4_and_a6_at_rest(octagon: Plan) -> None:
    a5 = octagon.joints[:, 4]
    assert np.count_nonzero(np.diff(np.sign(a5))) == 2
    assert np.abs(np.degrees(octagon.joints[:, 3])).max() < 1e-6
    assert np.abs(np.degrees(octagon.joints[:, 5])).max() < 1.0


def test_the_controllers_blocks_take_the_planned_time(octagon: Plan) -> None:
    begin, begin_s = octagon.joints[0, :6], 0.0
    for knot in octagon.knots:
        np.testing.assert_array_equal(knot.joints, octagon.joints[knot.sample, :6])
        assert 1e-4 <= knot.velocity <= 1
        assert 1e-4 <= knot.acceleration <= 1
        end_s = float(octagon.t[knot.sample])
        took_s = controller_block_s(begin, knot.joints, knot.velocity, knot.acceleration)
        assert took_s == pytest.approx(end_s - begin_s, rel=1e-6)
        begin, begin_s = knot.joints, end_s
    assert octagon.knots[-1].sample == len(octagon.t) - 1


def test_the_controllers_chords_stay_within_the_tolerance_and_no_block_less_would(
    octagon: Plan,
) -> None:
    sides = side_of(octagon)
    worst = 0.0
    begin, first = octagon.joints[0, :6], 0
    for knot in octagon.knots:
        side = next(i for i, low, high in sides if low <= first and knot.sample <= high)
        rows = np.linspace(first, knot.sample, 25).round().astype(int)
        # The controller's law has the plan's ramps, so the arm's share of its chord at these times
        # is the tool's share of the planned way.
        where = octagon.tool[rows, :3, 3]
        way = np.linalg.norm(where - where[0], axis=1)
        for row, share in zip(rows, way / way[-1], strict=True):
            arm = begin + share * (knot.joints - begin)
            joints = np.degrees(np.concatenate([arm, octagon.joints[row, 6:]]))
            tip, _ = pen_mm(joints)
            worst = max(worst, aside_mm(tip, CORNERS_MM[side], CORNERS_MM[side + 1]))
        begin, first = knot.joints, knot.sample
    print(f"largest chord error {worst:.3f} mm")
    assert 0.2 < worst <= 0.3005


@pytest.mark.parametrize("speed", [0.1, 0.5])
def test_a_slower_run_is_the_same_path_in_more_time(octagon: Plan, speed: float) -> None:
    slow = plan(load_path(PATHS / "octagon.yaml"), emulated_cell(), speed)
    assert slow.duration_s == pytest.approx(octagon.duration_s / speed, rel=1e-9)
    for knot, fast in zip(slow.knots, octagon.knots, strict=True):
        np.testing.assert_allclose(knot.joints, fast.joints, atol=1e-12)
        assert knot.velocity == pytest.approx(fast.velocity * speed)
        assert knot.acceleration == pytest.approx(fast.acceleration * speed**2)


def test_the_table_rows_by_joints_are_one_knot_each() -> None:
    by_joints = plan(load_path(PATHS / "octagon_joints.yaml"), emulated_cell())
    assert len(by_joints.knots) == 8
    assert [point.name for point in by_joints.points] == list("ABCDEFGHA")
    row_c = by_joints.points[2].sample
    wanted = [-18.62, -32.10, 114.85, 0.02, 8.59, -0.03, 60, 60, 60]
    np.testing.assert_allclose(np.degrees(by_joints.joints[row_c]), wanted, atol=1e-12)
    speed = np.abs(np.diff(np.degrees(by_joints.joints), axis=0)) / np.diff(by_joints.t)[:, None]
    assert (speed / SPEEDS_DEG_S).max() == pytest.approx(0.2, rel=1e-3)


def test_check_tells_duration_and_margins_of_all_joints(octagon: Plan) -> None:
    report = check(load_path(PATHS / "octagon.yaml"), emulated_cell())
    assert report.feasible
    assert report.duration_s == octagon.duration_s
    margins = {margin.joint: margin for margin in report.margins}
    assert len(margins) == 9
    assert margins["theta7"].range_deg == pytest.approx(0, abs=1e-9)
    # A3 comes nearest to its 156 degrees at E.
    assert margins["A3"].range_deg == pytest.approx(156 - np.degrees(octagon.joints[:, 2]).max())
    assert "move 5 (lin to E), 127.1 mm along" in margins["A3"].range_where
    assert 0 < margins["A1"].speed_share < 0.1


def test_the_csv_has_the_promised_columns_and_numbers_the_knots(octagon: Plan) -> None:
    head, *rows = plan_csv(octagon).splitlines()
    assert head == (
        "t_s,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,theta7_deg,theta8_deg,theta9_deg,"
        "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,knot"
    )
    cells = [row.split(",") for row in rows]
    assert len(cells) == len(octagon.t)
    assert [cell[-1] for cell in cells if cell[-1]] == [
        str(i + 1) for i in range(len(octagon.knots))
    ]
    last = cells[octagon.points[1].sample]
    assert [float(value) for value in last[10:13]] == pytest.approx([583.523, 107.628, 0], abs=1e-9)
    assert float(last[13]) == pytest.approx(-169.549522, abs=1e-9)
    assert float(cells[7][0]) == pytest.approx(0.028)
