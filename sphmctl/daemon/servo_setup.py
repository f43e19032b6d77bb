"""How a servo of the wrist has to be set up: the items, their values, and why. No bus.

Addresses, sizes and defaults: ROBOTIS e-manual, XL430-W250, "Control Table of EEPROM Area".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sphmctl.config import Cell
from sphmctl.drivers import xl430

LIMIT_MARGIN_TICKS = 11
"""How far the position limits lie outside the cranks' range: 1 degree, so that a goal that is
rounded, or a cell file measured a little anew, is not refused."""

FAST_FIRMWARE = 45
"""First firmware with Startup Configuration (60), fast reads and backup (e-manual)."""


@dataclass(frozen=True)
class Setting:
    """One EEPROM item and the value it needs.

    Attributes:
        name: as the e-manual has it.
        value: in the item's unit; two's complement when negative.
        why: in words.
        since: firmware that has it first.
    """

    name: str
    address: int
    size: int
    value: int
    why: str
    since: int = 0

    @property
    def data(self) -> bytes:
        """The value as it is written."""
        return self.value.to_bytes(self.size, "little", signed=self.value < 0)


def settings(limits_ticks: tuple[int, int]) -> tuple[Setting, ...]:
    """What a servo needs beside id and rate, in the order of writing.

    Args:
        limits_ticks: Min and Max Position Limit.
    """
    low, high = limits_ticks
    return (
        Setting("Return Delay Time", 9, 1, 0, "answers at once; 250 would cost 0.5 ms a servo"),
        Setting("Drive Mode", 10, 1, 0, "normal sense, velocity-based profile"),
        Setting("Operating Mode", 11, 1, xl430.POSITION_MODE, "position control within one turn"),
        Setting("Secondary ID", 12, 1, 255, "obeys under its own id only"),
        Setting("Homing Offset", 20, 4, 0, "the cell file's zero_ticks does that"),
        Setting("PWM Limit", 36, 2, 885, "full torque, the factory's value"),
        Setting("Velocity Limit", 44, 4, 265, "60.7 rpm, the factory's value"),
        Setting("Max Position Limit", 48, 4, high, "the crank's range and 1 degree"),
        Setting("Min Position Limit", 52, 4, low, "the crank's range and 1 degree"),
        Setting("Startup Configuration", 60, 1, 0, "no torque at power-up", FAST_FIRMWARE),
        Setting("Shutdown", 63, 1, 0x34, "torque off at overheating, shock and overload"),
    )


def limits_ticks(cell: Cell, leg: int) -> tuple[int, int]:
    """Position limits of the servo of leg 0..2, from the cell's mounting and crank range."""
    zero, sense = cell.wrist.zero_ticks[leg], cell.wrist.direction[leg]
    ends = [zero + sense * crank / xl430.RAD_PER_COUNT for crank in cell.ranges_rad[6 + leg]]
    low = math.floor(min(ends)) - LIMIT_MARGIN_TICKS
    high = math.ceil(max(ends)) + LIMIT_MARGIN_TICKS
    return max(0, low), min(xl430.COUNTS_PER_TURN - 1, high)
