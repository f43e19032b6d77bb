"""Monte Carlo in the workspace: all nine joints drawn, collisions left out, in blocks on all cores.

A random pose's tool hardly ever lies in the plane of the cut. So A4 is turned, by a quarter turn at
most where its range lets it, until it does: every sample then counts. A block has its own random
numbers, whichever thread computes it: a seed gives the same samples on any number of cores.

Threads serve, and no processes: numpy lets go of the interpreter in arrays of this size, and a
process would take longer to start than the work lasts.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_M,
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.workspace_robot import AXIS_1_RAD, Bools, Plane, Robot

BLOCK = 8192
"""Samples drawn at once: arrays of 64 kB, which numpy works on without the interpreter."""


@dataclass(frozen=True)
class Cloud:
    """Samples in a plane, those whose wrist does not close or whose A4 cannot turn left out.

    Attributes:
        joints: rad, (n, 9), with axis 1 and A4 as they put the point into the plane.
        axis_1: as it was drawn, (n,): the same point anywhere about axis 1.
        flange_m, point_m: flange and tool point in the plane: horizontal and z, (n, 2).
        arm_free, free: (n,) the arm alone, and all of the robot, touch nothing.
    """

    joints: Floats
    axis_1: Floats
    flange_m: Floats
    point_m: Floats
    arm_free: Bools
    free: Bools


def sample(robot: Robot, plane: Plane, count: int, seed: int, threads: int | None = None) -> Cloud:
    """Draw a cloud in a plane; the same for a seed, however many threads there are."""
    sizes = [min(BLOCK, count - start) for start in range(0, count, BLOCK)]
    seeds = np.random.SeedSequence(seed).spawn(len(sizes))

    def block(index: int) -> Cloud:
        return _block(robot, plane, sizes[index], np.random.default_rng(seeds[index]))

    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        parts = list(pool.map(block, range(len(sizes))))
    return Cloud(
        np.concatenate([part.joints for part in parts]),
        np.concatenate([part.axis_1 for part in parts]),
        np.concatenate([part.flange_m for part in parts]),
        np.concatenate([part.point_m for part in parts]),
        np.concatenate([part.arm_free for part in parts]),
        np.concatenate([part.free for part in parts]),
    )


def in_space(robot: Robot, cloud: Cloud, count: int) -> tuple[Floats, Floats]:
    """Flange and tool points of the first samples with axis 1 as drawn, each (n, 3), m, if free.

    What is in the way there is looked at again: obstacles stand on one side, and so do plugs.
    """
    joints = cloud.joints[:count].copy()
    side = _side(joints[:, 0])
    joints[:, 0] = cloud.axis_1[:count]
    c, s = np.cos(joints[:, 0]), np.sin(joints[:, 0])
    arm_hits, hits = robot.collisions(joints)

    def spun(place_m: Floats, hit: Bools) -> Floats:
        forward, up = place_m[:count].T
        return np.stack([c * side * forward, -s * side * forward, up], axis=1)[~hit]

    return spun(cloud.flange_m, arm_hits), spun(cloud.point_m, hits)


def _side(axis_1: Floats) -> Floats:
    """Which way the arm's forward is: at 90 degrees of axis 1 it is -y."""
    return np.where(axis_1 > 0.0, -1.0, 1.0)


def _block(robot: Robot, plane: Plane, count: int, rng: np.random.Generator) -> Cloud:
    joints = rng.uniform(robot.ranges[:, 0], robot.ranges[:, 1], (count, 9))
    drawn = joints[:, 0].copy()
    stands = np.array(AXIS_1_RAD[plane])
    joints[:, 0] = stands[(drawn > 0.0).astype(int) % len(stands)]
    hand = _hand(joints, robot.hand(joints[:, 6:]))
    joints[:, 3] = _turned_into_plane(joints[:, 3], hand, robot.ranges[3])
    usable = ~np.isnan(joints[:, 3])
    joints, drawn, hand = joints[usable], drawn[usable], hand[:, usable]
    flange, point = _places(joints, hand)
    flange[:, 0] *= _side(joints[:, 0])
    point[:, 0] *= _side(joints[:, 0])
    arm_hits, hits = robot.collisions(joints)
    return Cloud(joints, drawn, flange, point, ~arm_hits, ~hits)


def _hand(joints: Floats, point: Floats) -> Floats:
    """The tool's point from the wrist centre, (3, n): along the forearm, y and z at A4 = 0.

    Args:
        point: the same along the flange's axes, (n, 3); these turn as in `kr6.forward`.
    """
    c5, s5, c6, s6 = (f(joints[:, i]) for i in (4, 5) for f in (np.cos, np.sin))
    x, y, z = point.T
    aside = c6 * x + s6 * y
    return np.stack([c5 * z - s5 * aside, c6 * y - s6 * x, -s5 * z - c5 * aside])


def _turned_into_plane(a4: Floats, hand: Floats, limits: Floats) -> Floats:
    """A4 with the point in the arm's plane, nearest to what was drawn; NaN where out of range."""
    wanted = np.arctan2(-hand[1], hand[2])
    turned = wanted + np.pi * np.round((a4 - wanted) / np.pi)
    turned = np.where(turned > limits[1], turned - np.pi, turned)
    turned = np.where(turned < limits[0], turned + np.pi, turned)
    return np.where(turned > limits[1], np.nan, turned)


def _places(joints: Floats, hand: Floats) -> tuple[Floats, Floats]:
    """Flange and point in the arm's plane, forward and up, each (n, 2)."""
    a2, a3, a4, a5 = joints[:, 1:5].T
    lean = a2 + a3
    forward = AXIS2_FORWARD_M + UPPER_ARM_M * np.cos(a2)
    up = AXIS2_HEIGHT_M - UPPER_ARM_M * np.sin(a2)

    def place(along: Floats, above: Floats) -> Floats:
        c, s = np.cos(lean), np.sin(lean)
        return np.stack([forward + c * along + s * above, up - s * along + c * above], axis=1)

    # Without the wrist A4 would stand at 0 or half a turn, and the flange lie in the plane.
    upwards = np.where(np.cos(a4) > 0.0, -1.0, 1.0)
    flange = place(
        FOREARM_M + FLANGE_M * np.cos(a5), FOREARM_OFFSET_M + upwards * FLANGE_M * np.sin(a5)
    )
    above = np.cos(a4) * hand[2] - np.sin(a4) * hand[1]
    return flange, place(FOREARM_M + hand[0], FOREARM_OFFSET_M + above)
