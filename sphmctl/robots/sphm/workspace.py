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
from sphmctl.robots.sphm.workspace_robot import Bools, Plane, Robot
from sphmctl.robots.sphm.workspace_sampling import Cloud, sample
from sphmctl.robots.sphm.workspace_slices import (
    Grid,
    Slice,
    arm_alone,
    cells,
    grid_for,
    hand_of,
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
    """What was found of a plane.

    Attributes:
        arm, hybrid: extents found by optimisation, free of collisions; area of the exact cut,
            which does not know collisions.
        sampled_arm, sampled_hybrid: the same of all samples.
        free_arm, free_hybrid: the same of the samples that touch nothing.
        cloud: the samples.
        arm_cut, hybrid_cut: the cuts at axis 1 = 0.
    """

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

    def grid(self, cell_m: float) -> Grid:
        """A grid over all of the plane's workspace."""
        return grid_for(float(self.hybrid_cut.distance_m[-1]), cell_m)

    def marked(self, point_m: Floats, grid: Grid) -> Bools:
        """Cells (horizontal, z) in which one of the points (n, 2) lies, or its mirror image.

        At +-90 degrees of axis 1 the plane is symmetric, so that each sample counts on both sides.
        """
        out = np.zeros((len(grid.horizontal_m), len(grid.z_m)), dtype=bool)
        first = np.array([grid.horizontal_m[0], grid.z_m[0]])
        at = np.floor((point_m - first) / grid.cell_m + 0.5).astype(np.int64)
        out[at[:, 0], at[:, 1]] = True
        return out if self.plane == "a1_0" else out | out[::-1]


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
    nothing = Region((np.nan, np.nan), (np.nan, np.nan), 0.0)
    found = Survey(plane, *[nothing] * 6, cloud, arm_cut, hybrid_cut)
    fine = grid_for(float(hybrid_cut.distance_m[-1]))

    def exact(reached: extents.Extents, cut: Slice) -> Region:
        seen = reached.of(plane)
        return Region(seen.horizontal_m, seen.z_m, fine.area_m2(cells(cut, plane, fine)))

    return Survey(
        plane,
        exact(extents.of_arm(robot), arm_cut),
        exact(extents.of_hybrid(robot), hybrid_cut),
        _sampled(found, cloud.flange_m),
        _sampled(found, cloud.point_m),
        _sampled(found, cloud.flange_m[cloud.arm_free]),
        _sampled(found, cloud.point_m[cloud.free]),
        cloud,
        arm_cut,
        hybrid_cut,
    )


def _sampled(found: Survey, point_m: Floats) -> Region:
    """What samples alone tell of a region."""
    if not len(point_m):
        return Region((np.nan, np.nan), (np.nan, np.nan), 0.0)
    (left, low), (right, high) = point_m.min(axis=0).tolist(), point_m.max(axis=0).tolist()
    grid = found.grid(SAMPLED_CELL_M)
    area_m2 = grid.area_m2(found.marked(point_m, grid))
    if found.plane == "a1_90":
        left, right = min(left, -right), max(right, -left)
    return Region((left, right), (low, high), area_m2)
