"""The robot as a cell mounts and limits it, with a tool; what `fk` and `ik` compute with."""

from __future__ import annotations

from dataclasses import dataclass

from sphmctl.config import Cell
from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import sphm


@dataclass(frozen=True)
class Robot:
    """The robot as a cell mounts and limits it, with a tool.

    Attributes:
        tool: its frame on the platform, m, (4, 4).
        mount_yaw: leg 1 against the flange's x axis, rad.
        ranges: lowest and highest angle of the nine joints, rad, (9, 2).
        speeds, accelerations: rad/s and rad/s2, (9,).
    """

    tool: Floats
    mount_yaw: float
    ranges: Floats
    speeds: Floats
    accelerations: Floats

    @staticmethod
    def of(cell: Cell, tool: str | None) -> Robot:
        """Raises InvalidError for a tool that the cell does not have."""
        try:
            frame = cell.tool_matrix(tool)
        except InvalidError as problem:
            raise InvalidError(problem.message, "--tool") from None
        limits = cell.ranges_rad, cell.speeds_rad_s, cell.accelerations_rad_s2
        return Robot(frame, cell.mount_yaw_rad, *limits)

    def pose(self, joints: Floats) -> Floats:
        """Tool poses (..., 4, 4) of joints (..., 9), m and rad."""
        return sphm.forward(joints, self.tool, self.mount_yaw)
