"""Bus Watchdog, hardware errors and power of an emulated servo."""

import random
import struct

import pytest

from sphmctl.emulators.xl430 import Servo
from tests.emulators.servo_rig import Rig, frame, read, write

PING_3 = frame(3, 0x01)
ALERT = 0x80


def goal(value: int, servo_id: int = 1) -> bytes:
    return write(servo_id, 116, struct.pack("<i", value))


def running(rig: Rig, watchdog: int = 5) -> None:
    """Servo 1 with torque, a slow profile and the watchdog (20 ms a digit)."""
    rig.ask(write(1, 108, struct.pack("<II", 10, 50)), wait_s=0.001)
    rig.ask(write(1, 64, b"\x01"), wait_s=0.001)
    rig.ask(write(1, 98, bytes((watchdog,))), wait_s=0.001)


def item(rig: Rig, address: int, size: int) -> int:
    """An item of servo 1, past the bus so as not to feed the watchdog."""
    rig.world.advance()
    _, data = rig.servos[0].read(address, size)
    return int.from_bytes(data, "little", signed=True)


def test_the_watchdog_trips_after_its_time_of_silence_and_stops_the_move() -> None:
    with Rig() as rig:
        running(rig)
        rig.ask(goal(4000), wait_s=0.095)
        assert item(rig, 98, 1) == 5
        rig.wait(0.010)
        assert item(rig, 98, 1) == -1
        assert [item(rig, 108, 4), item(rig, 112, 4)] == [0, 0]
        assert item(rig, 64, 1) == 1
        held = rig.servos[0].true_ticks
        rig.wait(0.5)
        assert rig.servos[0].true_ticks == held
        assert 2048 < held < 2300


@pytest.mark.parametrize("packet", [PING_3, read(2, 132, 4), frame(0xFE, 0x05), goal(2048, 9)])
def test_any_instruction_on_the_bus_feeds_the_watchdog(packet: bytes) -> None:
    with Rig() as rig:
        running(rig)
        for _ in range(10):
            rig.ask(packet, wait_s=0.09)
        assert item(rig, 98, 1) == 5


def test_a_frame_with_a_wrong_crc_does_not_feed_the_watchdog() -> None:
    with Rig() as rig:
        running(rig)
        for _ in range(3):
            rig.ask(PING_3[:-1] + b"\x00", wait_s=0.09)
        assert item(rig, 98, 1) == -1


def test_the_watchdog_counts_only_with_torque_on() -> None:
    with Rig() as rig:
        running(rig)
        rig.ask(write(1, 64, b"\x00"))
        rig.wait(3.0)
        assert item(rig, 98, 1) == 5
        rig.ask(write(1, 64, b"\x01"), wait_s=0.09)
        assert item(rig, 98, 1) == 5
        rig.wait(0.02)
        assert item(rig, 98, 1) == -1


def test_after_a_trip_goals_are_refused_until_0_is_written_and_then_step() -> None:
    with Rig() as rig:
        running(rig)
        rig.wait(0.2)
        held = rig.servos[0].true_ticks
        assert rig.error(goal(2100)) == 4
        assert rig.error(write(1, 104, bytes(4))) == 4
        assert rig.error(write(1, 100, bytes(2))) == 4
        assert rig.error(write(1, 98, b"\x05")) == 4
        assert rig.value(1, 98, 1) == -1
        assert rig.error(write(1, 98, b"\x00")) == 0
        assert rig.error(goal(2100)) == 0
        rig.wait(0.3)
        assert held == 2048
        assert rig.servos[0].true_ticks == pytest.approx(2100, abs=1)


def test_a_sync_write_to_a_tripped_servo_leaves_no_trace() -> None:
    with Rig() as rig:
        running(rig)
        rig.wait(0.2)
        rig.ask(frame(0xFE, 0x83, struct.pack("<HHBi", 116, 4, 1, 2100)))
        rig.ask(write(1, 98, b"\x00"))
        rig.wait(0.3)
        assert rig.servos[0].true_ticks == 2048


def test_an_error_in_the_shutdown_mask_takes_the_torque_until_a_reboot() -> None:
    with Rig() as rig:
        rig.ask(write(1, 64, b"\x01"))
        rig.servos[0].raise_error(5)
        assert rig.error(read(1, 70, 1)) == ALERT
        assert rig.value(1, 70, 1) == 0x20
        assert rig.value(1, 64, 1) == 0
        assert rig.error(write(1, 64, b"\x01")) & ALERT
        assert rig.value(1, 64, 1) == 0
        rig.ask(frame(1, 0x08), wait_s=0.4)
        assert rig.error(read(1, 70, 1)) == 0
        assert rig.error(write(1, 64, b"\x01")) == 0
        assert rig.value(1, 64, 1) == 1


def test_an_error_outside_the_mask_alerts_with_valid_data_and_torque_stays() -> None:
    with Rig() as rig:
        rig.ask(write(1, 64, b"\x01"))
        rig.servos[0].raise_error(0)
        answer = rig.ask(read(1, 132, 4))
        assert answer[8:13] == bytes((ALERT,)) + struct.pack("<i", 2048)
        assert rig.value(1, 64, 1) == 1
        assert rig.ask(frame(1, 0x01))[8] == ALERT


def test_overheating_shuts_the_servo_down() -> None:
    with Rig() as rig:
        rig.ask(write(1, 64, b"\x01"))
        rig.servos[0].set_temperature(73)
        rig.wait(0.11)
        assert item(rig, 146, 1) == 73
        assert item(rig, 70, 1) == 0x04
        assert item(rig, 64, 1) == 0


@pytest.mark.parametrize("volts", [5.8, 14.2])
def test_a_voltage_outside_its_limits_alerts_but_does_not_shut_down_by_default(
    volts: float,
) -> None:
    with Rig() as rig:
        rig.ask(write(1, 64, b"\x01"))
        rig.servos[0].set_voltage(volts)
        rig.wait(0.11)
        assert item(rig, 144, 2) == round(volts * 10)
        assert item(rig, 70, 1) == 0x01
        assert item(rig, 64, 1) == 1
        rig.servos[0].set_voltage(12.0)
        rig.wait(0.2)
        assert item(rig, 70, 1) == 0x01


def test_a_lasting_overload_shuts_the_servo_down_and_a_short_one_does_not() -> None:
    with Rig() as rig:
        rig.ask(write(1, 64, b"\x01"))
        rig.servos[0].push(1.0)
        rig.wait(0.8)
        assert item(rig, 126, 2) < -900
        rig.servos[0].push(0.0)
        rig.wait(0.8)
        assert item(rig, 70, 1) == 0
        rig.servos[0].push(-1.0)
        rig.wait(1.5)
        assert item(rig, 70, 1) == 0x20
        assert item(rig, 64, 1) == 0


def test_load_warms_a_servo_slowly_and_rest_cools_it() -> None:
    servo = Servo(random.Random(1))
    servo.write(64, b"\x01")
    servo.push(0.8)
    temperatures = []
    for index in range(1, 150_001):
        if index == 30_000:
            servo.push(0.0)
        servo.step(index)
        if index % 15_000 == 0:  # every 15 s
            temperatures.append(servo.read(146, 1)[1][0])
    assert temperatures[0] < temperatures[1] > temperatures[-1]
    assert 2 <= temperatures[1] - temperatures[0] <= 6


def test_a_servo_without_power_is_limp_and_silent_and_comes_back_with_default_ram() -> None:
    with Rig() as rig:
        running(rig)
        rig.servos[0].unplug()
        assert rig.ask(frame(1, 0x01)) == b""
        rig.servos[0].plug()
        assert rig.ask(frame(1, 0x01)) == b""
        rig.wait(0.4)
        assert rig.ask(frame(1, 0x01))[8] == 0
        assert [rig.value(1, a, 1) for a in (64, 98)] == [0, 0]
        assert rig.value(1, 120, 2) <= 520
        assert rig.servos[0].true_ticks == 2048
