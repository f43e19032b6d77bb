"""Each option of the interpreters changes what it says, and so does the one behind $PRO_MOVE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest

from sphmctl.emulators.interpreter import Options, submit_program
from sphmctl.emulators.motion import Options as MotionOptions
from tests.emulators.interpreter.rig import Rig, config, program

DATA = config("INT X=0\nINT Y=0\nBOOL GO=TRUE\nE6AXIS P={A1 10,A2 -90,A3 90,A4 0,A5 90,A6 0}")
INI = "BAS(#INITMOV,0)\nPTP $AXIS_ACT\n"


def started(options: Options, body: str, *more: str) -> Rig:
    rig = Rig(program(body, *more), DATA, options=options)
    rig.krc.select("T")
    assert rig.krc.start()
    return rig


def turns_of_a_loop(options: Options) -> float:
    rig = started(options, "LOOP\nX=X+1\nENDLOOP")
    rig.cycles(10)
    return float(rig.get("X"))


def turns_of_submit(options: Options) -> float:
    sps = submit_program([], ["LOOP", "X=X+1", "ENDLOOP"])
    rig = Rig(sps, DATA, options=options)
    rig.cycles(10)
    return float(rig.get("X"))


def turns_of_a_trigger_at_once(options: Options) -> float:
    body = INI + "TRIGGER WHEN DISTANCE=1 DELAY=0 DO MANY() PRIO=-1\nPTP P\nWAIT SEC 1"
    rig = started(options, body, "DEF MANY()", "WHILE X<1000", "X=X+1", "ENDWHILE", "END")
    rig.until(lambda: rig.get("X") > 0)
    return float(rig.get("X"))


def depth(options: Options) -> float:
    rig = started(options, "DOWN()", "DEF DOWN()", "X=X+1", "DOWN()", "END")
    rig.until(lambda: rig.krc.state == "P_STOP")
    return float(rig.get("X"))


def fired(options: Options) -> float:
    body = "INTERRUPT DECL 20 WHEN GO DO HIT()\nINTERRUPT ON 20\nWAIT SEC 1"
    rig = started(options, body, "DEF HIT()", "X=X+1", "END")
    rig.go(0.2)
    return float(rig.get("X"))


def fired_in_the_same_turn(options: Options) -> float:
    body = "INTERRUPT DECL 20 WHEN $FLAG[1] DO HIT()\nINTERRUPT ON 20\nWAIT SEC 1"
    rig = started(options, body, "DEF HIT()", "X=X+1", "END")
    rig.cycles(5)
    rig.step()
    rig.step()
    assert rig.memory.write_text("$FLAG[1]", "TRUE")
    rig.step()
    return float(rig.get("X"))


def value_of_a_trigger(options: Options) -> float:
    body = INI + "Y=1\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO X=Y\nPTP P\nY=2\nWAIT SEC 0.2"
    rig = started(options, body)
    rig.until(lambda: rig.krc.state == "P_END")
    return float(rig.get("X"))


def place_at_a_flag(options: Options) -> float:
    rig = started(options, f"{INI}PTP P\n$FLAG[1]=TRUE\nX=1")
    rig.until(lambda: rig.get("X") == 1)
    return rig.mover.joints_deg[0]


def interrupts(switched_on: bool) -> Callable[[Options], float]:
    """How many are declared, or declared and switched on, before the program stops."""

    def count(options: Options) -> float:
        lines = []
        for number in range(1, 37):
            lines.append(f"INTERRUPT DECL {number} WHEN $FLAG[{number}] DO X=X")
            lines += [f"INTERRUPT ON {number}"] * switched_on + ["Y=Y+1"]
        rig = started(options, "\n".join(lines))
        rig.until(lambda: rig.krc.state != "P_ACTIVE")
        return float(rig.get("Y"))

    return count


CASES: dict[str, tuple[Any, Any, Callable[[Options], float]]] = {
    "robot_statements": (50, 400, turns_of_a_loop),
    "submit_statements": (50, 200, turns_of_submit),
    "trigger_statements": (20, 200, turns_of_a_trigger_at_once),
    "call_depth": (5, 20, depth),
    "fires_when_already_true": (False, True, fired),
    "looks_early": (True, False, fired_in_the_same_turn),
    "trigger_value": ("planning", "firing", value_of_a_trigger),
    "flags_stop_advance": (False, True, place_at_a_flag),
    "interrupts_declared": (8, 32, interrupts(switched_on=False)),
    "interrupts_on": (4, 16, interrupts(switched_on=True)),
}
"""The option's values for a small and for a great measure."""


@pytest.mark.parametrize("name", CASES)
def test_an_option_changes_what_it_says(name: str) -> None:
    small, great, measure = CASES[name]
    least, most = (measure(replace(Options(), **{name: value})) for value in (small, great))
    assert least < most


def test_every_option_is_tried() -> None:
    assert {field.name for field in fields(Options)} == set(CASES)


@pytest.mark.parametrize("moves", [False, True])
def test_pro_move_at_override_0_is_an_option(moves: bool) -> None:
    """[U] section 4."""
    rig = Rig(program(INI + "PTP P"), DATA, motion=MotionOptions(moving_at_override_0=moves))
    rig.krc.select("T")
    rig.krc.start()
    rig.until(lambda: rig.mover.joints_deg[0] > 1.0)
    assert rig.memory.write_text("$OV_PRO", "0")
    rig.go(1.0)
    assert rig.mover.joints_deg[0] < 10.0
    assert rig.text("$PRO_MOVE") == str(moves).upper()
    assert rig.text("$ROB_STOPPED") == str(not moves).upper()
