"""What planner, daemon and drivers hand to each other: plans, setpoints, feedback. Data only.

Metres, radians and seconds throughout; joints are in the order A1..A6, theta7..theta9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

JOINT_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6", "theta7", "theta8", "theta9")


@dataclass(frozen=True)
class Knot:
    """One point-to-point block of the arm: where it ends and how fast it may go.

    Attributes:
        sample: index of the plan's sample at which the block ends.
        joints: arm joints A1..A6 at the end, rad, shape (6,).
        velocity: block speed as a share (0, 1] of every axis's machine maximum.
        acceleration: block acceleration as a share (0, 1] of every axis's machine maximum.
    """

    sample: int
    joints: Floats
    velocity: float
    acceleration: float


@dataclass(frozen=True)
class NamedPoint:
    """A point that the path names, and the plan's sample that stands on it."""

    name: str
    sample: int


@dataclass(frozen=True)
class Plan:
    """Nine joint-angle streams over time, and the arm's knots.

    Attributes:
        name: the path's name.
        t: sample times from 0, s, shape (n,), strictly rising.
        joints: rad, shape (n, 9).
        tool: tool pose in the path's base frame at each sample, m, shape (n, 4, 4).
        knots: the arm's blocks in order; each ends at rest.
        points: the named points in the order in which they are visited.
        notes: what the user should know about the plan, one sentence each.
        tool_on_platform: the tool's frame on the platform, m, shape (4, 4).
        base_in_world: the path's base frame in the arm's base frame, m, shape (4, 4).
    """

    name: str
    t: Floats
    joints: Floats
    tool: Floats
    knots: tuple[Knot, ...]
    points: tuple[NamedPoint, ...]
    notes: tuple[str, ...]
    tool_on_platform: Floats
    base_in_world: Floats

    @property
    def duration_s(self) -> float:
        """Time of the last sample, s."""
        return float(self.t[-1])
