"""What the documents leave open about the interpreters; each default is a guess.

What is in doubt: KUKA's manuals at hand do not say it, or sources disagree.
"""

from __future__ import annotations

from dataclasses import dataclass

CYCLE_S = 0.012
"""The interpolation cycle: interrupts, waits, inputs and outputs are looked at in it (SI)."""


@dataclass(frozen=True)
class Options:
    """How the interpreters behave.

    Attributes:
        robot_statements: instructions of the robot interpreter in a cycle; this also keeps an
            endless loop without a wait from hanging the emulator.
        submit_statements: likewise, of the submit interpreter.
        trigger_statements: likewise, of the routine that a trigger calls, before the next cycle.
        call_depth: routines that may be in one another.
        fires_when_already_true: whether INTERRUPT ON fires when the condition is TRUE already;
            sources disagree.
        trigger_value: whether the right side of a trigger's assignment is looked at when the
            trigger is planned ("planning") or when it fires ("firing").
        flags_stop_advance: whether $FLAG[] stops the advance run.
        looks_early: whether interrupts are looked at 8 ms before the robot interpreter's turn, and
            not just before it; what happens in between is seen by the program, and not by them.
        interrupts_declared, interrupts_on: how many may be (SI, "INTERRUPT").
    """

    robot_statements: int = 400
    submit_statements: int = 200
    trigger_statements: int = 200
    call_depth: int = 20
    fires_when_already_true: bool = False
    trigger_value: str = "firing"
    flags_stop_advance: bool = False
    looks_early: bool = False
    interrupts_declared: int = 32
    interrupts_on: int = 16
