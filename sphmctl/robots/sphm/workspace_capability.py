"""Capability map: which ways the tool can point at each place of the plane, arm and hybrid.

The arm stays in its plane, and so does what it points with: the flange's axis for the arm alone,
the platform's normal for the hybrid, whose wrist tilts towards leg 1 or away from it. Tools beside
the platform's axis are taken as if they were on it. Metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
from sphmctl.robots.sphm.workspace_robot import Bools, Plane, Robot
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


def capability(robot: Robot, plane: Plane, grid: Grid) -> Capability:
    """The map of a plane; where bodies are in the way is not looked at."""
    level = np.array([[0.0, FLANGE_M, 0.0]])
    arm, hybrid = _reached(robot, grid, level), _reached(robot, grid, _wrist_states(robot))
    if plane == "a1_90":
        mirrored = (HEADINGS // 2 - np.arange(HEADINGS)) % HEADINGS
        arm = arm | arm[::-1][:, :, mirrored]
        hybrid = hybrid | hybrid[::-1][:, :, mirrored]
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


def _wrist_states(robot: Robot) -> Floats:
    """Where the point is across and along the flange's axis, and the platform's lean, (n, 3)."""
    states = []
    for direction in (0.0, np.pi):
        steepest = float(steepest_tilt(direction, robot.ranges[6:]))
        for tilt in np.linspace(0.0, steepest, TILTS + 1):
            low, high = heave_range(direction, tilt, robot.ranges[6:])
            cranks = rrs.inverse(direction, tilt, np.linspace(low, max(low, high), HEAVES))
            towards = direction + robot.mount_yaw
            point = robot.hand(np.clip(cranks, *robot.ranges[6:].T))
            across = point[:, 0] * np.cos(towards) + point[:, 1] * np.sin(towards)
            states += [
                np.stack([way * across, point[:, 2], np.full(HEAVES, way * tilt)], axis=1)
                for way in (1.0, -1.0)
            ]
    found = np.concatenate(states)
    return np.unique(found[~np.isnan(found).any(axis=1)], axis=0)


def _reached(robot: Robot, grid: Grid, states: Floats) -> Bools:
    """Which headings (horizontal, z, HEADINGS) one of the states makes with the arm's help."""
    heading = TURN * np.arange(HEADINGS) / HEADINGS
    places = np.meshgrid(grid.horizontal_m, grid.z_m, heading, indexing="ij")
    out = np.zeros(places[0].size, dtype=bool)
    longest = float(np.hypot(states[:, 0], states[:, 1]).max())
    x, z, heading = (part.ravel() for part in places)
    away = np.hypot(x - AXIS2_FORWARD_M, z - AXIS2_HEIGHT_M)
    todo = np.flatnonzero(away <= UPPER_ARM_M + FOREARM_LENGTH_M + longest)
    for across, along, tilt in states:
        flange = heading[todo] - tilt
        c, s = np.cos(flange), np.sin(flange)
        forward = x[todo] - AXIS2_FORWARD_M - along * c + across * s
        up = z[todo] - AXIS2_HEIGHT_M - along * s - across * c
        made = _arm_does(robot, forward, up, flange)
        out[todo[made]] = True
        todo = todo[~made]
    return out.reshape(places[0].shape)


def _arm_does(robot: Robot, forward: Floats, up: Floats, flange: Floats) -> Bools:
    """Whether the arm holds its wrist centre there, seen from axis 2, with the flange that way."""
    (low2, high2), (low3, high3) = robot.ranges[1:3]
    square = forward * forward + up * up
    cosine = (square - UPPER_ARM_M**2 - FOREARM_LENGTH_M**2) / (
        2.0 * UPPER_ARM_M * FOREARM_LENGTH_M
    )
    found = np.zeros(len(flange), dtype=bool)
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
        leans = [(swing >= low) & (swing <= high) for low, high in robot.swings()]
        within = (a2 >= low2) & (a2 <= high2) & (a3 >= low3) & (a3 <= high3)
        found[rows] |= within & np.logical_or.reduce(leans)
    return found
