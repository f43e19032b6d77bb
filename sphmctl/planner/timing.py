"""The time law of one block: a trapezoid of speed from rest to rest, as fast as every limit allows.

A block is the piece of a move between two stops of the arm. Its progress w runs from 0 to 1; the
controller runs its synchronous point-to-point blocks by the same law, so that it keeps this time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.timelaw import TimeLaw

SPEED_STEPS = 120
"""Speeds tried per block, from the highest down to SLOWEST_SHARE of it, 4 % apart."""

SLOWEST_SHARE = 0.01
"""Slowed below this share of the wanted speed, a block is too close to a singularity."""

LIMIT_SHARE = 0.998
"""Of the joints' limits: room for what happens between the points that are looked at."""


@dataclass(frozen=True)
class Trapezoid:
    """Progress 0 to 1 from rest to rest, at most at `speed` (1/s) and `acceleration` (1/s2).

    Attributes:
        ruled_by: the joint's limit that keeps speed and acceleration from being higher, such as "A2
            acceleration"; "" where it is a cap that the law was given.
    """

    speed: float
    acceleration: float
    ruled_by: tuple[str, str] = ("", "")

    @property
    def ramp_s(self) -> float:
        """How long it speeds up."""
        return min(self.speed / self.acceleration, 1.0 / math.sqrt(self.acceleration))

    @property
    def duration_s(self) -> float:
        """From rest to rest: one cruise of 1 - speed * ramp, and two ramps."""
        peak = self.ramp_s * self.acceleration
        return 1.0 / peak + self.ramp_s

    def progress(self, t_s: Floats) -> Floats:
        """w at times since the block's begin; 0 before and 1 after."""
        t = np.clip(t_s, 0.0, self.duration_s)
        left = self.duration_s - t
        ramp, a = self.ramp_s, self.acceleration
        cruise = a * ramp * (t - ramp / 2.0)
        up, down = a * t * t / 2.0, 1.0 - a * left * left / 2.0
        return np.clip(np.where(t < ramp, up, np.where(left < ramp, down, cruise)), 0.0, 1.0)

    def scaled(self, share: float) -> Trapezoid:
        """The same progress, `share` times as fast."""
        return replace(
            self, speed=self.speed * share, acceleration=self.acceleration * share * share
        )


@dataclass(frozen=True)
class Slice:
    """A piece of a time law along a whole path, as progress 0 to 1 of its own.

    Attributes:
        s: where on the law's path it begins and ends.
        t: when.
    """

    law: TimeLaw
    s: tuple[float, float]
    t: tuple[float, float]

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return self.t[1] - self.t[0]

    def progress(self, t_s: Floats) -> Floats:
        """w at times since the slice's begin; 0 before and 1 after."""
        along = self.law.s(self.t[0] + t_s)
        return np.clip((along - self.s[0]) / (self.s[1] - self.s[0]), 0.0, 1.0)


@dataclass(frozen=True)
class Limits:
    """What a block may do, in SI: the nine joints' speeds and accelerations, as shares of w or rad.

    Attributes:
        speed: cap on progress per second from tool and controller, 1/s; may be infinite.
        floor: slower than this, 1/s, the block is refused.
        acceleration: cap on progress per second squared, 1/s2.
        joint_speeds: rad/s, (9,).
        joint_accelerations: rad/s2, (9,).
    """

    speed: float
    floor: float
    acceleration: float
    joint_speeds: Floats
    joint_accelerations: Floats


@dataclass(frozen=True)
class TooFast:
    """No law at a sensible speed exists: this joint (index 0 to 8) needs too much at progress w."""

    joint: int
    w: float
    value: float
    limit: float
    what: str


def derivatives(joints: Floats) -> tuple[Floats, Floats]:
    """First and second derivative by w of joints (n, 9) given at equal steps of w over 0 to 1."""
    step = 1.0 / (len(joints) - 1)
    first = np.gradient(joints, step, axis=0, edge_order=2)
    second = np.zeros_like(joints)
    second[1:-1] = (joints[2:] - 2.0 * joints[1:-1] + joints[:-2]) / step**2
    second[0], second[-1] = second[1], second[-2]
    # Between the points the path may be steeper than at them.
    steepest = np.abs(np.diff(joints, axis=0)) / step
    first = np.abs(first)
    first[:-1] = np.maximum(first[:-1], steepest)
    first[1:] = np.maximum(first[1:], steepest)
    return first, np.abs(second)


def fastest(joints: Floats, limits: Limits) -> Trapezoid | TooFast:
    """The quickest trapezoid along joints (n, 9) that keeps every limit.

    Along the block |q'| a + |q''| v^2 <= limit must hold, with the cruise speed v also on the
    ramps: a little slower than need be, and never too fast.
    """
    first, second = derivatives(joints)
    speeds = LIMIT_SHARE * limits.joint_speeds
    accelerations = LIMIT_SHARE * limits.joint_accelerations
    with np.errstate(divide="ignore"):
        cap = float(np.min(speeds / first))
    if cap < limits.floor:
        return _too_fast(first * limits.speed, limits.joint_speeds, "speed")
    highest = min(limits.speed, cap)
    wanted = highest * np.geomspace(1.0, SLOWEST_SHARE, SPEED_STEPS)
    v = wanted[wanted >= limits.floor]
    slope, bend, owner = _hardest(first / accelerations, second / accelerations)
    room = 1.0 - bend * (v * v)[:, None]
    fit = room.min(axis=1) > 0.0
    if not fit.any():
        return _too_fast(second * highest**2, limits.joint_accelerations, "acceleration")
    v, room = v[fit], room[fit]
    with np.errstate(divide="ignore"):
        most = room / slope
        a = np.minimum(most.min(axis=1), limits.acceleration)
    ramp = np.minimum(v / a, 1.0 / np.sqrt(a))
    best = int((1.0 / (ramp * a) + ramp).argmin())
    hard = f"{JOINT_NAMES[owner[most[best].argmin()]]} acceleration"
    fast = f"{JOINT_NAMES[int((first / speeds).max(axis=0).argmax())]} speed"
    capped = (cap >= limits.speed, float(a[best]) >= limits.acceleration)
    # Slower than it might be: then for the sake of the acceleration in the bends.
    ruled_by = hard if v[best] < highest else "" if capped[0] else fast, "" if capped[1] else hard
    return Trapezoid(float(v[best]), float(a[best]), ruled_by)


def _hardest(slope: Floats, bend: Floats) -> tuple[Floats, Floats, NDArray[np.intp]]:
    """Of all rows and joints those (k,) that no other beats in slope and bend: only they rule.

    Also the joint that each of them is of.
    """
    joints = slope.shape[1]
    slope, bend = slope.ravel(), bend.ravel()
    order = np.lexsort((-bend, -slope))
    bend = bend[order]
    front = np.append(True, bend[1:] > np.maximum.accumulate(bend)[:-1])
    return slope[order][front], bend[front], order[front] % joints


def _too_fast(needed: Floats, limits: Floats, what: str) -> TooFast:
    row, joint = np.unravel_index(np.argmax(needed / limits), needed.shape)
    return TooFast(
        int(joint),
        float(row) / (len(needed) - 1),
        float(needed[row, joint]),
        float(limits[joint]),
        what,
    )
