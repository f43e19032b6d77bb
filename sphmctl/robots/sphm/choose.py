"""Where `auto` starts to look for a wrist pose, and how it makes sure where the arm is singular."""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots.kr6_model import FOREARM_ANGLE_RAD
from sphmctl.robots.sphm.climb import BEYOND_RAD, FAST, FINE, Field, Rows, climb

# Crank angles per leg to start from, in the middle of as many equal parts of the range; and where
# none of these is reached, from end to end of it.
GRID, FINE_GRID = 5, 13
# So many of a pose's branches are climbed from, each at its best cranks, and so many at the best
# cranks that lie in another corner of their range: one branch may have several hills.
BRANCHES, OTHERS = 6, 4
BLOCK = 1024  # poses searched at one go: their work arrays take some 10 megabytes
PART = 32  # poses whose grids are looked at together: that stays in the processor's cache
# Nearer to singular than this (rad, 3 and 6 degrees) slopes mislead: the stretched arm, A5 = 0.
ELBOW_RAD, WRIST_RAD = 0.05, 0.1
NEIGHBOURS: Floats = np.stack(np.meshgrid(*[[0.0, -1.0, 1.0]] * 3, indexing="ij"), -1).reshape(
    -1, 3
)
MOST_ROUNDS = 80


def best_cranks(field: Field) -> Floats:
    """The crank angles (n, 3) that make the field's value largest."""
    out = np.empty((len(field.T), 3))
    shares = (np.arange(GRID) + 0.5) / GRID
    for i in range(0, len(out), BLOCK):
        part = slice(i, i + BLOCK)
        near = None if field.near is None else field.near[part]
        block = Field(field.T[part], field.tool, near, field.limits, field.mount_yaw)
        joints, value = _search(block, np.arange(len(block.T)), shares)
        lost = np.flatnonzero(value < -BEYOND_RAD / 2.0)
        for row in lost:
            again = _search(block, np.array([row]), np.linspace(0.0, 1.0, FINE_GRID))
            joints[row], value[row] = again[0][0], again[1][0]
        _step_by_step(block, _singular(joints, value), joints, value)
        out[part] = joints[:, 6:]
    return out


def _search(field: Field, rows: Rows, shares: Floats) -> tuple[Floats, Floats]:
    """The best joints (k, 9) of poses `rows`, climbed to from a grid, and what they are worth."""
    parts = [_starts(field, rows[i : i + PART], shares) for i in range(0, len(rows), PART)]
    starts, joints, value = (np.concatenate(column) for column in zip(*parts, strict=True))
    joints, value = climb(field, starts, joints, value, FAST)
    order = np.lexsort((-value, starts))
    best = order[np.searchsorted(starts[order], rows)]
    return climb(field, rows, joints[best], value[best], FINE)


def _starts(field: Field, rows: Rows, shares: Floats) -> tuple[Rows, Floats, Floats]:
    """Poses, joints and values to climb from: the best cranks of each of the best branches."""
    low, high = field.limits[6:].T
    grid = np.stack(np.meshgrid(shares, shares, shares, indexing="ij"), -1).reshape(-1, 3)
    cranks = np.broadcast_to(low + (high - low) * grid, (len(rows), len(grid), 3))
    beyond = np.broadcast_to(field.beyond(cranks[0]), (*cranks.shape[:2], 4, 4))
    if field.near is not None:
        own = np.clip(field.near[rows, 6:], low, high)
        cranks = np.concatenate([own[:, None], cranks], axis=1)
        beyond = np.concatenate([field.beyond(own)[:, None], beyond], axis=1)
    each = np.repeat(rows, cranks.shape[1])
    q, value = field.branches(each, cranks.reshape(-1, 3), beyond.reshape(-1, 4, 4))
    q, value = q.reshape(len(rows), -1, 8, 6), value.reshape(len(rows), -1, 8)
    at, branch = _varied(value, (cranks > 0.5 * (low + high)) @ np.array([1, 2, 4]))
    pose = np.repeat(np.arange(len(rows)), at.shape[1])
    at, branch = at.ravel(), branch.ravel()
    best = value[pose, at, branch]
    keep = np.isfinite(best)
    keep[:: BRANCHES + OTHERS] = True
    joints = np.concatenate([q[pose, at, branch], cranks[pose, at]], axis=1)
    return rows[pose[keep]], np.nan_to_num(joints[keep]), best[keep]


def _varied(value: Floats, corner: Rows) -> tuple[Rows, Rows]:
    """Of values (n, points, 8 branches), where to start, best first: points and branches (n, k).

    The corner (n, points) says in which part of their range the cranks of a point are.
    """
    first = value.argmax(axis=1)
    apart = corner[:, :, None] != np.take_along_axis(corner, first, axis=1)[:, None]
    elsewhere = np.where(apart, value, -np.inf)
    points, branches = [], []
    for values, at, count in (
        (value, first, BRANCHES),
        (elsewhere, elsewhere.argmax(axis=1), OTHERS),
    ):
        best = np.take_along_axis(values, at[:, None], axis=1)[:, 0]
        order = np.argsort(-best, axis=1, kind="stable")[:, :count]
        points.append(np.take_along_axis(at, order, axis=1))
        branches.append(order)
    return np.concatenate(points, axis=1), np.concatenate(branches, axis=1)


def _singular(joints: Floats, value: Floats) -> Rows:
    """The rows whose joints stand near a singular pose of the arm, in which it is reached."""
    stretched = np.abs(joints[:, 2] - FOREARM_ANGLE_RAD) < ELBOW_RAD
    in_line = np.abs(joints[:, 4]) < WRIST_RAD
    return np.flatnonzero((stretched | in_line) & np.isfinite(value))


def _step_by_step(field: Field, rows: Rows, joints: Floats, value: Floats) -> None:
    """Go on to the best of all 26 neighbours, halving the steps where none is better."""
    low, high = field.limits[6:].T
    step = np.full(len(rows), FAST.first_rad / 2.0)
    for _ in range(MOST_ROUNDS):
        live = np.flatnonzero(step > FINE.last_rad)
        if not len(live):
            break
        at = rows[live]
        around = joints[at, None, 6:] + NEIGHBOURS * step[live, None, None]
        around = np.clip(around, low, high).reshape(-1, 3)
        tried, found = field.best(np.repeat(at, len(NEIGHBOURS)), around)
        tried, found = tried.reshape(len(at), -1, 9), found.reshape(len(at), -1)
        pick, each = found.argmax(axis=1), np.arange(len(at))
        better = found[each, pick] > value[at]
        joints[at[better]] = tried[each, pick][better]
        value[at[better]] = found[each, pick][better]
        step[live[~better]] /= 2.0
