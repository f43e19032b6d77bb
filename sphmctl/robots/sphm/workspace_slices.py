"""The exact cut through the workspace by the arm's own plane, for the arm alone and the hybrid.

Everything beyond axis 2 turns about it with A2. So at each distance from axis 2 the reachable
points form one arc: from the lowest angle that elbow and hand can bring about, less what A2 can
turn down, to the highest, plus what it can turn up. Metres and radians; collisions do not count.

In the arm's plane the hand is a bar from the wrist centre, of a length within a range, that leans
from the forearm by A5. The wrist's tilt adds to that: the platform shifts sideways, and A6 or the
tilt's direction brings the shift into the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots.geometry import TURN
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_ANGLE_RAD,
    FOREARM_LENGTH_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.workspace_robot import Bools, Plane, Robot

DISTANCES = 1200
"""Rows of the table: 0.9 mm apart."""

ELBOWS = 48
"""Angles of A3 tried for each distance and elbow, upwards and downwards. Between two of them the
end of A5's range is interpolated: the outline is then within 0.2 mm."""

LENGTHS = 9
"""Lengths of the hand tried: the outline comes from the longest, holes from the shortest;
those between count where the arm can hardly move."""

CRANKS = 17
"""Angles of each crank in the table of what the hand can be: 7.5 degrees apart."""

CELL_M = 0.0025
"""Of the grid that areas are counted on: an outline of 7 m then errs by some 0.1 % of the area."""

ROUNDING = 1e-12
"""Of a cosine: an arm stretched exactly is stretched."""


Pair = tuple[float, float]


@dataclass(frozen=True)
class Hand:
    """Lengths from the wrist centre to the point, m, and how far each may lean aside, rad."""

    length_m: Floats
    aside_rad: Floats


@dataclass(frozen=True)
class Slice:
    """Arcs about axis 2: distance, lowest and highest angle over level; NaN where nothing is."""

    distance_m: Floats
    low_rad: Floats
    high_rad: Floats

    def contains(self, x_m: Floats, z_m: Floats) -> Bools:
        """Which points of the arm's plane, x forward of axis 1 and z over the floor, are in it."""
        forward, up = x_m - AXIS2_FORWARD_M, z_m - AXIS2_HEIGHT_M
        distance = np.hypot(forward, up)
        out = distance <= self.distance_m[-1]
        near = distance[out]
        low = np.interp(near, self.distance_m, self.low_rad)
        high = np.interp(near, self.distance_m, self.high_rad)
        angle = np.arctan2(
            np.broadcast_to(up, out.shape)[out], np.broadcast_to(forward, out.shape)[out]
        )
        out[out] = np.mod(angle - low, TURN) <= high - low
        return np.asarray(out)


@dataclass(frozen=True)
class Grid:
    """Square cells over the plane: their middles, m; the plane of axis 1 is between two of them."""

    horizontal_m: Floats
    z_m: Floats
    cell_m: float

    def area_m2(self, cells: Bools) -> float:
        """The area of the marked cells."""
        return float(cells.sum()) * self.cell_m**2


def arm_alone() -> Hand:
    """The flange's centre."""
    return Hand(np.array([FLANGE_M]), np.zeros(1))


def hand_of(robot: Robot) -> Hand:
    """What the hybrid's wrist and tool make of the hand."""
    one = np.linspace(0.0, 1.0, CRANKS)
    share = np.stack(np.meshgrid(one, one, one), axis=-1).reshape(-1, 3)
    low, high = robot.ranges[6:].T
    point = robot.hand(low + share * (high - low))
    point = point[~np.isnan(point[:, 0])]
    across = np.hypot(point[:, 0], point[:, 1])
    length, aside = np.hypot(across, point[:, 2]), np.arctan2(across, point[:, 2])
    lengths = np.linspace(length.min(), length.max(), LENGTHS)
    step = max(float(lengths[1] - lengths[0]), ROUNDING)
    near = np.abs(length[:, None] - lengths) <= 0.5 * step
    return Hand(lengths, np.where(near, aside[:, None], 0.0).max(axis=0))


def slice_of(robot: Robot, hand: Hand) -> Slice:
    """The cut by the plane in which axis 1 holds the arm."""
    straightest = float(np.clip(FOREARM_ANGLE_RAD, *robot.ranges[2])) - FOREARM_ANGLE_RAD
    reach_m = abs(UPPER_ARM_M + FOREARM_LENGTH_M * np.exp(1j * straightest)) + hand.length_m.max()
    distance = np.linspace(ROUNDING, reach_m, DISTANCES)
    low, high = np.full(DISTANCES, np.inf), np.full(DISTANCES, -np.inf)
    for length, aside in zip(hand.length_m.tolist(), hand.aside_rad.tolist(), strict=True):
        leans = [(a - aside, b + aside) for _, a, b in robot.swings()]
        for elbow in _elbows(robot, distance, length):
            down, up = _angles(distance[:, None], length, elbow, leans)
            low, high = np.minimum(low, down), np.maximum(high, up)
    empty = low > high
    lowest, highest = robot.ranges[1]
    return Slice(
        distance,
        np.where(empty, np.nan, low - highest),
        np.where(empty, np.nan, high - lowest),
    )


def _elbows(robot: Robot, distance: Floats, length: float) -> list[Floats]:
    """Angles of A3 (n, ELBOWS) with which the hand can get to a distance, upwards and downwards.

    From hand and wrist stretched in one line to them folded on one. They stand closer towards
    both, where the hand's lean goes with the root of the angle.
    """
    wrist = np.stack([distance + length, np.abs(distance - length)])
    cosine = (wrist**2 - UPPER_ARM_M**2 - FOREARM_LENGTH_M**2) / (
        2.0 * UPPER_ARM_M * FOREARM_LENGTH_M
    )
    bend = np.arccos(np.clip(cosine, -1.0, 1.0))
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, ELBOWS))
    found = []
    for side in (1.0, -1.0):
        first, last = np.clip(FOREARM_ANGLE_RAD + side * bend, *robot.ranges[2])[:, :, None]
        found.append(first + (last - first) * share)
    return found


def _angles(
    distance: Floats, length: float, elbow: Floats, leans: list[Pair]
) -> tuple[Floats, Floats]:
    """Lowest and highest angle over level, (n,), with A2 at 0, that the point has at distances.

    Args:
        distance: from axis 2, m, (n, 1).
        elbow: angles of A3, (n, ELBOWS).
        leans: how far the hand may lean from the forearm.

    Returns:
        inf and -inf where it has none.
    """
    bend = elbow - FOREARM_ANGLE_RAD
    x, z = UPPER_ARM_M + FOREARM_LENGTH_M * np.cos(bend), -FOREARM_LENGTH_M * np.sin(bend)
    wrist, angle = np.hypot(x, z), np.arctan2(z, x)  # of the wrist centre
    cosine = (distance**2 - wrist**2 - length**2) / (2.0 * wrist * length)
    reached = np.abs(cosine) <= 1.0 + ROUNDING
    lean = np.arccos(np.clip(cosine, -1.0, 1.0))
    gain = np.arctan2(length * np.sin(lean), wrist + length * np.cos(lean))
    low, high = np.full(len(distance), np.inf), np.full(len(distance), -np.inf)
    for side in (1.0, -1.0):
        seen = angle + side * gain
        swing = angle + side * lean + elbow
        swing -= TURN * np.round(swing / TURN)
        good = reached & np.logical_or.reduce([(swing >= a) & (swing <= b) for a, b in leans])
        low = np.minimum(low, np.where(good, seen, np.inf).min(axis=1))
        high = np.maximum(high, np.where(good, seen, -np.inf).max(axis=1))
        row, k = np.nonzero(good[:, 1:] != good[:, :-1])
        for limit in {end for pair in leans for end in pair}:
            end = _between(limit, swing[row, k], swing[row, k + 1], seen[row, k], seen[row, k + 1])
            np.fmin.at(low, row, end)
            np.fmax.at(high, row, end)
    return low, high


def _between(limit: float, s0: Floats, s1: Floats, v0: Floats, v1: Floats) -> Floats:
    """What goes from v0 to v1 while s goes from s0 to s1, where s is at a limit; NaN if never."""
    with np.errstate(all="ignore"):
        share = (limit - s0) / (s1 - s0)
    passed = (share >= 0.0) & (share <= 1.0) & (np.abs(s1 - s0) < np.pi)
    return np.where(passed, v0 + share * (v1 - v0), np.nan)


def grid_for(reach_m: float, cell_m: float = CELL_M) -> Grid:
    """A grid over everything within a reach of axis 2, mirrored or not."""
    half = int(np.ceil((reach_m + AXIS2_FORWARD_M) / cell_m)) + 1
    horizontal: Floats = np.asarray((np.arange(-half, half) + 0.5) * cell_m, dtype=np.float64)
    return Grid(horizontal, AXIS2_HEIGHT_M + horizontal, cell_m)


def cells(cut: Slice, plane: Plane, grid: Grid) -> Bools:
    """Which cells (horizontal, z) have their middle in the cut by a plane."""
    inside = cut.contains(grid.horizontal_m[:, None], grid.z_m[None, :])
    return inside if plane == "a1_0" else inside | inside[::-1]


def marked(point_m: Floats, mirrored: bool, grid: Grid) -> Bools:
    """Cells (horizontal, z) that hold one of the points (n, 2), or the mirror image of one."""
    out = np.zeros((len(grid.horizontal_m), len(grid.z_m)), dtype=bool)
    first = np.array([grid.horizontal_m[0], grid.z_m[0]])
    at = np.floor((point_m - first) / grid.cell_m + 0.5).astype(np.int64)
    out[at[:, 0], at[:, 1]] = True
    return out | out[::-1] if mirrored else out
