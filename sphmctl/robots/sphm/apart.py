"""Joints for tool poses that are no path: each answer near the one before, in one go for all."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.sphm.chain import BLOCK, RANGES9, flange_target, join, margin_of, turned

Indices: TypeAlias = NDArray[np.intp]


def inverse_apart(
    T: ArrayLike,
    wrist: ArrayLike,
    start: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Floats:
    """Joints (n, 9) for tool poses (n, 4, 4), in order but far apart; NaN where there is no answer.

    Of each pose's answers, whole turns as near to mid-range as they can be, the one whose farthest
    joint has the shortest way from the answer before; the first is the nearest to `start`, or the
    one of largest margin. Arguments as in `inverse_along`, which follows a path.
    """
    T, limits = np.asarray(T, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    cranks = kr6.snap_to_range(np.asarray(wrist, dtype=np.float64), limits[6:])
    target = flange_target(T, cranks, tool, mount_yaw)
    cranks = np.broadcast_to(cranks, (len(T), 3))
    before = None if start is None else np.asarray(start, dtype=np.float64)[:6]
    out = np.full((len(T), 9), np.nan)
    for i in range(0, len(T), BLOCK):
        branches = _branches(target[i : i + BLOCK], cranks[i : i + BLOCK], limits)
        rows = np.flatnonzero(~np.isnan(branches[:, :, 0]).all(axis=1))
        if len(rows):
            chosen = _chosen(branches[rows], before, limits)
            out[i + rows] = chosen
            before = chosen[-1, :6]
    return out


def _branches(target: Floats, cranks: Floats, limits: Floats) -> Floats:
    """Joints (n, 8, 9) of flange poses (n, 4, 4), turned towards mid-range; NaN beyond it."""
    arm = turned(kr6.inverse(target), limits[:6].mean(axis=1), limits[:6])
    return join(kr6.snap_to_range(arm, limits[:6]), cranks)


def _chosen(branches: Floats, before: Floats | None, limits: Floats) -> Floats:
    """Of branches (n, 8, 9) those (n, 9) that go on from `before` (6,), each from the last."""
    arm = branches[:, :, :6]
    cost = -margin_of(branches[0], limits)
    if before is not None:
        cost = np.abs(arm[0] - before).max(axis=1)
    branch = int(np.nanargmin(cost))
    chosen = [branch]
    for after in _nearest(arm).tolist():
        branch = after[branch]
        chosen.append(branch)
    return np.asarray(branches[np.arange(len(arm)), chosen])


def _nearest(arm: Floats) -> Indices:
    """Of branches (m, 8, 6), which of the next row is nearest to each of a row, (m - 1, 8)."""
    by_joint = np.ascontiguousarray(arm.transpose(2, 1, 0), dtype=np.float32)
    way = np.zeros((8, 8, len(arm) - 1), dtype=np.float32)
    step = np.empty_like(way)
    for joint in by_joint:
        np.subtract(joint[:, None, :-1], joint[None, :, 1:], out=step)
        np.maximum(way, np.abs(step, out=step), out=way)
    way[np.isnan(way)] = np.inf
    return np.asarray(way.argmin(axis=1).T)
