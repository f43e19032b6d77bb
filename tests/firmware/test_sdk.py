"""dynamixel-sdk, unchanged, in a process of its own, at the pseudo-terminal of a simulated board.

Between the SDK and three emulated servos is the compiled firmware. In real time: a try of the SDK
is over after 34 ms.
"""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest

from sphmctl import clock
from sphmctl.emulators.board import Board, Options
from sphmctl.emulators.board_bus import BoardBus
from sphmctl.emulators.lines import STOP_PIN
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.wire import board_table as table
from tests.emulators.sdk_rig import MOVE_AND_READ, answers_of

pytestmark = pytest.mark.realtime

IDS = (1, 2, 3)

CLIENT = rf"""
out["ping"] = [settle(lambda i=i: dxl.ping(port, i)) for i in (200, 1, 2, 3)]
out["missing"] = dxl.ping(port, 4)[1]
for _ in range(TRIES):
    found, result = dxl.broadcastPing(port)
    if result == 0 and len(found) == 4:
        break
out["everybody"] = sorted(found.items())
out["model"] = settle(lambda: dxl.read2ByteTxRx(port, 200, 0))
out["protocol"] = settle(lambda: dxl.read2ByteTxRx(port, 200, 14))
out["clock"] = [settle(lambda: dxl.read4ByteTxRx(port, 200, 124)) for _ in range(2)]
out["state"] = settle(lambda: dxl.readTxRx(port, 200, 116, 84))
out["refused"] = settle(lambda: dxl.write4ByteTxRx(port, 1, 116, 2100))
out["free"] = settle(lambda: dxl.write1ByteTxRx(port, 200, 98, 0))
out["locked"] = settle(lambda: dxl.write2ByteTxRx(port, 200, 0, 1))
out["torque"] = [settle(lambda i=i: dxl.write1ByteTxRx(port, i, 64, 1)) for i in (1, 2, 3)]
{MOVE_AND_READ}
out["errors"] = settle(lambda: dxl.readTxRx(port, 200, 162, 12))
"""


async def _talk(firmware: Path) -> dict[str, Any]:
    board = Board(Options(firmware), "paced")
    try:
        board.drive(STOP_PIN, False)
        world = World(asyncio.get_running_loop().time)
        rng = random.Random(1)
        servos = [Servo(rng, servo_id) for servo_id in IDS]
        for servo in servos:
            world.add(servo)
        BoardBus(board, servos, world.advance)
        answers = await answers_of(CLIENT, board.port)
        answers["stats"] = board.stats()
        answers["faults"] = [fault.kind for fault in board.faults]
        return answers
    finally:
        board.close()


@pytest.fixture(scope="module")
def answers(built: Path) -> dict[str, Any]:
    """What the SDK got through the board."""
    return clock.run(_talk(built))


def test_the_sdk_finds_board_and_servos_by_ping(answers: dict[str, Any]) -> None:
    assert answers["ping"] == [[table.BOARD_MODEL, 0, 0]] + [[1060, 0, 0]] * 3
    assert answers["missing"] == -3001


def test_the_sdk_finds_all_four_by_one_broadcast_ping(answers: dict[str, Any]) -> None:
    servos = [[servo_id, [1060, 46]] for servo_id in IDS]
    assert answers["everybody"] == [*servos, [200, [table.BOARD_MODEL, table.BOARD_FIRMWARE]]]


def test_the_sdk_reads_the_board(answers: dict[str, Any]) -> None:
    assert answers["model"] == [table.BOARD_MODEL, 0, 0]
    assert answers["protocol"] == [table.BOARD_PROTOCOL, 0, 0]
    (first, *_), (second, *_) = answers["clock"]
    assert 0 < second - first < 10_000_000
    data, result, error = answers["state"]
    assert (len(data), result, error) == (84, 0, 0)


def test_the_sdk_sees_the_safe_state_and_leaves_it(answers: dict[str, Any]) -> None:
    assert answers["refused"] == [0, 4]
    assert answers["free"] == [0, 0]
    assert answers["locked"] == [0, 7]


def test_the_sdk_moves_and_reads_the_servos_through_the_board(answers: dict[str, Any]) -> None:
    assert answers["torque"] == [[0, 0]] * 3
    assert answers["sync_write"] == 0
    for way in ("txRxPacket", "fastSyncRead"):
        result, positions = answers[way]
        assert result == 0
        # Each shaft stops within its dead band, one count off the goal at most.
        assert positions == pytest.approx([2101, 2102, 2103], abs=1)


def test_nothing_was_lost_on_the_way(answers: dict[str, Any]) -> None:
    assert answers["errors"] == [[0] * 12, 0, 0]
    assert answers["faults"] == []
    assert answers["stats"]["dropped0"] == 0
