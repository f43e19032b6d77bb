"""Plan time from measured joints, on arms that start late, pause, slow down, hold and stall."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sphmctl.daemon.follow import (
    FIRST_LEAD_S,
    HORIZON_S,
    LEAD_LIMITS_S,
    Follower,
    Lead,
    stretches,
)
from sphmctl.motion import Floats, Plan
from tests.daemon.arm_sim import BEGIN_S, Course, Seen, drive
from tests.system.rig import SIDES, STEPS, plan_of

DWELL = SIDES.replace("{ptp: P}, {ptp: S}", "{ptp: P}, {dwell_s: 0.5}, {ptp: S}, {dwell_s: 0.3}")
WRIST_ONLY = """
version: 1
name: wrist only
points:
  S: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}
  T: {joints_deg: [0, -90, 90, 0, 90, 0, 90, 70, 40]}
moves: [{ptp: S}, {ptp: T}, {ptp: S}]
"""
MIXED = """
version: 1
name: mixed
points:
  S: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}
  P: {joints_deg: [20, -80, 95, 10, 80, 15, 90, 70, 40]}
  Q: {joints_deg: [20, -80, 95, 10, 80, 15, 60, 70, 80]}
moves: [{ptp: S}, {ptp: P}, {ptp: Q}, {ptp: S}]
"""

NOISE_S = 0.002
"""Twice the error of the host times that the simulated arm is seen with."""

SEEDS = range(3)


def _runs(plan: Plan, course: Course) -> list[tuple[Follower, Seen]]:
    return [drive(plan, course, seed) for seed in SEEDS]


def _errors(plan: Plan, course: Course) -> Floats:
    result: Floats = np.abs(np.concatenate([s.errors_s() for _, s in _runs(plan, course)]))
    return result


@pytest.mark.parametrize("start_s", [0.0, 0.03, 0.3, 1.5])
def test_however_late_the_arm_starts_its_progress_is_foretold(start_s: float) -> None:
    errors = _errors(plan_of(SIDES), Course(start_s=start_s))
    assert len(errors) > 700
    assert errors.max() < NOISE_S


@pytest.mark.parametrize("gap_s", [0.0, 0.024])
def test_pauses_between_blocks_are_learnt(gap_s: float) -> None:
    plan = plan_of(STEPS)
    for _, seen in _runs(plan, Course(gap_s=gap_s)):
        errors = np.abs(seen.errors_s())
        # Foretold wrongly by the whole difference at first, hardly any more at last.
        late = errors[-len(errors) // 4 :]
        assert errors.max() < 0.012 + NOISE_S
        assert late.max() < 0.5 * errors.max()


@pytest.mark.parametrize("override", [0.2, 0.5])
def test_a_slow_override_is_followed_as_exactly(override: float) -> None:
    errors = _errors(plan_of(SIDES), Course(override=lambda t: override))
    assert errors.max() < NOISE_S


def test_a_change_of_override_is_wrong_for_a_lead_and_no_longer() -> None:
    errors = _errors(plan_of(SIDES), Course(override=lambda t: 0.5 if 0.2 < t < 0.5 else 1.0))
    # Half the speed for as long as predictions reach ahead and news travel.
    assert errors.max() < 0.5 * (0.035 + 0.017) + NOISE_S
    assert np.percentile(errors, 80) < NOISE_S


def _pause(begin_s: float, end_s: float) -> Callable[[float], bool]:
    return lambda t: begin_s < t < end_s


@pytest.mark.parametrize("held", [_pause(0.3, 2.0), _pause(0.3, 0.32), _pause(0.9, 1.4)])
def test_a_hold_stops_plan_time_and_is_followed_afterwards(held: Callable[[float], bool]) -> None:
    for _, seen in _runs(plan_of(SIDES), Course(held=held)):
        assert np.abs(seen.errors_s()).max() < 0.035 + 0.017
        passed = [(t - BEGIN_S, tau) for t, tau in seen.now]
        standing = [tau for t, tau in passed if held(t) and held(t - 0.1)]
        assert not standing or max(standing) - min(standing) < 1e-9


def test_plan_time_never_goes_backwards_by_much() -> None:
    for course in (
        Course(),
        Course(gap_s=0.024),
        Course(override=lambda t: 0.3 if 0.3 < t < 0.8 else 1.0),
        Course(held=_pause(0.3, 2.0)),
        Course(noise_s=0.003),
    ):
        for _, seen in _runs(plan_of(SIDES), course):
            steps = np.diff([tau for _, tau in seen.now])
            assert steps.min() > -0.015


def test_predictions_stay_on_the_plan_and_within_the_horizon() -> None:
    plan = plan_of(SIDES)
    for follower, seen in _runs(plan, Course()):
        told = np.array([tau for _, tau in seen.predicted])
        assert told.min() >= 0.0
        assert told.max() <= plan.duration_s + 1e-9
        assert follower.tau(1e9) == pytest.approx(plan.duration_s)
    follower = Follower(plan, BEGIN_S)
    follower.publish(2)
    joints = np.array([np.interp(0.3, plan.t, plan.joints[:, i]) for i in range(6)])
    follower.update(joints, BEGIN_S + 1.0, 0, 1.0, False)
    # A connection that stalls: the cranks go no further than the horizon.
    assert follower.tau(BEGIN_S + 60.0) == pytest.approx(0.3 + HORIZON_S, abs=0.01)


def test_nothing_is_foretold_beyond_the_last_published_knot() -> None:
    plan = plan_of(SIDES)
    follower = Follower(plan, BEGIN_S)
    follower.publish(1)
    corner_s = float(plan.t[plan.knots[0].sample])
    joints = np.array([np.interp(corner_s - 0.01, plan.t, plan.joints[:, i]) for i in range(6)])
    follower.update(joints, BEGIN_S + 1.0, 0, 1.0, False)
    assert follower.tau(BEGIN_S + 1.1) == pytest.approx(corner_s)


def test_a_standing_arm_is_foretold_to_stand() -> None:
    plan = plan_of(SIDES)
    follower = Follower(plan, BEGIN_S)
    follower.publish(2)
    for cycle in range(100):
        follower.update(plan.joints[0, :6], BEGIN_S + 0.012 * cycle, 0, 1.0, False)
        assert follower.tau(BEGIN_S + 0.012 * cycle + 0.035) == 0.0


def test_a_plan_is_cut_where_the_arm_rests() -> None:
    assert [p.sequence for p in stretches(plan_of(SIDES))] == [1, 2]
    assert [p.sequence for p in stretches(plan_of(DWELL))] == [1, 0, 2, 0]
    assert [p.sequence for p in stretches(plan_of(MIXED))] == [1, 0, 2]
    assert {p.sequence for p in stretches(plan_of(WRIST_ONLY))} == {0}
    for text in (SIDES, DWELL, MIXED, WRIST_ONLY, STEPS):
        plan = plan_of(text)
        pieces = stretches(plan)
        assert (pieces[0].first, pieces[-1].last) == (0, len(plan.t) - 1)
        assert [a.last for a in pieces[:-1]] == [b.first for b in pieces[1:]]
        for piece in pieces:
            arm = plan.joints[piece.first : piece.last + 1, :6]
            assert bool(np.ptp(arm, axis=0).max() > 1e-6) is (piece.sequence > 0)


def test_knots_beyond_a_rest_are_given_only_when_it_is_over() -> None:
    plan = plan_of(DWELL)
    corner = plan.knots[0].sample
    follower = Follower(plan, BEGIN_S)
    assert follower.open_sequence == 1
    follower.publish(1)
    follower.update(plan.joints[corner, :6], BEGIN_S + 0.8, 1, 1.0, True)
    arrived_s = BEGIN_S + 0.8
    for at_s, newest in ((0.2, 0), (0.45, 0), (0.55, 2)):
        follower.update(plan.joints[corner, :6], arrived_s + at_s, 1, 1.0, True)
        assert follower.open_sequence == newest


@pytest.mark.parametrize("text", [DWELL, MIXED])
def test_rests_pass_by_the_clock_and_the_next_block_is_followed(text: str) -> None:
    plan = plan_of(text)
    for follower, seen in _runs(plan, Course()):
        assert follower.piece is None
        assert np.abs(seen.errors_s()).max() < NOISE_S
        steps = np.diff([tau for _, tau in seen.now])
        assert steps.min() > -0.015
        assert seen.now[-1][0] - BEGIN_S < plan.duration_s + 0.3


def test_a_plan_of_the_wrist_alone_passes_by_the_clock() -> None:
    plan = plan_of(WRIST_ONLY)
    for _, seen in _runs(plan, Course()):
        told = np.array([(t - BEGIN_S, tau) for t, tau in seen.now])
        inside = told[told[:, 0] < plan.duration_s]
        assert np.abs(inside[:, 0] - inside[:, 1]).max() < 0.02


def test_the_distance_from_the_plan_is_measured_in_motion_and_at_rest() -> None:
    plan = plan_of(DWELL)
    corner = plan.knots[0].sample
    follower = Follower(plan, BEGIN_S)
    follower.publish(1)
    aside = np.radians([0.0, 0.0, 0.0, 0.0, 0.0, 2.0])
    joints = np.array([np.interp(0.3, plan.t, plan.joints[:, i]) for i in range(6)])
    follower.update(joints, BEGIN_S + 0.3, 0, 1.0, False)
    assert np.degrees(follower.off_plan_rad) == pytest.approx(0.0, abs=0.01)
    follower.update(joints + aside, BEGIN_S + 0.31, 0, 1.0, False)
    assert 1.0 < np.degrees(follower.off_plan_rad) <= 2.0
    follower.update(plan.joints[corner, :6], BEGIN_S + 0.8, 1, 1.0, True)
    assert np.degrees(follower.off_plan_rad) == pytest.approx(0.0, abs=1e-9)
    # Somebody else moves the arm while it should stand.
    follower.update(plan.joints[corner, :6] + aside, BEGIN_S + 0.9, 1, 1.0, False)
    assert np.degrees(follower.off_plan_rad) == pytest.approx(2.0)


def test_crank_rates_follow_the_override_and_vanish_at_a_hold() -> None:
    plan = plan_of(SIDES)
    follower = Follower(plan, BEGIN_S)
    follower.publish(2)
    joints = np.array([np.interp(0.3, plan.t, plan.joints[:, i]) for i in range(6)])
    follower.update(joints, BEGIN_S + 0.3, 0, 1.0, False)
    full = follower.crank_rates(0.3)
    assert full == pytest.approx(np.array([3.0, 1.0, -2.0]) * full[1], rel=1e-3)
    follower.update(joints, BEGIN_S + 0.312, 0, 0.5, False)
    assert follower.crank_rates(0.3) == pytest.approx(0.5 * full, rel=0.2)
    follower.update(joints, BEGIN_S + 0.324, 0, 0.5, True)
    assert follower.crank_rates(0.3) == pytest.approx(np.zeros(3))


def _servo(lag_s: Floats, cycles: int, noise_rad: float = 0.0) -> Lead:
    """Learn from servos that trail their goals by fixed lags on cranks at 40 degrees a second."""
    rng = np.random.default_rng(1)
    lead = Lead()
    rates = np.radians([40.0, -40.0, 20.0])
    sent: list[Floats] = []
    for cycle in range(cycles):
        now_s = 0.01 * cycle
        sent.append(lead.seconds.copy())
        # What a servo does now comes from goals that were sent a lag ago.
        used = sent[max(0, cycle - 4)]
        required = rates * now_s
        measured = rates * (now_s + used - lag_s) + noise_rad * rng.standard_normal(3)
        lead.update(required, measured, rates)
    return lead


def test_each_servo_s_lead_is_learnt_by_itself() -> None:
    lags = np.array([0.015, 0.030, 0.055])
    lead = _servo(lags, 100)
    assert lead.seconds == pytest.approx(lags, abs=0.002)


def test_counts_and_noise_do_not_carry_a_lead_away() -> None:
    lags = np.array([0.015, 0.030, 0.055])
    lead = _servo(lags, 600, noise_rad=np.radians(0.09))
    assert lead.seconds == pytest.approx(lags, abs=0.004)


def test_a_lead_stays_within_what_a_servo_can_be() -> None:
    assert _servo(np.array([-1.0, 1.0, 1.0]), 400).seconds == pytest.approx(
        [LEAD_LIMITS_S[0], LEAD_LIMITS_S[1], LEAD_LIMITS_S[1]]
    )


def test_slow_cranks_and_silent_servos_teach_nothing() -> None:
    lead = Lead()
    for _ in range(100):
        lead.update(np.zeros(3), np.array([0.1, np.nan, 0.1]), np.radians([4.9, 40.0, -4.9]))
    assert lead.seconds == pytest.approx([FIRST_LEAD_S] * 3)
