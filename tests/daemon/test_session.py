"""The session as a whole: opening, consent, the run's folder, and runs that repeat to the byte."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.config import emulated_cell
from sphmctl.daemon.doctor import examine, state_of
from sphmctl.daemon.run import Job, run_job
from sphmctl.daemon.session import Session
from sphmctl.emulators.cell import Setup
from sphmctl.errors import DeviceError, SphmctlError
from tests.system.rig import SIDES, Rig, agree, plan_of

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def _on_rig(test: Callable[[Rig], Awaitable[None]], setup: Setup | None = None) -> None:
    async def main() -> None:
        rig = Rig(setup=setup)
        try:
            await test(rig)
        finally:
            await rig.close()

    clock.run(main(), virtual=True)


def test_when_one_device_cannot_be_opened_the_other_is_closed_again() -> None:
    async def no_controller(rig: Rig) -> None:
        rig.kvp.refused = True
        with pytest.raises(DeviceError, match="nothing listens"):
            await rig.session.open()
        assert not rig.wrist.connected

    async def no_port(rig: Rig) -> None:
        rig.bus.refused = True
        with pytest.raises(DeviceError, match="nothing listens"):
            await rig.session.open()
        assert not rig.arm.connected

    _on_rig(no_controller)
    _on_rig(no_port)


def test_the_question_names_duration_and_how_far_the_robot_is_away() -> None:
    asked: list[str] = []

    async def ask(question: str) -> bool:
        asked.append(question)
        return True

    async def test(rig: Rig) -> None:
        await rig.session.open()
        await rig.session.prepare(plan_of(SIDES), 1.0, ask)

    _on_rig(test)
    _on_rig(test, Setup(arm_deg=(25.0, -90.0, 90.0, 0.0, 90.0, 0.0)))
    assert asked[0] == "two sides: 1.4 s. The robot stands at the start. Move now?"
    assert "not at the start (A1 is 25.0 degrees away)" in asked[1]
    assert "Is the way free? Move now?" in asked[1]


def test_the_keep_alive_lets_a_user_think_for_a_minute() -> None:
    async def think(question: str) -> bool:
        await asyncio.sleep(60.0)
        return True

    async def test(rig: Rig) -> None:
        await rig.session.open()
        plan = plan_of(SIDES)
        approach = await rig.session.prepare(plan, 1.0, think)
        outcome = await rig.session.play(
            plan, approach, rig.stop, lambda t, j, tau: None, lambda tau: None
        )
        assert outcome.outcome == "completed"

    _on_rig(test)


def test_a_servo_that_refuses_torque_ends_before_motion_with_torque_off_on_all() -> None:
    async def test(rig: Rig) -> None:
        await rig.session.open()
        await rig.session.verify()
        approach = await rig.session.prepare(plan_of(SIDES), 1.0, agree)
        rig.emulated.servos[2].raise_error(5)
        with pytest.raises(DeviceError, match="servo 3 refused"):
            await rig.session.play(
                plan_of(SIDES), approach, rig.stop, lambda t, j, tau: None, lambda tau: None
            )
        assert rig.torques() == [0, 0, 0]
        assert all(frame[4] == 0 for _, frame in rig.kvp.frames)

    _on_rig(test)


def test_doctor_and_status_look_at_everything_and_write_nothing() -> None:
    async def test(rig: Rig) -> None:
        findings = await examine(rig.cell, rig.arm, rig.wrist)
        assert [f.name for f in findings if not f.ok] == []
        state = await state_of(rig.cell, rig.arm, rig.wrist)
        assert (state["state"], state["cause"], state["run"]) == ("ready", "", None)
        assert state["arm"]["joints_deg"] == pytest.approx([0, -90, 90, 0, 90, 0])
        assert state["wrist"]["cranks_deg"] == pytest.approx([60, 60, 60], abs=0.1)
        assert all(frame[4] == 0 for _, frame in rig.kvp.frames)
        assert all(frame[7] in (0x01, 0x02) for _, frame in rig.bus.frames)

    _on_rig(test)


def test_status_of_a_cell_that_is_not_ready_says_why() -> None:
    async def test(rig: Rig) -> None:
        rig.emulated.controller.panel.user_saf = False
        state = await state_of(rig.cell, rig.arm, rig.wrist)
        assert state["state"] == "not ready"
        assert "safety chain: open; release the emergency stop" in state["cause"]

    _on_rig(test)


INPUTS = {  # a table may have the name of one of the run's own files
    "path.yaml": SIDES.encode(),
    "tables/a.csv": b"x_mm",
    "plan.csv": b"y_mm",
}


def _job(runs_dir: Path) -> Job:
    return Job(plan_of(SIDES), emulated_cell(), 1.0, INPUTS, runs_dir, NOW, "virtual")


def _record(
    runs_dir: Path, seed: int, prepare: Callable[[Rig], Awaitable[Any]] | None = None
) -> dict[str, Any]:
    """A whole run with its folder; `prepare` runs beside it."""

    async def main() -> dict[str, Any]:
        rig = Rig(seed)
        task = None if prepare is None else asyncio.ensure_future(prepare(rig))
        try:
            return await run_job(
                _job(runs_dir),
                rig.arm,
                rig.wrist,
                agree,
                rig.stop,
                rig.progress,
                lambda name, fields: rig.events.add(name, **fields),
                rig.emulated,
            )
        finally:
            if task is not None:
                task.cancel()
            await rig.close()

    return clock.run(main(), virtual=True)


FILES = ("feedback.csv", "truth.csv", "events.jsonl", "plan.csv", "path.yaml", "cell.yaml")
"""The first three tell a seed; what the plan was made from is the same for all."""


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    folders = [Path(_record(tmp_path, seed)["run_dir"]) for seed in (4, 4, 5)]
    assert len(set(folders)) == 3
    first, again, other = ([(f / name).read_bytes() for name in FILES] for f in folders)
    assert first == again
    for index in range(3):
        assert first[index] != other[index], FILES[index]
    assert first[3:] == other[3:]


def test_a_run_that_is_stopped_has_its_whole_folder(tmp_path: Path) -> None:
    async def halt(rig: Rig) -> None:
        await rig.until_tau(0.4)
        rig.stop.set()

    summary = _record(tmp_path, 1, halt)
    folder = Path(summary["run_dir"])
    assert summary["outcome"] == "stopped"
    kept = {str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file()}
    assert kept == {*FILES, "summary.json", "report.html", "tables/a.csv", "path-plan.csv"}
    assert (folder / "path-plan.csv").read_bytes() == INPUTS["plan.csv"]
    assert json.loads((folder / "summary.json").read_text())["outcome"] == "stopped"
    rows = np.genfromtxt(folder / "feedback.csv", delimiter=",", skip_header=1)
    assert 0.4 < rows[-1, 0] < 1.0
    assert np.abs(rows[-1, 1:7] - rows[-4, 1:7]).max() < 0.1


def test_a_run_that_ends_before_any_motion_of_its_plan_is_assessed_too(tmp_path: Path) -> None:
    async def halt(rig: Rig) -> None:
        await rig.until_event("armed")
        rig.stop.set()

    summary = _record(tmp_path, 1, halt)
    assert (summary["outcome"], summary["duration_s"]) == ("stopped", 0.0)
    assert summary["skew_ms"]["p99"] is None


@pytest.mark.parametrize("what", ["verify", "consent", "torque"])
def test_what_ends_before_motion_leaves_no_folder(tmp_path: Path, what: str) -> None:
    async def spoil(rig: Rig) -> None:
        if what == "verify":
            rig.emulated.controller.panel.mode = "T2"
        if what == "consent":
            await rig.until_event("verified")
            rig.emulated.servos[0].turn_by_hand(-1000.0)
        if what == "torque":
            await rig.until_event("verified")
            rig.emulated.servos[0].raise_error(5)

    with pytest.raises(SphmctlError):
        _record(tmp_path, 1, spoil)
    assert list(tmp_path.iterdir()) == []


def test_a_session_can_be_closed_twice_and_before_it_is_open() -> None:
    async def test(rig: Rig) -> None:
        await rig.session.close()
        await rig.session.open()
        await rig.session.close()
        await rig.session.close()
        assert not rig.arm.connected

    _on_rig(test)


def test_findings_carry_a_remedy_where_something_is_wrong() -> None:
    async def test(rig: Rig) -> None:
        rig.emulated.controller.panel.drives = False
        session = Session(rig.cell, rig.arm, rig.wrist, rig.events)
        await session.open()
        findings = [*await session.examine_arm(), *await session.examine_wrist()]
        assert [f.name for f in findings if not f.ok] == ["drives", "program state"]
        assert all(bool(f.remedy) is not f.ok for f in findings)
        assert {f.name for f in findings} >= {"robot", "program", "mode", "safety chain"}
        assert dataclasses.asdict(findings[0])["detail"].startswith("KR6R900")

    _on_rig(test)
