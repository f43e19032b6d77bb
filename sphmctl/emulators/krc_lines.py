"""The lines to a board at the terminals of the emulated controller, by their I/O numbers."""

from __future__ import annotations

from collections.abc import Callable

from sphmctl.emulators.interpreter.signals import Terminals

OK_INPUT, KNOT_OUTPUT, MOVING_OUTPUT = 1, 1, 2
"""$IN and $OUT numbers of this cell; any that are free would do."""

_NAMES = {KNOT_OUTPUT: "knot", MOVING_OUTPUT: "moving"}


class TerminalLines:
    """Both outputs and the input of the robot program, as INTERFACE.md names them.

    Attributes:
        on_output: told of each change of an output: which, and its level.
    """

    def __init__(self, terminals: Terminals) -> None:
        self._inputs = terminals.inputs
        self.on_output: Callable[[str, bool], None] = lambda _name, _level: None
        terminals.outputs.changed = self._changed

    @property
    def wrist_ok(self) -> bool:
        """The input; a line that nobody drives is off."""
        return bool(self._inputs[OK_INPUT - 1])

    @wrist_ok.setter
    def wrist_ok(self, level: bool) -> None:
        self._inputs[OK_INPUT - 1] = level

    def _changed(self, number: int, level: bool) -> None:
        if number in _NAMES:
            self.on_output(_NAMES[number], level)
