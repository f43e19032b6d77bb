"""One emulated XL430-W250: its instructions, faults, watchdog and power; hears no bytes.

What it does follows the ROBOTIS e-manual, XL430-W250. Where the manual is silent the choice is
named beside the code, and is the one that forgives the host least.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from sphmctl.emulators.control_table import (
    ACCESS_ERROR,
    BACKUP_NAMES,
    DATA_RANGE,
    INSTRUCTION_ERROR,
    ITEMS,
    RAM_START,
    RESULT_FAIL,
    ControlTable,
    Item,
)
from sphmctl.emulators.servo_drive import LIVE_START, POSITION_MODE, TORQUE_BY_GOAL, Drive
from sphmctl.emulators.servo_motor import SLOW_S, Motor
from sphmctl.emulators.servo_profile import STEP_S

BAUD_RATES = (9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""Rates by their code in Baud Rate(8), bit / s."""

ALERT = 0x80
"""Bit of a status that says "read Hardware Error Status(70)" (e-manual, Protocol 2.0, "Error")."""

VOLTAGE_BIT, HEAT_BIT, OVERLOAD_BIT = 0, 2, 5
"""Bits of Hardware Error Status(70) and Shutdown(63) that the emulator sets by itself."""

WATCHDOG_MS = 20
"""One digit of Bus Watchdog(98), ms."""

BOOT_MS = 300
"""Silence after power or reboot, ms: not documented, assumed."""

SLOW_STEPS = round(SLOW_S / STEP_S)
"""Steps between two looks at heat, supply and overload."""

OVERLOAD_SHARE, OVERLOAD_LOOKS = 0.9, 10
"""Load that trips the overload bit, and for how many looks (1 s): not documented, assumed."""

NO_BROADCAST_RESET = 42
"""First firmware that ignores a broadcast reset of everything (e-manual, "Factory Reset")."""

NOTHING = (1, 0)
"""A range without values: every write is refused with a data range error."""

_CLEAR_KEY = b"\x01DXL\x22"
_BACKUP_KEY = b"CTRL"
_STORE, _RESTORE = 1, 2
_KEPT_AT_RESET = {0xFF: (), 0x01: ("id",), 0x02: ("id", "baud_rate")}
_GOALS = frozenset(("goal_pwm", "goal_velocity", "goal_position"))


class Servo:
    """One servo, powered from the start; a world (see `ServoBus`) lets it live.

    Args:
        rng: draws lag, noise and temperature.
        servo_id: ID(7).
        start_ticks: true shaft angle at first, pulses.
        baud_code: Baud Rate(8); the factory's is 1 (57,600), the cell's 3 (1 M).
        return_delay: Return Delay Time(9), 2 us; the factory's is 250, the cell's 0.
        model: Model Number(0).
        firmware: Firmware Version(6).
    """

    def __init__(
        self,
        rng: random.Random,
        servo_id: int = 1,
        start_ticks: float = 2048.0,
        *,
        baud_code: int = 3,
        return_delay: int = 0,
        model: int = 1060,
        firmware: int = 46,
    ) -> None:
        self.index = 0
        self.powered = True
        self.table = ControlTable(self._limits)
        for name, value in (
            ("id", servo_id),
            ("baud_rate", baud_code),
            ("return_delay_time", return_delay),
            ("model_number", model),
            ("firmware_version", firmware),
        ):
            self.table[name] = value
        self._memory = self.table.memory
        self._motor = Motor(float(start_ticks), rng)
        self._drive = Drive(self.table, self._motor)
        self._backup: dict[str, int] | None = None
        self._registered: tuple[int, bytes] | None = None
        self._hooks: dict[str, Callable[[int], None]] = {
            "torque_enable": self._on_torque,
            "goal_position": self._on_goal,
            "goal_pwm": lambda _: self._drive.adopt(),
            "position_p_gain": lambda _: self._drive.adopt(),
            "operating_mode": self._drive.change_mode,
            "drive_mode": lambda _: self._drive.reframe(fold=self._drive.mode == POSITION_MODE),
            "homing_offset": lambda _: self._drive.reframe(fold=False),
            "bus_watchdog": self._on_watchdog,
        }
        self._boot()
        self._silent_until = 0

    # What the bus asks -------------------------------------------------------------------------

    @property
    def id(self) -> int:
        """ID(7)."""
        return self._memory[7]

    @property
    def secondary_id(self) -> int:
        """Secondary ID(12): a group that obeys without answering; above 252 none."""
        return self._memory[12]

    @property
    def firmware(self) -> int:
        """Firmware Version(6)."""
        return self._memory[6]

    @property
    def baud(self) -> int:
        """The rate it listens at, bit / s."""
        return BAUD_RATES[self._memory[8]]

    @property
    def return_delay_s(self) -> float:
        """Return Delay Time(9), s."""
        return self._memory[9] * 2e-6

    @property
    def return_level(self) -> int:
        """Status Return Level(68)."""
        return self._memory[68]

    @property
    def alert(self) -> int:
        """The alert bit for a status."""
        return ALERT if self._memory[70] else 0

    @property
    def listening(self) -> bool:
        """Whether it has power and is not booting."""
        return self.powered and self.index >= self._silent_until

    def hear(self) -> None:
        """Note an instruction on the bus.

        The e-manual leaves open whose packets feed Bus Watchdog(98); here every valid instruction
        packet at the servo's rate does, whomever it addresses.
        """
        self._fed = self.index

    def read(self, address: int, size: int) -> tuple[int, bytes]:
        """Error number and table bytes."""
        if address + size > LIVE_START:
            self._drive.publish(self.index, self.index - self._born)
        return self.table.read(address, size)

    def write(self, address: int, data: bytes, *, as_group: bool = False) -> int:
        """Store all of `data` and act on it, or nothing; error number."""
        error, changes = self._check(address, data, as_group=as_group)
        if error:
            return error
        for item, value in changes:
            self.table[item.name] = value
        for item, value in changes:
            hook = self._hooks.get(item.name)
            if hook is not None:
                hook(value)
        return 0

    def register(self, address: int, data: bytes, *, as_group: bool = False) -> int:
        """Keep a write for `action`; error number."""
        error, _ = self._check(address, data, as_group=as_group)
        if not error:
            self._registered = (address, data)
            self._memory[69] = 1
        return error

    def action(self) -> int:
        """Do the registered write; error number."""
        if self._registered is None:
            return INSTRUCTION_ERROR
        address, data = self._registered
        self._registered = None
        self._memory[69] = 0
        return self.write(address, data)

    def reboot(self) -> int:
        """Start anew: silence, then RAM defaults, torque off and no errors."""
        self._boot()
        return 0

    def factory_reset(self, params: bytes, *, broadcast: bool) -> int:
        """Defaults everywhere but for what `params` keeps; error number."""
        if len(params) != 1 or params[0] not in _KEPT_AT_RESET:
            return DATA_RANGE
        if broadcast and params[0] == 0xFF and self.firmware >= NO_BROADCAST_RESET:
            return DATA_RANGE
        self.table.reset(eeprom=True, keep=_KEPT_AT_RESET[params[0]])
        self._boot()
        return 0

    def clear(self, params: bytes) -> int:
        """Fold the position to one turn, at rest only; error number."""
        if params != _CLEAR_KEY:
            return DATA_RANGE
        if self._drive.moving:
            return RESULT_FAIL
        self._drive.reframe(fold=True)
        self.table["goal_position"] = round(self._motor.position)
        return 0

    def back_up(self, params: bytes) -> int:
        """Store or restore EEPROM, gains, profile and indirect addresses; error number."""
        if len(params) != 5 or params[0] not in (_STORE, _RESTORE) or params[1:] != _BACKUP_KEY:
            return DATA_RANGE
        if self._drive.torque or (params[0] == _RESTORE and self._backup is None):
            return RESULT_FAIL
        if params[0] == _STORE:
            names = [item.name for item in ITEMS if item.writable and item.address < RAM_START]
            self._backup = {name: self.table[name] for name in (*names, *BACKUP_NAMES)}
            self._memory[147] = 1
        else:
            self._boot()
            for name, value in (self._backup or {}).items():
                self.table[name] = value
            self._drive.start()
        return 0

    # What the cell does to it ------------------------------------------------------------------

    @property
    def true_ticks(self) -> float:
        """True shaft angle in the shaft's own sense, pulses, never folded."""
        return self._drive.true_ticks

    def unplug(self) -> None:
        """Cut power and bus: silent, limp, RAM lost."""
        self.powered = False
        self._drive.limp()

    def plug(self) -> None:
        """Give power back: it boots."""
        self.powered = True
        self._boot()

    def set_voltage(self, volts: float) -> None:
        """Set the supply, V."""
        self._motor.supply_v = volts

    def set_temperature(self, celsius: float) -> None:
        """Set the temperature, degC; from there it goes its own way."""
        self._motor.temperature_c = celsius

    def push(self, load: float) -> None:
        """Press on the shaft with `load` (share of stall torque, -1 to 1) until told otherwise."""
        self._motor.press(load)

    def turn_by_hand(self, ticks: float) -> None:
        """Turn the shaft by `ticks` in its own sense, which works while torque is off."""
        if not self._drive.torque:
            self._drive.turn_by_hand(ticks)

    def raise_error(self, bit: int) -> None:
        """Latch a bit of Hardware Error Status(70); torque goes when Shutdown(63) has it too."""
        self._memory[70] |= 1 << bit
        if self._shut_down:
            self._drive.limp()

    def step(self, index: int) -> None:
        """Live on to grid instant `index` (1 ms each)."""
        self.index = index
        if index % SLOW_STEPS == 0:
            self._supervise()
        if self._drive.torque:
            if self._watchdog_ms and index - self._fed > self._watchdog_ms:
                self._trip()
            self._drive.step()

    # Inside ------------------------------------------------------------------------------------

    @property
    def _shut_down(self) -> bool:
        return bool(self._memory[70] & self._memory[63])

    def _check(
        self, address: int, data: bytes, *, as_group: bool
    ) -> tuple[int, list[tuple[Item, int]]]:
        error, changes = self.table.check(address, data)
        if as_group and any(item.address < RAM_START for item, _ in changes):
            return ACCESS_ERROR, []  # e-manual, "Secondary(Shadow) ID(12)": no EEPROM by group
        return error, changes

    def _limits(self, item: Item) -> tuple[int, int]:
        """What `item` may be now; torque of a shut down servo is refused by range (a choice)."""
        table, name = self.table, item.name
        refused = (name in _GOALS and self._tripped) or (
            name == "torque_enable" and self._shut_down
        )
        if refused:
            return (0, 0) if name == "torque_enable" else NOTHING
        if name == "goal_position" and self._drive.mode == POSITION_MODE:
            return table["min_position_limit"], table["max_position_limit"]
        if name == "goal_velocity":
            return -table["velocity_limit"], table["velocity_limit"]
        if name == "goal_pwm":
            return -table["pwm_limit"], table["pwm_limit"]
        if name in ("profile_velocity", "profile_acceleration") and self._drive.time_based:
            return 0, 32_737
        if name == "bus_watchdog" and self._tripped:
            return 0, 0
        return item.low, item.high

    def _boot(self) -> None:
        self._tripped = False
        self._watchdog_ms = self._fed = self._overloaded = 0
        self._registered = None
        self._born = self.index
        self._silent_until = self.index + BOOT_MS
        table = self.table
        table.reset(eeprom=False)
        self._memory[147] = self._backup is not None
        table["goal_pwm"] = table["pwm_limit"]
        if table["startup_configuration"] & 2 and self._backup is not None:
            for name in BACKUP_NAMES:
                table[name] = self._backup[name]
        self._drive.start()
        if table["startup_configuration"] & 1:
            self._on_torque(1)

    def _on_torque(self, value: int) -> None:
        if value:
            self._fed = self.index
            self._drive.energize()
        else:
            self._drive.limp()

    def _on_goal(self, _: int) -> None:
        if self._drive.torque:
            self._drive.aim()
        elif self._memory[10] & TORQUE_BY_GOAL and not self._shut_down:
            self._on_torque(1)

    def _on_watchdog(self, value: int) -> None:
        self._tripped = False
        self._watchdog_ms = value * WATCHDOG_MS
        self._fed = self.index

    def _trip(self) -> None:
        """Bus Watchdog(98): stop and hold, no profile, no goals until 0 is written to it.

        That torque stays on and Goal Position(116) keeps its value are choices.
        """
        self._tripped = True
        self._watchdog_ms = 0
        self.table["bus_watchdog"] = -1
        self._drive.stop()

    def _supervise(self) -> None:
        """Look at heat, supply and load as the firmware does, ten times a second."""
        motor = self._motor
        motor.warm()
        if not self.powered:
            return
        table = self.table
        if motor.temperature_c > table["temperature_limit"]:
            self.raise_error(HEAT_BIT)
        tenths = round(motor.voltage_v * 10)
        if not table["min_voltage_limit"] <= tenths <= table["max_voltage_limit"]:
            self.raise_error(VOLTAGE_BIT)
        loaded = abs(motor.torque) >= OVERLOAD_SHARE
        self._overloaded = self._overloaded + 1 if loaded else 0
        if self._overloaded >= OVERLOAD_LOOKS:
            self.raise_error(OVERLOAD_BIT)
