"""Device 200 by its instructions: what it answers, refuses and keeps to itself."""

from __future__ import annotations

import pytest

from sphmctl.wire import board_table as table
from sphmctl.wire import dxl
from tests.firmware.rig import (
    ACTION,
    BOARD,
    OK,
    PING,
    READ,
    REBOOT,
    REG_WRITE,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Rig,
    instruction,
    status_of,
    statuses_of,
)
from tests.wire import dxl_reference

MODEL_AND_FIRMWARE = table.BOARD_MODEL.to_bytes(2, "little") + bytes([table.BOARD_FIRMWARE])


def refusal(error: int, alert: bool = False) -> dxl.Status:
    return dxl.Status(BOARD, error, alert, b"")


def read(rig: Rig, address: int, size: int) -> dxl.Status:
    parameters = address.to_bytes(2, "little") + size.to_bytes(2, "little")
    return status_of(rig.send(instruction(BOARD, READ, parameters), 2000))


def test_a_ping_is_answered_and_goes_no_further(rig: Rig) -> None:
    seen = rig.send(bytes.fromhex("FF FF FD 00 C8 03 00 01 3B FA"))
    assert status_of(seen) == dxl.Status(BOARD, 0, False, MODEL_AND_FIRMWARE)
    assert seen.bus == b""


def test_a_read_gives_the_bytes_of_the_table(rig: Rig) -> None:
    first = read(rig, 0, 10).data
    assert first == (
        MODEL_AND_FIRMWARE[:2] + b"\0\0\0\0" + bytes([table.BOARD_FIRMWARE, BOARD, 3, 0])
    )
    assert len(read(rig, 116, 67).data) == 67


@pytest.mark.parametrize("address", [10, 12, 60, 65, 200, 250, 300, 65535])
def test_a_read_outside_the_table_is_an_access_error_without_data(rig: Rig, address: int) -> None:
    assert read(rig, address, 1) == refusal(7)


def test_a_read_across_a_gap_is_an_access_error(rig: Rig) -> None:
    assert read(rig, 8, 6) == refusal(7)
    assert read(rig, 196, 5) == refusal(7)


@pytest.mark.parametrize(
    "parameters", [b"", b"\x40", b"\x40\0\x01", b"\x40\0\0\0", b"\x40\0\1\0\0"]
)
def test_a_read_without_address_or_length_is_a_length_error(rig: Rig, parameters: bytes) -> None:
    assert status_of(rig.send(instruction(BOARD, READ, parameters))) == refusal(5)


def test_a_write_is_kept_and_read_back(rig: Rig) -> None:
    assert rig.write(9, 100) == OK
    assert read(rig, 9, 1).data == b"\x64"


@pytest.mark.parametrize("address", [0, 6, 7, 8, 69, 120, 122, 162, 188, 11, 201, 400])
def test_a_write_to_what_is_not_writable_is_an_access_error(rig: Rig, address: int) -> None:
    assert rig.write(address, 0) == refusal(7)


@pytest.mark.parametrize(("address", "value"), [(9, 255), (64, 2), (68, 3), (70, 1), (116, 2)])
def test_a_value_outside_its_range_is_a_range_error(free: Rig, address: int, value: int) -> None:
    assert free.write(address, value) == refusal(4)


def test_a_write_shorter_than_its_item_is_a_length_error(rig: Rig) -> None:
    assert rig.write(184, 0, size=1) == refusal(5)
    assert status_of(rig.send(instruction(BOARD, WRITE, b"\x40\0"))) == refusal(5)
    assert rig.write(184, 0, size=2) == OK


def test_a_write_beyond_its_item_is_an_access_error_and_changes_nothing(rig: Rig) -> None:
    assert rig.write(9, 5, size=2) == refusal(7)
    assert rig.table(9) == 0


@pytest.mark.parametrize("code", [0x06, 0x10, 0x20, 0x33, 0x82, 0x83, 0x8A, 0x92, 0xFF])
def test_an_instruction_that_it_does_not_know_is_an_instruction_error(rig: Rig, code: int) -> None:
    assert status_of(rig.send(instruction(BOARD, code, b"\1"))) == refusal(2)


def test_a_damaged_frame_is_a_crc_error_and_not_obeyed(free: Rig) -> None:
    frame = bytearray(instruction(BOARD, WRITE, b"\x40\0\1"))
    frame[-1] ^= 0x40
    assert status_of(free.send(bytes(frame))) == refusal(3)
    assert (free.table(64), free.table(162, 2)) == (0, 1)


def test_a_registered_write_waits_for_its_action(rig: Rig) -> None:
    assert status_of(rig.send(instruction(BOARD, REG_WRITE, b"\x09\0\x07"))) == OK
    assert (rig.table(9), rig.table(69)) == (0, 1)
    assert status_of(rig.send(instruction(BOARD, ACTION))) == OK
    assert (rig.table(9), rig.table(69)) == (7, 0)
    assert status_of(rig.send(instruction(BOARD, ACTION))) == refusal(2)


def test_a_registered_write_is_checked_at_once(rig: Rig) -> None:
    assert status_of(rig.send(instruction(BOARD, REG_WRITE, b"\x09\0\xff"))) == refusal(4)
    assert rig.table(69) == 0


@pytest.mark.parametrize(("level", "answered"), [(0, [PING]), (1, [PING, READ]), (2, [1, 2, 3])])
def test_the_status_return_level_says_what_is_answered(
    rig: Rig, level: int, answered: list[int]
) -> None:
    rig.write(68, level)
    parameters = {PING: b"", READ: b"\x40\0\1\0", WRITE: b"\x09\0\0"}
    for code, data in parameters.items():
        seen = rig.send(instruction(BOARD, code, data))
        assert bool(seen.host) == (code in answered)
    damaged = instruction(BOARD, PING)[:-1] + b"\0"
    assert bool(rig.send(damaged).host) == (level == 2)


def test_the_return_delay_is_kept(rig: Rig) -> None:
    frame = instruction(BOARD, PING)
    at_once = rig.send(frame)
    waited = {}
    for delay in (50, 250):
        rig.write(9, delay)
        sent_at = rig.now_us + 10 * len(frame)
        waited[delay] = rig.send(frame).host_at[0] - sent_at
    assert at_once.host
    assert 100 <= waited[50] <= 250
    assert 500 <= waited[250] <= 650


@pytest.mark.parametrize("data", ["fffffd00", "00fffffd", "fffffdfffffd", "fffffdfd", "fffffffd"])
def test_a_status_is_stuffed(rig: Rig, data: str) -> None:
    plain = bytes.fromhex(data)
    rig.tell(f"poke 164 {data}")
    parameters = b"\xa4\0" + len(plain).to_bytes(2, "little")
    seen = rig.send(instruction(BOARD, READ, parameters))
    assert bytes(seen.host) == dxl_reference.status(BOARD, plain)


def test_a_reboot_is_answered_and_then_carried_out(free: Rig) -> None:
    free.write(9, 3)
    seen = free.send(instruction(BOARD, REBOOT))
    assert status_of(seen) == OK
    (reset_at,) = seen.resets
    assert reset_at > seen.host_at[-1] + 20
    assert (free.table(9), free.table(98)) == (0, 255)


def test_a_sync_read_of_the_board_alone_is_answered_and_stays_off_the_bus(rig: Rig) -> None:
    seen = rig.send(instruction(254, SYNC_READ, b"\x08\0\1\0\xc8"))
    assert status_of(seen) == dxl.Status(BOARD, 0, False, b"\3")
    assert seen.bus == b""


def test_in_a_sync_read_with_servos_the_place_of_the_board_stays_silent(rig: Rig) -> None:
    frame = instruction(254, SYNC_READ, b"\x08\0\1\0\x01\xc8")
    seen = rig.send(frame, 4000)
    assert (bytes(seen.bus), bytes(seen.host)) == (frame, b"")


@pytest.mark.parametrize("ids", [(BOARD,), (1, BOARD), (BOARD, 1), (1, 2, BOARD, 3)])
def test_a_sync_write_that_lists_the_board_is_obeyed_without_an_answer(
    rig: Rig, ids: tuple[int, ...]
) -> None:
    listed = b"".join(bytes([device_id, 20 + device_id % 100]) for device_id in ids)
    frame = instruction(254, SYNC_WRITE, b"\x09\0\1\0" + listed)
    seen = rig.send(frame)
    assert (bytes(seen.bus), bytes(seen.host)) == (frame, b"")
    assert rig.table(9) == 20 + BOARD % 100


def test_a_sync_write_whose_data_hold_200_does_not_concern_the_board(rig: Rig) -> None:
    rig.send(instruction(254, SYNC_WRITE, b"\x09\0\1\0\1\xc8\2\xc8"))
    assert rig.table(9) == 0


def test_a_stuffed_sync_write_is_understood(rig: Rig) -> None:
    listed = b"\1\xff\xff\xfd\0" + b"\xc8\0\0\0\0"
    frame = instruction(254, SYNC_WRITE, b"\xb8\0\4\0" + listed)
    assert b"\xff\xff\xfd\xfd" in frame
    assert bytes(rig.send(frame).bus) == frame


def test_broadcast_write_register_action_and_reboot_concern_the_board_too(rig: Rig) -> None:
    for code, data in ((WRITE, b"\x09\0\5"), (REG_WRITE, b"\x09\0\6"), (REBOOT, b"")):
        frame = instruction(254, code, data)
        seen = rig.send(frame)
        assert (bytes(seen.bus), bytes(seen.host)) == (frame, b"")
        if code == WRITE:
            assert rig.table(9) == 5
        elif code == REG_WRITE:
            rig.write(98, 0)
            rig.send(instruction(254, ACTION))
            assert rig.table(9) == 6
    assert len(seen.resets) == 1


def test_a_broadcast_read_is_not_carried_out(rig: Rig) -> None:
    assert rig.send(instruction(254, READ, b"\0\0\2\0")).host == b""


def test_frames_without_a_gap_are_all_answered_in_order(rig: Rig) -> None:
    frames = [instruction(BOARD, PING), instruction(BOARD, READ, b"\x07\0\1\0")] * 5
    found = statuses_of(rig.send(b"".join(frames), 4000))
    assert [status.data for status in found] == [MODEL_AND_FIRMWARE, b"\xc8"] * 5
