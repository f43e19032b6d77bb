"""Access rules of the control table: what is refused, with which error, and what a boot resets."""

import random
import struct

import pytest

from sphmctl.emulators.control_table import ITEMS
from sphmctl.emulators.xl430 import Servo


def make() -> Servo:
    return Servo(random.Random(1))


def on() -> Servo:
    servo = make()
    assert servo.write(64, b"\x01") == 0
    return servo


def number(servo: Servo, address: int, size: int) -> int:
    error, data = servo.read(address, size)
    assert error == 0
    return int.from_bytes(data, "little", signed=True)


def steps(servo: Servo, count: int) -> None:
    for index in range(servo.index + 1, servo.index + count + 1):
        servo.step(index)


# Address, size, default: e-manual, XL430-W250, "Control Table", with the emulated cell's ID and
# rate. A range that is missing is not limited by a number in the manual.
ROWS = [
    (0, 2, 1060, None),
    (7, 1, 1, (0, 252)),
    (8, 1, 3, (0, 7)),
    (9, 1, 0, (0, 254)),
    (10, 1, 0, (0, 13)),
    (20, 4, 0, (-1_044_479, 1_044_479)),
    (24, 4, 10, (0, 1023)),
    (31, 1, 72, (0, 100)),
    (32, 2, 140, (60, 140)),
    (34, 2, 60, (60, 140)),
    (36, 2, 885, (0, 885)),
    (44, 4, 265, (0, 1023)),
    (48, 4, 4095, (0, 4095)),
    (52, 4, 0, (0, 4095)),
    (60, 1, 0, (0, 3)),
    (63, 1, 52, (0, 63)),
    (64, 1, 0, (0, 1)),
    (65, 1, 0, (0, 1)),
    (68, 1, 2, (0, 2)),
    (76, 2, 1000, (0, 16383)),
    (78, 2, 100, (0, 16383)),
    (80, 2, 4000, (0, 16383)),
    (82, 2, 0, (0, 16383)),
    (84, 2, 640, (0, 16383)),
    (98, 1, 0, (0, 127)),
    (100, 2, 885, (-885, 885)),
    (104, 4, 0, (-265, 265)),
    (108, 4, 0, (0, 32767)),
    (112, 4, 0, (0, 32767)),
    (116, 4, 2048, (0, 4095)),
    (168, 2, 224, (64, 661)),
    (632, 2, 661, (64, 661)),
]


def word(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little", signed=value < 0)


@pytest.mark.parametrize(("address", "size", "default", "limits"), ROWS)
def test_an_item_has_the_default_and_range_of_the_manual(
    address: int, size: int, default: int, limits: tuple[int, int] | None
) -> None:
    assert make().read(address, size) == (0, word(default, size))
    if limits is None:
        assert make().write(address, word(default, size)) == 7
        return
    low, high = limits
    for value in limits:
        assert make().write(address, word(value, size)) == 0
    for value in (low - 1, high + 1):
        if value >= 0 or low < 0:
            servo = make()
            if value < 1 << 8 * size:
                assert servo.write(address, word(value, size)) == 4
                assert servo.read(address, size) == (0, word(default, size))


@pytest.mark.parametrize("mode", [0, 2, 5, 15, 17])
def test_an_operating_mode_that_the_servo_lacks_is_out_of_range(mode: int) -> None:
    assert make().write(11, bytes((mode,))) == 4


@pytest.mark.parametrize("item", [item for item in ITEMS if not item.writable])
def test_a_read_only_item_refuses_a_write(item: object) -> None:
    address, size = vars(item)["address"], vars(item)["size"]
    assert make().write(address, bytes(size)) == 7


@pytest.mark.parametrize("address", [14, 28, 38, 56, 62, 66, 71, 92, 99, 102, 148, 252, 577, 662])
def test_an_undefined_address_is_an_access_error_without_data(address: int) -> None:
    assert make().read(address, 1) == (7, b"")
    assert make().write(address, b"\x00") == 7


def test_a_read_that_runs_off_the_table_is_refused_and_one_across_gaps_is_not() -> None:
    servo = make()
    assert servo.read(660, 3) == (7, b"")
    error, data = servo.read(0, 147)
    assert (error, len(data)) == (0, 147)
    assert data[7:9] == b"\x01\x03"


@pytest.mark.parametrize(("address", "data"), [(116, b"\0\0"), (84, b"\1"), (112, bytes(6))])
def test_a_write_shorter_than_its_item_is_a_length_error(address: int, data: bytes) -> None:
    assert make().write(address, data) == 5


def test_a_write_into_the_middle_of_an_item_is_an_access_error() -> None:
    assert make().write(117, b"\0") == 7


def test_a_write_over_several_items_is_stored_whole_or_not_at_all() -> None:
    servo = make()
    assert servo.write(108, struct.pack("<III", 5, 6, 7)) == 0
    assert struct.unpack("<III", servo.read(108, 12)[1]) == (5, 6, 7)
    assert servo.write(108, struct.pack("<III", 8, 9, 5000)) == 4
    assert struct.unpack("<III", servo.read(108, 12)[1]) == (5, 6, 7)


@pytest.mark.parametrize("address", [7, 8, 9, 10, 11, 31, 63, 168])
def test_eeprom_and_indirect_addresses_are_locked_while_torque_is_on(address: int) -> None:
    servo = on()
    size = 2 if address == 168 else 1
    before = servo.read(address, size)
    assert servo.write(address, before[1]) == 7
    servo.write(64, b"\x00")
    assert servo.write(address, before[1]) == 0


def test_goals_follow_the_limits_that_are_set() -> None:
    servo = make()
    assert servo.write(48, word(3000, 4)) == 0
    assert servo.write(52, word(1000, 4)) == 0
    assert [servo.write(116, word(v, 4)) for v in (999, 1000, 3000, 3001)] == [4, 0, 0, 4]
    assert servo.write(11, b"\x04") == 0
    assert [servo.write(116, word(v, 4)) for v in (-1_048_575, 1_048_576)] == [0, 4]
    assert servo.write(44, word(50, 4)) == 0
    assert [servo.write(104, word(v, 4)) for v in (-50, 51)] == [0, 4]
    assert servo.write(36, word(300, 2)) == 0
    assert [servo.write(100, word(v, 2)) for v in (-300, 301)] == [0, 4]


def test_the_profile_range_is_shorter_in_time_based_mode() -> None:
    servo = make()
    assert servo.write(112, word(32767, 4)) == 0
    assert servo.write(10, b"\x04") == 0
    assert [servo.write(112, word(v, 4)) for v in (32737, 32738)] == [0, 4]


def test_indirect_data_reads_and_writes_what_its_addresses_point_at() -> None:
    servo = make()
    for slot, target in enumerate((132, 133, 134, 135, 64, 116, 117, 118, 119)):
        assert servo.write(168 + 2 * slot, word(target, 2)) == 0
    assert servo.read(224, 5) == (0, word(2048, 4) + b"\x00")
    assert servo.write(228, b"\x01" + word(2100, 4)) == 0
    assert number(servo, 64, 1) == 1
    assert number(servo, 116, 4) == 2100
    assert servo.write(228, b"\x01" + word(9999, 4)) == 4
    assert servo.write(224, b"\x00") == 7
    assert servo.write(229, word(2100, 4)[:2]) == 5


def test_both_banks_of_indirect_data_work_and_are_plain_memory_at_first() -> None:
    servo = make()
    assert servo.write(634, bytes(range(28))) == 0
    assert servo.read(634, 28) == (0, bytes(range(28)))
    assert servo.write(578, word(146, 2)) == 0
    assert servo.read(634, 2)[1] == servo.read(146, 1)[1] + b"\x01"


def test_a_new_operating_mode_resets_gains_profile_and_goal_pwm() -> None:
    servo = make()
    for address, size, value in ((84, 2, 99), (108, 4, 7), (112, 4, 8), (100, 2, 55)):
        assert servo.write(address, word(value, size)) == 0
    assert servo.write(11, b"\x04") == 0
    items = ((84, 2), (108, 4), (112, 4), (100, 2))
    assert [number(servo, *item) for item in items] == [640, 0, 0, 885]


def test_a_reboot_keeps_the_eeprom_forgets_the_ram_and_is_silent_for_a_moment() -> None:
    servo = on()
    steps(servo, 1500)
    assert number(servo, 120, 2) == 1500
    servo.write(64, b"\x00")
    assert servo.write(31, b"\x3c") == 0
    assert servo.write(168, word(132, 2)) == 0
    servo.write(64, b"\x01")
    servo.write(68, b"\x01")
    servo.reboot()
    assert not servo.listening
    steps(servo, 1000)
    assert servo.listening
    assert servo.read(31, 1)[1] == b"\x3c"
    assert [servo.read(a, n)[1] for a, n in ((64, 1), (68, 1), (168, 2))] == [
        b"\x00",
        b"\x02",
        word(224, 2),
    ]
    assert number(servo, 120, 2) == 1000


@pytest.mark.parametrize(
    ("keep", "servo_id", "baud_code"), [(0xFF, 1, 1), (0x01, 5, 1), (0x02, 5, 3)]
)
def test_a_factory_reset_keeps_what_it_is_told_to(keep: int, servo_id: int, baud_code: int) -> None:
    servo = Servo(random.Random(1), 5)
    servo.write(31, b"\x3c")
    assert servo.factory_reset(bytes((keep,)), broadcast=False) == 0
    assert servo.read(7, 3) == (0, bytes((servo_id, baud_code, 250)))
    assert number(servo, 31, 1) == 72
    assert number(servo, 0, 2) == 1060


def test_a_factory_reset_of_everything_is_ignored_on_broadcast() -> None:
    servo = Servo(random.Random(1), 5)
    servo.factory_reset(b"\xff", broadcast=True)
    assert servo.id == 5


def test_a_backup_needs_torque_off_and_the_key() -> None:
    servo = on()
    assert servo.back_up(b"\x01CTRL") == 1
    servo.write(64, b"\x00")
    assert servo.back_up(b"\x01CTRX") == 4
    assert servo.back_up(b"\x01CTRL") == 0


def test_startup_configuration_restores_ram_and_switches_torque_on() -> None:
    servo = make()
    servo.write(112, word(77, 4))
    servo.back_up(b"\x01CTRL")
    servo.write(60, b"\x03")
    servo.reboot()
    assert number(servo, 112, 4) == 77
    assert number(servo, 64, 1) == 1


def test_torque_on_by_goal_update_is_a_drive_mode_bit() -> None:
    servo = make()
    servo.write(116, word(2100, 4))
    assert number(servo, 64, 1) == 0
    servo.write(10, b"\x08")
    servo.write(116, word(2100, 4))
    assert number(servo, 64, 1) == 1


def test_clear_folds_the_turns_but_not_during_a_move() -> None:
    servo = make()
    servo.write(11, b"\x04")
    servo.turn_by_hand(4096 * 3)
    key = bytes.fromhex("01 44 58 4C 22")
    assert number(servo, 132, 4) == 2048 + 4096 * 3
    servo.write(112, word(20, 4))
    servo.write(64, b"\x01")
    servo.write(116, word(2048, 4))
    steps(servo, 50)
    assert servo.clear(key) == 1
    servo.write(64, b"\x00")
    assert servo.clear(key) == 0
    assert 0 <= number(servo, 132, 4) < 4096


def test_a_servo_as_it_leaves_the_factory_can_be_made() -> None:
    servo = Servo(random.Random(1), 1, baud_code=1, return_delay=250)
    assert servo.read(7, 3) == (0, b"\x01\x01\xfa")
    assert servo.baud == 57_600
    assert servo.return_delay_s == pytest.approx(500e-6)
