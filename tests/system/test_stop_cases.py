"""What stops the arm on the octagon: how soon it stands, that nothing moves later, and the words.

Judged from the emulated machine's true joints, a row each 4 ms. `pytest -s` prints the table of
measured times.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.cli import emulation, main
from sphmctl.emulators.controller import ACCELERATION_DEG_S2
from sphmctl.emulators.motion import Options as MotionOptions
from sphmctl.motion import Floats
from tests.system.rig import STILL_DEG
from tests.system.stop_rig import (
    CASES,
    HANDS,
    INSTANTS,
    ROW_S,
    SOON_S,
    STAND_S,
    WATCHED_S,
    Hand,
    Instant,
    emergency_stop,
    fresh_links,
    key,
    kill,
    next_run,
    off_path_deg,
    on_the_side,
    plan_from,
    release,
    stands_s,
    stop_case,
    switch_drives_off,
    true_rows,
)
from tests.system.test_octagon import OCTAGON

IN_MOTION_S = 12.0
"""After the begin of `run` on the emulated cell: it is on the octagon."""

EXIT_FAULT = 6

BCO_DEG = 1e-4
"""A program that is selected anew drives to where the arm stands, which is a REAL of 24 bits."""

ON_PATH_DEG = 0.1
"""How far an axis may be from the nearest sample of the plan; samples are up to 0.05 apart."""


TRIED = (INSTANTS[0], INSTANTS[-1])
"""Tried each time; `make many` tries the others."""

EACH_INSTANT = pytest.mark.parametrize(
    "instant",
    [pytest.param(i, marks=() if i in TRIED else pytest.mark.many) for i in INSTANTS],
    ids=str,
)


def test_a_side_is_driven_as_in_the_whole_octagon() -> None:
    whole = plan_from("A").knots
    for corner in "BDEG":
        part = plan_from(corner).knots
        for ours, octagons in zip(part, whole[-len(part) :], strict=True):
            assert np.abs(ours.joints - octagons.joints).max() < 1e-6
            assert ours.velocity == pytest.approx(octagons.velocity, rel=1e-3)
            assert ours.acceleration == pytest.approx(octagons.acceleration, rel=1e-3)


@pytest.fixture(scope="module")
def table() -> Iterator[list[str]]:
    """Lines to be printed when all is measured."""
    lines: list[str] = []
    yield lines
    print("\ncase, side and plan time, speed of the fastest axis, stands after, way until then")
    print("\n".join(lines))


def line(name: str, instant: Instant, rows: Floats, stands_after_s: float) -> str:
    """A line of the table."""
    speed = np.abs(rows[1, 1:] - rows[0, 1:]).max() / ROW_S
    begin, end = (int(np.searchsorted(rows[:, 0], t)) for t in (0.0, stands_after_s))
    way = np.abs(rows[end, 1:] - rows[begin - 1, 1:]).max()
    return (
        f"{name:20} {instant!s:10} {speed:5.1f} deg/s {1000.0 * stands_after_s:5.0f} ms "
        f"{way:6.3f} deg"
    )


@EACH_INSTANT
@pytest.mark.parametrize("name", CASES)
def test_the_arm_stands_in_time_and_never_drives_an_old_target(
    name: str, instant: Instant, table: list[str]
) -> None:
    case = CASES[name]
    stopped = clock.run(stop_case(case, instant), virtual=True)
    table.append(line(name, instant, stopped.rows, stopped.stands_s))
    assert 0.0 < stopped.stands_s <= case.limit_s
    assert stopped.rows[-1, 0] - stopped.mended_s > 0.99 * WATCHED_S
    assert stopped.moved_late_deg <= (BCO_DEG if name == "program deselected" else STILL_DEG)
    cause, remedy = stopped.told
    assert re.fullmatch(case.cause, cause)
    if not instant.soon:
        assert remedy.startswith(case.remedy)
    if stopped.refused is not None:
        assert case.refusal in stopped.refused
    assert stopped.again == ""


@pytest.mark.parametrize("name", ["run killed", "stop key", "drives off", "emergency stop"])
def test_it_stands_in_time_with_a_tenth_of_the_brakes_that_are_assumed(
    name: str, table: list[str]
) -> None:
    # How hard a KRC4 brakes is a guess: nothing here may rest on it.
    weak = MotionOptions(
        acceleration_deg_s2=ACCELERATION_DEG_S2,
        brake_percent=10.0,
        fast_brake_percent=(10.0,) * 6,
    )
    case, instant = CASES[name], INSTANTS[0]
    stopped = clock.run(stop_case(case, instant, weak), virtual=True)
    table.append(line(f"{name}, weak", instant, stopped.rows, stopped.stands_s))
    assert stopped.stands_s <= case.limit_s
    assert (stopped.moved_late_deg <= STILL_DEG, stopped.again) == (True, "")


async def override_case(instant: Instant, back_after_s: float) -> tuple[str, Floats, Floats]:
    """Override 0 in the middle of a side, and back."""
    plan, rig = plan_from(instant.side[0]), on_the_side(instant)
    try:
        task = asyncio.create_task(rig.play(plan))
        await rig.until_tau(instant.tau_s)
        event_s = rig.loop.time()
        rig.write("$OV_PRO", "0")
        await asyncio.sleep(back_after_s)
        held = true_rows(rig, event_s)
        rig.write("$OV_PRO", "100")
        outcome = await task
        return outcome.outcome, held, true_rows(rig, event_s)
    finally:
        await rig.close()


@EACH_INSTANT
def test_override_0_holds_the_arm_in_time_and_back_it_goes_on_along_the_path(
    instant: Instant, table: list[str]
) -> None:
    back_after_s = SOON_S if instant.soon else 4.0
    outcome, held, rows = clock.run(override_case(instant, back_after_s), virtual=True)
    table.append(line("override 0", instant, held, stands_s(held)))
    assert 0.0 < stands_s(held) <= STAND_S
    assert outcome == "completed"
    plan = plan_from(instant.side[0])
    assert off_path_deg(rows, plan) <= ON_PATH_DEG
    assert np.abs(rows[-1, 1:] - np.degrees(plan.joints[-1, :6])).max() <= BCO_DEG


@pytest.mark.parametrize("started_s", [0.5, 3.0])
@pytest.mark.parametrize("hand", [emergency_stop, switch_drives_off, key("P_STOP")])
def test_a_start_after_the_run_was_killed_in_a_stop_moves_nothing(
    hand: Hand, started_s: float
) -> None:
    instant = INSTANTS[0]

    async def main() -> Floats:
        rig = on_the_side(instant)
        try:
            task = asyncio.create_task(rig.play(plan_from(instant.side[0])))
            await rig.until_tau(instant.tau_s)
            event_s = rig.loop.time()
            hand(rig.emulated)
            kill(rig)
            task.cancel()
            await asyncio.sleep(started_s)
            release(rig.emulated)
            await asyncio.sleep(WATCHED_S + 1.0)
            rows = true_rows(rig, event_s)
            fresh_links(rig)
            assert await next_run(rig, plan_from(instant.side[0])) == ""
            return rows
        finally:
            await rig.close()

    assert stands_s(clock.run(main(), virtual=True)) <= STAND_S


STILL_BRAKING = "controller: arm: moving; wait until no other program moves it"


@pytest.mark.parametrize(
    ("after_s", "told"),
    [(0.01, STILL_BRAKING), (0.1, STILL_BRAKING)] + [(t, "") for t in (0.2, 0.5, 0.9, 1.1, 2.0)],
)
def test_the_next_run_after_a_kill_can_begin_once_the_arm_stands(after_s: float, told: str) -> None:
    instant = INSTANTS[2]

    async def main() -> str:
        rig = on_the_side(instant)
        try:
            task = asyncio.create_task(rig.play(plan_from(instant.side[0])))
            await rig.until_tau(instant.tau_s)
            kill(rig)
            task.cancel()
            await asyncio.sleep(after_s)
            fresh_links(rig)
            return await next_run(rig, plan_from(instant.side[0]))
        finally:
            await rig.close()

    assert clock.run(main(), virtual=True) == told


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.act in HANDS])
def test_run_says_what_happened_and_how_to_go_on(
    name: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = CASES[name]
    make = emulation.open_devices

    async def with_the_event(cell: Any, **options: Any) -> emulation.Devices:
        devices = await make(cell, **options)
        assert devices.emulated is not None
        asyncio.get_running_loop().call_later(IN_MOTION_S, HANDS[case.act], devices.emulated)
        return devices

    monkeypatch.setattr(emulation, "open_devices", with_the_event)
    code = main.run(
        ["run", str(OCTAGON), "--dry-run", "--virtual", "--json", "--board", case.board]
        + ["--runs-dir", str(tmp_path)]
    )
    told = capsys.readouterr()
    summary = json.loads(told.out)
    assert (code, summary["outcome"], summary["unconfirmed"]) == (EXIT_FAULT, "faulted", [])
    assert re.fullmatch(case.cause, summary["cause"])
    assert summary["remedy"] == case.remedy
    lines = told.err.splitlines()
    assert lines[-3:] == [
        f"fault: {summary['cause']}",
        "both devices stand",
        f"to go on: {summary['remedy']}",
    ]
    true = np.loadtxt(Path(summary["run_dir"]) / "truth.csv", delimiter=",", skiprows=1)
    assert np.abs(true[-1, 1:7] - true[-2, 1:7]).max() <= STILL_DEG
