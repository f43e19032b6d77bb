"""The host's end of a held board: a pipe in memory, and the USB adapter behind it."""

from __future__ import annotations

import random

from sphmctl.emulators.adapter import Adapter, Usb
from sphmctl.emulators.board import HOST, Board, Byte
from sphmctl.emulators.servo_bus import BITS_PER_BYTE, Pipe


class BoardHost:
    """Serves pipes, one after the other, as a board serves whoever opens its port.

    Args:
        board: a held one; its host port is taken over.
        rng: draws the adapter's phase.
        usb: the adapter's chip.
    """

    def __init__(self, board: Board, rng: random.Random, usb: Usb = "16u2") -> None:
        self._board = board
        self._adapter = Adapter(usb, rng, self._deliver)
        self._pipe: Pipe | None = None
        self._baud = 0.0
        board.on.byte[HOST] = self._from_board

    def attach(self, pipe: Pipe, baud: int = 1_000_000) -> None:
        """Serve `pipe`, whose host talks at `baud`; that resets the board, as DTR does."""
        self._lose()
        self._pipe = pipe
        self._baud = float(baud)
        pipe.on_bytes = self._to_board
        pipe.on_lost = lambda: self._hear_loss(pipe)
        self._board.reset()

    def close(self) -> None:
        """Hang up."""
        pipe = self._pipe
        self._lose()
        if pipe is not None:
            pipe.close()

    def _hear_loss(self, pipe: Pipe) -> None:
        # An old pipe's loss may be reported when the next one is served already.
        if pipe is self._pipe:
            self._lose()

    def _lose(self) -> None:
        self._pipe = None
        self._adapter.drop()

    def _to_board(self, data: bytes) -> None:
        self._board.put(HOST, data, baud=self._baud)

    def _from_board(self, byte: Byte) -> None:
        byte_s = BITS_PER_BYTE / byte.baud
        if self._pipe is not None:
            self._adapter.put(byte.end_s - byte_s, byte_s, bytes((byte.value,)))

    def _deliver(self, data: bytes) -> None:
        if self._pipe is not None:
            self._pipe.write(data)
