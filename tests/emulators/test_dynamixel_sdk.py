"""dynamixel-sdk, unchanged, in a process of its own, on the emulated servos' pseudo-terminal."""

import asyncio
import contextlib
import os
import random
import termios
from pathlib import Path
from typing import Any

import pytest

from sphmctl.emulators.pseudo_terminal import UNREAD_BYTES, PseudoTerminal
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from tests.emulators.sdk_rig import MOVE_AND_READ, answers_of

pytestmark = pytest.mark.realtime

IDLE_ROUNDS = 300
PING_1 = bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E")

CLIENT = rf"""
out["ping"] = [settle(lambda i=i: dxl.ping(port, i)) for i in (1, 2, 3)]
out["missing"] = dxl.ping(port, 4)[1]
out["read"] = settle(lambda: dxl.read4ByteTxRx(port, 2, 132))
out["torque"] = [settle(lambda i=i: dxl.write1ByteTxRx(port, i, 64, 1)) for i in (1, 2, 3)]
out["locked"] = settle(lambda: dxl.write1ByteTxRx(port, 1, 9, 1))
out["range"] = settle(lambda: dxl.write4ByteTxRx(port, 1, 116, 5000))
{MOVE_AND_READ}
port.closePort()
port = PortHandler(sys.argv[1])
assert port.openPort() and port.setBaudRate(57600)
out["wrong_baud"] = dxl.ping(port, 1)[1]
"""


def cell(*, usb: Any = "none", pacing: bool = True) -> ServoBus:
    rng = random.Random(1)
    world = World(asyncio.get_running_loop().time)
    return ServoBus(world, [Servo(rng, i) for i in (1, 2, 3)], rng, usb=usb, pacing=pacing)


async def _talk() -> dict[str, Any]:
    bus = cell()
    device = bus.open_pty()
    try:
        return await answers_of(CLIENT, device)
    finally:
        await bus.close()


@pytest.fixture(scope="module")
def answers() -> dict[str, Any]:
    """What the SDK got from the emulated servos."""
    return asyncio.run(_talk())


def test_the_sdk_pings_three_servos_and_misses_a_fourth(answers: dict[str, Any]) -> None:
    assert answers["ping"] == [[1060, 0, 0]] * 3
    assert answers["missing"] == -3001


def test_the_sdk_reads_and_writes_and_sees_the_servos_errors(answers: dict[str, Any]) -> None:
    assert answers["read"] == [2048, 0, 0]
    assert answers["torque"] == [[0, 0]] * 3
    assert answers["locked"] == [0, 7]
    assert answers["range"] == [0, 4]


@pytest.mark.parametrize("way", ["txRxPacket", "fastSyncRead"])
def test_the_sdk_moves_and_reads_a_group(answers: dict[str, Any], way: str) -> None:
    assert answers["sync_write"] == 0
    # Each shaft stops within its dead band, one count below the goal at most.
    result, positions = answers[way]
    assert result == 0
    assert positions == pytest.approx([2101, 2102, 2103], abs=1)


def test_the_sdk_at_a_wrong_baud_rate_hears_nothing(answers: dict[str, Any]) -> None:
    assert answers["wrong_baud"] == -3001


async def _receive(client: int, size: int) -> bytes:
    """Up to `size` bytes from a client's end, until nothing has come for a while."""
    got = b""
    idle = 0
    while len(got) < size and idle < IDLE_ROUNDS:
        try:
            got += os.read(client, size - len(got))
            idle = 0
        except BlockingIOError:
            idle += 1
            await asyncio.sleep(0.001)
    return got


def _open(device: str, speed: int) -> int:
    """A client's end as the emulator has set it up, but for the rate."""
    client = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    settings = termios.tcgetattr(client)
    settings[4] = settings[5] = speed
    termios.tcsetattr(client, termios.TCSANOW, settings)
    return client


@pytest.mark.parametrize("pacing", [True, False])
def test_clients_may_come_and_go_on_one_pseudo_terminal(pacing: bool) -> None:
    async def visit() -> list[bytes]:
        bus = cell(usb="16u2", pacing=pacing)
        device = bus.open_pty()
        heard = []
        for _ in range(3):
            client = _open(device, termios.B1000000)
            os.write(client, PING_1)
            heard.append(await _receive(client, 14))
            os.close(client)
        await bus.close()
        return heard

    pong = bytes.fromhex("FF FF FD 00 01 07 00 55 00 24 04 2E FE DF")
    assert asyncio.run(visit()) == [pong] * 3


def test_the_link_points_at_the_device_until_close_and_replaces_an_old_link(
    tmp_path: Path,
) -> None:
    link = tmp_path / "wrist"
    link.symlink_to("/dev/null")

    async def life() -> None:
        bus = cell()
        device = bus.open_pty(link)
        assert os.readlink(link) == device
        await bus.close()
        await bus.close()

    asyncio.run(life())
    assert list(tmp_path.iterdir()) == []


def test_a_link_never_replaces_a_file(tmp_path: Path) -> None:
    place = tmp_path / "wrist"
    place.write_text("mine")

    async def life() -> None:
        with pytest.raises(FileExistsError, match="is no symbolic link"):
            cell().open_pty(place)

    asyncio.run(life())
    assert place.read_text() == "mine"


def test_a_link_that_another_has_taken_over_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "wrist"

    async def life() -> None:
        bus = cell()
        bus.open_pty(link)
        link.unlink()
        link.symlink_to("/dev/null")
        await bus.close()

    asyncio.run(life())
    assert os.readlink(link) == "/dev/null"


def test_bytes_for_a_client_that_does_not_read_are_bounded_and_kept_in_order() -> None:
    async def flood() -> tuple[int, bytes]:
        terminal = PseudoTerminal()
        client = _open(terminal.path, termios.B1000000)
        count = 3 * UNREAD_BYTES // 4
        for i in range(count):
            terminal.write(i.to_bytes(4, "little"))
        got = await _receive(client, 4 * count)
        terminal.close()
        os.close(client)
        return count, got

    count, got = asyncio.run(flood())
    assert UNREAD_BYTES <= len(got) < 4 * count
    numbers = [int.from_bytes(got[i : i + 4], "little") for i in range(0, len(got) - 3, 4)]
    assert numbers[:1000] == list(range(1000))


def test_the_pseudo_terminal_survives_a_flood_of_noise() -> None:
    async def flood() -> bytes:
        bus = cell(pacing=False)
        client = _open(bus.open_pty(), termios.B1000000)
        rng = random.Random(3)
        for _ in range(200):
            with contextlib.suppress(BlockingIOError):  # the kernel may lag behind
                os.write(client, rng.randbytes(rng.randrange(1, 200)))
            await asyncio.sleep(0)
        termios.tcflush(client, termios.TCIFLUSH)
        pong = b""
        for _ in range(20):  # noise may still be on its way when the first one is sent
            with contextlib.suppress(BlockingIOError):
                os.write(client, PING_1)
            pong = await _receive(client, 14)
            if pong:
                break
        os.close(client)
        await bus.close()
        return pong

    assert asyncio.run(flood())[:5] == PING_1[:5]
