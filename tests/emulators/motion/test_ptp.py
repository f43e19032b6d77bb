"""PTP from rest to rest, and blends between PTPs."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.emulators.motion import Apo, AxisLimitError, Block, Kind, MotionError, Options
from sphmctl.emulators.motion.blend import join
from sphmctl.emulators.motion.profile import Profile
from sphmctl.emulators.motion.run import plan
from tests.emulators.motion.rig import HOME, STEP_S, Rig, Row, plus, ptp

FULL = Apo(cptp_percent=100.0)
BLEND = ("C_PTP",)
AXES = st.tuples(
    *[
        st.floats(low, high)
        for low, high in (
            (-170, 170),
            (-190, 45),
            (-120, 156),
            (-185, 185),
            (-120, 120),
            (-350, 350),
        )
    ]
)


def begun(rig: Rig) -> None:
    """Let the first block begin: it is planned and enters."""
    rig.until(lambda: rig.mover.running is not None)


def test_a_long_ptp_takes_way_over_speed_plus_ramp_plus_filter() -> None:
    # By hand: A1 90 deg at 360 deg/s and 2400 deg/s2 is 0.25 s + 0.15 s, and 0.096 s of filter.
    rig = Rig()
    rig.mover.feed(ptp(plus(HOME, 90.0)))
    rig.rest()
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(0.25 + 0.15 + 0.096, abs=1e-9)
    assert rig.mover.joints_deg == plus(HOME, 90.0)


def test_a_short_ptp_takes_four_ramps_of_its_triangle() -> None:
    # 2 deg at 2400 deg/s2: peak sqrt(2 * 2400 / 2) = 49 deg/s, ramp 20.4 ms, as long to build up.
    rig = Rig()
    rig.mover.feed(ptp(plus(HOME, 2.0)))
    rig.rest()
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(4.0 * math.sqrt(2.0 * 2400.0 / 2.0) / 2400.0, abs=1e-9)


def test_percents_of_speed_and_acceleration_scale_the_leading_axis() -> None:
    # 60 deg at 36 deg/s is 1.6667 s; the ramp at 1200 deg/s2 is 0.03 s, and so is the build-up.
    rig = Rig()
    rig.mover.feed(ptp(plus(HOME, 60.0, 5.0, 1.0), velocity=10.0, acceleration=50.0))
    rig.rest()
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(60.0 / 36.0 + 0.03 + 0.03, abs=1e-9)


def test_all_axes_leave_and_arrive_together_on_a_line_in_axis_space() -> None:
    rig = Rig()
    steps = (40.0, 20.0, -30.0, 10.0, -5.0, 100.0)
    rig.mover.feed(ptp(plus(HOME, *steps)))
    rig.rest()
    for row in rig.rows:
        shares = [(q - h) / s for q, h, s in zip(row, HOME, steps, strict=True)]
        assert max(shares) - min(shares) < 1e-9


@settings(max_examples=30, deadline=None)
@given(AXES, AXES, st.floats(5.0, 100.0), st.floats(5.0, 100.0))
def test_a_ptp_keeps_speed_and_acceleration_of_every_axis(
    start: Row, end: Row, velocity: float, acceleration: float
) -> None:
    rig = Rig(start)
    rig.mover.feed(ptp(end, velocity=velocity, acceleration=acceleration))
    rig.rest()
    rig.assert_smooth(acceleration / 100.0, velocity / 100.0)
    assert rig.mover.joints_deg == pytest.approx(end, abs=2e-7)


@pytest.mark.parametrize("filter_s", [0.0, 0.01, 0.096])
@pytest.mark.parametrize(("speed", "acceleration"), [(1.0, 5.0), (10.0, 5.0), (0.1, 100.0)])
def test_a_profile_is_the_integral_of_its_speed_and_acceleration(
    filter_s: float, speed: float, acceleration: float
) -> None:
    profile = Profile.plan(speed, acceleration, filter_s)
    steps, h = 1000, 1e-7
    for k in range(1, steps):
        t_s = k * profile.duration_s / steps
        way, v, a = profile.at(t_s)
        before, after = profile.at(t_s - h), profile.at(t_s + h)
        assert (after[0] - before[0]) / (2 * h) == pytest.approx(v, abs=1e-4 * speed)
        if filter_s:
            assert (after[1] - before[1]) / (2 * h) == pytest.approx(a, abs=1e-3 * acceleration)
        assert 0.0 < way < 1.0
        assert v <= speed * (1 + 1e-9)
        assert abs(a) <= acceleration * (1 + 1e-9)


def test_equal_blocks_in_line_keep_their_speed_through_the_knots() -> None:
    rig = Rig()
    for k in range(1, 6):
        rig.mover.feed(ptp(plus(HOME, 10.0 * k), k, 20.0, words=BLEND, apo=FULL))
    rig.rest()
    # From the first cruise on to the last one: 20 % of 360 deg/s.
    inner = [row[0] for row in rig.speeds() if row[0] > 8.0]
    fast = [v for v in inner if v > 71.9]
    assert len(fast) * STEP_S > 0.5
    speeds = [row[0] for row in rig.speeds()]
    middle = speeds[speeds.index(fast[0]) : len(speeds) - speeds[::-1].index(fast[-1])]
    assert min(middle) > 72.0 * 0.999
    assert max(speeds) <= 72.0 * (1 + 1e-9)


def corner(angle_deg: float, way_deg: float = 20.0, percent: float = 100.0) -> Rig:
    """Two equal blocks of A1 and A3, which are equally strong, that meet at an angle."""
    rig = Rig()
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    knot = plus(HOME, way_deg)
    apo = Apo(cptp_percent=percent)
    rig.mover.feed(ptp(knot, 1, words=BLEND, apo=apo))
    rig.mover.feed(ptp(plus(knot, way_deg * c, 0.0, way_deg * s), 2, apo=apo))
    rig.rest()
    return rig


@pytest.mark.parametrize("angle_deg", [20.0, 60.0, 90.0])
def test_a_blend_passes_the_knot_no_farther_than_half_the_chord(angle_deg: float) -> None:
    rig = corner(angle_deg)
    missed = min(math.hypot(r[0] - HOME[0] - 20.0, r[2] - HOME[2]) for r in rig.rows)
    # Depth of the cut: d/2 sin(phi/2) for a straight cut, half of it for a parabola.
    chord = 20.0 / 2.0 * math.sin(math.radians(angle_deg) / 2.0)
    assert 0.2 * chord < missed <= chord
    assert rig.kinds(Kind.BLENDED) == [(Kind.BLENDED, 1)]


@pytest.mark.parametrize("percent", [10.0, 25.0, 50.0, 100.0])
def test_cptp_is_percent_of_half_the_block(percent: float) -> None:
    rig = corner(90.0, percent=percent)
    # Before the zone only A1 moves, behind it only A3; one step is up to 0.9 deg.
    begin = min(r[0] - HOME[0] for r in rig.rows if r[2] > HOME[2])
    end = max(r[2] - HOME[2] for r in rig.rows if r[0] - HOME[0] < 20.0)
    zone = 10.0 * percent / 100.0
    assert 20.0 - zone <= begin < 20.0 - zone + 1.0
    assert zone - 1.0 < end <= zone


def test_the_end_of_a_blend_obeys_the_next_blocks_apo() -> None:
    line = Options()
    wide = plan(ptp(plus(HOME, 20.0), 1, words=BLEND, apo=FULL), HOME, line, False)
    narrow = Apo(cptp_percent=4.0)
    second = plan(
        ptp(plus(HOME, 20.0, 0.0, 20.0), 2, apo=narrow), wide.contour.end_deg, line, False
    )
    overlap_s, _ = join(wide, second, line)
    assert second.profile.at(overlap_s)[0] == pytest.approx(0.02, abs=1e-6)


def test_a_blend_is_never_longer_than_90_degrees_of_an_axis() -> None:
    line = Options()
    start = (-170.0, -90.0, 90.0, 0.0, 90.0, -350.0)
    first = plan(
        ptp(plus(start, 0, 0, 0, 0, 0, 690.0), 1, words=BLEND, apo=FULL), start, line, False
    )
    then = plan(ptp(start, 2, apo=FULL), first.contour.end_deg, line, False)
    overlap_s, _ = join(first, then, line)
    assert 690.0 * (1.0 - first.profile.at(first.profile.duration_s - overlap_s)[0]) <= 90.0


@settings(max_examples=30, deadline=None)
@given(st.lists(AXES, min_size=3, max_size=5), st.floats(1.0, 100.0), st.floats(10.0, 100.0))
def test_blends_are_smooth_whatever_the_corner(
    targets: list[Row], cptp: float, percent: float
) -> None:
    rig = Rig()
    for k, target in enumerate(targets):
        apo = Apo(cptp_percent=cptp)
        rig.mover.feed(ptp(target, k, percent, percent, BLEND, apo))
    rig.rest()
    rig.assert_smooth(percent / 100.0, percent / 100.0)
    assert rig.mover.joints_deg == pytest.approx(targets[-1], abs=1e-6)


@pytest.mark.parametrize(
    ("blocks", "reason"),
    [
        ([ptp(plus(HOME, 10.0), 1, words=BLEND)], "no next block in time"),
        (
            [ptp(plus(HOME, 10.0), 1, words=BLEND), ptp(plus(HOME, 10.0), 2)],
            "a block without way",
        ),
        (
            [ptp(plus(HOME, 10.0), 1, words=BLEND), ptp(plus(HOME, 10.05), 2)],
            "a block too short to be planned in time",
        ),
        (
            [ptp(plus(HOME, 10.0), 1, words=BLEND, apo=Apo(0.0)), ptp(HOME, 2)],
            "$APO is 0",
        ),
    ],
)
def test_a_blend_silently_becomes_an_exact_stop(blocks: list[Block], reason: str) -> None:
    rig = Rig()
    for block in blocks:
        rig.mover.feed(block)
    rig.rest()
    assert rig.first(Kind.EXACT_STOP, 1).detail == reason
    assert rig.kinds(Kind.BLENDED) == []


def test_a_next_block_that_comes_after_the_blend_should_have_begun_is_too_late() -> None:
    rig = Rig()
    rig.mover.feed(ptp(plus(HOME, 30.0), 1, words=BLEND, apo=FULL))
    begun(rig)
    rig.until(lambda: rig.mover.joints_deg[0] > 25.0)
    rig.mover.feed(ptp(plus(HOME, 60.0), 2))
    rig.rest()
    assert rig.first(Kind.EXACT_STOP, 1).detail == "next block planned too late"
    assert min(abs(r[0] - 30.0) for r in rig.rows) < 1e-9


def test_a_next_block_fed_in_time_is_blended() -> None:
    rig = Rig()
    rig.mover.feed(ptp(plus(HOME, 30.0), 1, words=BLEND, apo=FULL))
    begun(rig)
    rig.go(0.02)
    rig.mover.feed(ptp(plus(HOME, 60.0), 2))
    rig.rest()
    assert rig.kinds(Kind.EXACT_STOP) == []


def test_a_block_is_needed_plan_time_before_the_blend() -> None:
    rig = Rig(options=Options(plan_s=0.5))
    rig.mover.feed(ptp(plus(HOME, 30.0), 1, words=BLEND, apo=FULL))
    begun(rig)
    rig.mover.feed(ptp(plus(HOME, 60.0), 2))
    rig.rest()
    assert rig.first(Kind.EXACT_STOP, 1).detail == "next block planned too late"


def test_a_target_beyond_a_software_limit_is_refused_and_told() -> None:
    rig = Rig()
    with pytest.raises(AxisLimitError, match=r"A2 = 46\.000 deg is beyond its limit"):
        rig.mover.feed(ptp((0.0, 46.0, 90.0, 0.0, 90.0, 0.0), 5))
    assert rig.kinds() == [(Kind.AXIS_LIMIT, 5)]
    assert rig.mover.queued == 0


@pytest.mark.parametrize("percent", [0.0, -5.0, 101.0, math.nan])
def test_a_percent_outside_1_to_100_is_refused(percent: float) -> None:
    rig = Rig()
    with pytest.raises(MotionError, match=r"\$VEL_AXIS\[1\]"):
        rig.mover.feed(ptp(HOME, velocity=percent))


def test_a_stream_of_knots_every_60_ms_runs_through_without_a_stop() -> None:
    rig = Rig()
    fed = 0
    while fed < 40 or rig.mover.running is not None:
        while fed < 40 and rig.mover.queued < 3:
            fed += 1
            # 1 deg in 60 ms on a slow circle of A1 and A3.
            turn = math.radians(3.0 * fed)
            knot = plus(HOME, 19.1 * math.sin(turn), 0.0, 19.1 * (1.0 - math.cos(turn)))
            rig.mover.feed(ptp(knot, fed, 100.0 / 360.0 / 6.0 * 100.0, words=BLEND, apo=FULL))
        rig.go(STEP_S)
    rig.rest()
    finished = [e.time_s for e in rig.events if e.kind is Kind.FINISHED]
    periods = [b - a for a, b in pairwise(finished)][1:-1]
    assert min(periods) > 0.04
    assert max(periods) < 0.065
    begin, end = (round((t - rig.start_s) / STEP_S) for t in (finished[0], finished[-2]))
    speeds = [math.hypot(v[0], v[2]) for v in rig.speeds()][begin:end]
    assert min(speeds) > 15.0
    assert rig.kinds(Kind.EXACT_STOP) == [(Kind.EXACT_STOP, 40)]
