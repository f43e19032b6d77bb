"""The robot's model for other programs: URDF and MJCF as text; no I/O."""

from sphmctl.robots.export.mjcf import mjcf
from sphmctl.robots.export.urdf import joint_values, urdf

__all__ = ["joint_values", "mjcf", "urdf"]
