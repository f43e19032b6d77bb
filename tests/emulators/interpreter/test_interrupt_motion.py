"""Motions of an interrupt routine that has braked, and what goes on behind them."""

from __future__ import annotations

import pytest

from tests.emulators.interpreter.rig import Rig, config, program

START = """BAS(#INITMOV,0)
$TOOL=$NULLFRAME
$BASE=$NULLFRAME
INTERRUPT DECL 10 WHEN HIT DO SEEN()
INTERRUPT DECL 9 WHEN AGAIN DO MORE()
PTP $AXIS_ACT
INTERRUPT ON
"""
DATA = "BOOL HIT=FALSE\nBOOL AGAIN=FALSE\nBOOL LATER=FALSE\nINT MARK=0"


def begun(routine: str, main: str = "PTP {A1 40}\nPTP {A1 40,A2 -70}", *more: str) -> Rig:
    """A program on its way to A1 40 whose interrupt has just fired."""
    text = ["DEF SEEN()", "BRAKE", *routine.splitlines(), "END", *more]
    if "DEF MORE()" not in more:
        text += ["DEF MORE()", "END"]
    rig = Rig(program(START + main, *text), config(DATA))
    rig.krc.select("T")
    assert rig.krc.start()
    rig.until(lambda: rig.mover.joints_deg[0] > 5.0)
    rig.memory.put("HIT", True)
    return rig


def axis(rig: Rig, number: int) -> float:
    return rig.mover.joints_deg[number - 1]


def test_a_routine_that_braked_moves_by_itself_and_the_rest_goes_on_behind_it() -> None:
    """[M] $AXIS_RET is where the path was left; back there, the motion goes on."""
    rig = begun("PTP {A6 30}\nPTP $AXIS_RET\nMARK=1")
    rig.until(lambda: axis(rig, 6) > 29.999)
    left_deg = axis(rig, 1)
    assert 5.0 < left_deg < 40.0, "it braked on its way"
    assert rig.get("$AXIS_RET")["A1"] == pytest.approx(left_deg, abs=1e-3)
    assert rig.get("$AXIS_INT")["A1"] < left_deg, "it was told before it stood"
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg == pytest.approx((40, -70, 90, 0, 90, 0))
    assert not [message for message in rig.krc.messages if message.stops]


def test_a_routine_that_ends_beside_the_path_returns_to_it_first() -> None:
    """Guess: like the return after a STOP 0."""
    rig = begun("PTP {A6 30}")
    rig.until(lambda: axis(rig, 6) > 29.999)
    left_deg = axis(rig, 1)
    highest = 0.0
    while axis(rig, 6) > 1e-9:
        rig.step()
        highest = max(highest, axis(rig, 1))
    assert highest == pytest.approx(left_deg), "it went on before it was back"
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg == pytest.approx((40, -70, 90, 0, 90, 0))


def test_the_routines_end_waits_for_its_motions() -> None:
    """[I] what is planned below is taken up only then."""
    rig = begun("MARK=1\nPTP_REL {A6 90}\nMARK=2")
    rig.until(lambda: rig.get("MARK") == 2)
    assert rig.krc.place[1:] == ("t.src", 17), "on the END of SEEN"
    rig.until(lambda: axis(rig, 6) > 89.999)


def test_resume_forgets_what_was_set_aside() -> None:
    """[C] remaining and planned motion is dropped, and the next begins where the arm stands."""
    work = ("DEF WORK()", "PTP {A1 40}", "PTP {A1 40,A2 -70}", "WAIT SEC 0", "END")
    rig = begun("PTP {A6 30}\nWAIT SEC 0\nRESUME", "WORK()\nMARK=5\nPTP {A5 80}", *work)
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.get("MARK") == 5
    assert axis(rig, 1) < 39.0
    assert rig.mover.joints_deg[1:] == pytest.approx((-90, 90, 0, 80, 30))


def test_a_routine_that_interrupts_a_moving_one_brakes_that_too() -> None:
    """[C] 9 is more urgent than 10."""
    more = ("DEF MORE()", "BRAKE", "PTP_REL {A5 -20}", "PTP $AXIS_RET", "MARK=MARK+10", "END")
    rig = begun("PTP {A6 60}\nMARK=MARK+1", "PTP {A1 40}", *more)
    rig.until(lambda: axis(rig, 6) > 5.0)
    rig.memory.put("AGAIN", True)
    rig.until(lambda: axis(rig, 5) < 70.001)
    assert axis(rig, 6) < 60.0
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.get("MARK") == 11
    assert rig.mover.joints_deg == pytest.approx((40, -90, 90, 0, 90, 0))


def test_resume_inside_of_a_routine_forgets_only_what_that_set_aside() -> None:
    """[C] RESUME goes back to the level that declared the interrupt, no farther."""
    routine = "INTERRUPT DECL 8 WHEN LATER DO LEAVE()\nINTERRUPT ON 8\nSUB()\nMARK=MARK+1"
    more = (
        "DEF SUB()", "PTP_REL {A6 60}", "WAIT SEC 0", "END",
        "DEF LEAVE()", "BRAKE", "PTP_REL {A5 -20}", "WAIT SEC 0", "RESUME", "END",
    )  # fmt: skip
    rig = begun(routine, "PTP {A1 40}", *more)
    rig.until(lambda: axis(rig, 6) > 5.0)
    rig.memory.put("LATER", True)
    rig.until(lambda: rig.get("MARK") == 1)
    assert 5.0 < axis(rig, 6) < 60.0
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg == pytest.approx((40, -90, 90, 0, 90, 0))


def test_a_reset_forgets_what_was_set_aside() -> None:
    """[M] the next motion is a BCO run from where the arm stands."""
    rig = begun("PTP {A6 30}\nWAIT FOR FALSE")
    rig.until(lambda: axis(rig, 6) > 29.999)
    rig.go(0.1)
    rig.krc.cancel()
    rig.memory.put("HIT", False)
    rig.krc.select("T")
    assert rig.krc.start()
    rig.until(lambda: rig.krc.state == "P_END")
    assert rig.mover.joints_deg == pytest.approx((40, -70, 90, 0, 90, 30))


def test_a_frame_that_changes_while_a_motion_is_planned_is_counted() -> None:
    """[C] 2.5: a real controller plans the move anew; here blocks keep their frames."""
    main = "LIN_REL {{Z 50}} C_DIS\n{}$BASE.X=100\nLIN_REL {{Z 50}}"
    for between, count in (("", 1), ("WAIT SEC 0\n", 0)):
        rig = Rig(program(START + main.format(between), "DEF SEEN()", "END", "DEF MORE()", "END"),
                  config(DATA)).run()  # fmt: skip
        assert (rig.krc.state, rig.krc.frame_changes) == ("P_END", count)
