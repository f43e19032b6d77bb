"""Capability map: which ways the tool can point at each place of the plane, touching nothing.

The arm stays in its plane, and so does what it points with: the flange's axis for the arm alone,
the platform's normal for the hybrid, whose wrist tilts towards leg 1 or away from it. Tools beside
the platform's axis are taken as if they were on it. A way counts if one of the poses tried for it,
with either elbow and either way of A4, is free. Metres and radians.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats
from sphmctl.robots import rrs
from sphmctl.robots.geometry import TURN
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_ANGLE_RAD,
    FOREARM_LENGTH_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.workspace_robot import AXIS_1_RAD, Bools, Plane, Robot
from sphmctl.robots.sphm.workspace_slices import Grid
from sphmctl.robots.sphm.wrist_grid import heave_range, steepest_tilt

HEADINGS = 48
"""Directions looked at in the plane: 7.5 degrees apart; one of them is straight down."""

TILTS = 3
"""Tilts of the wrist tried each way, up to the steepest, beside the level platform."""

HEAVES = 3
"""Heaves tried for each tilt, from the lowest to the highest that it leaves."""

DOWN = 3 * HEADINGS // 4
"""The heading of -90 degrees."""


@dataclass(frozen=True)
class Capability:
    """What can be pointed where, for every cell of a grid.

    Attributes:
        grid: the cells.
        arm, hybrid: headings that can be reached, (horizontal, z, HEADINGS), level first, upwards.
    """

    grid: Grid
    arm: Bools
    hybrid: Bools


@dataclass(frozen=True)
class State:
    """A pose of the wrist in the arm's plane.

    Attributes:
        across_m, along_m: the point seen from the wrist centre across the flange's axis, upwards
            with the arm level, and along it.
        lean: of the platform's normal from the flange's axis, rad, upwards alike.
        a6: with A4 at 0, rad; half a turn further with A4 at half a turn.
        cranks: rad, (3,).
    """

    across_m: float
    along_m: float
    lean: float
    a6: float
    cranks: Floats


def capability(robot: Robot, plane: Plane, grid: Grid) -> Capability:
    """The map of a plane."""
    shape = len(grid.horizontal_m), len(grid.z_m), HEADINGS
    arm, hybrid = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    flange = [State(0.0, FLANGE_M, 0.0, 0.0, robot.ranges[6:, 0])]
    wrist = _wrist_states(robot)
    mirrored = robot.mirrored(plane)
    for axis_1 in AXIS_1_RAD[plane][:1] if mirrored else AXIS_1_RAD[plane]:
        arm |= _reached(robot, axis_1, grid, flange, 0)
        hybrid |= _reached(robot, axis_1, grid, wrist, 1)
    if mirrored:
        other = (HEADINGS // 2 - np.arange(HEADINGS)) % HEADINGS
        arm, hybrid = (reached | reached[::-1][:, :, other] for reached in (arm, hybrid))
    return Capability(grid, arm, hybrid)


def share(reached: Bools) -> Floats:
    """How much of all headings is reached at each place, 0 to 1."""
    return np.asarray(reached.mean(axis=-1))


def lean(reached: Bools) -> Floats:
    """How far it may lean from straight down, either way, rad; NaN where not straight down."""
    steps = np.arange(HEADINGS // 2 + 1)
    both = reached[..., (DOWN + steps) % HEADINGS] & reached[..., (DOWN - steps) % HEADINGS]
    unbroken = np.logical_and.accumulate(both, axis=-1).sum(axis=-1)
    return np.where(unbroken > 0, (unbroken - 1) * TURN / HEADINGS, np.nan)


def _wrist_states(robot: Robot) -> list[State]:
    """Tilts and heaves of the hybrid's wrist, each kind once."""
    states: dict[tuple[float, ...], State] = {}
    for direction in (0.0, np.pi):
        steepest = float(steepest_tilt(direction, robot.ranges[6:]))
        for tilt in np.linspace(0.0, steepest, TILTS + 1):
            low, high = heave_range(direction, tilt, robot.ranges[6:])
            cranks = rrs.inverse(direction, tilt, np.linspace(low, max(low, high), HEAVES))
            towards = direction + robot.mount_yaw
            point = robot.hand(np.clip(cranks, *robot.ranges[6:].T))
            across = point[:, 0] * np.cos(towards) + point[:, 1] * np.sin(towards)
            # With A4 and A6 at 0 the flange's x axis is downwards.
            for way, a6 in ((1.0, towards + np.pi), (-1.0, towards)):
                for k in np.flatnonzero(~np.isnan(across)):
                    state = State(way * across[k], point[k, 2], way * tilt, a6, cranks[k])
                    seen = (state.across_m, state.along_m, state.lean)
                    states.setdefault(tuple(np.round(seen, 9).tolist()), state)
    return list(states.values())


def _reached(robot: Robot, axis_1: float, grid: Grid, states: list[State], which: int) -> Bools:
    """Which headings (horizontal, z, HEADINGS) one of the states makes with the arm's help.

    `which` of the collisions count: the arm's, or all.
    """
    heading = TURN * np.arange(HEADINGS) / HEADINGS
    places = np.meshgrid(grid.horizontal_m, grid.z_m, heading, indexing="ij")
    out = np.zeros(places[0].size, dtype=bool)
    x, z, heading = (part.ravel() for part in places)
    if axis_1 > 0.0:  # the arm's forward is -y there
        x, heading = -x, np.pi - heading
    away = np.hypot(x - AXIS2_FORWARD_M, z - AXIS2_HEIGHT_M)
    longest = max(float(np.hypot(state.across_m, state.along_m)) for state in states)
    todo = np.flatnonzero(away <= UPPER_ARM_M + FOREARM_LENGTH_M + longest)

    def look(todo: NDArray[np.int64]) -> None:
        for state in states:
            flange = heading[todo] - state.lean
            c, s = np.cos(flange), np.sin(flange)
            forward = x[todo] - AXIS2_FORWARD_M - state.along_m * c + state.across_m * s
            up = z[todo] - AXIS2_HEIGHT_M - state.along_m * s - state.across_m * c
            for rows, joints in _poses(robot, axis_1, state, forward, up, flange):
                new = ~out[todo[rows]]
                rows, joints = rows[new], joints[new]
                out[todo[rows[~robot.collisions(joints)[which]]]] = True
            todo = todo[~out[todo]]

    threads = len(os.sched_getaffinity(0))
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(look, (todo[k::threads] for k in range(threads))))
    return out.reshape(places[0].shape)


def _poses(
    robot: Robot, axis_1: float, state: State, forward: Floats, up: Floats, flange: Floats
) -> Iterator[tuple[NDArray[np.int64], Floats]]:
    """The rows, and their joints (n, 9), with the wrist centre there and the flange that way.

    Args:
        forward, up: of the wrist centre, seen from axis 2, (n,).
        flange: its direction in the plane, upwards, (n,).
    """
    (low2, high2), (low3, high3) = robot.ranges[1:3]
    square = forward * forward + up * up
    cosine = (square - UPPER_ARM_M**2 - FOREARM_LENGTH_M**2) / (
        2.0 * UPPER_ARM_M * FOREARM_LENGTH_M
    )
    rows = np.flatnonzero(np.abs(cosine) <= 1.0)
    bend = np.arccos(cosine[rows])
    lead = np.arctan2(
        FOREARM_LENGTH_M * np.sin(bend), UPPER_ARM_M + FOREARM_LENGTH_M * np.cos(bend)
    )
    towards = -np.arctan2(up[rows], forward[rows])
    for side in (1.0, -1.0):
        a2 = towards - side * lead
        a2 -= TURN * np.round((a2 - (low2 + high2) / 2.0) / TURN)
        a3 = FOREARM_ANGLE_RAD + side * bend
        a3 -= TURN * np.round((a3 - (low3 + high3) / 2.0) / TURN)
        swing = flange[rows] + a2 + a3
        swing -= TURN * np.round(swing / TURN)
        within = (a2 >= low2) & (a2 <= high2) & (a3 >= low3) & (a3 <= high3)
        for a4, low, high in robot.swings():
            a6 = _turned(state.a6 + a4, *robot.ranges[5].tolist())
            if a6 is None:
                continue
            good = within & (swing >= low) & (swing <= high)
            joints = np.empty((int(good.sum()), 9))
            joints[:, [0, 3, 5]] = axis_1, a4, a6
            joints[:, 1], joints[:, 2] = a2[good], a3[good]
            joints[:, 4] = -swing[good] if a4 == 0.0 else swing[good]
            joints[:, 6:] = state.cranks
            yield rows[good], joints


def _turned(angle: float, low: float, high: float) -> float | None:
    """The angle, by whole turns nearest to the middle of a range; None where that is outside."""
    middle = (low + high) / 2.0
    angle -= TURN * round((angle - middle) / TURN)
    return angle if low <= angle <= high else None
