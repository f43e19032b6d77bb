"""Emulated servos behind a simulated board: on the virtual clock, and in real time over a pty."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import termios
import tty
from collections.abc import Callable
from pathlib import Path

import pytest

from sphmctl import clock
from sphmctl.emulators.board import BUS, Board, Byte, Options
from sphmctl.emulators.board_bus import BoardBus
from sphmctl.emulators.board_host import BoardHost
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from tests.avrsim.conftest import Sketch
from tests.avrsim.rig import PING_1, STATUS_1

BOOT_S = 0.5
"""Until the servos have booted."""

ANSWER_TIMEOUT_S = 5.0


class Pipe:
    """A host's end in memory."""

    def __init__(self) -> None:
        self.on_bytes: Callable[[bytes], None] = lambda _: None
        self.on_lost: Callable[[], None] = lambda: None
        self.heard = b""
        self.came = asyncio.Event()

    def write(self, data: bytes) -> None:
        """From the board."""
        self.heard += data
        self.came.set()

    def close(self) -> None:
        """Nothing to hang up."""


def servo_bus(board: Board) -> BoardBus:
    """One servo, that of the e-manual's example."""
    world = World(asyncio.get_running_loop().time)
    servo = Servo(random.Random(1), model=1030, firmware=38)
    world.add(servo)
    return BoardBus(board, [servo], world.advance)


async def ping_on_virtual_time(firmware: Path) -> tuple[bytes, float, float]:
    """What the host hears, when, and where on the bus the ping ended, both since it was sent."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, clock.VirtualLoop)
    board = Board(Options(firmware))
    loop.accompany(board.ahead)
    servo_bus(board)
    pipe = Pipe()
    BoardHost(board, random.Random(1), "none").attach(pipe)
    ends: list[float] = []
    hear = board.on.byte[BUS]

    def note(byte: Byte) -> None:
        ends.append(byte.end_s)
        hear(byte)

    board.on.byte[BUS] = note
    await asyncio.sleep(BOOT_S)
    sent_s = loop.time()
    pipe.on_bytes(PING_1)
    while len(pipe.heard) < len(STATUS_1):
        pipe.came.clear()
        async with asyncio.timeout(ANSWER_TIMEOUT_S):
            await pipe.came.wait()
    loop.accompany(None)
    assert board.faults == []
    board.close()
    return pipe.heard, loop.time() - sent_s, ends[-1] - sent_s


def test_a_servo_answers_through_the_firmware_at_its_instant(sketch: Sketch) -> None:
    heard, took_s, bus_end_s = clock.run(ping_on_virtual_time(sketch("forward")), virtual=True)
    assert heard == STATUS_1
    # Ten bytes in, the last of them once more on the bus, 3 us of the loop each way.
    assert 110e-6 < bus_end_s < 115e-6
    # 50 us of the servo's turnaround, 14 bytes, the last of them once more to the host; the host
    # is told 30 us after the end.
    assert bus_end_s + 50e-6 + 150e-6 < took_s < bus_end_s + 50e-6 + 150e-6 + 40e-6


def test_virtual_runs_with_the_firmware_are_alike_to_the_last_digit(sketch: Sketch) -> None:
    firmware = sketch("forward")
    runs = [clock.run(ping_on_virtual_time(firmware), virtual=True) for _ in range(2)]
    assert runs[0] == runs[1]


async def read_some(fd: int, size: int) -> bytes:
    """`size` bytes from a terminal."""
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()
    loop.add_reader(fd, ready.set)
    data = b""
    try:
        async with asyncio.timeout(ANSWER_TIMEOUT_S):
            while len(data) < size:
                await ready.wait()
                ready.clear()
                with contextlib.suppress(BlockingIOError):
                    data += os.read(fd, size)
    finally:
        loop.remove_reader(fd)
    return data


def open_port(path: str, rate: int) -> int:
    """Open a serial port as a client does."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(fd)
    mode = termios.tcgetattr(fd)
    mode[4] = mode[5] = rate
    termios.tcsetattr(fd, termios.TCSANOW, mode)
    return fd


async def ping_in_real_time(firmware: Path, link: Path) -> tuple[bytes, dict[str, int]]:
    board = Board(Options(firmware, host_link=link, reset_on_open=False), "paced")
    servo_bus(board)
    await asyncio.sleep(BOOT_S)
    fd = open_port(str(link), termios.B1000000)
    try:
        os.write(fd, PING_1)
        heard = await read_some(fd, len(STATUS_1))
        return heard, board.stats()
    finally:
        os.close(fd)
        board.close()


@pytest.mark.realtime
def test_a_servo_answers_through_a_paced_board_and_its_pseudo_terminal(
    sketch: Sketch, tmp_path: Path
) -> None:
    link = tmp_path / "port"
    heard, stats = clock.run(ping_in_real_time(sketch("forward"), link))
    assert heard == STATUS_1
    assert (stats["rx_bytes0"], stats["tx_bytes1"], stats["tx_lost1"]) == (10, 10, 0)
    assert not link.is_symlink()
