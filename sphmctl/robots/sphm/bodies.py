"""The robot's bodies as capsules, and how far they are from each other and from obstacles.

Radii enclose the parts, so a clearance is never too large by more than the figures below are wrong.
The arm's come from the corner points of its meshes in ros-industrial/kuka_experimental
(kuka_kr6_support/meshes, kr6r900sixx and kr6_agilus), read in part and rounded up: KUKA prints side
views only. The wrist's lengths are the paper's (Elsamanty et al., Appl. Sci. 2023, 13, 2088); its
thicknesses are guesses, for the paper prints none, and are said to be guesses where they stand.

Which pairs are looked at (PAIRS), and why no others:
- neighbours on the arm (and link arm with base, link arm with forearm) meet in their joints or
  nearly, and KUKA's axis ranges keep the rest of them apart;
- the elbow stays clear of the turret at every A2, and of the wrist without a tool at every A5;
- the wrist's own parts stay apart at all crank angles from 0 to 120 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs
from sphmctl.robots.capsules import between_segments, to_box, to_plane
from sphmctl.robots.kr6_model import (
    AXIS2_FORWARD_M,
    AXIS2_HEIGHT_M,
    FLANGE_M,
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.chain import ADAPTER_M, NO_TOOL

BLOCK = 1024
"""Samples per piece: the work arrays then stay in the cache."""

FAR_M = 0.020
"""Larger gaps within the robot are told as this: nobody has to care about them."""

# Hulls, for `_near`; the tests sample that they enclose what they stand for.
HULL_M = 0.100  # ball about servos, legs and platform, HULL_HEIGHT_M over the wrist's base plane
HULL_HEIGHT_M = 0.030
TOOL_HULL_M = 0.061  # furthest that O7 comes from the ball's centre, and a tool's radius
LINK_ARM_HULL_M = 0.142  # both capsules, 50 mm beside the middle
ELBOW_HULL_M = 0.125
FOREARM_HULL_M = 0.155  # elbow, forearm and hand about the line from elbow to fork
A5_FREE_RAD = float(np.radians(85.0))
"""Below this angle of A5 the wrist stays more than FAR_M from the forearm at any A6 and cranks."""
TOOL_FREE_M = 0.100
"""A tool up to this long stays as far from it below A5_FREE_RAD, whichever way it points."""

RIM_POINTS = 6
"""Corners of the platform's rim; between two of them the disc swells by 7.5 mm, less than RIM_M."""

RIM_M = 0.010
"""Half of the platform's thickness with its ball joints: a guess."""

SERVO_M = 0.0225
"""Half the diagonal of an XL430's cross-section, 28.5 x 34 mm: ROBOTIS e-manual, "Dimensions"."""

SERVO_INNER_M = 0.021
"""Where a servo begins, from the wrist's axis: 46.5 mm long, its horn 11.25 mm from one end at the
base joint, lying towards the axis: a guess, for the paper shows no drawing with sizes."""

CRANK_M = 0.008
COUPLER_M = 0.006
"""Half the thickness of the links: guesses, after the paper's photograph."""

TOOL_M = 0.005
"""Half the thickness of a tool: a guess, a pen's."""

TOOL_TIP_M = 0.010
"""So much of a tool's end may touch: it is there to. Twice TOOL_M, so that a pen that leans up to
60 degrees does not collide with what it draws on."""


@dataclass(frozen=True)
class Body:
    """A capsule: what it is called in messages, and its radius."""

    group: str
    radius_m: float


# In the order in which `_arm_segments` and `_wrist_segments` lay them.
ARM_BODIES: tuple[Body, ...] = (
    Body("base", 0.150),  # foot 204 x 204 mm
    Body("base", 0.130),  # its connectors, to x = -194
    Body("turret", 0.125),  # link 1 about axis 1
    Body("turret", 0.095),  # the same along axis 2, to y = +-129
    Body("link arm", 0.092),  # link 2: 258 mm wide, 140 deep; two side by side
    Body("link arm", 0.092),
    Body("elbow", 0.085),  # link 3 along axis 3
    Body("forearm", 0.066),  # links 3 and 4 about axis 4
    Body("forearm", 0.052),  # link 4's fork: 106 mm wide, 104 deep; two side by side
    Body("forearm", 0.052),
    Body("hand", 0.053),  # link 5
)
WRIST_BODIES: tuple[Body, ...] = (
    *[Body("servos", SERVO_M)] * 3,
    *[Body("legs", CRANK_M)] * 3,
    *[Body("legs", COUPLER_M)] * 3,
    *[Body("platform", RIM_M)] * (RIM_POINTS + RIM_POINTS // 2),
    Body("tool", TOOL_M),
)
BODIES = ARM_BODIES + WRIST_BODIES
LINK_ARM, ELBOW, HAND = 4, 6, len(ARM_BODIES) - 1
HAND_LENGTH_M = 0.030
"""Link 5's capsule begins in the wrist centre; its far end then lies on the flange."""

GROUPS = tuple(dict.fromkeys(body.group for body in BODIES))
FIXED_GROUPS = ("base",)
"""They stand still, so that no motion brings them to an obstacle (and the table bears them)."""
RADII_M: Floats = np.array([body.radius_m for body in BODIES])

OF_WRIST = ("servos", "legs", "platform", "tool")
PAIRS: tuple[tuple[str, str], ...] = (
    *[(ours, "forearm") for ours in OF_WRIST],
    *[(ours, other) for ours in OF_WRIST for other in ("link arm", "turret", "base")],
    ("tool", "elbow"),
    ("elbow", "base"),
    *[(ours, other) for ours in ("forearm", "hand") for other in ("turret", "base")],
)
"""Which groups `clearances` compares: the column's names."""


@dataclass(frozen=True)
class Box:
    """An obstacle: its centre's pose in the arm's base (4, 4), half of its size (3,), m."""

    name: str
    pose: Floats
    half_m: Floats

    def distance(self, p: Floats, d: Floats) -> Floats:
        """From segments p to p + d."""
        return to_box(p, d, self.pose, self.half_m)


@dataclass(frozen=True)
class Plane:
    """An obstacle: everything behind a point (3,), m, as its normal (3,), of length 1, looks."""

    name: str
    point_m: Floats
    normal: Floats

    def distance(self, p: Floats, d: Floats) -> Floats:
        """From segments p to p + d."""
        return to_plane(p, d, self.point_m, self.normal)


Obstacle = Box | Plane


def segments(
    joints: ArrayLike, tool: ArrayLike | None = None, mount_yaw: float = 0.0
) -> tuple[Floats, Floats]:
    """The axes of all BODIES in the arm's base frame: begin and extent, each (3, bodies, n).

    Args:
        joints: rad, (n, 9).
        tool: the tool's frame on the platform, (4, 4); None for none.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    tip = (NO_TOOL if tool is None else np.asarray(tool, dtype=np.float64))[:3, 3]
    ends = np.empty((2, 3, len(BODIES), len(q)))
    flange = np.ascontiguousarray(kr6.forward(q[:, :6])[:, :3].transpose(1, 2, 0))
    _lay_arm(q, ends)
    ends[0, :, HAND] = flange[:, 3] - FLANGE_M * flange[:, 2]
    ends[1, :, HAND] = flange[:, 3] - (FLANGE_M - HAND_LENGTH_M) * flange[:, 2]
    _lay_wrist(q[:, 6:], flange, tip, mount_yaw, ends[:, :, len(ARM_BODIES) :])
    return ends[0], ends[1] - ends[0]


def clearances(joints: ArrayLike, tool: ArrayLike | None = None, mount_yaw: float = 0.0) -> Floats:
    """Gaps between the groups of PAIRS, m, (n, pairs): negative where they overlap, FAR_M beyond.

    Rows whose hulls are further apart than FAR_M are not looked at more closely, which is nine
    tenths of the work. Arguments as `segments` takes them; the cranks within their ranges.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    out = np.full((len(q), len(PAIRS)), FAR_M)
    length_m = 0.0 if tool is None else float(np.linalg.norm(np.asarray(tool)[:3, 3]))
    for i in range(0, len(q), BLOCK):
        near = _near(q[i : i + BLOCK], length_m)
        some = np.flatnonzero(np.logical_or.reduce(list(near.values())))
        p, d = segments(q[i + some], tool, mount_yaw)
        for other, group_columns in _BY_OTHER:
            rows = np.flatnonzero(near[other][some])
            gap = _gaps(p, d, _OURS[other], _MEMBERS[other], rows)
            for column, ours in group_columns:
                out[i + some[rows], column] = np.minimum(gap[ours].min(axis=0), FAR_M)
    return out


def _near(q: Floats, tool_m: float) -> dict[str, NDArray[np.bool_]]:
    """Which rows of joints (n, 9) may have a gap below FAR_M to each of the groups.

    The hulls: a ball about the wrist and its tool, a capsule about elbow, forearm and hand, one
    about both halves of the link arm, one about turret and base.
    """
    flange = np.ascontiguousarray(kr6.forward(q[:, :6])[:, :3].transpose(1, 2, 0))
    centre = flange[:, 3] + (ADAPTER_M + HULL_HEIGHT_M) * flange[:, 2]
    ends = np.empty((2, 3, len(ARM_BODIES), len(q)))
    _lay_arm(q, ends)
    ball_m = max(HULL_M, TOOL_HULL_M + tool_m) + FAR_M
    nothing = np.zeros((3, 1))

    def to_ball(begin: Floats, end: Floats, radius_m: float) -> NDArray[np.bool_]:
        gap = between_segments(begin, end - begin, centre, nothing)
        return np.asarray(~(gap > radius_m + ball_m))  # rows without numbers are near

    def to_arm(body: int) -> NDArray[np.bool_]:
        gap = between_segments(elbow, fork - elbow, ends[0, :, body], extent[:, body])
        return np.asarray(~(gap > FOREARM_HULL_M + RADII_M[body] + FAR_M))

    extent = ends[1] - ends[0]
    elbow, fork = ends[:, :, ELBOW].mean(axis=0), ends[1, :, HAND - 2 : HAND].mean(axis=1)
    link = ends[:, :, LINK_ARM : LINK_ARM + 2].mean(axis=2)
    near = {
        "forearm": ~(np.abs(q[:, 4]) < A5_FREE_RAD) | (tool_m > TOOL_FREE_M),
        "link arm": to_ball(link[0], link[1], LINK_ARM_HULL_M),
        "elbow": to_ball(elbow, elbow, ELBOW_HULL_M),
    }
    for group in ("turret", "base"):
        near[group] = np.logical_or.reduce(
            [to_arm(k) | to_ball(ends[0, :, k], ends[1, :, k], RADII_M[k]) for k in _MEMBERS[group]]
        )
    return near


def obstacle_clearances(
    joints: ArrayLike,
    obstacles: tuple[Obstacle, ...],
    tool: ArrayLike | None = None,
    mount_yaw: float = 0.0,
) -> Floats:
    """Gaps between what moves and the obstacles, m, (n, pairs) in the order of `obstacle_pairs`.

    Where a body's axis itself is inside a box the gap is minus its radius, however deep it is.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    out = np.empty((len(q), len(obstacles), len(MOVING_GROUPS)))
    for i in range(0, len(q), BLOCK):
        p, d = segments(q[i : i + BLOCK], tool, mount_yaw)
        for j, obstacle in enumerate(obstacles):
            gap = obstacle.distance(p, d) - RADII_M[:, None]
            for k, group in enumerate(MOVING_GROUPS):
                out[i : i + BLOCK, j, k] = gap[_MEMBERS[group]].min(axis=0)
    return out.reshape(len(q), -1)


def obstacle_pairs(obstacles: tuple[Obstacle, ...]) -> tuple[tuple[str, str], ...]:
    """The columns of `obstacle_clearances`: group and obstacle."""
    return tuple((group, obstacle.name) for obstacle in obstacles for group in MOVING_GROUPS)


MOVING_GROUPS = tuple(group for group in GROUPS if group not in FIXED_GROUPS)
_MEMBERS = {group: [i for i, body in enumerate(BODIES) if body.group == group] for group in GROUPS}
# What is compared with each group on the far side: all bodies at once, then each column's share.
_OURS = {
    other: [i for ours, theirs in PAIRS if theirs == other for i in _MEMBERS[ours]]
    for other in dict.fromkeys(theirs for _, theirs in PAIRS)
}
_BY_OTHER = [
    (
        other,
        [
            (column, [ours.index(i) for i in _MEMBERS[pair[0]]])
            for column, pair in enumerate(PAIRS)
            if pair[1] == other
        ],
    )
    for other, ours in _OURS.items()
]


def _gaps(
    p: Floats, d: Floats, ours: list[int], theirs: list[int], rows: NDArray[np.int64]
) -> Floats:
    """The gap (ours, rows) between each of our bodies and the nearest of theirs."""
    mine = p[:, ours][..., rows], d[:, ours][..., rows]
    nearest = np.full((len(ours), len(rows)), np.inf)
    for k in theirs:
        gap = between_segments(*mine, p[:, k][:, None, rows], d[:, k][:, None, rows])
        nearest = np.minimum(nearest, gap - (RADII_M[ours] + RADII_M[k])[:, None])
    return nearest


def _lay_arm(q: Floats, ends: Floats) -> None:
    """Both ends of the ARM_BODIES' axes (2, 3, bodies, n), as `kr6.forward` has the joints."""
    a1, a2, a3, a4 = q[:, :4].T
    c1, s1, c2, s2 = np.cos(a1), np.sin(a1), np.cos(a2), np.sin(a2)
    cb, sb, c4, s4 = np.cos(a2 + a3), np.sin(a2 + a3), np.cos(a4), np.sin(a4)
    elbow = AXIS2_FORWARD_M + UPPER_ARM_M * c2, AXIS2_HEIGHT_M - UPPER_ARM_M * s2

    def lay(body: int, end: int, radius: ArrayLike, side: ArrayLike, height: ArrayLike) -> None:
        """One end, given in the arm's plane and beside it."""
        ends[end, 0, body] = c1 * radius + s1 * side
        ends[end, 1, body] = c1 * side - s1 * radius
        ends[end, 2, body] = height

    def on_forearm(
        along: float, side: ArrayLike, up: ArrayLike
    ) -> tuple[Floats, ArrayLike, Floats]:
        """A point of the forearm's frame at axis 3, in the arm's plane and beside it."""
        return elbow[0] + along * cb + up * sb, side, elbow[1] - along * sb + up * cb

    for end, z in enumerate((0.05, 0.18)):
        ends[end, :, 0] = np.array([[0.0], [0.0], [z]])
    for end, x in enumerate((0.0, -0.135)):
        ends[end, :, 1] = np.array([[x], [0.0], [0.083]])
    for end, z in enumerate((0.27, 0.40)):
        lay(2, end, 0.0, 0.0, z)
    for end, side in enumerate((-0.075, 0.075)):
        lay(3, end, 0.0, side, AXIS2_HEIGHT_M)
    for body, side in ((4, -0.05), (5, 0.05)):
        lay(body, 0, AXIS2_FORWARD_M, side, AXIS2_HEIGHT_M)
        lay(body, 1, elbow[0], side, elbow[1])
    for end, side in enumerate((-0.04, 0.04)):
        lay(6, end, *on_forearm(0.025, side, np.float64(0.005)))
    up = np.float64(FOREARM_OFFSET_M)
    for end, along in enumerate((0.06, 0.28)):
        lay(7, end, *on_forearm(along, 0.0, up))
    for body, side in ((8, -0.02), (9, 0.02)):  # they turn with A4 about the forearm
        for end, along in enumerate((0.30, 0.415)):
            lay(body, end, *on_forearm(along, side * c4, up - side * s4))


def _lay_wrist(cranks: Floats, flange: Floats, tip: Floats, mount_yaw: float, ends: Floats) -> None:
    """Both ends of the WRIST_BODIES' axes (2, 3, bodies, n); the flange is (3, 4, n)."""
    c, s = np.cos(mount_yaw), np.sin(mount_yaw)
    out = flange[:, 2]
    across = c * flange[:, 0] + s * flange[:, 1], c * flange[:, 1] - s * flange[:, 0]
    centre = flange[:, 3] + ADAPTER_M * out
    platform = np.ascontiguousarray(rrs.forward(cranks)[:, :3].transpose(1, 2, 0))
    x, y, z, shift = (
        across[0] * v[0] + across[1] * v[1] + out * v[2] for v in platform.transpose(1, 0, 2)
    )
    rim = [
        centre + shift + rrs.PLATFORM_RADIUS_M * (np.cos(angle) * x + np.sin(angle) * y)
        for angle in 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    ]
    for leg, (cosine, sine) in enumerate(rrs.LEG_DIRECTIONS.T):
        radial = cosine * across[0] + sine * across[1]
        joint = centre + rrs.BASE_RADIUS_M * radial
        theta = cranks[:, leg]
        knee = joint + rrs.CRANK_M * (np.sin(theta) * radial + np.cos(theta) * out)
        ends[0, :, leg], ends[1, :, leg] = centre + SERVO_INNER_M * radial, joint
        ends[0, :, 3 + leg], ends[1, :, 3 + leg] = joint, knee
        ends[0, :, 6 + leg], ends[1, :, 6 + leg] = knee, rim[2 * leg]
    half = RIM_POINTS // 2
    for k, corner in enumerate(rim):
        ends[0, :, 9 + k], ends[1, :, 9 + k] = corner, rim[(k + 1) % RIM_POINTS]
    for k in range(half):
        ends[0, :, 9 + RIM_POINTS + k], ends[1, :, 9 + RIM_POINTS + k] = rim[k], rim[k + half]
    length_m = float(np.linalg.norm(tip))
    share = max(1.0 - TOOL_TIP_M / length_m, 0.0) if length_m else 0.0
    ends[0, :, -1] = centre + shift
    ends[1, :, -1] = centre + shift + share * (tip[0] * x + tip[1] * y + tip[2] * z)
