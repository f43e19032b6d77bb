"""Stops that somebody asks for, and what the override does, at every place of a run."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.emulators.cell import Setup
from sphmctl.motion import Floats
from tests.system.rig import (
    SIDES,
    STEPS,
    STILL_DEG,
    Rig,
    at,
    crank_errors_deg,
    ends_in_peace,
    plan_of,
    run,
)

ON_SIDE_S = 0.4
"""Plan time in the middle of the first side."""


STOPS = {
    "in the first block": 0.02,
    "in the middle of a side": 0.4,
    "at the corner": plan_of(SIDES).duration_s / 2,
    "in the last block": 1.2,
    "shortly before the end": 1.42,
}


@pytest.mark.parametrize("place", STOPS)
def test_a_stop_that_was_asked_for_ends_in_order(place: str) -> None:
    ended = run(at(STOPS[place], lambda rig: rig.stop.set()))
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("stopped", [])
    assert ended.outcome.cause == "a stop was asked for"
    assert ended.end_s - ended.rig.acted_s < 0.4
    moved = ended.moved_deg(ended.rig.acted_s)
    assert moved[:6].max() < 2.5
    assert moved[6:].max() < 5.0
    assert crank_errors_deg(ended, SIDES).max() < 0.5
    assert ended.torques == [0, 0, 0]
    ends_in_peace(ended)


def test_a_stop_while_a_knot_is_written_does_not_announce_it() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(0.5)
        before = len(rig.kvp.frames)
        await rig.until(lambda: any(b"SPH_KNOT" in f for _, f in rig.kvp.frames[before:]))
        assert b"SPH_KNOT" in rig.kvp.frames[-1][1]
        rig.act()
        rig.stop.set()

    ended = run(script, path=STEPS)
    assert ended.outcome.outcome == "stopped"
    ends_in_peace(ended)


def test_a_stop_before_the_motion_moves_nothing() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_event("armed")
        rig.act()
        rig.stop.set()

    ended = run(script)
    assert ended.outcome.outcome == "stopped"
    assert ended.moved_deg(0.0)[:6].max() == 0.0
    # Torque on and off, and the goal's rounding to a count of 0.088 degrees.
    assert ended.moved_deg(0.0)[6:].max() < 0.09
    assert np.isnan(ended.outcome.begin_s)
    written = [frame for _, frame in ended.rig.kvp.frames]
    assert not any(frame.endswith(b"SPH_CMD\x00\x011") for frame in written)
    assert ended.torques == [0, 0, 0]


def test_a_stop_while_the_robot_settles_finds_the_plan_completed() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(1.3)
        await rig.until_driven()
        # The state of the next cycle says so, and the daemon's next look finds it.
        await asyncio.sleep(0.03)
        rig.stop.set()

    ended = run(script)
    assert (ended.outcome.outcome, ended.outcome.cause) == ("completed", "")
    assert ended.moved_deg(ended.end_s).max() <= STILL_DEG


AWAY_SETUP = Setup(arm_deg=(10.0, -85.0, 92.0, 5.0, 85.0, 7.0), cranks_deg=(75.0, 65.0, 50.0))


def test_a_stop_during_the_approach_leaves_the_plan_undriven() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_event("approach")
        await asyncio.sleep(0.4)
        rig.act()
        rig.stop.set()

    ended = run(script, setup=AWAY_SETUP)
    assert ended.outcome.outcome == "stopped"
    assert ended.rig.rows == []
    assert np.isnan(ended.outcome.begin_s)
    assert 0.5 < ended.moved_deg(0.0)[0] < 10.0
    assert ended.moved_deg(ended.rig.acted_s)[:6].max() < 2.5
    assert ended.torques == [0, 0, 0]
    ends_in_peace(ended)


def test_a_fault_during_the_approach_leaves_the_plan_undriven() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_event("approach")
        await asyncio.sleep(0.4)
        rig.emulated.controller.emergency_stop()

    ended = run(script, setup=AWAY_SETUP)
    assert ended.outcome.outcome == "faulted"
    assert "emergency stop" in ended.outcome.cause
    assert ended.rig.rows == []
    ends_in_peace(ended)


def test_the_approach_ends_at_the_start_and_the_plan_is_driven() -> None:
    ended = run(setup=AWAY_SETUP)
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("completed", [])
    assert np.abs(ended.truth[-1, 1:7] - np.degrees(plan_of(SIDES).joints[-1, :6])).max() < 1e-3


def test_override_zero_holds_both_and_full_override_completes() -> None:
    held: list[Floats] = []

    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.write("$OV_PRO", "0")
        await asyncio.sleep(0.5)
        rig.emulated.world.advance()
        held.append(np.array(rig.emulated.true_joints_deg()))
        await asyncio.sleep(4.0)
        rig.emulated.world.advance()
        held.append(np.array(rig.emulated.true_joints_deg()))
        rig.write("$OV_PRO", "100")

    ended = run(script)
    assert np.abs(held[1] - held[0]).max() <= STILL_DEG
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("completed", [])
    assert crank_errors_deg(ended, SIDES).max() < 0.2


def test_a_slow_override_slows_both_and_completes() -> None:
    async def script(rig: Rig) -> None:
        rig.write("$OV_PRO", "30")

    ended = run(script)
    outcome = ended.outcome
    assert outcome.outcome == "completed"
    slow_s = outcome.end_s - outcome.begin_s
    # The ramps' rounding is slowed as well.
    assert 1.438 / 0.3 < slow_s < 1.438 / 0.3 + 0.9
    plan = plan_of(SIDES)
    t, joints = ended.truth[:, 0], ended.truth[:, 1:]
    inside = (t > outcome.begin_s) & (t < outcome.end_s)
    for row in joints[inside][::25]:
        on_plan = np.abs(np.degrees(plan.joints[:, :6]) - row[:6]).max(axis=1)
        candidates = np.degrees(plan.joints[on_plan < 0.2, 6:])
        assert np.abs(candidates - row[6:]).max(axis=1).min() < 0.6


def test_a_stop_at_override_zero_ends_in_order() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.write("$OV_PRO", "0")
        await asyncio.sleep(1.0)
        rig.act()
        rig.stop.set()

    ended = run(script)
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("stopped", [])
    assert ended.moved_deg(ended.rig.acted_s).max() <= STILL_DEG
    ends_in_peace(ended)


def test_a_stop_while_the_controller_is_deaf_ends_after_the_time_limits() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.kvp.deaf = True
        await asyncio.sleep(0.1)
        rig.act()
        rig.stop.set()

    ended = run(script)
    assert ended.outcome.outcome in ("stopped", "faulted")
    assert ended.end_s - ended.rig.acted_s < 5.0
    assert ended.torques == [0, 0, 0]
    assert ended.moved_deg(ended.end_s).max() <= STILL_DEG


def test_a_run_that_is_cancelled_still_stops_both() -> None:
    ends: list[tuple[float, Floats, list[int]]] = []

    async def main() -> None:
        rig = Rig()
        task = asyncio.create_task(rig.play(plan_of(SIDES)))
        await rig.until_tau(ON_SIDE_S)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        end_s = rig.loop.time()
        await asyncio.sleep(1.0)
        rows = np.array(rig.emulated.truth(end_s, end_s + 1.0))
        ends.append((end_s, np.ptp(rows[:, 1:], axis=0), rig.torques()))
        await rig.close()

    clock.run(main(), virtual=True)
    _, moved, torques = ends[0]
    assert moved.max() <= STILL_DEG
    assert torques == [0, 0, 0]
