"""Draws what each wrist policy does on one path, for `sphmctl/planner/policies.md`.

The path: 300 mm along x at 160 mm, three waves of 12 mm in height on the way, the tool turning from
leaning 12 degrees back to 12 degrees forward. Run from the repository: `python
tools/pictures/policies.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sphmctl.config import emulated_cell
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pictures import charts
from sphmctl.pictures.charts import Chart, Line
from sphmctl.pictures.plot import STYLE
from sphmctl.planner.legs import Setup
from sphmctl.planner.policies import Auto, Cranks, Fixed, Level, Policy, Resolved, Tilt
from sphmctl.planner.redundancy import resolve
from sphmctl.robots.geometry import from_parts, pose_matrix
from sphmctl.robots.sphm import bodies

FOLDER = Path(__file__).parents[2] / "sphmctl" / "planner" / "policies" / "pictures"

LENGTH_M, HEIGHT_M, WAVE_M, WAVES, LEAN_DEG = 0.300, 0.160, 0.012, 3, 12.0
BEGIN_X_M = 0.400
ROWS = 601
"""Half a millimetre apart."""

WIDTH, TALL, SCENE = 900.0, 340.0, 380.0
SEEN_M = (0.250, 0.790, 0.110)
"""From which x to which x the drawing goes, and from which height on."""

COLOURS = {"servos": 8, "legs": 1, "platform": 3, "tool": 8}
"""Of the groups of bodies that are not the arm's, which is 2: classes of the style sheet."""


def target() -> tuple[Floats, Floats]:
    """Tool poses (n, 4, 4) and how far along each is, m, (n,)."""
    u = np.linspace(0.0, 1.0, ROWS)
    height = HEIGHT_M + WAVE_M * np.sin(2.0 * np.pi * WAVES * u)
    place = np.stack([BEGIN_X_M + LENGTH_M * u, np.zeros(ROWS), height], axis=1)
    lean = np.radians(LEAN_DEG) * (2.0 * u - 1.0)
    c, s, o, i = np.cos(lean), np.sin(lean), np.zeros(ROWS), np.ones(ROWS)
    # The tool looks down, its x back to the base, and leans about y.
    R = np.stack([[-c, o, -s], [o, i, o], [s, o, -c]]).transpose(2, 0, 1)
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    return from_parts(R, place), np.concatenate([[0.0], np.cumsum(steps)])


def policies() -> dict[str, Policy]:
    """Each with what it is told."""
    u = np.linspace(0.0, 1.0, ROWS)[:, None]
    return {
        "cranks": Cranks(np.radians(30.0 + 60.0 * u) * np.ones(3)),
        "fixed": Fixed(np.radians([60.0] * 3)),
        "level": Level(),
        "tilt": Tilt(flange=pose_matrix([0, 0, 0], np.radians([180.0, 0.0, 180.0]))[:3, :3]),
        "auto": Auto(),
    }


def scene(joints: Floats, setup: Setup, place: Floats) -> list[str]:
    """Forearm and wrist from the side at begin, middle and end, and the path."""
    left, right, low = SEEN_M
    scale = SCENE / (right - left)
    clip = f'<clipPath id="scene"><rect width="{SCENE:g}" height="{TALL:g}"/></clipPath>'
    parts = [clip, '<g clip-path="url(#scene)">']
    for row in (0, ROWS // 2, ROWS - 1):
        parts.append('<g opacity="0.6">')
        begin, extent = bodies.segments(joints[row : row + 1], setup.tool, setup.mount_yaw)
        for k in np.argsort(-(begin[1, :, 0] + extent[1, :, 0] / 2.0)):
            colour = COLOURS.get(bodies.BODY_GROUPS[k], 2)
            x = (np.array([begin[0, k, 0], begin[0, k, 0] + extent[0, k, 0]]) - left) * scale
            y = TALL - (np.array([begin[2, k, 0], begin[2, k, 0] + extent[2, k, 0]]) - low) * scale
            ends = f'x1="{x[0]:.1f}" y1="{y[0]:.1f}" x2="{x[1]:.1f}" y2="{y[1]:.1f}"'
            width = 2.0 * bodies.RADII_M[k] * scale * (0.7 if colour == 2 else 1.0)
            look = f'class="s{colour}" stroke-linecap="round"'
            parts.append(f'<line {ends} {look} stroke-width="{width:.1f}"/>')
        parts.append("</g>")
    x, y = (place[:, 0] - left) * scale, TALL - (place[:, 2] - low) * scale
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[::6], y[::6], strict=True))
    parts.append(f'<polyline class="line axis" points="{points}"/></g>')
    return parts


def picture(name: str, joints: Floats, setup: Setup, place: Floats, way_m: Floats) -> str:
    """The whole drawing of one policy."""
    mm = way_m * 1000.0
    arm = np.degrees(joints[:, :6] - joints[0, :6])
    travel = np.abs(np.diff(arm, axis=0)).sum()
    lines = tuple(Line(*charts.thin(mm, arm[:, k], 300), f"s{k + 1}") for k in range(6))
    cranks = tuple(
        Line(*charts.thin(mm, np.degrees(joints[:, 6 + k]), 300), f"s{7 + k}") for k in range(3)
    )
    width = WIDTH - SCENE - 20.0
    along, unit = "along the path, mm", "degrees"
    upper = Chart("Arm", lines, along, unit, width, 145.0, least_span=50.0)
    lower = Chart("Cranks", cranks, along, unit, width, 145.0, levels=(0.0, 120.0))
    x = SCENE + 20.0
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {TALL:g}" role="img">',
        f"<title>The policy {name}</title><style>{STYLE}</style>",
        f'<rect class="page" width="{WIDTH:g}" height="{TALL:g}"/>',
        *scene(joints, setup, place),
        charts.text("title", 14.0, 30.0, name),
        charts.text("head", x, 18.0, f"Arm from its start: {travel:.0f} degrees of travel"),
        *legend(range(6), 18.0),
        charts.place(upper, x, 22.0),
        charts.text("head", x, 188.0, "Cranks"),
        *legend(range(6, 9), 188.0),
        charts.place(lower, x, 192.0),
        "</svg>\n",
    ]
    return "\n".join(parts)


def legend(joints: range, y: float) -> list[str]:
    """The joints' names in the colours of their lines, at the right edge."""
    names = [JOINT_NAMES[k] for k in joints]
    at, parts = WIDTH - 14.0, []
    for k, name in reversed(list(zip(joints, names, strict=True))):
        parts.append(charts.text(f"note end f{k + 1}", at, y, name))
        at -= 9.0 + 7.0 * len(name)
    return parts


def drawings() -> dict[str, str]:
    """The drawing of each policy."""
    cell = emulated_cell()
    setup = Setup(
        cell.tool_matrix("octagon_pen"),
        np.eye(4),
        cell.mount_yaw_rad,
        cell.ranges_rad,
        cell.speeds_rad_s,
        cell.accelerations_rad_s2,
    )
    poses, way_m = target()
    found = {}
    for name, policy in policies().items():
        outcome = resolve(poses, way_m, policy, setup)
        if not isinstance(outcome, Resolved):
            raise SystemExit(f"{name}: {outcome.problem.message}")
        found[name] = picture(name, outcome.joints, setup, poses[:, :3, 3], way_m)
    return found


def main() -> None:
    """Write them all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, text in drawings().items():
        (FOLDER / f"{name}.svg").write_text(text, encoding="utf-8")
        print(f"{name}.svg")


if __name__ == "__main__":
    main()
