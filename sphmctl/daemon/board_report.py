"""What a run tells of its board: identity, counters at begin and end, each edge of "knot"."""

from __future__ import annotations

from typing import Any

from sphmctl.daemon.record import Events
from sphmctl.drivers.board import Board, BoardState, Identity
from sphmctl.errors import DeviceError

KNOT_EDGE = "knot edge"
"""The event of one edge: `edge_s` is its time on the clock of `t_s`, `window_ms` wide."""


async def board_document(board: Board | None) -> dict[str, Any] | None:
    """Identity, inputs and counters of a board, as `status` shows them; None without a board.

    Raises:
        DeviceError: it is silent.
    """
    if board is None:
        return None
    identity, state = await board.identity(), await board.state()
    return identity_document(identity) | {
        "emergency_stop": state.stop_pressed,
        "knot_edges": state.knot_edges,
        "counters": state.counters,
    }


def identity_document(identity: Identity) -> dict[str, Any]:
    """What the board says it is."""
    return {
        "firmware": identity.firmware,
        "build_hash": f"{identity.build_hash:08x}",
        "protocol_version": f"{identity.protocol:04x}",
    }


class BoardRecord:
    """A run's record of its board: the report, and each edge of "knot" as an event.

    Args:
        board: as it answered last.
        begin: its state before it is armed.
        identity: what it says it is.
        events: where to report.

    Attributes:
        report: for the summary; complete after `end`.
    """

    def __init__(self, board: Board, begin: BoardState, identity: Identity, events: Events) -> None:
        self._board = board
        self._events = events
        self._last = begin
        self._edges = 0
        self._reset = False
        self.report: dict[str, Any] = identity_document(identity) | {
            "knot_edges": None,
            "begin": begin.counters,
            "end": None,
            "reset": None,
            "clock_window_ms": None,
        }
        events.add("board at the begin", **begin.counters)

    def take(self, state: BoardState) -> None:
        """Note the edges that a read shows for the first time; it may be given again."""
        if state is self._last or self._reset:
            return
        new = state.edges_since(self._last)
        self._last = state
        if new is None:
            self._reset = True
            self._events.add("board reset", message="it counts anew: no edges from here on")
            return
        times_s = self._board.knots_s(state, new)
        self._edges += new
        if len(times_s) < new:
            self._events.add("knot edges without a time", count=new - len(times_s))
        for number, at_s in enumerate(times_s, self._edges - len(times_s) + 1):
            fields = {"edge_s": self._events.on_clock(at_s), "window_ms": self._window_ms()}
            self._events.add(KNOT_EDGE, number=number, **fields)

    async def end(self) -> None:
        """Complete the report; a board that is lost by now leaves `end` empty."""
        try:
            state = await self._board.state()
        except DeviceError as error:
            self._events.add("board lost", message=error.message)
            return
        self.take(state)
        self.report |= {
            "knot_edges": None if self._reset else self._edges,
            "end": state.counters,
            "reset": self._reset,
            "clock_window_ms": self._window_ms(),
        }
        self._events.add("board at the end", **state.counters)

    def _window_ms(self) -> float:
        return round(1000.0 * self._board.clock_window_s, 3)


async def board_begins(board: Board | None, events: Events) -> BoardRecord | None:
    """The record of a run's board, before it is armed; None without a board.

    Raises:
        DeviceError: it is silent.
    """
    if board is None:
        return None
    identity, state = await board.identity(), await board.state()
    return BoardRecord(board, state, identity, events)
