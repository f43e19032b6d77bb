"""The furthest points of the workspace, found by optimisation over the joints.

A pattern search from many starts at once, for all four directions at once: each start tries both
ways of every joint and takes the best; where none is better its step is halved. It needs no
derivative, which vanishes where a crank is in line with its coupler, just where the tool is
furthest out, and it takes limits and collisions by leaving such a way out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sphmctl.errors import InfeasibleError
from sphmctl.motion import Floats
from sphmctl.robots import kr6, sphm
from sphmctl.robots.sphm.workspace_robot import AXIS_1_RAD, Plane, Robot

STARTS = 12
"""For each direction: the best of DRAWN."""

DRAWN = 3000
SEED = 1
FIRST_STEP = 0.1
"""Of a joint's range."""

LAST_STEP = 1e-5
"""Of a joint's range, 0.003 degrees: at a smooth maximum that is below 1e-8 m."""

MOST_ROUNDS = 400
"""Some 120 are usual."""

ARM_JOINTS = (1, 2, 4)
"""What moves the arm in its plane: A2, A3, A5."""

ALL_JOINTS = (1, 2, 4, 5, 6, 7, 8)
"""The same with A6 and the cranks. A1 and A4 stay, so that the arm stays in its plane."""

DIRECTIONS: dict[Plane, Floats] = {
    "a1_0": np.array([[-1.0, 0, 0], [1.0, 0, 0], [0, 0, -1.0], [0, 0, 1.0]]),
    "a1_90": np.array([[0, -1.0, 0], [0, 1.0, 0], [0, 0, -1.0], [0, 0, 1.0]]),
}
"""Backwards and forwards in the plane, down, up."""


@dataclass(frozen=True)
class Extents:
    """How far the point gets in a plane, m; and the joints (4, 9) that bring it there."""

    horizontal_m: tuple[float, float]
    z_m: tuple[float, float]
    joints: Floats


def of_arm(robot: Robot, plane: Plane) -> Extents:
    """Those of the flange's centre, for the arm without the wrist."""
    return _search(robot, plane, ARM_JOINTS, lambda q: kr6.forward(q[:, :6])[:, :3, 3], 0)


def of_hybrid(robot: Robot, plane: Plane) -> Extents:
    """Those of the tool's point."""
    return _search(
        robot,
        plane,
        ALL_JOINTS,
        lambda q: sphm.forward(q, robot.tool, robot.mount_yaw)[:, :3, 3],
        1,
    )


def _search(
    robot: Robot,
    plane: Plane,
    moved: tuple[int, ...],
    place: Callable[[Floats], Floats],
    which: int,
) -> Extents:
    """The extents of `place`; `which` of the collisions count: the arm's, or all."""
    q = _starts(robot, plane, moved, place, which)
    count = len(q) // len(DIRECTIONS[plane])
    towards = np.repeat(DIRECTIONS[plane], count, axis=0)
    value = np.einsum("ij,ij->i", place(q), towards)
    low, high = robot.ranges.T
    ways = np.repeat(np.eye(9)[list(moved)], 2, axis=0) * (high - low)
    ways[1::2] *= -1.0
    fixed = np.setdiff1d(np.arange(9), moved)
    step = np.full(len(q), FIRST_STEP)
    for _ in range(MOST_ROUNDS):
        live = np.flatnonzero(step > LAST_STEP)
        if not len(live):
            break
        tried = np.clip(q[live, None] + step[live, None, None] * ways, low, high)
        tried[:, :, fixed] = q[live, None][:, :, fixed]
        flat = tried.reshape(-1, 9)
        reached = np.einsum("ij,ij->i", place(flat), np.repeat(towards[live], len(ways), axis=0))
        better = np.flatnonzero(reached > np.repeat(value[live], len(ways)))
        good = better[~robot.collisions(flat[better])[which]]
        score = np.full(len(flat), -np.inf)
        score[good] = reached[good]
        table = score.reshape(len(live), -1)
        pick, gained = table.argmax(axis=1), table.max(axis=1)
        won = gained > value[live]
        q[live[won]] = tried[won, pick[won]]
        value[live[won]] = gained[won]
        step[live[~won]] *= 0.5
    furthest = value.reshape(4, count)
    left, right, down, up = furthest.max(axis=1).tolist()
    chosen = q.reshape(4, count, 9)[np.arange(4), furthest.argmax(axis=1)]
    return Extents((-left, right), (-down, up), chosen)


def _starts(
    robot: Robot,
    plane: Plane,
    moved: tuple[int, ...],
    place: Callable[[Floats], Floats],
    which: int,
) -> Floats:
    """Joints (4 x starts, 9) to begin at: the best of random ones for each direction in turn.

    As many wherever axis 1 stands: what is in the way may differ.
    """
    columns = list(moved)
    low, high = robot.ranges.T
    drawn = np.tile(np.clip(np.zeros(9), low, high), (DRAWN, 1))
    drawn[:, 3] = robot.a4_in_plane()
    rng = np.random.default_rng(SEED)
    drawn[:, columns] = rng.uniform(low[columns], high[columns], (DRAWN, len(columns)))
    chosen = []
    for axis_1 in AXIS_1_RAD[plane]:
        drawn[:, 0] = axis_1
        free = drawn[~robot.collisions(drawn)[which]]
        best = np.argsort(place(free) @ DIRECTIONS[plane].T, axis=0)[-STARTS:]
        chosen.append(free[best.T])
    starts = np.concatenate(chosen, axis=1)
    if not starts.size:
        raise InfeasibleError(f"the robot collides in each of {DRAWN} poses tried")
    return starts.reshape(-1, 9)
