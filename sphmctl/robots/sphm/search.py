"""The inverse of the hybrid robot: all answers, the best one, and the search for a wrist pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.sphm.chain import (
    BLOCK,
    NO_TOOL,
    RANGES9,
    flange_target,
    join,
    margin_of,
    turned,
)
from sphmctl.robots.sphm.choose import best_cranks
from sphmctl.robots.sphm.climb import Field


@dataclass(frozen=True)
class Solutions:
    """Answers of the inverse, best first, NaN after the last.

    Attributes:
        joints: rad, (..., K, 9).
        margins: distance of the joint nearest to its limit from that limit, rad, (..., K).
    """

    joints: Floats
    margins: Floats


def inverse(
    T: ArrayLike,
    tool: ArrayLike | None = None,
    wrist: ArrayLike | None = None,
    near: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Solutions:
    """Every set of joints within the limits that puts the tool at T, whole turns included.

    With `near`, best is nearest to it (root mean square over the joints); without, best is the
    largest margin. For 10,000 poses and more `inverse_best` takes a tenth of the memory.

    Args:
        T: tool poses, (..., 4, 4).
        tool: the tool's frame on the platform, (4, 4); None for the platform centre O7.
        wrist: crank angles, broadcast to (..., 3); None lets `auto` choose them.
        near: joints to stay near to, broadcast to (..., 9).
        limits: lowest and highest angle of each joint, (9, 2); the ends belong to them.
        mount_yaw: see `platform_in_flange`.
    """
    T, limits = np.asarray(T, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    if wrist is None:
        wrist = auto(T, tool, near, limits, mount_yaw)[..., 6:]
    cranks = kr6.snap_to_range(np.asarray(wrist, dtype=np.float64), limits[6:])
    cranks = np.broadcast_to(cranks, (*T.shape[:-2], 3))
    arm_near = None if near is None else np.asarray(near, dtype=np.float64)[..., :6]
    arm = kr6.inverse_in_range(flange_target(T, cranks, tool, mount_yaw), limits[:6], arm_near)
    joints = join(arm, cranks)
    cost = -margin_of(joints, limits) if near is None else _distance(joints, near)
    order = np.argsort(cost, axis=-1, kind="stable")  # NaN goes last
    joints = np.take_along_axis(joints, order[..., None], axis=-2)
    if joints.ndim == 2:
        joints = joints[~np.isnan(joints[:, 0])]
    return Solutions(joints, margin_of(joints, limits))


def inverse_best(
    T: ArrayLike,
    wrist: ArrayLike,
    tool: ArrayLike | None = None,
    near: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Floats:
    """The first of `inverse` for each pose, (..., 9), in flat memory; NaN where there is none."""
    T, limits = np.asarray(T, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    shape = T.shape[:-2]
    flat = T.reshape(-1, 4, 4)
    cranks = kr6.snap_to_range(np.asarray(wrist, dtype=np.float64), limits[6:])
    cranks = np.broadcast_to(cranks, (*shape, 3)).reshape(-1, 3)
    hints = None
    if near is not None:
        hints = np.broadcast_to(np.asarray(near, dtype=np.float64), (*shape, 9)).reshape(-1, 9)
    out = np.empty((len(flat), 9))
    for i in range(0, len(flat), BLOCK):
        part = slice(i, i + BLOCK)
        target = flange_target(flat[part], cranks[part], tool, mount_yaw)
        hint = None if hints is None else hints[part]
        branches = _branches(target, cranks[part], hint, limits)
        cost = -margin_of(branches, limits) if hint is None else _distance(branches, hint)
        out[part] = _pick(branches, cost)
    return out.reshape(*shape, 9)


def auto(
    T: ArrayLike,
    tool: ArrayLike | None = None,
    near: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Floats:
    """Joints (..., 9) with the wrist pose chosen: far from the limits, and near to `near`.

    The largest of margin minus distance to `near` is sought, both in radians: the margin is that of
    the joint nearest to its limit, the distance the root mean square over the joints (0 without
    `near`). A grid over the crank angles, then steps uphill: the same input gives the same answer.
    NaN where no wrist pose reaches. Poses are searched together: in arrays of 1,000 each takes
    some 1.5 ms, with `near` 3; alone, ten times as long.
    """
    T, limits = np.asarray(T, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    shape = T.shape[:-2]
    flat = T.reshape(-1, 4, 4)
    hints = None
    if near is not None:
        hints = np.broadcast_to(np.asarray(near, dtype=np.float64), (*shape, 9)).reshape(-1, 9)
    frame = NO_TOOL if tool is None else np.asarray(tool, dtype=np.float64)
    cranks = best_cranks(Field(flat, frame, hints, limits, mount_yaw))
    branches = _branches(flange_target(flat, cranks, tool, mount_yaw), cranks, hints, limits)
    cost = -margin_of(branches, limits)
    if hints is not None:
        cost = cost + _distance(branches, hints)
    return _pick(branches, cost).reshape(*shape, 9)


def _branches(target: Floats, cranks: Floats, near: Floats | None, limits: Floats) -> Floats:
    """The arm's branches with the wrist's joints, (n, 8, 9), each turn nearest to `near` in range.

    Without `near`, nearest to the middle of the range, which is also the turn of largest margin.
    """
    q = kr6.inverse(target, None if near is None else near[..., :6])
    wanted = limits[:6].mean(axis=1) if near is None else near[..., None, :6]
    return join(kr6.snap_to_range(turned(q, wanted, limits[:6]), limits[:6]), cranks)


def _distance(q: Floats, near: ArrayLike) -> Floats:
    """Root mean square difference (..., K) of joints (..., K, 9) from `near` (..., 9), rad."""
    difference = q - np.asarray(near, dtype=np.float64)[..., None, :]
    return np.asarray(np.sqrt((difference * difference).mean(axis=-1)))


def _pick(branches: Floats, cost: Floats) -> Floats:
    """The cheapest of the branches (n, 8, 9)."""
    best = np.nan_to_num(cost, nan=np.inf).argmin(axis=-1)
    return np.asarray(np.take_along_axis(branches, best[..., None, None], axis=-2)[..., 0, :])
