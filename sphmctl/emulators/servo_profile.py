"""The profile of a servo: the position and velocity its firmware asks of the motor at each instant.

ROBOTIS e-manual, XL430-W250, "Profile Acceleration(108)", "Profile Velocity(112)", "What is the
Profile". Positions are pulses, velocities pulses per second.
"""

from __future__ import annotations

import math

STEP_S = 0.001
"""Grid of the emulated world, s."""

STEP, RECTANGLE, TRIANGLE, TRAPEZOID = range(4)
"""Profile types as bits 5-4 of Moving Status(123) tell them."""


class Profile:
    """A planned move to a goal, walked along at 1 ms; between moves it stands at `position`."""

    def __init__(self, position: float) -> None:
        self.position = position
        self.velocity = 0.0
        self.goal = position
        self.kind = STEP
        self.active = False
        self._pieces: list[tuple[float, float, float]] = []  # duration s, velocity, acceleration
        self._ticks = 0
        self._begin_s = 0.0
        self._from = position

    def hold(self, position: float) -> None:
        """Stand at `position` from now on."""
        self.position = self.goal = self._from = position
        self.velocity = 0.0
        self.active = False
        self._pieces = []

    def go(self, goal: float, velocity: float, acceleration: float) -> None:
        """Velocity-based profile; 0 velocity steps, 0 acceleration is a rectangle.

        Starts from the present position and velocity of the profile: a goal that comes during a
        move is blended in.

        Args:
            goal: pulses.
            velocity: largest speed, pulses / s.
            acceleration: pulses / s^2.
        """
        if velocity <= 0:
            self.hold(goal)
            self.kind = STEP
            return
        distance = goal - self.position
        if acceleration <= 0:
            self.kind = RECTANGLE
            run = math.copysign(velocity, distance)
            self._start(goal, [(abs(distance) / velocity, run, 0.0)])
            return
        self._start(goal, self._trapezoid(distance, velocity, acceleration))

    def go_timed(self, goal: float, total_s: float, ramp_s: float) -> None:
        """Time-based profile: there in `total_s`, ramps of `ramp_s` (at most half of it).

        The e-manual leaves open what a goal during a move does; here the profile starts from rest
        at the present position of the profile, the harshest reading.
        """
        if total_s <= 0:
            self.go(goal, 0.0, 0.0)
            return
        ramp_s = min(ramp_s, total_s / 2)
        run = (goal - self.position) / (total_s - ramp_s)
        self.velocity = 0.0
        if ramp_s <= 0:
            self.kind = RECTANGLE
            self._start(goal, [(total_s, run, 0.0)])
            return
        a = run / ramp_s
        cruise_s = total_s - 2 * ramp_s
        self.kind = TRAPEZOID if cruise_s > 0 else TRIANGLE
        self._start(goal, [(ramp_s, 0.0, a), (cruise_s, run, 0.0), (ramp_s, run, -a)])

    def _trapezoid(self, distance: float, top: float, a: float) -> list[tuple[float, float, float]]:
        """Change speed at `a` to a peak, cruise, brake to rest; v^2 = v0^2 + 2 a s throughout."""
        v = self.velocity
        braking = v * abs(v) / (2 * a)
        sign = 1.0 if distance >= braking else -1.0
        way, v = sign * distance, sign * v  # from here on the peak is forward
        peak = min(top, math.sqrt(max(0.0, a * way + v * v / 2)))
        self.kind = TRAPEZOID if peak == top else TRIANGLE
        ramp = a if peak >= v else -a
        ramp_s = (peak - v) / ramp
        cruise = way - (peak * peak - v * v) / (2 * ramp) - peak * peak / (2 * a)
        return [
            (ramp_s, sign * v, sign * ramp),
            (max(0.0, cruise) / peak if peak > 0 else 0.0, sign * peak, 0.0),
            (peak / a, sign * peak, -sign * a),
        ]

    def _start(self, goal: float, pieces: list[tuple[float, float, float]]) -> None:
        self.goal = goal
        self._from = self.position
        self._pieces = pieces
        self._ticks = 0
        self._begin_s = 0.0
        self.active = True

    def step(self) -> None:
        """Go on by 1 ms."""
        self._ticks += 1
        pieces = self._pieces
        into_s = self._ticks * STEP_S - self._begin_s
        # A hair of tolerance, so that a piece of whole milliseconds ends on its own instant.
        while pieces and into_s >= pieces[0][0] - 1e-9:
            duration_s, v, a = pieces.pop(0)
            self._from += (v + a * duration_s / 2) * duration_s
            self._begin_s += duration_s
            into_s -= duration_s
        if not pieces:
            self.hold(self.goal)
            return
        _, v, a = pieces[0]
        self.position = self._from + (v + a * into_s / 2) * into_s
        self.velocity = v + a * into_s
