"""Emulated servos on the bus of a simulated board, to the board's clock; no adapter."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sphmctl.emulators.board import BUS, Board, Byte
from sphmctl.emulators.dxl_frame import FrameFinder, Instruction
from sphmctl.emulators.servo_bus import BITS_PER_BYTE, MAX_GAP_S
from sphmctl.emulators.servo_instructions import answer
from sphmctl.emulators.xl430 import Servo

RATE_TOLERANCE = 0.03
"""How far sender and receiver may be apart: a frame of 10 bits stands 5 %, both halves share it."""


class BoardBus:
    """Hears what the board sends and lets the servos answer in their time.

    Args:
        board: its bus port is taken over.
        servos: those on the bus; they live in the world of `advance`.
        advance: brings their world up to the present instant.
    """

    def __init__(self, board: Board, servos: Sequence[Servo], advance: Callable[[], None]) -> None:
        self.servos = tuple(servos)
        self._board = board
        self._advance = advance
        self._finder = FrameFinder()
        self._last_s = self._busy_until_s = 0.0
        board.on.byte[BUS] = self._hear

    @property
    def crc_errors(self) -> int:
        """Instructions that reached the servos garbled."""
        return self._finder.crc_errors

    def _hear(self, byte: Byte) -> None:
        if byte.end_s - self._last_s > MAX_GAP_S:
            self._finder.drop()
        self._last_s = byte.end_s
        for packet in self._finder.feed(bytes((byte.value,))):
            self._obey(packet, byte.end_s, byte.baud)

    def _obey(self, packet: Instruction, end_s: float, baud: float) -> None:
        self._advance()
        hearing = [s for s in self.servos if s.listening and _matches(s.baud, baud)]
        self._busy_until_s = max(end_s, self._busy_until_s)
        for reply in answer(packet, hearing):
            rate = hearing[0].baud
            begin_s = self._busy_until_s + reply.delay_s
            self._busy_until_s = begin_s + len(reply.data) * BITS_PER_BYTE / rate
            self._board.put(BUS, reply.data, begin_s, rate)


def _matches(rate: float, baud: float) -> bool:
    return abs(rate / baud - 1.0) < RATE_TOLERANCE
