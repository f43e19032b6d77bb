"""Control table of the board. Written by tools/make_board_table.py; do not edit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Item:
    """One item; writable when `access` is RW, in units of `unit`."""

    address: int
    size: int
    name: str
    access: str
    default: int
    minimum: int
    maximum: int
    unit: str


BOARD_ID: Final = 200
BOARD_MODEL: Final = 60200
BOARD_FIRMWARE: Final = 1
BOARD_PROTOCOL: Final = 0x53CF
TABLE_SIZE: Final = 200

MODEL_NUMBER: Final = Item(0, 2, "MODEL_NUMBER", "R", 60200, 0, 65535, "")
BUILD_HASH: Final = Item(2, 4, "BUILD_HASH", "R", 0, 0, 4294967295, "")
FIRMWARE_VERSION: Final = Item(6, 1, "FIRMWARE_VERSION", "R", 1, 0, 255, "")
ID: Final = Item(7, 1, "ID", "R", 200, 0, 255, "")
BAUD_RATE: Final = Item(8, 1, "BAUD_RATE", "R", 3, 0, 255, "")
RETURN_DELAY_TIME: Final = Item(9, 1, "RETURN_DELAY_TIME", "RW", 0, 0, 254, "2 us")
PROTOCOL_TYPE: Final = Item(13, 1, "PROTOCOL_TYPE", "R", 2, 0, 255, "")
PROTOCOL_VERSION: Final = Item(14, 2, "PROTOCOL_VERSION", "R", 0, 0, 65535, "")
ARM: Final = Item(64, 1, "ARM", "RW", 0, 0, 1, "")
STATUS_RETURN_LEVEL: Final = Item(68, 1, "STATUS_RETURN_LEVEL", "RW", 2, 0, 2, "")
REGISTERED_INSTRUCTION: Final = Item(69, 1, "REGISTERED_INSTRUCTION", "R", 0, 0, 255, "")
FAULTS: Final = Item(70, 1, "FAULTS", "RW", 0, 0, 0, "")
BUS_WATCHDOG: Final = Item(98, 1, "BUS_WATCHDOG", "RW", 255, 0, 127, "20 ms")
OUTPUTS: Final = Item(116, 1, "OUTPUTS", "RW", 0, 0, 1, "")
OUTPUT_STATE: Final = Item(117, 1, "OUTPUT_STATE", "R", 0, 0, 255, "")
HINDRANCES: Final = Item(118, 1, "HINDRANCES", "R", 0, 0, 255, "")
ALERT_ID: Final = Item(119, 1, "ALERT_ID", "R", 255, 0, 255, "")
REALTIME_TICK: Final = Item(120, 2, "REALTIME_TICK", "R", 0, 0, 32767, "ms")
INPUTS: Final = Item(122, 1, "INPUTS", "R", 0, 0, 255, "")
INPUTS_RAW: Final = Item(123, 1, "INPUTS_RAW", "R", 0, 0, 255, "")
BOARD_CLOCK: Final = Item(124, 4, "BOARD_CLOCK", "R", 0, 0, 4294967295, "us")
KNOT_EDGES: Final = Item(128, 2, "KNOT_EDGES", "R", 0, 0, 65535, "")
MOVING_EDGES: Final = Item(130, 2, "MOVING_EDGES", "R", 0, 0, 65535, "")
KNOT_STAMP_0: Final = Item(132, 4, "KNOT_STAMP_0", "R", 0, 0, 4294967295, "us")
KNOT_STAMP_1: Final = Item(136, 4, "KNOT_STAMP_1", "R", 0, 0, 4294967295, "us")
KNOT_STAMP_2: Final = Item(140, 4, "KNOT_STAMP_2", "R", 0, 0, 4294967295, "us")
KNOT_STAMP_3: Final = Item(144, 4, "KNOT_STAMP_3", "R", 0, 0, 4294967295, "us")
MOVING_STAMP: Final = Item(148, 4, "MOVING_STAMP", "R", 0, 0, 4294967295, "us")
STOP_STAMP: Final = Item(152, 4, "STOP_STAMP", "R", 0, 0, 4294967295, "us")
KNOT_RAW_STAMP: Final = Item(156, 4, "KNOT_RAW_STAMP", "R", 0, 0, 4294967295, "us")
KNOT_RAW_EDGES: Final = Item(160, 2, "KNOT_RAW_EDGES", "R", 0, 0, 65535, "")
HOST_CRC_ERRORS: Final = Item(162, 2, "HOST_CRC_ERRORS", "R", 0, 0, 65535, "")
HOST_TORN_FRAMES: Final = Item(164, 2, "HOST_TORN_FRAMES", "R", 0, 0, 65535, "")
HOST_OVERRUNS: Final = Item(166, 2, "HOST_OVERRUNS", "R", 0, 0, 65535, "")
BUS_CRC_ERRORS: Final = Item(168, 2, "BUS_CRC_ERRORS", "R", 0, 0, 65535, "")
BUS_TORN_FRAMES: Final = Item(170, 2, "BUS_TORN_FRAMES", "R", 0, 0, 65535, "")
BUS_OVERRUNS: Final = Item(172, 2, "BUS_OVERRUNS", "R", 0, 0, 65535, "")
BUS_TIMEOUTS: Final = Item(174, 2, "BUS_TIMEOUTS", "R", 0, 0, 65535, "")
WATCHDOG_TRIPS: Final = Item(176, 2, "WATCHDOG_TRIPS", "R", 0, 0, 65535, "")
REFUSED_FRAMES: Final = Item(178, 2, "REFUSED_FRAMES", "R", 0, 0, 65535, "")
RESETS: Final = Item(180, 2, "RESETS", "R", 0, 0, 65535, "")
RESET_CAUSE: Final = Item(182, 2, "RESET_CAUSE", "R", 0, 0, 65535, "")
LONGEST_PASS: Final = Item(184, 2, "LONGEST_PASS", "RW", 0, 0, 0, "us")
STACK_FREE: Final = Item(186, 2, "STACK_FREE", "R", 0, 0, 65535, "bytes")
FRAMES_DOWN: Final = Item(188, 4, "FRAMES_DOWN", "R", 0, 0, 4294967295, "")
FRAMES_UP: Final = Item(192, 4, "FRAMES_UP", "R", 0, 0, 4294967295, "")
UPTIME: Final = Item(196, 4, "UPTIME", "R", 0, 0, 4294967295, "s")

FAULTS_STOP: Final = 0x01
FAULTS_SERVO: Final = 0x02
OUTPUTS_WRIST_OK: Final = 0x01
OUTPUT_STATE_WRIST_OK: Final = 0x01
HINDRANCES_NOT_ARMED: Final = 0x01
HINDRANCES_NOT_ASKED: Final = 0x02
HINDRANCES_NO_WATCHDOG: Final = 0x04
HINDRANCES_SAFE_STATE: Final = 0x08
HINDRANCES_STOP: Final = 0x10
HINDRANCES_SERVO: Final = 0x20
INPUTS_KNOT: Final = 0x01
INPUTS_MOVING: Final = 0x02
INPUTS_STOP: Final = 0x04
RESET_CAUSE_POWER: Final = 0x01
RESET_CAUSE_EXTERNAL: Final = 0x02
RESET_CAUSE_BROWN_OUT: Final = 0x04
RESET_CAUSE_HARDWARE_WATCHDOG: Final = 0x08
RESET_CAUSE_JTAG: Final = 0x10
RESET_CAUSE_ASKED: Final = 0x80

ITEMS: Final = (
    MODEL_NUMBER,
    BUILD_HASH,
    FIRMWARE_VERSION,
    ID,
    BAUD_RATE,
    RETURN_DELAY_TIME,
    PROTOCOL_TYPE,
    PROTOCOL_VERSION,
    ARM,
    STATUS_RETURN_LEVEL,
    REGISTERED_INSTRUCTION,
    FAULTS,
    BUS_WATCHDOG,
    OUTPUTS,
    OUTPUT_STATE,
    HINDRANCES,
    ALERT_ID,
    REALTIME_TICK,
    INPUTS,
    INPUTS_RAW,
    BOARD_CLOCK,
    KNOT_EDGES,
    MOVING_EDGES,
    KNOT_STAMP_0,
    KNOT_STAMP_1,
    KNOT_STAMP_2,
    KNOT_STAMP_3,
    MOVING_STAMP,
    STOP_STAMP,
    KNOT_RAW_STAMP,
    KNOT_RAW_EDGES,
    HOST_CRC_ERRORS,
    HOST_TORN_FRAMES,
    HOST_OVERRUNS,
    BUS_CRC_ERRORS,
    BUS_TORN_FRAMES,
    BUS_OVERRUNS,
    BUS_TIMEOUTS,
    WATCHDOG_TRIPS,
    REFUSED_FRAMES,
    RESETS,
    RESET_CAUSE,
    LONGEST_PASS,
    STACK_FREE,
    FRAMES_DOWN,
    FRAMES_UP,
    UPTIME,
)
