"""The compiled firmware in the simulator, held: what the board does, to the cycle, in us.

Host and servos are played byte by byte ahead of time, so that every phase can be had. Nothing of
the firmware is looked at from inside, but for its clock (`clock_start_us`).
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from sphmctl.drivers.board import ERROR_COUNTERS
from sphmctl.emulators.board import (
    BUS,
    CLOCK_HZ,
    DIRECTION_PIN,
    HOST,
    SIMULATOR_ERRORS,
    Board,
    Byte,
    Edge,
    Options,
)
from sphmctl.emulators.lines import KNOT_PIN, MOVING_PIN, OK_PIN, STOP_PIN
from sphmctl.wire import board_table as table
from sphmctl.wire import dxl
from tests.firmware.rig import BOARD, READ, SYNC_READ, SYNC_WRITE, WRITE, instruction

BYTE_US = 10.0
"""Ten bits at 1 Mbaud."""

BOOT_US = 20_000.0
"""After power-up: the stack is painted, both receivers are on, the loop runs."""

SETTLED_US = 6_500.0
"""After an instruction that nobody answers: a broadcast ping is waited for 5 ms."""

RAM_BEGIN, RAM_END = 0x200, 0x2200
"""The ATmega2560's (data sheet, section 8.2)."""

TCNT4 = 0xA4
"""Counter of timer 4 in data memory (data sheet, register summary)."""

TICK_CYCLES, TICKS_PER_US = 8, 2
"""Timer 4 counts each eighth cycle."""

IDS = (1, 2, 3)
GOAL, POSITION = b"\x74\x00\x04\x00", b"\x84\x00\x04\x00"
"""Address and size of Goal and Present Position (e-manual, XL430-W250, "Control Table")."""

BROADCAST = 0xFE
SYNC_WRITE_29 = instruction(
    BROADCAST, SYNC_WRITE, GOAL + b"".join(bytes((i, 0x10, 8, 0, 0)) for i in IDS)
)
SYNC_READ_17 = instruction(BROADCAST, SYNC_READ, POSITION + bytes(IDS))
"""The two frames of each cycle of a run."""

TURNAROUND_US = (40.0, 300.0)
"""A servo's answer begins so long after the instruction, or after the answer before it."""

Span = tuple[float, float]


def us(at_s: float) -> float:
    """An instant of the simulator, exact: whole cycles are sixteenths of a microsecond."""
    return round(at_s * CLOCK_HZ) / (CLOCK_HZ // 1_000_000)


def judge(name: str, values_us: Iterable[float], most_us: float, least_us: float = 0.0) -> None:
    """Print a figure beside its limit, and hold it to that."""
    values = list(values_us)
    assert values, f"{name}: nothing measured"
    low, high = min(values), max(values)
    print(
        f"{name}: min {low:.2f} us, max {high:.2f} us in {len(values)}; "
        f"limit {least_us:g} to {most_us:g} us"
    )
    assert least_us <= low, f"{name}: {low:.2f} us is below {least_us:g} us"
    assert high <= most_us, f"{name}: {high:.2f} us is above {most_us:g} us"


class Simulated:
    """A held board with its stop released and both lines from the controller off.

    Attributes:
        host, bus: bytes that the board has sent to either side.
        edges: of the direction pin and of "wrist ok".
    """

    def __init__(self, firmware: Path) -> None:
        self.board = Board(Options(firmware))
        self.host: list[Byte] = []
        self.bus: list[Byte] = []
        self.edges: list[Edge] = []
        self.board.on.byte = {HOST: self.host.append, BUS: self.bus.append}
        self.board.on.edge = self.edges.append
        self._free_us = {HOST: 0.0, BUS: 0.0}
        for pin, level in ((STOP_PIN, False), (KNOT_PIN, True), (MOVING_PIN, True)):
            self.board.drive(pin, level)
        for pin in (DIRECTION_PIN, OK_PIN):
            self.board.watch(pin)

    @property
    def now_us(self) -> float:
        """Since power-up."""
        return self.board.now_cycle() / 16

    def forget(self) -> None:
        """Drop what was noted so far."""
        for noted in (self.host, self.bus, self.edges):
            noted.clear()

    def run_until(self, at_us: float) -> None:
        """Go on."""
        self.board.run_us(at_us - self.now_us)

    def put(self, port: int, data: bytes, at_us: float) -> float:
        """Bytes on a wire from `at_us` on, or after those before; when their last stop bit ends."""
        begin_us = max(us(at_us / 1e6), self._free_us[port])
        self.board.put(port, data, begin_us / 1e6)
        self._free_us[port] = begin_us + BYTE_US * len(data)
        return self._free_us[port]

    def drive(self, pin: str, level: bool, at_us: float) -> float:
        """Drive a pin from `at_us` on; that instant in whole cycles."""
        self.board.drive(pin, level, at_us / 1e6)
        return us(at_us / 1e6)

    def ask(self, frame: bytes, time_us: float = 2000.0) -> list[dxl.Status]:
        """Send a frame now and wait; the statuses that came."""
        before = len(self.host)
        self.run_until(self.put(HOST, frame, self.now_us) + time_us)
        return statuses(self.host[before:])

    def write(self, item: table.Item, value: int) -> None:
        """Write an item of the board."""
        data = item.address.to_bytes(2, "little") + value.to_bytes(item.size, "little")
        (status,) = self.ask(instruction(BOARD, WRITE, data))
        assert (status.device_id, status.error) == (BOARD, 0)

    def read(self, first: table.Item, last: table.Item) -> dict[str, int]:
        """The board's items from one to another."""
        size = last.address + last.size - first.address
        (status,) = self.ask(read(BOARD, first.address, size), 4500.0)
        data = dxl.expect_data(status, size)
        return {
            item.name: int.from_bytes(data[item.address - first.address :][: item.size], "little")
            for item in table.ITEMS
            if first.address <= item.address <= last.address
        }

    def arm(self, watchdog_units: int) -> None:
        """Put "wrist ok" on."""
        for item, value in (
            (table.BUS_WATCHDOG, 0),
            (table.FAULTS, 0),
            (table.ARM, 1),
            (table.BUS_WATCHDOG, watchdog_units),
            (table.OUTPUTS, table.OUTPUTS_WRIST_OK),
        ):
            self.write(item, value)
        assert self.ok_edges()[-1][1]

    def ok_edges(self) -> list[tuple[float, bool]]:
        """When "wrist ok" changed, and to what."""
        return [(us(edge.at_s), edge.level) for edge in self.edges if edge.pin == OK_PIN]

    def driving(self) -> list[Span]:
        """From when to when the board drove the bus."""
        edges = [edge for edge in self.edges if edge.pin == DIRECTION_PIN]
        assert [edge.level for edge in edges] == [True, False] * (len(edges) // 2)
        return [(us(rise.at_s), us(fall.at_s)) for rise, fall in pairwise(edges) if rise.level]

    def check_counters(self, unanswered: int = 0) -> None:
        """Neither board nor simulator counts an error, but for instructions nobody answered."""
        stats = self.board.stats()
        assert self.board.faults == []
        assert {name: stats[name] for name in SIMULATOR_ERRORS if stats[name]} == {}
        counted = self.read(table.HOST_CRC_ERRORS, table.REFUSED_FRAMES)
        wanted = {item.name: 0 for item in ERROR_COUNTERS} | {"BUS_TIMEOUTS": unanswered}
        assert {name: counted[name] for name in wanted} == wanted

    def clock_start_us(self) -> float:
        """When the board's clock was 0, to half a microsecond.

        The clock is made from the count of timer 4, an eighth of the cycles since that timer was
        started. The simulator leaves the last count read in the counter's register: each shows
        when the timer was started. The clock is only brought up to date now and then, from a count
        just read: it was 0 at the count which then is the difference of both. Later counts, and
        looks that come late, make either number larger, so that the smallest ones are right.
        """
        at = self._table_address() + table.BOARD_CLOCK.address
        timer, zero = [], []
        before = (-1, -1)
        for _ in range(2000):
            self.board.run_us(0.25)
            count = int.from_bytes(self.board.memory(TCNT4, 2), "little")
            clock_us = int.from_bytes(self.board.memory(at, 4), "little")
            if before[0] not in (-1, count):
                timer.append((self.board.now_cycle() - TICK_CYCLES * count) % (TICK_CYCLES << 16))
            if (count, clock_us) == before:  # not half written
                zero.append((count - TICKS_PER_US * clock_us) % (1 << 16))
            before = count, clock_us
        return (min(timer) + TICK_CYCLES * min(zero)) / 16

    def _table_address(self) -> int:
        """Where the table is in RAM: by its first bytes, more of them than any frame has held."""
        build = self.read(table.BUILD_HASH, table.BUILD_HASH)["BUILD_HASH"]
        head = table.BOARD_MODEL.to_bytes(2, "little") + build.to_bytes(4, "little")
        head += bytes((table.BOARD_FIRMWARE, table.BOARD_ID))
        ram = b"".join(self.board.memory(at, 1024) for at in range(RAM_BEGIN, RAM_END, 1024))
        assert ram.count(head) == 1
        return RAM_BEGIN + ram.index(head)


def read(device_id: int, address: int, size: int) -> bytes:
    """A Read."""
    return instruction(device_id, READ, address.to_bytes(2, "little") + size.to_bytes(2, "little"))


def values(sent: Sequence[Byte]) -> bytes:
    """The bytes alone."""
    return bytes(byte.value for byte in sent)


def statuses(sent: Sequence[Byte]) -> list[dxl.Status]:
    """The statuses in what the board sent to its host; there is nothing else."""
    splitter = dxl.Splitter()
    splitter.feed(values(sent))
    found = []
    while (frame := splitter.next_frame()) is not None:
        found.append(dxl.parse_status(frame))
    assert (splitter.garbage_bytes, splitter.pending_bytes) == (0, 0)
    return found


def noise(rng: random.Random, size: int) -> bytes:
    """Parameters with everything that has to be stuffed now and then."""
    data = bytearray(rng.randbytes(size))
    if size > 8 and rng.random() < 0.3:
        at = rng.randrange(size - 4)
        data[at : at + 3] = b"\xff\xff\xfd"
    return bytes(data)
