"""The way of one block, from 0 to 1, as axes; without any time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from sphmctl.emulators.motion.blocks import AxisLimitError, Circ, Lin, MotionError, PathSpeed, Ptp
from sphmctl.emulators.motion.figures import (
    PATH_ACCELERATION_MM_S2,
    TURN_ACCELERATION_DEG_S2,
    Joints,
    Options,
    beyond,
)
from sphmctl.emulators.motion.frames import (
    Frame,
    Pose,
    Quaternion,
    Vector,
    about,
    axis_angle,
    chained,
    cross,
    dot,
    inverted,
    length,
    minus,
    plus,
    pose_of,
    reverse,
    scaled,
    times,
    turned,
)
from sphmctl.emulators.motion.kinematics import inverse, status_and_turn, tool_centre

NO_WAY_DEG = 1e-7
"""An axis with less to go stays: far below a motor's resolution, and its rates would overflow."""

NO_WAY_MM = 1e-6
"""The same for the tool's centre."""

FLAT_CIRCLE = 1e-6
"""Sine of the angle at the auxiliary point below which three points make no circle."""

SAMPLES = 16
"""Places at which a path is checked for reach and limits when it is planned."""

TANGENT = 1e-4
"""Part of a path over which its axes are differentiated."""


@dataclass(frozen=True)
class AxisLine:
    """PTP: a straight line in axis space.

    Attributes:
        stretch: each axis's way, deg; with `hardest_deg_s2` as its acceleration at 100 %.
    """

    start_deg: Joints
    end_deg: Joints
    stretch: Joints
    hardest: Joints

    def joints(self, way: float, near_deg: Joints) -> Joints:
        """The axes at `way` of the line."""
        del near_deg
        a, d = self.start_deg, self.stretch
        return (
            a[0] + d[0] * way,
            a[1] + d[1] * way,
            a[2] + d[2] * way,
            a[3] + d[3] * way,
            a[4] + d[4] * way,
            a[5] + d[5] * way,
        )

    def tangent(self, at_end: bool) -> Joints:
        """Axes by way."""
        del at_end
        return self.stretch


@dataclass(frozen=True)
class ToolPath:
    """LIN and CIRC: the tool's centre on a line or an arc, turning evenly about one axis.

    Attributes:
        start: the tool on the robot's base.
        way: the line's vector, mm; None for an arc.
        centre: of the arc, with its unit `normal` and angle `sweep`.
        turn_axis, angle: the turn from start to end, in the robot's base.
        length_mm: of the tool centre's way.
        stretch: length in mm and turn in degrees, with `hardest` as their accelerations.
        from_tool: the flange on the tool.
        frames: tool and base, for comparison.
    """

    start: Pose
    way: Vector | None
    centre: Vector
    normal: Vector
    sweep: float
    turn_axis: Vector
    angle: float
    length_mm: float
    from_tool: Pose
    frames: tuple[Frame, Frame]
    status: int
    start_deg: Joints
    hardest: Joints = (PATH_ACCELERATION_MM_S2, TURN_ACCELERATION_DEG_S2)

    @cached_property
    def stretch(self) -> Joints:
        """Length in mm and turn in degrees."""
        return self.length_mm, math.degrees(self.angle)

    @cached_property
    def end_deg(self) -> Joints:
        """The axes at the end, followed along the path."""
        near = self.start_deg
        for sample in range(1, SAMPLES + 1):
            near = self.joints(sample / SAMPLES, near)
        return near

    def place(self, way: float) -> Vector:
        """The tool's centre at `way`."""
        if self.way is not None:
            return plus(self.start[0], scaled(self.way, way))
        arm = minus(self.start[0], self.centre)
        return plus(self.centre, turned(about(self.normal, self.sweep * way), arm))

    def turn(self, way: float) -> Quaternion:
        """The tool's turn at `way`."""
        return times(about(self.turn_axis, self.angle * way), self.start[1])

    def direction(self, at_end: bool) -> Vector:
        """Tool centre by way, mm, at the start or the end."""
        if self.way is not None:
            return self.way
        arm = minus(self.place(1.0 if at_end else 0.0), self.centre)
        return scaled(cross(self.normal, arm), self.sweep)

    def axes(self, place: Vector, turn: Quaternion, near_deg: Joints) -> Joints:
        """The axes for a tool centre and turn."""
        joints_deg = inverse(
            chained((place, turn), self.from_tool), self.status, near_deg, wrist=True
        )
        if joints_deg is None:
            raise MotionError(f"the arm does not reach the tool's centre {place} mm")
        return joints_deg

    def joints(self, way: float, near_deg: Joints) -> Joints:
        """The axes at `way`, on the branch nearest to `near_deg`."""
        return self.axes(self.place(way), self.turn(way), near_deg)

    def tangent(self, at_end: bool) -> Joints:
        """Axes by way, at the start or the end."""
        inner, edge = (1.0 - TANGENT, 1.0) if at_end else (TANGENT, 0.0)
        near = self.end_deg if at_end else self.start_deg
        a, b = self.joints(inner, near), self.joints(edge, near)
        return tuple((q - p) / (edge - inner) for p, q in zip(a, b, strict=True))


Contour = AxisLine | ToolPath


def axis_line(start_deg: Joints, target_deg: Joints, options: Options) -> AxisLine:
    """The line to `target_deg`; refused where that is outside the software limits."""
    axis = beyond(target_deg)
    if axis is not None:
        raise AxisLimitError(f"A{axis + 1} = {target_deg[axis]:.3f} deg is beyond its limit")
    ways = (end - start for end, start in zip(target_deg, start_deg, strict=True))
    stretch = tuple(way if abs(way) >= NO_WAY_DEG else 0.0 for way in ways)
    # An axis without way stays exactly where it is, so that no block ends in a jump.
    end_deg = tuple(
        q if way != 0.0 else p for p, q, way in zip(start_deg, target_deg, stretch, strict=True)
    )
    return AxisLine(start_deg, end_deg, stretch, options.acceleration_deg_s2)


def tool_path(start_deg: Joints, motion: Lin | Circ) -> ToolPath:
    """The path from where the axes are; refused where it leaves reach or software limits."""
    tool, base = pose_of(motion.tool), pose_of(motion.base)
    start = tool_centre(start_deg, motion.tool)
    target = chained(base, pose_of(motion.target))
    axis, angle = axis_angle(times(target[1], reverse(start[1])))
    way: Vector | None = minus(target[0], start[0])
    centre = normal = (0.0, 0.0, 0.0)
    sweep, length_mm = 0.0, length(minus(target[0], start[0]))
    if isinstance(motion, Circ):
        through = chained(base, pose_of(motion.auxiliary))[0]
        way, (centre, normal, sweep) = None, _circle(start[0], through, target[0])
        length_mm = length(minus(start[0], centre)) * sweep
    path = ToolPath(
        start,
        way,
        centre,
        normal,
        sweep,
        axis,
        angle,
        length_mm if length_mm > NO_WAY_MM else 0.0,
        inverted(tool),
        (motion.tool, motion.base),
        status_and_turn(start_deg)[0],
        start_deg,
    )
    _check(path)
    return path


def _check(path: ToolPath) -> None:
    near = path.start_deg
    for sample in range(1, SAMPLES + 1):
        near = path.joints(sample / SAMPLES, near)
        axis = beyond(near)
        if axis is not None:
            raise AxisLimitError(f"A{axis + 1} would pass its limit on the path")


def _circle(a: Vector, b: Vector, c: Vector) -> tuple[Vector, Vector, float]:
    """Centre, unit normal and angle of the arc from a through b to c."""
    u, v = minus(b, a), minus(c, a)
    n = cross(u, v)
    square = dot(n, n)
    if square <= (FLAT_CIRCLE * length(u) * length(v)) ** 2:
        raise MotionError("the three points of the CIRC lie on a line")
    # Circumcentre from a: ((u.u) v - (v.v) u) x n / (2 n.n), with the sign for n = u x v.
    bow = minus(scaled(v, dot(u, u)), scaled(u, dot(v, v)))
    arm = scaled(cross(bow, n), 1.0 / (2.0 * square))
    centre, normal = plus(a, arm), scaled(n, 1.0 / math.sqrt(square))
    first, last = minus(a, centre), minus(c, centre)
    sweep = math.atan2(dot(cross(first, last), normal), dot(first, last)) % (2.0 * math.pi)
    return centre, normal, sweep


def ptp_rates(line: AxisLine, motion: Ptp, speed_deg_s: Joints) -> tuple[float, float]:
    """Speed and acceleration of the line's way, 1/s and 1/s2: the leading axis sets them."""
    return (
        _rate(line.stretch, speed_deg_s, motion.velocity_percent),
        _rate(line.stretch, line.hardest, motion.acceleration_percent),
    )


def _rate(stretch: Joints, limits: Joints, percent: Joints) -> float:
    return min(
        (
            limit * share / 100.0 / abs(way)
            for way, limit, share in zip(stretch, limits, percent, strict=True)
            if way != 0.0
        ),
        default=math.inf,
    )


def path_rates(path: ToolPath, speed: PathSpeed) -> tuple[float, float]:
    """Speed and acceleration of the path's way: the slowest of travel, swivel and turn."""
    ends = path.start[1], path.turn(1.0)
    before, after = (turned(q, (1.0, 0.0, 0.0)) for q in ends)
    swivel = math.degrees(math.atan2(length(cross(before, after)), dot(before, after)))
    twist = math.sqrt(max(0.0, math.degrees(path.angle) ** 2 - swivel**2))
    parts = (
        (path.length_mm, speed.vel_cp_m_s * 1e3, speed.acc_cp_m_s2 * 1e3, NO_WAY_MM),
        (swivel, speed.vel_ori1_deg_s, speed.acc_ori1_deg_s2, NO_WAY_DEG),
        (twist, speed.vel_ori2_deg_s, speed.acc_ori2_deg_s2, NO_WAY_DEG),
    )
    rates = [(v / way, a / way) for way, v, a, least in parts if way > least]
    if not rates:
        return math.inf, math.inf
    return min(v for v, _ in rates), min(a for _, a in rates)
