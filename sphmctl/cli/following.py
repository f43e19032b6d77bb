"""Joints for the poses of a file, in order: continuous where they are a path, else pose by pose."""

from __future__ import annotations

import sys
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sphmctl.cli.common import say
from sphmctl.cli.robot import Robot
from sphmctl.motion import Floats
from sphmctl.robots import sphm

SLOW_ROWS = 1000
"""From so many rows on, searching the wrist pose takes more than some seconds, and we say so."""

TOGETHER = 1000
"""Poses whose wrist poses are searched in one go: more are not faster."""

FEW_ROWS = 1000
"""So many rows of a long path tell on which of the arm's branches to begin."""

SMOOTH_RAD = 0.35
"""A joint that moves further (20 degrees) from row to row has changed branch, as in a plan."""

APART_M, APART_RAD = 0.05, 0.35
"""Poses further apart (50 mm, 20 degrees) are no neighbours on a path."""

MOST_APART = 1000
"""With more such rows a file is no path: following it would take milliseconds for each of them."""

MOST_PATHS = 20
"""With more such rows no wrist poses are sought along the paths between: seconds for each."""


def follow(robot: Robot, cranks: Floats | None, near: Floats | None, T: Floats) -> Floats:
    """Joints (n, 9) for poses (n, 4, 4); rows of NaN have no answer.

    Args:
        robot: with its tool.
        cranks: crank angles (3,); None: they are searched.
        near: joints (9,) just before the first pose, or None.
        T: tool poses in the arm's base frame.
    """
    if cranks is not None:
        return _with_cranks(robot, cranks, near, T)
    if not len(T):
        return np.empty((0, 9))
    if len(T) >= SLOW_ROWS:
        say(f"searching the wrist pose of {len(T)} rows; --wrist T7,T8,T9 would be faster")
    cuts = np.flatnonzero(_apart(T)) + 1
    if len(cuts) > MOST_PATHS:
        return _each(robot, T)
    out = np.full((len(T), 9), np.nan)
    for rows in np.split(np.arange(len(T)), cuts):
        out[rows] = _path(robot, near, T[rows])
        answered = out[rows][~np.isnan(out[rows, 0])]
        near = answered[-1] if len(answered) else near
    return out


def _with_cranks(robot: Robot, cranks: Floats, near: Floats | None, T: Floats) -> Floats:
    setup = (robot.tool, robot.ranges, robot.mount_yaw)
    if np.count_nonzero(_apart(T)) > MOST_APART:
        return sphm.inverse_apart(T, cranks, near, *setup)
    if near is None and len(T) > 2 * FEW_ROWS:
        # A few rows tell where to begin; if that leads through all rows, no other begin is tried.
        few = sphm.inverse_along(T[:: len(T) // FEW_ROWS], cranks, None, *setup)
        joints = sphm.inverse_along(T, cranks, few[0], *setup)
        with np.errstate(invalid="ignore"):
            smooth = np.abs(np.diff(joints, axis=0)).max() < SMOOTH_RAD  # NaN is not
        if smooth:
            return joints
    return sphm.inverse_along(T, cranks, near, *setup)


def _path(robot: Robot, near: Floats | None, T: Floats) -> Floats:
    """Joints along one path, its wrist poses searched over the whole of it."""
    joints = _whole(robot, near, T)
    if joints is not None:
        return joints
    reached = ~np.isnan(_each(robot, T)[:, 0])
    if reached.all():
        return _row_by_row(robot, near, T)
    out = np.full((len(T), 9), np.nan)
    ends = np.flatnonzero(np.diff(reached)) + 1
    for rows in np.split(np.arange(len(T)), ends):
        if reached[rows[0]]:
            joints = _whole(robot, near, T[rows])
            out[rows] = _row_by_row(robot, near, T[rows]) if joints is None else joints
            near = out[rows[-1]]
    return out


def _whole(robot: Robot, near: Floats | None, T: Floats) -> Floats | None:
    """Joints along a path that one policy resolves as a whole, or None."""
    # The planner takes longer to import than a fixed wrist takes to solve.
    from sphmctl.planner.legs import Setup
    from sphmctl.planner.policies import Auto, Resolved
    from sphmctl.planner.redundancy import resolve

    start = None
    if near is not None:
        start = _nearest(robot, near, T[0])
        if np.isnan(start[0]):
            return None
    limits = robot.ranges, robot.speeds, robot.accelerations
    setup = Setup(robot.tool, np.eye(4), robot.mount_yaw, *limits)
    way = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    found = resolve(T, np.concatenate([[0.0], np.cumsum(way)]), Auto(), setup, start)
    return found.joints if isinstance(found, Resolved) else None


def _row_by_row(robot: Robot, near: Floats | None, T: Floats) -> Floats:
    """Each row near to the one before."""
    out = np.full((len(T), 9), np.nan)
    for row in _watched(range(len(T))):
        out[row] = _nearest(robot, near, T[row])
        near = near if np.isnan(out[row, 0]) else out[row]
    return out


def _each(robot: Robot, T: Floats) -> Floats:
    """Each pose by itself."""
    out = np.empty((len(T), 9))
    for row in _watched(range(0, len(T), TOGETHER)):
        out[row : row + TOGETHER] = _nearest(robot, None, T[row : row + TOGETHER])
    return out


def _nearest(robot: Robot, near: Floats | None, T: Floats) -> Floats:
    return sphm.auto(T, robot.tool, near, robot.ranges, robot.mount_yaw)


def _apart(T: Floats) -> NDArray[np.bool_]:
    """Which poses (n - 1,) lie too far from the one before to go on from it."""
    moved = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) > APART_M
    cosine = ((T[1:, :3, :3] * T[:-1, :3, :3]).sum(axis=(1, 2)) - 1.0) / 2.0
    return np.asarray(moved | (cosine < np.cos(APART_RAD)))


def _watched(rows: range) -> Iterable[int]:
    """The same rows, with a progress bar on a terminal."""
    if not sys.stderr.isatty():
        return rows
    from rich.console import Console
    from rich.progress import track

    return track(rows, "searching", console=Console(stderr=True), transient=True)
