"""A plan as one HTML file: the robot in 3D moves along it, offline and in any browser.

The page is `view.html` with `view.css`, `view.js` and the plan inside. Its content security policy
lets nothing be loaded, and no script run but this one.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats, Plan
from sphmctl.pictures import figures
from sphmctl.pictures.charts import safe
from sphmctl.pictures.figures import Limits
from sphmctl.robots import rrs
from sphmctl.robots.export import links
from sphmctl.robots.sphm import bodies
from sphmctl.robots.sphm.bodies import Box, Obstacle, Plane

STEP_S = 0.04
"""Rows of the page, 25 a second: joints between them are linear, 0.01 mm beside at 100 mm/s."""

MOST_ROWS = 15_000
"""Ten minutes of such rows, about 1.5 MB; longer plans get fewer a second."""

MOST_PATH = 800
"""Pieces of the path that are drawn."""

CENTRE_HEIGHT_M = 0.35
"""What the view turns about lies so high, between the base and the middle of the path."""

LEVEL = 1e-6
"""Sine of the tilt from which on a plane is not level."""

SLIM = {"base": 0.62, "turret": 0.62, "link arm": 0.58, "elbow": 0.72, "forearm": 0.72, "hand": 0.8}
"""Share of their radii with which bodies are drawn at first: they enclose the parts, and at full
size hide the arm's shape."""

COLOURS = {
    "base": "base",
    "turret": "arm",
    "link arm": "arm",
    "elbow": "arm",
    "forearm": "arm",
    "hand": "hand",
    "servos": "servos",
    "legs": "legs",
    "platform": "platform",
    "tool": "tool",
}
"""Names of the style sheet's colours."""

LINKS = (links.BASE, *[axis.link for axis in links.AXES], links.WRIST, links.PLATFORM)
"""In the order of the script's frames."""


def view(
    plan: Plan,
    limits: Limits,
    mount_yaw: float = 0.0,
    binding: Sequence[str] | None = None,
    obstacles: Sequence[Obstacle] = (),
    frames: tuple[str, str] = ("point", "the path's base"),
) -> str:
    """The page's text.

    Args:
        mount_yaw: leg 1 against the flange's x axis, rad.
        binding: what rules the motion at each row, (n,).
        obstacles: the cell's.
        frames: names of the tool and of the frame that its pose is told in.
    """
    here = files("sphmctl.pictures")
    html, style, script = (
        here.joinpath(f"view.{kind}").read_text(encoding="utf-8") for kind in ("html", "css", "js")
    )
    data = _robot(plan, mount_yaw) | _motion(plan) | _surroundings(plan, binding, obstacles)
    data["ranges"] = np.degrees(limits.ranges).round(3).tolist()
    policy = f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}"
    parts = {
        "policy": f"{policy}; base-uri 'none'; form-action 'none'",
        "name": safe(plan.name),
        "summary": figures.headline(plan),
        "frames": safe(f"Tool {frames[0]} in {frames[1]}"),
        "style": style,
        "script": script,
        # A name must not end the element that the data stand in.
        "data": json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    }
    head, *rest = html.split("{{")
    pieces = [head]
    for piece in rest:
        key, after = piece.split("}}", 1)
        pieces += [parts[key], after]
    return "".join(pieces)


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _robot(plan: Plan, mount_yaw: float) -> dict[str, Any]:
    shapes = links.capsules(plan.tool_on_platform)
    return {
        "axes": [{"at": axis.at_m, "sense": axis.sense} for axis in links.AXES],
        "flange": {"at": links.FLANGE_AT_M, "pitch": links.FLANGE_PITCH_RAD},
        "wrist": {
            "at": links.WRIST_AT_M,
            "yaw": mount_yaw,
            "base": rrs.BASE_RADIUS_M,
            "platform": rrs.PLATFORM_RADIUS_M,
            "crank": rrs.CRANK_M,
            "coupler": rrs.COUPLER_M,
            "radii": [bodies.CRANK_M, bodies.COUPLER_M],
        },
        "bodies": [
            [
                LINKS.index(shape.link),
                shape.group,
                shape.begin_m.round(6).tolist(),
                shape.end_m.round(6).tolist(),
                shape.radius_m,
            ]
            for shape in shapes
        ],
        "slim": SLIM,
        "colour": COLOURS,
        "tool": _pose(plan.tool_on_platform),
        "base": _pose(plan.base_in_world),
        "joints": JOINT_NAMES,
    }


def _motion(plan: Plan) -> dict[str, Any]:
    """Rows evenly apart: nine joints, deg; the platform's tilt x and y, rad, and its heave, m."""
    count = int(np.clip(np.ceil(plan.duration_s / STEP_S), 1, MOST_ROWS - 1)) + 1
    t = np.linspace(0.0, plan.duration_s, count)
    joints = np.stack([np.interp(t, plan.t, q) for q in plan.joints.T], axis=1)
    direction, tilt, heave = rrs.tilt_of(rrs.forward(joints[:, 6:]))
    platform = np.stack([tilt * np.cos(direction), tilt * np.sin(direction), heave], axis=1)
    rows = np.hstack([np.degrees(joints).round(4), platform.round(7)])
    return {
        "duration_s": plan.duration_s,
        "step_s": plan.duration_s / (count - 1) or STEP_S,
        "rows": (rows + 0.0).tolist(),
    }


def _surroundings(
    plan: Plan, binding: Sequence[str] | None, obstacles: Sequence[Obstacle]
) -> dict[str, Any]:
    """Path, points and obstacles in the arm's base, m, and what binds until when."""
    place = (plan.base_in_world @ plan.tool)[:, :3, 3]
    kept = np.unique(np.linspace(0, len(place) - 1, MOST_PATH + 1).astype(int))
    middle = (place.min(axis=0) + place.max(axis=0)) / 2.0
    return {
        "path": np.column_stack([plan.t[kept], place[kept]]).round(5).tolist(),
        "points": [
            {
                "name": point.name,
                "t": float(plan.t[point.sample]),
                "at": place[point.sample].round(5).tolist(),
            }
            for point in plan.points
        ],
        "centre": [middle[0] / 2.0, middle[1] / 2.0, CENTRE_HEIGHT_M],
        "boxes": [
            {"name": box.name, "pose": _pose(box.pose), "half": box.half_m.tolist()}
            for box in obstacles
            if isinstance(box, Box)
        ],
        "planes": [
            {
                "name": plane.name,
                "at": _beside(plane, middle).tolist(),
                "across": _across(plane.normal).tolist(),
            }
            for plane in obstacles
            if isinstance(plane, Plane)
        ],
        "binding": [] if binding is None else _runs(plan, binding),
    }


def _beside(plane: Plane, point: Floats) -> Floats:
    """The point of a plane that is nearest to a point (3,)."""
    return np.asarray(point - ((point - plane.point_m) @ plane.normal) * plane.normal)


def _across(normal: Floats) -> Floats:
    """Two directions in a plane, (2, 3), the first level."""
    level = np.cross([0.0, 0.0, 1.0], normal)
    length = np.linalg.norm(level)
    first = level / length if length > LEVEL else np.array([1.0, 0.0, 0.0])
    return np.stack([first, np.cross(normal, first)])


def _runs(plan: Plan, binding: Sequence[str]) -> list[tuple[float, str]]:
    """When each stretch of one label ends, and the label."""
    last = len(binding) - 1
    ends = [k for k in range(last + 1) if k == last or binding[k] != binding[k + 1]]
    return [(round(float(plan.t[k]), 4), binding[k]) for k in ends]


def _pose(T: Floats) -> list[float]:
    """The first three rows, as the script has poses."""
    return [float(value) for value in T[:3].ravel()]
