"""The time law: limits of the stream by plain differences, closed forms, and what it promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.planner.timelaw import LABELS, Bounds, Stuck, TimeLaw, time_law
from tests.planner.timing_paths import (
    ACCELERATIONS,
    SPEEDS,
    Floats,
    Way,
    bounds,
    octagon,
    rounded_square,
    stream_use,
    waves,
)

ALLOWED = 1.005
FREE = np.full(9, np.inf)


def timed(way: Way, limits: Bounds, filter_s: float = 0.0, stops: tuple[int, ...] = ()) -> TimeLaw:
    law = time_law(way.joints, way.s, way.tool, limits, way.cuts, stops, filter_s)
    assert isinstance(law, TimeLaw)
    return law


def straight(joint: int, angle: float, rows: int = 2) -> Way:
    def at(s: Floats) -> tuple[Floats, Floats]:
        joints = np.zeros((len(s), 9))
        joints[:, joint] = angle * s
        return joints, np.zeros((len(s), 3))

    return Way(np.linspace(0.0, 1.0, rows), at)


def one_joint(speed: float, acceleration: float) -> Bounds:
    return Bounds(np.full(9, speed), np.full(9, acceleration))


seeds = st.integers(0, 10**6)
filters = st.sampled_from([0.0, 0.020, 0.024, 0.040])


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(300, 900), filters, st.integers(1, 9))
def test_no_sample_of_a_smooth_path_is_beyond_a_joints_limits(
    seed: int, rows: int, filter_s: float, moving: int
) -> None:
    way = waves(seed, rows, moving)
    law = timed(way, bounds(), filter_s)
    assert stream_use(law, way, bounds())[:2].max() <= ALLOWED
    assert law.stretch == 1.0
    assert law.optimal_s + filter_s <= law.duration_s * (1 + 1e-9)


@pytest.mark.parametrize("filter_s", [0.0, 0.024])
@pytest.mark.parametrize(
    ("radius_m", "side_m", "tool_speed", "tool_acceleration"),
    [
        (0.02, 0.1, 0.1, 0.5),
        (0.02, 0.1, 0.25, 2.0),
        (0.005, 0.1, 0.25, 2.0),
        (0.005, 0.1, 0.5, 20.0),
        (0.02, 0.2, 1.0, np.inf),
    ],
)
def test_no_sample_of_a_path_with_jumps_of_curvature_is_beyond_any_limit(
    radius_m: float, side_m: float, tool_speed: float, tool_acceleration: float, filter_s: float
) -> None:
    way = rounded_square(radius_m, side_m, 0.0005)
    limits = bounds(tool_speed, tool_acceleration)
    law = timed(way, limits, filter_s)
    use = stream_use(law, way, limits)
    print(f"{law.summary()}; {law.rounds} rounds, use {use.round(4)}")
    assert use.max() <= ALLOWED
    assert use.max() >= 0.97
    assert law.duration_s <= 1.06 * law.optimal_s + filter_s


@pytest.mark.parametrize("filter_s", [0.0, 0.024])
@pytest.mark.parametrize("tool", [(0.1, 0.5), (1.0, 10.0), (np.inf, np.inf)])
def test_the_octagon_keeps_its_limits_and_stands_at_each_corner(
    tool: tuple[float, float], filter_s: float
) -> None:
    way = octagon(0.001)
    limits = bounds(*tool)
    law = timed(way, limits, filter_s, way.cuts)
    print(law.summary())
    assert stream_use(law, way, limits).max() <= ALLOWED
    corners = law.sample(law.t(way.s[list(way.cuts)]))
    np.testing.assert_allclose(corners[1], 0.0, atol=1e-4)
    assert law.duration_s == pytest.approx(law.optimal_s + 8 * filter_s, rel=0.02)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 7, 101])
@pytest.mark.parametrize("filter_s", [0.0, 0.03])
def test_a_straight_way_takes_the_time_of_the_trapezoid(rows: int, filter_s: float) -> None:
    for angle, speed, acceleration in ((1.0, 0.5, 2.0), (1.0, 5.0, 2.0), (1e-3, 5.0, 60.0)):
        ramp = min(speed / acceleration, np.sqrt(angle / acceleration))
        expected = angle / (ramp * acceleration) + ramp
        law = timed(straight(4, angle, rows), one_joint(speed, acceleration), filter_s)
        assert law.duration_s == pytest.approx(expected + filter_s, rel=4e-3)
        assert law.duration_s >= expected + filter_s - 1e-9
        assert law.optimal_s == pytest.approx(expected, rel=4e-3)


@settings(max_examples=20, deadline=None)
@given(seeds, filters)
def test_s_rises_from_rest_to_rest_and_its_derivatives_are_its_derivatives(
    seed: int, filter_s: float
) -> None:
    law = timed(waves(seed, 400), bounds(), filter_s)
    t = np.linspace(-0.01, law.duration_s + 0.01, 20_001)
    s, speed, acceleration = law.sample(t)
    np.testing.assert_array_equal(s, law.s(t))
    assert (s[0], s[-1]) == (0.0, 1.0)
    assert np.diff(s).min() >= -1e-12
    step = t[1] - t[0]
    outside = (t < 0.0) | (t > law.duration_s)
    np.testing.assert_allclose(speed[outside], 0.0, atol=1e-9)
    np.testing.assert_allclose(acceleration[outside], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.gradient(s, step), speed, atol=step * np.abs(acceleration).max())
    change = np.abs(np.gradient(speed, step) - acceleration)
    assert np.quantile(change, 0.9) <= 1e-3 * np.abs(acceleration).max()


@settings(max_examples=20, deadline=None)
@given(seeds, filters)
def test_t_is_the_inverse_of_s(seed: int, filter_s: float) -> None:
    way = waves(seed, 200)
    law = timed(way, bounds(), filter_s, (50, 120))
    s = np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, 500))
    s = np.concatenate([s, way.s])
    np.testing.assert_allclose(law.s(law.t(s)), s, atol=1e-11)
    t = np.linspace(0.0, law.duration_s, 101)
    np.testing.assert_allclose(law.t(law.s(t)), t, atol=1e-4)


@settings(max_examples=20, deadline=None)
@given(seeds, st.sampled_from([0.020, 0.024, 0.040]))
def test_the_filter_bounds_the_jerk_by_twice_the_acceleration_over_its_length(
    seed: int, filter_s: float
) -> None:
    way = waves(seed, 400)
    law, sharp = timed(way, bounds(), filter_s), timed(way, bounds())
    step = 1e-4
    t = np.arange(0.0, law.duration_s, step)
    jerk = np.abs(np.diff(law.sample(t)[1], 2)) / step**2
    limit = 2.0 * np.abs(law.pieces.acceleration).max() / filter_s
    assert jerk.max() <= limit * (1 + 1e-6)
    assert np.abs(law.pieces.jerk(t)).max() == pytest.approx(jerk.max(), rel=0.1)
    sharper = np.abs(np.diff(sharp.sample(t)[1], 2)) / step**2
    assert sharper.max() > 5.0 * jerk.max()


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_the_way_back_takes_as_long(seed: int) -> None:
    way = waves(seed, 600)
    back = time_law(way.joints[::-1], way.s, way.tool, bounds(), filter_s=0.0)
    assert isinstance(back, TimeLaw)
    assert back.duration_s == pytest.approx(timed(way, bounds()).duration_s, rel=2e-3)


@settings(max_examples=15, deadline=None)
@given(seeds, st.floats(0.1, 1.0))
def test_slower_by_a_factor_is_the_same_law_and_slower_limits_give_it(
    seed: int, share: float
) -> None:
    way = waves(seed, 300)
    law = timed(way, bounds(), 0.024)
    slow = law.slowed(1.0 / share)
    assert slow.duration_s == pytest.approx(law.duration_s / share)
    t = np.linspace(0.0, law.duration_s, 50)
    np.testing.assert_allclose(slow.s(t / share), law.s(t), atol=1e-9)
    np.testing.assert_allclose(slow.sample(t / share)[1], share * law.sample(t)[1], atol=1e-6)
    lower = Bounds(SPEEDS * share, ACCELERATIONS * share**2)
    assert timed(way, lower).duration_s == pytest.approx(timed(way, bounds()).duration_s / share)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(0, 8))
def test_no_tighter_limit_makes_it_faster(seed: int, joint: int) -> None:
    way = waves(seed, 300)
    tight = ACCELERATIONS.copy()
    tight[joint] *= 0.3
    free = timed(way, bounds()).duration_s
    assert timed(way, Bounds(SPEEDS, tight)).duration_s >= free * (1 - 2e-3)


def test_a_stop_is_two_laws_one_after_the_other() -> None:
    way = waves(7, 401)
    whole = timed(way, bounds(), 0.024, (160,))
    joints, tool = way.joints, way.tool
    cut = replace(way, cuts=(160,))
    assert whole.duration_s == timed(cut, bounds(), 0.024, (160,)).duration_s
    halves = [
        time_law(joints[part], way.s[part], tool[part], bounds())
        for part in (slice(0, 161), slice(160, 401))
    ]
    first, second = (half for half in halves if isinstance(half, TimeLaw))
    assert whole.duration_s == pytest.approx(first.duration_s + second.duration_s, rel=1e-6)
    assert float(whole.t(way.s[160:161])[0]) == pytest.approx(first.duration_s, abs=1e-4)


def test_a_turn_is_driven_at_the_speed_its_acceleration_allows() -> None:
    way = rounded_square(0.02, 0.1, 0.0005)
    limits = Bounds(FREE, FREE, 1.0, 2.0)
    law = timed(way, limits)
    middle = 0.06 + np.pi * 0.02 / 4.0
    assert law.sample(law.t(np.array([middle])))[1][0] == pytest.approx(
        np.sqrt(2.0 * 0.02), rel=0.02
    )
    assert stream_use(law, way, limits, 3)[3] == pytest.approx(1.0, abs=0.005)


def test_each_interval_keeps_its_own_tool_limits() -> None:
    s = np.linspace(0.0, 1.0, 201)
    tool = np.column_stack([s, 0.0 * s, 0.0 * s])
    limits = np.repeat([0.1, 0.3], 100)
    law = time_law(np.zeros((201, 9)), s, tool, Bounds(FREE, FREE, limits, 10.0), filter_s=0.0)
    assert isinstance(law, TimeLaw)
    speed = law.sample(law.t(s))[1]
    assert speed[1:100] == pytest.approx(0.1)
    assert speed[110:190] == pytest.approx(0.3)
    assert law.duration_s == pytest.approx(0.5 / 0.1 + 0.5 / 0.3, rel=0.02)


def test_it_says_what_binds_where_and_for_how_long() -> None:
    way = straight(1, 1.0, 51)
    law = timed(way, one_joint(0.5, 2.0))
    names = [LABELS[i] for i in law.binding]
    assert names[:3] == names[-3:] == ["A2 acceleration"] * 3
    assert names[5:-5] == ["A2 speed"] * 41
    shares = dict(law.shares())
    assert shares["A2 acceleration"] == pytest.approx(0.5 / law.duration_s, abs=0.02)
    assert sum(shares.values()) == pytest.approx(1.0)
    fine = timed(straight(1, 1.0, 1001), one_joint(0.5, 2.0))
    assert fine.summary() == (
        "2.25 s (2.25 s without jerk limit); A2 speed binds 78%, A2 acceleration 22% of the time"
    )
    smooth = timed(straight(1, 1.0, 1001), one_joint(0.5, 2.0), 0.024)
    assert "2.27 s (2.25 s without jerk limit)" in smooth.summary()
    assert dict(smooth.shares())["smoothing"] < 0.1


def test_the_tool_is_named_when_it_binds() -> None:
    law = timed(rounded_square(0.02, 0.1, 0.0005), bounds(0.25, 2.0))
    shares = dict(law.shares())
    assert set(shares) <= {"tool speed", "tool acceleration", "none"}
    assert law.use.shape == (len(law.binding), 20)
    assert law.use.max() <= 1.01


@pytest.mark.parametrize("kind", ["speed", "acceleration"])
def test_a_limit_of_zero_holds_a_joint_that_has_to_move_and_no_other(kind: str) -> None:
    way = waves(3, 100, moving=4)
    for joint, name in ((2, "A3"), (6, "theta7")):
        speeds, accelerations = SPEEDS.copy(), ACCELERATIONS.copy()
        (speeds if kind == "speed" else accelerations)[joint] = 0.0
        law = time_law(way.joints, way.s, way.tool, Bounds(speeds, accelerations))
        if joint == 2:
            assert law == Stuck(0, name, kind, 0.0)
        else:
            assert isinstance(law, TimeLaw)


def test_a_tool_that_may_not_move_is_told_with_its_row() -> None:
    s = np.linspace(0.0, 1.0, 51)
    tool = np.column_stack([s, s, s])
    allowed = np.where(np.arange(50) < 30, 1.0, 0.0)
    law = time_law(np.zeros((51, 9)), s, tool, Bounds(FREE, FREE, allowed, 1.0))
    assert law == Stuck(30, "tool", "speed", 0.0)


def test_without_any_limit_the_whole_path_takes_a_millisecond_and_the_filter() -> None:
    for way in (waves(1, 500), straight(3, 0.0, 20)):
        law = timed(way, Bounds(FREE, FREE), 0.024)
        assert law.duration_s == pytest.approx(0.025, abs=1e-4)
    one = timed(waves(1, 300, moving=1), Bounds(FREE, ACCELERATIONS))
    assert dict(one.shares())["A1 acceleration"] > 0.9


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_a_path_without_length_is_over_at_once(rows: int) -> None:
    law = time_law(np.ones((rows, 9)), np.full(rows, 0.3), np.zeros((rows, 3)), bounds())
    assert isinstance(law, TimeLaw)
    assert (law.duration_s, law.optimal_s, law.shares()) == (0.0, 0.0, [])
    assert law.s(np.array([-1.0, 0.0, 2.0])).tolist() == [0.3] * 3
    assert law.t(np.array([0.3])).tolist() == [0.0]
    assert [LABELS[i] for i in law.binding] == ["none"] * rows


def test_rows_are_told_that_cannot_be_a_path() -> None:
    way = waves(1, 10)
    joints = way.joints
    joints[4, 2] = np.nan
    with pytest.raises(ValueError, match="row 4 is not finite"):
        time_law(joints, way.s, way.tool, bounds())
    s = way.s.copy()
    s[6] = s[5]
    with pytest.raises(ValueError, match="s does not rise after row 5"):
        time_law(way.joints, s, way.tool, bounds())
    with pytest.raises(ValueError, match="do not fit"):
        time_law(way.joints[:-1], way.s, way.tool, bounds())
    with pytest.raises(ValueError, match=r"a filter of -0\.1 s"):
        time_law(way.joints, way.s, way.tool, bounds(), filter_s=-0.1)


def test_a_path_of_a_hundred_thousand_rows_is_timed_as_one_of_a_thousand() -> None:
    few, many = timed(waves(5, 1_000), bounds()), timed(waves(5, 100_000), bounds())
    assert many.duration_s == pytest.approx(few.duration_s, rel=3e-3)


def test_rounding_of_the_joints_does_not_slow_it_down() -> None:
    way = rounded_square(0.02, 0.1, 0.0002)
    noise = np.random.default_rng(1).normal(scale=1e-12, size=way.joints.shape)
    clean = timed(way, bounds(0.25, 2.0), 0.024)
    rough = time_law(way.joints + noise, way.s, way.tool, bounds(0.25, 2.0), way.cuts)
    assert isinstance(rough, TimeLaw)
    assert rough.duration_s == pytest.approx(clean.duration_s, rel=1e-3)
