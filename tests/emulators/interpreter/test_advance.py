"""Rules of the two pointers, of what stops the advance run, and of blocks as they are planned."""

from __future__ import annotations

import pytest

from sphmctl.emulators.interpreter import Options
from sphmctl.emulators.motion import Kind
from tests.emulators.interpreter.rig import HOME, Rig, config, program

INI = "BAS(#INITMOV,0)\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP $AXIS_ACT\n"
POINTS = "INT X=0\nINT Y=0\nBOOL GO=FALSE\nE6AXIS P={A1 10,A2 -90,A3 90,A4 0,A5 90,A6 0}"


def begun(body: str, data: str = POINTS, options: Options | None = None, mode: str = "EX") -> Rig:
    rig = Rig(program(INI + body), config(data), options=options, mode=mode)
    rig.krc.select("T")
    assert rig.krc.start()
    return rig


def six(words: str = "") -> str:
    return "".join(f"P.A1={10 * k}\nPTP P {words}\nX={k}\n" for k in range(1, 7))


def until_x(rig: Rig) -> None:
    rig.until(lambda: rig.get("X") == 1)


# 2.1 Pointers


@pytest.mark.parametrize(("advance", "blocks"), [(0, 1), (1, 2), (3, 4), (5, 6)])
def test_the_interpreter_runs_ahead_until_advance_blocks_are_queued(
    advance: int, blocks: int
) -> None:
    """[C] $ADVANCE 0..5 beyond the running one."""
    rig = begun(f"$ADVANCE={advance}\n{six()}")
    rig.until(lambda: rig.mover.running is not None and rig.mover.moving)
    rig.cycles(2)
    assert rig.mover.queued + 1 == blocks


def test_lines_between_motions_run_in_advance() -> None:
    """[C] non-motion lines in between are executed then."""
    rig = begun(six())
    rig.until(lambda: rig.get("X") == 3)
    assert rig.mover.joints_deg[0] < 10.0


def test_without_advance_nothing_is_blended() -> None:
    """[C] 0 makes blending impossible."""
    rig = begun(f"$ADVANCE=0\n{six('C_PTP')}")
    rig.until(lambda: rig.krc.state == "P_END")
    assert not [e for e in rig.told if e.kind is Kind.BLENDED]


def test_with_advance_points_are_blended() -> None:
    """[C]."""
    rig = begun(six("C_PTP"))
    rig.until(lambda: rig.krc.state == "P_END")
    assert len([e for e in rig.told if e.kind is Kind.BLENDED]) == 5


def test_speeds_are_those_at_planning_time() -> None:
    """[C] $VEL_AXIS, $APO, $TOOL, $BASE are advance-run variables, captured per block."""
    slow = "$VEL_AXIS[1]=5\nP.A1=5\nPTP P\n$VEL_AXIS[1]=100\nP.A1=50\nPTP P"
    rig = begun(slow)
    rig.until(lambda: rig.mover.joints_deg[0] > 1.0)
    assert rig.get("$VEL_AXIS")[0] == 100.0
    rig.go(0.08)
    assert rig.mover.speed_deg_s[0] == pytest.approx(18.0, abs=0.5)


# 2.2 What stops the advance run


@pytest.mark.parametrize(
    "line",
    [
        "WAIT FOR TRUE",
        "WAIT SEC 0",
        "PULSE($OUT[1],TRUE,0.1)",
        "$OUT[1]=TRUE",
        "IF $IN[1] THEN\nENDIF",
        "$ANOUT[1]=0.5",
        "Y=$ROB_TIMER",
        "$TIMER[1]=0",
        "Q=$AXIS_ACT",
        "IF $T1 THEN\nENDIF",
        "IF $STOPMESS THEN\nENDIF",
        "$ACT_TOOL=1",
        "LAMP=TRUE",
    ],
)
def test_the_advance_run_stops(line: str) -> None:
    """[C]/[M] statements, inputs and outputs, SIGNAL names, actual values, settings."""
    rig = begun(f"PTP P\n{line}\nX=1", f"{POINTS}\nE6AXIS Q\nSIGNAL LAMP $OUT[7]")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == 10.0


@pytest.mark.parametrize(
    "line",
    [
        "Y=5*Y+1",
        "$VEL_AXIS[1]=50",
        "$VEL.CP=0.1",
        "$ACC.CP=0.1",
        "$APO.CPTP=70",
        "$ADVANCE=4",
        "$TOOL=$NULLFRAME",
        "$BASE=$NULLFRAME",
        "$FLAG[1]=TRUE",
        "HELP()",
    ],
)
def test_the_advance_run_goes_on(line: str) -> None:
    """[C] user variables, [M] settings, [U] $FLAG: none of these stop it."""
    rig = Rig(program(f"{INI}PTP P\n{line}\nX=1", "DEF HELP()", "Y=2", "END"), config(POINTS))
    rig.krc.select("T")
    rig.krc.start()
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] < 1.0


def test_flags_stop_it_where_the_option_says_so() -> None:
    """[U]."""
    rig = begun("PTP P\n$FLAG[1]=TRUE\nX=1", options=Options(flags_stop_advance=True))
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] == 10.0


def test_continue_lets_the_next_line_only_run_in_advance() -> None:
    """[C] use, [M] rule."""
    rig = begun("PTP P\nCONTINUE\n$OUT[1]=TRUE\nX=1\n$OUT[2]=TRUE\nX=2")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.mover.joints_deg[0] < 1.0
    rig.until(lambda: rig.get("X") == 2)
    assert rig.mover.joints_deg[0] == 10.0


def test_halt_waits_for_the_arm() -> None:
    """[M] stops the main run there."""
    rig = begun("PTP P\nHALT")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert rig.mover.joints_deg[0] == 10.0


def test_the_end_of_a_routine_with_an_interrupt_of_its_own_waits() -> None:
    """[M] `END` of a routine holding a non-global interrupt."""
    more = ("DEF F()", "{}INTERRUPT DECL 20 WHEN GO DO F()", "PTP P", "END")
    for word, place in (("", 10.0), ("GLOBAL ", HOME[0])):
        body = [line.format(word) for line in more]
        rig = Rig(program(f"{INI}F()\nX=1", *body), config(POINTS))
        rig.krc.select("T")
        rig.krc.start()
        until_x(rig)
        assert rig.mover.joints_deg[0] == pytest.approx(place, abs=0.5)


def test_an_advance_run_stop_makes_a_blend_an_exact_stop_and_is_counted() -> None:
    """[C/M] 2.5: no next block in time."""
    rig = begun("PTP P C_PTP\nWAIT SEC 0\nP.A1=20\nPTP P")
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.krc.exact_stops == 1


# 2.3 and BCO


def test_a_ptp_needs_all_speeds() -> None:
    """[C] $VEL_AXIS and $ACC_AXIS must be set for all axes."""
    rig = Rig(program("PTP $AXIS_ACT")).run()
    assert rig.krc.messages[-1].text == "value invalid: $VEL_AXIS[1] was never set"


def test_missing_components_keep_the_point_before() -> None:
    """[M] in a motion."""
    rig = begun("PTP {A1 5}\nPTP {A3 80}")
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg == pytest.approx((5.0, -90.0, 80.0, 0.0, 90.0, 0.0))


def test_in_relative_motions_missing_components_are_zero() -> None:
    """[C] PTP_REL; LIN_REL on base and tool."""
    body = "PTP_REL {A1 5}\nPTP_REL {A1 5,A5 -90}\nQ=$POS_ACT\nLIN_REL {Z 50}\nR=$POS_ACT"
    rig = begun(body + "\nLIN_REL {Z 50} #TOOL\nS=$POS_ACT", f"{POINTS}\nE6POS Q,R,S")
    rig.until(lambda: rig.krc.state != "P_ACTIVE")
    assert rig.krc.state == "P_END", rig.krc.messages
    before, up, out = (rig.get(name) for name in "QRS")
    assert up["Z"] - before["Z"] == pytest.approx(50, abs=0.01)
    moved = sum((out[k] - up[k]) ** 2 for k in "XYZ") ** 0.5
    assert moved == pytest.approx(50, abs=0.01)


def test_a_point_is_reached_by_ptp_and_lin_and_circ() -> None:
    """[M] with $TOOL, $BASE, S and T."""
    body = """
PTP_REL {A5 -90}
$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}
$BASE={X 10,Y 20,Z 0,A 0,B 0,C 0}
Q=$POS_ACT
$VEL.CP=0.2
LIN {X 600}
Q=$POS_ACT
Q.Y=60
PTP Q
CIRC {X 570,Y 90},{X 540,Y 60}
R=$POS_ACT
CIRC {X 570,Y 90},{X 600,Y 60},CA 360
S=$POS_ACT
"""
    rig = begun(body, f"{POINTS}\nE6POS Q,R,S")
    rig.until(lambda: rig.krc.state != "P_ACTIVE")
    assert rig.krc.state == "P_END", rig.krc.messages
    assert [rig.get("Q")[k] for k in "XY"] == pytest.approx([600, 60], abs=0.01)
    assert [rig.get("R")[k] for k in "XY"] == pytest.approx([540, 60], abs=0.01)
    assert [rig.get("S")[k] for k in "XY"] == pytest.approx([540, 60], abs=0.01)


def test_the_first_motion_is_a_ptp_to_a_full_position() -> None:
    """[M] BCO."""
    for line in ("PTP {A1 5}", "LIN {X 500}", "PTP {X 500,Y 0,Z 500,A 0,B 90,C 0}"):
        head = "BAS(#INITMOV,0)\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n"
        rig = Rig(program(head + line)).run()
        assert "full position" in rig.krc.messages[-1].text
    rig = begun("PTP P")
    rig.until(lambda: rig.krc.state == "P_END")
    assert any("BCO" in message.text for message in rig.krc.messages)


def test_in_t1_the_bco_run_stops_and_a_second_start_goes_on() -> None:
    """[M] T1/T2: stops when reached, with a message; EXT runs by itself."""
    rig = begun("PTP P", mode="T1")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert not rig.get("$STOPMESS")
    assert rig.mover.joints_deg == HOME
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg[0] == 10.0


def test_a_target_beyond_the_software_limits_stops_the_program() -> None:
    """[C] limits of 2.6."""
    rig = begun("P.A1=171\nPTP P")
    rig.until(lambda: rig.krc.state == "P_STOP")
    assert rig.krc.messages[-1].line == 7
    assert rig.get("$STOPMESS") is True


def test_single_spline_motions_run_with_their_own_speeds() -> None:
    """[C] SPTP .. WITH; valid for that block only."""
    rig = begun("SPTP P WITH $VEL_AXIS[1]=SVEL_JOINT(10.0)\nX=1")
    rig.until(lambda: rig.get("X") == 1)
    assert rig.get("$VEL_AXIS")[0] == 100.0
    rig.until(lambda: rig.mover.joints_deg[0] > 5.0)
    assert rig.mover.speed_deg_s[0] == pytest.approx(36.0, abs=1.0)


def test_step_modes_have_no_advance_run() -> None:
    """[C] #MSTEP and #ISTEP."""
    rig = begun(six("C_PTP"))
    assert rig.memory.write_text("$PRO_MODE1", "#MSTEP")
    rig.until(lambda: rig.mover.joints_deg[0] > 42.0)
    assert rig.mover.queued == 0


def test_the_main_run_has_copies_of_what_was_valid_as_its_block_was_planned() -> None:
    """[C] $TOOL_C, $APO_C, ..."""
    rig = begun("$TOOL={X 0,Y 0,Z 90,A 0,B 0,C 0}\n$APO.CPTP=20\nPTP P\n$TOOL.Z=1\n$APO.CPTP=50")
    rig.until(lambda: rig.mover.joints_deg[0] > 1.0)
    assert (rig.text("$TOOL_C.Z"), rig.text("$TOOL.Z")) == ("90.0000", "1.00000")
    assert (rig.text("$APO_C.CPTP"), rig.text("$APO.CPTP")) == ("20.0000", "50.0000")


def test_a_trigger_on_a_path_fires_before_the_end() -> None:
    """[C] forms, [M]: PATH for LIN, in mm from its end."""
    body = """PTP_REL {A5 -90}
Q=$POS_ACT
TRIGGER WHEN PATH=-20 DELAY=0 DO X=1
LIN_REL {Z 50}"""
    rig = begun(body, f"{POINTS}\nE6POS Q")
    rig.until(lambda: rig.get("X") == 1)
    gone = rig.get("$POS_ACT")["Z"] - rig.get("Q")["Z"]
    assert gone == pytest.approx(30, abs=2.0)


def test_a_program_starts_only_where_the_arm_stands() -> None:
    """[I] it brakes after a reset, and the new plan begins at its rest."""
    rig = begun("PTP P")
    rig.until(lambda: rig.mover.joints_deg[0] > 3.0)
    rig.krc.reset()
    assert not rig.krc.start()
    rig.until(lambda: not rig.mover.moving)
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state == "P_END")


@pytest.mark.parametrize(("live", "place"), [(True, 10.0), (False, 0.0)])
def test_declaring_a_live_interrupt_anew_stops_the_advance_run(live: bool, place: float) -> None:
    """[M] only while it is on."""
    declare = "GLOBAL INTERRUPT DECL 20 WHEN GO DO Y=1\n"
    on = "INTERRUPT ON 20\n" if live else ""
    rig = begun(f"{declare}{on}PTP P\n{declare}X=1\nWAIT FOR GO")
    until_x(rig)
    assert rig.mover.joints_deg[0] == pytest.approx(place, abs=0.5)
