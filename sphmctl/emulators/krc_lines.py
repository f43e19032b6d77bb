"""The lines to a board at the terminals of the emulated controller, by their I/O numbers."""

from __future__ import annotations

from collections.abc import Callable

from sphmctl.emulators.interpreter.signals import Terminals
from sphmctl.emulators.krc_files import Numbers

NUMBERS = Numbers(ok=1, knot=1, moving=2)
"""Where they are when nobody says; any that are free would do."""


class TerminalLines:
    """Both outputs and the input of the robot program, as INTERFACE.md names them.

    Attributes:
        on_output: told of each change of an output: which, and its level.
    """

    def __init__(self, terminals: Terminals, numbers: Numbers) -> None:
        self._inputs = terminals.inputs
        self._ok = numbers.ok - 1
        self._names = {numbers.knot: "knot", numbers.moving: "moving"}
        self.on_output: Callable[[str, bool], None] = lambda _name, _level: None
        terminals.outputs.changed = self._changed

    @property
    def wrist_ok(self) -> bool:
        """The input; a line that nobody drives is off."""
        return bool(self._inputs[self._ok])

    @wrist_ok.setter
    def wrist_ok(self, level: bool) -> None:
        self._inputs[self._ok] = level

    def _changed(self, number: int, level: bool) -> None:
        if number in self._names:
            self.on_output(self._names[number], level)
