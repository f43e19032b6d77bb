"""The robot program's lines to the board: "knot", "arm moving" and "wrist ok"."""

from __future__ import annotations

from collections.abc import Callable

from sphmctl.emulators.controller import Options
from sphmctl.emulators.krc_lines import TerminalLines
from tests.emulators.krc4_rig import (
    ENDED,
    FAULT,
    HOLD,
    HOLDING,
    HOME,
    READY,
    RUN,
    RUNNING,
    STOP,
    Rig,
    away,
)

FAULT_WRIST = 5
NONE, OFF, ON = 0, 1, 2


def connected() -> tuple[Rig, TerminalLines]:
    """A controller with its lines, "wrist ok" on."""
    rig = Rig(Options(lines=True))
    lines = rig.controller.lines
    assert lines is not None
    lines.wrist_ok = True
    return rig, lines


def begin(rig: Rig, *knots: tuple[float, ...]) -> None:
    """A session with knots, told to run."""
    rig.session()
    for number, knot in enumerate(knots, start=1):
        rig.knot(number, knot)
    rig.write("SPH_LAST", str(len(knots)))
    rig.command(RUN)


def test_knot_toggles_at_each_knot_passed_and_moving_tells_of_motion() -> None:
    rig, lines = connected()
    seen: list[tuple[str, bool, object]] = []
    lines.on_output = lambda name, level: seen.append((name, level, rig.world.index))
    begin(rig, away(5.0), HOME, away(-5.0))
    rig.wait_for(ENDED)
    rig.wait_ms(24)
    assert [level for name, level, _ in seen if name == "knot"] == [True, False, True]
    moving = [(level, index) for name, level, index in seen if name == "moving"]
    assert moving[0][0] is True
    assert moving[-1][0] is False
    # "moving" changes in the submit interpreter's turns, every 12 ms of the world's 1 ms steps.
    assert {int(str(index)) % 12 for _, index in moving} == {0}


def test_without_lines_the_state_says_so_and_the_program_runs() -> None:
    rig = Rig()
    assert rig.controller.lines is None
    assert rig.state("WRIST") == NONE
    begin(rig, away(5.0))
    rig.wait_for(ENDED)


def test_a_run_command_waits_for_wrist_ok() -> None:
    rig, lines = connected()
    lines.wrist_ok = False
    begin(rig, away(5.0))
    rig.wait_ms(500)
    assert (rig.state("STATUS"), rig.state("WRIST")) == (READY, OFF)
    assert rig.controller.true_joints_deg() == HOME
    lines.wrist_ok = True
    rig.wait_for(ENDED)
    assert rig.state("WRIST") == ON


def test_the_fall_of_wrist_ok_brakes_the_arm_and_only_a_new_session_moves_again() -> None:
    rig, lines = connected()
    begin(rig, away(90.0), HOME)
    rig.wait_for(RUNNING)
    rig.wait_ms(300)
    before = rig.controller.true_joints_deg()[0]
    lines.wrist_ok = False
    rig.wait_ms(13)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, FAULT_WRIST)
    rig.wait_ms(300)
    stood = rig.controller.true_joints_deg()
    assert before < stood[0] < 80.0
    lines.wrist_ok = True
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == stood
    rig.session(2)
    rig.knot(1, HOME)
    rig.write("SPH_LAST", "1")
    rig.command(RUN)
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == HOME


def stopping_deg(stop: Callable[[Rig, TerminalLines], None]) -> float:
    """How far axis 1 turns after a stop at full speed."""
    rig, lines = connected()
    begin(rig, away(150.0))
    rig.wait_for(RUNNING)
    rig.wait_ms(500)
    before = rig.controller.true_joints_deg()[0]
    stop(rig, lines)
    rig.wait_ms(500)
    return rig.controller.true_joints_deg()[0] - before


def test_the_fall_of_wrist_ok_brakes_harder_than_a_stop_command() -> None:
    fell = stopping_deg(lambda rig, lines: setattr(lines, "wrist_ok", False))
    told = stopping_deg(lambda rig, lines: rig.command(STOP))
    assert 0.0 < fell < 0.7 * told


def test_the_fall_of_wrist_ok_in_a_hold_ends_the_motion() -> None:
    rig, lines = connected()
    begin(rig, away(90.0), HOME)
    rig.wait_for(RUNNING)
    rig.wait_ms(200)
    rig.command(HOLD)
    rig.wait_for(HOLDING)
    stood = rig.controller.true_joints_deg()
    lines.wrist_ok = False
    rig.wait_ms(26)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, FAULT_WRIST)
    lines.wrist_ok = True
    rig.command(RUN)
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == stood


def test_a_controller_whose_always_true_input_is_not_does_not_move() -> None:
    rig = Rig()
    rig.controller.krc.terminals.inputs[1024] = False
    begin(rig, away(5.0))
    rig.wait_ms(500)
    assert (rig.state("STATUS"), rig.state("WRIST")) == (READY, OFF)
    assert rig.controller.true_joints_deg() == HOME
