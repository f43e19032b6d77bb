"""What pictures show of a plan, in the units that people read: millimetres, degrees, shares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats, Plan

LEAST_STEP = 0.5
"""Share of the usual step between two rows from which on their difference tells a rate."""


@dataclass(frozen=True)
class Limits:
    """What the nine joints may do.

    Attributes:
        ranges: rad, (9, 2).
        speeds: rad/s, (9,).
        accelerations: rad/s2, (9,).
    """

    ranges: Floats
    speeds: Floats
    accelerations: Floats


@dataclass(frozen=True)
class Margin:
    """A margin along the plan, drawn as a panel of its own.

    Attributes:
        name: what it is to, in words.
        unit: of the values.
        values: one for each of the plan's rows, (n,); not finite where there is none.
        limit: beyond this it is refused; None when it is only told.
    """

    name: str
    unit: str
    values: Floats
    limit: float | None = None


@dataclass(frozen=True)
class Binding:
    """What rules the motion.

    Attributes:
        rows: at each of the plan's rows, in words, (n,).
        shares: how much of the time each of these does, the most first.
    """

    rows: Sequence[str]
    shares: Sequence[tuple[str, float]]


def tool_mm(plan: Plan) -> Floats:
    """Where the tool point is in the path's base frame, (n, 3)."""
    return np.asarray(plan.tool[:, :3, 3] * 1000.0)


def headline(plan: Plan) -> str:
    """How long the plan lasts and how often the arm stops in it."""
    count = len(plan.knots)
    return f"{plan.duration_s:.2f} s, {count or 'no'} stop{'' if count == 1 else 's'} of the arm"


def speed_percent(plan: Plan, limits: Limits) -> tuple[Floats, Floats]:
    """Times (m,), and there the share of each joint's speed (m, 9)."""
    (t_s, speed), _ = _rates(plan.t, plan.joints)
    return t_s, 100.0 * np.abs(speed) / limits.speeds


def acceleration_percent(plan: Plan, limits: Limits) -> tuple[Floats, Floats]:
    """Times (m,), and there the share of each joint's acceleration (m, 9)."""
    _, (t_s, acceleration) = _rates(plan.t, plan.joints)
    return t_s, 100.0 * np.abs(acceleration) / limits.accelerations


def tool_rates(plan: Plan) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Times and the tool point's speed there, mm/s; times and its acceleration there, mm/s2."""
    (t_s, speed), (inner_s, acceleration) = _rates(plan.t, tool_mm(plan))
    return (t_s, np.linalg.norm(speed, axis=1)), (inner_s, np.linalg.norm(acceleration, axis=1))


def _rates(t_s: Floats, values: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Times and there the first derivative of values (n, k); times and there the second.

    Rows just behind another are passed over: differences over tiny steps show what none would see.
    """
    gaps = np.diff(t_s, prepend=-np.inf)
    kept = np.flatnonzero(gaps >= LEAST_STEP * np.median(gaps))
    t_s, values = t_s[kept], values[kept]
    dt = np.diff(t_s)
    middle = (t_s[1:] + t_s[:-1]) / 2.0
    speed = np.diff(values, axis=0) / dt[:, None]
    return (middle, speed), (t_s[1:-1], np.diff(speed, axis=0) / np.diff(middle)[:, None])


def range_margin_deg(plan: Plan, limits: Limits) -> Floats:
    """Distance of each joint from the nearer end of its range, (n, 9)."""
    low, high = limits.ranges.T
    return np.asarray(np.degrees(np.minimum(plan.joints - low, high - plan.joints)))
