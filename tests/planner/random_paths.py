"""Random paths that are feasible because they were made by smooth curves of all nine joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.legs import Setup
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix

PEN: Floats = pose_matrix([0.004, 0.0, 0.0589], [0.1, 0.05, 0.0])
SETUP = Setup(PEN, np.eye(4), 0.3, sphm.RANGES9, sphm.MAX_SPEED9, sphm.MAX_ACCELERATION9)
ROW_M = 0.0005
SWINGS: Floats = np.radians([20.0, 12, 15, 30, 25, 40, 30, 30, 30])
LOW, HIGH = sphm.RANGES9.T


@dataclass(frozen=True)
class Made:
    """A path and the joints (n, 9) that made it."""

    joints: Floats
    target: Floats
    s_m: Floats


def forward(joints: Floats) -> Floats:
    """Tool poses."""
    return sphm.forward(joints, PEN, SETUP.mount_yaw)


def length(target: Floats) -> Floats:
    """Arc length at each pose."""
    steps = np.linalg.norm(np.diff(target[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def made(seed: int) -> Made | None:
    """0.2 to 1.5 m long; a third passes A5 = 0, a third touches a crank's limit; None if unfit."""
    g = np.random.default_rng(seed)
    u = np.linspace(0.0, 1.0, 2001)
    q = np.empty((len(u), 9))
    for joint, middle in enumerate(g.uniform(0.85 * LOW + 0.15 * HIGH, 0.15 * LOW + 0.85 * HIGH)):
        waves = zip(g.normal(size=3), g.uniform(0.0, 6.3, 3), (1, 2, 3), strict=True)
        swing = sum(a * np.sin(2.2 * k * u + phase) for a, phase, k in waves)
        q[:, joint] = middle + SWINGS[joint] / 2.0 * swing
    if seed % 3 == 0:
        q[:, 4] += np.radians(g.uniform(-2.0, 2.0)) - q[len(u) // 2, 4]
    if seed % 3 == 1:
        crank = q[:, 6 + seed // 3 % 3]
        crank -= crank.min() if seed % 2 else crank.max() - HIGH[8]
    s = length(forward(q))
    if (q < LOW).any() or (q > HIGH).any() or not 0.2 < s[-1] < 1.5:
        return None
    at = np.interp(np.linspace(0.0, s[-1], int(s[-1] / ROW_M) + 2), s, u)
    q = np.stack([np.interp(at, u, column) for column in q.T], axis=1)
    if np.abs(np.diff(q, axis=0)).max() > 0.1:
        return None
    target = forward(q)
    return Made(q, target, length(target))


def some(count: int, first: int = 0) -> list[Made]:
    """The first `count` fit paths from a seed on."""
    found: list[Made] = []
    for seed in range(first, first + 20 * count):
        path = made(seed)
        if path is not None:
            found.append(path)
        if len(found) == count:
            break
    assert len(found) == count
    return found
