"""The trapezoid and the choice of its speed and acceleration."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.planner.timing import Limits, TooFast, Trapezoid, fastest
from tests.planner.oracle import controller_progress

rates = st.floats(0.05, 50.0)


@given(rates, rates)
def test_progress_rises_from_0_to_1_within_speed_and_acceleration(v: float, a: float) -> None:
    law = Trapezoid(v, a)
    t = np.linspace(0.0, law.duration_s, 401)
    w = law.progress(t)
    assert w[0] == 0.0
    assert w[-1] == pytest.approx(1.0, abs=1e-9)
    step = t[1]
    rate = np.diff(w) / step
    assert np.all(rate >= -1e-9)
    assert rate.max() <= v * (1 + 1e-9)
    assert np.abs(np.diff(rate)).max() / step <= a * (1 + 1e-6)
    assert law.progress(np.array([-1.0, law.duration_s + 1.0])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("v", "a"), [(1.0, 5.0), (3.0, 2.0), (0.5, 0.5)])
def test_it_is_what_stepwise_integration_gives(v: float, a: float) -> None:
    stepped = controller_progress(v, a, 1e-4)
    law = Trapezoid(v, a)
    assert law.duration_s == pytest.approx((len(stepped) - 1) * 1e-4, abs=2e-2)
    t = np.asarray(np.arange(len(stepped)) * 1e-4, dtype=np.float64)
    np.testing.assert_allclose(law.progress(t), stepped, atol=2e-3)


def limits(speed: float = 10.0, floor: float = 0.0, acceleration: float = 100.0) -> Limits:
    return Limits(speed, floor, acceleration, np.full(9, 1.0), np.full(9, 4.0))


def test_a_straight_block_is_ruled_by_its_slowest_joint() -> None:
    joints = np.outer(np.linspace(0, 1, 101), [0.5, 2.0, 0, 0, 0, 0, 0, 0, 0])
    law = fastest(joints, limits())
    assert isinstance(law, Trapezoid)
    assert law.speed == pytest.approx(1.0 / 2.0, rel=0.003)
    assert law.acceleration == pytest.approx(4.0 / 2.0, rel=0.003)


def test_a_bent_block_keeps_the_acceleration_of_the_bend() -> None:
    w = np.linspace(0, 1, 2001)
    joints = np.zeros((2001, 9))
    joints[:, 2] = 0.05 * np.sin(20 * w)
    law = fastest(joints, limits())
    assert isinstance(law, Trapezoid)
    t = np.linspace(0, law.duration_s, 20001)
    q = 0.05 * np.sin(20 * law.progress(t))
    rate = np.gradient(q, t)
    assert np.abs(rate).max() <= 1.0
    assert np.abs(np.gradient(rate, t))[2:-2].max() <= 4.0
    assert np.abs(np.gradient(rate, t)).max() > 2.0


def test_below_the_floor_the_joint_and_its_place_are_told() -> None:
    w = np.linspace(0, 1, 1001)
    joints = np.zeros((1001, 9))
    joints[:, 3] = np.arctan((w - 0.7) * 500)
    found = fastest(joints, limits(speed=1.0, floor=0.01))
    assert isinstance(found, TooFast)
    assert (found.joint, found.what, found.limit) == (3, "speed", 1.0)
    assert found.w == pytest.approx(0.7, abs=0.01)
    assert found.value == pytest.approx(500, rel=0.1)
