"""The board's driver against the shipped firmware, simulated on virtual time."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from dynamixel_sdk import Protocol2PacketHandler

from sphmctl import clock
from sphmctl.board import image
from sphmctl.drivers import board as driver
from sphmctl.drivers import servo_bus
from sphmctl.drivers.board import Board
from sphmctl.drivers.servo_bus import BOARD_SILENCE_S, ServoBus
from sphmctl.emulators.board import Board as Hardware
from sphmctl.emulators.board import Options
from sphmctl.emulators.board_host import BoardHost
from sphmctl.errors import DeviceError
from sphmctl.wire import board_table as table
from sphmctl.wire import dxl_instructions
from tests.avrsim.rig import BOOTLOADER
from tests.drivers.far_end import FarEnd
from tests.system.rig import Rig, Wire

WATCHDOG_S = 0.020 * driver.WATCHDOG_UNITS


def with_board(test: Callable[[Rig, Board], Awaitable[None]]) -> None:
    """Run a test on a cell with a simulated board whose port is open."""

    async def main() -> None:
        rig = Rig(board="simulated")
        board = rig.wrist.board
        assert board is not None
        await rig.wrist.connect()
        try:
            await test(rig, board)
        finally:
            await rig.close()

    clock.run(main(), virtual=True)


def wrist_ok(rig: Rig) -> bool:
    """The line at the controller."""
    lines = rig.emulated.controller.lines
    assert lines is not None
    return lines.wrist_ok


def test_nothing_is_sent_for_two_seconds_after_the_port_was_opened() -> None:
    async def main() -> None:
        rig = Rig(board="simulated")
        opened_s = rig.loop.time()
        await rig.wrist.connect()
        await rig.wrist.verify()
        assert rig.bus.frames[0][0] - opened_s >= BOARD_SILENCE_S >= 2.0
        await rig.close()

    clock.run(main(), virtual=True)


def test_the_shipped_firmware_is_the_one_this_version_speaks_to() -> None:
    async def test(rig: Rig, board: Board) -> None:
        identity = await board.identity()
        assert (identity.model, identity.protocol) == (table.BOARD_MODEL, table.BOARD_PROTOCOL)
        assert identity.build_hash != 0
        findings = await rig.wrist.examine()
        assert [f.name for f in findings if not f.ok] == []
        assert findings[0].name == "board 200, firmware"
        assert any(f.name.startswith("servo 3") for f in findings)

    with_board(test)


def test_another_protocol_version_is_refused_with_the_command_that_mends_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(table, "BOARD_PROTOCOL", 0x1234)

    async def main() -> str:
        rig = Rig(board="simulated")
        bus = ServoBus(rig.bus.open, "wrist", 1_000_000, board_id=200)
        findings = []
        try:
            await bus.connect()
            findings = await Board(bus, 200, "/dev/ttyACM0", "wrist").examine()
        finally:
            await bus.close()
            await rig.close()
        return "; ".join(f.remedy for f in findings if not f.ok)

    told = clock.run(main(), virtual=True)
    assert told == ("this version speaks 0x1234: sphmctl firmware flash --port /dev/ttyACM0")


def _findings_of(answer: Callable[[FarEnd, bytes], None] | None) -> str:
    """What is told about a port where `answer` speaks."""

    async def main() -> str:
        bus = ServoBus(FarEnd(answer).open, "wrist", 1_000_000, board_id=200)
        await bus.connect()
        (finding,) = await Board(bus, 200, "P", "wrist").examine()
        await bus.close()
        assert not finding.ok
        return f"{finding.name}: {finding.detail}; {finding.remedy}"

    return clock.run(main(), virtual=True)


def test_a_port_without_a_board_is_told() -> None:
    told = _findings_of(None)
    assert told.startswith("board 200: does not answer; check port")
    assert told.endswith("sphmctl firmware flash --port P")


def test_a_servo_with_the_boards_id_is_no_board() -> None:
    # Ping of id 200, answered as by an XL430 (model 1060, firmware 45); CRC by dynamixel-sdk.
    status = bytes.fromhex("FF FF FD 00 C8 07 00 55 00 24 04 2D")

    def answer(far: FarEnd, request: bytes) -> None:
        crc = Protocol2PacketHandler().updateCRC(0, list(status), len(status))
        far.send(status + crc.to_bytes(2, "little"), 0.001)

    told = _findings_of(answer)
    assert told.startswith("board 200, model number: 1060; the board's is 60200")


def test_wrist_ok_is_on_only_while_armed_and_asked_for() -> None:
    async def test(rig: Rig, board: Board) -> None:
        with pytest.raises(DeviceError, match=r"wrist ok was refused: .*not armed.*safe state"):
            await board.permit()
        await board.arm()
        assert not wrist_ok(rig)
        await board.permit()
        assert wrist_ok(rig)
        assert (await board.state()).trouble() is None
        await board.disarm()
        assert not wrist_ok(rig)

    with_board(test)


def test_a_silent_host_loses_wrist_ok_and_can_arm_again() -> None:
    async def test(rig: Rig, board: Board) -> None:
        await board.arm()
        await board.permit()
        heard_s = rig.loop.time()
        await rig.until(lambda: not wrist_ok(rig), 1.0)
        assert WATCHDOG_S - 0.006 < rig.loop.time() - heard_s < WATCHDOG_S + 0.003
        state = await board.state()
        trouble = state.trouble()
        assert trouble is not None
        assert "heard nothing for 500 ms" in trouble
        assert state.counters["watchdog_trips"] == 1
        await board.arm()
        await board.permit()
        assert wrist_ok(rig)

    with_board(test)


def test_a_pressed_stop_is_latched_until_the_board_is_armed_anew() -> None:
    async def test(rig: Rig, board: Board) -> None:
        await board.arm()
        await board.permit()
        assert rig.emulated.wiring is not None
        rig.emulated.wiring.press_stop()
        await asyncio.sleep(0.005)
        assert not wrist_ok(rig)
        assert (await board.state()).trouble() == "the emergency stop at the board was pressed"
        with pytest.raises(DeviceError, match="emergency stop at the board is pressed; release it"):
            await board.arm()
        rig.emulated.wiring.press_stop(False)
        await asyncio.sleep(0.005)
        state = await board.state()
        assert not state.stop_pressed
        assert state.trouble() == "the emergency stop at the board was pressed"
        await board.arm()
        await board.permit()
        assert wrist_ok(rig)

    with_board(test)


def test_edge_times_are_within_the_clocks_window_of_the_truth() -> None:
    async def test(rig: Rig, board: Board) -> None:
        hardware = rig.emulated.board
        assert hardware is not None
        for _ in range(20):
            assert await board.look() is not None
            await asyncio.sleep(0.0137)
        true_s = []
        for number in range(1, 6):
            true_s.append(rig.loop.time() + 0.003)
            hardware.drive("L0", number % 2 == 0, true_s[-1])
            await asyncio.sleep(0.02)
        state = await board.state()
        assert state.knot_edges == 5
        found_s = board.knots_s(state, 5)
        assert len(found_s) == driver.STAMPS
        # Behind an ATmega16U2 a reply waits for up to 4.1 ms; replies at many phases prove more.
        assert board.clock_window_s < 0.004
        for at_s, edge_s in zip(found_s, true_s[1:], strict=True):
            assert abs(at_s - edge_s) < board.clock_window_s / 2 + 50e-6

    with_board(test)


def test_a_cycle_with_the_board_fits_into_ten_milliseconds() -> None:
    async def test(rig: Rig, board: Board) -> None:
        await rig.wrist.arm(1.0)
        cranks = await rig.wrist.read_cranks()
        took, asked = [], 0
        question = dxl_instructions.read(200, table.OUTPUTS.address, driver.STATE_BYTES)
        for _ in range(100):
            begin_s = rig.loop.time()
            state = await rig.wrist.exchange(cranks)
            took.append(rig.loop.time() - begin_s)
            assert None not in state.servos
            await asyncio.sleep(max(0.0, begin_s + 0.010 - rig.loop.time()))
        asked = sum(frame == question for _, frame in rig.bus.frames)
        assert 20 <= asked <= 24
        assert max(took) < 0.0105
        assert sum(t > 0.010 for t in took) <= 2
        state = await rig.wrist.exchange(cranks)
        assert state.board is not None
        assert set(state.board.errors.values()) == {0}
        assert await rig.wrist.disarm() == []

    with_board(test)


async def _reconnect(firmware: Path, duration_s: float) -> list[bool]:
    """Open the port, ask, close, again and again; whether the board answered each time."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, clock.VirtualLoop)
    hardware = Hardware(Options(firmware, bootloader=BOOTLOADER))
    loop.accompany(hardware.ahead)
    wire = Wire(BoardHost(hardware, random.Random(1)).attach)
    end_s, answered = loop.time() + duration_s, []
    while loop.time() < end_s:
        bus = ServoBus(wire.open, "wrist", 1_000_000, board_id=200)
        await bus.connect()
        answered.append(await bus.ping(200) is not None)
        await bus.close()
    loop.accompany(None)
    hardware.close()
    return answered


def test_reconnecting_for_a_minute_does_not_keep_the_board_in_its_bootloader() -> None:
    answered = clock.run(_reconnect(image.load().hex, 60.0), virtual=True)
    assert len(answered) > 25
    assert all(answered)


def test_without_the_silence_the_bootloader_would_keep_the_board(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(servo_bus, "BOARD_SILENCE_S", 0.3)
    assert not any(clock.run(_reconnect(image.load().hex, 8.0), virtual=True))
