"""The robot as a path uses it, and straight lines of joint space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.config import Cell
from sphmctl.motion import Floats
from sphmctl.pathfile import Move, Path
from sphmctl.planner.places import place
from sphmctl.robots import sphm
from sphmctl.robots.geometry import angle_between, invert

NO_RANGES: Floats = np.array([[-np.inf, np.inf]] * 9)
"""The way is sought without ranges, so that a refusal can say by how much it is beyond."""


@dataclass(frozen=True)
class Setup:
    """The robot as one path uses it; SI.

    Attributes:
        tool: the tool's frame on the platform, (4, 4).
        base: the path's base in the arm's base frame, (4, 4).
        mount_yaw: leg 1 against the flange's x axis, rad.
        ranges: (9, 2); speeds, accelerations: (9,).
    """

    tool: Floats
    base: Floats
    mount_yaw: float
    ranges: Floats
    speeds: Floats
    accelerations: Floats

    @staticmethod
    def of(path: Path, cell: Cell) -> Setup:
        """What `cell` gives for `path`. Raises InvalidError for an unknown tool or frame."""
        return Setup(
            cell.tool_matrix(path.tool),
            cell.frame_matrix(path.base),
            cell.mount_yaw_rad,
            cell.ranges_rad,
            cell.speeds_rad_s,
            cell.accelerations_rad_s2,
        )

    def tool_pose(self, joints: Floats) -> Floats:
        """Tool poses in the base (n, 4, 4) of joints (n, 9); NaN where the wrist does not close."""
        return np.asarray(invert(self.base) @ sphm.forward(joints, self.tool, self.mount_yaw))

    def on_flange(self, cranks: Floats) -> Floats:
        """The tool's poses on the flange (n, 4, 4) of crank angles (n, 3)."""
        return np.asarray(sphm.platform_in_flange(cranks, self.mount_yaw) @ self.tool)


@dataclass(frozen=True)
class Direct:
    """A straight line of joint space, all nine joints together."""

    setup: Setup
    move: Move
    begin_joints: Floats
    end_joints: Floats

    length_m = 0.0

    def at(self, u: Floats) -> tuple[Floats, Floats]:
        """Joints (n, 9) and tool poses (n, 4, 4) at u (n,)."""
        joints = self.begin_joints + u[:, None] * (self.end_joints - self.begin_joints)
        joints[u >= 1.0] = self.end_joints
        return joints, self.setup.tool_pose(joints)

    def move_at(self, u: float) -> Move:
        """The move that draws it."""
        return self.move

    def where(self, u: float) -> str:
        """The place at u in words."""
        return place(self.move, u, 0.0)


def turn_between(begin: Floats, end: Floats, u: Floats) -> Floats:
    """Rotations (n, 3, 3) at shares u of the shortest turn from one (3, 3) to another.

    Rodrigues' formula about the axis of begin^T end. Half a turn has no defined axis; the callers
    refuse it.
    """
    angle = float(angle_between(begin, end))
    D = begin.T @ end
    axis = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    norm = float(np.linalg.norm(axis))
    if norm == 0.0:
        return np.broadcast_to(begin, (len(u), 3, 3))
    x, y, z = axis / norm
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    part = (u * angle)[:, None, None]
    return np.asarray(begin @ (np.eye(3) + np.sin(part) * K + (1.0 - np.cos(part)) * (K @ K)))
