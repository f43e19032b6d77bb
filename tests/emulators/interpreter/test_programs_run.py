"""The programs of tests/emulators/krl/programs run on the emulated controller to their ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.parse import parse, read
from tests.emulators.interpreter.rig import Rig, program

PROGRAMS = Path(__file__).parents[1] / "krl" / "programs"

EXPECTED = {"programmed path reached (BCO)"}
"""Messages that a program in good order may bring."""

LIMIT_S = 60.0
"""No program here takes longer."""

PULSE_S = 0.2
"""The longest pulse that goes on behind a program's end."""

HOMES = {
    "XHOME": "{A1 0,A2 -90,A3 90,A4 0,A5 90,A6 0}",
    "XHOME1": "{A1 20,A2 -90,A3 90,A4 0,A5 90,A6 0}",
    "XHOME2": "{A1 20,A2 -80,A3 90,A4 0,A5 90,A6 0}",
    "XHOME3": "{A1 0,A2 -80,A3 90,A4 0,A5 90,A6 10}",
}
FRAMES = dict.fromkeys(("$TOOL", "$BASE"), "{X 0,Y 0,Z 0,A 0,B 0,C 0}")
FULL_SPEED = {
    f"{name}[{axis}]": "50" for name in ("$VEL_AXIS", "$ACC_AXIS") for axis in range(1, 7)
}


@dataclass(frozen=True)
class Run:
    """One program with what the operator and the machine around give it.

    Attributes:
        set: variables before the start.
        inputs: that are on.
        act: what happens around it, called in each step.
        shows: variables after the end.
    """

    name: str
    set: dict[str, str] = field(default_factory=dict)
    inputs: tuple[int, ...] = ()
    act: Callable[[Rig], None] = lambda rig: None
    shows: dict[str, str] = field(default_factory=dict)


def grip(rig: Rig) -> None:
    """The gripper's switch follows its valve."""
    rig.krc.terminals.inputs[4] = rig.krc.terminals.outputs[0]


def feed(rig: Rig) -> None:
    """Two places in the ring, and no more."""
    if rig.time_s > 1.0:
        rig.memory.put("GIVEN", 2)
    if rig.time_s > 3.0:
        rig.memory.put("FINISHED", True)


def hold_a_while(rig: Rig) -> None:
    """Somebody holds the arm for a second."""
    rig.memory.put("HOLD", 0.3 < rig.time_s < 1.3)


RUNS = (
    Run("CALLER"),
    Run("CLOCK"),
    Run("DRAW", FRAMES, shows={"$AXIS_ACT.E1": "0.0"}),
    Run("EARLY", HOMES, (3,), shows={"$OUT[2]": "TRUE", "$AXIS_ACT.A6": "10.0000"}),
    Run("FLAGS", shows={"$CYCFLAG[1]": "FALSE"}),
    Run("GUARD", HOMES, (1,), shows={"$AXIS_ACT.A2": "-80.0000"}),
    Run("GUARD", HOMES, (1,), hold_a_while, {"$AXIS_ACT.A2": "-80.0000"}),
    Run("JUMP"),
    Run("LINES", inputs=(3,), shows={"$OUT[4]": "FALSE", "$ANOUT[1]": "0.250000"}),
    Run("LOWER", shows={"$AXIS_ACT.A5": "0.0"}),
    Run("MATRIX"),
    Run("MODE"),
    Run("PAINT", {f"BOXES[{k}].SIZE[2]": "1" for k in (1, 2, 3, 4)} | {
        "BOXES[2].PAINT": "#GREEN", "BOXES[3].PAINT": "#BLUE", "BOXES[4].PAINT": "#RED",
        "WEIGHTS[3]": "1", "WEIGHTS[4]": "2",
    }, shows={"WEIGHTS[1]": "13", "WEIGHTS[4]": "3", "BOXES[3].PAINT": "#GREEN", "LAMP": "TRUE"}),
    Run("PALLET", HOMES | {"TOOL_DATA[1]": FRAMES["$TOOL"]}, shows={"$OUT[1]": "FALSE"}),
    Run("PICK", HOMES | FRAMES | {
        "PDEFAULT": "{VEL 100,ACC 100,APO_DIST 100}", "FHOME": "{TOOL_NO 0,BASE_NO 0}",
    }, act=grip, shows={"$OUT[1]": "TRUE", "$STOPMESS": "FALSE"}),
    Run("RETRY"),
    Run("RING", act=feed, shows={"TAKEN": "2", "$AXIS_ACT.A1": "10.0000"}),
    Run("SMOOTH", FRAMES | FULL_SPEED | {
        "FHOME": "{TOOL_NO 0,BASE_NO 0}", "$APO.CDIS": "5", "$VEL": "{CP 0.2,ORI1 90,ORI2 90}",
        "$ACC": "{CP 2,ORI1 200,ORI2 200}",
    }),
    Run("SWITCHPT", HOMES | FRAMES, shows={"PASSED": "3", "$OUT[7]": "TRUE", "$OUT[8]": "FALSE"}),
    Run("TIMED"),
    Run("WATCH"),
    Run("WORDS"),
)  # fmt: skip

DATA = """INT N[5]
BOOL OK
REAL R
FRAME F
CHAR S[32]
E6POS P"""

CALLED = (
    # (5 or (15 exor 1)) is 15; the other bits of 16.
    ("N[1]=BITS(5)", {"N[1]": 0xFFF0}),
    ("N[5]=3\nBRANCH(2,N[1])\nBRANCH(9,N[2])\nBRANCH(3,N[5])", {"N[1]": 4, "N[2]": 11, "N[5]": 0}),
    ("N[1]=FOREVER()", {"N[1]": 1001}),
    # Half a turn about X, then 100 along the turned Z.
    (
        "F=GEOMETRY({X 1,Y 0,Z 0,A 0,B 0,C 0},{X 4,Y 0,Z 9,A 0,B 0,C 180})",
        {"F.X": 3, "F.Y": 0, "F.Z": -91, "F.C": 180},
    ),
    # P EXOR Q is TRUE; (P==Q) AND .. is FALSE.
    ("OK=LOGIC(TRUE,FALSE)", {"OK": True}),
    ("R=MATH(3.0,4.0)", {"R": 53.130102 + 0.9961947 * 0.0087269 - 30}),
    ("$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nP=$POS_ACT\nOK=REACH(P)", {"OK": True}),
    ("S[]=TEXT()", {"S[]": "ready"}),
)
"""Routines with parameters, and functions: a call, and what it leaves."""


@lru_cache(maxsize=1)
def programs() -> tuple[n.Module, ...]:
    """All of them, since some call others, and the cell program that WATCH starts."""
    modules = [read(path) for path in sorted(PROGRAMS.iterdir())]
    return (*modules, program("JUMP()", name="CELL"))


def started(name: str, *more: n.Module, run: Run | None = None) -> Rig:
    """All programs on one controller, SPS stopped, and one of the others started."""
    rig = Rig(*programs(), *more)
    rig.krc.stop_submit()
    for variable, text in (run.set if run else {}).items():
        assert rig.memory.write_text(variable, text), variable
    for number in run.inputs if run else ():
        rig.krc.terminals.inputs[number - 1] = True
    rig.krc.select(name)
    assert rig.krc.start()
    return rig


def unexpected(rig: Rig) -> list[str]:
    """Messages, where there should be none."""
    return [str(message) for message in rig.krc.messages if str(message) not in EXPECTED]


def value(rig: Rig, name: str) -> Any:
    text = rig.text(name)
    assert text is not None, name
    words = {"TRUE": True, "FALSE": False}
    return words[text] if text in words else text[1:-1] if text[:1] == '"' else float(text)


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.name)
def test_a_program_runs_to_its_end(run: Run) -> None:
    rig = started(run.name, run=run)
    while rig.krc.state == "P_ACTIVE" and rig.time_s < LIMIT_S:
        run.act(rig)
        rig.step()
    rig.go(PULSE_S)
    assert (rig.krc.state, unexpected(rig)) == ("P_END", [])
    assert {name: rig.text(name) for name in run.shows} == run.shows


@pytest.mark.parametrize(("call", "shows"), CALLED, ids=lambda part: str(part)[:12])
def test_a_routine_with_parameters_runs_when_it_is_called(call: str, shows: dict[str, Any]) -> None:
    data = parse(f"DEFDAT T PUBLIC\n{_global(DATA)}\nENDDAT", "t.dat")
    rig = started("T", program(call), data)
    rig.until(lambda: rig.krc.state != "P_ACTIVE", LIMIT_S)
    assert (rig.krc.state, unexpected(rig)) == ("P_END", [])
    for name, wanted in shows.items():
        assert value(rig, name) == (
            wanted if isinstance(wanted, bool | str) else pytest.approx(wanted, abs=1e-4)
        )


def _global(data: str) -> str:
    return "\n".join(f"DECL GLOBAL {line}" for line in data.splitlines())


def test_an_endless_stream_of_points_goes_on() -> None:
    run = Run("STEADY", {"$APO.CPTP": "50", "$ADVANCE": "3"})
    rig = started("STEADY", run=run)
    rig.go(30.0)
    assert (rig.krc.state, unexpected(rig)) == ("P_ACTIVE", [])
    assert rig.krc.exact_stops == 0


def test_a_fallen_input_ends_the_work_early() -> None:
    """GUARD's interrupt brakes and resumes below WORK()."""
    rig = started("GUARD", run=Run("GUARD", HOMES, (1,)))
    rig.go(0.4)
    rig.krc.terminals.inputs[0] = False
    rig.until(lambda: rig.krc.state != "P_ACTIVE")
    assert (rig.krc.state, unexpected(rig)) == ("P_END", [])
    assert value(rig, "$AXIS_ACT.A2") < -80.1, "it went on to the end"


def test_a_halted_program_ends_at_the_next_start() -> None:
    rig = started("STOP")
    rig.until(lambda: rig.krc.state != "P_ACTIVE")
    assert (rig.krc.state, unexpected(rig)) == ("P_STOP", [])
    assert rig.krc.start()
    rig.cycles(2)
    assert (rig.krc.state, unexpected(rig)) == ("P_END", [])


def test_the_submit_program_runs_beside_and_starts_the_cell_program() -> None:
    rig = Rig(*programs())
    rig.cycles(5)
    assert (rig.krc.submit_state, rig.krc.name, rig.krc.state) == ("P_ACTIVE", "CELL", "P_END")
    assert unexpected(rig) == []


def test_every_program_is_run() -> None:
    calls = " ".join(call for call, _ in CALLED)
    run = {run.name for run in RUNS} | {"STEADY", "STOP"}
    names = {path.stem.upper() for path in PROGRAMS.glob("*.src")}
    assert {name for name in names - run if f"{name}(" not in calls} == set()
