"""Which way each frame goes, and that two answers never meet."""

from __future__ import annotations

import random

import pytest

from sphmctl.wire import dxl
from tests.firmware.rig import (
    ACTION,
    BOARD,
    BULK_WRITE,
    PING,
    READ,
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
from tests.wire.chunks import load

INSTRUCTIONS = [
    entry["hex"] for entry in load("dxl_frames.toml")["instruction"] if entry["hex"][4] != BOARD
]
READ_1 = bytes.fromhex("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15")
REPLY_1 = bytes.fromhex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0")
GOAL = b"\x74\0\0\2\0\0"
BUS_CRC_ERRORS, BUS_TORN, BUS_OVERRUNS, BUS_TIMEOUTS, REFUSED = 168, 170, 172, 174, 178
HOST_TORN, HOST_OVERRUNS = 164, 166


@pytest.mark.parametrize("frame", INSTRUCTIONS)
def test_a_golden_instruction_goes_to_the_bus_unchanged(free: Rig, frame: bytes) -> None:
    seen = free.send(frame, 8000)
    assert bytes(seen.bus) == frame
    assert seen.faults == []
    assert [level for _, level in seen.driving] == [1, 0]


def test_a_frame_begins_on_the_bus_within_15_us_of_its_end(free: Rig) -> None:
    for size in (1, 4, 60):
        frame = instruction(1, WRITE, b"\x74\0" + bytes(size))
        end_us = free.now_us + 10 * len(frame)
        seen = free.send(frame, 3000)
        assert 0 <= seen.bus_at[0] - end_us <= 15


def test_the_pin_is_released_within_5_us_of_the_last_stop_bit_and_not_before(free: Rig) -> None:
    seen = free.send(READ_1)
    # A byte is written into a free transmitter and the last one needs 10 us after its begin.
    release_us = seen.driving[1][0]
    last_us = seen.driving[0][0] + 10 * len(READ_1)
    assert seen.faults == []
    assert 0 <= release_us - last_us <= 5


def test_nothing_of_a_frame_goes_to_the_bus_before_its_crc_is_right(free: Rig) -> None:
    assert free.send(READ_1[:-1]).bus == b""
    free.run(6000)
    damaged = bytearray(READ_1)
    damaged[9] ^= 1
    assert free.send(bytes(damaged)).bus == b""
    assert (free.table(162, 2), free.table(HOST_TORN, 2)) == (1, 1)
    assert bytes(free.send(READ_1).bus) == READ_1


def test_a_cut_frame_is_given_up_after_a_pause_and_the_next_one_passes(free: Rig) -> None:
    free.send(READ_1[:9])
    free.run(5500)
    assert bytes(free.send(READ_1).bus) == READ_1
    assert free.table(HOST_TORN, 2) == 1


def test_a_frame_with_a_pause_that_usb_may_make_passes(free: Rig) -> None:
    free.tell(f"host {READ_1[:9].hex()}")
    free.run(4000)
    assert bytes(free.send(READ_1[9:]).bus) == READ_1
    assert free.table(HOST_TORN, 2) == 0


def test_a_status_goes_to_the_host_byte_by_byte(free: Rig) -> None:
    free.reply(REPLY_1)
    seen = free.send(READ_1)
    assert bytes(seen.host) == REPLY_1
    released_us = seen.driving[1][0]
    complete = [released_us + 50 + 10 * (at + 1) for at in range(len(REPLY_1))]
    late = [at - came for at, came in zip(seen.host_at, complete, strict=True)]
    assert max(late) <= 5
    assert free.table(BUS_TIMEOUTS, 2) == 0


@pytest.mark.parametrize("cut", range(len(REPLY_1)))
def test_a_status_cut_anywhere_still_goes_up_and_the_bus_is_free_again(free: Rig, cut: int) -> None:
    free.reply(REPLY_1[:cut])
    assert bytes(free.send(READ_1, 5000).host) == REPLY_1[:cut]
    assert free.table(BUS_TIMEOUTS, 2) == 1
    assert free.table(BUS_TORN, 2) == (1 if cut > 4 else 0)
    free.reply(REPLY_1)
    assert bytes(free.send(READ_1).host) == REPLY_1


def test_a_damaged_status_goes_up_and_is_counted(free: Rig) -> None:
    damaged = REPLY_1[:-1] + b"\0"
    free.reply(damaged)
    assert bytes(free.send(READ_1, 4000).host) == damaged
    assert free.table(BUS_CRC_ERRORS, 2) == 1


def test_the_next_frame_waits_for_the_status_of_the_one_before(free: Rig) -> None:
    second = instruction(2, READ, b"\x84\0\4\0")
    reply_2 = dxl_reference.status(2, b"abcd")
    free.reply(REPLY_1, delay_us=500)
    free.reply(reply_2, delay_us=500)
    seen = free.send(READ_1 + second, 3000)
    assert bytes(seen.bus) == READ_1 + second
    assert bytes(seen.host) == REPLY_1 + reply_2
    assert seen.bus_at[len(READ_1)] > seen.host_at[len(REPLY_1) - 1]


def test_all_statuses_of_a_sync_read_are_waited_for(free: Rig) -> None:
    frame = instruction(254, SYNC_READ, b"\x84\0\4\0\1\2\3")
    replies = b"".join(dxl_reference.status(i, bytes(4)) for i in (1, 2, 3))
    free.reply(replies, delay_us=400)
    seen = free.send(frame + instruction(BOARD, PING), 3000)
    assert [status.device_id for status in statuses_of(seen)] == [1, 2, 3, BOARD]
    assert free.table(BUS_TIMEOUTS, 2) == 0


def test_a_silent_servo_does_not_hold_up_the_bus_for_more_than_some_ms(free: Rig) -> None:
    second = instruction(2, PING)
    seen = free.send(READ_1 + second, 5000)
    assert bytes(seen.bus) == READ_1 + second
    assert 2500 <= seen.bus_at[len(READ_1)] - seen.bus_at[len(READ_1) - 1] <= 3500


def test_a_sync_write_owes_no_status_and_the_next_frame_follows_at_once(free: Rig) -> None:
    frame = instruction(254, SYNC_WRITE, b"\x74\0\4\0\1" + bytes(4))
    seen = free.send(frame + READ_1, 1000)
    assert bytes(seen.bus) == frame + READ_1
    # 10 us for the last byte itself; then the pin falls and rises.
    assert seen.bus_at[len(frame)] - seen.bus_at[len(frame) - 1] <= 40


def test_a_broadcast_ping_is_answered_by_the_board_after_the_servos(free: Rig) -> None:
    frame = instruction(254, PING)
    replies = b"".join(dxl_reference.status(i, b"\x24\4\x2d") for i in (1, 2, 3))
    free.reply(replies, delay_us=500)
    seen = free.send(frame, 8000)
    assert [status.device_id for status in statuses_of(seen)] == [1, 2, 3, BOARD]
    assert seen.host_at[-14] - seen.host_at[-15] > 4000
    assert free.table(BUS_TIMEOUTS, 2) == 0


def test_a_status_that_comes_late_is_not_cut_by_one_of_the_board(free: Rig) -> None:
    for delay_us in range(2850, 3400, 10):
        free.reply(REPLY_1, delay_us)
        seen = free.send(READ_1 + instruction(BOARD, READ, b"\x74\0\x43\0"), 8000)
        assert sorted(status.device_id for status in statuses_of(seen)) == [1, BOARD]


def test_long_streams_pass_both_ways(free: Rig) -> None:
    down = b"".join(
        instruction(254, SYNC_WRITE, b"\x74\0\4\0" + bytes([i] * 183)) for i in range(5)
    )
    assert bytes(free.send(down, 12_000).bus) == down
    up = b"".join(dxl_reference.status(i, bytes([i] * 189)) for i in range(5))
    assert bytes(free.hear(up).host) == up
    counters = [free.table(a, 2) for a in (162, 164, 166, 168, 170, 172)]
    assert counters == [0] * 6


def test_both_sides_may_send_at_once(free: Rig) -> None:
    down = instruction(254, SYNC_WRITE, b"\x74\0\4\0" + bytes(183))
    up = dxl_reference.status(3, bytes(range(189)))
    free.tell(f"bus {up.hex()}")
    seen = free.send(down, 8000)
    assert bytes(seen.bus) == down
    assert bytes(seen.host) == up


def test_more_frames_than_the_store_holds_are_counted_and_what_passes_is_whole(free: Rig) -> None:
    frames = [instruction(1, READ, b"\x84\0" + bytes([i, 0])) for i in range(250)]
    seen = free.send(b"".join(frames), 600_000)
    sent = bytes(seen.bus)
    passed = [sent[at : at + 14] for at in range(0, len(sent), 14)]
    assert passed == [frame for frame in frames if frame in passed]
    assert 140 < len(passed) < 250
    assert free.table(HOST_OVERRUNS, 2) == 250 - len(passed)


def test_lost_bytes_are_counted(free: Rig) -> None:
    free.tell("overrun 0")
    free.send(READ_1, 4000)
    free.tell("overrun 1")
    free.hear(REPLY_1)
    assert (free.table(HOST_OVERRUNS, 2), free.table(BUS_OVERRUNS, 2)) == (1, 1)


@pytest.mark.parametrize(
    "frame",
    [
        instruction(1, WRITE, GOAL),
        instruction(1, WRITE, b"\x64\0\0\0"),
        instruction(1, WRITE, b"\x70\0" + bytes(8)),
        instruction(1, WRITE, b"\xe0\0" + bytes(4)),
        instruction(1, WRITE, b"\x84\2" + bytes(4)),
        instruction(1, REG_WRITE, GOAL),
        instruction(1, WRITE, b"\x40\0\1"),
        instruction(1, WRITE, b"\x3f\0\0\0"),
        instruction(1, ACTION),
        instruction(1, BULK_WRITE, b"\1"),
    ],
)
def test_in_the_safe_state_a_goal_is_refused_in_the_name_of_the_servo(
    rig: Rig, frame: bytes
) -> None:
    seen = rig.send(frame)
    assert seen.bus == b""
    assert status_of(seen) == dxl.Status(1, 4, False, b"")
    assert rig.table(REFUSED, 2) == 1


@pytest.mark.parametrize(
    "frame",
    [
        instruction(254, SYNC_WRITE, b"\x74\0\4\0\1" + bytes(4)),
        instruction(254, WRITE, GOAL),
        instruction(254, SYNC_WRITE, b"\x40\0\1\0\1\0\2\1"),
        instruction(254, ACTION),
        instruction(254, BULK_WRITE, b"\1\x74\0\1\0\0"),
    ],
)
def test_in_the_safe_state_a_goal_for_several_servos_is_dropped_in_silence(
    rig: Rig, frame: bytes
) -> None:
    seen = rig.send(frame)
    assert not seen.bus
    assert not seen.host
    assert rig.table(REFUSED, 2) == 1


@pytest.mark.parametrize(
    "frame",
    [
        READ_1,
        instruction(1, PING),
        instruction(1, WRITE, b"\x40\0\0"),
        instruction(1, WRITE, b"\x62\0\0"),
        instruction(1, WRITE, b"\x74"),
        instruction(1, WRITE),
        instruction(254, SYNC_WRITE),
        instruction(254, SYNC_WRITE, b"\x74\0\4"),
        instruction(254, SYNC_WRITE, b"\x40\0\1\0\1\0\2\0"),
        instruction(1, WRITE, b"\x60\0" + bytes(4)),
        instruction(1, WRITE, b"\x78\0\0"),
        instruction(254, WRITE, b"\x40\0\0"),
        instruction(254, SYNC_WRITE, b"\x62\0\1\0\1\0"),
    ],
)
def test_in_the_safe_state_everything_else_passes(rig: Rig, frame: bytes) -> None:
    assert bytes(rig.send(frame, 3500).bus) == frame
    assert rig.table(REFUSED, 2) == 0


def keep_waiting(free: Rig, sizes: list[int]) -> None:
    """Frames of these sizes that nobody answers, so that some wait in the store at any time."""
    sent, seen = bytearray(), bytearray()
    for number, size in enumerate(sizes):
        frame = instruction(1, WRITE, b"\x14\0" + bytes(i % 250 for i in range(size - 12)))
        assert len(frame) == size
        sent += frame
        # Each keeps the board for 3 ms and its own length.
        seen += free.send(frame, 0.0 if number < 4 else 1680.0).bus
    seen += free.run(40_000).bus
    assert bytes(seen) == bytes(sent)
    assert free.table(HOST_OVERRUNS, 2) == 0


def test_frames_that_wait_go_out_in_order_round_and_round_the_store(free: Rig) -> None:
    rng = random.Random(1)
    keep_waiting(free, [rng.randrange(100, 400) for _ in range(150)])


def test_where_frames_once_turned_to_the_begin_of_the_store_is_forgotten(free: Rig) -> None:
    # A frame takes a byte more than its length of 2048: 20 of 99 end at 2000, where the next turns.
    keep_waiting(free, [99] * 30)
    keep_waiting(free, [99] * 20 + [47])
