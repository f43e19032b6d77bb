"""Interrupts and triggers that wait, and the levels on which their routines run.

A lower priority number is more urgent (SI, "INTERRUPT"). Interrupts are looked at once in a cycle
and fire on the rising edge of their condition.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sphmctl.emulators.interpreter.calls import Action
from sphmctl.emulators.interpreter.code import Fn, Frame
from sphmctl.emulators.interpreter.faults import NOT_ALLOWED, OUT_OF_RANGE, KrlFaultError
from sphmctl.emulators.interpreter.options import Options

LOWEST = 1000
"""Priority of the main program: less urgent than all interrupts."""

AUTOMATIC = 40
"""PRIO=-1 of a TRIGGER: the controller takes one of 40 to 80 (SI, "TRIGGER")."""

SYSTEM = range(40, 81)
PRIORITIES = range(1, 129)


@dataclass
class Interrupt:
    """One INTERRUPT DECL.

    Attributes:
        frame: of the routine that declared it.
        before: the condition when it was last looked at.
        pending: it has fired, and its routine has not begun.
    """

    priority: int
    condition: Fn
    action: Action
    is_global: bool
    frame: Frame
    on: bool = False
    enabled: bool = True
    before: bool = False
    pending: bool = False


@dataclass
class Level:
    """The main program, or a routine that interrupted it.

    Attributes:
        base: how many frames were there before.
        braked: whether its BRAKE still holds the arm.
        moves: whether it has set aside what was planned, for motions of its own.
        tags: its blocks that are not finished.
    """

    priority: int = LOWEST
    base: int = 0
    interrupt: Interrupt | None = None
    braked: bool = False
    moves: bool = False
    tags: set[int] = field(default_factory=set)


@dataclass(frozen=True)
class Due:
    """A trigger that has fired, and an interrupt that is to run."""

    priority: int
    action: Action
    frame: Frame
    interrupt: Interrupt | None = None


class Interrupts:
    """The declared interrupts of one interpreter."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._all: dict[int, Interrupt] = {}

    def clear(self) -> None:
        """Forget all of them."""
        self._all.clear()

    def is_live(self, priority: int) -> bool:
        """Whether one of this priority is declared and on."""
        known = self._all.get(priority)
        return known is not None and known.on

    def declare(self, made: Interrupt) -> None:
        """Declare one, or another one in its place; it is off at first."""
        if made.priority not in PRIORITIES or made.priority in SYSTEM:
            message = f"priority {made.priority}: an interrupt has 1 to 39 or 81 to 128"
            raise KrlFaultError(OUT_OF_RANGE, message)
        self._all[made.priority] = made
        if len(self._all) > self._options.interrupts_declared:
            most = self._options.interrupts_declared
            raise KrlFaultError(NOT_ALLOWED, f"more than {most} interrupts are declared")

    def switch(self, mode: str, priority: int | None) -> None:
        """INTERRUPT ON, OFF, ENABLE or DISABLE, of one or all."""
        if priority is not None and priority not in self._all:
            raise KrlFaultError(NOT_ALLOWED, f"interrupt {priority} is not declared here")
        chosen = list(self._all.values()) if priority is None else [self._all[priority]]
        for one in chosen:
            if mode == "ON" and not one.on:
                one.on = True
                already = not self._options.fires_when_already_true
                one.before = already and bool(one.condition(one.frame))
            elif mode == "OFF":
                one.on = one.pending = False
            elif mode in ("ENABLE", "DISABLE"):
                one.enabled = mode == "ENABLE"
        if sum(one.on for one in self._all.values()) > self._options.interrupts_on:
            most = self._options.interrupts_on
            raise KrlFaultError(NOT_ALLOWED, f"more than {most} interrupts are on")

    def has_own(self, frame: Frame) -> bool:
        """Whether a routine has declared an interrupt that ends with it."""
        return any(one.frame is frame and not one.is_global for one in self._all.values())

    def forget(self, frame: Frame) -> None:
        """A routine has ended, and its interrupts with it."""
        ended = [p for p, one in self._all.items() if one.frame is frame and not one.is_global]
        for priority in ended:
            del self._all[priority]

    def look(self) -> None:
        """Once in a cycle: which conditions have become TRUE."""
        for one in self._all.values():
            if one.on:
                now = bool(one.condition(one.frame))
                if now and not one.before:
                    one.pending = True
                one.before = now

    def most_urgent(self, above: int) -> Interrupt | None:
        """The pending one that may interrupt a level of priority `above`."""
        ready = [one for one in self._all.values() if one.pending and one.enabled]
        best = min(ready, key=lambda one: one.priority, default=None)
        return best if best is not None and best.priority < above else None


class Waiting:
    """Triggers that have fired and wait for a more urgent routine to end."""

    def __init__(self) -> None:
        self._due: list[Due] = []

    def add(self, due: Due) -> None:
        """One more."""
        self._due.append(due)

    def clear(self) -> None:
        """Forget them."""
        self._due.clear()

    def take(self, above: int) -> Due | None:
        """The first of the most urgent ones that may interrupt."""
        best = min(self._due, key=lambda due: due.priority, default=None)
        if best is None or best.priority >= above:
            return None
        self._due.remove(best)
        return best
