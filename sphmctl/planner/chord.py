"""Lines at equal steps, and how many stops they need.

Between two stops the controller drives a straight line of axis space, which is none of the tool's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.legs import NO_RANGES, Direct, Line, Setup
from sphmctl.robots import sphm
from sphmctl.robots.geometry import angle_between

TOLERANCE_M = 0.0003
"""Of the tool point against the line. The path's tolerance is 0.5 mm; the rest is for the wrist's
lag and the servos' steps."""

TURN_TOLERANCE_RAD = float(np.radians(0.5))
"""Of the tool's orientation, which nobody gave a tolerance for."""

KNOT_LIMIT = 100
"""Knots on one line; a line that needs more passes too close to a singularity to be meant."""

POINTS = 720
"""Steps on a line, at least, at whose ends it is examined. Knots stand there too: 2, 3, 4, 5, 6, 8,
9 and 10 divide them."""

SPACING_M = 0.0005
"""Distance between the points on long lines."""


@dataclass(frozen=True)
class Curve:
    """A line at equal steps.

    Attributes:
        u: shares of the way, (n,).
        joints: (n, 9).
        pose: tool in the base, (n, 4, 4).
    """

    line: Line
    u: Floats
    joints: Floats
    pose: Floats

    @staticmethod
    def of(line: Line) -> Curve:
        """Examine a line; joints are NaN where it cannot be driven."""
        u = np.linspace(0.0, 1.0, max(POINTS, int(line.length_m / SPACING_M)) + 1)
        return Curve(line, u, *line.at(u))

    @property
    def length_m(self) -> float:
        """How far the tool point goes."""
        return self.line.length_m

    @property
    def setup(self) -> Setup:
        """The robot."""
        return self.line.setup

    def at(self, u: Floats) -> tuple[Floats, Floats]:
        """Joints (n, 9) and tool poses (n, 4, 4) at any u (n,): exact, on the curve's branch."""
        near = np.stack([np.interp(u, self.u, column) for column in self.joints.T], axis=1)
        pose, setup = self.line.pose(u), self.setup
        joints = sphm.inverse_best(
            setup.base @ pose, self.line.cranks(u), setup.tool, near, NO_RANGES, setup.mount_yaw
        )
        return joints, pose


Leg: TypeAlias = Curve | Direct


@dataclass(frozen=True)
class Split:
    """A line cut into blocks of equal length.

    Attributes:
        edges: the points of the curve at which blocks begin and end, rising from 0.
        error_m: largest distance of the tool point from the line.
        turn_rad: largest difference from the line's orientation.
    """

    edges: tuple[int, ...]
    error_m: float
    turn_rad: float

    @property
    def count(self) -> int:
        """How many blocks."""
        return len(self.edges) - 1

    @property
    def excess(self) -> float:
        """The larger error as a share of its tolerance."""
        return max(self.error_m / TOLERANCE_M, self.turn_rad / TURN_TOLERANCE_RAD)


def split(curve: Curve) -> Split | None:
    """The line in as few equal blocks as the tolerances allow; None if KNOT_LIMIT are too few."""
    found = _examine(curve, 1)
    while found.excess > 1.0:
        # The error falls with the square of the count; the step stays short of that.
        count = max(found.count + 1, int(found.count * found.excess**0.5 * 0.9))
        if count > KNOT_LIMIT:
            return None
        found = _examine(curve, count)
    while found.count > 1:
        fewer = _examine(curve, found.count - 1)
        if fewer.excess > 1.0:
            break
        found = fewer
    return found


def _examine(curve: Curve, count: int) -> Split:
    """Drive the chords as the controller does, the cranks at the arm's progress, and measure."""
    edges = tuple(round(i * (len(curve.u) - 1) / count) for i in range(count + 1))
    chords = curve.joints.copy()
    followed = curve.joints.copy()
    for begin, end in pairwise(edges):
        here = curve.joints[begin : end + 1]
        chord = here[0] + np.linspace(0.0, 1.0, len(here))[:, None] * (here[-1] - here[0])
        chords[begin : end + 1, :6] = followed[begin : end + 1, :6] = chord[:, :6]
        followed[begin : end + 1, 6:] = _cranks_at_progress(here, chord)
    error = turn = 0.0
    for joints in (chords, followed):
        reached = curve.line.setup.tool_pose(joints)
        error = max(error, float(_beside(curve.line, reached[:, :3, 3]).max()))
        turn = max(turn, float(angle_between(reached[:, :3, :3], curve.pose[:, :3, :3]).max()))
    return Split(edges, error, turn)


def _cranks_at_progress(here: Floats, chord: Floats) -> Floats:
    """Cranks (n, 3) of the line where its leading axis stands as it does on the chord."""
    moved = np.abs(here[-1, :6] - here[0, :6])
    lead = int(np.argmax(moved))
    along = here[:, lead] * np.sign(here[-1, lead] - here[0, lead])
    if moved[lead] == 0.0 or np.any(np.diff(along) <= 0.0):
        return here[:, 6:]
    wanted = chord[:, lead] * np.sign(here[-1, lead] - here[0, lead])
    return np.stack([np.interp(wanted, along, here[:, leg]) for leg in (6, 7, 8)], axis=1)


def _beside(line: Line, points: Floats) -> Floats:
    """Distances (n,) of points (n, 3) from the line's segment."""
    way = line.end[:3, 3] - line.begin[:3, 3]
    square = float(way @ way)
    apart = points - line.begin[:3, 3]
    share = np.clip(apart @ way / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(apart - share[:, None] * way, axis=1))
