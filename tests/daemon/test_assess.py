"""Assessing a run: synthetic runs whose figures are known by construction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.daemon import assess
from sphmctl.motion import Floats, NamedPoint, Plan
from sphmctl.robots import sphm

GRID_S = 0.004
START_DEG = np.array([0.0, -30.0, 100.0, 0.0, 20.0, 0.0, 60.0, 60.0, 60.0])


def grid(n: int) -> Floats:
    return np.asarray(GRID_S * np.arange(n), dtype=np.float64)


def line(corners: list[list[float]], speed_deg_s: float) -> tuple[Floats, Floats]:
    """Times and joints of a way through the corners at one speed of the largest joint."""
    parts = []
    for a, b in pairwise(corners):
        way = np.subtract(b, a)
        n = round(float(np.abs(way).max()) / (speed_deg_s * GRID_S))
        parts.append(np.asarray(a) + np.linspace(0.0, 1.0, n, endpoint=False)[:, None] * way)
    joints = np.vstack([*parts, np.array([corners[-1]])])
    return grid(len(joints)), joints


def at(t: Floats, joints: Floats, when: Floats) -> Floats:
    return np.stack([np.interp(when, t, column) for column in joints.T], axis=1)


def brute_force(plan_t: Floats, plan: Floats, rows: Floats) -> list[float]:
    """The definition of tau, word for word, on the samples alone."""
    tau, found = 0.0, []
    for row in rows:
        best = None
        for t, joints in zip(plan_t, plan, strict=True):
            if tau - 1e-12 <= t <= tau + 1.0:
                gap = max(abs(a - b) for a, b in zip(joints, row, strict=True))
                if best is None or gap < best[0] - 1e-12:
                    best = (gap, t)
        assert best is not None
        tau = best[1]
        found.append(tau)
    return found


def make_plan(corners: list[list[float]], speed_deg_s: float = 20.0) -> Plan:
    """A plan through joint corners (offsets from START_DEG), with its real tool poses."""
    t, offsets = line(corners, speed_deg_s)
    joints = np.radians(START_DEG + offsets)
    tool = np.eye(4)
    tool[2, 3] = 0.0589
    base = np.array([[0.0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    stops = [round(float(np.interp(i, [0, len(corners) - 1], [0, len(t) - 1]))) for i in (0, 1)]
    points = (NamedPoint("first", stops[0]), NamedPoint("last", len(t) - 1))
    poses = np.linalg.inv(base) @ sphm.forward(joints) @ tool
    return Plan("test", t, joints, poses, (), points, (), tool, base)


OUT_30 = [[0.0] * 9, [30.0, 0, 0, 0, 0, 0, 30, 30, 30]]
CORNER = [[0.0] * 9, [20.0] + [0.0] * 8, [20.0, 20.0] + [0.0] * 7, [0.0, 20.0] + [0.0] * 7]


def test_progress_of_a_late_arm_is_the_plan_time_less_the_delay() -> None:
    t, joints = line([[0, 0, 0, 0, 0, 0], [40, 10, 0, -20, 5, 0]], 20.0)
    when = np.arange(0.0, 1.9, 0.00313)
    tau = assess.progress(t, joints, at(t, joints, np.maximum(when - 0.0507, 0.0)))
    assert np.abs(tau - np.maximum(when - 0.0507, 0.0)).max() < 1e-6


def test_progress_agrees_with_the_definition_on_samples_within_half_a_sample() -> None:
    rng = np.random.default_rng(3)
    t = grid(400)
    joints = np.stack([15 * np.sin(2.1 * t * k + k) for k in range(1, 7)], axis=1)
    true = at(t, joints, np.linspace(0.0, t[-1], 150)) + rng.normal(0.0, 0.02, (150, 6))
    difference = np.abs(assess.progress(t, joints, true) - np.array(brute_force(t, joints, true)))
    assert difference.max() <= 1.01 * GRID_S
    assert np.median(difference) <= 0.5 * GRID_S


def test_progress_never_goes_back_when_the_arm_does() -> None:
    t, joints = line([[0.0] * 6, [40.0] + [0.0] * 5], 20.0)
    rows = at(t, joints, np.array([0.0, 0.5, 1.0, 0.8, 0.5, 1.1]))
    expected = [0.0, 0.5, 1.0, 1.0, 1.0, 1.1]
    assert assess.progress(t, joints, rows) == pytest.approx(expected, abs=1e-6)


def test_progress_looks_no_further_than_a_second_ahead() -> None:
    t, joints = line([[0.0] * 6, [100.0] + [0.0] * 5], 20.0)
    rows = at(t, joints, np.array([0.0, 4.0, 4.0]))
    assert assess.progress(t, joints, rows) == pytest.approx([0.0, 1.0, 2.0], abs=GRID_S)


def test_progress_through_a_dwell_stays_at_its_start_until_the_arm_moves_on() -> None:
    t, way = line([[0.0] * 6, [10.0] + [0.0] * 5], 20.0)
    still = np.repeat(way[-1:], 100, axis=0)
    joints = np.vstack([way, still, way[1:] + way[-1]])
    t = grid(len(joints))
    rows = np.array([[9.9], [10.0], [10.0], [10.06], [12.0]]) * np.eye(6)[0]
    tau = assess.progress(t, joints, rows)
    assert tau[1:3] == pytest.approx([0.5, 0.5], abs=1e-6)
    assert tau[3:] == pytest.approx([0.903, 1.0], abs=1e-6)


def test_progress_out_and_back_along_one_line_visits_the_turn() -> None:
    _, out = line([[0.0] * 6, [6.0] + [0.0] * 5], 20.0)
    _, back = line([[6.0] + [0.0] * 5, [0.0] * 6], 13.7)
    joints = np.vstack([out, back[1:]])
    t = grid(len(joints))
    when = np.arange(0.0, t[-1], 0.0031)
    tau = assess.progress(t, joints, at(t, joints, when))
    assert np.abs(tau - when).max() < 0.004


def test_progress_of_no_rows_is_empty() -> None:
    t, joints = line([[0.0] * 6, [6.0] + [0.0] * 5], 20.0)
    assert assess.progress(t, joints, np.empty((0, 6))).shape == (0,)


@given(delay_ms=st.floats(-25.0, 25.0), speed=st.floats(12.0, 80.0))
@settings(max_examples=25, deadline=None)
def test_skew_of_cranks_that_are_late_is_the_delay_less_the_dead_band(
    delay_ms: float, speed: float
) -> None:
    t, joints = line([[0.0] * 9, [speed] * 9], speed)
    when = np.arange(0.1, 0.9, GRID_S)
    true = np.hstack([at(t, joints[:, :6], when), at(t, joints[:, 6:], when - delay_ms / 1000.0)])
    expected = max(abs(delay_ms) - 1000.0 * 0.044 / speed, 0.0)
    result = assess.skew(t, joints, when, true)
    assert result.p50_ms == pytest.approx(expected, abs=1e-3)
    assert result.p99_ms == pytest.approx(expected, abs=1e-3)
    assert result.share_counted == 1.0
    assert result.max_crank_error_deg == pytest.approx(abs(delay_ms) * speed / 1000.0, abs=1e-4)


def test_skew_sees_only_the_part_of_the_error_that_lies_along_the_motion() -> None:
    t, joints = line([[0.0] * 9, [*[20.0] * 6, 20.0, 0.0, 0.0]], 20.0)
    when = np.arange(0.1, 0.9, GRID_S)
    true = at(t, joints, when) + np.array([0, 0, 0, 0, 0, 0, 0.0, 3.0, 0.0])
    result = assess.skew(t, joints, when, true)
    assert result.max_ms == pytest.approx(0.0, abs=1e-3)
    assert result.max_crank_error_deg == pytest.approx(3.0)


def test_skew_counts_only_fast_cranks_under_a_moving_arm() -> None:
    corners = [[0.0] * 9, [10.0] * 9, [20.0] * 6 + [13.0] * 3]
    t, joints = line(corners, 20.0)
    when = np.arange(0.0, t[-1], GRID_S)
    true = at(t, joints, when)
    # Half a second fast, half a second with cranks at 6 deg/s.
    assert assess.skew(t, joints, when, true).share_counted == pytest.approx(0.5, abs=0.01)
    standing = np.vstack([true[:60], np.repeat(true[60:61], 120, axis=0)])
    share = assess.skew(t, joints, grid(180), standing).share_counted
    assert share == pytest.approx(61 / 180)


def test_skew_has_no_figures_when_nothing_counts() -> None:
    t, joints = line([[0.0] * 9, [5.0] * 9], 5.0)
    result = assess.skew(t, joints, t, joints + 0.25)
    assert (result.p50_ms, result.p99_ms, result.max_ms) == (None, None, None)
    assert result.share_counted == 0.0
    assert result.max_crank_error_deg is not None
    empty = assess.skew(t, joints, np.empty(0), np.empty((0, 9)))
    assert empty == assess.Skew(None, None, None, 0.0, None)


def test_tracking_of_the_plan_itself_is_zero_at_any_pace() -> None:
    plan = make_plan(CORNER)
    pace = np.interp(np.linspace(0, 1, 900), [0, 0.3, 0.5, 1], [0, 0.6, 0.6, 1]) * plan.duration_s
    result = assess.tracking(plan, at(plan.t, np.degrees(plan.joints), pace))
    assert result.max_joint_deg == pytest.approx(0.0, abs=0.05)
    assert result.max_tcp_mm == pytest.approx(0.0, abs=0.3)
    same = assess.tracking(plan, np.degrees(plan.joints))
    assert same.max_joint_deg == pytest.approx(0.0, abs=1e-9)
    assert same.max_tcp_mm == pytest.approx(0.0, abs=1e-9)


def test_tracking_measures_a_turned_base_as_an_arc_of_the_tool() -> None:
    plan = make_plan([[0.0] * 9, [0.0, 10.0] + [0.0] * 7])
    rows = np.degrees(plan.joints) + np.array([0.5] + [0.0] * 8)
    result = assess.tracking(plan, rows)
    tool = sphm.forward(plan.joints) @ plan.tool_on_platform
    radius_mm = 1000.0 * float(np.hypot(tool[:, 0, 3], tool[:, 1, 3]).max())
    assert result.max_joint_deg == pytest.approx(0.5)
    assert result.max_tcp_mm == pytest.approx(2 * radius_mm * np.sin(np.radians(0.25)), rel=1e-3)


def test_a_cut_corner_counts_with_the_distance_of_the_corner() -> None:
    plan = make_plan(CORNER)
    joints = np.degrees(plan.joints)
    off = np.abs(joints - (START_DEG + CORNER[1])).max(axis=1)
    rows = joints[off >= 4.0]
    # The chord between 4 degrees before and 4 degrees after passes the corner at 2 and 2.
    assert assess.tracking(plan, rows).max_joint_deg == pytest.approx(2.0, abs=0.1)


def test_a_skipped_side_counts_in_full() -> None:
    plan = make_plan(CORNER)
    joints = np.degrees(plan.joints)
    side = len(joints) // 3
    rows = np.vstack([joints[: side - 50], joints[2 * side + 50 :]])
    # 4 degrees before the skipped side to 4 degrees after it, whose corners are 20 apart.
    assert assess.tracking(plan, rows).max_joint_deg == pytest.approx(4.0, abs=0.1)


def test_a_run_that_stopped_half_way_is_judged_up_to_there_or_in_full() -> None:
    plan = make_plan(CORNER)
    rows = np.degrees(plan.joints)[: len(plan.t) // 2]
    whole = assess.tracking(plan, rows)
    partial = assess.tracking(plan, rows, complete=False)
    assert (whole.max_joint_deg or 0.0) > 15.0
    assert partial.max_joint_deg == pytest.approx(0.0, abs=1e-9)
    assert assess.tracking(plan, rows[:0]) == assess.Tracking(None, None)


def test_tracking_follows_a_wrist_that_moves_by_itself() -> None:
    plan = make_plan([[0.0] * 9, [0.0] * 6 + [30.0] * 3])
    result = assess.tracking(plan, np.degrees(plan.joints))
    assert result.max_joint_deg == pytest.approx(0.0, abs=1e-9)


def test_what_is_required_is_the_plan_where_the_arm_is() -> None:
    plan = make_plan(OUT_30)
    joints = np.degrees(plan.joints)
    rows = joints[100:200].copy()
    rows[:, 6:] += 1.5
    assert assess.required(plan, rows) == pytest.approx(joints[100:200], abs=1e-3)


def test_named_points_report_the_nearest_pose_in_order() -> None:
    plan = make_plan(OUT_30)
    joints = np.degrees(plan.joints)
    rows = joints[::7] + np.array([0, 0, 0, 0, 0, 0.4, 0, 0, 0])
    first, last = assess.named_points(plan, rows)
    assert (first.name, last.name) == ("first", "last")
    assert first.reached is not None
    # A6 turns about the tool's own axis here: the point stays, the orientation turns by 0.4.
    assert first.position_error_mm == pytest.approx(0.0, abs=1e-6)
    assert first.angle_error_deg == pytest.approx(0.4)
    tool = np.linalg.inv(plan.base_in_world) @ sphm.forward(plan.joints[0]) @ plan.tool_on_platform
    assert first.required[:3] == pytest.approx(1000.0 * tool[:3, 3])


def test_a_point_between_two_rows_is_reached_between_them() -> None:
    plan = make_plan(OUT_30)
    middle = len(plan.t) // 2
    points = (NamedPoint("middle", middle),)
    moved = Plan(**{**vars(plan), "points": points})
    rows = np.degrees(plan.joints)[[0, middle - 11, middle + 5]]
    (point,) = assess.named_points(moved, rows)
    assert point.position_error_mm == pytest.approx(0.0, abs=0.2)


def test_a_point_that_was_not_reached_has_no_pose() -> None:
    plan = make_plan(OUT_30)
    first, last = assess.named_points(plan, np.degrees(plan.joints)[:50])
    assert first.reached is not None
    assert (last.reached, last.position_error_mm, last.angle_error_deg) == (None, None, None)
    assert last.required[:3] == pytest.approx((1000.0 * plan.tool[-1, :3, 3]).tolist())
    assert all(point.reached is None for point in assess.named_points(plan, np.empty((0, 9))))


def test_a_place_that_is_visited_twice_is_compared_with_each_visit() -> None:
    plan = make_plan([[0.0] * 9, [8.0] + [0.0] * 8, [0.0] * 9])
    turn = len(plan.t) // 2
    points = (NamedPoint("out", turn - 25), NamedPoint("back", turn + 25))
    rows = np.degrees(plan.joints)
    rows[turn:, 1] += 0.1
    out, back = assess.named_points(Plan(**{**vars(plan), "points": points}), rows)
    assert out.position_error_mm == pytest.approx(0.0, abs=1e-6)
    assert (back.position_error_mm or 0.0) > 0.5
