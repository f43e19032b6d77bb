"""The robot as MJCF for MuJoCo: nine driven joints, and the wrist's three loops closed.

Each leg is a crank hinge and a coupler hinge; the platform floats (three slides and a ball), and an
equality constraint holds each coupler's end on its ball joint. A motion begins at the key `home`:
the level platform at crank 0 is singular, and a start elsewhere may close the loops in another
assembly. The model is one of motion: KUKA prints no masses of links, so they share the arm's by
volume, and gravity is taken off every body, as drives that hold their position do.
"""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.robots import rrs
from sphmctl.robots.export import links
from sphmctl.robots.export.links import words
from sphmctl.robots.geometry import from_parts
from sphmctl.robots.sphm import bodies
from sphmctl.robots.sphm.chain import RANGES9

ARM_MASS_KG = 52.0
"""KUKA, data sheet KR 6 R900 sixx: weight."""

SERVO_MASS_KG = 0.0572
"""ROBOTIS e-manual, XL430-W250: weight."""

WRIST_DENSITY_KG_M3 = 1200.0
"""Of links and platform: printed plastic, a guess, for the paper does not say."""

CRANK_TORQUE_NM = 1.5
"""ROBOTIS e-manual, XL430-W250: stall torque at 12 V."""

TIMESTEP_S = 0.001

DRIVE_RATE_S = 100.0
"""How fast the position drives follow, 1/s: a tenth of a step's rate, so that they are stable."""

ARM_ARMATURE, CRANK_ARMATURE = 1.0, 0.001
"""kg m2 of a motor behind its gear; guesses that keep the drives' rate below DRIVE_RATE_S."""

LOOP_SOLREF = "0.002 1"
LOOP_SOLIMP = "0.999 0.9999 0.0001"
"""Stiff: the time constant is two steps, the least MuJoCo takes, and the loops give way by less
than a hundredth of a millimetre at rest."""

HOME_DEG = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0, 60.0, 60.0, 60.0)
"""KUKA's usual home position, and cranks in the middle of the machine's range; where a range leaves
one of them out, its nearest end stands in."""


def mjcf(tool: Floats | None = None, mount_yaw: float = 0.0, ranges: Floats = RANGES9) -> str:
    """The model's text.

    Args:
        tool: its frame on the platform, (4, 4); None leaves the site `tool` on the platform's.
        mount_yaw: leg 1 against the flange's x axis, rad.
        ranges: of the nine joints, rad, (9, 2). Speeds have no place in the format.
    """
    root = Xml.Element("mujoco", model="sphm")
    root.append(Xml.Comment(" " + " ".join((__doc__ or "").split()) + " "))
    Xml.SubElement(root, "compiler", angle="radian")
    # With an implicit integrator the drives' damping is stable at any rate.
    Xml.SubElement(root, "option", timestep=words(TIMESTEP_S), integrator="implicitfast")
    _defaults(root)
    shapes = links.capsules(tool)
    world = Xml.SubElement(root, "worldbody")
    Xml.SubElement(world, "light", pos="0 -1 2", dir="0 0.4 -1")
    body = _body(world, links.BASE, np.eye(4))
    _geoms(body, shapes, links.BASE)
    for k, axis in enumerate(links.AXES):
        body = _body(body, axis.link, from_parts(np.eye(3), np.array(axis.at_m)))
        _hinge(body, axis.joint, axis.sense, "arm", ranges[k])
        _geoms(body, shapes, axis.link)
    _wrist(body, shapes, np.eye(4) if tool is None else tool, mount_yaw, ranges[6:])
    _loops(root)
    _drives(root)
    key = Xml.SubElement(Xml.SubElement(root, "keyframe"), "key", name="home")
    home = np.clip(np.radians(HOME_DEG), *ranges.T)
    key.set("qpos", words(*_positions(home)))
    key.set("ctrl", words(*home))
    Xml.indent(root)
    return Xml.tostring(root, "unicode") + "\n"


def _defaults(root: Xml.Element) -> None:
    """The robot's geometry meets what stands around it (conaffinity 1), never itself."""
    default = Xml.SubElement(root, "default")
    Xml.SubElement(default, "geom", type="capsule", contype="1", conaffinity="0")
    Xml.SubElement(default, "site", size="0.004")
    for name, armature in (("arm", ARM_ARMATURE), ("crank", CRANK_ARMATURE)):
        kind = Xml.SubElement(default, "default", {"class": name})
        Xml.SubElement(kind, "joint", armature=words(armature))
        Xml.SubElement(kind, "position", kp=words(armature * DRIVE_RATE_S**2), dampratio="1")


def _wrist(
    link_6: Xml.Element,
    shapes: tuple[links.Capsule, ...],
    tool: Floats,
    yaw: float,
    ranges: Floats,
) -> None:
    """Legs and platform; the cranks' ranges (3, 2)."""
    half = links.FLANGE_PITCH_RAD / 2.0
    flange = Xml.SubElement(link_6, "body", name=links.FLANGE, gravcomp="1")
    flange.set("pos", words(*links.FLANGE_AT_M))
    flange.set("quat", words(np.cos(half), 0.0, np.sin(half), 0.0))
    wrist = _body(flange, links.WRIST, _about_z(yaw, np.array(links.WRIST_AT_M)))
    _geoms(wrist, shapes, links.WRIST)
    for leg, angle in enumerate(rrs.LEG_ANGLES, start=1):
        at = _about_z(angle, np.zeros(3))
        at[:3, 3] = at[:3, 0] * rrs.BASE_RADIUS_M
        crank = _body(wrist, f"crank_{leg}", at)
        _hinge(crank, JOINT_NAMES[5 + leg], (0, 1, 0), "crank", ranges[leg - 1])
        _rod(crank, rrs.CRANK_M, bodies.CRANK_M)
        end = from_parts(np.eye(3), np.array([0.0, 0.0, rrs.CRANK_M]))
        coupler = _body(crank, f"coupler_{leg}", end)
        _hinge(coupler, f"coupler_{leg}", (0, 1, 0))
        _rod(coupler, rrs.COUPLER_M, bodies.COUPLER_M)
        Xml.SubElement(coupler, "site", name=f"coupler_end_{leg}", pos=words(0, 0, rrs.COUPLER_M))
    platform = _body(wrist, links.PLATFORM, np.eye(4))
    for k, name in enumerate("xyz"):
        Xml.SubElement(
            platform, "joint", name=f"platform_{name}", type="slide", axis=words(*np.eye(3)[k])
        )
    Xml.SubElement(platform, "joint", name="platform_turn", type="ball")
    _geoms(platform, shapes, links.PLATFORM)
    for leg, direction in enumerate(rrs.LEG_DIRECTIONS.T, start=1):
        at_m = rrs.PLATFORM_RADIUS_M * direction
        Xml.SubElement(platform, "site", name=f"ball_{leg}", pos=words(*at_m, 0.0))
    site = Xml.SubElement(platform, "site", name="tool", pos=words(*tool[:3, 3]))
    site.set("xyaxes", words(*tool[:3, 0], *tool[:3, 1]))


def _loops(root: Xml.Element) -> None:
    equality = Xml.SubElement(root, "equality")
    for leg in (1, 2, 3):
        loop = Xml.SubElement(equality, "connect", name=f"leg_{leg}")
        loop.attrib |= {"site1": f"coupler_end_{leg}", "site2": f"ball_{leg}"}
        loop.attrib |= {"solref": LOOP_SOLREF, "solimp": LOOP_SOLIMP}


def _drives(root: Xml.Element) -> None:
    """Position drives of the nine joints, in their order."""
    actuator = Xml.SubElement(root, "actuator")
    for k, joint in enumerate(JOINT_NAMES):
        drive = Xml.SubElement(actuator, "position", name=joint, joint=joint, inheritrange="1")
        drive.set("class", "arm" if k < 6 else "crank")
        if k >= 6:
            drive.set("forcerange", words(-CRANK_TORQUE_NM, CRANK_TORQUE_NM))


def _positions(joints: Floats) -> list[float]:
    """qpos of joints (9,) in the tree's order: each crank and its coupler, then the platform."""
    platform = rrs.forward(joints[6:])
    balls = platform[:3, 3:] + rrs.PLATFORM_RADIUS_M * (platform[:3, :2] @ rrs.LEG_DIRECTIONS)
    values = joints[:6].tolist()
    for leg, theta in enumerate(joints[6:]):
        r = float(balls[:2, leg] @ rrs.LEG_DIRECTIONS[:, leg])
        along = r - rrs.BASE_RADIUS_M - rrs.CRANK_M * np.sin(theta)
        up = balls[2, leg] - rrs.CRANK_M * np.cos(theta)
        values += [float(theta), float(np.arctan2(along, up) - theta)]
    direction, tilt, _ = (float(part) for part in rrs.tilt_of(platform))
    s, c = np.sin(tilt / 2.0), np.cos(tilt / 2.0)
    turn = c, -s * np.sin(direction), s * np.cos(direction), 0.0  # about what is across, no torsion
    return [*values, *platform[:3, 3].tolist(), *turn]


def _body(parent: Xml.Element, name: str, at: Floats) -> Xml.Element:
    body = Xml.SubElement(parent, "body", name=name, gravcomp="1", pos=words(*at[:3, 3]))
    if not np.array_equal(at[:3, :3], np.eye(3)):
        body.set("xyaxes", words(*at[:3, 0], *at[:3, 1]))
    return body


def _hinge(
    body: Xml.Element,
    name: str,
    axis: tuple[int, int, int],
    kind: str | None = None,
    ends: Floats | None = None,
) -> None:
    joint = Xml.SubElement(body, "joint", name=name, type="hinge", axis=words(*axis))
    if kind is not None and ends is not None:
        joint.set("class", kind)
        joint.set("range", words(*ends))


def _geoms(body: Xml.Element, shapes: tuple[links.Capsule, ...], link: str) -> None:
    of_arm = [shape for shape in shapes if shape.link not in (links.WRIST, links.PLATFORM)]
    arm_density = ARM_MASS_KG / sum(shape.volume_m3 for shape in of_arm)
    for shape in shapes:
        if shape.link != link:
            continue
        geom = Xml.SubElement(body, "geom", size=words(shape.radius_m))
        geom.set("fromto", words(*shape.begin_m, *shape.end_m))
        if shape.group == "servos":
            geom.set("mass", words(SERVO_MASS_KG))
        else:
            wrist = link in (links.WRIST, links.PLATFORM)
            geom.set("density", words(WRIST_DENSITY_KG_M3 if wrist else arm_density))


def _rod(body: Xml.Element, length_m: float, radius_m: float) -> None:
    geom = Xml.SubElement(body, "geom", size=words(radius_m), density=words(WRIST_DENSITY_KG_M3))
    geom.set("fromto", words(0.0, 0.0, 0.0, 0.0, 0.0, length_m))


def _about_z(angle: float, at_m: Floats) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return from_parts(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), at_m)
