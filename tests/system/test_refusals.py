"""A cell that is not ready is refused before anything moves, is made stiff or is written to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from sphmctl import clock
from sphmctl.emulators.cell import Setup
from sphmctl.emulators.controller import Options
from sphmctl.errors import DeviceError, SphmctlError, UsageError
from tests.system.rig import (
    SIDES,
    Rig,
    agree,
    plan_of,
    run,
)


def _refusal(
    setup: Setup | None = None,
    options: Options | None = None,
    prepare: Callable[[Rig], object] = lambda rig: None,
) -> SphmctlError:
    """The error that refuses a cell; nothing was written to the controller or made stiff."""

    async def main() -> SphmctlError:
        rig = Rig(setup=setup, options=options)
        prepare(rig)
        before = rig.emulated.true_joints_deg()
        try:
            with pytest.raises(SphmctlError) as raised:
                await rig.play(plan_of(SIDES))
            await asyncio.sleep(0.5)
            rig.emulated.world.advance()
            assert rig.emulated.true_joints_deg() == before
            assert rig.torques() == [0, 0, 0]
            assert all(frame[4] == 0 for _, frame in rig.kvp.frames), "something was written"
        finally:
            await rig.close()
        return raised.value

    return clock.run(main(), virtual=True)


def _panel(name: str, value: object) -> Callable[[Rig], object]:
    return lambda rig: setattr(rig.emulated.controller.panel, name, value)


@pytest.mark.parametrize(
    ("options", "prepare", "sentence"),
    [
        (Options(model_name="#KR10R1100 C4SR"), None, "robot: KR10R1100 C4SR; the cell file says"),
        (Options(program="OTHER"), None, "program: OTHER; select SPH_RUN"),
        (Options(program_state="P_FREE"), None, "program: none selected; select SPH_RUN"),
        (Options(program_state="P_STOP"), None, "program state: #P_STOP; start SPH_RUN"),
        (Options(program_version=7), None, "program version: 7; this sphmctl needs 3; write"),
        (Options(installed=False), None, "SPH_STATE"),
        (None, _panel("mode", "T2"), "mode: T2; choose one of EX"),
        (None, _panel("user_saf", False), "safety chain: open; release"),
        (None, _panel("alarm_stop", False), "safety chain: open; release"),
        (None, _panel("drives", False), "drives: off; switch"),
        (None, _panel("stop_message", True), "messages: stop message; acknowledge"),
    ],
)
def test_a_cell_that_is_not_ready_is_refused_before_anything_moves(
    options: Options | None, prepare: Callable[[Rig], object] | None, sentence: str
) -> None:
    error = _refusal(options=options, prepare=prepare or (lambda rig: None))
    assert isinstance(error, DeviceError)
    assert error.exit_code == 5
    assert sentence in str(error)


def test_a_missing_servo_is_refused_before_anything_moves() -> None:
    error = _refusal(prepare=lambda rig: rig.emulated.servos[1].unplug())
    assert "servo 2 (leg 2): does not answer (check power, cable, id and baud rate)" in str(error)


def test_a_deaf_controller_is_refused_before_anything_moves() -> None:
    error = _refusal(prepare=lambda rig: setattr(rig.kvp, "deaf", True))
    assert "no answer to a request for PING within 0.8 s" in str(error)


def test_without_consent_nothing_moves() -> None:
    async def refuse(question: str) -> bool:
        assert "Move now?" in question
        return False

    async def main() -> None:
        rig = Rig()
        await rig.session.open()
        await rig.session.verify()
        with pytest.raises(UsageError, match="no consent"):
            await rig.session.prepare(plan_of(SIDES), 1.0, refuse)
        assert all(frame[4] == 0 for _, frame in rig.kvp.frames)
        await rig.close()

    clock.run(main(), virtual=True)


def test_a_robot_that_was_moved_while_the_question_stood_is_refused() -> None:
    async def main() -> None:
        rig = Rig()
        await rig.session.open()
        await rig.session.verify()
        approach = await rig.session.prepare(plan_of(SIDES), 1.0, agree)
        rig.emulated.servos[2].turn_by_hand(300.0)
        with pytest.raises(DeviceError, match=r"theta9 was moved by 26\.\d degrees"):
            await rig.session.play(
                plan_of(SIDES), approach, rig.stop, lambda t, j, tau: None, lambda tau: None
            )
        assert rig.torques() == [0, 0, 0]
        await rig.close()

    clock.run(main(), virtual=True)


def test_a_robot_outside_its_range_is_refused_by_name() -> None:
    error = _refusal(setup=Setup(cranks_deg=(60.0, 60.0, 130.0)))
    assert "theta9 stands at 129.99 degrees, outside 0 to 120" in str(error)


def test_a_program_that_does_not_take_the_session_faults_without_motion() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_event("armed")
        rig.emulated.controller.panel.program_state = "P_STOP"

    ended = run(script)
    assert ended.outcome.outcome == "faulted"
    assert "SPH_RUN did not take the session within 1 s" in ended.outcome.cause
    assert ended.outcome.unconfirmed == []
    assert ended.moved_deg(0.0)[:6].max() == 0.0
    assert ended.torques == [0, 0, 0]
