"""The robot as URDF: the arm's six joints, and the platform on a virtual chain of three.

URDF has no loops, so the legs are left out and the platform moves by heave, tilt direction s and
tilt t. All it can do is Rz(s) Ry(t) Rz(-s), shifted sideways by d/2 (1 - cos t) (-cos 2s, sin 2s)
(Elsamanty et al., Appl. Sci. 2023, 13, 2088: u_y = v_x, O7_x = d (u_x - v_y) / 2, O7_y = -d u_y).
Both follow exactly from joints that mimic s and t: two arms of d/4, turned by t and by -t, reach
d/2 cos t and stay level, and a turn by -2s puts them where the shift points. A level platform has
no direction; `joint_values` says 0 then. A continuous motion through the level pose may instead go
on with the same direction and a negative tilt, which is the same pose as s + 180 degrees and t.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import rrs
from sphmctl.robots.export import links
from sphmctl.robots.export.links import words
from sphmctl.robots.geometry import matrix_to_abc
from sphmctl.robots.sphm.chain import MAX_SPEED9, RANGES9

EFFORT = "0"
"""The format asks for a highest effort; KUKA prints none, and 0 stands for unknown as in
ros-industrial/kuka_experimental."""

QUARTER_M = rrs.PLATFORM_RADIUS_M / 4.0


@dataclass(frozen=True)
class Step:
    """One joint of the virtual chain: a turn by `factor` times direction or tilt.

    Attributes:
        name: of the joint.
        of: "direction", "tilt" or "heave".
        at_m: on the link before, (3,).
        axis: it turns about, or moves along.
    """

    name: str
    of: str
    factor: int
    at_m: tuple[float, float, float]
    axis: str


HERE, Y, Z = (0.0, 0.0, 0.0), "0 1 0", "0 0 1"
CHAIN: tuple[Step, ...] = (
    Step("heave", "heave", 1, HERE, Z),
    Step("direction", "direction", 1, HERE, Z),
    # From s to -2s, and in the shift's own plane back by d/2 and forth by d/2 cos t.
    Step("shift_direction", "direction", -3, HERE, Z),
    Step("tilt", "tilt", 1, (-2.0 * QUARTER_M, 0.0, 0.0), Y),
    Step("shift_tilt_forth", "tilt", -2, (QUARTER_M, 0.0, 0.0), Y),
    Step("shift_tilt_back", "tilt", 1, (QUARTER_M, 0.0, 0.0), Y),
    # From -2s to s, tilt, and back by s: the wrist has no torsion.
    Step("shift_direction_back", "direction", 3, HERE, Z),
    Step("tilt_platform", "tilt", 1, HERE, Y),
    Step("direction_back", "direction", -1, HERE, Z),
)
# Each stands before those that mimic it, as some readers ask.
MASTERS = ("heave", "direction", "tilt")


def joint_values(q: ArrayLike) -> dict[str, Floats]:
    """Values (...) of all joints of the URDF by name, mimicking ones included, of joints (..., 9).

    NaN where the wrist does not close.
    """
    q = np.asarray(q, dtype=np.float64)
    direction, tilt, heave = rrs.tilt_of(rrs.forward(q[..., 6:]))
    virtual = {"direction": direction, "tilt": tilt, "heave": heave}
    values = {axis.joint: q[..., k] for k, axis in enumerate(links.AXES)}
    values.update({step.name: np.asarray(step.factor * virtual[step.of]) for step in CHAIN})
    return values


def urdf(
    tool: Floats | None = None,
    mount_yaw: float = 0.0,
    ranges: Floats = RANGES9,
    speeds: Floats = MAX_SPEED9,
) -> str:
    """The model's text.

    Args:
        tool: its frame on the platform, (4, 4); None leaves the link `tool` on the platform's.
        mount_yaw: leg 1 against the flange's x axis, rad.
        ranges: of the nine joints, rad, (9, 2).
        speeds: of the nine joints, rad/s, (9,).
    """
    robot = Xml.Element("robot", name="sphm")
    robot.append(Xml.Comment(" " + " ".join((__doc__ or "").replace("--", "-").split()) + " "))
    shapes = links.capsules(tool)
    before = _link(robot, links.BASE, shapes)
    for k, axis in enumerate(links.AXES):
        low, high = ranges[k]
        _link(robot, axis.link, shapes)
        joint = _joint(robot, axis.joint, "revolute", before, axis.link, axis.at_m)
        Xml.SubElement(joint, "axis", xyz=words(*axis.sense))
        _limit(joint, low, high, speeds[k])
        before = axis.link
    flange = _link(robot, links.FLANGE, ())
    turn = (0.0, links.FLANGE_PITCH_RAD, 0.0)
    _joint(robot, "flange_mount", "fixed", before, flange, links.FLANGE_AT_M, turn)
    wrist = _link(robot, links.WRIST, shapes)
    _joint(robot, "wrist_mount", "fixed", flange, wrist, links.WRIST_AT_M, (0.0, 0.0, mount_yaw))
    _platform(robot, wrist, shapes, ranges[6:], speeds[6:])
    _link(robot, "tool", ())
    at = np.eye(4) if tool is None else tool
    place = tuple(float(x) for x in at[:3, 3])
    _joint(robot, "tool_mount", "fixed", links.PLATFORM, "tool", place, _rpy(at[:3, :3]))
    Xml.indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + Xml.tostring(robot, "unicode") + "\n"


def platform_limits(ranges: Floats) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of heave, direction and tilt within the cranks' ranges (3, 2)."""
    each = [np.linspace(low, high, 13) for low, high in ranges]
    cranks = np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, 3)
    _, tilt, heave = rrs.tilt_of(rrs.forward(cranks))
    most = float(tilt.max())
    return {
        "heave": (float(heave.min()), float(heave.max())),
        "direction": (-np.pi, np.pi),
        "tilt": (-most, most),
    }


def _platform(
    robot: Xml.Element,
    before: str,
    shapes: tuple[links.Capsule, ...],
    ranges: Floats,
    speeds: Floats,
) -> None:
    """The virtual chain; the cranks' ranges (3, 2) and speeds (3,) limit it.

    Its speeds are what the quickest crank gives where its leg stands best: guides, for the true
    limits are those of the cranks.
    """
    limits = platform_limits(ranges)
    heave_m_s = rrs.CRANK_M * float(speeds.max())
    tilt_rad_s = heave_m_s / rrs.PLATFORM_RADIUS_M
    quickest = {"heave": heave_m_s, "tilt": tilt_rad_s, "direction": tilt_rad_s}
    for step in CHAIN:
        link = links.PLATFORM if step is CHAIN[-1] else f"{step.name}_link"
        _link(robot, link, shapes)
        kind = "prismatic" if step.of == "heave" else "revolute"
        joint = _joint(robot, step.name, kind, before, link, step.at_m)
        Xml.SubElement(joint, "axis", xyz=step.axis)
        low, high = sorted(step.factor * value for value in limits[step.of])
        _limit(joint, low, high, abs(step.factor) * quickest[step.of])
        if step.name not in MASTERS:
            Xml.SubElement(joint, "mimic", joint=step.of, multiplier=str(step.factor))
        before = link


def _link(robot: Xml.Element, name: str, shapes: tuple[links.Capsule, ...]) -> str:
    link = Xml.SubElement(robot, "link", name=name)
    for shape in shapes:
        if shape.link == name:
            for use in ("visual", "collision"):
                _capsule(link, use, shape)
    return name


def _capsule(link: Xml.Element, use: str, shape: links.Capsule) -> None:
    """A cylinder and two balls: URDF has no capsules."""
    x, y, z = along = shape.end_m - shape.begin_m
    turn = (0.0, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))
    radius = words(shape.radius_m)
    parts = [
        (shape.begin_m, HERE, "sphere", {"radius": radius}),
        (shape.end_m, HERE, "sphere", {"radius": radius}),
        (
            (shape.begin_m + shape.end_m) / 2.0,
            turn,
            "cylinder",
            {"radius": radius, "length": words(float(np.linalg.norm(along)))},
        ),
    ]
    for at, rpy, kind, sizes in parts:
        element = Xml.SubElement(link, use)
        Xml.SubElement(element, "origin", xyz=words(*at), rpy=words(*rpy))
        Xml.SubElement(Xml.SubElement(element, "geometry"), kind, sizes)


def _joint(
    robot: Xml.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    at_m: tuple[float, ...],
    rpy: tuple[float, ...] = HERE,
) -> Xml.Element:
    joint = Xml.SubElement(robot, "joint", name=name, type=kind)
    Xml.SubElement(joint, "origin", xyz=words(*at_m), rpy=words(*rpy))
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    return joint


def _limit(joint: Xml.Element, low: float, high: float, speed: float) -> None:
    limit = Xml.SubElement(joint, "limit", effort=EFFORT, velocity=words(speed))
    limit.attrib |= {"lower": words(low), "upper": words(high)}


def _rpy(R: Floats) -> tuple[float, ...]:
    """Fixed-axis roll, pitch, yaw: KUKA's C, B, A."""
    from_abc = matrix_to_abc(R)
    return tuple(float(x) for x in from_abc[::-1])
