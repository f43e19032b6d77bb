"""Golden frames: what the ROBOTIS e-manual prints (or dynamixel-sdk computes) comes back."""

import random
from collections.abc import Callable

import pytest

from sphmctl.emulators.dxl_frame import FrameFinder, crc16
from sphmctl.emulators.xl430 import Servo
from tests.emulators.servo_rig import Rig, read, write

H = bytes.fromhex
HEAD = "FF FF FD 00 "
OK_1 = HEAD + "01 04 00 55 00 A1 0C"


def _one(position: float = 2048.0, servo_id: int = 1) -> list[Servo]:
    return [Servo(random.Random(1), servo_id, position)]


def _model_1030() -> list[Servo]:
    return [Servo(random.Random(1), 1, model=1030, firmware=38)]


def _firmware_45() -> list[Servo]:
    return [Servo(random.Random(1), 1, firmware=45)]


def _three(first: int, second: int, third: int) -> list[Servo]:
    rng = random.Random(1)
    servos = [Servo(rng, 3, first), Servo(rng, 7, second), Servo(rng, 4, third)]
    servos[2].set_temperature(31)
    return servos


def _voltage_and_heat() -> list[Servo]:
    rng = random.Random(1)
    servos = [Servo(rng, 1), Servo(rng, 2)]
    servos[0].set_voltage(11.9)
    servos[1].set_temperature(36)
    return servos


def _alert() -> list[Servo]:
    servos = _one()
    servos[0].raise_error(0)
    return servos


EXCHANGES: list[tuple[str, Callable[[], list[Servo]], str, str]] = [
    ("ping", _model_1030, "01 03 00 01 19 4E", "01 07 00 55 00 06 04 26 65 5D"),
    ("ping fw 45", _firmware_45, "01 03 00 01 19 4E", "01 07 00 55 00 24 04 2D F4 DF"),
    ("ping fw 46", _one, "01 03 00 01 19 4E", "01 07 00 55 00 24 04 2E FE DF"),
    ("ping all", _one, "FE 03 00 01 31 42", "01 07 00 55 00 24 04 2E FE DF"),
    ("ping 200", _one, "C8 03 00 01 3B FA", ""),
    (
        "read 132",
        lambda: _one(166),
        "01 07 00 02 84 00 04 00 1D 15",
        "01 08 00 55 00 A6 00 00 00 8C C0",
    ),
    ("write 116", _one, "01 09 00 03 74 00 00 02 00 00 CA 89", "01 04 00 55 00 A1 0C"),
    ("alert", _alert, "01 09 00 03 74 00 00 02 00 00 CA 89", "01 04 00 55 80 A2 8F"),
    ("alert, range", _alert, "01 0A 00 03 74 00 FF FF FD FD 00 21 E7", "01 04 00 55 84 B9 0F"),
    ("reg write", _one, "01 09 00 04 68 00 C8 00 00 00 AE 8E", "01 04 00 55 00 A1 0C"),
    ("factory reset", _one, "01 04 00 06 01 A1 E6", "01 04 00 55 00 A1 0C"),
    ("reboot", _one, "01 03 00 08 2F 4E", "01 04 00 55 00 A1 0C"),
    ("reboot all", _one, "FE 03 00 08 07 42", ""),
    ("clear", _one, "01 08 00 10 01 44 58 4C 22 B1 DC", "01 04 00 55 00 A1 0C"),
    ("backup", _one, "01 08 00 20 01 43 54 52 4C 16 F5", "01 04 00 55 00 A1 0C"),
    ("torque on", _one, "01 06 00 03 40 00 01 DB 66", "01 04 00 55 00 A1 0C"),
    ("torque off, all", _one, "FE 06 00 03 40 00 00 2E 16", ""),
    ("watchdog 100 ms", _one, "01 06 00 03 62 00 05 68 E4", "01 04 00 55 00 A1 0C"),
    ("watchdog clear", _one, "01 06 00 03 62 00 00 76 E4", "01 04 00 55 00 A1 0C"),
    (
        "sync read, second of two",
        lambda: [*_one(166), *_one(2079, 2)],
        "FE 09 00 82 84 00 04 00 01 02 CE FA",
        "01 08 00 55 00 A6 00 00 00 8C C0 FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE",
    ),
    (
        "fast sync read",
        lambda: _three(166, 2079, 1023),
        "FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
        "FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E",
    ),
    (
        "bulk read",
        _voltage_and_heat,
        "FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
        "01 06 00 55 00 77 00 C3 69 FF FF FD 00 02 05 00 55 00 24 8B A9",
    ),
    ("a wrong CRC", _one, "01 03 00 01 19 4F", ""),
]


@pytest.mark.parametrize(
    ("setup", "ask", "reply"), [row[1:] for row in EXCHANGES], ids=[row[0] for row in EXCHANGES]
)
def test_a_servo_answers_as_the_manual_prints(
    setup: Callable[[], list[Servo]], ask: str, reply: str
) -> None:
    with Rig(setup()) as rig:
        expected = H(HEAD + reply) if reply else b""
        assert rig.ask(H(HEAD + ask)).hex(" ") == expected.hex(" ")


def test_an_action_without_a_registered_write_is_an_instruction_error() -> None:
    with Rig(_one()) as rig:
        assert rig.error(H(HEAD + "01 03 00 05 02 CE")) == 2
        rig.ask(H(HEAD + "01 09 00 04 68 00 C8 00 00 00 AE 8E"))
        assert rig.value(1, 69, 1) == 1
        assert rig.value(1, 104, 4) == 0
        assert rig.ask(H(HEAD + "01 03 00 05 02 CE")) == H(OK_1)
        assert rig.value(1, 69, 1) == 0
        assert rig.value(1, 104, 4) == 200


def test_a_broadcast_action_acts_in_silence() -> None:
    with Rig(_one()) as rig:
        rig.ask(H(HEAD + "01 09 00 04 68 00 C8 00 00 00 AE 8E"))
        assert rig.ask(H(HEAD + "FE 03 00 05 2A C2")) == b""
        assert rig.value(1, 104, 4) == 200


def test_an_eeprom_write_with_torque_on_answers_the_printed_access_error() -> None:
    with Rig(_one()) as rig:
        rig.ask(H(HEAD + "01 06 00 03 40 00 01 DB 66"))
        assert rig.ask(write(1, 8, b"\x03")) == H(HEAD + "01 04 00 55 07 B0 8C")


def test_the_hardware_error_item_reads_back_with_the_alert() -> None:
    with Rig(_alert()) as rig:
        answer = rig.ask(H(HEAD + "01 07 00 02 46 00 01 00 3C A3"))
        assert answer[8:10] == b"\x80\x01"


def test_the_printed_sync_write_sets_both_goals_in_silence() -> None:
    with Rig([*_one(), *_one(2048, 2)]) as rig:
        ask = "FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87"
        assert rig.ask(H(HEAD + ask)) == b""
        assert [rig.value(i, 116, 4) for i in (1, 2)] == [150, 170]


def test_our_frames_for_three_servos_do_what_they_say() -> None:
    rng = random.Random(1)
    with Rig([Servo(rng, i, 1365) for i in (1, 2, 3)]) as rig:
        ask = "FE 16 00 83 74 00 04 00 01 00 08 00 00 02 00 08 00 00 03 00 08 00 00 78 4B"
        assert rig.ask(H(HEAD + ask)) == b""
        assert [rig.value(i, 116, 4) for i in (1, 2, 3)] == [2048] * 3
        plain = rig.ask(H(HEAD + "FE 0A 00 82 7E 00 0A 00 01 02 03 59 1B"))
        assert [plain[i + 4] for i in (0, 21, 42)] == [1, 2, 3]
        assert len(plain) == 63
        fast = rig.ask(H(HEAD + "FE 0A 00 8A 7E 00 0A 00 01 02 03 69 9B"))
        assert len(fast) == 50
        assert fast[10:20] == plain[9:19]


def test_the_printed_bulk_write_is_refused_where_the_table_forbids_it() -> None:
    # 160 is above the largest Max Voltage Limit(32); 80 is a Temperature Limit(31).
    with Rig([*_one(), *_one(2048, 2)]) as rig:
        ask = "FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68"
        assert rig.ask(H(HEAD + ask)) == b""
        assert rig.value(1, 32, 2) == 140
        assert rig.value(2, 31, 1) == 80


def test_the_printed_fast_bulk_read_reads_three_lengths_in_one_frame() -> None:
    servos = _three(166, 2048, 1023)
    with Rig(servos) as rig:
        servos[1].write(11, b"\x10")  # PWM mode
        servos[1].write(64, b"\x01")
        servos[1].write(100, (421).to_bytes(2, "little"))
        ask = "FE 12 00 9A 03 84 00 04 00 07 7C 00 02 00 04 92 00 01 00 DA 2D"
        reply = "FE 14 00 55 00 03 A6 00 00 00 67 A4 00 07 A5 01 24 74 00 04 1F D9 C1"
        assert rig.ask(H(HEAD + ask)).hex(" ") == H(HEAD + reply).hex(" ")


def test_a_status_with_a_header_in_its_data_is_stuffed() -> None:
    # Load -1, velocity -3, position 2048, put into plain indirect data.
    with Rig(_one()) as rig:
        servo = rig.servos[0]
        assert servo.write(224, H("FF FF FD FF FF FF 00 08 00 00")) == 0
        answer = rig.ask(read(1, 224, 10))
        expected = "01 0F 00 55 00 FF FF FD FD FF FF FF 00 08 00 00 49 F0"
        assert answer.hex(" ") == H(HEAD + expected).hex(" ")


@pytest.mark.parametrize(
    ("ask", "stored"),
    [
        ("01 0D 00 03 E0 00 FF FF FD FD FF FF FD FD ED B2", "FF FF FD FF FF FD"),
        ("01 0A 00 03 E0 00 FF FF FD FD FD 6F 78", "FF FF FD FD"),
    ],
)
def test_a_stuffed_write_stores_what_was_meant(ask: str, stored: str) -> None:
    with Rig(_one()) as rig:
        assert rig.ask(H(HEAD + ask)) == H(OK_1)
        assert rig.servos[0].read(224, len(H(stored))) == (0, H(stored))


def test_stuffing_at_the_very_end_is_understood_and_the_value_refused_by_range() -> None:
    with Rig(_one()) as rig:
        assert rig.error(H(HEAD + "01 0A 00 03 68 00 00 FF FF FD FD EC 50")) == 4


def test_restore_brings_a_backup_back_and_reboots() -> None:
    with Rig(_one()) as rig:
        restore = H(HEAD + "01 08 00 20 02 43 54 52 4C 9E F5")
        assert rig.error(restore) == 1
        rig.servos[0].write(84, (500).to_bytes(2, "little"))
        rig.ask(H(HEAD + "01 08 00 20 01 43 54 52 4C 16 F5"))
        assert rig.value(1, 147, 1) == 1
        rig.servos[0].write(84, (100).to_bytes(2, "little"))
        assert rig.ask(restore) == H(OK_1)
        assert rig.ask(H(HEAD + "01 03 00 01 19 4E")) == b""
        rig.wait(0.4)
        assert rig.value(1, 84, 2) == 500


def test_the_crc_is_the_documented_one() -> None:
    assert crc16(b"123456789") == 0xFEE8


def test_every_chunking_of_a_stream_gives_the_same_instructions() -> None:
    stream = b"\x00\xff" + b"".join(H(HEAD + row[2]) for row in EXCHANGES[:20]) + b"\xff\xff\xfd"
    whole = FrameFinder().feed(stream)
    assert len(whole) == 20
    finder = FrameFinder()
    bytewise = [p for i in range(len(stream)) for p in finder.feed(stream[i : i + 1])]
    assert [(p.servo_id, p.code, p.params) for p in bytewise] == [
        (p.servo_id, p.code, p.params) for p in whole
    ]
