"""Motion statements: what they become, and how their target turns into a block.

The block holds everything that is valid as the advance run comes to the statement. Components
that a target leaves out keep the previous point's value; in a relative motion they are 0 (SI,
"PTP", "PTP_REL").
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter.code import Fn
from sphmctl.emulators.interpreter.faults import (
    MOTION_REFUSED,
    NOT_ALLOWED,
    KrlFaultError,
    invalid,
)
from sphmctl.emulators.interpreter.operators import PLACE_PARTS, place_of
from sphmctl.emulators.interpreter.values import is_set
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl_text import Real
from sphmctl.emulators.motion.blocks import Apo, Circ, Lin, PathSpeed, Ptp
from sphmctl.emulators.motion.frames import (
    Frame,
    Pose,
    Vector,
    chained,
    cross,
    dot,
    frame_of,
    inverted,
    length,
    minus,
    plus,
    pose_of,
    scaled,
)
from sphmctl.emulators.motion.kinematics import axes_of, tool_centre

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.compiler import Builder

Joints = tuple[float, ...]

AXIS_PARTS = tuple(f"A{axis}" for axis in range(1, 7))

LIKE = {"SPTP": "PTP", "SLIN": "LIN", "SCIRC": "CIRC"}
"""Single spline motions run like their older kin; C_SPL blends by $APO.CDIS (guess)."""


@dataclass(frozen=True)
class Order:
    """A motion statement with its values, before it is a block."""

    kind: str
    target: dict[str, Any]
    via: dict[str, Any] | None
    angle_deg: float | None
    blends: tuple[str, ...]
    in_tool: bool


def motion(builder: Builder, node: n.Motion) -> None:
    """Compile a motion."""
    expressions = builder.expressions
    parts = [node.target, *([node.via] if node.via else []), *node.settings]
    builder.sync(*parts)
    target = expressions.of(node.target).fn
    via = expressions.of(node.via).fn if node.via is not None else None
    angle = builder.value(node.angle, "CA", Real()) if node.angle is not None else None
    settings = [_setting(builder, part) for part in node.settings]
    kind = LIKE.get(node.kind, node.kind)
    blends = tuple(dict.fromkeys("C_DIS" if word == "C_SPL" else word for word in node.blends))
    in_tool = node.frame == "TOOL"

    def move(f: Any) -> None:
        order = Order(
            kind,
            target(f),
            None if via is None else via(f),
            None if angle is None else angle(f),
            blends,
            in_tool,
        )
        undo = [put(f) for put in settings]
        try:
            f.machine.move(order)
        finally:
            for back in reversed(undo):
                back()

    builder.emit(move)


def _setting(builder: Builder, node: n.Assign) -> Callable[[Any], Callable[[], None]]:
    """`WITH X=..` is valid for one block: gives what puts the old value back."""
    target = builder.expressions.reference(node.target)
    fn: Fn = builder.value(node.value, target.name, target.kind)

    def put(f: Any) -> Callable[[], None]:
        box = target.box(f)
        before, box.value = box.value, fn(f)

        def back() -> None:
            box.value = before

        return back

    return put


class Planner:
    """Makes blocks out of orders.

    Args:
        look: the value of a system variable.
        start: where the block begins, A1..A6.
    """

    def __init__(self, look: Callable[[str], Any], start: Callable[[], Joints]) -> None:
        self._look = look
        self._start = start

    def plan(self, order: Order, whole: bool) -> Ptp | Lin | Circ:
        """The motion of an order.

        Args:
            whole: the target must be complete, since no point is before it (BCO).

        Raises:
            KrlFaultError: something that it needs is not set, or not reachable.
        """
        if not is_set(order.target):
            raise invalid("the target")
        if order.kind.startswith("PTP"):
            return self._ptp(order, whole)
        if whole:
            message = "the first motion must be a PTP to a full position"
            raise KrlFaultError(NOT_ALLOWED, message)
        if "X" not in order.target:
            message = f"{order.kind} goes to a point, not to axis angles"
            raise KrlFaultError(NOT_ALLOWED, message)
        tool, base = self._frames()
        speed = self._speed()
        start = self._here(tool, base)
        end = self._point(order, start)
        if order.via is None:
            return Lin(end, speed, tool, base)
        via = self._via(order, start)
        if order.angle_deg is not None:
            via, end = turned_arc(start[0], via, end, order.angle_deg)
        return Circ(via, end, speed, tool, base)

    def apo(self, blends: tuple[str, ...]) -> Apo:
        """$APO; a part of it that no word asks for may be unset."""
        value = self._look("$APO") or {}
        default = Apo()
        for word, part in (("C_PTP", "CPTP"), ("C_DIS", "CDIS"), ("C_VEL", "CVEL")):
            if word in blends and value.get(part) is None:
                raise invalid(f"$APO.{part}")
        given = {name: value.get(name) for name in ("CPTP", "CDIS", "CVEL", "CORI")}
        return Apo(
            _or(given["CPTP"], default.cptp_percent),
            _or(given["CDIS"], default.cdis_mm),
            _or(given["CVEL"], default.cvel_percent),
            _or(given["CORI"], default.cori_deg),
        )

    def _ptp(self, order: Order, whole: bool) -> Ptp:
        velocity, acceleration = self._percents("$VEL_AXIS"), self._percents("$ACC_AXIS")
        tool = self._look("$TOOL")
        frame = place_of(tool, "$TOOL") if is_set(tool) else (0.0,) * 6
        x, y, z, a, b, c = frame
        joints_deg = self._axes(order, whole) if "A1" in order.target else self._goal(order, whole)
        return Ptp(joints_deg, velocity, acceleration, (x, y, z, a, b, c))

    def _axes(self, order: Order, whole: bool) -> Joints:
        start = self._start()
        given = [order.target.get(part) for part in AXIS_PARTS]
        if order.kind == "PTP_REL":
            return tuple(q + (way or 0.0) for q, way in zip(start, given, strict=True))
        if whole and None in given:
            message = "the first motion must be a PTP to a full position"
            raise KrlFaultError(NOT_ALLOWED, message)
        return tuple(q if way is None else way for q, way in zip(start, given, strict=True))

    def _goal(self, order: Order, whole: bool) -> Joints:
        target = order.target
        if whole and None in (*(target.get(part) for part in PLACE_PARTS), target.get("S")):
            message = "the first motion must be a PTP to a full position, with S and T"
            raise KrlFaultError(NOT_ALLOWED, message)
        tool, base = self._frames()
        end = self._point(order, self._here(tool, base))
        near_deg = self._start()
        joints_deg = axes_of(end, tool, base, near_deg, target.get("S"), target.get("T"))
        if joints_deg is None:
            raise KrlFaultError(MOTION_REFUSED, "the point is out of the arm's reach")
        return joints_deg

    def _percents(self, name: str) -> Joints:
        values = self._look(name)[:6]
        for axis, value in enumerate(values, start=1):
            if value is None:
                raise invalid(f"{name}[{axis}]")
        return tuple(values)

    def _frames(self) -> tuple[Frame, Frame]:
        return place_of(self._look("$TOOL"), "$TOOL"), place_of(self._look("$BASE"), "$BASE")

    def _here(self, tool: Frame, base: Frame) -> Pose:
        return chained(inverted(pose_of(base)), tool_centre(self._start(), tool))

    def _point(self, order: Order, start: Pose) -> Frame:
        parts = [order.target.get(part) for part in PLACE_PARTS]
        return _point(parts, start, order.kind.endswith("_REL"), order.in_tool)

    def _via(self, order: Order, start: Pose) -> Frame:
        parts = [(order.via or {}).get(part) for part in PLACE_PARTS]
        return _point(parts, start, order.kind.endswith("_REL"), order.in_tool)

    def _speed(self) -> PathSpeed:
        speeds = [self._look("$VEL"), self._look("$ACC")]
        values = []
        for part in ("CP", "ORI1", "ORI2"):
            for name, speed in zip(("$VEL", "$ACC"), speeds, strict=True):
                if speed[part] is None:
                    raise invalid(f"{name}.{part}")
                values.append(speed[part])
        return PathSpeed(*values)


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _point(parts: list[float | None], start: Pose, relative: bool, in_tool: bool) -> Frame:
    here = frame_of(start)
    if not relative:
        x, y, z, a, b, c = (
            before if part is None else part for before, part in zip(here, parts, strict=True)
        )
        return x, y, z, a, b, c
    x, y, z, a, b, c = (part or 0.0 for part in parts)
    if in_tool:
        return frame_of(chained(start, pose_of((x, y, z, a, b, c))))
    # Turns of a relative motion on the base are added to A, B and C (guess).
    return here[0] + x, here[1] + y, here[2] + z, here[3] + a, here[4] + b, here[5] + c


def turned_arc(start: Vector, via: Frame, end: Frame, angle_deg: float) -> tuple[Frame, Frame]:
    """CIRC with CA: the auxiliary and end point of an arc of so many degrees.

    The circle goes through the three points; A, B, C stay those of the programmed end.
    """
    u, v = minus((via[0], via[1], via[2]), start), minus((end[0], end[1], end[2]), start)
    normal = cross(u, v)
    area = dot(normal, normal)
    if area < 1e-9:
        raise KrlFaultError(MOTION_REFUSED, "the three points of a CIRC lie on a line")
    # Circumcentre of a triangle with one corner in the origin (Weisstein, "Circumcenter").
    to_centre = scaled(
        plus(scaled(cross(v, normal), dot(u, u)), scaled(cross(normal, u), dot(v, v))),
        0.5 / area,
    )
    centre = plus(start, to_centre)
    axis = scaled(normal, 1.0 / length(normal))
    radius = scaled(to_centre, -1.0)

    def at(share: float) -> Vector:
        angle = math.radians(angle_deg * share)
        across = cross(axis, radius)
        return plus(centre, plus(scaled(radius, math.cos(angle)), scaled(across, math.sin(angle))))

    middle, last = at(0.5), at(1.0)
    return (*middle, *via[3:]), (*last, *end[3:])
