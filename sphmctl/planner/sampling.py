"""Samples of the blocks on the 4 ms grid, and the check of every one before anything moves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats, Knot, NamedPoint
from sphmctl.planner.blocks import Block
from sphmctl.planner.legs import Setup
from sphmctl.planner.places import RANGE_TOLERANCE_RAD, joint_problem
from sphmctl.planner.timing import Slice
from sphmctl.planner.way import Way

GRID_S = 0.004
"""The arm controller's own step; the servos' cycle is longer."""

MERGE_S = 0.0002
"""A grid instant this close to a knot is left out: differences over tiny steps are rounding."""

RATE_TOLERANCE = 1.005
"""Differences between samples are means over 4 ms, never above the peak; the rest is rounding."""

POSE_TOLERANCE_M = 1e-9
"""Between forward kinematics of a sample's joints and its tool pose; rounding is 1e-15."""


@dataclass(frozen=True)
class Samples:
    """A plan's rows and where they belong.

    Attributes:
        t: s, (n,).
        joints: rad, (n, 9).
        tool: m, (n, 4, 4), in the base.
        block: which block a row belongs to, (n,); the row that ends it included.
        u: share of the block's leg, (n,).
        ends: the row that ends each block.
    """

    t: Floats
    joints: Floats
    tool: Floats
    block: NDArray[np.int64]
    u: Floats
    ends: tuple[int, ...]


def sample(blocks: list[Block], setup: Setup, start: Floats) -> Samples:
    """Rows of all blocks from the start (9,) on."""
    t, u, owner, ends = [np.zeros(1)], [np.zeros(1)], [np.zeros(1, dtype=np.int64)], []
    begin_s, rows = 0.0, 1
    for index, block in enumerate(blocks):
        end_s = begin_s + block.duration_s
        steps = np.arange(int(begin_s / GRID_S), int(end_s / GRID_S) + 2)
        grid = np.asarray(GRID_S * steps, dtype=np.float64)
        grid = grid[(grid > begin_s + MERGE_S) & (grid < end_s - MERGE_S)]
        w = np.zeros(len(grid)) if block.law is None else block.law.progress(grid - begin_s)
        t.append(np.append(grid, end_s))
        u.append(np.append(block.u[0] + (block.u[1] - block.u[0]) * w, block.u[1]))
        owner.append(np.full(len(grid) + 1, index))
        rows += len(grid) + 1
        ends.append(rows - 1)
        begin_s = end_s
    shares = np.concatenate(u)
    joints, tool = np.empty((rows, 9)), np.empty((rows, 4, 4))
    joints[0], tool[0] = start, setup.tool_pose(start[None])[0]
    row = 1
    for _, group in groupby(range(len(blocks)), key=lambda index: id(blocks[index].leg)):
        members = list(group)
        stop = ends[members[-1]] + 1
        leg = blocks[members[0]].leg
        if leg is None:
            joints[row:stop], tool[row:stop] = joints[row - 1], tool[row - 1]
        else:
            joints[row:stop], tool[row:stop] = leg.at(shares[row:stop])
        row = stop
    return Samples(np.concatenate(t), joints, tool, np.concatenate(owner), shares, tuple(ends))


def knots(blocks: list[Block], rows: Samples) -> tuple[Knot, ...]:
    """The arm's blocks."""
    return tuple(
        Knot(end, rows.joints[end, :6].copy(), block.velocity, block.acceleration)
        for block, end in zip(blocks, rows.ends, strict=True)
        if block.velocity is not None and block.acceleration is not None
    )


def named(blocks: list[Block], rows: Samples, start: str) -> tuple[NamedPoint, ...]:
    """The named points in the order in which they are visited."""
    found = [NamedPoint(start, 0)] if start else []
    found += [
        NamedPoint(block.name, end)
        for block, end in zip(blocks, rows.ends, strict=True)
        if block.name
    ]
    return tuple(found)


def where(blocks: list[Block], rows: Samples, row: int) -> str:
    """The place of a row in words."""
    if not blocks:
        return "the start"
    block = blocks[int(rows.block[row])]
    return block.move.where if block.leg is None else block.leg.where(float(rows.u[row]))


def rates(t: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Speeds (n - 1, k) between rows, accelerations (n, k) at rows of values (n, k).

    A plan begins and ends at rest: a step of the grid before its first row, and one after its last.
    """
    dt = np.diff(t)[:, None]
    speed = np.diff(values, axis=0) / dt
    rest = np.zeros((1, values.shape[1]))
    steps = np.vstack([[[GRID_S]], dt, [[GRID_S]]])
    return speed, np.diff(np.vstack([rest, speed, rest]), axis=0) / ((steps[1:] + steps[:-1]) / 2.0)


def _steps(blocks: list[Block], rows: Samples) -> NDArray[np.int64]:
    """The rows without those of knots that are passed without a stop, within a step of the grid.

    Differences over a small part of a step would show what no controller sees.
    """
    keep = np.ones(len(rows.t), dtype=bool)
    for (block, following), end in zip(pairwise(blocks), rows.ends, strict=False):
        if isinstance(block.law, Slice) and isinstance(following.law, Slice):
            keep[end] = block.law.law is not following.law.law or block.leg is not following.leg
    return np.flatnonzero(keep)


def verify(blocks: list[Block], rows: Samples, setup: Setup, scale: float) -> list[Problem]:
    """Every row against ranges, speeds, accelerations, tool limits and forward kinematics."""
    found: list[Problem] = []
    low, high = setup.ranges.T
    excess = np.maximum(low - rows.joints, rows.joints - high)
    for joint in np.flatnonzero(excess.max(axis=0) > RANGE_TOLERANCE_RAD):
        row = int(excess[:, joint].argmax())
        value = float(rows.joints[row, joint])
        limit = float(low[joint] if value < low[joint] else high[joint])
        found.append(joint_problem(where(blocks, rows, row), int(joint), value, limit, "angle"))
    kept = _steps(blocks, rows)
    speed, acceleration = rates(rows.t[kept], rows.joints[kept])
    for kind, rate, limits in (
        ("speed", np.abs(speed), setup.speeds),
        ("acceleration", np.abs(acceleration), setup.accelerations),
    ):
        for joint in np.flatnonzero((rate > limits * RATE_TOLERANCE).any(axis=0)):
            row = int(rate[:, joint].argmax())
            value, limit = float(rate[row, joint]), float(limits[joint])
            here = where(blocks, rows, int(kept[row + (kind == "speed")]))
            found.append(joint_problem(here, int(joint), value, limit, kind))
    apart = np.linalg.norm(setup.tool_pose(rows.joints)[:, :3, 3] - rows.tool[:, :3, 3], axis=1)
    row = int(np.nan_to_num(apart, nan=np.inf).argmax())
    if not apart[row] <= POSE_TOLERANCE_M:
        message = "the joints do not reproduce the tool's pose: the wrist does not close there"
        found.append(Problem(where(blocks, rows, row), JOINT_NAMES[6], None, None, message))
    return found + _tool_problems(blocks, rows, scale)


def _tool_problems(blocks: list[Block], rows: Samples, scale: float) -> list[Problem]:
    """The tool's speed and acceleration, each row against what the path asks for there."""
    kept = _steps(blocks, rows)
    if len(kept) < 2:
        return []
    allowed = _allowed(blocks, rows, kept)
    # An acceleration spans two steps, and at a knot these may belong to two moves.
    around = np.concatenate([allowed[:1, 1], allowed[:, 1], allowed[-1:, 1]])
    limits = allowed[:, 0], np.maximum(around[1:], around[:-1])
    found = []
    pairs = zip(rates(rows.t[kept], rows.tool[kept, :3, 3]), limits, strict=True)
    for power, (rate, limit) in enumerate(pairs, 1):
        unit = "mm/s" if power == 1 else "mm/s2"
        # Slower plans may ramp up as the path allows at full speed.
        wanted = 1000.0 * limit * max(scale, 1.0) ** power
        value = 1000.0 * np.linalg.norm(rate, axis=1)
        row = int((value / wanted).argmax())
        if value[row] > wanted[row] * RATE_TOLERANCE:
            reached, most = float(value[row]), float(wanted[row])
            message = f"the tool would reach {reached:.6g} {unit}; {most:.6g} is asked for"
            here = where(blocks, rows, int(kept[row + (power == 1)]))
            found.append(Problem(here, "tool", reached, most, message))
    return found


def _allowed(blocks: list[Block], rows: Samples, kept: NDArray[np.int64]) -> Floats:
    """Tool speed (m/s) and acceleration (m/s2), (n - 1, 2), allowed between the kept rows (n,).

    Where a step passes from one move into the next, the more generous of the two counts; where the
    tool follows no path, nothing is asked for.
    """
    out = np.full((max(len(kept) - 1, 0), 2), np.inf)
    owner = rows.block[kept[1:]]
    for _, group in groupby(range(len(blocks)), key=lambda index: id(blocks[index].leg)):
        members = list(group)
        leg = blocks[members[0]].leg
        if not isinstance(leg, Way) or leg.length_m == 0.0:
            continue
        low, high = np.searchsorted(owner, [members[0], members[-1] + 1])
        s = rows.u[kept[low : high + 1]] * leg.length_m
        s[0] = 0.0  # that row ended the leg before
        asked = np.stack(leg.contour.speeds(s), axis=1)
        out[low:high] = np.maximum(asked[1:], asked[:-1])
    return out
