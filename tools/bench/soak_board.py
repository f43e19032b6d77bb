"""Soak of the board: its firmware in the simulator, in held time, the full cycle for minutes.

Run `make soak`: ten simulated minutes at 50 and at 100 Hz. Each cycle is a sync write and a sync
read without a gap between them, which three emulated servos answer; each fifth cycle reads the
board's own state. Each reply is checked, and no error may be counted by board, simulator or
servos. The first wrong thing ends it, exit code 1. Held time: the same seed gives the same soak.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import random
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sphmctl import clock
from sphmctl.board.image import SHIPPED
from sphmctl.drivers.board import ERROR_COUNTERS, STATE_BYTES, STATE_ITEMS
from sphmctl.emulators.board import HOST, SIMULATOR_ERRORS, Board, Byte, Edge, Options
from sphmctl.emulators.board_bus import BoardBus
from sphmctl.emulators.lines import KNOT_PIN, MOVING_PIN, OK_PIN, STOP_PIN
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.wire import board_table as table
from sphmctl.wire import dxl
from sphmctl.wire import dxl_instructions as instructions

IDS = (1, 2, 3)
TORQUE, GOAL, POSITION = 64, 116, 132
"""Addresses of Torque Enable, Goal and Present Position (e-manual, XL430-W250)."""

MIDDLE_TICKS, SWING_TICKS, SWING_S = 2048, 100, 2.0
"""The servos follow a slow sine, so that every cycle has other bytes."""

OFF_TICKS = 50
"""How far a servo may be off its sine, which moves 6 ticks in a cycle of 20 ms: no stale goal."""

BOOT_S = 0.5
"""Until board and servos answer."""

REPLY_TIMEOUT_S = 5e-3
"""The longest transaction takes 1.2 ms; 5 ms fit into the cycle of 100 Hz."""

JITTER_S = 200e-6
"""Cycles begin at random phases of the board's loop, whose pass is shorter than this."""

BOARD_EVERY = 5
"""Cycles from one read of the board to the next, as in a run."""

KNOT_EVERY = 7
"""Cycles from one edge of "knot" to the next: longer than the board debounces."""

WATCHDOG_UNITS = 25
"""Bus Watchdog of the board, 20 ms: as in a run."""

CLOCK_OFF_US = 1000
"""How far the board's clock may be off what has passed; both count the same crystal."""

RATES_HZ = (50.0, 100.0)
MINUTES = 10.0
PROGRESS_S = 60.0
"""Simulated time between two lines of progress."""


class SoakError(Exception):
    """What went wrong, and in which cycle."""


@dataclass(frozen=True)
class Figures:
    """One soak.

    Attributes:
        cycles: how many went well.
        replies: statuses checked, the board's included.
        knots: edges of "knot" that the board has counted.
        longest_pass_us: of the board's loop, as it measures itself.
        stack_bytes: depth that the stack has reached, by the simulator.
        took_s: wall time.
    """

    rate_hz: float
    cycles: int
    replies: int
    knots: int
    longest_pass_us: int
    stack_bytes: int
    took_s: float

    def line(self) -> str:
        """As one printed line."""
        return (
            f"{self.rate_hz:g} Hz: {self.cycles} cycles, {self.replies} replies and {self.knots} "
            f"knots without an error; longest pass {self.longest_pass_us} us, "
            f"stack {self.stack_bytes} bytes, took {self.took_s:.1f} s"
        )


class Cell:
    """A held board on the running virtual loop, three servos at its bus, and a host without USB.

    Args:
        firmware: the hex file.
        rng: draws the servos' noise and the host's phases.
    """

    def __init__(self, firmware: Path, rng: random.Random) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, clock.VirtualLoop)
        self._loop = loop
        self._rng = rng
        self.board = Board(Options(firmware))
        loop.accompany(self.board.ahead)
        world = World(loop.time)
        servos = [Servo(rng, servo_id) for servo_id in IDS]
        for servo in servos:
            world.add(servo)
        self.bus = BoardBus(self.board, servos, world.advance)
        self.board.on.byte[HOST] = self._hear
        self.ok_edges: list[Edge] = []
        self.board.on.edge = self.ok_edges.append
        self.board.watch(OK_PIN)
        for pin, level in ((STOP_PIN, False), (KNOT_PIN, True), (MOVING_PIN, True)):
            self.board.drive(pin, level)
        self._splitter = dxl.Splitter()
        self._came = asyncio.Event()

    def close(self) -> None:
        """Power down."""
        self._loop.accompany(None)
        self.board.close()

    def _hear(self, byte: Byte) -> None:
        self._splitter.feed(bytes((byte.value,)))
        self._came.set()

    async def exchange(
        self, frames: bytes, ids: Sequence[int], limit_s: float = REPLY_TIMEOUT_S
    ) -> list[dxl.Status]:
        """Send `frames` without a gap; the statuses, which come from `ids` in this order.

        Args:
            frames: whole ones.
            ids: who answers.
            limit_s: from the first byte sent to the last one received.

        Raises:
            SoakError: they are others, none, more, or carry an error.
        """
        self.board.put(HOST, frames)
        statuses: list[dxl.Status] = []
        try:
            async with asyncio.timeout(limit_s):
                while len(statuses) < len(ids):
                    self._came.clear()
                    while (frame := self._splitter.next_frame()) is not None:
                        statuses.append(dxl.parse_status(frame))
                    if len(statuses) < len(ids):
                        await self._came.wait()
        except TimeoutError:
            got = [status.device_id for status in statuses]
            raise SoakError(f"ids {list(ids)} asked, only {got} answered") from None
        got = [status.device_id for status in statuses]
        if got != list(ids) or any(status.error or status.alert for status in statuses):
            raise SoakError(f"ids {list(ids)} asked, the answer is {statuses}")
        garbage = self._splitter.garbage_bytes + self._splitter.pending_bytes
        if garbage:
            raise SoakError(f"{garbage} bytes beside the statuses")
        return statuses

    async def set_item(self, item: table.Item, value: int) -> None:
        """Write an item of the board.

        Raises:
            SoakError: as `exchange`.
        """
        data = value.to_bytes(item.size, "little")
        await self.exchange(
            instructions.write(table.BOARD_ID, item.address, data), [table.BOARD_ID]
        )

    async def start(self) -> None:
        """Boot; free and arm the board, servos under torque, "wrist ok" on.

        Raises:
            SoakError: as `exchange`.
        """
        await asyncio.sleep(BOOT_S)
        await self.set_item(table.BUS_WATCHDOG, 0)
        for servo_id in IDS:
            await self.exchange(instructions.write(servo_id, TORQUE, b"\x01"), [servo_id])
        await self.set_item(table.ARM, 1)
        await self.set_item(table.LONGEST_PASS, 0)
        await self.set_item(table.BUS_WATCHDOG, WATCHDOG_UNITS)
        await self.set_item(table.OUTPUTS, table.OUTPUTS_WRIST_OK)

    async def state(self) -> dict[str, int]:
        """The board's items from OUTPUTS to the end of its table.

        Raises:
            SoakError: as `exchange`, or an item that is not as it should be in a run.
        """
        first = table.OUTPUTS.address
        frame = instructions.read(table.BOARD_ID, first, STATE_BYTES)
        (status,) = await self.exchange(frame, [table.BOARD_ID])
        data = dxl.expect_data(status, STATE_BYTES)
        state = {
            item.name: int.from_bytes(data[item.address - first :][: item.size], "little")
            for item in STATE_ITEMS
        }
        zero = [item.name for item in (*ERROR_COUNTERS, table.WATCHDOG_TRIPS, table.HINDRANCES)]
        wrong = {name: state[name] for name in zero if state[name]}
        if wrong or state["OUTPUT_STATE"] != table.OUTPUT_STATE_WRIST_OK:
            raise SoakError(f"the board counts {wrong}, wrist ok {state['OUTPUT_STATE']}")
        return state

    def check(self) -> dict[str, int]:
        """The simulator's counters.

        Raises:
            SoakError: one of simulator or servos that should be 0 is not.
        """
        stats = self.board.stats()
        wrong = {name: stats[name] for name in SIMULATOR_ERRORS if stats[name]}
        if self.board.faults or wrong or self.bus.crc_errors:
            first = self.board.faults[:1]
            raise SoakError(
                f"the simulator counts {wrong}, first {first}; servos {self.bus.crc_errors} CRC"
            )
        if [edge.level for edge in self.ok_edges] != [True]:
            raise SoakError(f"wrist ok did more than to rise: {self.ok_edges[:3]}")
        return stats


class _Soak:
    """The cycles of one soak."""

    def __init__(self, cell: Cell, rate_hz: float, rng: random.Random) -> None:
        self._cell = cell
        self._rate_hz = rate_hz
        self._rng = rng
        self._loop = asyncio.get_running_loop()
        self._knot = True
        self._clock: tuple[float, int] | None = None
        self.replies = self.knots = 0
        self.state: dict[str, int] = {}

    async def cycle(self, number: int, begin_s: float) -> None:
        """One cycle.

        Raises:
            SoakError: anything is not as it should be.
        """
        at_s = begin_s + number / self._rate_hz + self._rng.random() * JITTER_S
        await asyncio.sleep(at_s - self._loop.time())
        if number % KNOT_EVERY == 0:
            self._toggle_knot()
        await self._servos(number / self._rate_hz)
        if number % BOARD_EVERY == 0:
            await self._board()

    def _toggle_knot(self) -> None:
        self._knot = not self._knot
        self.knots += 1
        at_s = self._loop.time() + self._rng.random() * 1e-3
        self._cell.board.drive(KNOT_PIN, self._knot, at_s)

    async def _servos(self, time_s: float) -> None:
        swing = SWING_TICKS * math.sin(2 * math.pi * time_s / SWING_S)
        goal = round(MIDDLE_TICKS + swing)
        frames = instructions.sync_write(GOAL, {i: goal.to_bytes(4, "little") for i in IDS})
        frames += instructions.sync_read(POSITION, 4, IDS)
        for status in await self._cell.exchange(frames, IDS):
            position = int.from_bytes(dxl.expect_data(status, 4), "little", signed=True)
            if abs(position - goal) > OFF_TICKS:
                raise SoakError(f"servo {status.device_id} at {position}, its goal is {goal}")
        self.replies += len(IDS)

    async def _board(self) -> None:
        self.state = await self._cell.state()
        self.replies += 1
        now_s, now_us = self._loop.time(), self.state["BOARD_CLOCK"]
        before = self._clock
        self._clock = now_s, now_us
        if before is not None:
            off_us = (now_us - before[1]) % (1 << 32) - (now_s - before[0]) * 1e6
            if abs(off_us) > CLOCK_OFF_US:
                raise SoakError(f"the board's clock jumped by {off_us:.0f} us")


async def soak(
    firmware: Path, rate_hz: float, duration_s: float, tell: Callable[[str], None]
) -> Figures:
    """Run the full cycle on a virtual loop.

    Args:
        firmware: the hex file.
        rate_hz: cycles per second.
        duration_s: simulated time.
        tell: told of the progress.

    Raises:
        SoakError: the first thing that is not as it should be.
    """
    rng = random.Random(rate_hz)
    began_s = time.perf_counter()
    cell = Cell(firmware, rng)
    number = -1
    try:
        await cell.start()
        run = _Soak(cell, rate_hz, rng)
        begin_s = asyncio.get_running_loop().time()
        for number in range(round(duration_s * rate_hz)):
            await run.cycle(number, begin_s)
            if (number + 1) % round(PROGRESS_S * rate_hz) == 0:
                cell.check()
                tell(f"{rate_hz:g} Hz: {(number + 1) / rate_hz:.0f} s of {duration_s:g} s")
        await asyncio.sleep(1 / rate_hz)
        state, stats = await cell.state(), cell.check()
        if state["KNOT_EDGES"] != run.knots & 0xFFFF:
            raise SoakError(f"{run.knots} edges of knot, the board counts {state['KNOT_EDGES']}")
    except SoakError as error:
        raise SoakError(f"{rate_hz:g} Hz, cycle {number}: {error}") from error
    finally:
        cell.close()
    return Figures(
        rate_hz=rate_hz,
        cycles=number + 1,
        replies=run.replies,
        knots=run.knots,
        longest_pass_us=state["LONGEST_PASS"],
        stack_bytes=stats["stack_bytes"],
        took_s=time.perf_counter() - began_s,
    )


def main() -> None:
    """Soak at each rate; print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--firmware", type=Path, default=SHIPPED, help="hex file")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="simulated, at each rate")
    parser.add_argument("--rates", type=float, nargs="+", default=RATES_HZ, help="Hz")
    options = parser.parse_args()
    duration_s = 60.0 * options.minutes
    for rate_hz in options.rates:
        whole = soak(options.firmware, rate_hz, duration_s, partial(print, flush=True))
        try:
            print(clock.run(whole, virtual=True).line(), flush=True)
        except SoakError as error:
            sys.exit(f"soak failed: {error}")


if __name__ == "__main__":
    main()
