"""Refinement of a way over layers: the best way in a tube of wrist poses around it, ever narrower,
and the smooth curve through its layers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.policies import cost
from sphmctl.planner.policies.families import Family, Rows
from sphmctl.planner.policies.graph import STEP_RAD, Ridge
from sphmctl.planner.policies.known import Task
from sphmctl.robots import kr6, sphm
from sphmctl.robots.sphm.chain import turned

HALVINGS = 8
"""Of the tube's width: 12 degrees of crank become 0.05."""

MOST_PASSES = 4
"""At one width, as long as the way still gets cheaper; each may move it by one width."""

GAIN = 1e-3
"""Share of the cost by which another pass at the same width has to pay."""


@dataclass(frozen=True)
class Tube:
    """Candidates around a way: joints (L, k, 9), NaN where there are none; parameters (L, k, d)."""

    joints: Floats
    values: Floats


def refined(task: Task, family: Family, ridge: Ridge, first: int = 0) -> Ridge:
    """The way moved to where it costs least, all layers together; `first` halvings are left out."""
    step = family.step / 2.0**first
    way_m = task.way_m[ridge.rows]
    for _ in range(first, HALVINGS):
        before = np.inf
        for _ in range(MOST_PASSES):
            ridge, total = _best(task, _around(task, family, ridge, step), ridge, way_m)
            if total > before * (1.0 - GAIN):
                break
            before = total
        step /= 2.0
    return ridge


def inserted(task: Task, family: Family, ridge: Ridge, rows: Rows) -> Ridge | None:
    """The way with more layers, by straight lines between; None where one has no answer."""
    way_m = task.way_m
    values = np.stack(
        [np.interp(way_m[rows], way_m[ridge.rows], column) for column in ridge.values.T], axis=1
    )
    joints = np.stack(
        [np.interp(way_m[rows], way_m[ridge.rows], column) for column in ridge.joints.T], axis=1
    )
    guess = Ridge(rows, values, joints, np.isin(rows, ridge.rows[ridge.pinned]))
    tube = _around(task, family, guess, 0.0)
    middle = tube.joints[:, 0]
    if np.isnan(middle).any():
        return None
    return replace(guess, joints=middle)


def _around(task: Task, family: Family, ridge: Ridge, step: float) -> Tube:
    """Neighbours of each layer's parameters, with the arm's answer nearest to the layer's."""
    rows, setup = ridge.rows, task.setup
    offsets = np.array(list(product((0.0, -1.0, 1.0), repeat=ridge.values.shape[1]))) * step
    shift = np.broadcast_to(offsets, (len(rows), *offsets.shape)).copy()
    shift[ridge.pinned] = 0.0
    values = np.clip(ridge.values[:, None] + shift, family.low[rows, None], family.high[rows, None])
    cranks = family.cranks(rows[:, None], values)
    flange = sphm.flange_target(task.target[rows, None], cranks, setup.tool, setup.mount_yaw)
    near, limits = ridge.joints[:, None, :6], setup.ranges[:6]
    arm = kr6.snap_to_range(turned(kr6.inverse(flange, near), near[:, :, None], limits), limits)
    apart = np.square(arm - near[:, :, None]).sum(axis=-1)
    pick = np.nan_to_num(apart, nan=np.inf).argmin(axis=-1)
    nearest = np.take_along_axis(arm, pick[..., None, None], axis=2)[:, :, 0]
    joints = np.concatenate([nearest, cranks], axis=-1)
    joints[ridge.pinned] = ridge.joints[ridge.pinned, None]
    return Tube(joints, values)


def _best(task: Task, tube: Tube, ridge: Ridge, way_m: Floats) -> tuple[Ridge, float]:
    """The cheapest way through a tube. Its middle stays possible, so it never gets dearer."""
    length = np.maximum(np.diff(way_m), cost.SHORTEST_M)[:, None]
    near = cost.closeness(tube.joints, task.setup.ranges)
    weighted = tube.joints * cost.seconds_per_rad(task.setup)
    plain = _squared(weighted[:-1], weighted[1:]) / length[..., None]
    edges = plain + cost.swing(
        tube.joints[:-1, :, None], tube.joints[1:, None], length[..., None], task.setup
    )
    for joint, most in enumerate(STEP_RAD):
        far = np.abs(tube.joints[:-1, :, None, joint] - tube.joints[1:, None, :, joint]) > most
        edges[far] = np.inf
    middle = edges[:, 0, 0]  # the way itself has been allowed
    edges[:, 0, 0] = np.where(np.isinf(middle), plain[:, 0, 0], middle)
    edges += ((near[:-1] * length)[:, :, None] + (near[1:] * length)[:, None, :]) / 2.0
    edges[np.isnan(edges)] = np.inf
    total = np.zeros(tube.joints.shape[1])
    came = []
    for edge in edges:
        sums = total[:, None] + edge
        came.append(sums.argmin(axis=0))
        total = sums.min(axis=0)
    pick = [int(total.argmin())]
    for back in reversed(came):
        pick.append(int(back[pick[-1]]))
    layers = np.arange(len(pick))
    chosen = np.array(pick[::-1])
    better = Ridge(
        ridge.rows, tube.values[layers, chosen], tube.joints[layers, chosen], ridge.pinned
    )
    return better, float(total.min())


def _squared(a: Floats, b: Floats) -> Floats:
    """Squared distances (..., m, k) of points (..., m, 9) and (..., k, 9)."""
    product = a @ np.swapaxes(b, -1, -2)
    ends = np.square(a).sum(axis=-1)[..., :, None] + np.square(b).sum(axis=-1)[..., None, :]
    return np.asarray(np.maximum(ends - 2.0 * product, 0.0))


def smooth(way_m: Floats, knots_m: Floats, values: Floats) -> Floats:
    """The natural cubic spline through values (L, d) at rising knots_m (L,), at way_m (n,).

    Second derivatives by elimination from both neighbours (the tridiagonal system of the spline).
    """
    if len(knots_m) < 3:
        return np.stack([np.interp(way_m, knots_m, column) for column in values.T], axis=1)
    h = np.diff(knots_m)
    slope = np.diff(values, axis=0) / h[:, None]
    right = 6.0 * np.diff(slope, axis=0)
    diagonal = 2.0 * (h[:-1] + h[1:])
    for i in range(1, len(diagonal)):
        share = h[i] / diagonal[i - 1]
        diagonal[i] -= share * h[i]
        right[i] -= share * right[i - 1]
    bend = np.zeros_like(values)
    for i in range(len(diagonal), 0, -1):
        rest = h[i] * bend[i + 1] if i < len(diagonal) else 0.0
        bend[i] = (right[i - 1] - rest) / diagonal[i - 1]
    part = np.clip(np.searchsorted(knots_m, way_m, side="right") - 1, 0, len(h) - 1)
    width = h[part, None]
    b = (way_m - knots_m[part])[:, None] / width
    a = 1.0 - b
    return np.asarray(
        a * values[part]
        + b * values[part + 1]
        + ((a**3 - a) * bend[part] + (b**3 - b) * bend[part + 1]) * width**2 / 6.0
    )
