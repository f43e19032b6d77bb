"""The drive of one XL430: control table and motor joined by operating mode, sense and torque.

ROBOTIS e-manual, XL430-W250. Where it is silent the choice is named beside the code. Faults,
watchdog and instructions are not here.
"""

from __future__ import annotations

import math
import struct

from sphmctl.emulators.control_table import ITEMS, ControlTable
from sphmctl.emulators.servo_motor import FULL_PWM, FULL_SPEED, NOMINAL_V, Motor
from sphmctl.emulators.servo_profile import STEP_S

TURN = 4096
"""Pulses per turn (e-manual, "Resolution")."""

VELOCITY_UNIT = 0.229 * TURN / 60
"""One digit of a velocity, pulses / s (0.229 rpm; e-manual, "Profile Velocity(112)")."""

ACCELERATION_UNIT = 214.577 * TURN / 3600
"""One digit of an acceleration, pulses / s^2 (214.577 rev/min^2; "Profile Acceleration(108)")."""

VELOCITY_MODE, POSITION_MODE, EXTENDED_MODE, PWM_MODE = 1, 3, 4, 16
"""Values of Operating Mode(11)."""

REVERSE, TIME_BASED, TORQUE_BY_GOAL = 1, 4, 8
"""Bits of Drive Mode(10)."""

HOMING_LIMIT = 1024
"""Homing Offset(20) that position mode honours, pulses (e-manual, "Homing Offset(20)")."""

IN_POSITION = 10
"""Error within which Moving Status(123) bit 0 is set, pulses: not documented, assumed."""

FOLLOWING_ERROR = 200
"""Error beyond which Moving Status(123) bit 3 is set, pulses: not documented, assumed."""

LIVE_START = 120
"""First of the read-only items that change by themselves, Realtime Tick(120)."""

_LIVE = struct.Struct("<HBBhhiiiiHB")  # to Present Temperature(146)
_DRIVE_MODE, _TORQUE_ENABLE = 10, 64


class Drive:
    """Turns goals into motion, and motion into what the servo reports."""

    def __init__(self, table: ControlTable, motor: Motor) -> None:
        self.table = table
        self.motor = motor
        self.mode = POSITION_MODE
        self.torque = False
        self._memory = table.memory
        self._sense, self._turns, self._offset = 1, 0.0, 0.0
        self._speed = 0.0

    @property
    def true_ticks(self) -> float:
        """Shaft angle in the shaft's own sense, pulses, never folded."""
        return self._sense * (self.motor.position - self._offset)

    @property
    def time_based(self) -> bool:
        """Whether profiles are given by time."""
        return bool(self._memory[_DRIVE_MODE] & TIME_BASED)

    @property
    def by_position(self) -> bool:
        """Whether the mode has a position goal."""
        return self.mode in (POSITION_MODE, EXTENDED_MODE)

    @property
    def moving(self) -> bool:
        """Moving(122): faster than Moving Threshold(24), or a profile goes on."""
        slow = self.table["moving_threshold"] * VELOCITY_UNIT
        return self.motor.profile.active or abs(self.motor.velocity) > slow

    def turn_by_hand(self, ticks: float) -> None:
        """Turn the limp shaft by `ticks` in its own sense."""
        self.motor.position += self._sense * ticks
        self.motor.profile.hold(self.motor.position)

    def start(self) -> None:
        """Take over the table after power up: torque off, position folded, goal where it stands."""
        self.mode = self.table["operating_mode"]
        self._speed = 0.0
        self.limp()
        self.adopt()
        self.reframe(fold=True)
        self.table["goal_position"] = round(self.motor.position)

    def change_mode(self, mode: int) -> None:
        """Gains, goals and profile to their defaults (e-manual, "Operating Mode(11)")."""
        self.mode = mode
        table = self.table
        for item in ITEMS:
            if 76 <= item.address <= 91 or item.address in (104, 108, 112):
                table[item.name] = item.default
        table["goal_pwm"] = table["pwm_limit"]
        self.adopt()
        self.reframe(fold=mode == POSITION_MODE)
        table["goal_position"] = round(self.motor.position)

    def adopt(self) -> None:
        """Hand the motor what it keeps of the table."""
        self.motor.p_gain = self.table["position_p_gain"]
        self.motor.pwm_share = abs(self.table["goal_pwm"]) / FULL_PWM

    def reframe(self, *, fold: bool) -> None:
        """Count the same shaft angle anew: sense, offset, and on request within one turn."""
        true = self.true_ticks
        self._sense = -1 if self._memory[_DRIVE_MODE] & REVERSE else 1
        if fold:
            self._turns = -math.floor(self._sense * true / TURN) * float(TURN)
        homing = self.table["homing_offset"]
        if self.mode == POSITION_MODE:
            homing = max(-HOMING_LIMIT, min(HOMING_LIMIT, homing))
        self._offset = self._turns + homing
        self.motor.position = self._sense * true + self._offset
        self.motor.profile.hold(self.motor.position)

    def energize(self) -> None:
        """Torque on: the shaft goes to whatever Goal Position(116) still holds (a choice)."""
        if self.torque:
            return
        self.torque = self.motor.driven = True
        self._memory[_TORQUE_ENABLE] = 1
        self._speed = 0.0
        self.reframe(fold=self.mode == POSITION_MODE)
        self.aim()

    def limp(self) -> None:
        """Torque off: the shaft stays where it is."""
        self.torque = False
        self._memory[_TORQUE_ENABLE] = 0
        self.motor.let_go()
        self.motor.profile.hold(self.motor.position)

    def aim(self) -> None:
        """Plan the way to Goal Position(116)."""
        if not (self.torque and self.by_position):
            return
        table = self.table
        goal, profile = table["goal_position"], self.motor.profile
        velocity, acceleration = table["profile_velocity"], table["profile_acceleration"]
        if self.time_based:
            profile.go_timed(goal, velocity * 1e-3, acceleration * 1e-3)
        else:
            profile.go(goal, velocity * VELOCITY_UNIT, acceleration * ACCELERATION_UNIT)

    def stop(self) -> None:
        """Stop where it is and hold; the profile's limits are gone afterwards."""
        table = self.table
        table["profile_velocity"] = table["profile_acceleration"] = table["goal_velocity"] = 0
        if self.mode == PWM_MODE:
            table["goal_pwm"] = 0
        self._speed = 0.0
        self.motor.profile.hold(self.motor.position)

    def step(self) -> None:
        """Go on by 1 ms; torque is on."""
        if self.mode == POSITION_MODE or self.mode == EXTENDED_MODE:
            self.motor.follow()
        elif self.mode == PWM_MODE:
            motor = self.motor
            duty = self.table["goal_pwm"] / FULL_PWM
            motor.turn(duty * FULL_SPEED * motor.supply_v / NOMINAL_V)
        else:
            goal = self.table["goal_velocity"] * VELOCITY_UNIT
            ramp = self.table["profile_acceleration"] * ACCELERATION_UNIT * STEP_S or math.inf
            self._speed += max(-ramp, min(ramp, goal - self._speed))
            self.motor.turn(self._speed)

    def publish(self, index: int, age_ms: int) -> None:
        """Write the live items as they are at grid instant `index`."""
        motor, profile = self.motor, self.motor.profile
        torque, by_position = self.torque, self.by_position
        pwm = self.table["goal_pwm"] if self.mode == PWM_MODE else motor.duty * FULL_PWM
        _LIVE.pack_into(
            self._memory,
            LIVE_START,
            age_ms % 32_768,
            self.moving,
            self._moving_status(),
            round(pwm) if torque else 0,
            round(motor.load(index) * 1000) if torque else 0,
            round(motor.velocity / VELOCITY_UNIT),
            round(motor.position),
            round((profile.velocity if by_position else self._speed) / VELOCITY_UNIT),
            round(profile.position if by_position else motor.position),
            max(0, round(motor.voltage_v * 10)),
            max(0, min(255, round(motor.temperature_c))),
        )

    def _moving_status(self) -> int:
        motor, profile = self.motor, self.motor.profile
        arrived = not profile.active and abs(profile.goal - motor.position) <= IN_POSITION
        lost = abs(profile.position - motor.position) > FOLLOWING_ERROR
        return arrived | profile.active << 1 | lost << 3 | profile.kind << 4
