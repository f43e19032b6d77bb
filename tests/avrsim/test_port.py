"""The board's pseudo-terminal: reset at opening, rates, the bootloader, and avrdude for real."""

from __future__ import annotations

import asyncio
import os
import subprocess
import termios
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from sphmctl import clock
from sphmctl.emulators.board import HOST, Board, Options
from sphmctl.emulators.board_process import BoardError, simulator
from tests.avrsim.conftest import Sketch
from tests.avrsim.rig import BOOTLOADER, PING_1
from tests.avrsim.test_servos import open_port, read_some

pytestmark = pytest.mark.realtime

AVRDUDE_TIMEOUT_S = 20.0

NOTICED_TIMEOUT_S = 5.0


@asynccontextmanager
async def paced(options: Options) -> AsyncIterator[Board]:
    board = Board(options, "paced")
    try:
        yield board
    finally:
        board.close()


def clients_of(board: Board) -> asyncio.Queue[bool]:
    """What the board notices of its clients: True at an opening, False at the last closing."""
    noticed: asyncio.Queue[bool] = asyncio.Queue()
    board.on.client = lambda _, opened: noticed.put_nowait(opened)
    return noticed


async def open_and_close(board: Board, clients: asyncio.Queue[bool], *, hang_up: bool) -> None:
    """Open the port, set HUPCL, close it; the board notices both."""
    fd = open_port(board.port, termios.B1000000)
    mode = termios.tcgetattr(fd)
    mode[2] = mode[2] | termios.HUPCL if hang_up else mode[2] & ~termios.HUPCL
    termios.tcsetattr(fd, termios.TCSANOW, mode)
    async with asyncio.timeout(NOTICED_TIMEOUT_S):
        assert await clients.get()
        os.close(fd)
        assert not await clients.get()


def test_opening_resets_unless_the_last_one_left_the_line_up(sketch: Sketch) -> None:
    async def scenario() -> list[int]:
        resets = []
        async with paced(Options(sketch("echo"))) as board:
            clients = clients_of(board)
            for hang_up in (True, False, True, True):
                await open_and_close(board, clients, hang_up=hang_up)
                resets.append(board.stats()["resets"])
        return resets

    # The second close leaves DTR up, so the third opening is no edge.
    assert clock.run(scenario()) == [1, 2, 2, 3]


@pytest.mark.parametrize(("rate", "same"), [(termios.B115200, True), (termios.B57600, False)])
def test_the_rate_of_the_client_counts(sketch: Sketch, rate: int, same: bool) -> None:
    async def scenario() -> bytes:
        options = Options(sketch("echo", "HOST_DIVIDER=16"), reset_on_open=False)
        async with paced(options) as board:
            clients = clients_of(board)
            fd = open_port(board.port, rate)
            try:
                async with asyncio.timeout(NOTICED_TIMEOUT_S):
                    await clients.get()
                os.write(fd, b"rates")
                return await read_some(fd, 5)
            finally:
                os.close(fd)

    assert (clock.run(scenario()) == b"rates") == same


def first_sign_of_the_sketch_s(firmware: Path, pings_s: tuple[float, ...]) -> float | None:
    """When a sketch that says "!" at its start does so, with pings at these instants."""
    board = Board(Options(firmware, bootloader=BOOTLOADER))
    heard: list[float] = []
    board.on.byte[HOST] = lambda byte: heard.append(byte.end_s) if byte.value == ord("!") else None
    for at_s in pings_s:
        board.put(HOST, PING_1, at_s, baud=115_200)
    board.run_us(6.5e6)
    board.close()
    return heard[0] if heard else None


def test_a_host_that_pings_keeps_the_board_in_its_bootloader(sketch: Sketch) -> None:
    firmware = sketch("capture")
    silent_s = first_sign_of_the_sketch_s(firmware, ())
    once_s = first_sign_of_the_sketch_s(firmware, (0.3,))
    always_s = first_sign_of_the_sketch_s(firmware, tuple(0.3 + 0.5 * i for i in range(13)))
    assert silent_s == pytest.approx(0.84, abs=0.05)
    assert once_s is not None
    assert once_s > 4.0
    assert always_s is None


async def avrdude(port: str, *words: str) -> tuple[int, str]:
    """Run avrdude as `sphmctl firmware flash` does; its exit code and what it said."""
    process = await asyncio.create_subprocess_exec(
        *("avrdude", "-q", "-c", "wiring", "-P", port, "-b", "115200", "-D", *words),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    async with asyncio.timeout(AVRDUDE_TIMEOUT_S):
        said, _ = await process.communicate()
    assert process.returncode is not None
    return process.returncode, said.decode()


def test_avrdude_flashes_and_verifies_and_the_sketch_runs(sketch: Sketch) -> None:
    image = sketch("capture")
    other = sketch("echo")

    async def scenario() -> None:
        async with paced(Options(None, bootloader=BOOTLOADER)) as board:
            code, said = await avrdude(board.port, "-p", "m2560", "-U", f"flash:w:{image}:i")
            assert code == 0, said
            assert "verified" in said
            fd = open_port(board.port, termios.B1000000)
            try:
                assert await read_some(fd, 1) == b"!"
            finally:
                os.close(fd)
            code, said = await avrdude(board.port, "-p", "m2560", "-U", f"flash:v:{other}:i")
            assert code != 0, said

    clock.run(scenario())


def test_avrdude_refuses_another_part(sketch: Sketch) -> None:
    async def scenario() -> tuple[int, str]:
        async with paced(Options(sketch("echo"), bootloader=BOOTLOADER)) as board:
            return await avrdude(board.port, "-p", "m1280", "-U", f"flash:w:{sketch('echo')}:i")

    code, said = clock.run(scenario())
    assert code == 1
    assert "signature" in said


def test_without_its_source_the_simulator_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(BoardError, match=r"source is not there; it comes with a checkout"):
        simulator(source=tmp_path)


def test_without_a_compiler_the_simulator_names_the_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BoardError, match=r"apt-get install gcc libc6-dev libsimavr-dev"):
        simulator()


def test_a_wrong_hex_file_is_named_with_its_line(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.hex"
    wrong.write_text(":0400000001020304F2\n:00000001FE\n")
    with pytest.raises(BoardError, match=r"wrong\.hex:2: not a record"):
        Board(Options(wrong))


def test_the_simulator_is_clean_under_sanitizers(sketch: Sketch, tmp_path: Path) -> None:
    program = simulator(("-fsanitize=address,undefined", "-fno-sanitize-recover=all"))
    commands = (
        "watch B7\nthrough 16000\nput 0 0 75\nput 1 0 00112233445566778899\nto 20000\nto 40000\n"
        "drive B0 0 50000\ndrive L0 1 45000\nrate 0 57600\nput 0 0 ffff00\nthrough 200000\n"
        "put 0 0 72\nthrough 800000\nreset\nmemory 8700 4\nmemory 9000 4\nput 9 9 9\nnonsense\n"
        "drive E4 0 0\nput 1 0 55\nstats\n"
    )
    options = ["--bus", "E4", "--pty", "1", "--eeprom", str(tmp_path / "eeprom")]
    options += ["--boot", str(BOOTLOADER), str(sketch("pins", "PULSE_CYCLES=100"))]
    done = subprocess.run(
        [str(program), *options],
        input=commands,
        capture_output=True,
        text=True,
        env={**os.environ, "ASAN_OPTIONS": "detect_leaks=0"},  # libsimavr frees little at its end
        timeout=60,
        check=False,
    )
    assert done.stderr == ""
    assert done.returncode == 0
    assert "stats cycle=8000" in done.stdout
