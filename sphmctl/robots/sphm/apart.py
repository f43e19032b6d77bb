"""Joints for tool poses that are no path: each answer near the one before, in one go for all."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.sphm.chain import BLOCK, RANGES9, flange_target, join, margin_of, turned


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
    out = np.full((len(T), 9), np.nan)
    q = kr6.inverse(target)
    middle = limits[:6].mean(axis=1)
    branches = join(kr6.snap_to_range(turned(q, middle, limits[:6]), limits[:6]), cranks)
    rows = np.flatnonzero(~np.isnan(branches[:, :, 0]).all(axis=1))
    if not len(rows):
        return out
    arm = branches[rows, :, :6]
    if start is None:
        cost = -margin_of(branches[rows[0]], limits)
    else:
        cost = np.abs(arm[0] - np.asarray(start, dtype=np.float64)[:6]).max(axis=1)
    branch = int(np.nanargmin(cost))
    chosen = [branch]
    for i in range(0, len(arm) - 1, BLOCK):
        for after in _nearest(arm[i : i + BLOCK + 1]).tolist():
            branch = after[branch]
            chosen.append(branch)
    out[rows] = branches[rows, chosen]
    return out


def _nearest(arm: Floats) -> Floats:
    """Of branches (m, 8, 6), which of the next row is nearest to each of a row, (m - 1, 8)."""
    way = np.zeros((len(arm) - 1, 8, 8))
    for joint in range(6):
        np.maximum(way, np.abs(arm[:-1, :, None, joint] - arm[1:, None, :, joint]), out=way)
    return np.asarray(np.nan_to_num(way, nan=np.inf).argmin(axis=2))
