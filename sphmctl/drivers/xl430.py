"""The XL430-W250's control table as the wrist uses it, and its units. From the ROBOTIS e-manual."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

MODEL = 1060
MIN_FIRMWARE = 42
"""The oldest whose control table and error handling the e-manual describes as used here."""

COUNTS_PER_TURN = 4096
RAD_PER_COUNT = 2.0 * math.pi / COUNTS_PER_TURN
VELOCITY_UNIT_RAD_S = 0.229 * 2.0 * math.pi / 60.0
POSITION_MODE = 3
STATUS_ALL = 2

RETURN_DELAY = 9
DRIVE_MODE = 10
OPERATING_MODE = 11
HOMING_OFFSET = 20
MAX_POSITION = 48
TORQUE_ENABLE = 64
STATUS_RETURN_LEVEL = 68
HARDWARE_ERROR = 70
BUS_WATCHDOG = 98
PROFILE_ACCELERATION = 108
GOAL_POSITION = 116
PRESENT_POSITION = 132
INDIRECT_ADDRESS_1 = 168
INDIRECT_DATA_1 = 224

TELEMETRY = (
    (64, 1),  # torque enable
    (70, 1),  # hardware error status
    (98, 1),  # bus watchdog
    (122, 1),  # moving
    (123, 1),  # moving status
    (126, 2),  # present load
    (128, 4),  # present velocity
    (132, 4),  # present position
    (144, 2),  # present input voltage
    (146, 1),  # present temperature
)
"""What each cycle reads, gathered by indirect addresses into one block."""

TELEMETRY_FORMAT = struct.Struct("<BBbBBhiiHB")

HARDWARE_ERRORS = {
    0: "input voltage",
    2: "overheating",
    3: "encoder",
    4: "electrical shock",
    5: "overload",
}
"""Bits of Hardware Error Status (70)."""

WATCHDOG_TRIPPED = -1


@dataclass(frozen=True)
class Telemetry:
    """One servo's block, in its own units."""

    torque: int
    hardware_error: int
    watchdog: int
    moving: int
    moving_status: int
    load_permille: int
    velocity_units: int
    position_ticks: int
    voltage_dv: int
    temperature_c: int


def telemetry_map() -> bytes:
    """What to write to Indirect Address 1 so that Indirect Data 1 shows TELEMETRY."""
    addresses = [start + i for start, size in TELEMETRY for i in range(size)]
    return struct.pack(f"<{len(addresses)}H", *addresses)


def parse_telemetry(data: bytes) -> Telemetry:
    """The block that `telemetry_map` arranges; `data` has TELEMETRY_FORMAT.size bytes."""
    return Telemetry(*TELEMETRY_FORMAT.unpack(data))


def hardware_error_text(bits: int) -> str:
    """The errors of a Hardware Error Status, in words."""
    names = [name for bit, name in HARDWARE_ERRORS.items() if bits >> bit & 1]
    return ", ".join(names) or f"bits 0x{bits:02x}"
