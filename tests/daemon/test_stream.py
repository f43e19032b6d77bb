"""The two loops of a motion: pacing of the wrist, feeding of the arm, pairing, and their ends."""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable
from typing import cast

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.daemon.record import Events
from sphmctl.daemon.stream import AHEAD
from sphmctl.daemon.wrist_loop import CYCLE_S, Hold, WristLoop
from sphmctl.drivers.wrist import Wrist, WristState
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats
from tests.system.rig import SIDES, STEPS, Ended, Rig, goals_in, plan_of, run

CRANKS = np.radians([60.0, 60.0, 60.0])


class Wristlike:
    """What the loop needs of a wrist: an exchange that takes its time, or fails."""

    def __init__(self, lasts: Callable[[int], float]) -> None:
        self.begun: list[float] = []
        self.goals: list[Floats] = []
        self._lasts = lasts

    async def exchange(self, cranks: Floats | None) -> WristState:
        loop = asyncio.get_running_loop()
        self.begun.append(loop.time())
        if cranks is not None:
            self.goals.append(cranks)
        await asyncio.sleep(self._lasts(len(self.begun)))
        return WristState((None, None, None), loop.time())


def _loop_times(
    lasts: Callable[[int], float], seconds: float
) -> tuple[list[float], WristLoop, list[str]]:
    async def main() -> tuple[list[float], WristLoop, list[str]]:
        loop = asyncio.get_running_loop()
        wrist = Wristlike(lasts)
        events = Events(None, loop.time)
        wrist_loop = WristLoop(cast(Wrist, wrist), CRANKS, events)
        task = asyncio.create_task(wrist_loop.run())
        await asyncio.sleep(seconds)
        wrist_loop.end()
        await task
        return wrist.begun, wrist_loop, [name for _, name, _ in events.history]

    return clock.run(main(), virtual=True)


def test_cycles_begin_at_absolute_instants_however_long_an_exchange_lasts() -> None:
    times, wrist_loop, _ = _loop_times(lambda n: 0.001 + 0.006 * (n % 2), 1.0)
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, CYCLE_S), abs=1e-9)
    assert wrist_loop.late_cycles == 0
    assert len(times) in (100, 101)


def test_a_missed_instant_is_told_and_not_made_up_for() -> None:
    times, wrist_loop, told = _loop_times(lambda n: 0.035 if n == 20 else 0.004, 1.0)
    begin_s = times[0]
    phases = [(t - begin_s + 0.005) % CYCLE_S for t in times[22:]]
    assert phases == pytest.approx([0.005] * len(phases), abs=1e-6)
    pauses = np.diff(times)
    assert pauses.max() == pytest.approx(0.035, abs=0.006)
    # No burst afterwards: never two cycles closer than what is left of one.
    assert pauses.min() > 0.004
    assert wrist_loop.late_cycles >= 1
    assert "late cycle" in told
    assert len(times) in (97, 98, 99)


def test_an_exception_of_any_kind_becomes_the_loops_fault() -> None:
    def breaks(n: int) -> float:
        if n == 5:
            raise ValueError("cannot convert float NaN to integer")
        return 0.001

    def loses(n: int) -> float:
        if n == 5:
            raise DeviceError("the port is lost", "wrist")
        return 0.001

    for lasts, fault in ((breaks, "the wrist's loop failed: ValueError"), (loses, "the port is")):
        times, wrist_loop, told = _loop_times(lasts, 0.2)
        assert len(times) == 5
        assert fault in str(wrist_loop.fault)
        assert told == ["wrist lost"]


def test_a_source_that_fails_becomes_the_loops_fault_and_hold_ends_it() -> None:
    class Broken(Hold):
        def goals(self, now_s: float) -> Floats:
            raise ZeroDivisionError

    async def main() -> None:
        loop = asyncio.get_running_loop()
        wrist = cast(Wrist, Wristlike(lambda n: 0.001))
        wrist_loop = WristLoop(wrist, CRANKS, Events(None, loop.time))
        wrist_loop.source = Broken(CRANKS)
        await wrist_loop.run()
        assert "ZeroDivisionError" in str(wrist_loop.fault)

    clock.run(main(), virtual=True)


@pytest.fixture(scope="module")
def steps() -> Ended:
    """One undisturbed run of fourteen sides."""
    ended = run(path=STEPS)
    assert ended.outcome.outcome == "completed"
    return ended


def _kvp_writes(ended: Ended) -> list[tuple[float, str, str]]:
    found = []
    for t_s, frame in ended.rig.kvp.frames:
        if frame[4] == 1:
            (size,) = struct.unpack_from(">H", frame, 5)
            found.append((t_s, frame[7 : 7 + size].decode(), frame[9 + size :].decode()))
    return found


def test_a_knot_is_written_before_it_is_announced_and_the_last_before_that(steps: Ended) -> None:
    words = [
        (name, value)
        for _, name, value in _kvp_writes(steps)
        if name.startswith(("SPH_KNOT", "SPH_WR", "SPH_LAST"))
    ]
    # After the session's own zeros.
    words = words[2:]
    total = len(plan_of(STEPS).knots)
    wanted: list[tuple[str, str]] = []
    for sequence in range(1, total + 1):
        wanted.append((f"SPH_KNOT[{sequence}]", f"SEQ {sequence},"))
        if sequence == total:
            wanted.append(("SPH_LAST", str(total)))
        wanted.append(("SPH_WR", str(sequence)))
    assert [name for name, _ in words] == [name for name, _ in wanted]
    for (_, value), (_, part) in zip(words, wanted, strict=True):
        assert part in value


def test_the_controller_has_no_more_knots_than_it_needs(steps: Ended) -> None:
    begin_s = next(t for t, name, value in _kvp_writes(steps) if (name, value) == ("SPH_CMD", "1"))
    before = [int(v) for t, n, v in _kvp_writes(steps) if n == "SPH_WR" and t < begin_s]
    assert max(before) == AHEAD
    ends = [steps.outcome.begin_s + plan_of(STEPS).t[knot.sample] for knot in plan_of(STEPS).knots]
    for t_s, name, value in _kvp_writes(steps):
        if name == "SPH_WR" and int(value) > AHEAD:
            passed = sum(end < t_s for end in ends)
            assert passed <= int(value) <= passed + AHEAD + 1


def test_the_heart_beats_at_least_every_fifty_milliseconds(steps: Ended) -> None:
    beats = [t for t, name, _ in _kvp_writes(steps) if name == "SPH_BEAT"]
    assert beats[0] < steps.outcome.begin_s
    assert np.diff(beats).max() <= 0.060
    assert beats[-1] > steps.outcome.end_s - 0.3


def test_every_wrist_cycle_of_the_plan_becomes_one_row_in_order(steps: Ended) -> None:
    rows = steps.rig.rows
    times = np.array([t for t, _, _ in rows])
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, CYCLE_S), abs=0.006)
    assert len(rows) >= plan_of(STEPS).duration_s / CYCLE_S
    taus = np.array([tau for _, _, tau in rows])
    assert np.diff(taus).min() > -0.01
    assert not np.isnan(np.array([j for _, j, _ in rows])).any()


def test_rows_join_arm_and_wrist_at_the_same_instant(steps: Ended) -> None:
    truth = steps.truth
    for t_s, joints, _ in steps.rig.rows[5::20]:
        at_s = steps.outcome.begin_s + t_s
        true = [np.interp(at_s, truth[:, 0], truth[:, i]) for i in range(1, 10)]
        away = np.abs(np.degrees(joints) - true)
        # At 29 degrees a second, 3 ms of the controller's clock; a count of a crank.
        assert away[:6].max() < 0.2
        assert away[6:].max() < 0.25


def test_goals_stay_within_what_the_plan_asks_of_each_crank(steps: Ended) -> None:
    plan = plan_of(STEPS)
    low, high = np.degrees([plan.joints[:, 6:].min(axis=0), plan.joints[:, 6:].max(axis=0)])
    goals = np.array([g for _, frame in steps.rig.bus.frames for g in goals_in(frame)])
    degrees = (goals - 1365) * 360.0 / 4096.0
    assert (degrees >= low - 0.05).all()
    assert (degrees <= high + 0.05).all()


def test_no_goal_jumps(steps: Ended) -> None:
    goals = np.array([g for _, frame in steps.rig.bus.frames for g in goals_in(frame)])
    fastest = np.abs(np.diff(plan_of(STEPS).joints[:, 6:], axis=0)).max() / 0.004
    per_cycle = math.degrees(fastest) * CYCLE_S * 4096.0 / 360.0
    assert np.abs(np.diff(goals, axis=0)).max() < 3.0 * per_cycle + 2.0


DWELLING = SIDES.replace("{ptp: P}, {ptp: S}", "{ptp: P}, {dwell_s: 4}, {ptp: S}, {dwell_s: 0.5}")
WRIST_ALONE = """
version: 1
name: wrist alone
points:
  S: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}
  T: {joints_deg: [0, -90, 90, 0, 90, 0, 90, 70, 40]}
moves: [{ptp: S}, {ptp: T}]
"""


def test_a_dwell_longer_than_the_stall_limit_is_no_stall() -> None:
    ended = run(path=DWELLING)
    assert (ended.outcome.outcome, ended.outcome.cause) == ("completed", "")
    lasted_s = ended.outcome.end_s - ended.outcome.begin_s
    assert plan_of(DWELLING).duration_s < lasted_s < plan_of(DWELLING).duration_s + 0.4


def test_a_plan_of_the_wrist_alone_moves_the_wrist_alone() -> None:
    ended = run(path=WRIST_ALONE)
    assert ended.outcome.outcome == "completed"
    assert ended.moved_deg(0.0)[:6].max() == 0.0
    assert ended.truth[-1, 7:] == pytest.approx([90.0, 70.0, 40.0], abs=0.2)
    written = [(name, value) for _, name, value in _kvp_writes(ended)]
    assert ("SPH_CMD", "1") not in written


def test_a_run_that_ends_leaves_the_controller_idle() -> None:
    ended: list[object] = []

    async def main() -> None:
        rig = Rig()
        await rig.play(plan_of(SIDES))
        ended.append(rig.emulated.controller.store.get("SPH_CMD"))
        await rig.close()

    clock.run(main(), virtual=True)
    assert ended == [0]
