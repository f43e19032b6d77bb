"""Lines to the KRC4, the watch on the host, and the conditions of wrist ok."""

from __future__ import annotations

import pytest

from sphmctl.wire import board_table as table
from tests.firmware.rig import (
    BOARD,
    KNOT,
    MOVING,
    OK,
    PING,
    READ,
    REBOOT,
    STOP,
    SYNC_WRITE,
    Rig,
    instruction,
)
from tests.wire import dxl_reference

PING_1 = instruction(1, PING)
SYNC_WRITE_1 = instruction(254, SYNC_WRITE, b"\x74\0\4\0\1" + bytes(4))
# Broadcast Write of 98 = 1, its CRC by the bitwise rule.
HOLD = dxl_reference.frame(254, b"\x03\x62\0\1")


def item(rig: Rig, which: table.Item) -> int:
    return rig.table(which.address, which.size)


def test_a_board_powers_up_in_the_safe_state_before_the_first_byte(rig: Rig) -> None:
    assert item(rig, table.BUS_WATCHDOG) == 255
    assert item(rig, table.OUTPUT_STATE) == 0
    assert item(rig, table.HINDRANCES) == (
        table.HINDRANCES_NOT_ARMED | table.HINDRANCES_NOT_ASKED | table.HINDRANCES_SAFE_STATE
    )
    assert rig.run(5000).wrist_ok == []


def test_wrist_ok_goes_on_when_all_conditions_hold_and_not_before(rig: Rig) -> None:
    frames = [
        instruction(BOARD, 3, bytes([address, 0, value]))
        for address, value in ((98, 0), (98, 5), (64, 1))
    ]
    for frame in frames:
        assert rig.send(frame).wrist_ok == []
    assert [level for _, level in rig.send(instruction(BOARD, 3, b"\x74\0\1")).wrist_ok] == [1]
    assert (item(rig, table.HINDRANCES), item(rig, table.OUTPUT_STATE)) == (0, 1)


@pytest.mark.parametrize(
    ("before", "error"),
    [
        ([], 4),
        ([(98, 0)], 6),
        ([(98, 0), (98, 5)], 6),
        ([(98, 0), (64, 1)], 6),
    ],
)
def test_asking_for_wrist_ok_without_its_conditions_is_refused(
    rig: Rig, before: list[tuple[int, int]], error: int
) -> None:
    for address, value in before:
        assert rig.write(address, value) == OK
    assert rig.write(116, 1).error == error
    assert item(rig, table.OUTPUTS) == 0


@pytest.mark.parametrize(("address", "value"), [(64, 0), (98, 0), (116, 0)])
def test_taking_a_condition_away_drops_wrist_ok_and_giving_it_back_does_not_bring_it_back(
    rig: Rig, address: int, value: int
) -> None:
    rig.arm()
    frame = instruction(BOARD, 3, bytes([address, 0, value]))
    assert [level for _, level in rig.send(frame).wrist_ok] == [0]
    rig.write(98, 5)
    rig.write(64, 1)
    assert item(rig, table.OUTPUT_STATE) == 0
    assert rig.write(116, 1) == OK
    assert item(rig, table.OUTPUT_STATE) == 1


def test_a_silent_host_drops_wrist_ok_within_1_ms_of_the_watchdog_time(rig: Rig) -> None:
    rig.arm()
    frame = instruction(BOARD, PING)
    fed_us = rig.now_us + 10 * len(frame)
    rig.send(frame)
    seen = rig.run(110_000)
    ((fell_us, level),) = seen.wrist_ok
    assert level == 0
    assert 100_000 <= fell_us - fed_us <= 101_000
    assert item(rig, table.BUS_WATCHDOG) == 255
    assert item(rig, table.WATCHDOG_TRIPS) == 1


def test_a_trip_sends_the_hold_to_the_servos_and_refuses_goals_until_it_is_cleared(
    rig: Rig,
) -> None:
    rig.arm()
    assert bytes(rig.run(105_000).bus) == HOLD
    goal = SYNC_WRITE_1
    assert rig.send(goal).bus == b""
    assert rig.write(98, 5).error == 4
    assert rig.write(116, 1).error == 4
    assert rig.write(98, 0) == OK
    assert bytes(rig.send(goal).bus) == goal
    assert item(rig, table.OUTPUT_STATE) == 0


def test_the_hold_waits_for_a_servo_that_is_speaking(rig: Rig) -> None:
    rig.arm()
    rig.run(97_000 - 1500)
    reply = dxl_reference.status(1, bytes(500))
    rig.tell(f"bus {reply.hex()}")
    seen = rig.run(9_000)
    assert (bytes(seen.bus), bytes(seen.host)) == (HOLD, reply)
    assert seen.bus_at[0] > seen.host_at[-1]


@pytest.mark.parametrize("frame", [PING_1, instruction(BOARD, READ, b"\0\0\1\0"), SYNC_WRITE_1])
def test_any_valid_frame_keeps_the_watchdog_quiet(rig: Rig, frame: bytes) -> None:
    rig.arm()
    for _ in range(4):
        assert rig.send(frame, 80_000).wrist_ok == []


def test_damaged_frames_do_not_keep_the_watchdog_quiet(rig: Rig) -> None:
    rig.arm()
    fell = []
    for _ in range(4):
        fell += rig.send(PING_1[:-1] + b"\0", 40_000).wrist_ok
    assert [level for _, level in fell] == [0]


def test_the_watchdog_only_counts_while_armed(rig: Rig) -> None:
    rig.write(98, 0)
    rig.write(98, 1)
    rig.run(200_000)
    assert item(rig, table.BUS_WATCHDOG) == 1
    rig.write(64, 1)
    rig.run(25_000)
    assert item(rig, table.BUS_WATCHDOG) == 255


def test_a_pressed_stop_is_latched_disarms_and_drops_wrist_ok_within_1_ms(rig: Rig) -> None:
    rig.arm()
    pressed_us = rig.now_us
    rig.line(STOP, high=True)
    ((fell_us, level),) = rig.run(3000).wrist_ok
    assert level == 0
    assert 250 <= fell_us - pressed_us <= 1000
    assert abs(item(rig, table.STOP_STAMP) - pressed_us) < 300
    assert item(rig, table.ARM) == 0
    rig.line(STOP, high=False)
    rig.run(10_000)
    assert item(rig, table.FAULTS) == table.FAULTS_STOP
    assert rig.write(64, 1).error == 6
    assert rig.write(70, 0) == OK
    rig.arm()
    assert item(rig, table.OUTPUT_STATE) == 1


def test_a_stop_cannot_be_cleared_while_it_is_pressed(rig: Rig) -> None:
    rig.line(STOP, high=True)
    rig.run(3000)
    status = rig.write(70, 0)
    assert (status.error, status.alert) == (1, True)


def test_a_spike_on_the_stop_line_is_no_stop(rig: Rig) -> None:
    rig.arm()
    for _ in range(5):
        rig.line(STOP, high=True)
        assert rig.run(200).wrist_ok == []
        rig.line(STOP, high=False)
        assert rig.run(3000).wrist_ok == []


def test_a_board_that_starts_with_the_stop_pressed_says_so(bare: Rig) -> None:
    bare.start()
    bare.line(STOP, high=True)
    bare.tell("start")
    assert item(bare, table.FAULTS) == table.FAULTS_STOP


def test_wrist_ok_falls_once_whenever_an_alert_comes(rig: Rig) -> None:
    for delay_us in range(50, 250):
        rig.arm()
        rig.reply(dxl_reference.status(2, b"", error=0x80), delay_us)
        seen = rig.send(instruction(2, PING), 1000)
        assert [level for _, level in seen.wrist_ok] == [0], delay_us
        assert rig.write(70, 0) == OK


def test_an_alert_of_a_servo_drops_wrist_ok_and_names_the_servo(rig: Rig) -> None:
    rig.arm()
    rig.reply(dxl_reference.status(2, b"", error=0x80))
    seen = rig.send(instruction(2, PING))
    assert [level for _, level in seen.wrist_ok] == [0]
    assert item(rig, table.FAULTS) == table.FAULTS_SERVO
    assert item(rig, table.ALERT_ID) == 2
    assert rig.write(116, 1).error == 6
    assert rig.write(70, 0) == OK
    assert rig.write(116, 1) == OK


def test_an_alert_in_a_damaged_status_is_none(rig: Rig) -> None:
    rig.arm()
    rig.reply(dxl_reference.status(2, b"", error=0x80)[:-1] + b"\0")
    rig.send(instruction(2, PING), 4000)
    assert item(rig, table.FAULTS) == 0


def test_each_knot_is_stamped_when_it_came_and_counted_once_it_lasted(rig: Rig) -> None:
    came = {}
    for number in range(1, 7):
        came[number % 4] = rig.now_us
        rig.line(KNOT, high=number % 2 == 0)
        rig.run(1000)
        assert item(rig, table.KNOT_RAW_EDGES) == number
        assert item(rig, table.KNOT_EDGES) == number - 1
        assert abs(item(rig, table.KNOT_RAW_STAMP) - came[number % 4]) <= 4
        rig.run(11_000)
        assert item(rig, table.KNOT_EDGES) == number
        assert item(rig, table.INPUTS) == (table.INPUTS_KNOT if number % 2 else 0)
    stamps = (table.KNOT_STAMP_0, table.KNOT_STAMP_1, table.KNOT_STAMP_2, table.KNOT_STAMP_3)
    for slot, stamp in enumerate(stamps):
        assert abs(item(rig, stamp) - came[slot]) <= 4


def test_a_bouncing_knot_counts_once_and_is_stamped_at_its_first_edge(rig: Rig) -> None:
    first_us = rig.now_us
    for high in (False, True, False, True, False):
        rig.line(KNOT, high=high)
        rig.run(150)
    rig.run(5000)
    assert item(rig, table.KNOT_EDGES) == 1
    assert abs(item(rig, table.KNOT_STAMP_1) - first_us) <= 4


def test_a_spike_on_knot_is_captured_but_not_counted(rig: Rig) -> None:
    rig.line(KNOT, high=False)
    rig.run(300)
    rig.line(KNOT, high=True)
    rig.run(5000)
    assert item(rig, table.KNOT_RAW_EDGES) == 2
    assert (item(rig, table.KNOT_EDGES), item(rig, table.INPUTS)) == (0, 0)


def test_arm_moving_is_debounced_counted_and_stamped(rig: Rig) -> None:
    came_us = rig.now_us
    rig.line(MOVING, high=False)
    rig.run(5000)
    assert item(rig, table.INPUTS) == table.INPUTS_MOVING
    assert item(rig, table.MOVING_EDGES) == 1
    assert abs(item(rig, table.MOVING_STAMP) - came_us) < 300


def test_the_clock_the_tick_and_the_uptime_agree_with_time(rig: Rig) -> None:
    began_us, clock = rig.now_us, item(rig, table.BOARD_CLOCK)
    rig.run(2_300_000)
    passed_us = rig.now_us - began_us
    assert abs(item(rig, table.BOARD_CLOCK) - clock - passed_us) < 300
    assert abs(item(rig, table.REALTIME_TICK) - passed_us / 1000) < 3
    assert item(rig, table.UPTIME) == 2


def test_wrist_ok_falls_before_a_reboot(rig: Rig) -> None:
    rig.arm()
    seen = rig.send(instruction(BOARD, REBOOT))
    ((fell_us, level),) = seen.wrist_ok
    assert level == 0
    assert fell_us < seen.resets[0]
