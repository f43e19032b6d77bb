"""The mechanics of one XL430: shaft, load, heat and supply, stepped at 1 ms; knows no registers.

A model to test a host against, not an identified one: how far the shaft trails its profile is
drawn per servo and cannot be read over the bus, as on a real one. Positions are pulses
(4096 per turn), velocities pulses per second, torques and duties shares of the largest.
"""

from __future__ import annotations

import math
import random

from sphmctl.emulators.servo_profile import STEP_S, Profile

LAG_S = (0.015, 0.040)
"""Range of the first-order lag between profile and shaft, s: assumed."""

DEAD_BAND = 1.0
"""Error below which the shaft does not move, pulses: static friction of the 258:1 gear."""

FULL_SPEED = 61.0 * 4096 / 60
"""No-load speed at 12 V, pulses / s (61 rpm; ROBOTIS e-manual, 2XL430-W250, same drive)."""

NOMINAL_V = 12.0
"""Supply at which `FULL_SPEED` holds, V."""

FULL_PWM = 885
"""Goal PWM at full duty, 0.113 % (e-manual, "PWM Limit(36)")."""

P_GAIN_UNIT = 128
"""Position P gain is the register over this, PWM per pulse (e-manual, "Position PID Gain")."""

FRICTION = 0.05
"""Torque share that the running gear takes; assumed."""

FULL_ACCELERATION = FULL_SPEED / 0.05
"""Acceleration at full torque, pulses / s^2: full speed in 50 ms; assumed."""

LOAD_NOISE = 0.003
"""Standard deviation of the load reading, share; assumed, a few digits of Present Load(126)."""

NOISE_ROWS = 997
"""Length of the noise table: noise is looked up by time, so that readers cannot change it."""

COOLING_S = 400.0
"""Time constant towards the temperature at rest, s; assumed."""

HEATING_K_S = 0.3
"""Warming at full load, K/s: from 35 to the limit of 72 degC in two minutes; assumed."""

SAG_V = 0.5
"""Voltage lost in the cable at full duty, V; assumed."""

SLOW_S = 0.1
"""Period of `warm`, s: temperature and supply need no finer one."""


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


class Motor:
    """Shaft of one servo in the coordinates that the servo reports (sense and offset applied)."""

    def __init__(self, position: float, rng: random.Random) -> None:
        self.position = position
        self.velocity = 0.0
        self.profile = Profile(position)
        self.supply_v = NOMINAL_V
        self.idle_c = rng.uniform(30.0, 35.0)
        self.temperature_c = self.idle_c
        self.pushed = 0.0
        self.p_gain = 640
        self.pwm_share = 1.0
        self.driven = False
        self._lag_s = rng.uniform(*LAG_S)
        self._decay = math.exp(-STEP_S / self._lag_s)
        self._acceleration = 0.0
        self._settled = False
        self._noise = [rng.gauss(0.0, LOAD_NOISE) for _ in range(NOISE_ROWS)]

    @property
    def droop(self) -> float:
        """How far an outside torque displaces the shaft against the P gain, pulses."""
        return self.pushed * FULL_PWM * P_GAIN_UNIT / max(self.p_gain, 1)

    @property
    def torque(self) -> float:
        """Torque of the motor, share of the largest."""
        if not self.driven:
            return 0.0
        if self._settled:
            error = self.profile.position - self.position
            return _clip(error * self.p_gain / P_GAIN_UNIT / FULL_PWM, 1.0)
        drag = math.copysign(FRICTION, self.velocity) if self.velocity else 0.0
        return _clip(self._acceleration / FULL_ACCELERATION + drag - self.pushed, 1.0)

    @property
    def duty(self) -> float:
        """Share of the supply on the motor: back-EMF and torque."""
        return _clip(self.velocity / FULL_SPEED + self.torque, 1.0)

    @property
    def voltage_v(self) -> float:
        """Voltage at the servo, V."""
        return self.supply_v - SAG_V * abs(self.duty)

    def load(self, index: int) -> float:
        """Torque share of the motor as the firmware would estimate it at grid instant `index`."""
        return _clip(self.torque + self._noise[index % NOISE_ROWS], 1.0)

    def follow(self) -> None:
        """One step of position control: the shaft trails the profile by a first-order lag."""
        profile = self.profile
        before = profile.position
        if profile.active:
            profile.step()
        target = profile.position
        if self.pushed:
            before, target = before + self.droop, target + self.droop
        error = target - self.position
        if -DEAD_BAND < error < DEAD_BAND:
            self.velocity = 0.0
            self._settled = True
            return
        # Exact answer of x' = (u - x) / lag to a u that goes straight from `before` to `target`.
        ramp = (target - before) / STEP_S * self._lag_s
        moved = target - ramp + (self.position - before + ramp) * self._decay
        self._move((moved - self.position) / STEP_S)

    def turn(self, velocity: float) -> None:
        """One step of velocity control: the speed goes to `velocity` by the same lag."""
        self._move(velocity + (self.velocity - velocity) * self._decay)

    def press(self, load: float) -> None:
        """Put an outside torque on the shaft, share of stall torque."""
        self.pushed = _clip(load, 1.0)

    def let_go(self) -> None:
        """Torque off: the gear holds the shaft where it is."""
        self.driven = self._settled = False
        self.velocity = self._acceleration = 0.0

    def warm(self) -> None:
        """Go on by `SLOW_S` with temperature."""
        heat = HEATING_K_S * self.torque * self.torque
        cool = (self.idle_c - self.temperature_c) / COOLING_S
        self.temperature_c += (heat + cool) * SLOW_S

    def _move(self, velocity: float) -> None:
        top = FULL_SPEED * self.supply_v / NOMINAL_V * self.pwm_share
        if velocity > top:
            velocity = top
        elif velocity < -top:
            velocity = -top
        self._acceleration = (velocity - self.velocity) / STEP_S
        self._settled = False
        self.velocity = velocity
        self.position += velocity * STEP_S
