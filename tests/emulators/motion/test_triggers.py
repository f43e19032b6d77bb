"""TRIGGER WHEN DISTANCE and PATH: where and when they fire."""

from __future__ import annotations

import pytest

from sphmctl.emulators.motion import Apo, Block, Kind, Lin, MotionError, PathSpeed, Trigger
from sphmctl.emulators.motion.frames import frame_of
from sphmctl.emulators.motion.kinematics import forward
from tests.emulators.motion.rig import HOME, Rig, plus, ptp

FULL = Apo(cptp_percent=100.0)
BLEND = ("C_PTP",)
A, B, C = plus(HOME, 30.0), plus(HOME, 60.0), plus(HOME, 90.0)


def run(*triggers: Trigger, blended: bool = False, override: float = 100.0) -> Rig:
    """Three blocks in line; the triggers stand before the second one."""
    rig = Rig()
    rig.mover.override_percent = override
    words = BLEND if blended else ()
    rig.mover.feed(ptp(A, 1, 50.0, words=words, apo=FULL))
    rig.mover.feed(ptp(B, 2, 50.0, words=words, apo=FULL, triggers=triggers))
    rig.mover.feed(ptp(C, 3, 50.0, apo=FULL))
    rig.rest()
    rig.go(0.5)
    return rig


def fired_s(rig: Rig, tag: int) -> float:
    events = [e for e in rig.events if e.kind is Kind.TRIGGER and e.tag == tag]
    assert len(events) == 1
    return events[0].time_s


def test_exact_stops_put_distance_0_at_the_start_and_1_at_the_end() -> None:
    rig = run(Trigger(10, 0), Trigger(11, 1))
    assert fired_s(rig, 10) == pytest.approx(rig.first(Kind.ENTERED, 2).time_s, abs=0.004)
    assert fired_s(rig, 11) == pytest.approx(rig.first(Kind.FINISHED, 2).time_s, abs=1e-9)


def test_blends_put_distance_0_at_the_arcs_end_and_1_in_the_arcs_middle() -> None:
    rig = run(Trigger(10, 0), Trigger(11, 1), blended=True)
    assert fired_s(rig, 10) == pytest.approx(rig.first(Kind.BLENDED, 1).time_s, abs=1e-9)
    assert fired_s(rig, 11) == pytest.approx(rig.first(Kind.ENTERED, 3).time_s, abs=1e-9)


@pytest.mark.parametrize("override", [100.0, 40.0])
@pytest.mark.parametrize("delay_s", [-0.05, 0.05])
def test_a_delay_is_in_real_time(delay_s: float, override: float) -> None:
    rig = run(Trigger(10, 1, delay_s=delay_s), Trigger(11, 1), override=override)
    assert fired_s(rig, 10) - fired_s(rig, 11) == pytest.approx(delay_s, abs=0.0041)


def test_a_delay_is_trimmed_to_half_a_block_each_way() -> None:
    rig = run(Trigger(10, 1, delay_s=-9.0), Trigger(11, 1, delay_s=9.0))
    second = [rig.first(kind, 2).time_s for kind in (Kind.ENTERED, Kind.FINISHED)]
    third = [rig.first(kind, 3).time_s for kind in (Kind.ENTERED, Kind.FINISHED)]
    assert fired_s(rig, 10) == pytest.approx(sum(second) / 2.0, abs=0.0041)
    assert fired_s(rig, 11) == pytest.approx(sum(third) / 2.0, abs=0.0041)


def test_a_start_with_a_negative_delay_fires_in_the_block_before() -> None:
    rig = run(Trigger(10, 0, delay_s=-0.04), Trigger(11, 0))
    assert fired_s(rig, 10) < rig.first(Kind.FINISHED, 1).time_s
    assert fired_s(rig, 11) - fired_s(rig, 10) == pytest.approx(0.04 + 0.012, abs=0.0081)


def test_a_held_arm_fires_no_trigger_ahead() -> None:
    rig = Rig()
    rig.mover.feed(ptp(C, 1, triggers=(Trigger(10, 1),)))
    rig.go(0.2)
    rig.mover.brake()
    rig.go(2.0)
    assert rig.kinds(Kind.TRIGGER) == []
    rig.mover.release()
    rig.rest()
    assert rig.kinds(Kind.TRIGGER) == [(Kind.TRIGGER, 10)]


def test_triggers_of_discarded_blocks_never_fire() -> None:
    rig = Rig()
    rig.mover.feed(ptp(B, 1, triggers=(Trigger(10, 1),)))
    rig.mover.feed(ptp(C, 2, triggers=(Trigger(11, 0), Trigger(12, 1))))
    rig.go(0.1)
    rig.mover.discard()
    rig.rest()
    rig.mover.feed(ptp(HOME, 3))
    rig.rest()
    assert rig.kinds(Kind.TRIGGER) == []


@pytest.mark.parametrize(
    ("trigger", "y_mm"),
    [
        (Trigger(10, path_mm=-20.0), 80.0),
        (Trigger(10, path_mm=30.0, onstart=True), 30.0),
        (Trigger(10, path_mm=20.0), 100.0),
    ],
)
def test_path_triggers_fire_at_their_distance_along_the_path(trigger: Trigger, y_mm: float) -> None:
    rig = Rig()
    x, y, z, *turn = frame_of(forward(HOME))
    target = (x, y + 100.0, z, turn[0], turn[1], turn[2])
    rig.mover.feed(Block(1, Lin(target, PathSpeed(0.1, 2.0)), triggers=(trigger,)))
    rig.until(lambda: bool(rig.kinds(Kind.TRIGGER)))
    # One step at 100 mm/s is 0.4 mm.
    assert forward(rig.mover.joints_deg)[0][1] - y == pytest.approx(y_mm, abs=0.41)


def test_a_ptp_takes_no_path_trigger_and_a_trigger_has_one_place() -> None:
    with pytest.raises(MotionError, match="not with PTP"):
        ptp(A, triggers=(Trigger(10, path_mm=5.0),))
    with pytest.raises(MotionError, match="either DISTANCE or PATH"):
        Trigger(10)
    with pytest.raises(MotionError, match="0 or 1"):
        Trigger(10, 2)
