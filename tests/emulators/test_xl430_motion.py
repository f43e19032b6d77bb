"""Profiles, lag and dead band of an emulated servo, against the formulas of the e-manual."""

import math
import random
import struct
from itertools import pairwise

import pytest

from sphmctl.emulators.servo_profile import RECTANGLE, TRAPEZOID, TRIANGLE, Profile
from sphmctl.emulators.xl430 import Servo

PULSES_PER_RPM = 4096 / 60
VELOCITY_DIGIT = 0.229 * PULSES_PER_RPM
ACCELERATION_DIGIT = 214.577 * 4096 / 3600
TIME_BASED = b"\x04"


class Bench:
    """One servo stepped by hand."""

    def __init__(self, seed: int = 1, start_ticks: float = 2048.0) -> None:
        self.servo = Servo(random.Random(seed), start_ticks=start_ticks)
        self.index = 0

    def set(self, address: int, size: int, value: int) -> int:
        return self.servo.write(address, value.to_bytes(size, "little", signed=value < 0))

    def get(self, address: int, size: int) -> int:
        error, data = self.servo.read(address, size)
        assert error == 0
        return int.from_bytes(data, "little", signed=True)

    def run(self, steps: int) -> list[float]:
        """True shaft angle after each of `steps` ms."""
        track = []
        for _ in range(steps):
            self.index += 1
            self.servo.step(self.index)
            track.append(self.servo.true_ticks)
        return track

    def trajectory(self, steps: int) -> list[tuple[int, int]]:
        """Position Trajectory(140) and Velocity Trajectory(136) after each of `steps` ms."""
        rows = []
        for _ in range(steps):
            self.run(1)
            rows.append((self.get(140, 4), self.get(136, 4)))
        return rows


def moving(velocity: int, acceleration: int, goal: int, start_ticks: float = 2048.0) -> Bench:
    bench = Bench(start_ticks=start_ticks)
    bench.set(64, 1, 1)
    assert bench.servo.write(108, struct.pack("<III", acceleration, velocity, goal)) == 0
    return bench


def profile_rows(profile: Profile, steps: int) -> list[tuple[float, float]]:
    rows = [(profile.position, profile.velocity)]
    for _ in range(steps):
        profile.step()
        rows.append((profile.position, profile.velocity))
    return rows


@pytest.mark.parametrize("sign", [1, -1])
def test_a_trapezoid_keeps_speed_and_acceleration_and_ends_on_the_goal(sign: int) -> None:
    # e-manual, "Profile Velocity(112)": t1 = 64 V / A ms.
    velocity, acceleration = 100, 20
    profile = Profile(0.0)
    top, a = velocity * VELOCITY_DIGIT, acceleration * ACCELERATION_DIGIT
    profile.go(sign * 3000.0, top, a)
    assert profile.kind == TRAPEZOID
    rows = profile_rows(profile, 3000)
    speeds = [sign * v for _, v in rows]
    reached = next(i for i, v in enumerate(speeds) if v >= top * (1 - 1e-6))
    assert reached == pytest.approx(64 * velocity / acceleration, abs=1.5)
    assert max(speeds) == pytest.approx(top)
    assert max(abs(b - c) for b, c in pairwise(speeds)) <= a * 1e-3 + 1e-9
    steps = [abs(q[0] - p[0]) for p, q in pairwise(rows)]
    assert max(steps) <= top * 1e-3 + 1e-9
    assert rows[-1] == (sign * 3000.0, 0.0)
    duration_s = 3000 / top + top / a
    arrived = next(i for i, (p, _) in enumerate(rows) if p == sign * 3000.0)
    assert arrived == pytest.approx(duration_s * 1000, abs=1.5)


def test_a_short_way_is_a_triangle() -> None:
    profile = Profile(100.0)
    a = 50 * ACCELERATION_DIGIT
    profile.go(200.0, 200 * VELOCITY_DIGIT, a)
    assert profile.kind == TRIANGLE
    rows = profile_rows(profile, 300)
    assert max(v for _, v in rows) == pytest.approx(math.sqrt(a * 100), rel=0.03)
    arrived = next(i for i, (p, _) in enumerate(rows) if p == 200.0)
    assert arrived == pytest.approx(2000 * math.sqrt(100 / a), abs=1.5)


def test_without_acceleration_the_profile_is_a_rectangle_and_without_velocity_a_step() -> None:
    profile = Profile(0.0)
    profile.go(-500.0, 1000.0, 0.0)
    assert profile.kind == RECTANGLE
    rows = profile_rows(profile, 501)
    assert rows[250] == pytest.approx((-250.0, -1000.0))
    assert rows[499] == pytest.approx((-499.0, -1000.0))
    assert rows[500] == (-500.0, 0.0)
    profile.go(700.0, 0.0, 99.0)
    assert (profile.position, profile.active) == (700.0, False)


@pytest.mark.parametrize("goal", [900.0, 350.0, 60.0, -800.0])
def test_a_new_goal_during_a_move_is_blended_in_without_a_jump(goal: float) -> None:
    profile = Profile(0.0)
    top, a = 1500.0, 5000.0
    profile.go(600.0, top, a)
    rows = profile_rows(profile, 200)
    profile.go(goal, top, a)
    rows += profile_rows(profile, 2500)[1:]
    for (p, v), (q, w) in pairwise(rows):
        assert abs(w - v) <= a * 1e-3 + 1e-6
        assert abs(w) <= top + 1e-6
        assert q - p == pytest.approx((v + w) / 2 * 1e-3, abs=a * 1e-6)
    assert rows[-1] == (goal, 0.0)


def test_a_blended_triangle_goes_as_fast_as_its_acceleration_allows() -> None:
    # From v0 over a way d: peak^2 = a d + v0^2 / 2, and up and down at a.
    profile = Profile(0.0)
    a, way = 5000.0, 800.0
    profile.go(3000.0, 1000.0, a)
    profile_rows(profile, 200)
    start = profile.position
    profile.go(start + way, 9000.0, a)
    rows = profile_rows(profile, 2500)
    peak = math.sqrt(a * way + 1000.0**2 / 2)
    assert max(v for _, v in rows) == pytest.approx(peak, abs=a * 1e-3)
    arrived = next(i for i, (p, _) in enumerate(rows) if p == start + way)
    assert arrived == pytest.approx((2 * peak - 1000) / a * 1000, abs=1.5)


def test_a_lower_velocity_during_a_move_is_reached_by_the_ramp() -> None:
    profile = Profile(0.0)
    profile.go(3000.0, 2000.0, 5000.0)
    profile_rows(profile, 500)
    profile.go(3000.0, 500.0, 5000.0)
    speeds = [v for _, v in profile_rows(profile, 400)]
    assert speeds[0] == pytest.approx(2000.0)
    assert speeds[150] == pytest.approx(1250.0)
    assert speeds[310] == pytest.approx(500.0)


def test_a_time_based_profile_ends_on_time_whatever_the_way() -> None:
    for way in (10.0, 400.0, -2000.0):
        profile = Profile(0.0)
        profile.go_timed(way, 0.8, 0.2)
        rows = profile_rows(profile, 800)
        assert rows[799][0] != way
        assert rows[800] == (way, 0.0)
        assert rows[200][1] == pytest.approx(way / 0.6)
        assert rows[100][1] == pytest.approx(way / 1.2)


def test_the_time_based_ramp_is_capped_at_half_the_time() -> None:
    profile = Profile(0.0)
    profile.go_timed(100.0, 0.4, 0.39)
    rows = profile_rows(profile, 400)
    assert rows[200] == pytest.approx((50.0, 500.0))


def test_registers_make_the_profile_and_report_its_trajectory() -> None:
    bench = moving(100, 20, 4000)
    rows = bench.trajectory(2000)
    speeds = [v for _, v in rows]
    assert max(speeds) == 100
    assert speeds[159] in (49, 50, 51)
    assert rows[-1] == (4000, 0)
    assert bench.get(123, 1) == 1 | 3 << 4


def test_drive_mode_bit_2_makes_the_same_registers_milliseconds() -> None:
    bench = Bench()
    assert bench.servo.write(10, TIME_BASED) == 0
    bench.set(64, 1, 1)
    assert bench.servo.write(108, struct.pack("<III", 100, 500, 3000)) == 0
    rows = bench.trajectory(500)
    assert rows[490][0] < 3000
    assert rows[499] == (3000, 0)


def test_the_shaft_trails_a_steady_profile_by_a_lag_between_15_and_40_ms() -> None:
    lags = []
    for seed in range(60):
        bench = Bench(seed, start_ticks=100.0)
        bench.set(64, 1, 1)
        bench.servo.write(108, struct.pack("<III", 0, 100, 4000))
        at_1000 = bench.run(1000)[-1]
        lags.append((bench.get(140, 4) - at_1000) / (100 * VELOCITY_DIGIT))
    assert 0.0145 < min(lags) < 0.018
    assert 0.037 < max(lags) < 0.0405


def test_the_answer_to_a_small_step_is_exponential() -> None:
    bench = Bench(start_ticks=2000.0)
    bench.set(64, 1, 1)
    bench.set(116, 4, 2060)
    errors = [2060 - p for p in bench.run(40)]
    ratios = [b / a for a, b in pairwise(errors)]
    assert max(ratios) - min(ratios) < 1e-9
    assert 15 < -1 / math.log(ratios[0]) < 40


@pytest.mark.parametrize(("start", "moves"), [(2047.2, False), (2048.9, False), (2046.8, True)])
def test_an_error_below_one_count_does_not_move_the_shaft(start: float, moves: bool) -> None:
    bench = Bench(start_ticks=start)
    bench.set(116, 4, 2048)
    bench.set(64, 1, 1)
    end = bench.run(300)[-1]
    assert (end != start) == moves
    assert abs(end - 2048) <= 1.0


def test_the_shaft_turns_at_most_at_61_rpm_and_slower_at_a_lower_voltage() -> None:
    for volts in (12.0, 9.0):
        bench = Bench(start_ticks=0.0)
        bench.servo.set_voltage(volts)
        bench.set(64, 1, 1)
        bench.set(116, 4, 4095)
        track = bench.run(400)
        top = max(q - p for p, q in pairwise(track)) * 1000
        assert top == pytest.approx(61 * PULSES_PER_RPM * volts / 12)


def test_moving_is_told_while_a_profile_goes_on_or_the_shaft_is_fast() -> None:
    bench = moving(5, 0, 2100)
    bench.run(100)
    assert bench.get(122, 1) == 1
    assert bench.get(123, 1) & 0b10 == 0b10
    bench.run(2000)
    assert bench.get(122, 1) == 0
    assert bench.get(123, 1) & 0b11 == 0b01
    assert bench.get(128, 4) == 0


def test_velocity_mode_ramps_to_its_goal_and_runs_on_past_a_turn() -> None:
    bench = Bench()
    assert bench.set(11, 1, 1) == 0
    bench.set(64, 1, 1)
    bench.set(108, 4, 10)
    bench.set(104, 4, -200)
    rows = bench.trajectory(640)
    assert rows[-1][1] in (-100, -99)
    bench.run(3000)
    assert bench.get(128, 4) == -200
    assert bench.get(132, 4) < -4096


def test_extended_position_mode_counts_beyond_a_turn() -> None:
    bench = Bench()
    assert bench.set(11, 1, 4) == 0
    bench.set(64, 1, 1)
    assert bench.set(116, 4, -9000) == 0
    bench.run(6000)
    assert bench.get(132, 4) == pytest.approx(-9000, abs=1)
    assert bench.servo.true_ticks == pytest.approx(-9000, abs=1)


def test_pwm_mode_runs_at_a_speed_in_proportion() -> None:
    bench = Bench()
    bench.set(11, 1, 16)
    bench.set(64, 1, 1)
    bench.set(100, 2, 442)
    bench.run(1000)
    assert bench.get(128, 4) == pytest.approx(61 / 2 / 0.229, abs=1)
    assert bench.get(124, 2) == 442


def test_reverse_mode_counts_the_other_way() -> None:
    bench = Bench(start_ticks=1000.0)
    assert bench.set(10, 1, 1) == 0
    assert bench.get(132, 4) == 3096
    bench.set(64, 1, 1)
    bench.set(116, 4, 3196)
    bench.run(500)
    assert bench.servo.true_ticks == pytest.approx(900, abs=1)


def test_the_homing_offset_shifts_what_is_reported_by_1024_at_most_in_position_mode() -> None:
    bench = Bench()
    bench.set(20, 4, 100)
    assert bench.get(132, 4) == 2148
    bench.set(20, 4, -5000)
    assert bench.get(132, 4) == 2048 - 1024
    bench.set(11, 1, 4)
    assert bench.get(132, 4) == 2048 - 5000
    assert bench.servo.true_ticks == 2048


def test_turns_by_hand_are_counted_until_torque_on_folds_them() -> None:
    bench = Bench()
    bench.servo.turn_by_hand(5000)
    assert bench.get(132, 4) == 7048
    bench.set(64, 1, 1)
    assert bench.get(132, 4) == 7048 - 4096
    bench.servo.turn_by_hand(100)
    assert bench.servo.true_ticks == 7048


def test_torque_on_goes_to_the_goal_that_is_still_stored() -> None:
    bench = Bench()
    bench.servo.turn_by_hand(300)
    bench.set(64, 1, 1)
    assert bench.run(1000)[-1] == pytest.approx(2048, abs=1)


def test_a_pushed_shaft_droops_against_the_p_gain_and_shows_the_load() -> None:
    bench = Bench()
    bench.set(64, 1, 1)
    bench.servo.push(0.2)
    bench.run(500)
    # 0.2 of 885 over a gain of 640 / 128 per pulse.
    assert bench.get(132, 4) == pytest.approx(2048 + 0.2 * 885 / 5, abs=1.5)
    assert bench.get(126, 2) == pytest.approx(-200, abs=20)
    assert bench.get(144, 2) < 120


def test_the_load_reading_is_noisy_at_rest_and_the_same_for_the_same_seed() -> None:
    series = []
    for seed in (1, 1, 2):
        bench = Bench(seed)
        bench.set(64, 1, 1)
        loads = []
        for _ in range(50):
            bench.run(1)
            loads.append(bench.get(126, 2))
        series.append(loads)
    assert len(set(series[0])) > 3
    assert series[0] == series[1] != series[2]
