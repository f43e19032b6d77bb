"""The robot as links and capsules, each in its link's frame; what URDF, MJCF and view are made of.

With all joints at 0 the arm's frames are parallel to its base; the flange's z is outward. Metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots import rrs, sphm
from sphmctl.robots.geometry import from_parts, invert
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_M,
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm import bodies
from sphmctl.robots.sphm.chain import ADAPTER_M


@dataclass(frozen=True)
class Axis:
    """One joint of the arm: where it is on the link before, and the axis it turns about.

    Attributes:
        joint: "A1" .. "A6".
        link: the link that it moves.
        at_m: on the link before, (3,).
        sense: the axis, (3,), positive as KUKA counts.
    """

    joint: str
    link: str
    at_m: tuple[float, float, float]
    sense: tuple[int, int, int]


# As in `kr6.forward`: Rz(-A1) Ry(A2) Ry(A3) Rx(-A4) Ry(A5) Rx(-A6).
AXES: tuple[Axis, ...] = tuple(
    Axis(joint, f"link_{k}", at, sense)
    for k, joint, at, sense in zip(
        range(1, 7),
        JOINT_NAMES[:6],
        (
            (0.0, 0.0, 0.0),
            (AXIS2_FORWARD_M, 0.0, AXIS2_HEIGHT_M),
            (UPPER_ARM_M, 0.0, 0.0),
            (0.0, 0.0, FOREARM_OFFSET_M),
            (FOREARM_M, 0.0, 0.0),
            (0.0, 0.0, 0.0),
        ),
        ((0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)),
        strict=True,
    )
)
FLANGE_AT_M = (FLANGE_M, 0.0, 0.0)
"""Of the flange on link 6, which it turns on by FLANGE_PITCH_RAD about y."""
FLANGE_PITCH_RAD = np.pi / 2.0
WRIST_AT_M = (0.0, 0.0, ADAPTER_M)
"""Of the wrist's base plane on the flange, turned by the mount yaw about z."""

BASE, FLANGE, WRIST, PLATFORM = "base_link", "flange", "wrist_base", "platform"

LINK_OF_GROUP = {
    "base": BASE,
    "turret": "link_1",
    "link arm": "link_2",
    "elbow": "link_3",
    "forearm": "link_4",  # what stands still beside it lies about axis 4 and looks the same turned
    "hand": "link_5",
    "servos": WRIST,
    "platform": PLATFORM,
    "tool": PLATFORM,
}


@dataclass(frozen=True)
class Capsule:
    """What lies within a radius of a segment, on a link."""

    link: str
    group: str
    begin_m: Floats
    end_m: Floats
    radius_m: float

    @property
    def volume_m3(self) -> float:
        """Both half balls included."""
        length = float(np.linalg.norm(self.end_m - self.begin_m))
        return np.pi * self.radius_m**2 * (length + 4.0 / 3.0 * self.radius_m)


def frames_at_zero() -> dict[str, Floats]:
    """Each link's frame (4, 4) in the arm's base with all joints at 0, no mount yaw."""
    frames = {BASE: np.eye(4)}
    pose = np.eye(4)
    for axis in AXES:
        pose = pose @ from_parts(np.eye(3), np.array(axis.at_m))
        frames[axis.link] = pose
    joints = np.zeros(9)
    platform = sphm.forward(joints)
    frames[PLATFORM] = platform
    frames[WRIST] = platform @ invert(rrs.forward(joints[6:]))
    return frames


def capsules(tool: Floats | None = None) -> tuple[Capsule, ...]:
    """The robot's bodies of the collision check without the legs, each on its link.

    The mount yaw turns wrist and platform, and the bodies on them stay as they are.

    Args:
        tool: its frame on the platform, (4, 4); None for none.
    """
    begin, extent = bodies.segments(np.zeros((1, 9)), tool)
    inverse = {link: invert(frame) for link, frame in frames_at_zero().items()}
    laid = []
    for k, group in enumerate(bodies.BODY_GROUPS):
        if group not in LINK_OF_GROUP or (group == "tool" and tool is None):
            continue
        link = LINK_OF_GROUP[group]
        ends = np.stack([begin[:, k, 0], begin[:, k, 0] + extent[:, k, 0]])
        placed = ends @ inverse[link][:3, :3].T + inverse[link][:3, 3]
        placed[np.abs(placed) < 1e-12] = 0.0  # rounding of the way there and back
        laid.append(Capsule(link, group, placed[0], placed[1], float(bodies.RADII_M[k])))
    return tuple(laid)


def words(*values: float) -> str:
    """Numbers as both formats take them, precise to rounding."""
    return " ".join(f"{float(value) + 0.0:.16g}" for value in values)
