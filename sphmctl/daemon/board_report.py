"""What a run tells of its board: identity, and the counters at begin and end."""

from __future__ import annotations

from typing import Any

from sphmctl.daemon.record import Events
from sphmctl.drivers.board import Board
from sphmctl.errors import DeviceError

EDGE_SPAN = 1 << 16
"""The board counts edges in 16 bits."""


async def board_document(board: Board | None) -> dict[str, Any] | None:
    """Identity, inputs and counters of a board, as `status` shows them; None without a board.

    Raises:
        DeviceError: it is silent.
    """
    if board is None:
        return None
    identity, state = await board.identity(), await board.state()
    return {
        "firmware": identity.firmware,
        "build_hash": f"{identity.build_hash:08x}",
        "protocol_version": f"{identity.protocol:04x}",
        "emergency_stop": state.stop_pressed,
        "knot_edges": state.knot_edges,
        "counters": state.counters,
    }


async def board_begins(board: Board | None, events: Events) -> dict[str, Any] | None:
    """The run's report on its board, before it is armed; None without a board.

    Raises:
        DeviceError: it is silent.
    """
    document = await board_document(board)
    if document is None or board is None:
        return None
    counters = document.pop("counters")
    document.pop("emergency_stop")
    events.add("board at the begin", **counters)
    return {**document, "begin": counters, "end": None, "clock_window_ms": None}


async def board_ends(board: Board | None, report: dict[str, Any] | None, events: Events) -> None:
    """Complete the report; a board that is lost by now leaves `end` empty."""
    if board is None or report is None:
        return
    try:
        state = await board.state()
    except DeviceError as error:
        report["knot_edges"] = None
        events.add("board lost", message=error.message)
        return
    report["end"] = state.counters
    report["knot_edges"] = (state.knot_edges - report["knot_edges"]) % EDGE_SPAN
    report["clock_window_ms"] = round(1000.0 * board.clock_window_s, 3)
    events.add("board at the end", **state.counters)
