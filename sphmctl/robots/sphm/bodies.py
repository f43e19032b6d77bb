"""The robot's bodies as capsules, and how far they are from each other and from obstacles.

Radii enclose the parts, so a clearance is never too large by more than the figures below are wrong.
The arm's come from the corner points of its meshes in ros-industrial/kuka_experimental
(kuka_kr6_support/meshes, kr6r900sixx and kr6_agilus), read in part and rounded up: KUKA prints side
views only. The wrist's lengths are the paper's (Elsamanty et al., Appl. Sci. 2023, 13, 2088); its
thicknesses are guesses, for the paper prints none, and are said to be guesses where they stand.

Which pairs are looked at (CHECKS), and why no others:
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
    FOREARM_OFFSET_M,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.chain import ADAPTER_M, NO_TOOL

BLOCK = 8192
"""Samples per piece: enough that Python's part does not count, and memory stays flat."""

OBSTACLE_BLOCK = 512
"""The same for obstacles, which look at all bodies of each sample at once."""

PAIR_BLOCK = 200
"""Samples of twenty bodies at once: one work array then stays below the 128 kB above which the C
library asks the kernel for each anew, which doubles the time."""

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
A5_FREE_PLATFORM_RAD = float(np.radians(105.0))
"""Below these angles of A5 servos and legs, and platform and tool, stay more than FAR_M from the
forearm at any A6 and cranks."""
TOOL_FREE_M = 0.100
"""A tool up to this long stays as far from it below that, whichever way it points."""

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


HAND_LENGTH_M = 0.030
"""Link 5's capsule begins in the wrist centre; its far end then lies on the flange."""

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Body:
    """A capsule of the arm: its name in messages, its axis in its link's frame, m.

    Links count from 0, the base. With A1..A6 = 0 every frame has x along the arm and z up; link 1
    has its origin at axis 1 on the floor, 2 at axis 2, 3 at axis 3, 4 on axis 4 above axis 3.
    """

    group: str
    radius_m: float
    link: int
    begin_m: Triple
    end_m: Triple


ARM_BODIES: tuple[Body, ...] = (
    Body("base", 0.150, 0, (0.0, 0.0, 0.050), (0.0, 0.0, 0.180)),  # foot 204 x 204 mm
    Body("base", 0.130, 0, (0.0, 0.0, 0.083), (-0.135, 0.0, 0.083)),  # plugs, to x = -194
    Body("turret", 0.125, 1, (0.0, 0.0, 0.270), (0.0, 0.0, 0.400)),  # about axis 1
    Body("turret", 0.095, 1, (0.0, -0.075, 0.400), (0.0, 0.075, 0.400)),  # along axis 2, 258 wide
    Body("link arm", 0.092, 2, (0.0, -0.050, 0.0), (0.455, -0.050, 0.0)),  # 258 wide, 140 deep:
    Body("link arm", 0.092, 2, (0.0, 0.050, 0.0), (0.455, 0.050, 0.0)),  # two side by side
    Body("elbow", 0.085, 3, (0.025, -0.040, 0.005), (0.025, 0.040, 0.005)),  # along axis 3
    Body("forearm", 0.066, 3, (0.060, 0.0, 0.035), (0.280, 0.0, 0.035)),  # about axis 4
    Body("forearm", 0.052, 4, (0.300, -0.020, 0.0), (0.415, -0.020, 0.0)),  # fork: 106 wide, 104
    Body("forearm", 0.052, 4, (0.300, 0.020, 0.0), (0.415, 0.020, 0.0)),  # deep: two again
    Body("hand", 0.053, 4, (0.420, 0.0, 0.0), (0.420, 0.0, 0.0)),  # link 5; its end: `_lay_arm`
)
LINK_ARM, ELBOW, HAND = 4, 6, len(ARM_BODIES) - 1
# In the order in which `_lay_wrist` lays them.
WRIST_BODIES: tuple[tuple[str, float], ...] = (
    *[("servos", SERVO_M)] * 3,
    *[("legs", CRANK_M)] * 3,
    *[("legs", COUPLER_M)] * 3,
    *[("platform", RIM_M)] * (RIM_POINTS + RIM_POINTS // 2),
    ("tool", TOOL_M),
)
BODY_GROUPS = (*[body.group for body in ARM_BODIES], *[group for group, _ in WRIST_BODIES])
"""Which group each body belongs to, in the order of `segments`."""
RADII_M: Floats = np.array([body.radius_m for body in ARM_BODIES] + [r for _, r in WRIST_BODIES])
GROUPS = tuple(dict.fromkeys(BODY_GROUPS))
MOVING_GROUPS = GROUPS[1:]
"""The base stands still: no motion brings it to an obstacle, and the table bears it."""
_MEMBERS = {group: [i for i, other in enumerate(BODY_GROUPS) if other == group] for group in GROUPS}

OF_WRIST = ("servos", "legs", "platform", "tool")
CHECKS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("servos", "legs"), "forearm"),
    (("platform", "tool"), "forearm"),
    (OF_WRIST, "link arm"),
    (OF_WRIST, "turret"),
    (OF_WRIST, "base"),
    (("tool",), "elbow"),
    (("forearm", "hand"), "turret"),
    (("elbow", "forearm", "hand"), "base"),
)
"""Which groups are compared with which; those of one line are looked at in the same samples."""
PAIRS = tuple((ours, other) for groups, other in CHECKS for ours in groups)
"""What the columns of `clearances` are."""


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
    """The axes of all bodies in the arm's base frame: begin and extent, each (3, bodies, n).

    Args:
        joints: rad, (n, 9).
        tool: the tool's frame on the platform, (4, 4); None for none.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    flange = _flange(q)
    wrist = _lay_wrist(q[:, 6:], flange, _tip(tool), mount_yaw)
    begin, end = np.concatenate([_lay_arm(q, flange), wrist], axis=2)
    return begin, end - begin


def clearances(joints: ArrayLike, tool: ArrayLike | None = None, mount_yaw: float = 0.0) -> Floats:
    """Gaps between the groups of PAIRS, m, (n, pairs): negative where they overlap, FAR_M beyond.

    Rows whose hulls are further apart than FAR_M are not looked at more closely, which is nine
    tenths of the work. Arguments as `segments` takes them; the cranks within their ranges.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    out = np.full((len(q), len(PAIRS)), FAR_M)
    length_m = float(np.linalg.norm(_tip(tool)))
    for i in range(0, len(q), BLOCK):
        block = q[i : i + BLOCK]
        flange = _flange(block)
        arm = _lay_arm(block, flange)
        near = _near(block[:, 4], flange, arm, length_m)
        some = np.flatnonzero(np.logical_or.reduce(near))
        wrist = _lay_wrist(block[some, 6:], flange[..., some], _tip(tool), mount_yaw)
        p, end = np.concatenate([arm[..., some], wrist], axis=2)
        d = end - p
        columns = iter(range(len(PAIRS)))
        for (groups, other), mask in zip(CHECKS, near, strict=True):
            rows = np.flatnonzero(mask[some])
            ours = [_MEMBERS[group] for group in groups]
            every = [k for members in ours for k in members]
            gap = _gaps(p, d, every, _MEMBERS[other], rows)
            for members in ours:
                least = np.minimum(gap[: len(members)].min(axis=0), FAR_M)
                out[i + some[rows], next(columns)] = least
                gap = gap[len(members) :]
    return out


def _near(a5: Floats, flange: Floats, arm: Floats, tool_m: float) -> list[NDArray[np.bool_]]:
    """Which samples may have a gap below FAR_M, for each of the CHECKS.

    The hulls: a ball about the wrist and its tool, a capsule about elbow, forearm and hand, and one
    about both halves of the link arm. Rows without numbers count as near.
    """
    centre = flange[:, 3] + (ADAPTER_M + HULL_HEIGHT_M) * flange[:, 2]
    ball_m = max(HULL_M, TOOL_HULL_M + tool_m) + FAR_M
    begin, extent = arm[0], arm[1] - arm[0]
    elbow, fork = arm[:, :, ELBOW].mean(axis=0), arm[1, :, HAND - 2 : HAND].mean(axis=1)
    link = slice(LINK_ARM, LINK_ARM + 2)

    def to_ball(begin: Floats, extent: Floats, radius_m: float) -> NDArray[np.bool_]:
        gap = between_segments(begin, extent, centre, np.zeros((3, 1)))
        return np.asarray(~(gap > radius_m + ball_m))

    def ball_near(group: str) -> NDArray[np.bool_]:
        near = [to_ball(begin[:, k], extent[:, k], RADII_M[k]) for k in _MEMBERS[group]]
        return np.asarray(np.logical_or.reduce(near))

    def arm_near(group: str) -> NDArray[np.bool_]:
        near = [
            between_segments(elbow, fork - elbow, begin[:, k], extent[:, k])
            <= FOREARM_HULL_M + RADII_M[k] + FAR_M
            for k in _MEMBERS[group]
        ]
        return np.asarray(np.logical_or.reduce(near))

    long = tool_m > TOOL_FREE_M
    return [
        ~(np.abs(a5) < A5_FREE_RAD),
        ~(np.abs(a5) < A5_FREE_PLATFORM_RAD) | long,
        to_ball(begin[:, link].mean(axis=1), extent[:, link].mean(axis=1), LINK_ARM_HULL_M),
        ball_near("turret"),
        ball_near("base"),
        ball_near("elbow"),
        arm_near("turret"),
        arm_near("base"),
    ]


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
    columns = len(obstacles) * len(MOVING_GROUPS)
    if not obstacles:
        return out.reshape(len(q), columns)
    for i in range(0, len(q), OBSTACLE_BLOCK):
        p, d = segments(q[i : i + OBSTACLE_BLOCK], tool, mount_yaw)
        for j, obstacle in enumerate(obstacles):
            gap = obstacle.distance(p, d) - RADII_M[:, None]
            for k, group in enumerate(MOVING_GROUPS):
                out[i : i + OBSTACLE_BLOCK, j, k] = gap[_MEMBERS[group]].min(axis=0)
    return out.reshape(len(q), columns)


def obstacle_pairs(obstacles: tuple[Obstacle, ...]) -> tuple[tuple[str, str], ...]:
    """The columns of `obstacle_clearances`: group and obstacle."""
    return tuple((group, obstacle.name) for obstacle in obstacles for group in MOVING_GROUPS)


def _gaps(
    p: Floats, d: Floats, ours: list[int], theirs: list[int], rows: NDArray[np.int64]
) -> Floats:
    """The gap (ours, rows) between each of our bodies and the nearest of theirs."""
    out = np.full((len(ours), len(rows)), np.inf)
    for i in range(0, len(rows), PAIR_BLOCK):
        part = rows[i : i + PAIR_BLOCK]
        mine = p[:, np.array(ours)[:, None], part], d[:, np.array(ours)[:, None], part]
        nearest = out[:, i : i + PAIR_BLOCK]
        for k in theirs:
            gap = between_segments(*mine, p[:, k][:, None, part], d[:, k][:, None, part])
            np.minimum(nearest, gap - (RADII_M[ours] + RADII_M[k])[:, None], out=nearest)
    return out


def _tip(tool: ArrayLike | None) -> Floats:
    """The tool's point on the platform (3,)."""
    return np.asarray(NO_TOOL if tool is None else tool, dtype=np.float64)[:3, 3]


def _flange(q: Floats) -> Floats:
    """The flange's x, y, z and point as (3, 4, n)."""
    return np.ascontiguousarray(kr6.forward(q[:, :6])[:, :3].transpose(1, 2, 0))


def _lay_arm(q: Floats, flange: Floats) -> Floats:
    """Both ends of the ARM_BODIES' axes (2, 3, bodies, n), as `kr6.forward` has the joints."""
    a1, a2, a3, a4 = q[:, :4].T
    zero, one = np.zeros(len(q)), np.ones(len(q))
    c1, s1, c4, s4 = np.cos(a1), np.sin(a1), np.cos(a4), np.sin(a4)
    up, side = np.stack([zero, zero, one]), np.stack([s1, c1, zero])

    def frame(pitch: Floats, origin: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """x, y, z and origin of a link in the arm's plane, tilted down by a pitch."""
        c, s = np.cos(pitch), np.sin(pitch)
        return np.stack([c * c1, -c * s1, -s]), side, np.stack([s * c1, -s * s1, c]), origin

    turret = frame(zero, np.zeros((3, len(q))))
    axis2 = AXIS2_FORWARD_M * turret[0] + AXIS2_HEIGHT_M * up
    link2 = frame(a2, axis2)
    link3 = frame(a2 + a3, axis2 + UPPER_ARM_M * link2[0])
    x, y, z, elbow = link3
    link4 = x, c4 * y - s4 * z, s4 * y + c4 * z, elbow + FOREARM_OFFSET_M * z
    still = np.stack([one, zero, zero]), np.stack([zero, one, zero]), up, turret[3]
    links = still, turret, link2, link3, link4
    ends = np.empty((2, 3, len(ARM_BODIES), len(q)))
    for k, body in enumerate(ARM_BODIES):
        x, y, z, origin = links[body.link]
        for end, place in enumerate((body.begin_m, body.end_m)):
            ends[end, :, k] = origin + place[0] * x + place[1] * y + place[2] * z
    ends[1, :, HAND] = ends[0, :, HAND] + HAND_LENGTH_M * flange[:, 2]
    return ends


def _lay_wrist(cranks: Floats, flange: Floats, tip: Floats, mount_yaw: float) -> Floats:
    """Both ends of the WRIST_BODIES' axes (2, 3, bodies, n); the flange as `_flange` has it."""
    ends = np.empty((2, 3, len(WRIST_BODIES), len(cranks)))
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
    return ends
