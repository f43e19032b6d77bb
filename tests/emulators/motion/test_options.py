"""Each option of the mover changes what it says, and in the direction that it says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest

from sphmctl.emulators.motion import Apo, Block, Kind, Lin, Options, PathSpeed
from sphmctl.emulators.motion.frames import NULL_FRAME, frame_of
from sphmctl.emulators.motion.kinematics import forward
from tests.emulators.motion.rig import HOME, Rig, plus, ptp

Measure = Callable[[Rig], float]


def lin(rig: Rig, way_mm: float) -> Block:
    x, y, z, a, b, c = frame_of(forward(rig.mover.joints_deg))
    speed = PathSpeed(0.5, 2.0, 100.0, 300.0, 100.0, 300.0)
    return Block(1, Lin((x, y + way_mm, z, a, b, c), speed, NULL_FRAME, NULL_FRAME))


def ptp_time_s(rig: Rig) -> float:
    rig.mover.feed(ptp(plus(HOME, 40.0)))
    rig.go(0.004)
    return rig.rest()


def two_blocks_s(rig: Rig) -> float:
    rig.mover.feed(ptp(plus(HOME, 20.0), 1))
    rig.mover.feed(ptp(plus(HOME, 40.0), 2))
    rig.go(0.004)
    rig.until(lambda: (Kind.FINISHED, 2) in rig.kinds())
    return rig.mover.time_s


def lin_time_s(rig: Rig) -> float:
    rig.mover.feed(lin(rig, 200.0))
    rig.go(0.004)
    return rig.rest()


def under_way(rig: Rig) -> None:
    rig.mover.feed(ptp(plus(HOME, 160.0)))
    rig.go(0.4)


def override_way_deg(rig: Rig) -> float:
    under_way(rig)
    at = rig.mover.joints_deg[0]
    rig.mover.override_percent = 0.0
    rig.go(2.0)
    return rig.mover.joints_deg[0] - at


def braking_s(act: Callable[[Rig], Any], path: bool = False) -> Measure:
    def measure(rig: Rig) -> float:
        if path:
            rig.mover.feed(lin(rig, 300.0))
            rig.go(0.4)
        else:
            under_way(rig)
        act(rig)
        return rig.rest()

    return measure


def blends(rig: Rig) -> float:
    apo = Apo(cptp_percent=100.0)
    for number in range(1, 4):
        rig.mover.feed(ptp(plus(HOME, 20.0 * number), number, words=("C_PTP",), apo=apo))
    rig.go(0.004)
    rig.rest()
    return len(rig.kinds(Kind.BLENDED))


def blends_of_a_late_block(rig: Rig) -> float:
    """The second block comes while the first one is under way."""
    apo = Apo(cptp_percent=100.0)
    rig.mover.feed(ptp(plus(HOME, 40.0), 1, words=("C_PTP",), apo=apo))
    rig.until(lambda: (Kind.ENTERED, 1) in rig.kinds())
    rig.mover.feed(ptp(plus(HOME, 80.0), 2, apo=apo))
    rig.rest()
    return len(rig.kinds(Kind.BLENDED))


def stops_at_bco(rig: Rig) -> float:
    rig.mover.mode = "T2"
    rig.mover.select()
    rig.mover.feed(ptp(plus(HOME, 5.0)))
    rig.go(2.0)
    return rig.mover.held


def in_t1(measure: Measure) -> Measure:
    def slow(rig: Rig) -> float:
        rig.mover.mode = "T1"
        return measure(rig)

    return slow


def moving_at_0(rig: Rig) -> float:
    under_way(rig)
    rig.mover.override_percent = 0.0
    rig.go(1.0)
    return rig.mover.moving


SLOW = (1000.0,) * 6

CASES: dict[str, tuple[Any, Any, Measure]] = {
    "acceleration_deg_s2": (tuple(4 * a for a in SLOW), SLOW, ptp_time_s),
    "filter_s": (0.01, 0.2, ptp_time_s),
    "override_ramp_s": (0.1, 1.0, override_way_deg),
    "brake_percent": (200.0, 50.0, braking_s(lambda rig: rig.mover.brake())),
    "fast_brake_percent": (
        (300.0,) * 6,
        (100.0,) * 6,
        braking_s(lambda rig: rig.mover.stop(1)),
    ),
    "fast_path_percent": (400.0, 100.0, braking_s(lambda rig: rig.mover.stop(1), path=True)),
    "coast_percent": ((300.0,) * 6, (100.0,) * 6, braking_s(lambda rig: rig.mover.stop(0))),
    "plan_s": (1.0, 0.012, blends_of_a_late_block),
    "shortest_blend_s": (9.0, 0.036, blends),
    "exact_stop_s": (0.012, 0.2, two_blocks_s),
    "t1_ptp_percent": (14.0, 7.0, in_t1(ptp_time_s)),
    "t1_path_mm_s": (229.0, 100.0, in_t1(lin_time_s)),
    "bco_stops_in": (("T1",), ("T1", "T2"), stops_at_bco),
    "drives_off_stop": (0, 2, lambda rig: _drives_after(rig)),
    "moving_at_override_0": (False, True, moving_at_0),
}
"""The option's values for a small and for a great measure."""


def _drives_after(rig: Rig) -> float:
    under_way(rig)
    rig.mover.drives_off()
    return rig.mover.drives


@pytest.mark.parametrize("name", CASES)
def test_an_option_changes_what_it_says(name: str) -> None:
    small, great, measure = CASES[name]
    least, most = (
        measure(Rig(options=replace(Options(), **{name: value}))) for value in (small, great)
    )
    assert least < most


def test_every_option_is_tried() -> None:
    assert {field.name for field in fields(Options)} == set(CASES)
