"""What a run records of its board, on a board whose every answer is made up here."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from sphmctl import clock
from sphmctl.daemon.board_report import KNOT_EDGE, BoardRecord
from sphmctl.daemon.record import Events
from sphmctl.drivers.board import STAMPS, STATE_BYTES, Board, Identity
from sphmctl.drivers.servo_bus import ServoBus
from sphmctl.wire import board_table as table
from tests.drivers.far_end import FarEnd
from tests.wire import dxl_reference

IDENTITY = Identity(table.BOARD_MODEL, 1, 0x1234, table.BOARD_PROTOCOL)
READ_S = 0.0017
"""One read of the board's state without an adapter: 14 and 95 bytes at 1 Mbaud, and some."""


class MadeUp:
    """A board that passed edges of "knot" at instants that the test names.

    Attributes:
        edges: its counter, before it wraps.
        stamps_s: when the newest edges were, by number modulo `STAMPS`.
    """

    def __init__(self, edges: int) -> None:
        self.edges = edges
        self.stamps_s = [0.0] * STAMPS
        self.resets, self.uptime_s = 3, 100
        self.silent = False

    def pass_edge(self, at_s: float) -> None:
        """One more edge."""
        self.edges += 1
        self.stamps_s[self.edges % STAMPS] = at_s

    def answer(self, far: FarEnd, request: bytes) -> None:
        """Answer a read of the state, sampled now; the driver is told when it is over."""
        if self.silent:
            return
        now_s = asyncio.get_running_loop().time()
        values = {
            table.BOARD_CLOCK: round(now_s * 1e6),
            table.KNOT_EDGES: self.edges % 65536,
            table.RESETS: self.resets,
            table.UPTIME: self.uptime_s,
        }
        stamps = (table.KNOT_STAMP_0, table.KNOT_STAMP_1, table.KNOT_STAMP_2, table.KNOT_STAMP_3)
        values |= {
            stamp: round(at_s * 1e6) for stamp, at_s in zip(stamps, self.stamps_s, strict=True)
        }
        data = bytearray(STATE_BYTES)
        for item, value in values.items():
            place = item.address - table.OUTPUTS.address
            data[place : place + item.size] = value.to_bytes(item.size, "little")
        far.send(dxl_reference.status(table.BOARD_ID, bytes(data)), READ_S)


def recorded(
    hardware: MadeUp, test: Callable[[BoardRecord, Board], Awaitable[None]]
) -> tuple[dict[str, Any], list[tuple[str, dict[str, Any]]]]:
    """The report and the events of a record that begins with the board as it is."""

    async def main() -> tuple[dict[str, Any], list[tuple[str, dict[str, Any]]]]:
        bus = ServoBus(FarEnd(hardware.answer).open, "wrist", 1_000_000)
        await bus.connect()
        board = Board(bus, table.BOARD_ID, "P", "wrist")
        events = Events(None, asyncio.get_running_loop().time)
        record = BoardRecord(board, await board.state(), IDENTITY, events)
        await test(record, board)
        await record.end()
        await bus.close()
        return record.report, [entry[1:] for entry in events.history]

    return clock.run(main(), virtual=True)


def test_edges_are_counted_and_timed_once_each_across_the_counter_s_wrap() -> None:
    hardware = MadeUp(65534)
    true_s: list[float] = []

    async def test(record: BoardRecord, board: Board) -> None:
        begin_s = asyncio.get_running_loop().time()
        for count in (1, 2, 0, 3):
            for _ in range(count):
                await asyncio.sleep(0.003)
                hardware.pass_edge(asyncio.get_running_loop().time())
                true_s.append(asyncio.get_running_loop().time() - begin_s)
            state = await board.state()
            record.take(state)
            record.take(state)

    report, events = recorded(hardware, test)
    edges = [fields for name, fields in events if name == KNOT_EDGE]
    assert [fields["number"] for fields in edges] == [1, 2, 3, 4, 5, 6]
    # The record's clock began one read earlier; its window is what the reads leave, below 1 ms.
    for fields, at_s in zip(edges, true_s, strict=True):
        assert 0.0 < fields["window_ms"] < 2.0
        assert abs(fields["edge_s"] - READ_S - at_s) < 2e-3
    assert (report["knot_edges"], report["reset"]) == (6, False)


def test_edges_beyond_the_four_stamps_are_counted_without_a_time() -> None:
    hardware = MadeUp(7)

    async def test(record: BoardRecord, board: Board) -> None:
        for _ in range(6):
            hardware.pass_edge(asyncio.get_running_loop().time())

    report, events = recorded(hardware, test)
    assert ("knot edges without a time", {"count": 2}) in events
    assert [f["number"] for name, f in events if name == KNOT_EDGE] == [3, 4, 5, 6]
    assert report["knot_edges"] == 6


def test_a_board_that_was_reset_has_no_count_of_edges() -> None:
    def by_count(hardware: MadeUp) -> None:
        hardware.resets += 1

    def by_power(hardware: MadeUp) -> None:
        hardware.uptime_s = 0

    for how in (by_count, by_power):
        hardware = MadeUp(40)

        async def test(
            record: BoardRecord,
            board: Board,
            how: Callable[[MadeUp], None] = how,
            hardware: MadeUp = hardware,
        ) -> None:
            how(hardware)
            hardware.edges = 2

        report, events = recorded(hardware, test)
        assert (report["knot_edges"], report["reset"]) == (None, True)
        assert report["end"]["uptime_s"] == hardware.uptime_s
        assert [name for name, _ in events].count("board reset") == 1
        assert KNOT_EDGE not in [name for name, _ in events]


def test_a_board_that_is_lost_leaves_the_end_open() -> None:
    hardware = MadeUp(40)

    async def test(record: BoardRecord, board: Board) -> None:
        hardware.silent = True

    report, events = recorded(hardware, test)
    assert (report["end"], report["knot_edges"], report["reset"]) == (None, None, None)
    assert events[-1][0] == "board lost"
