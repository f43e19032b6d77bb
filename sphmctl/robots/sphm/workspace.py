"""The workspace of the arm alone and of the hybrid: extents, cuts and their areas, samples.

Each figure is found twice: extents by optimisation and areas from the exact outline; and, beside
them, as a cloud of random samples has them. Samples fall short of the extents, and cells that they
mark stand out over the outline or stay empty: that difference is the bias that is told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats
from sphmctl.robots.sphm import workspace_extents as extents
from sphmctl.robots.sphm.workspace_robot import Plane, Robot
from sphmctl.robots.sphm.workspace_sampling import Cloud, sample
from sphmctl.robots.sphm.workspace_slices import (
    Grid,
    Slice,
    arm_alone,
    cells,
    grid_for,
    hand_of,
    marked,
    slice_of,
)

__all__ = ["Cloud", "Grid", "Plane", "Region", "Robot", "Survey", "survey"]

SAMPLED_CELL_M = 0.020
"""Of the grid that samples mark: 200,000 leave two dozen for a cell on average."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Region:
    """A cut through a workspace: how far it goes, m, and its area, m2."""

    horizontal_m: Pair
    z_m: Pair
    area_m2: float


@dataclass(frozen=True)
class Survey:
    """What was found of a robot in a plane.

    Attributes:
        arm, hybrid: extents found by optimisation, free of collisions; area of the exact cut,
            which does not know collisions.
        sampled_arm, sampled_hybrid: the same of all samples.
        free_arm, free_hybrid: the same of the samples that touch nothing.
        cloud: the samples.
        arm_cut, hybrid_cut: the cuts at axis 1 = 0.
    """

    robot: Robot
    plane: Plane
    arm: Region
    hybrid: Region
    sampled_arm: Region
    sampled_hybrid: Region
    free_arm: Region
    free_hybrid: Region
    cloud: Cloud
    arm_cut: Slice
    hybrid_cut: Slice

    @property
    def mirrored(self) -> bool:
        """Whether samples count on both sides of axis 1."""
        return self.robot.mirrored(self.plane)

    def grid(self, cell_m: float) -> Grid:
        """A grid over all of the plane's workspace."""
        return grid_for(float(self.hybrid_cut.distance_m[-1]), cell_m)


def survey(
    robot: Robot, plane: Plane, samples: int, seed: int, threads: int | None = None
) -> Survey:
    """Everything about one plane.

    Raises:
        InfeasibleError: the ranges leave the plane out, or obstacles leave no room.
    """
    robot.check(plane)
    arm_cut, hybrid_cut = slice_of(robot, arm_alone()), slice_of(robot, hand_of(robot))
    cloud = sample(robot, plane, samples, seed, threads)
    reach_m = float(hybrid_cut.distance_m[-1])
    fine, coarse = grid_for(reach_m), grid_for(reach_m, SAMPLED_CELL_M)

    def exact(reached: extents.Extents, cut: Slice) -> Region:
        area_m2 = fine.area_m2(cells(cut, plane, fine))
        return Region(reached.horizontal_m, reached.z_m, area_m2)

    mirrored = robot.mirrored(plane)
    return Survey(
        robot,
        plane,
        exact(extents.of_arm(robot, plane), arm_cut),
        exact(extents.of_hybrid(robot, plane), hybrid_cut),
        _sampled(cloud.flange_m, mirrored, coarse),
        _sampled(cloud.point_m, mirrored, coarse),
        _sampled(cloud.flange_m[cloud.arm_free], mirrored, coarse),
        _sampled(cloud.point_m[cloud.free], mirrored, coarse),
        cloud,
        arm_cut,
        hybrid_cut,
    )


def _sampled(point_m: Floats, mirrored: bool, grid: Grid) -> Region:
    """What points (n, 2) alone tell of a region."""
    if not len(point_m):
        return Region((np.nan, np.nan), (np.nan, np.nan), 0.0)
    (left, low), (right, high) = point_m.min(axis=0).tolist(), point_m.max(axis=0).tolist()
    if mirrored:
        left, right = min(left, -right), max(right, -left)
    return Region((left, right), (low, high), grid.area_m2(marked(point_m, mirrored, grid)))
