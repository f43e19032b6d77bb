"""Six true joints that drive synchronous point-to-point blocks in 4 ms steps.

Knows no program and no variable. A block is a straight line in axis space with one trapezoid of
speed along it; there is no lag and no vibration: where the block is, the joints are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Joints = tuple[float, ...]

STEP_S = 0.004
"""Time of one step: KRC4's drives take a new value every 4 ms (RSI's fast cycle)."""

MAX_SPEED_DEG_S: Joints = (360.0, 300.0, 360.0, 381.0, 388.0, 615.0)
"""kuka_kr6_support/urdf/kr6r900sixx_macro.xacro, from KUKA's data sheet of the robot."""

MAX_ACCELERATION_DEG_S2: Joints = tuple(
    math.degrees(limit_rad_s2) for limit_rad_s2 in (21.7, 6.9, 31.4, 133.0, 136.0, 268.0)
)
"""kuka_agilus_support/config/kr6_r900_sixx_joint_limits.yaml of kroshu/kuka_robot_descriptions."""

RANGE_DEG: tuple[tuple[float, float], ...] = (
    (-170.0, 170.0),
    (-190.0, 45.0),
    (-120.0, 156.0),
    (-185.0, 185.0),
    (-120.0, 120.0),
    (-350.0, 350.0),
)
"""Software limits, same source as the speeds."""

NO_WAY_DEG = 1e-7
"""An axis with less to go stays: far below a motor's resolution, and its rates would overflow."""

OVERRIDE_RATE_PER_S = 10.0
"""0 to 100 % of override take 100 ms; slower where an axis would exceed its acceleration. KUKA
says only that override changes are ramped and keep the path."""


def in_range(joints_deg: Joints) -> bool:
    """Whether every axis is inside its software limits."""
    return all(low <= q <= high for q, (low, high) in zip(joints_deg, RANGE_DEG, strict=True))


@dataclass(frozen=True)
class Trapezoid:
    """A stretch from rest to rest: constant acceleration, `peak` speed, constant deceleration."""

    distance: float
    peak: float
    acceleration: float
    ramp_s: float
    duration_s: float

    @classmethod
    def plan(cls, distance: float, speed: float, acceleration: float) -> Trapezoid:
        """The fastest one; a triangle when `speed` is not reached."""
        peak = min(speed, (distance * acceleration) ** 0.5)
        ramp_s = peak / acceleration
        # A ramp covers peak * ramp / 2, and there are two of them.
        cruise_s = max(0.0, distance / peak - ramp_s) if peak > 0.0 else 0.0
        return cls(distance, peak, acceleration, ramp_s, 2.0 * ramp_s + cruise_s)

    def at(self, t_s: float) -> tuple[float, float, float]:
        """Distance, speed and acceleration at `t_s` after the start."""
        left_s = self.duration_s - t_s
        if left_s <= 0.0:
            return self.distance, 0.0, 0.0
        if t_s < self.ramp_s:
            return self.acceleration * t_s**2 / 2.0, self.acceleration * t_s, self.acceleration
        if left_s < self.ramp_s:
            covered = self.distance - self.acceleration * left_s**2 / 2.0
            return covered, self.acceleration * left_s, -self.acceleration
        return self.peak * (t_s - self.ramp_s / 2.0), self.peak, 0.0


@dataclass(frozen=True)
class _Block:
    """A line in axis space; its parameter runs from 0 to 1, and all rates are of the parameter."""

    start_deg: Joints
    delta_deg: Joints
    target_deg: Joints
    speed: float
    acceleration: float
    hardest: float


@dataclass(frozen=True)
class _Brake:
    """A way to rest on the path, from a place and speed of the block's parameter."""

    place: float
    speed: float
    deceleration: float


class Arm:
    """The arm: at most one block at a time, in motion, held on its path, or braking.

    Attributes:
        joints_deg: the true joints A1..A6.
        speed_deg_s: their speeds.
        override: the share 0..1 of programmed speed that is wanted.
        finished: blocks driven to their end since the start.
    """

    def __init__(self, start_deg: Joints) -> None:
        self.joints_deg = start_deg
        self.speed_deg_s: Joints = (0.0,) * 6
        self.override = 1.0
        self.finished = 0
        self._share = 1.0
        self._block: _Block | None = None
        self._place = 0.0
        self._origin = 0.0
        self._profile = Trapezoid.plan(0.0, 1.0, 1.0)
        self._t_s = 0.0
        self._brake: _Brake | None = None
        self._held = False
        self._dropping = False

    @property
    def busy(self) -> bool:
        """Whether a block is there, in motion or held."""
        return self._block is not None

    @property
    def moving(self) -> bool:
        """Whether the arm is in motion, or about to be in its next step."""
        if self._block is None:
            return False
        if self._brake is not None:
            return True
        return not self._held and (self._share > 0.0 or self.override > 0.0)

    @property
    def back_deg(self) -> Joints | None:
        """Where the present block began; None without a block."""
        return None if self._block is None else self._block.start_deg

    @property
    def target_deg(self) -> Joints | None:
        """Where the present block ends; None without a block."""
        return None if self._block is None else self._block.target_deg

    def begin(
        self, target_deg: Joints, velocity_percent: float, acceleration_percent: float
    ) -> None:
        """Start a block; the arm must have none, and the target must be in range."""
        if self._block is not None:
            raise RuntimeError("a block begins only after the one before has ended")
        if not in_range(target_deg):
            raise ValueError(f"{target_deg} degrees is outside the software limits {RANGE_DEG}")
        ways = (end - now for end, now in zip(target_deg, self.joints_deg, strict=True))
        delta_deg = tuple(way if abs(way) >= NO_WAY_DEG else 0.0 for way in ways)
        fastest = _parameter_rate(delta_deg, MAX_SPEED_DEG_S)
        hardest = _parameter_rate(delta_deg, MAX_ACCELERATION_DEG_S2)
        speed = fastest * velocity_percent / 100.0
        acceleration = hardest * acceleration_percent / 100.0
        self._block = _Block(self.joints_deg, delta_deg, target_deg, speed, acceleration, hardest)
        self._place = 0.0
        self._held = self._dropping = False
        self._plan_rest()

    def hold(self) -> None:
        """Brake on the path and keep the rest of the block."""
        if self._block is None or self._held:
            return
        self._held = True
        if self._brake is None:
            _, speed, _ = self._profile.at(self._t_s)
            speed *= self._share
            if speed > 0.0:
                self._brake = _Brake(self._place, speed, self._block.hardest)
                self._t_s = 0.0

    def resume(self) -> None:
        """Go on along the same path; a brake under way is finished first."""
        if self._block is None or self._dropping:
            return
        if self._held:
            self._held = False
            if self._brake is None:
                self._plan_rest()

    def drop(self) -> None:
        """Brake on the path and forget the rest of the block."""
        self.hold()
        if self._brake is None:
            self._block = None
        self._dropping = self._block is not None

    def step(self) -> None:
        """Go 4 ms ahead."""
        block = self._block
        if block is None:
            self._share = self.override
            return
        if self._brake is not None:
            self._step_brake(block, self._brake)
        elif self._held:
            self._share = self.override
        else:
            self._step_profile(block)

    def _plan_rest(self) -> None:
        block = self._block
        if block is not None:
            # A block to where the arm is already has no way to go and ends in its first step.
            left = 1.0 - self._place if any(block.delta_deg) else 0.0
            self._origin = self._place
            self._t_s = 0.0
            self._profile = Trapezoid.plan(left, block.speed, block.acceleration)

    def _step_profile(self, block: _Block) -> None:
        before = self._share
        self._share = self._next_share(block)
        self._t_s += (before + self._share) / 2.0 * STEP_S
        if self._t_s >= self._profile.duration_s:
            self.joints_deg = block.target_deg
            self.speed_deg_s = (0.0,) * 6
            self.finished += 1
            self._block = None
            return
        covered, speed, _ = self._profile.at(self._t_s)
        self._place_on(block, self._origin + covered, speed * self._share)

    def _next_share(self, block: _Block) -> float:
        """The override 4 ms later: its own ramp, within what the axes' accelerations leave.

        With the time base share s the parameter's acceleration is f'' s^2 + f' s'.
        """
        now = self._share
        if now == self.override or self._profile.peak == 0.0:
            return self.override
        _, speed, before = self._profile.at(self._t_s)
        _, _, after = self._profile.at(self._t_s + STEP_S)
        fastest = min(self._profile.peak, speed + self._profile.acceleration * STEP_S)
        # Within the step f'' may change and s does; each side takes the worse of both ends.
        change = OVERRIDE_RATE_PER_S * STEP_S
        higher, lower = now + change, max(0.0, now - change)
        pushing = max(max(before, after) * s**2 for s in (now, higher))
        pulling = min(min(before, after) * s**2 for s in (now, lower))
        up, down = (block.hardest - pushing) / fastest, (block.hardest + pulling) / fastest
        rise = min(OVERRIDE_RATE_PER_S, max(0.0, up)) * STEP_S
        fall = min(OVERRIDE_RATE_PER_S, max(0.0, down)) * STEP_S
        return min(max(self.override, now - fall), now + rise)

    def _step_brake(self, block: _Block, brake: _Brake) -> None:
        self._t_s += STEP_S
        duration_s = brake.speed / brake.deceleration
        t_s = min(self._t_s, duration_s)
        covered = brake.speed * t_s - brake.deceleration * t_s**2 / 2.0
        speed = brake.speed - brake.deceleration * t_s
        # A block's own deceleration is never harder, so only rounding could pass its end.
        self._place_on(block, min(1.0, brake.place + covered), speed)
        if t_s < duration_s:
            return
        self.speed_deg_s = (0.0,) * 6
        self._brake = None
        if self._dropping:
            self._block = None
            self._dropping = False
        elif not self._held:
            self._plan_rest()

    def _place_on(self, block: _Block, place: float, rate: float) -> None:
        self._place = place
        self.joints_deg = tuple(
            [q + d * place for q, d in zip(block.start_deg, block.delta_deg, strict=True)]
        )
        self.speed_deg_s = tuple([d * rate for d in block.delta_deg])


def _parameter_rate(delta_deg: Joints, limits: Joints) -> float:
    """The rate of the block's parameter at which the first axis reaches its limit."""
    return min(
        (limit / abs(d) for d, limit in zip(delta_deg, limits, strict=True) if d != 0.0),
        default=limits[0],
    )
