"""Override, brakes, stops, discard, drives, T1 and the block coincidence run."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from sphmctl.emulators.motion import Apo, Block, Kind, Lin, MotionError, Options, PathSpeed, Ptp
from sphmctl.emulators.motion.figures import TABLE
from sphmctl.emulators.motion.frames import chained, pose_of
from sphmctl.emulators.motion.kinematics import forward
from tests.emulators.motion.rig import ACCELERATION_DEG_S2, HOME, STEP_S, Rig, Row, plus, ptp

FULL = Apo(cptp_percent=100.0)
KNOTS = [
    plus(HOME, 20.0),
    plus(HOME, 35.0, 15.0, -10.0),
    plus(HOME, 35.0, 30.0, -30.0, 20.0),
    plus(HOME, 10.0, 30.0, -40.0, 20.0, 10.0),
]


def stream(rig: Rig) -> None:
    for k, knot in enumerate(KNOTS, start=1):
        rig.mover.feed(ptp(knot, k, 50.0, words=("C_PTP",), apo=FULL))


def distance_to_curve(point: Row, curve: list[Row]) -> float:
    """Greatest axis difference to the nearest point of a polyline's corners and chords."""
    best = math.inf
    for a, b in pairwise(curve):
        d = [q - p for p, q in zip(a, b, strict=True)]
        square = sum(x * x for x in d)
        along = sum((x - p) * y for x, p, y in zip(point, a, d, strict=True))
        share = min(1.0, max(0.0, along / square)) if square else 0.0
        off = max(abs(x - p - share * y) for x, p, y in zip(point, a, d, strict=True))
        best = min(best, off)
    return best


def undisturbed() -> list[Row]:
    rig = Rig()
    stream(rig)
    rig.rest()
    return rig.rows


def test_override_scales_speed_keeps_the_path_and_stays_within_accelerations() -> None:
    curve = undisturbed()
    rig = Rig()
    stream(rig)
    for percent in (30.0, 100.0, 60.0, 5.0, 100.0):
        rig.mover.override_percent = percent
        rig.go(0.1)
    rig.rest()
    rig.assert_smooth(1.02)
    assert max(distance_to_curve(row, curve) for row in rig.rows) < 0.05
    assert rig.mover.joints_deg == KNOTS[-1]


def test_override_50_takes_twice_as_long() -> None:
    times = []
    for percent in (100.0, 50.0):
        rig = Rig()
        rig.mover.override_percent = percent
        rig.mover.feed(ptp(plus(HOME, 60.0)))
        rig.rest()
        times.append(rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s)
    assert times[1] == pytest.approx(2.0 * times[0], abs=1e-9)


def test_override_0_stops_on_the_path_and_back_goes_on() -> None:
    curve = undisturbed()
    rig = Rig()
    stream(rig)
    rig.go(0.2)
    rig.mover.override_percent = 0.0
    assert rig.rest() < 0.15
    stood = rig.mover.joints_deg
    rig.go(1.0)
    assert rig.mover.joints_deg == stood
    assert not rig.mover.held
    rig.mover.override_percent = 100.0
    rig.rest()
    rig.assert_smooth(1.02)
    assert max(distance_to_curve(row, curve) for row in rig.rows) < 0.05
    assert rig.mover.joints_deg == KNOTS[-1]


def test_whether_override_0_counts_as_motion_is_an_option() -> None:
    for counts in (False, True):
        rig = Rig(options=Options(moving_at_override_0=counts))
        stream(rig)
        rig.go(0.2)
        rig.mover.override_percent = 0.0
        rig.go(0.5)
        assert rig.mover.moving is counts


@pytest.mark.parametrize("after_s", [0.02, 0.06, 0.11, 0.16, 0.21, 0.26])
def test_brake_rests_on_the_path_keeps_what_is_planned_and_goes_on(after_s: float) -> None:
    curve = undisturbed()
    rig = Rig()
    stream(rig)
    rig.go(after_s)
    rig.mover.brake()
    rig.rest()
    stood = rig.mover.joints_deg
    rig.go(0.5)
    assert rig.mover.joints_deg == stood
    assert rig.mover.queued > 0
    rig.mover.release()
    rig.rest()
    rig.assert_smooth(1.02)
    assert max(distance_to_curve(row, curve) for row in rig.rows) < 0.05
    assert rig.kinds(Kind.FINISHED) == [(Kind.FINISHED, k) for k in (1, 2, 3, 4)]


def at_full_speed(rig: Rig) -> None:
    rig.mover.feed(ptp(plus(HOME, 150.0)))
    rig.until(lambda: rig.mover.speed_deg_s[0] > 359.9)


def brake_way_deg(fast: bool) -> float:
    rig = Rig()
    at_full_speed(rig)
    here = rig.mover.joints_deg[0]
    rig.mover.brake(fast)
    rig.rest()
    return rig.mover.joints_deg[0] - here


def test_brake_f_is_harder_than_brake_by_the_emergency_ramp() -> None:
    # 360 deg/s at 2400 deg/s2 is v^2/2a = 27 deg; RED_ACC_EMX of A1 is 250 %. One step is 1.4 deg.
    assert brake_way_deg(False) == pytest.approx(27.0, abs=1.5)
    assert brake_way_deg(True) == pytest.approx(27.0 / 2.5, abs=1.5)


def test_discard_forgets_what_is_planned_and_the_next_block_begins_where_the_arm_stands() -> None:
    rig = Rig()
    stream(rig)
    rig.until(lambda: bool(rig.kinds(Kind.FINISHED)))
    rig.mover.brake()
    rig.rest()
    rig.mover.discard()
    stood = rig.mover.joints_deg
    assert (rig.mover.queued, rig.mover.running, rig.mover.held) == (0, None, False)
    rig.go(1.0)
    assert rig.mover.joints_deg == rig.mover.planned_end_deg == stood
    assert rig.kinds(Kind.FINISHED)[-1][1] < 4
    rig.mover.feed(ptp(HOME, 9))
    rig.rest()
    assert rig.mover.joints_deg == HOME
    rig.assert_smooth(1.02)


def test_discard_in_motion_brakes_first_and_takes_no_block_meanwhile() -> None:
    rig = Rig()
    stream(rig)
    rig.go(0.16)
    rig.mover.discard()
    with pytest.raises(RuntimeError, match="before the arm stands"):
        rig.mover.feed(ptp(HOME, 9))
    rig.rest()
    assert rig.mover.queued == 0
    rig.assert_smooth(1.02)
    assert distance_to_curve(rig.mover.joints_deg, undisturbed()) < 0.05


def test_stop_2_waits_for_a_start_with_the_drives_on() -> None:
    rig = Rig()
    stream(rig)
    rig.go(0.16)
    rig.mover.stop(2)
    rig.rest()
    assert rig.mover.drives
    rig.mover.release()
    rig.go(0.3)
    assert not rig.mover.moving
    assert rig.mover.start()
    rig.rest()
    assert rig.mover.joints_deg == KNOTS[-1]


def test_stop_1_stays_on_the_path_and_switches_the_drives_off_at_standstill() -> None:
    rig = Rig()
    stream(rig)
    rig.go(0.16)
    rig.mover.stop(1)
    assert rig.mover.drives
    rig.rest()
    assert not rig.mover.drives
    assert distance_to_curve(rig.mover.joints_deg, undisturbed()) < 0.05
    assert not rig.mover.start()
    rig.mover.drives_on()
    assert not rig.mover.moving
    assert rig.mover.start()
    rig.rest()
    assert rig.mover.joints_deg == KNOTS[-1]


def test_stop_0_leaves_the_path_and_a_start_returns_to_it_first() -> None:
    curve = undisturbed()
    rig = Rig()
    stream(rig)
    # In the corner between the first two blocks, where the axes brake differently.
    rig.until(lambda: rig.mover.joints_deg[1] > HOME[1] + 8.0)
    rig.mover.stop(0)
    assert not rig.mover.drives
    rig.rest()
    assert distance_to_curve(rig.mover.joints_deg, curve) > 0.1
    rig.mover.drives_on()
    assert rig.mover.start()
    rig.rest()
    assert rig.kinds(Kind.RETURNED) == [(Kind.RETURNED, -1)]
    assert rig.mover.joints_deg == KNOTS[-1]
    for row in rig.accelerations():
        for value, limit in zip(row, ACCELERATION_DEG_S2, strict=True):
            assert abs(value) <= limit * 2.55


def test_drives_off_stops_by_the_category_of_the_option() -> None:
    for category, at_once in ((0, True), (1, False)):
        rig = Rig(options=Options(drives_off_stop=category))
        stream(rig)
        rig.go(0.16)
        rig.mover.drives_off()
        assert rig.mover.drives is not at_once
        rig.rest()
        assert not rig.mover.drives


def test_at_full_speed_every_stop_is_done_within_200_ms() -> None:
    for category in (0, 1, 2):
        rig = Rig()
        at_full_speed(rig)
        rig.mover.stop(category)
        assert rig.rest() < 0.2


def test_standstill_is_told_once() -> None:
    rig = Rig()
    stream(rig)
    rig.go(0.16)
    rig.mover.brake()
    rig.go(1.0)
    assert rig.kinds(Kind.STANDSTILL) == [(Kind.STANDSTILL, -1)]


@pytest.mark.parametrize("mode", ["T1", "T2", "AUT", "EX"])
def test_the_first_motion_is_a_slow_bco_run_that_waits_for_a_start_but_in_external(
    mode: str,
) -> None:
    rig = Rig(mode=mode, bco=False)
    assert rig.mover.needs_bco
    rig.mover.feed(ptp(plus(HOME, 20.0), 1, words=("C_PTP",), apo=FULL))
    rig.mover.feed(ptp(plus(HOME, 40.0), 2))
    assert not rig.mover.needs_bco
    rig.rest()
    bco = {(Kind.BCO_NEEDED, 1), (Kind.BCO_REACHED, 1)}
    assert bco <= set(rig.kinds())
    # RED_VEL_AXC of A1 is 17 %.
    until_there = [v[0] for v, r in zip(rig.speeds(), rig.rows, strict=False) if r[0] < 19.99]
    assert max(until_there) <= 0.17 * 360.0 + 1e-6
    if mode != "EX":
        assert rig.mover.joints_deg == plus(HOME, 20.0)
        assert rig.mover.start()
        rig.rest()
    assert rig.mover.joints_deg == plus(HOME, 40.0)


def test_the_first_motion_must_be_a_ptp() -> None:
    rig = Rig(bco=False)
    with pytest.raises(MotionError, match="first motion must be a PTP"):
        rig.mover.feed(Block(1, Lin((500.0, 0.0, 700.0, 0.0, 180.0, 0.0), PathSpeed(0.1, 1.0))))


def test_selecting_again_forgets_everything_and_asks_for_bco() -> None:
    rig = Rig()
    stream(rig)
    rig.go(0.16)
    rig.mover.select()
    rig.rest()
    assert rig.mover.needs_bco
    assert rig.mover.queued == 0


def test_t1_keeps_flange_and_tool_centre_below_250_mm_s() -> None:
    tool = (0.0, 0.0, 300.0, 0.0, 0.0, 0.0)
    rig = Rig(mode="T1", options=Options(t1_ptp_percent=100.0))
    full = (100.0,) * 6
    rig.mover.feed(Block(1, Ptp((-60.0, -45.0, 60.0, 90.0, 60.0, 200.0), full, full, tool)))
    rig.rest()

    def place(row: Row) -> tuple[float, float, float]:
        return chained(forward(row), pose_of(tool))[0]

    tool_mm_s = [math.dist(place(a), place(b)) / STEP_S for a, b in pairwise(rig.rows)]
    assert 249.0 < max(tool_mm_s) <= 250.1
    for a, b in pairwise(rig.rows):
        assert math.dist(forward(a)[0], forward(b)[0]) / STEP_S <= 250.1


def test_t1_reduces_ptp_to_red_t1_percent_and_paths_to_vel_cp_t1() -> None:
    rig = Rig(mode="T1")
    rig.mover.feed(ptp(plus(HOME, 60.0), velocity=50.0))
    rig.rest()
    assert max(v[0] for v in rig.speeds()) == pytest.approx(0.07 * 360.0, rel=1e-6)
    rig = Rig(mode="T1")
    x, y, z = forward(HOME)[0]
    rig.mover.feed(Block(1, Lin((x, y + 150.0, z, 180.0, 0.0, 180.0), PathSpeed(1.0, 5.0))))
    rig.rest()
    fastest = max(math.dist(forward(a)[0], forward(b)[0]) / STEP_S for a, b in pairwise(rig.rows))
    assert fastest == pytest.approx(100.0, rel=1e-4)


def test_how_often_somebody_advances_changes_nothing() -> None:
    coarse, fine = Rig(), Rig()
    for rig in (coarse, fine):
        stream(rig)
    coarse.mover.advance(0.4)
    for _ in range(400):
        fine.mover.advance(0.001)
    assert coarse.mover.joints_deg == fine.mover.joints_deg
    assert coarse.events == fine.events


def test_every_option_stands_in_the_table_of_documents_and_guesses() -> None:
    named = {what for what, _ in TABLE}
    assert set(vars(Options())) <= named
