"""Bounds of the offset between both clocks: they contain the true one, whatever the phases."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.drivers.device_clock import CRYSTAL_DRIFT, DeviceClock
from sphmctl.drivers.krc_interface import CYCLE_S


def _reply(
    rng: random.Random, asked_s: float, offset_s: float, rate: float = 1.0
) -> tuple[float, float, float]:
    """Stamp, sent and received of one read: sampled inside, stamped at the cycle before."""
    service_s = rng.choice((0.0022, 0.0045)) + rng.uniform(-3e-4, 3e-4)
    sampled_s = asked_s + rng.uniform(0.0, 1.0) * service_s
    controller_s = (sampled_s - offset_s) * rate
    return math.floor(controller_s / CYCLE_S) * CYCLE_S, asked_s, asked_s + service_s


@given(
    seed=st.integers(0, 2**32),
    offset_s=st.floats(-1e4, 1e4),
    begin_s=st.floats(10.0, 1e5),
)
def test_the_bounds_contain_the_true_offset_for_any_phase(
    seed: int, offset_s: float, begin_s: float
) -> None:
    rng = random.Random(seed)
    clock = DeviceClock(CYCLE_S)
    now_s = begin_s
    for _ in range(60):
        stamp_s, sent_s, received_s = _reply(rng, now_s, offset_s)
        clock.update(stamp_s, sent_s, received_s)
        error_s = clock.host_s(stamp_s) - stamp_s - offset_s
        assert abs(error_s) <= clock.window_s / 2 + 1e-6
        now_s = received_s + rng.uniform(0.0, 0.005)
    assert clock.window_s < CYCLE_S


def test_many_replies_leave_a_window_of_about_a_service_time() -> None:
    errors = []
    for seed in range(20):
        rng = random.Random(seed)
        clock = DeviceClock(CYCLE_S)
        now_s = 1000.0
        for _ in range(300):
            stamp_s, sent_s, received_s = _reply(rng, now_s, 123.4567)
            clock.update(stamp_s, sent_s, received_s)
            now_s = received_s + rng.uniform(0.0, 0.002)
        errors.append(abs(clock.host_s(0.0) - 123.4567))
        assert clock.window_s < 0.004
    assert max(errors) < 0.002


@pytest.mark.parametrize("ppm", [-150.0, 150.0])
def test_a_drifting_crystal_stays_within_the_bounds(ppm: float) -> None:
    rng = random.Random(7)
    clock = DeviceClock(CYCLE_S)
    rate = 1.0 + ppm * 1e-6
    now_s = 1000.0
    for index in range(20_000):
        stamp_s, sent_s, received_s = _reply(rng, now_s, 0.0, rate)
        clock.update(stamp_s, sent_s, received_s)
        if index > 100:
            assert abs(clock.host_s(stamp_s) - stamp_s / rate) < 0.006
        now_s = received_s + 0.01
    assert CRYSTAL_DRIFT >= 150e-6


@pytest.mark.parametrize("step_s", [-3600.0, -0.05, 0.05, 3600.0])
def test_a_clock_that_was_set_is_learnt_anew(step_s: float) -> None:
    rng = random.Random(3)
    clock = DeviceClock(CYCLE_S)
    now_s = 1000.0
    offset_s = 5.0
    for index in range(200):
        if index == 100:
            offset_s += step_s
        stamp_s, sent_s, received_s = _reply(rng, now_s, offset_s)
        clock.update(stamp_s, sent_s, received_s)
        assert abs(clock.host_s(stamp_s) - stamp_s - offset_s) <= 0.01
        now_s = received_s


def test_one_reply_is_enough_for_a_first_estimate() -> None:
    clock = DeviceClock(CYCLE_S)
    clock.update(60.0, 1000.0, 1000.004)
    # Between 1000.000 - 0.012 and 1000.004: the middle.
    assert clock.host_s(60.0) == pytest.approx(999.996)
    assert clock.window_s == pytest.approx(0.016)
