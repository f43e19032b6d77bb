"""The share of programmed speed: ramped to what is wanted, within what the axes can.

Override, holds and path-true brakes scale the time base and leave the path. With the share s of
time, an axis's acceleration is q'' s^2 + q' s'.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sphmctl.emulators.motion.contours import AxisLine
from sphmctl.emulators.motion.figures import STEP_S, Joints, Options
from sphmctl.emulators.motion.run import Run


@dataclass(frozen=True)
class Limits:
    """How hard the time base may be changed, percent of normal acceleration.

    Attributes:
        axes: on PTP.
        path: on LIN and CIRC.
        rate_per_s: fastest change of the share; infinite for a brake.
    """

    axes: Joints
    path: float
    rate_per_s: float


def ramp_limits(options: Options) -> Limits:
    """For a change of the override."""
    return Limits((100.0,) * 6, 100.0, 1.0 / options.override_ramp_s)


def brake_limits(options: Options, fast: bool) -> Limits:
    """For BRAKE F and STOP 1, or for BRAKE and STOP 2."""
    if fast:
        return Limits(options.fast_brake_percent, options.fast_path_percent, float("inf"))
    return Limits((options.brake_percent,) * 6, options.brake_percent, float("inf"))


def next_share(now: float, wanted: float, run: Run, limits: Limits) -> float:
    """The share one step later, on the way from `now` to `wanted`."""
    if now == wanted:
        return now
    rising = wanted > now
    room = min(abs(wanted - now), limits.rate_per_s * STEP_S)
    square = (now + room) ** 2 if rising else now * now
    for hardest, speed, least, most in _rates(run, limits, now * STEP_S):
        pushing = most if rising else -least
        # A profile that uses more than these limits by itself leaves nothing to change.
        left = max(0.0, hardest - max(0.0, pushing) * square)
        if left * STEP_S < room * speed:
            room = left * STEP_S / speed
    return now + room if rising else now - room


def _rates(run: Run, limits: Limits, ahead_s: float) -> Iterator[tuple[float, float, float, float]]:
    """For each axis, or for travel and turn of a path: its limit, its speed, and its least and
    greatest acceleration along that speed, now and `ahead_s` later; all by own time."""
    follower = run.follower
    profile, t_s = run.profile, run.t_s
    _, v, a = profile.at(t_s)
    _, v_next, a_next = profile.at(t_s + ahead_s)
    one = (max(v, v_next), min(a, a_next), max(a, a_next))
    if follower is None:
        yield from _alone(run, limits, one)
        return
    profile, t_s = follower.profile, t_s - run.follows_s
    _, w, b = profile.at(t_s)
    _, w_next, b_next = profile.at(t_s + ahead_s)
    first, second = run.contour, follower.contour
    if not (isinstance(first, AxisLine) and isinstance(second, AxisLine)):
        yield from _alone(run, limits, one)
        yield from _alone(follower, limits, (max(w, w_next), min(b, b_next), max(b, b_next)))
        return
    for axis in range(6):
        d, e = first.stretch[axis], second.stretch[axis]
        speed, speed_next = d * v + e * w, d * v_next + e * w_next
        sign = 1.0 if speed + speed_next >= 0.0 else -1.0
        push, push_next = sign * (d * a + e * b), sign * (d * a_next + e * b_next)
        hardest = first.hardest[axis] * limits.axes[axis] / 100.0
        yield (
            hardest,
            max(abs(speed), abs(speed_next)),
            min(push, push_next),
            max(push, push_next),
        )


def _alone(
    run: Run, limits: Limits, rates: tuple[float, float, float]
) -> Iterator[tuple[float, float, float, float]]:
    contour = run.contour
    speed, least, most = rates
    for part, (way, hardest) in enumerate(zip(contour.stretch, contour.hardest, strict=True)):
        if way != 0.0:
            percent = limits.axes[part] if isinstance(contour, AxisLine) else limits.path
            size = abs(way)
            yield hardest * percent / 100.0, size * speed, size * least, size * most
