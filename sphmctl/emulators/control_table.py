"""The control table of an XL430-W250: items, storage, indirect addresses, access rules; no physics.

Addresses, sizes, defaults and ranges: ROBOTIS e-manual, XL430-W250, "Control Table of EEPROM Area"
and "Control Table of RAM Area". Error numbers: e-manual, Protocol 2.0, "Error".
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

RESULT_FAIL = 1
INSTRUCTION_ERROR = 2
DATA_RANGE = 4
DATA_LENGTH = 5
ACCESS_ERROR = 7

TABLE_BYTES = 662
"""One past the last address, indirect data 56 at 661."""

RAM_START = 64
"""Addresses below are EEPROM: kept without power, locked while torque is on."""

INDIRECT = ((168, 224), (578, 634))
"""Starts of the two banks of indirect addresses (2 bytes each) and of their data (1 byte each)."""

BANK_SLOTS = 28
"""Slots per bank."""

INDIRECT_LOW, INDIRECT_HIGH = 64, 661
"""What an indirect address may point at."""


@dataclass(frozen=True)
class Item:
    """One row of the table; `low` and `high` are inclusive, `choices` replaces them when given."""

    name: str
    address: int
    size: int
    writable: bool
    default: int
    low: int
    high: int
    choices: tuple[int, ...] = ()

    @property
    def signed(self) -> bool:
        """Whether its values are two's complement."""
        return self.low < 0

    def allows(self, value: int) -> bool:
        """Whether the fixed range has `value`."""
        return value in self.choices if self.choices else self.low <= value <= self.high


def _read_only(name: str, address: int, size: int, low: int = 0) -> Item:
    return Item(name, address, size, False, 0, low, (1 << (8 * size)) - 1)


def _slots() -> list[Item]:
    items = []
    for bank, (addresses, data) in enumerate(INDIRECT):
        for slot in range(BANK_SLOTS):
            number = bank * BANK_SLOTS + slot + 1
            at, to = addresses + 2 * slot, data + slot
            items.append(
                Item(f"indirect_address_{number}", at, 2, True, to, INDIRECT_LOW, INDIRECT_HIGH)
            )
            items.append(Item(f"indirect_data_{number}", to, 1, True, 0, 0, 255))
    return items


ITEMS = (
    _read_only("model_number", 0, 2),
    _read_only("model_information", 2, 4),
    _read_only("firmware_version", 6, 1),
    Item("id", 7, 1, True, 1, 0, 252),
    Item("baud_rate", 8, 1, True, 1, 0, 7),
    Item("return_delay_time", 9, 1, True, 250, 0, 254),
    Item("drive_mode", 10, 1, True, 0, 0, 13),
    Item("operating_mode", 11, 1, True, 3, 1, 16, choices=(1, 3, 4, 16)),
    Item("secondary_id", 12, 1, True, 255, 0, 255),
    Item("protocol_type", 13, 1, True, 2, 2, 2),
    Item("homing_offset", 20, 4, True, 0, -1_044_479, 1_044_479),
    Item("moving_threshold", 24, 4, True, 10, 0, 1023),
    Item("temperature_limit", 31, 1, True, 72, 0, 100),
    Item("max_voltage_limit", 32, 2, True, 140, 60, 140),
    Item("min_voltage_limit", 34, 2, True, 60, 60, 140),
    Item("pwm_limit", 36, 2, True, 885, 0, 885),
    Item("velocity_limit", 44, 4, True, 265, 0, 1023),
    Item("max_position_limit", 48, 4, True, 4095, 0, 4095),
    Item("min_position_limit", 52, 4, True, 0, 0, 4095),
    Item("startup_configuration", 60, 1, True, 0, 0, 3),
    Item("shutdown", 63, 1, True, 52, 0, 63),
    Item("torque_enable", 64, 1, True, 0, 0, 1),
    Item("led", 65, 1, True, 0, 0, 1),
    Item("status_return_level", 68, 1, True, 2, 0, 2),
    _read_only("registered_instruction", 69, 1),
    _read_only("hardware_error_status", 70, 1),
    Item("velocity_i_gain", 76, 2, True, 1000, 0, 16383),
    Item("velocity_p_gain", 78, 2, True, 100, 0, 16383),
    Item("position_d_gain", 80, 2, True, 4000, 0, 16383),
    Item("position_i_gain", 82, 2, True, 0, 0, 16383),
    Item("position_p_gain", 84, 2, True, 640, 0, 16383),
    Item("feedforward_2nd_gain", 88, 2, True, 0, 0, 16383),
    Item("feedforward_1st_gain", 90, 2, True, 0, 0, 16383),
    Item("bus_watchdog", 98, 1, True, 0, -1, 127, choices=tuple(range(128))),
    Item("goal_pwm", 100, 2, True, 885, -885, 885),
    Item("goal_velocity", 104, 4, True, 0, -1023, 1023),
    Item("profile_acceleration", 108, 4, True, 0, 0, 32767),
    Item("profile_velocity", 112, 4, True, 0, 0, 32767),
    Item("goal_position", 116, 4, True, 0, -1_048_575, 1_048_575),
    _read_only("realtime_tick", 120, 2),
    _read_only("moving", 122, 1),
    _read_only("moving_status", 123, 1),
    _read_only("present_pwm", 124, 2, low=-885),
    _read_only("present_load", 126, 2, low=-1000),
    _read_only("present_velocity", 128, 4, low=-(1 << 31)),
    _read_only("present_position", 132, 4, low=-(1 << 31)),
    _read_only("velocity_trajectory", 136, 4, low=-(1 << 31)),
    _read_only("position_trajectory", 140, 4, low=-(1 << 31)),
    _read_only("present_input_voltage", 144, 2),
    _read_only("present_temperature", 146, 1),
    _read_only("backup_ready", 147, 1),
    *_slots(),
)
_CODECS = {
    item.name: (struct.Struct("<" + (" bh i" if item.signed else " BH I")[item.size]), item.address)
    for item in ITEMS
}
_ITEM_AT = {item.address: item for item in ITEMS}
_DEFINED = frozenset(at for item in ITEMS for at in range(item.address, item.address + item.size))
_DATA_TO_ADDRESS = {
    data + slot: addresses + 2 * slot for addresses, data in INDIRECT for slot in range(BANK_SLOTS)
}

BACKUP_NAMES = tuple(
    item.name
    for item in ITEMS
    if item.address >= RAM_START
    and (76 <= item.address <= 91 or item.address in (108, 112) or "address" in item.name)
)
"""RAM in the backup beside the EEPROM: gains, profile, pointers ("Control Table Backup")."""


class ControlTable:
    """The bytes of one servo.

    Args:
        limits: what an item may be now, where other items or the servo's state narrow it.
    """

    def __init__(self, limits: Callable[[Item], tuple[int, int]]) -> None:
        self.memory = bytearray(TABLE_BYTES)
        self._limits = limits
        for item in ITEMS:
            self[item.name] = item.default

    def __getitem__(self, name: str) -> int:
        codec, address = _CODECS[name]
        value: int = codec.unpack_from(self.memory, address)[0]
        return value

    def __setitem__(self, name: str, value: int) -> None:
        codec, address = _CODECS[name]
        codec.pack_into(self.memory, address, value)

    def reset(self, *, eeprom: bool, keep: tuple[str, ...] = ()) -> None:
        """Set the RAM, and on request the writable EEPROM too, to its defaults but for `keep`."""
        for item in ITEMS:
            is_rom = item.address < RAM_START
            if item.name not in keep and ((eeprom and item.writable) if is_rom else True):
                self[item.name] = item.default

    def read(self, address: int, size: int) -> tuple[int, bytes]:
        """Error number and bytes; gaps between items read as 0, the end of the table is an error.

        ROBOTIS' own tools read the table in blocks across its gaps, so that only a block which
        starts outside every item, or runs off the table, is refused.
        """
        end = address + size
        if size < 1 or end > TABLE_BYTES or address not in _DEFINED:
            return ACCESS_ERROR, b""
        if end <= INDIRECT[0][1]:
            return 0, bytes(self.memory[address:end])
        return 0, bytes(self.memory[self._resolve(at)] for at in range(address, end))

    def check(self, address: int, data: bytes) -> tuple[int, list[tuple[Item, int]]]:
        """Error number and the items that writing `data` would set; stores nothing.

        One refused item refuses the whole write.
        """
        if not data or address + len(data) > TABLE_BYTES:
            return (DATA_LENGTH if not data else ACCESS_ERROR), []
        changes: list[tuple[Item, int]] = []
        for start, part in self._runs(address, data):
            error = self._split(start, part, changes)
            if error:
                return error, []
        return 0, changes

    def _resolve(self, address: int) -> int:
        """Where a byte really lives: indirect data stands for the byte its address points at.

        One step only: data that points at indirect data (as all do at first) is plain memory.
        """
        pointer = _DATA_TO_ADDRESS.get(address)
        if pointer is None:
            return address
        return int.from_bytes(self.memory[pointer : pointer + 2], "little")

    def _runs(self, address: int, data: bytes) -> list[tuple[int, bytes]]:
        """The write as stretches of consecutive true addresses."""
        if address + len(data) <= INDIRECT[0][1]:
            return [(address, data)]
        places = [self._resolve(at) for at in range(address, address + len(data))]
        cuts = [i for i in range(1, len(places)) if places[i] != places[i - 1] + 1]
        edges = [0, *cuts, len(places)]
        return [(places[begin], data[begin:end]) for begin, end in pairwise(edges)]

    def _split(self, address: int, data: bytes, changes: list[tuple[Item, int]]) -> int:
        """Append the items that `data` sets from `address` on, or return the error number."""
        torque = self.memory[RAM_START]
        done = 0
        while done < len(data):
            item = _ITEM_AT.get(address + done)
            if item is None or not item.writable:
                return ACCESS_ERROR
            # ROBOTIS' indirect address example wants torque off for indirect addresses as well.
            if torque and (item.address < RAM_START or item.name.startswith("indirect_address")):
                return ACCESS_ERROR
            raw = data[done : done + item.size]
            if len(raw) < item.size:
                return DATA_LENGTH
            value = int.from_bytes(raw, "little", signed=item.signed)
            low, high = self._limits(item)
            if not (item.allows(value) and low <= value <= high):
                return DATA_RANGE
            changes.append((item, value))
            done += item.size
        return 0
