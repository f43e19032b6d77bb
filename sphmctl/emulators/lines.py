"""The digital lines between controller and board: levels at the controller's terminals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sphmctl.emulators.board import Board, Edge

KNOT_PIN, MOVING_PIN, STOP_PIN, OK_PIN = "L0", "L1", "L2", "L3"
"""D49, D48, D47 and D46 of an Arduino Mega (firmware/board/README.md, pin table)."""


class Levels(Protocol):
    """A controller's end of the lines."""

    wrist_ok: bool
    on_output: Callable[[str, bool], None]


class Loose:
    """Terminals that lead nowhere: a board without a controller."""

    def __init__(self) -> None:
        self.wrist_ok = False
        self.on_output: Callable[[str, bool], None] = lambda _name, _level: None


class Wiring:
    """The three lines and the emergency stop's contact, from terminals to the board's pins.

    24 V at a terminal pulls the board's input low through an optocoupler; its output drives one.

    Args:
        lines: the controller's terminals.
        board: whose pins.
        advance: brings the controller up to the present instant.
    """

    def __init__(self, lines: Levels, board: Board, advance: Callable[[], None]) -> None:
        self._lines = lines
        self._board = board
        self._advance = advance
        self.cut = False
        board.on.edge = self._hear
        board.watch(OK_PIN)
        lines.on_output = self._put
        for name in ("knot", "moving"):
            self._put(name, False)
        self.press_stop(False)

    def press_stop(self, pressed: bool = True) -> None:
        """Open or close the contact of the emergency stop at the board."""
        self._board.drive(STOP_PIN, pressed)

    def cut_wrist_ok(self) -> None:
        """The wire of "wrist ok" breaks."""
        self._advance()
        self.cut = True
        self._lines.wrist_ok = False

    def _put(self, name: str, level: bool) -> None:
        self._board.drive({"knot": KNOT_PIN, "moving": MOVING_PIN}[name], not level)

    def _hear(self, edge: Edge) -> None:
        if edge.pin == OK_PIN and not self.cut:
            self._advance()
            self._lines.wrist_ok = edge.level
