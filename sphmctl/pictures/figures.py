"""What pictures show of a plan, in the units that people read: millimetres, degrees, shares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats, Plan


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
        values: one for each of the plan's rows, (n,); NaN where there is none.
        least: below this it is refused; None when it is only told.
    """

    name: str
    unit: str
    values: Floats
    least: float | None = None


def tool_mm(plan: Plan) -> Floats:
    """Where the tool point is in the path's base frame, (n, 3)."""
    return np.asarray(plan.tool[:, :3, 3] * 1000.0)


def speed_percent(plan: Plan, limits: Limits) -> tuple[Floats, Floats]:
    """Times between rows (n - 1,), and there the share of each joint's speed (n - 1, 9)."""
    dt = np.diff(plan.t)
    rate = np.abs(np.diff(plan.joints, axis=0)) / dt[:, None]
    return (plan.t[1:] + plan.t[:-1]) / 2.0, 100.0 * rate / limits.speeds


def acceleration_percent(plan: Plan, limits: Limits) -> tuple[Floats, Floats]:
    """Times of the inner rows (n - 2,), and there the share of each joint's acceleration."""
    dt = np.diff(plan.t)
    rate = np.diff(plan.joints, axis=0) / dt[:, None]
    change = np.abs(np.diff(rate, axis=0)) / ((dt[1:] + dt[:-1]) / 2.0)[:, None]
    return plan.t[1:-1], 100.0 * change / limits.accelerations


def range_margin_deg(plan: Plan, limits: Limits) -> Floats:
    """Distance of each joint from the nearer end of its range, (n, 9)."""
    low, high = limits.ranges.T
    return np.asarray(np.degrees(np.minimum(plan.joints - low, high - plan.joints)))


def time_shares(t_s: Floats, labels: Sequence[str]) -> list[tuple[str, float]]:
    """How much of the time each label has, the most first; labels (n,) belong to times (n,)."""
    half = np.diff(t_s) / 2.0
    owned = np.append(half, 0.0) + np.append(0.0, half)
    total = float(owned.sum())
    times: dict[str, float] = {}
    for label, time_s in zip(labels, owned.tolist(), strict=True):
        times[label] = times.get(label, 0.0) + time_s
    order = sorted(times.items(), key=lambda item: -item[1])
    return [(label, time_s / total if total else 0.0) for label, time_s in order]
