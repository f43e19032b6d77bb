"""LIN and CIRC: geometry, speed, blends, limits."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from sphmctl.emulators.motion import (
    Apo,
    AxisLimitError,
    Block,
    Circ,
    Kind,
    Lin,
    MotionError,
    PathSpeed,
)
from sphmctl.emulators.motion.frames import Frame, Vector, chained, frame_of, minus, pose_of, turned
from sphmctl.emulators.motion.kinematics import axes_of, forward
from tests.emulators.motion.rig import HOME, STEP_S, Rig, Row, plus, ptp

TOOL: Frame = (0.0, 0.0, 100.0, 0.0, 0.0, 0.0)
BASE: Frame = (500.0, 0.0, 400.0, 0.0, 0.0, 0.0)
DOWN = (180.0, 0.0, 180.0)
SPEED = PathSpeed(0.25, 2.0)
START: Frame = (0.0, -100.0, 100.0, *DOWN)


def at(x: float, y: float, z: float, turn: tuple[float, float, float] = DOWN) -> Frame:
    return (x, y, z, *turn)


def lin(target: Frame, tag: int = 1, words: tuple[str, ...] = (), apo: Apo | None = None) -> Block:
    return Block(tag, Lin(target, SPEED, TOOL, BASE), words, apo or Apo())


def rig_at(start: Frame = START, mode: str = "EX") -> Rig:
    axes = axes_of(start, TOOL, BASE, HOME)
    assert axes is not None
    return Rig(axes, mode=mode)


def places(rig: Rig) -> list[Vector]:
    """The tool's centre in the base, at each step."""
    tool, base = pose_of(TOOL), pose_of(BASE)[0]
    return [minus(chained(forward(row), tool)[0], base) for row in rig.rows]


def test_a_lin_is_straight_and_takes_way_over_speed_plus_ramps() -> None:
    # 200 mm at 250 mm/s, 2000 mm/s2: 0.8 s, ramp 0.125 s, build-up 0.096 s.
    rig = rig_at()
    rig.mover.feed(lin(at(0.0, 100.0, 100.0)))
    rig.rest()
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(0.8 + 0.125 + 0.096, abs=1e-9)
    for x, _, z in places(rig):
        assert (x, z) == pytest.approx((0.0, 100.0), abs=1e-6)
    ways = [math.dist(a, b) for a, b in pairwise(places(rig))]
    assert max(ways) / STEP_S == pytest.approx(250.0, rel=1e-6)
    rig.assert_smooth(2.0)


def test_a_lin_turns_evenly_and_its_orientation_can_set_the_time() -> None:
    rig = rig_at()
    target = at(0.0, -99.0, 100.0, (90.0, 0.0, 180.0))
    speed = PathSpeed(0.25, 2.0, 45.0, 45.0, 500.0, 500.0)
    rig.mover.feed(Block(1, Lin(target, speed, TOOL, BASE)))
    rig.rest()
    # 90 deg at 45 deg/s is 2 s; the ramp of 0.09 s and the same to build up.
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(2.0 + 0.09 + 0.09, abs=1e-6)
    x_axis = turned(chained(forward(rig.mover.joints_deg), pose_of(TOOL))[1], (1.0, 0.0, 0.0))
    assert x_axis == pytest.approx(turned(pose_of(target)[1], (1.0, 0.0, 0.0)), abs=1e-9)


def test_a_circ_goes_through_its_auxiliary_point_on_a_circle() -> None:
    rig = rig_at()
    rig.mover.feed(Block(1, Circ(at(100.0, 0.0, 100.0), at(0.0, 100.0, 100.0), SPEED, TOOL, BASE)))
    rig.rest()
    points = places(rig)
    for x, y, z in points:
        assert math.hypot(x, y) == pytest.approx(100.0, abs=1e-6)
        assert z == pytest.approx(100.0, abs=1e-6)
        assert x > -1e-6
    assert min(math.dist(p, (100.0, 0.0, 100.0)) for p in points) < 1.0
    assert points[-1] == pytest.approx((0.0, 100.0, 100.0), abs=1e-6)
    took_s = rig.first(Kind.FINISHED).time_s - rig.first(Kind.ENTERED).time_s
    assert took_s == pytest.approx(math.pi * 100.0 / 250.0 + 0.125 + 0.096, abs=1e-9)


def test_a_circ_on_a_line_is_refused() -> None:
    rig = rig_at()
    with pytest.raises(MotionError, match="lie on a line"):
        rig.mover.feed(
            Block(1, Circ(at(0.0, 0.0, 100.0), at(0.0, 100.0, 100.0), SPEED, TOOL, BASE))
        )


@pytest.mark.parametrize("zone_mm", [3.0, 10.0, 30.0])
def test_cdis_is_the_distance_at_which_a_blend_may_begin_and_end(zone_mm: float) -> None:
    rig = rig_at()
    apo = Apo(cdis_mm=zone_mm)
    rig.mover.feed(lin(at(0.0, 0.0, 100.0), 1, ("C_DIS",), apo))
    rig.mover.feed(lin(at(100.0, 0.0, 100.0), 2, apo=apo))
    rig.rest()
    points = places(rig)
    assert rig.kinds(Kind.BLENDED) == [(Kind.BLENDED, 1)]
    assert min(y for x, y, _ in points if x > 1e-6) >= -zone_mm - 1e-6
    assert max(x for x, y, _ in points if y < -1e-6) <= zone_mm + 1e-6
    assert min(math.dist(p, (0.0, 0.0, 100.0)) for p in points) > 0.05 * zone_mm
    ways = [minus(b, a) for a, b in pairwise(points)]
    for a, b in pairwise(ways):
        assert math.dist(a, b) / STEP_S**2 <= 2000.0 * math.sqrt(2.0) * 1.001


def test_equal_lins_in_line_keep_their_speed_through_the_knots() -> None:
    rig = rig_at()
    apo = Apo(cdis_mm=100.0)
    for k, y in enumerate((-30.0, 40.0, 110.0), start=1):
        rig.mover.feed(lin(at(0.0, y, 100.0), k, ("C_DIS",), apo))
    rig.rest()
    ways = [math.dist(a, b) / STEP_S for a, b in pairwise(places(rig))]
    fast = [k for k, v in enumerate(ways) if v > 249.9]
    assert min(ways[fast[0] : fast[-1]]) > 249.9
    assert rig.kinds(Kind.BLENDED) == [(Kind.BLENDED, 1), (Kind.BLENDED, 2)]


def test_c_vel_begins_the_blend_where_the_end_ramp_has_fallen_to_its_percent() -> None:
    begins = []
    for percent in (100.0, 50.0):
        rig = rig_at()
        apo = Apo(cvel_percent=percent)
        rig.mover.feed(lin(at(0.0, 0.0, 100.0), 1, ("C_VEL",), apo))
        rig.mover.feed(lin(at(0.0, 100.0, 100.0), 2, apo=apo))
        rig.rest()
        begins.append(rig.first(Kind.BLENDED).time_s - rig.first(Kind.ENTERED, 2).time_s)
    # Half the overlap: half the rise of 0.221 s, and half of that again.
    assert begins == pytest.approx([0.221 / 2.0, 0.221 / 4.0], abs=1e-6)


@pytest.mark.parametrize(
    ("words", "blended"),
    [(("C_PTP",), False), (("C_PTP", "C_DIS"), True), (("C_DIS",), True), ((), False)],
)
def test_before_a_path_a_ptp_needs_the_second_word(words: tuple[str, ...], blended: bool) -> None:
    rig = rig_at()
    knot = plus(rig.mover.joints_deg, 10.0)
    rig.mover.feed(ptp(knot, 1, 30.0, 30.0, words, Apo(100.0, 20.0)))
    rig.mover.feed(lin(at(0.0, 100.0, 100.0), 2, apo=Apo(100.0, 20.0)))
    rig.rest()
    assert (rig.kinds(Kind.BLENDED) == [(Kind.BLENDED, 1)]) is blended
    assert rig.kinds(Kind.EXACT_STOP) == ([(Kind.EXACT_STOP, 1)] if words == ("C_PTP",) else [])
    rig.assert_smooth(2.0)
    assert places(rig)[-1] == pytest.approx((0.0, 100.0, 100.0), abs=1e-6)


def test_a_path_blends_into_a_ptp() -> None:
    rig = rig_at()
    rig.mover.feed(lin(at(0.0, 0.0, 100.0), 1, ("C_DIS",), Apo(cdis_mm=20.0)))
    end: Row = plus(rig.mover.planned_end_deg, 20.0, 10.0)
    rig.mover.feed(ptp(end, 2, 30.0, 30.0, apo=Apo(100.0)))
    rig.rest()
    assert rig.kinds(Kind.BLENDED) == [(Kind.BLENDED, 1)]
    rig.assert_smooth(2.0)
    assert rig.mover.joints_deg == end


def test_brake_and_override_keep_a_path_straight() -> None:
    rig = rig_at()
    rig.mover.feed(lin(at(0.0, 100.0, 100.0)))
    rig.go(0.4)
    rig.mover.brake(fast=True)
    rig.rest()
    y = places(rig)[-1][1]
    assert -100.0 < y < 99.0
    rig.mover.release()
    rig.go(0.1)
    rig.mover.override_percent = 20.0
    rig.rest()
    for x, _, z in places(rig):
        assert (x, z) == pytest.approx((0.0, 100.0), abs=1e-6)
    assert places(rig)[-1][1] == pytest.approx(100.0)


def test_a_path_through_a5_zero_stays_continuous() -> None:
    # Straight up and down through a level wrist, A4 and A6 at 0.
    start = (0.0, -60.0, 90.0, 0.0, -20.0, 0.0)
    rig = Rig(start)
    goal = (0.0, -60.0, 90.0, 0.0, 20.0, 0.0)
    pose = forward(goal)
    rig.mover.feed(Block(1, Lin(frame_of(pose), PathSpeed(0.1, 1.0, 30.0, 30.0, 200.0, 200.0))))
    rig.rest()
    assert rig.mover.joints_deg == pytest.approx(goal, abs=1e-5)
    assert all(abs(r[3]) < 1e-5 for r in rig.rows)
    rig.assert_smooth(2.0)


def test_axes_that_a_path_would_drive_too_fast_are_slowed_and_told() -> None:
    # Past the wrist's singularity with A4 off zero, A4 and A6 would have to jump.
    rig = Rig((0.0, -60.0, 80.0, 2.0, 10.0, 0.0))
    goal = forward((0.0, -60.0, 80.0, -170.0, 10.0, 172.0))
    rig.mover.feed(Block(1, Lin(frame_of(goal), PathSpeed(1.0, 10.0))))
    rig.rest()
    assert Kind.SLOWED in {kind for kind, _ in rig.kinds()}
    rig.assert_smooth(math.inf)


def test_a_path_out_of_reach_or_beyond_a_limit_is_refused() -> None:
    rig = rig_at()
    with pytest.raises(MotionError, match="does not reach"):
        rig.mover.feed(lin(at(900.0, 0.0, 100.0)))
    rig = Rig((160.0, -90.0, 90.0, 0.0, 90.0, 0.0))
    x, y, z = forward((175.0, -90.0, 90.0, 0.0, 90.0, 0.0))[0]
    with pytest.raises(AxisLimitError, match="A1"):
        rig.mover.feed(Block(1, Lin((x, y, z, 25.0, 0.0, 180.0), SPEED)))
    assert rig.mover.queued == 0


@pytest.mark.parametrize(("vel", "acc"), [(0.0, 1.0), (0.1, -1.0), (3.1, 1.0), (math.nan, 1.0)])
def test_a_path_speed_that_is_not_one_is_refused(vel: float, acc: float) -> None:
    rig = rig_at()
    with pytest.raises(MotionError):
        rig.mover.feed(Block(1, Lin(at(0.0, 0.0, 100.0), PathSpeed(vel, acc), TOOL, BASE)))
