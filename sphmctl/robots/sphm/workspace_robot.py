"""Whose workspace: ranges, tool, obstacles; and the two vertical planes that it is cut by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.errors import InfeasibleError
from sphmctl.motion import Floats
from sphmctl.robots.kr6_model import FLANGE_M, RANGE_TOLERANCE_RAD
from sphmctl.robots.sphm.bodies import (
    PAIRS,
    WRIST_BODIES,
    Obstacle,
    clearances,
    obstacle_clearances,
    obstacle_pairs,
)
from sphmctl.robots.sphm.chain import NO_TOOL, RANGES9, platform_in_flange

Plane: TypeAlias = Literal["a1_0", "a1_90"]
Bools: TypeAlias = NDArray[np.bool_]

AXIS_1_RAD: dict[Plane, tuple[float, ...]] = {"a1_0": (0.0,), "a1_90": (-np.pi / 2.0, np.pi / 2.0)}
"""Where axis 1 stands. Axis 2 is 25 mm before axis 1, so at 0 the cut is not symmetric; at -90 and
90 it is the same cut and its mirror image together. Elsamanty et al., Appl. Sci. 2023, 13, 2088,
Tables 3 and 4, whose captions have the two the wrong way round."""

ON_WRIST = frozenset(group for group, _ in WRIST_BODIES)
"""Groups of bodies that the arm alone does not carry."""


@dataclass(frozen=True)
class Robot:
    """What decides on the workspace.

    Attributes:
        ranges: of the nine joints, rad, (9, 2).
        tool: the tool's frame on the platform, (4, 4); only its origin counts.
        mount_yaw: of the wrist on the flange, rad.
        obstacles: what the robot must not touch.
    """

    ranges: Floats = field(default_factory=lambda: RANGES9)
    tool: Floats = field(default_factory=lambda: NO_TOOL)
    mount_yaw: float = 0.0
    obstacles: tuple[Obstacle, ...] = ()

    def mirrored(self, plane: Plane) -> bool:
        """Whether a point of the plane that is free is so on the other side of axis 1 as well.

        At 90 degrees of axis 1 it is, for at -90 the same pose has it there; but not where
        obstacles stand, which need not be on both sides.
        """
        return plane == "a1_90" and not self.obstacles

    def hand(self, cranks: ArrayLike) -> Floats:
        """The tool's point seen from the wrist centre along the flange's axes, (..., 3), m."""
        platform = platform_in_flange(cranks, self.mount_yaw)
        point = platform[..., :3, :3] @ self.tool[:3, 3] + platform[..., :3, 3]
        point[..., 2] += FLANGE_M
        return np.asarray(point)

    def collisions(self, joints: Floats) -> tuple[Bools, Bools]:
        """Which joints (n, 9) collide: the arm by itself, and the whole robot."""
        gaps = clearances(joints, self.tool, self.mount_yaw)
        names = list(PAIRS)
        if self.obstacles:
            more = obstacle_clearances(joints, self.obstacles, self.tool, self.mount_yaw)
            gaps = np.hstack([gaps, more])
            names += obstacle_pairs(self.obstacles)
        arm = [not ON_WRIST & set(pair) for pair in names]
        hit = gaps < 0.0
        return np.asarray(hit[:, arm].any(axis=1)), np.asarray(hit.any(axis=1))

    def check(self, plane: Plane) -> None:
        """Raises InfeasibleError where the ranges leave out the plane."""
        low, high = np.degrees(self.ranges[0])
        for angle in np.degrees(AXIS_1_RAD[plane]):
            if not low <= angle <= high:
                raise InfeasibleError(
                    f"the plane {plane} needs A1 at {angle:g} degrees, beyond its range of "
                    f"{low:g} to {high:g}"
                )
        if not self.swings():
            low, high = np.degrees(self.ranges[3])
            raise InfeasibleError(
                f"the tool stays in the arm's plane with A4 at 0 or 180 degrees, and its range is "
                f"{low:g} to {high:g}"
            )

    def a4_in_plane(self) -> float:
        """A4 that keeps the hand in the arm's plane: 0, or a half turn where the range lacks 0."""
        low, high = self.ranges[3].tolist()
        if low <= 0.0 <= high:
            return 0.0
        return float(np.pi if high > 0.0 else -np.pi)

    def swings(self) -> list[tuple[float, float, float]]:
        """A4, and how far the hand may lean upwards from the forearm in the arm's plane then, rad.

        A5 leans it downwards with A4 at 0, upwards with A4 at half a turn.
        """
        low4, high4 = (
            self.ranges[3, 0] - RANGE_TOLERANCE_RAD,
            self.ranges[3, 1] + RANGE_TOLERANCE_RAD,
        )
        low5, high5 = (float(angle) for angle in self.ranges[4])
        found = []
        if low4 <= 0.0 <= high4:
            found.append((0.0, -high5, -low5))
        if low4 <= -np.pi or high4 >= np.pi:
            found.append((float(np.pi if high4 >= np.pi else -np.pi), low5, high5))
        return found
