"""The robot program's behaviour as firmware/krc/INTERFACE.md defines it, seen from outside."""

from __future__ import annotations

import pytest

from sphmctl.emulators.controller import Options
from tests.emulators.krc4_rig import (
    ENDED,
    FAULT,
    HOLD,
    HOLDING,
    HOME,
    IDLE,
    READY,
    RUN,
    RUNNING,
    STOP,
    STOPPED,
    Rig,
    away,
)

NONE, BEAT, SEQUENCE, KNOT, CONTROLLER = range(5)


def running(angle_deg: float = 90.0, velocity: float = 50.0) -> Rig:
    """A rig whose arm is in the middle of its only, long knot."""
    rig = Rig()
    rig.session()
    rig.knot(1, away(angle_deg), velocity)
    rig.write("SPH_LAST", "1")
    rig.command(RUN)
    rig.wait_ms(250)
    assert rig.state("STATUS") == RUNNING
    return rig


def test_before_the_first_session_the_program_is_idle_and_takes_no_knots() -> None:
    rig = Rig()
    rig.knot(1, away(10.0))
    rig.command(RUN)
    rig.wait_ms(100)
    assert rig.state("STATUS") == IDLE
    assert rig.controller.true_joints_deg() == HOME


def test_a_motion_of_several_knots_ends_on_the_last_one() -> None:
    rig = Rig()
    rig.session()
    rig.write("SPH_LAST", "3")
    for number, angle in enumerate((10.0, 20.0, 5.0), start=1):
        rig.knot(number, away(angle))
    rig.command(RUN)
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(5.0)
    assert (rig.state("RD"), rig.state("DONE"), rig.state("FAULT")) == (3, 3, NONE)
    assert rig.state("STOPPED") is True


def test_three_blocks_wait_behind_the_running_one() -> None:
    rig = Rig()
    rig.session()
    for number in range(1, 7):
        rig.knot(number, away(float(number)))
    rig.command(RUN)
    rig.wait_ms(60)
    # RD rises behind the motion statement, at which the program waits with the fourth block.
    assert (rig.state("RD"), rig.state("DONE")) == (3, 0)
    rig.wait_for(1, field="DONE")
    rig.wait_ms(24)
    assert (rig.state("RD"), rig.state("DONE")) == (4, 1)


def test_a_taken_block_keeps_the_values_it_was_taken_with() -> None:
    rig = Rig()
    rig.session()
    rig.write("SPH_LAST", "2")
    rig.knot(1, away(5.0))
    rig.knot(2, away(9.0))
    rig.command(RUN)
    rig.wait_for(2, 60, "RD")
    rig.write("SPH_KNOT[2].Q.A1", "-50.0")
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(9.0)


def test_the_ring_goes_round() -> None:
    rig = Rig()
    rig.session()
    rig.write("SPH_LAST", "70")
    for number in range(1, 65):
        rig.knot(number, away(number * 0.1))
    rig.command(RUN)
    rig.wait_for(64, 20_000, field="RD")
    for number in range(65, 71):
        rig.knot(number, away(number * 0.1))
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg()[0] == pytest.approx(7.0, abs=1e-6)


def test_a_starved_program_waits_in_running_and_goes_on() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(5.0))
    rig.command(RUN)
    rig.wait_ms(600)
    assert (rig.state("STATUS"), rig.state("DONE"), rig.state("MOVING")) == (RUNNING, 1, False)
    rig.write("SPH_LAST", "2")
    rig.knot(2, away(8.0))
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(8.0)


def test_the_state_is_of_the_last_12_ms_cycle_all_fields_together() -> None:
    rig = running()
    while rig.world.index % 12:
        rig.wait_ms(1)
    time, joints = rig.state("TIME"), rig.controller.true_joints_deg()
    rig.wait_ms(11)
    state_q = rig.state("Q")
    assert isinstance(state_q, dict)
    assert rig.state("TIME") == time
    # A REAL has 24 bits.
    assert state_q["A1"] == pytest.approx(joints[0], rel=1e-7)
    assert abs(joints[0] - rig.controller.true_joints_deg()[0]) > 0.1
    rig.wait_ms(1)
    assert isinstance(time, int)
    assert rig.state("TIME") == time + 12
    assert f"TIME {time + 12}, " in (rig.read("SPH_STATE") or "")
    rig.wait_ms(12)
    assert f"TIME {time + 24}, " in (rig.read("SPH_STATE") or "")


def test_a_held_motion_goes_on_along_its_path_to_the_exact_end() -> None:
    rig = running()
    rig.command(HOLD)
    rig.wait_ms(13)
    assert rig.state("STATUS") == RUNNING, "it is still braking"
    rig.wait_for(HOLDING)
    held = rig.controller.true_joints_deg()
    rig.wait_ms(300)
    assert rig.controller.true_joints_deg() == held
    rig.command(RUN)
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(90.0)
    angles = [row[0] for row in rig.truth]
    assert angles == sorted(angles)


def test_a_stop_forgets_everything_until_a_new_session() -> None:
    rig = Rig()
    rig.session()
    for number in range(1, 4):
        rig.knot(number, away(30.0 * number))
    rig.command(RUN)
    rig.wait_ms(250)
    rig.command(STOP)
    rig.wait_for(STOPPED)
    stood = rig.controller.true_joints_deg()
    rig.command(RUN)
    rig.wait_ms(500)
    assert rig.state("STATUS") == STOPPED
    assert rig.controller.true_joints_deg() == stood
    rig.session(2)
    assert (rig.state("RD"), rig.state("DONE")) == (0, 0)
    rig.write("SPH_LAST", "1")
    rig.knot(1, HOME)
    rig.command(RUN)
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == HOME


def test_a_stop_in_a_hold_forgets_the_held_block() -> None:
    rig = running()
    rig.command(HOLD)
    rig.wait_for(HOLDING)
    stood = rig.controller.true_joints_deg()
    rig.command(STOP)
    rig.wait_for(STOPPED, 60)
    rig.command(RUN)
    rig.wait_ms(300)
    assert rig.controller.true_joints_deg() == stood


def test_a_late_heartbeat_holds_and_a_new_one_goes_on() -> None:
    rig = running(150.0, 20.0)
    rig.beating = False
    rig.wait_ms(80)
    speed = rig.controller.arm.speed_deg_s[0]
    assert speed == pytest.approx(72.0)
    rig.wait_ms(100)
    rig.wait_for(HOLDING, 100)
    rig.beating = True
    rig.wait_ms(60)
    assert rig.state("STATUS") == RUNNING
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(150.0)


def test_a_lost_heartbeat_ends_the_motion() -> None:
    rig = running()
    rig.beating = False
    rig.wait_ms(1100)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, BEAT)
    stood = rig.controller.true_joints_deg()
    rig.beating = True
    rig.wait_ms(300)
    assert rig.state("STATUS") == FAULT
    assert rig.controller.true_joints_deg() == stood
    rig.session(2)
    assert rig.state("FAULT") == NONE


def test_a_daemon_that_never_beats_does_not_move_the_arm() -> None:
    rig = Rig()
    rig.beating = False
    rig.wait_ms(1500)
    rig.session()
    rig.knot(1, away(10.0))
    rig.command(RUN)
    rig.wait_ms(30)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, BEAT)
    rig.beating = True
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == HOME


def test_a_session_is_taken_only_at_rest_and_only_when_it_is_new_and_positive() -> None:
    rig = running()
    rig.write("SPH_SESSION", "2")
    rig.wait_ms(50)
    assert (rig.state("SESSION"), rig.state("STATUS")) == (1, RUNNING)
    rig.command(HOLD)
    rig.wait_for(HOLDING)
    assert rig.state("SESSION") == 1
    rig.command(STOP)
    rig.wait_for(STOPPED)
    rig.wait_ms(30)
    assert (rig.state("SESSION"), rig.state("STATUS")) == (1, STOPPED)
    rig.write("SPH_CMD", "0")
    rig.wait_ms(40)
    assert (rig.state("SESSION"), rig.state("STATUS")) == (2, READY)
    rig.write("SPH_SESSION", "0")
    rig.wait_ms(30)
    assert rig.state("SESSION") == 2
    rig.write("SPH_SESSION", "-3")
    rig.wait_ms(30)
    assert rig.state("SESSION") == 2


def test_a_slot_with_another_sequence_number_is_a_fault() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(30.0))
    rig.write("SPH_KNOT[1].SEQ", "65")
    rig.command(RUN)
    rig.wait_for(FAULT, 60)
    assert rig.state("FAULT") == SEQUENCE
    empty = Rig()
    empty.session()
    empty.write("SPH_WR", "1")
    empty.command(RUN)
    empty.wait_for(FAULT, 60)
    assert empty.state("FAULT") == SEQUENCE


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("VEL", "0.0"),
        ("VEL", "100.1"),
        ("ACC", "-1.0"),
        ("ACC", "101"),
        ("Q.A1", "170.5"),
        ("Q.A2", "45.01"),
    ],
)
def test_an_impossible_knot_is_a_fault_that_stops_the_block_before(field: str, text: str) -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(90.0))
    rig.knot(2, away(10.0))
    rig.write(f"SPH_KNOT[2].{field}", text)
    rig.command(RUN)
    rig.wait_for(FAULT, 60)
    assert rig.state("FAULT") == KNOT
    rig.wait_ms(1000)
    stood = rig.controller.true_joints_deg()
    assert stood[0] < 20.0
    rig.command(RUN)
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == stood


def test_a_knot_with_an_axis_that_was_never_set_stops_the_program_at_its_line() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(90.0))
    rig.knot(2, away(10.0))
    rig.write("SPH_KNOT[2].Q", "{A1 1.0}")
    rig.command(RUN)
    rig.wait_for(FAULT, 60)
    assert rig.state("FAULT") == CONTROLLER
    assert rig.read("$PRO_STATE1") == "#P_STOP"
    message = rig.controller.krc.messages[-1]
    assert "sph_run.src" in message.file
    assert "was never set" in message.text
    rig.wait_ms(1000)
    assert rig.controller.true_joints_deg()[0] < 20.0


def test_a_session_waits_until_the_arm_stands_after_a_fault() -> None:
    rig = running()
    rig.beating = False
    rig.wait_for(FAULT, 1500)
    rig.beating = True
    rig.command(0)
    rig.write("SPH_SESSION", "2")
    rig.wait_for(READY)
    assert (rig.state("SESSION"), rig.state("MOVING")) == (2, False)


def test_an_emergency_stop_while_running_is_a_fault_on_the_path() -> None:
    rig = running()
    rig.controller.emergency_stop()
    rig.wait_for(FAULT, 60)
    assert rig.state("FAULT") == CONTROLLER
    rig.wait_ms(400)
    stood = rig.controller.true_joints_deg()
    assert 0.0 < stood[0] < 90.0
    assert stood[1:] == HOME[1:]
    shown = {name: rig.state(name) for name in ("SAFE", "STOPMESS", "DRIVES", "MOVING")}
    assert shown == {"SAFE": False, "STOPMESS": True, "DRIVES": False, "MOVING": False}
    assert rig.read("$PRO_STATE1") == "#P_STOP"
    assert rig.read("$ALARM_STOP") == "FALSE"
    rig.command(0)
    rig.write("SPH_SESSION", "2")
    rig.wait_ms(30)
    assert rig.state("SESSION") == 1, "the robot interpreter stands"
    rig.controller.release()
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == stood, "nothing old moves after the release"
    assert (rig.state("SESSION"), rig.state("STATUS"), rig.state("SAFE")) == (2, READY, True)


def test_an_open_gate_and_a_mode_change_while_running_are_faults() -> None:
    gate = running()
    gate.controller.open_gate()
    gate.wait_for(FAULT, 60)
    assert (gate.state("FAULT"), gate.state("SAFE")) == (CONTROLLER, False)
    mode = running()
    mode.controller.set_mode("T2")
    mode.wait_for(FAULT, 60)
    assert (mode.state("FAULT"), mode.state("MODE"), mode.state("OV")) == (CONTROLLER, "T2", 10)
    quick = running()
    quick.controller.set_mode("AUT")
    quick.controller.release()
    quick.wait_for(FAULT, 60)
    with pytest.raises(ValueError, match="T1, T2, AUT, EX"):
        mode.controller.set_mode("T3")


def test_a_run_command_on_a_stopped_controller_is_a_fault_and_not_kept_for_later() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(30.0))
    rig.controller.emergency_stop()
    rig.command(RUN)
    rig.wait_ms(30)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, CONTROLLER)
    rig.controller.release()
    rig.wait_ms(500)
    assert rig.controller.true_joints_deg() == HOME


def test_the_override_scales_the_time_and_shows_in_the_state() -> None:
    rig = Rig()
    rig.write("$OV_PRO", "10")
    rig.session()
    rig.write("SPH_LAST", "1")
    rig.knot(1, away(10.0))
    rig.command(RUN)
    rig.wait_ms(1000)
    assert (rig.state("OV"), rig.state("STATUS")) == (10, RUNNING)
    assert rig.controller.arm.speed_deg_s[0] <= 18.0 + 1e-9
    rig.wait_for(ENDED)
    assert rig.controller.true_joints_deg() == away(10.0)


def test_a_program_that_is_not_selected_shows_its_state_but_takes_no_session() -> None:
    rig = Rig(Options(program_state="P_FREE"))
    rig.write("SPH_SESSION", "1")
    rig.wait_ms(30)
    assert (rig.state("STATUS"), rig.state("SESSION")) == (IDLE, 0)
    assert rig.read("$PRO_NAME1[]") == '""'
