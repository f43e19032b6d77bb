"""Compiled routines and their calls. `compiler` makes code, `machine` runs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter.values import Box
from sphmctl.emulators.krl.nodes import Parameter, Place
from sphmctl.emulators.krl_text import Type

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.machine import Machine


class Pause(Enum):
    """What an instruction says when the interpreter cannot go on at once."""

    AGAIN = auto()
    """Wait: the same instruction is due again."""
    CYCLE = auto()
    """Done, but not more in this cycle."""


Instruction = Callable[["Frame"], Pause | None]
Fn = Callable[["Frame"], Any]


@dataclass(frozen=True)
class Local:
    """A variable or parameter of a routine: its place in a frame."""

    index: int
    kind: Type
    is_open: bool = False


@dataclass
class Code:
    """A routine.

    Attributes:
        instructions: a statement is one or several of them.
        places: where each instruction's statement stands.
        numbers: the statement that each instruction belongs to.
        kinds: of the variables of a frame; parameters are the first.
        locals: by name.
        temps: how many values a frame keeps for itself.
    """

    name: str
    module: str
    at: Place
    parameters: tuple[Parameter, ...] = ()
    result: Type | None = None
    instructions: list[Instruction] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    kinds: list[Type] = field(default_factory=list)
    locals: dict[str, Local] = field(default_factory=dict)
    temps: int = 0


class Frame:
    """One call of a routine.

    Attributes:
        pc: the next instruction.
        continued: the statement behind a CONTINUE, which does not stop the advance run; else -1.
        guarded: the statement behind an ON_ERROR_PROCEED; else -1.
        result: the caller's temp for the result; -1 for none.
        memory: of one instruction that has to wait: what it keeps between two attempts.
    """

    __slots__ = (
        "cells", "code", "continued", "guarded", "machine", "memory", "pc", "result", "temps",
    )  # fmt: skip

    def __init__(self, code: Code, machine: Machine, cells: list[Box], result: int = -1) -> None:
        self.code = code
        self.machine = machine
        self.cells = cells
        self.temps: list[Any] = [None] * code.temps
        self.pc = 0
        self.continued = -1
        self.guarded = -1
        self.result = result
        self.memory: Any = None
