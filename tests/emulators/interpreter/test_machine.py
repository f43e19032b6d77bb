"""Machine data, the advance run's stops one by one, stops of the program, and its states."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sphmctl.emulators.interpreter import submit_program
from sphmctl.emulators.krl.findings import KrlError
from tests.emulators.interpreter.rig import Rig, config, program
from tests.emulators.interpreter.test_advance import INI, POINTS, begun
from tests.emulators.interpreter.test_concurrency import moving, put, states

# 2.2 What stops the advance run


@pytest.mark.parametrize(
    "name",
    ["$AXIS_ACT.A1", "$AXIS_ACT_MEAS.A1", "$POS_ACT.X", "$AXIS_INT.A1", "$POS_INT.X", "$VEL_ACT",
     "$VEL_AXIS_ACT[1]", "$CURR_ACT[1]", "$TORQ_DIFF[1]", "$ROB_TIMER", "$TIMER[3]", "$ANIN[1]"],
)  # fmt: skip
def test_a_look_at_an_actual_value_stops_the_advance_run(name: str) -> None:
    """[C] $AXIS_ACT, [M] the rest."""
    data = f"{POINTS}\nREAL Q"
    rig = begun(f"PTP P\nON_ERROR_PROCEED\nQ={name}\nX=1", data)
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == 10.0


@pytest.mark.parametrize(
    "name", ["$MOVE_BCO", "$POWER_FAIL", "$T2", "$EXT", "$AUT", "$ON_PATH", "$PERI_RDY", "$IN[7]"]
)
def test_a_look_at_an_output_behind_a_signal_stops_the_advance_run(name: str) -> None:
    """[C] $T1, $T2, $EXT.. are outputs; [M] the rest."""
    rig = begun(f"PTP P\nIF {name} THEN\nENDIF\nX=1")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == 10.0


@pytest.mark.parametrize("name", ["$ACT_BASE", "$ACT_TOOL", "$ACT_EX_AX"])
@pytest.mark.parametrize(("before", "place_deg"), [("", 10.0), ("CONTINUE\n", 0.0)])
def test_a_number_of_a_frame_stops_the_advance_run(
    name: str, before: str, place_deg: float
) -> None:
    """[C] KUKA prefixes CONTINUE."""
    rig = begun(f"PTP P\n{before}{name}=1\nX=1")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == pytest.approx(place_deg, abs=1.0)


@pytest.mark.parametrize(
    "line", ["WAIT FOR NOT $IN[3]", "IF ($T1 OR $T2) THEN\nENDIF", "PULSE($OUT[1],TRUE,0.1)",
             "X=2*X", "$OUT[2]=TRUE"],
)  # fmt: skip
def test_continue_spares_what_kuka_and_vw_put_behind_it(line: str) -> None:
    """[C] CONTINUE before $OUT, WAIT FOR $IN, IF ($T1 OR $T2), PULSE."""
    rig = begun(f"PTP P\nCONTINUE\n{line}\nX=1")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] < 1.0


def test_on_error_an_undefined_speed_is_told_by_its_axis() -> None:
    """[C] the first PTP without $VEL_AXIS is a run-time error."""
    rig = Rig(program("PTP $AXIS_ACT"), config(POINTS)).run()
    assert "$VEL_AXIS[1] was never set" in str(rig.krc.messages[-1])


# 2.3, 2.6 Machine data


def test_initmov_sets_what_config_dat_says() -> None:
    """[C] $ADVANCE 3, velocities 100 %, accelerations 50 %, $APO 50 %, 3 mm, 100 %, 5 deg."""
    rig = Rig(program("BAS(#INITMOV,0)"), config("")).run()
    assert rig.krc.state == "P_END"
    assert rig.get("$ADVANCE") == 3
    assert rig.get("$VEL_AXIS")[:6] == [100.0] * 6
    assert rig.get("$ACC_AXIS")[:6] == [50.0] * 6
    apo = rig.get("$APO")
    assert [apo[part] for part in ("CPTP", "CDIS", "CVEL", "CORI")] == [50.0, 3.0, 100.0, 5.0]


def test_the_arms_limits_are_its_machine_data() -> None:
    """[C] $machine.dat and $robcor.dat of the R900."""
    rig = Rig(config(""))
    low, high = rig.get("$SOFTN_END")[:6], rig.get("$SOFTP_END")[:6]
    assert low == [-170, -190, -120, -185, -120, -350]
    assert high == [170, 45, 156, 185, 120, 350]
    assert rig.get("$RED_VEL_AXC")[:6] == [17, 20, 17, 16, 15, 10]
    assert rig.get("$RED_ACC_AXC")[:6] == [12, 25, 10, 10, 10, 10]
    assert rig.get("$APO_DIS_PTP")[:6] == [90.0] * 6
    assert (rig.get("$VEL_MA")["CP"], rig.get("$VEL_MA")["ORI1"]) == (3.0, 400.0)
    assert (rig.get("$ACC_MA")["CP"], rig.get("$ACC_MA")["ORI1"]) == (10.0, 1000.0)
    assert (rig.get("$RED_T1"), rig.get("$NUM_AX")) == (7, 6)


# 2.5 Exact stops instead of blends

SHORT = "$APO.CPTP=100\nP.A1=20\nPTP P C_PTP\n{}\nP.A1=40\nPTP P"


@pytest.mark.parametrize(("mode", "told"), [("EX", 0), ("T1", 1)])
def test_a_lost_blend_is_told_in_t1_only(mode: str, told: int) -> None:
    """[second hand] "Approximate positioning not possible" shows in T1 and T2 only."""
    rig = begun(SHORT.format("WAIT SEC 0"), mode=mode)
    while rig.krc.state != "P_END" and rig.time_s < 60.0:
        rig.step()
        if rig.krc.state == "P_STOP":
            rig.krc.start()
    texts = [message.text for message in rig.krc.messages]
    assert sum("approximate positioning not possible" in text for text in texts) == told
    assert (rig.krc.exact_stops, rig.krc.state) == (1, "P_END")


def test_stopnoaprox_stops_the_program_there() -> None:
    """[second hand] $STOPNOAPROX=TRUE turns it into a stop for debugging."""
    rig = begun("$STOPNOAPROX=TRUE\n" + SHORT.format("WAIT SEC 0"))
    rig.until(lambda: rig.krc.state != "P_ACTIVE")
    assert (rig.krc.state, rig.get("$STOPMESS")) == ("P_STOP", True)
    assert rig.mover.joints_deg[0] == pytest.approx(20.0)


def test_the_same_target_twice_is_no_blend() -> None:
    """[I] a zero-length block before or after."""
    rig = begun("P.A1=20\nPTP P C_PTP\nPTP P C_PTP\nP.A1=40\nPTP P")
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.krc.exact_stops >= 1


# 2.7 Override and stops


def test_a_program_sets_the_override() -> None:
    """[C] BAS and SPS code write $OV_PRO directly."""
    rig = begun("$OV_PRO=10\nP.A1=40\nPTP P")
    rig.until(lambda: rig.mover.moving)
    assert rig.mover.override_percent == 10.0
    rig.go(0.5)
    assert max(map(abs, rig.mover.speed_deg_s)) <= 36.001


def test_rob_stop_keeps_the_arm_until_it_is_released() -> None:
    """[C] exist, [M] motion stays blocked until released."""
    plc = ["IF GO THEN", "OK=ROB_STOP(#RAMP_DOWN)", "ELSE", "OK=ROB_STOP_RELEASE()", "ENDIF"]
    robot = program(INI + "P.A1=60\nPTP P")
    rig = Rig(robot, submit_program([], plc), config(f"{POINTS}\nBOOL OK"))
    rig.krc.select("T")
    rig.krc.start()
    moving(rig)
    put(rig, "GO", "TRUE")
    rig.until(lambda: not rig.mover.moving)
    assert rig.mover.joints_deg[0] < 59.0
    assert not rig.krc.start()
    put(rig, "GO", "FALSE")
    rig.cycles(2)
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state == "P_END")


def test_cwrite_resets_a_program() -> None:
    """[C] RESET 1."""
    plc = ["IF GO THEN", "GO=FALSE", 'CWRITE($CMD,ST,MO,"RESET 1")', "ENDIF"]
    data = f"{POINTS}\nDECL STATE_T ST\nDECL MODUS_T MO"
    rig = Rig(program(INI + "X=X+1\nWAIT FOR FALSE"), submit_program([], plc), config(data))
    rig.krc.select("T")
    rig.krc.start()
    rig.until(lambda: rig.get("X") == 1)
    put(rig, "GO", "TRUE")
    rig.cycles(3)
    assert (rig.krc.state, rig.get("ST")["RET1"]) == ("P_RESET", "CMD_OK")
    assert rig.krc.start()
    rig.until(lambda: rig.get("X") == 2)


# 3 Conditions, flags, signals


@pytest.mark.parametrize(
    ("condition", "act"),
    [
        ("$IN[4]==FALSE", lambda rig: rig.krc.terminals.inputs.__setitem__(3, False)),
        ("$FLAG[9]==TRUE", lambda rig: put(rig, "$FLAG[9]", "TRUE")),
        ("$CYCFLAG[2]", lambda rig: put(rig, "GO", "TRUE")),
        ("$TIMER_FLAG[5]", lambda rig: put(rig, "$TIMER[5]", "1")),
        ("$STOPMESS==TRUE", lambda rig: setattr(rig.panel, "stop_message", True)),
        ("GO", lambda rig: put(rig, "GO", "TRUE")),
        ("$PRO_STATE0<>#P_ACTIVE", lambda rig: rig.krc.stop_submit()),
        ("$OV_PRO<50", lambda rig: put(rig, "$OV_PRO", "10")),
    ],
)
def test_an_interrupt_fires_on_any_condition(condition: str, act: Callable[[Rig], None]) -> None:
    """[C] conditions seen in the field."""
    body = f"""$CYCFLAG[2]=GO
INTERRUPT DECL 20 WHEN {condition} DO HIT()
INTERRUPT ON 20
WAIT FOR FALSE"""
    data = config(POINTS)
    rig = Rig(program(body, "DEF HIT()", "X=X+1", "END"), submit_program([], []), data)
    rig.krc.terminals.inputs[3] = True
    put(rig, "$TIMER[5]", "-1000")
    rig.krc.select("T")
    rig.krc.start()
    rig.cycles(3)
    assert rig.get("X") == 0
    act(rig)
    rig.cycles(2)
    assert rig.get("X") == 1


def test_flags_are_shared_by_both_interpreters_and_the_variable_server() -> None:
    """[M] $FLAG[1..1024] is plain BOOL."""
    plc = ["$FLAG[1024]=$FLAG[1]"]
    rig = Rig(program("WAIT FOR $FLAG[1024]\nX=1"), submit_program([], plc), config(POINTS))
    rig.krc.select("T")
    rig.krc.start()
    rig.cycles(3)
    put(rig, "$FLAG[1]", "TRUE")
    rig.cycles(3)
    assert (rig.get("X"), rig.text("$FLAG[1024]"), rig.text("$FLAG[1025]")) == (1, "TRUE", None)


def test_a_signal_has_at_most_32_bits() -> None:
    """[C] SIGNAL n $OUT[1] TO $OUT[32], as an INT."""
    rig = Rig(program("WORD=-2"), config("SIGNAL WORD $OUT[1] TO $OUT[32]")).run()
    assert rig.get("$OUT")[:33] == [False, *[True] * 31, False]
    assert rig.text("WORD") == "-2"
    with pytest.raises(KrlError, match=r"\$config\.dat:2"):
        Rig(config("SIGNAL WORD $OUT[1] TO $OUT[33]"))


def test_a_waiting_routine_blocks_less_urgent_ones() -> None:
    """[M] WAIT is allowed in the routine, but blocks that priority."""
    body = """INTERRUPT DECL 10 WHEN $FLAG[1] DO LONG()
INTERRUPT DECL 11 WHEN $FLAG[2] DO SHORT()
INTERRUPT ON
WAIT FOR FALSE"""
    more = ("DEF LONG()", "WAIT SEC 0.1", "X=X+1", "END", "DEF SHORT()", "Y=X+10", "END")
    rig = Rig(program(body, *more), config(POINTS))
    rig.krc.select("T")
    rig.krc.start()
    for number in (1, 2):
        put(rig, f"$FLAG[{number}]", "TRUE")
        rig.cycles(2)
    assert rig.get("Y") == 0
    rig.go(0.15)
    assert rig.get("Y") == 11


# 4 States that the table has beside those of a plain run


def active(body: str = "PTP P\nWAIT FOR GO", *more: str) -> Rig:
    data = config(POINTS.replace("A1 10", "A1 60"))
    rig = Rig(program(INI + body, *more), data)
    rig.krc.select("T")
    assert rig.krc.start()
    moving(rig)
    return rig


def test_a_program_that_waits_is_active_and_does_not_move() -> None:
    """[M]/[I] running, in WAIT or starved."""
    rig = active()
    rig.until(lambda: not rig.mover.moving)
    assert states(rig) == ["#P_ACTIVE", "TRUE", "FALSE", "TRUE", "FALSE", "TRUE"]


def test_a_braked_routine_that_waits_is_active_and_does_not_move() -> None:
    """[M]/[I] BRAKE in an ISR, waiting."""
    body = "INTERRUPT DECL 20 WHEN GO DO HALTED()\nINTERRUPT ON 20\nPTP P\nWAIT SEC 0"
    rig = active(body, "DEF HALTED()", "BRAKE", "X=1", "WAIT FOR NOT GO", "END")
    put(rig, "GO", "TRUE")
    rig.until(lambda: rig.get("X") == 1)
    assert states(rig) == ["#P_ACTIVE", "TRUE", "FALSE", "TRUE", "FALSE", "TRUE"]


def test_a_halt_stops_without_a_message() -> None:
    """[M]/[I] HALT: #P_STOP, drives on."""
    rig = active("PTP P\nHALT")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert states(rig) == ["#P_STOP", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]


def test_an_open_gate_stops_with_a_message_and_drives_off() -> None:
    """[M]/[I] E-stop or gate."""
    rig = active()
    rig.panel.user_saf = False
    rig.krc.stop(1, "gate open")
    rig.until(lambda: not rig.mover.moving)
    rig.cycles()
    assert states(rig) == ["#P_STOP", "FALSE", "FALSE", "TRUE", "TRUE", "FALSE"]
    assert (rig.text("$USER_SAF"), rig.text("$ALARM_STOP")) == ("FALSE", "TRUE")


def test_a_run_time_error_stops_with_a_message_and_drives_on() -> None:
    """[M]/[I] run-time error."""
    rig = active("PTP P\nWAIT SEC 0\nX=1/Y")
    rig.until(lambda: rig.krc.state == "P_STOP")
    rig.until(lambda: not rig.mover.moving)
    assert states(rig) == ["#P_STOP", "FALSE", "FALSE", "TRUE", "TRUE", "TRUE"]


def test_drives_off_by_the_submit_interpreter_keep_the_program_from_moving() -> None:
    """[C] $DRIVES_ENABLE is written by kroshu's submit program."""
    rig = active()
    rig.memory.put("$DRIVES_ENABLE", False)
    rig.until(lambda: not rig.mover.moving)
    rig.cycles()
    assert rig.text("$PERI_RDY") == "FALSE"
    assert rig.mover.joints_deg[0] < 59.0
    rig.memory.put("$DRIVES_ENABLE", True)
    assert rig.text("$PERI_RDY") == "TRUE"
