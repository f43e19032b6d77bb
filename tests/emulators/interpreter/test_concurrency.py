"""Rules of submit interpreter, interrupts, RESUME, triggers, timers, lines, and program states."""

from __future__ import annotations

import pytest

from sphmctl.emulators.interpreter import Options, submit_program
from tests.emulators.interpreter.rig import Rig, config, program

INI = "BAS(#INITMOV,0)\nPTP $AXIS_ACT\n"
DATA = """INT X=0
INT Y=0
INT N=0
BOOL HOLD=FALSE
BOOL GO=FALSE
BOOL C=FALSE
E6AXIS P={A1 60,A2 -90,A3 90,A4 0,A5 90,A6 0}
"""


def begun(
    body: str, *more: str, head: str = "", options: Options | None = None, data: str = ""
) -> Rig:
    rig = Rig(program(INI + body, *more, head=head), config(DATA + data), options=options)
    rig.krc.select("T")
    assert rig.krc.start()
    return rig


def until_x(rig: Rig) -> None:
    rig.until(lambda: rig.get("X") == 1)


def put(rig: Rig, name: str, text: str) -> None:
    assert rig.memory.write_text(name, text)


def moving(rig: Rig) -> None:
    rig.until(lambda: rig.mover.joints_deg[0] > 5.0)


# 3 Submit


def test_the_submit_interpreter_runs_beside_and_before_any_program() -> None:
    """[C] starts at boot, loops behind WAIT FOR NOT($POWER_FAIL), once in a cycle (guess)."""
    rig = Rig(submit_program(["X=100"], ["X=X+1"]), config(DATA))
    assert rig.krc.submit_state == "P_ACTIVE"
    rig.cycles(10)
    assert rig.get("X") == 110
    assert rig.text("$PRO_STATE1") == "#P_FREE"


@pytest.mark.parametrize("line", ["PTP P", "BRAKE", "RESUME"])
def test_the_submit_interpreter_has_no_arm(line: str) -> None:
    """[M] no motion of robot axes, no BRAKE/RESUME."""
    rig = Rig(submit_program([], [line]), config(DATA))
    rig.cycles(2)
    assert rig.krc.submit_state == "P_STOP"
    assert "submit" in rig.krc.messages[-1].text


def test_cwrite_of_the_submit_interpreter_ends_a_program() -> None:
    """[C] kroshu: STOP 1, wait until $PRO_STATE1 leaves #P_ACTIVE, CANCEL 1, wait for #P_FREE."""
    plc = [
        "IF GO THEN", "GO=FALSE", 'CWRITE($CMD,ST,MO,"STOP 1")', "WAIT FOR $PRO_STATE1<>#P_ACTIVE",
        "X=1", 'CWRITE($CMD,ST,MO,"CANCEL 1")', "WAIT FOR $PRO_STATE1==#P_FREE", "X=2", "ENDIF",
    ]  # fmt: skip
    data = DATA + "DECL STATE_T ST\nDECL MODUS_T MO"
    rig = Rig(program(INI + "PTP P\nWAIT FOR FALSE"), submit_program([], plc), config(data))
    rig.krc.select("T")
    rig.krc.start()
    moving(rig)
    put(rig, "GO", "TRUE")
    rig.until(lambda: rig.get("X") == 2)
    assert rig.get("ST")["RET1"] == "CMD_OK"
    rig.until(lambda: not rig.mover.moving)
    assert rig.mover.joints_deg[0] < 50.0


def test_an_interpreter_cannot_stop_itself() -> None:
    """[C] 2.7."""
    rig = begun('CWRITE($CMD,ST,MO,"STOP 1")\nX=1', data="DECL STATE_T ST\nDECL MODUS_T MO")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.get("ST")["RET1"] == "CMD_REJ"


def test_submit_runs_a_program_in_ext() -> None:
    """[C] CWRITE RUN /R1/CELL() in #EX."""
    plc = ["IF GO THEN", "GO=FALSE", 'CWRITE($CMD,ST,MO,"RUN /R1/T()")', "ENDIF"]
    data = DATA + "DECL STATE_T ST\nDECL MODUS_T MO"
    rig = Rig(program("X=7\nWAIT SEC 1"), submit_program([], plc), config(data))
    put(rig, "GO", "TRUE")
    rig.until(lambda: rig.get("X") == 7)


# 3 Interrupts


def test_an_interrupt_fires_on_the_rising_edge_and_returns() -> None:
    """[C] interrupts both runs."""
    body = "INTERRUPT DECL 20 WHEN C DO F()\nINTERRUPT ON 20\nWAIT FOR GO\nY=1"
    rig = begun(body, "DEF F()", "N=N+1", "END")
    rig.go(0.3)
    for _ in range(2):
        put(rig, "C", "TRUE")
        rig.cycles(3)
        put(rig, "C", "FALSE")
        rig.cycles(1)
    assert rig.get("N") == 2
    put(rig, "GO", "TRUE")
    rig.until(lambda: rig.get("Y") == 1)


def test_an_interrupt_is_off_after_its_declaration() -> None:
    """[M] declared in statements, starts OFF."""
    rig = begun("INTERRUPT DECL 20 WHEN C DO N=N+1\nWAIT FOR GO")
    rig.go(0.3)
    put(rig, "C", "TRUE")
    rig.cycles(3)
    assert rig.get("N") == 0


@pytest.mark.parametrize(("already", "count"), [(False, 0), (True, 1)])
def test_a_condition_that_is_true_already_fires_by_option(already: bool, count: int) -> None:
    """[U] sources disagree."""
    body = "C=TRUE\nINTERRUPT DECL 20 WHEN C DO N=N+1\nINTERRUPT ON 20\nWAIT FOR GO"
    rig = begun(body, options=Options(fires_when_already_true=already))
    rig.go(0.3)
    assert rig.get("N") == count


def test_a_disabled_interrupt_keeps_its_event_and_one_that_is_off_does_not() -> None:
    """[M] ENABLE/DISABLE: held events are kept."""
    for word, back, count in (("DISABLE", "ENABLE", 1), ("OFF", "ON", 0)):
        body = (
            f"INTERRUPT DECL 20 WHEN C DO N=N+1\nINTERRUPT ON 20\nINTERRUPT {word} 20\nX=1\n"
            f"WAIT FOR GO\nINTERRUPT {back} 20\nWAIT SEC 1"
        )
        rig = begun(body)
        until_x(rig)
        put(rig, "C", "TRUE")
        rig.cycles(3)
        assert rig.get("N") == 0
        put(rig, "C", "FALSE" if word == "OFF" else "TRUE")
        put(rig, "GO", "TRUE")
        rig.cycles(4)
        assert rig.get("N") == count


def test_a_lower_number_is_more_urgent() -> None:
    """[C] use: 20 interrupts 30, 30 waits for 20."""
    body = """INTERRUPT DECL 20 WHEN C DO F()
INTERRUPT DECL 30 WHEN HOLD DO G()
INTERRUPT ON
WAIT FOR FALSE"""
    more = (
        "DEF F()", "X=1", "WAIT SEC 0.1", "X=2", "END",
        "DEF G()", "Y=1", "WAIT SEC 0.1", "Y=2", "END",
    )  # fmt: skip
    rig = begun(body, *more)
    rig.go(0.3)
    put(rig, "C", "TRUE")
    rig.cycles(2)
    put(rig, "HOLD", "TRUE")
    rig.cycles(4)
    assert (rig.get("X"), rig.get("Y")) == (1, 0)
    rig.go(0.1)
    assert (rig.get("X"), rig.get("Y")) == (2, 1)
    put(rig, "C", "FALSE")
    rig.cycles(1)
    rig.memory.put("X", 0)
    put(rig, "C", "TRUE")
    rig.cycles(2)
    assert (rig.get("X"), rig.get("Y")) == (1, 1)


def test_an_interrupt_ends_with_its_routine_unless_it_is_global() -> None:
    """[M] valid in the declaring level and below, GLOBAL everywhere."""
    for word, count in (("", 0), ("GLOBAL ", 1)):
        more = (
            "DEF F()", f"{word}INTERRUPT DECL 20 WHEN C DO N=N+1", "INTERRUPT ON 20", "END",
        )  # fmt: skip
        rig = begun("F()\nX=1\nWAIT FOR GO", *more)
        until_x(rig)
        put(rig, "C", "TRUE")
        rig.cycles(3)
        assert rig.get("N") == count


def test_the_priority_may_be_a_variable_and_40_to_80_are_the_systems() -> None:
    """[C] use, [M] ranges."""
    rig = begun("Y=21\nINTERRUPT DECL Y WHEN C DO N=N+1\nINTERRUPT ON Y\nX=1\nWAIT FOR GO")
    rig.until(lambda: rig.get("X") == 1)
    put(rig, "C", "TRUE")
    rig.cycles(2)
    assert rig.get("N") == 1
    rig = begun("INTERRUPT DECL 40 WHEN C DO N=N+1")
    rig.until(lambda: rig.krc.state == "P_STOP")


def test_at_most_16_interrupts_are_on() -> None:
    """[M] up to 32 declared, 16 on."""
    rig = begun("FOR X=4 TO 20\nINTERRUPT DECL X WHEN C DO N=N+1\nINTERRUPT ON X\nENDFOR")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert "more than 16" in rig.krc.messages[-1].text
    assert rig.get("X") == 20


def test_an_interrupt_hands_over_no_runtime_variables() -> None:
    """[M]."""
    with pytest.raises(Exception, match="is gone with its routine"):
        begun("INTERRUPT DECL 20 WHEN C DO F(I)", "DEF F(I :IN)", "INT I", "END", head="INT I")


def test_bas_in_an_interrupt_routine_stops_the_program() -> None:
    """[C] $GEAR_JERK write-protected."""
    rig = begun("INTERRUPT DECL 20 WHEN C DO BAS(#INITMOV,0)\nINTERRUPT ON 20\nWAIT FOR GO")
    rig.go(0.3)
    put(rig, "C", "TRUE")
    rig.cycles(2)
    assert "$GEAR_JERK is write-protected" in rig.krc.messages[-1].text


# 2.7, 3 BRAKE and RESUME

GUARDED = "INTERRUPT DECL 20 WHEN HOLD DO PAUSE()\nINTERRUPT ON 20\n"
PAUSE = ("DEF PAUSE()", "BRAKE", "X=1", "WAIT FOR NOT HOLD", "END")


def test_brake_keeps_what_is_planned_and_the_routines_end_goes_on() -> None:
    """[M] routine continues at standstill; at its END the motion and all planned blocks go on."""
    rig = begun(f"{GUARDED}PTP P\nP.A1=0\nPTP P", *PAUSE)
    moving(rig)
    put(rig, "HOLD", "TRUE")
    rig.until(lambda: rig.get("X") == 1)
    assert not rig.mover.moving
    stood = rig.mover.joints_deg
    assert 5.0 < stood[0] < 50.0
    rig.go(0.5)
    assert rig.mover.joints_deg == stood
    assert rig.text("$PRO_STATE1") == "#P_ACTIVE"
    put(rig, "HOLD", "FALSE")
    rig.until(lambda: rig.mover.joints_deg[0] == 60.0)
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg[0] == 0.0


def test_brake_f_stops_sooner_than_brake() -> None:
    """[M] quick path-true stop."""
    ways = []
    for word in ("", " F"):
        rig = begun(f"{GUARDED}PTP P", "DEF PAUSE()", f"BRAKE{word}", "X=1", "HALT", "END")
        moving(rig)
        put(rig, "HOLD", "TRUE")
        until_x(rig)
        ways.append(rig.mover.joints_deg[0])
    assert ways[1] < ways[0]


def test_brake_stands_only_in_an_interrupt_routine() -> None:
    """[M]."""
    rig = begun("BRAKE")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert "only in an interrupt routine" in rig.krc.messages[-1].text


def test_resume_goes_on_below_the_call_and_forgets_what_is_planned() -> None:
    """[C] robot-forum 36451."""
    more = (
        "DEF W()", "INTERRUPT ON 20", "PTP P", "P.A1=-60", "PTP P", "WAIT SEC 0", "N=99", "END",
        "DEF CUT()", "INTERRUPT OFF 20", "BRAKE", "RESUME", "N=98", "END",
    )  # fmt: skip
    rig = begun("INTERRUPT DECL 20 WHEN C DO CUT()\nW()\nX=1\nP.A1=0\nPTP P", *more)
    moving(rig)
    put(rig, "C", "TRUE")
    rig.until(lambda: rig.get("X") == 1)
    highest = rig.mover.joints_deg[0]
    assert highest < 50.0
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg[0] == 0.0
    assert rig.get("N") == 0


def test_resume_unwinds_several_levels_also_from_a_routine_of_the_routine() -> None:
    """[C] ends all routines down to the level that declared the interrupt."""
    more = (
        "DEF W()", "V()", "N=99", "END", "DEF V()", "PTP P", "WAIT SEC 0", "N=98", "END",
        "DEF CUT()", "STOP_IT()", "N=97", "END", "DEF STOP_IT()", "RESUME", "END",
    )  # fmt: skip
    body = "INTERRUPT DECL 20 WHEN C DO CUT()\nINTERRUPT ON 20\nW()\nX=1"
    rig = begun(body, *more)
    moving(rig)
    put(rig, "C", "TRUE")
    rig.until(lambda: rig.krc.state == "P_END")
    assert (rig.get("X"), rig.get("N")) == (1, 0)


def test_resume_with_the_advance_pointer_past_the_subprogram_is_an_error() -> None:
    """[M] "impermissible program structure": hence the WAIT SEC 0 at its end."""
    more = ("DEF W()", "PTP P", "END", "DEF CUT()", "BRAKE", "RESUME", "END")
    body = "INTERRUPT DECL 20 WHEN C DO CUT()\nINTERRUPT ON 20\nW()\nX=1\nWAIT SEC 0"
    rig = begun(body, *more)
    moving(rig)
    put(rig, "C", "TRUE")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert "impermissible program structure" in rig.krc.messages[-1].text
    assert not rig.mover.moving


def test_the_advance_run_of_an_interrupt_routine_does_not_wait_for_braked_blocks() -> None:
    """[I] WAIT in the routine after BRAKE would never end otherwise."""
    rig = begun(f"{GUARDED}PTP P", "DEF PAUSE()", "BRAKE", "WAIT SEC 0", "Y=$ROB_TIMER", "END")
    moving(rig)
    put(rig, "HOLD", "TRUE")
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.get("Y") > 0


# 3 Triggers


@pytest.mark.parametrize(("distance", "place"), [(0, 0.0), (1, 60.0)])
def test_a_trigger_fires_at_the_start_or_end_of_the_next_motion(
    distance: int, place: float
) -> None:
    """[M] DISTANCE=0 start, 1 end; the call is not counted before."""
    rig = begun(
        f"TRIGGER WHEN DISTANCE={distance} DELAY=0 DO F() PRIO=-1\nPTP P\nP.A1=0\nPTP P",
        "DEF F()", "X=1", "END",
    )  # fmt: skip
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == pytest.approx(place, abs=0.5)


def test_a_trigger_may_assign_and_pulse() -> None:
    """[C] seen: $OUT, PULSE, $CYCFLAG."""
    body = """TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[3]=TRUE
TRIGGER WHEN DISTANCE=1 DELAY=0 DO PULSE($OUT[4],TRUE,0.1)
PTP P
WAIT SEC 0.5"""
    rig = begun(body)
    moving(rig)
    assert not rig.get("$OUT")[2]
    rig.until(lambda: rig.get("$OUT")[2])
    assert rig.get("$OUT")[3]
    rig.go(0.15)
    assert not rig.get("$OUT")[3]


@pytest.mark.parametrize(("option", "value"), [("firing", 2), ("planning", 1)])
def test_when_a_triggers_right_side_is_looked_at_is_an_option(option: str, value: int) -> None:
    """[U]."""
    body = "Y=1\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO X=Y\nPTP P\nY=2\nWAIT SEC 0"
    rig = begun(body, options=Options(trigger_value=option))
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.get("X") == value


def test_a_delay_moves_a_trigger() -> None:
    """[M] signed ms."""
    rig = begun("TRIGGER WHEN DISTANCE=1 DELAY=-50 DO X=1\nPTP P")
    rig.until(lambda: rig.get("X") == 1)
    assert 30.0 < rig.mover.joints_deg[0] < 59.9


# 3 Timers, flags, lines


def test_a_timer_runs_while_it_is_not_stopped_and_its_flag_rises_at_zero() -> None:
    """[C] $TIMER[1]=-200, $TIMER_STOP[1]=FALSE, interrupt on the flag."""
    body = """$TIMER[1]=-200
INTERRUPT DECL 20 WHEN $TIMER_FLAG[1] DO F()
INTERRUPT ON 20
$TIMER_STOP[1]=FALSE
X=1
WAIT FOR GO"""
    rig = begun(body, "DEF F()", "Y=1", "$TIMER_STOP[1]=TRUE", "END")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.until(lambda: rig.get("Y") == 1) == pytest.approx(0.2, abs=0.02)
    put(rig, "$TIMER_STOP[1]", "FALSE")
    rig.go(0.1)
    put(rig, "$TIMER[1]", "1000")
    rig.go(0.1)
    put(rig, "$TIMER_STOP[1]", "TRUE")
    at = rig.text("$TIMER[1]")
    assert at == "1100"
    rig.go(0.1)
    assert rig.text("$TIMER[1]") == at


def test_a_cyclic_flag_keeps_its_expression() -> None:
    """[C] assigning stores the expression, re-evaluated cyclically."""
    rig = begun("$CYCFLAG[1]=C AND NOT GO\nX=1\nWAIT SEC 9")
    rig.until(lambda: rig.get("X") == 1)
    put(rig, "C", "TRUE")
    rig.cycles(1)
    assert rig.text("$CYCFLAG[1]") == "TRUE"
    put(rig, "GO", "TRUE")
    rig.cycles(1)
    assert rig.text("$CYCFLAG[1]") == "FALSE"


def test_signals_name_bits_and_numbers() -> None:
    """[C] SIGNAL n $OUT[1] TO $OUT[8]."""
    data = "SIGNAL BYTE $OUT[1] TO $OUT[8]\nSIGNAL LAMP $OUT[9]\nSIGNAL NONE FALSE"
    rig = begun("BYTE=5\nLAMP=TRUE\nX=BYTE", data=data)
    rig.until(lambda: rig.get("X") == 5)
    assert rig.get("$OUT")[:9] == [True, False, True, *[False] * 5, True]
    assert rig.text("NONE") == "FALSE"


def test_an_output_tells_of_its_change_and_an_input_is_seen() -> None:
    """[C] $IN and $OUT."""
    heard: list[tuple[int, bool]] = []
    rig = begun("$OUT[5]=TRUE\nWAIT FOR $IN[6]\n$OUT[5]=FALSE")
    rig.krc.terminals.outputs.changed = lambda number, level: heard.append((number, level))
    rig.go(0.5)
    rig.krc.terminals.inputs[5] = True
    rig.until(lambda: rig.krc.state == "P_END")
    assert heard == [(5, True), (5, False)]


def test_an_analog_output_is_clamped() -> None:
    """[C] -1.0..1.0."""
    rig = begun("$ANOUT[1]=3")
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.text("$ANOUT[1]") == "1.00000"


# 4 States


def states(rig: Rig) -> list[str | None]:
    names = ("$PRO_STATE1", "$PRO_ACT", "$PRO_MOVE", "$ROB_STOPPED", "$STOPMESS", "$PERI_RDY")
    return [rig.text(name) for name in names]


def test_the_state_table() -> None:
    """[M]/[I] section 4, row by row."""
    rig = Rig(program(INI + "PTP P\nWAIT FOR GO"), config(DATA))
    assert states(rig) == ["#P_FREE", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]
    rig.krc.select("T")
    assert states(rig) == ["#P_RESET", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]
    rig.krc.start()
    moving(rig)
    assert states(rig) == ["#P_ACTIVE", "TRUE", "TRUE", "FALSE", "FALSE", "TRUE"]
    put(rig, "$OV_PRO", "0")
    rig.go(0.5)
    assert states(rig) == ["#P_ACTIVE", "TRUE", "FALSE", "TRUE", "FALSE", "TRUE"]
    put(rig, "$OV_PRO", "100")
    rig.go(0.1)
    rig.krc.stop()
    rig.until(lambda: not rig.mover.moving)
    assert states(rig) == ["#P_STOP", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]
    assert rig.krc.start()
    rig.go(0.1)
    rig.panel.alarm_stop = False
    rig.krc.stop(1, "emergency stop")
    rig.until(lambda: not rig.mover.moving)
    rig.cycles(1)
    assert states(rig) == ["#P_STOP", "FALSE", "FALSE", "TRUE", "TRUE", "FALSE"]
    assert not rig.krc.confirm()
    rig.panel.alarm_stop = True
    assert rig.krc.confirm()
    assert not rig.krc.start()
    rig.mover.drives_on()
    assert rig.krc.start()
    rig.until(lambda: rig.mover.joints_deg[0] == 60.0)
    put(rig, "GO", "TRUE")
    rig.until(lambda: rig.krc.state == "P_END")
    assert states(rig) == ["#P_END", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]
    rig.krc.cancel()
    assert states(rig) == ["#P_FREE", "FALSE", "FALSE", "TRUE", "FALSE", "TRUE"]


def test_a_pending_interrupt_brakes_before_the_arm_moves_again() -> None:
    """[I] start looks at interrupts first."""
    rig = begun(f"{GUARDED}PTP P\nWAIT SEC 0", *PAUSE)
    moving(rig)
    rig.krc.stop()
    rig.until(lambda: not rig.mover.moving)
    stood = rig.mover.joints_deg
    put(rig, "HOLD", "TRUE")
    assert rig.krc.start()
    rig.go(0.5)
    assert rig.mover.joints_deg == stood
    assert rig.get("X") == 1


def test_system_variables_that_can_only_be_read_refuse_a_write() -> None:
    """[C] kvp.md: the server answers, nothing changes."""
    rig = begun("WAIT FOR GO")
    assert not rig.memory.write_text("$AXIS_ACT", "{A1 1}")
    assert not rig.memory.write_text("$OV_PRO", "101")
    assert rig.memory.read_text("NOBODY") is None


def test_the_delivered_stop_routine_halts_until_the_message_is_gone() -> None:
    """[C] ir_stopm.src: BRAKE, then REPEAT .. HALT .. UNTIL $STOPMESS==FALSE."""
    body = "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()\nINTERRUPT ON 3\nPTP P"
    rig = begun(body)
    moving(rig)
    rig.panel.stop_message = True
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert not rig.krc.start()
    rig.krc.confirm()
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg[0] == 60.0
