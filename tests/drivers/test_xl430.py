"""The control table as the wrist uses it: addresses, units and the telemetry block.

Values by hand from the ROBOTIS e-manual, "XL430-W250".
"""

from __future__ import annotations

import math
import struct

import pytest

from sphmctl.drivers import xl430


def test_units_are_those_of_the_e_manual() -> None:
    assert pytest.approx(0.0878906, rel=1e-5) == math.degrees(xl430.RAD_PER_COUNT)
    # The SDK's model file says 0.0239691 rad/s for 0.229 rpm, from a rounded pi.
    assert pytest.approx(0.0239808, rel=1e-4) == xl430.VELOCITY_UNIT_RAD_S


def test_addresses_are_those_of_the_e_manual() -> None:
    assert (xl430.TORQUE_ENABLE, xl430.STATUS_RETURN_LEVEL, xl430.HARDWARE_ERROR) == (64, 68, 70)
    assert (xl430.BUS_WATCHDOG, xl430.PROFILE_ACCELERATION) == (98, 108)
    assert (xl430.GOAL_POSITION, xl430.PRESENT_POSITION) == (116, 132)
    assert (xl430.INDIRECT_ADDRESS_1, xl430.INDIRECT_DATA_1) == (168, 224)
    assert (xl430.RETURN_DELAY, xl430.DRIVE_MODE, xl430.OPERATING_MODE) == (9, 10, 11)
    assert (xl430.HOMING_OFFSET, xl430.MAX_POSITION, xl430.MODEL) == (20, 48, 1060)


def test_the_telemetry_map_names_each_byte_of_the_block_once_in_order() -> None:
    wanted = [64, 70, 98, 122, 123, 126, 127, *range(128, 136), 144, 145, 146]
    assert list(struct.unpack("<18H", xl430.telemetry_map())) == wanted
    assert xl430.TELEMETRY_FORMAT.size == 18
    # More than 28 indirect addresses do not stand in one piece.
    assert len(wanted) <= 28


def test_the_telemetry_block_is_read_with_its_signs() -> None:
    block = bytes.fromhex("01 20 FF 01 03 FF FF FD FF FF FF 00 08 00 00 78 00 23")
    telemetry = xl430.parse_telemetry(block)
    assert telemetry == xl430.Telemetry(1, 0x20, -1, 1, 3, -1, -3, 2048, 120, 35)
    assert telemetry.watchdog == xl430.WATCHDOG_TRIPPED


@pytest.mark.parametrize(
    ("bits", "text"),
    [
        (0x01, "input voltage"),
        (0x04, "overheating"),
        (0x08, "encoder"),
        (0x10, "electrical shock"),
        (0x20, "overload"),
        (0x21, "input voltage, overload"),
        (0x40, "bits 0x40"),
    ],
)
def test_hardware_errors_have_names(bits: int, text: str) -> None:
    assert xl430.hardware_error_text(bits) == text
