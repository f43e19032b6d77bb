"""Checking: the verdict on what a board tells, and the silence before it is asked."""

from __future__ import annotations

import asyncio
import random
import struct
from pathlib import Path

import pytest

from sphmctl import clock
from sphmctl.board import check
from sphmctl.board.check import Report
from sphmctl.board.image import Image
from sphmctl.drivers.board import Identity
from sphmctl.drivers.link import Link, memory_pair
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.wire import board_table
from tests.drivers.far_end import FarEnd
from tests.emulators.servo_rig import crc

SHIPPED = Image(Path("board.hex"), "", 1, 1, 0xA1B2C3D4, 3, 0x1234)


def status(data: bytes) -> bytes:
    """A status of id 200."""
    head = b"\xff\xff\xfd\x00\xc8" + struct.pack("<HBB", len(data) + 4, 0x55, 0)
    return head + data + crc(head + data)


@pytest.mark.parametrize(
    ("version", "build_hash", "protocol", "state", "words"),
    [
        (3, 0xA1B2C3D4, 0x1234, "match", "runs what this sphmctl ships"),
        (2, 0xA1B2C3D4, 0x1234, "older", "version 2"),
        (4, 0x00000001, 0x9999, "newer", "update sphmctl"),
        (3, 0x00000001, 0x1234, "foreign", "build 00000001, not what"),
        (3, 0xA1B2C3D4, 0x1235, "foreign", "flash it"),
        (3, 0x00000000, 0x1234, "foreign", "Arduino IDE"),
    ],
)
def test_version_hash_and_protocol_make_the_verdict(
    version: int, build_hash: int, protocol: int, state: str, words: str
) -> None:
    told, why = check.verdict(Identity(60200, version, build_hash, protocol), SHIPPED)
    assert told == state
    assert words in why


def examine(servo: Servo | None) -> Report:
    """A check of a bus with that servo."""

    async def look() -> Report:
        world = World(asyncio.get_running_loop().time)
        bus = ServoBus(world, [servo] if servo else [], random.Random(1), usb="none")

        async def opener() -> Link:
            here, there = memory_pair()
            bus.attach(there)
            return here

        return await check.check(opener, "PORT", SHIPPED)

    return clock.run(look(), virtual=True)


def test_nobody_under_the_board_s_id_is_silent() -> None:
    report = examine(None)
    assert report.state == "silent"
    assert "sphmctl firmware flash --port PORT" in report.detail
    assert report.version is None


def test_a_servo_under_the_board_s_id_is_foreign() -> None:
    report = examine(Servo(random.Random(1), servo_id=200))
    assert (report.state, report.model) == ("foreign", 1060)


def board_answers() -> dict[int | tuple[int, ...], bytes]:
    """A board's status to a ping (1), and to a read by address and length."""
    return {
        # Ping: model 60200, firmware 3.
        0x01: status(bytes.fromhex("28eb03")),
        (0, 7): status(bytes.fromhex("28ebd4c3b2a103")),
        (14, 2): status(struct.pack("<H", board_table.BOARD_PROTOCOL)),
        # From OUTPUTS on; HOST_CRC_ERRORS stands at 162, UPTIME at 196.
        (116, 84): status(bytes(46) + bytes((5, 1)) + bytes(32) + struct.pack("<I", 70_000)),
    }


def asked(piece: bytes) -> int | tuple[int, ...]:
    """Which of the answers an instruction wants."""
    return 0x01 if piece[7] == 0x01 else struct.unpack_from("<HH", piece, 8)


def test_nothing_is_sent_for_two_seconds_after_opening_then_all_is_read() -> None:
    answers = board_answers()

    def answer(far: FarEnd, piece: bytes) -> None:
        far.send(answers[asked(piece)])

    async def look() -> tuple[Report, float]:
        began_s = asyncio.get_running_loop().time()
        report = await check.check(far.open, "PORT", SHIPPED)
        return report, far.pieces[0][0] - began_s

    far = FarEnd(answer)
    report, silence_s = clock.run(look(), virtual=True)
    assert silence_s >= 2.0
    assert far.lost
    assert (report.version, report.build_hash, report.state) == (3, "a1b2c3d4", "foreign")
    assert report.counters["host_crc_errors"] == 0x0105
    assert report.counters["uptime_s"] == 70_000
    assert report.counters["longest_pass_us"] == 0


@pytest.mark.parametrize(("stall_s", "state"), [(4.0, "foreign"), (6.0, "silent")])
def test_a_board_that_was_kept_in_its_bootloader_is_asked_again_after_a_silence(
    stall_s: float, state: str
) -> None:
    answers = board_answers()
    far = FarEnd()

    async def look() -> Report:
        loop = asyncio.get_running_loop()
        began_s = loop.time()

        def answer(far: FarEnd, piece: bytes) -> None:
            if loop.time() - began_s > stall_s:
                far.send(answers[asked(piece)])

        far.answer = answer
        report = await check.check(far.open, "PORT", SHIPPED)
        assert loop.time() - began_s < 6.0
        return report

    assert clock.run(look(), virtual=True).state == state


def test_a_flash_that_differs_overrules_what_the_board_says() -> None:
    report = Report("match", "", 3, "a1b2c3d4", "1234", 60200, {"resets": 1})
    refused = check.with_flash(report, False, "PORT")
    assert refused.state == "foreign"
    assert refused.detail.endswith("flash it: sphmctl firmware flash --port PORT")
    assert refused.counters == report.counters
    assert check.with_flash(report, True, "PORT") is report
    older = Report("older", "")
    assert check.with_flash(older, False, "PORT") is older


def test_a_silent_board_with_the_right_flash_need_not_be_flashed() -> None:
    report = check.with_flash(Report("silent", "flash it"), True, "PORT")
    assert report.state == "silent"
    assert "unplug the board" in report.detail
    assert "flash it" not in report.detail
