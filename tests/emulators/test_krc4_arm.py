"""The arm's motion, differentiated numerically, against the data sheet's limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.emulators.arm import Arm

HOME = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
STEP_S = 0.004

# KUKA's data sheet; accelerations from KUKA's own ROS package, rad/s2.
SPEED_DEG_S = (360.0, 300.0, 360.0, 381.0, 388.0, 615.0)
ACCELERATION_RAD_S2 = (21.7, 6.9, 31.4, 133.0, 136.0, 268.0)

JOINTS = st.tuples(
    *(
        st.floats(low, high)
        for low, high in (
            (-170, 170),
            (-190, 45),
            (-120, 156),
            (-185, 185),
            (-120, 120),
            (-350, 350),
        )
    )
)

Row = tuple[float, ...]


def drive(arm: Arm, at_step: dict[int, Callable[[], None]], limit: int = 20_000) -> list[Row]:
    """Step until the arm stands without a block; the joints before and after each step."""
    rows = [arm.joints_deg]
    for step in range(limit):
        if step in at_step:
            at_step[step]()
        if not arm.busy and step > max(at_step, default=0):
            return rows
        arm.step()
        rows.append(arm.joints_deg)
    raise AssertionError("the arm did not come to its end")


def assert_limits_kept(rows: list[Row]) -> None:
    for axis in range(6):
        q = [rows[0][axis], *(row[axis] for row in rows), rows[-1][axis]]
        speeds = [(b - a) / STEP_S for a, b in pairwise(q)]
        rates = [(b - a) / STEP_S for a, b in pairwise(speeds)]
        limit = math.degrees(ACCELERATION_RAD_S2[axis])
        assert max(map(abs, speeds)) <= SPEED_DEG_S[axis] * (1 + 1e-9) + 1e-9
        # 1e-8 degrees of rounding, differentiated twice.
        assert max(map(abs, rates)) <= limit * (1 + 1e-6) + 1e-2


def assert_on_line(rows: list[Row], start: Row, end: Row) -> None:
    longest = max(range(6), key=lambda axis: abs(end[axis] - start[axis]))
    span = end[longest] - start[longest]
    last = 0.0
    for row in rows:
        share = (row[longest] - start[longest]) / span if abs(span) > 1e-6 else 0.0
        assert -1e-9 <= share <= 1 + 1e-9
        assert share >= last - 1e-9, "the arm went back on its path"
        last = share
        for axis in range(6):
            wanted = start[axis] + share * (end[axis] - start[axis])
            assert row[axis] == pytest.approx(wanted, abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(JOINTS, JOINTS, st.floats(20, 100), st.floats(10, 100))
def test_a_block_ends_exactly_on_its_target_within_every_limit(
    start: Row, end: Row, velocity: float, acceleration: float
) -> None:
    arm = Arm(start)
    arm.begin(end, velocity, acceleration)
    rows = drive(arm, {})
    assert rows[-1] == end
    assert arm.finished == 1
    assert_limits_kept(rows)
    assert_on_line(rows, start, end)


@settings(max_examples=30, deadline=None)
@given(
    JOINTS,
    JOINTS,
    st.floats(20, 100),
    st.integers(0, 60),
    st.integers(0, 60),
    st.lists(st.tuples(st.integers(0, 120), st.sampled_from([0.1, 0.3, 0.7, 1.0])), max_size=3),
)
def test_holds_and_override_changes_keep_the_path_and_the_limits(
    start: Row,
    end: Row,
    velocity: float,
    hold_at: int,
    pause: int,
    overrides: list[tuple[int, float]],
) -> None:
    arm = Arm(start)
    arm.begin(end, velocity, 100.0)
    at_step: dict[int, Callable[[], None]] = {}
    for step, share in overrides:
        at_step[step] = partial(setattr, arm, "override", share)
    at_step[hold_at] = arm.hold
    at_step[hold_at + pause + 1] = arm.resume
    rows = drive(arm, at_step)
    assert rows[-1] == end
    assert_limits_kept(rows)
    assert_on_line(rows, start, end)


def test_a_block_takes_the_time_of_the_textbook_trapezoid() -> None:
    arm = Arm(HOME)
    arm.begin((90.0, *HOME[1:]), 50.0, 100.0)
    speed, acceleration = 180.0, math.degrees(21.7)
    wanted_s = 90.0 / speed + speed / acceleration
    assert (len(drive(arm, {})) - 1) * STEP_S == pytest.approx(wanted_s, abs=STEP_S)


def test_a_short_block_is_a_triangle() -> None:
    arm = Arm(HOME)
    arm.begin((5.0, *HOME[1:]), 100.0, 50.0)
    wanted_s = 2.0 * math.sqrt(5.0 / (math.degrees(21.7) / 2))
    assert (len(drive(arm, {})) - 1) * STEP_S == pytest.approx(wanted_s, abs=STEP_S)


def test_the_axis_that_needs_longest_sets_the_pace_of_all() -> None:
    arm = Arm(HOME)
    end = (10.0, -60.0, 90.0, 0.0, 90.0, 30.0)
    arm.begin(end, 100.0, 100.0)
    # 30 degrees of A2 are a triangle; no other axis needs as long.
    wanted_s = 2.0 * math.sqrt(30.0 / math.degrees(6.9))
    assert (len(drive(arm, {})) - 1) * STEP_S == pytest.approx(wanted_s, abs=STEP_S)


def test_a_brake_takes_the_full_acceleration_whatever_the_block_has() -> None:
    arm = Arm(HOME)
    arm.begin((150.0, *HOME[1:]), 50.0, 20.0)
    for _ in range(190):
        arm.step()
    assert arm.speed_deg_s[0] == pytest.approx(180.0)
    before = arm.joints_deg[0]
    arm.hold()
    while arm.moving:
        arm.step()
    assert arm.joints_deg[0] - before == pytest.approx(180.0**2 / 2 / math.degrees(21.7), rel=1e-4)
    assert arm.speed_deg_s == (0.0,) * 6
    assert arm.busy


def test_what_is_dropped_never_moves_later() -> None:
    arm = Arm(HOME)
    arm.begin((90.0, *HOME[1:]), 50.0, 100.0)
    for _ in range(100):
        arm.step()
    arm.drop()
    while arm.busy:
        arm.step()
    stood = arm.joints_deg
    assert 0.0 < stood[0] < 90.0
    arm.resume()
    for _ in range(100):
        arm.step()
    assert arm.joints_deg == stood
    assert arm.finished == 0
    arm.begin(HOME, 50.0, 100.0)
    assert drive(arm, {})[-1] == HOME


def test_half_the_override_takes_twice_the_time() -> None:
    times = []
    for share in (1.0, 0.5):
        arm = Arm(HOME)
        arm.override = share
        arm.step()
        arm.begin((90.0, *HOME[1:]), 50.0, 50.0)
        times.append(len(drive(arm, {})) - 1)
    assert times[1] == pytest.approx(2 * times[0], abs=2)


def test_override_0_stops_on_the_path_and_a_later_one_goes_on() -> None:
    arm = Arm(HOME)
    arm.begin((90.0, *HOME[1:]), 50.0, 100.0)
    for _ in range(60):
        arm.step()
    arm.override = 0.0
    for _ in range(200):
        arm.step()
    stood = arm.joints_deg
    assert not arm.moving
    assert arm.busy
    arm.step()
    assert arm.joints_deg == stood
    arm.override = 1.0
    assert drive(arm, {})[-1] == (90.0, *HOME[1:])


@pytest.mark.parametrize("way_deg", [0.0, 5e-324, 1e-9])
def test_a_block_to_the_present_place_ends_in_its_first_step(way_deg: float) -> None:
    arm = Arm(HOME)
    arm.begin((way_deg, *HOME[1:]), 50.0, 100.0)
    arm.override = 0.5
    arm.step()
    assert not arm.busy
    assert arm.finished == 1
    assert arm.joints_deg == (way_deg, *HOME[1:])


def test_a_target_outside_the_software_limits_and_a_second_block_are_programming_errors() -> None:
    arm = Arm(HOME)
    with pytest.raises(ValueError, match="outside the software limits"):
        arm.begin((171.0, *HOME[1:]), 50.0, 100.0)
    arm.begin((10.0, *HOME[1:]), 50.0, 100.0)
    with pytest.raises(RuntimeError, match="only after the one before"):
        arm.begin(HOME, 50.0, 100.0)
