"""Random path files of every kind, with what the tool has to follow as formulas of their own.

A seed gives the kind, the wrist's policy, the limits and whether it passes near A5 = 0 or a crank's
limit; attempts under a seed are drawn until one is feasible, see `witness.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.random import Generator

from sphmctl.motion import Floats
from sphmctl.robots import rrs, sphm
from sphmctl.robots.geometry import matrix_to_abc, pose_matrix
from sphmctl.robots.sphm.wrist_grid import heave_range

KINDS = ("lin", "corner", "arc", "circle", "helix", "spline", "polyline")
POLICIES = ("cranks", "fixed", "level", "tilt", "motion")
PEN: Floats = pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0])
MOST_TILT_RAD = float(np.radians(20.0))
LEAST_MM = 200.0
AUTO_EACH = 50
"""One seed in so many takes the policy auto, which is slow."""

Aside = Callable[[Floats], Floats]
"""How far points (n, 3) are beside a figure, (n,); mm."""


@dataclass(frozen=True)
class Drawing:
    """A path file, and what it says as formulas.

    Attributes:
        near: "a5", "crank" or "": what it is to pass closely.
        csv: rows of its polyline; "" for none.
        begin: joints (9,) from which a way exists, if one does, rad.
        aside: distances from the exact figure; None for curves that nobody's formula gives.
        still: whether the tool's orientation must stay as it is.
    """

    kind: str
    policy: str
    near: str
    text: str
    csv: str
    begin: Floats
    aside: Aside | None
    still: bool


@dataclass
class Wrist:
    """How the wrist goes: its cranks at both ends, deg, and what the file says of it."""

    begin: Floats
    end: Floats
    text: str


@dataclass
class Sketch:
    """What is collected while a figure is drawn; mm.

    Attributes:
        R: orientation of the tool at the begin, (3, 3); R_end at the end.
        e1, e2: unit vectors of the figure's plane.
        by_cranks: whether points name their cranks.
    """

    g: Generator
    p: Floats
    R: Floats
    R_end: Floats
    e1: Floats
    e2: Floats
    wrist: Wrist
    by_cranks: bool
    rule: str = "interpolated"
    csv: list[str] = field(default_factory=list)

    def place(self, p: Floats, R: Floats, share: float = 1.0) -> str:
        """A point as the file gives it: pose and, where asked for, cranks."""
        pose = _list([*p, *np.degrees(matrix_to_abc(R))])
        if not self.by_cranks:
            return f"{{pose: {pose}}}"
        cranks = self.wrist.begin + share * (self.wrist.end - self.wrist.begin)
        return f"{{pose: {pose}, cranks_deg: {_list(cranks)}}}"

    def between(self, share: float) -> Floats:
        """The orientation at a share of the turn to the end's, about one axis."""
        return self.R @ _turn_vector(share * _turn_of(self.R.T @ self.R_end))


def drawing(seed: int, attempt: int) -> Drawing:
    """One attempt of a seed."""
    g = np.random.default_rng([seed, attempt])
    kind, policy = KINDS[seed % 7], POLICIES[seed // 7 % 5]
    policy = "auto" if seed % AUTO_EACH == AUTO_EACH - 1 else policy
    near = {0: "a5", 3: "crank"}.get(seed % 6, "")
    wrist = _wrist(g, policy, near)
    joints = np.append(_arm(g, near), wrist.begin)
    pose = sphm.forward(np.radians(joints), PEN)
    e1, e2 = _plane(g, near, np.radians(joints[0]))
    sketch = Sketch(g, pose[:3, 3] * 1000.0, pose[:3, :3], pose[:3, :3], e1, e2, wrist, False)
    sketch.by_cranks = policy == "cranks"
    if policy == "tilt":  # the flange stays, so the wrist does what the tool turns
        still = kind in ("circle", "helix") or near == "crank"
        sketch.R_end = sketch.R if still else _tilted(g, sketch.R)
    elif near != "a5" and g.random() < 0.6:
        sketch.R_end = sketch.R @ _turn_vector(_direction(g) * g.uniform(0.0, MOST_TILT_RAD))
    moves, aside = FIGURES[kind](sketch)
    if policy in ("tilt", "level") and sketch.rule in ("tangent", "sphere"):
        sketch.rule = "fixed"
    head = ["version: 1", "name: random", "tool: octagon_pen", _speed(g, kind, near)]
    head += [f"wrist: {wrist.text}"]
    rule = _rule(sketch)
    if rule:
        head.append(f"orientation: {rule}")
    first = f"joints_deg: {_list(joints)}"
    if g.random() < 0.5:
        first = sketch.place(sketch.p, sketch.R)[1:-1].split(", cranks_deg")[0]
        first += f", cranks_deg: {_list(wrist.begin)}"
    lines = [*head, "moves:", f"  - ptp: {{{first}}}", *moves]
    still = rule == "fixed" or bool(np.array_equal(sketch.R_end, sketch.R) and not rule)
    text, csv = "\n".join(lines) + "\n", "\n".join(sketch.csv)
    return Drawing(kind, policy, near, text, csv, np.radians(joints), aside, still)


def _speed(g: Generator, kind: str, near: str) -> str:
    """The tool's limits: far, so that joints rule; or those of a process."""
    speed, acceleration = (1000.0, 20_000.0) if g.random() < 0.5 else (g.uniform(50, 300), 2000.0)
    if kind in ("helix", "spline", "polyline"):
        acceleration = 100_000.0
    if near == "a5":
        speed = min(speed, 200.0)
    return f"speed: {{tcp_mm_s: {speed:.3f}, tcp_mm_s2: {acceleration:.3f}}}"


def _arm(g: Generator, near: str) -> Floats:
    """Six angles before the robot, deg."""
    low, high = [-120.0, -125, 40, -90, 25, -200], [120.0, -35, 125, 90, 110, 200]
    arm = g.uniform(low, high)
    arm[4] *= g.choice([-1.0, 1.0])
    if near == "a5":
        arm[3], arm[4] = g.choice([0.0, 0.0, g.uniform(-90.0, 90.0)]), g.uniform(-8.0, 8.0)
    return np.round(arm, 6)


def _plane(g: Generator, near: str, a1: float) -> tuple[Floats, Floats]:
    """Two unit vectors, square to each other; near A5 = 0 in the arm's own plane."""
    if near == "a5":
        angle = g.uniform(0.0, 2.0 * np.pi)
        out, up = np.array([np.cos(a1), -np.sin(a1), 0.0]), np.array([0.0, 0.0, 1.0])
        c, s = np.cos(angle), np.sin(angle)
        return c * out + s * up, c * up - s * out
    e1 = _direction(g)
    e2 = np.cross(e1, _direction(g))
    return e1, e2 / np.linalg.norm(e2)


def _wrist(g: Generator, policy: str, near: str) -> Wrist:
    """The wrist's way for a policy."""
    level = policy == "level"
    directions, tilts, heaves = np.empty(2), np.empty(2), np.empty(2)
    for end in range(2):
        directions[end] = g.uniform(-np.pi, np.pi)
        tilts[end] = 0.0 if level else g.uniform(0.0, 0.9 * MOST_TILT_RAD)
        if policy == "tilt" and end == 0:
            tilts[end] = 0.0
        low, high = (float(x) for x in heave_range(directions[end], tilts[end]))
        edge = near == "crank" and g.random() < 0.5
        share = g.choice([0.0, 1.0]) if edge else g.uniform(0.15, 0.85)
        heaves[end] = low + share * (high - low)
    if near == "crank" and policy in ("fixed", "tilt", "auto"):
        low, high = (float(x) for x in heave_range(directions[0], tilts[0]))
        heaves[0] = g.choice([low, high])
    if policy == "tilt":
        heaves[1] = heaves[0]
    turns = 0.0 if near == "crank" else float(np.round(g.uniform(-1.0, 1.0), 3))
    if policy == "motion":
        directions[1] = directions[0] + 2.0 * np.pi * turns
    low, high = np.degrees(rrs.RANGES).T
    cranks = np.clip(np.degrees(rrs.inverse(directions, tilts, heaves)), low, high)
    begin, end = np.round(cranks[0], 9), np.round(cranks[1], 9)
    heave, tilt = _list(1000.0 * heaves), _list(np.degrees(tilts))
    text = policy
    if level and g.random() < 0.5:
        text = f"{{policy: level, heave_mm: {heave}}}"
    if policy == "motion":
        towards = f"{np.degrees(directions[0]):.9f}"
        text = f"{{heave_mm: {heave}, tilt_deg: {tilt}, tilt_turns: {turns}, "
        text += f"tilt_towards_deg: {towards}}}"
    return Wrist(begin, end, text)


def _tilted(g: Generator, R: Floats) -> Floats:
    """An orientation that the wrist, level at the begin, can give by tilting alone."""
    return R @ _turn_vector(_across(g) * g.uniform(0.0, 0.6 * MOST_TILT_RAD))


def _lin(k: Sketch) -> tuple[list[str], Aside | None]:
    end = k.p + k.g.uniform(LEAST_MM, 350.0) * k.e1
    return [f"  - lin: {k.place(end, k.R_end)}"], lambda x: _from_lines(x, [k.p, end])


def _corner(k: Sketch) -> tuple[list[str], Aside | None]:
    angle = k.g.uniform(0.3, 2.4)
    middle = k.p + k.g.uniform(100.0, 200.0) * k.e1
    way = np.cos(angle) * k.e1 + np.sin(angle) * k.e2
    end, blend = middle + k.g.uniform(100.0, 200.0) * way, k.g.uniform(5.0, 30.0)
    lines = [f"  - lin: {k.place(middle, k.R, 0.5)}", f"    blend_mm: {blend:.3f}"]

    def aside(x: Floats) -> Floats:
        """Within the blend's reach the tool is free."""
        out = _from_lines(x, [k.p, middle, end])
        return np.where(np.linalg.norm(x - middle, axis=1) < blend + 0.01, 0.0, out)

    return [*lines, f"  - lin: {k.place(end, k.R_end)}"], aside


def _arc(k: Sketch) -> tuple[list[str], Aside | None]:
    if k.rule == "interpolated" and np.array_equal(k.R, k.R_end) and k.g.random() < 0.6:
        k.rule = str(k.g.choice(["tangent", "sphere", "fixed"]))
    radius, e1, e2 = k.g.uniform(60.0, 250.0), k.e1, k.e2
    if k.rule == "sphere":
        radius, e1 = k.g.uniform(600.0, 900.0), -k.R[:, 2]
        e2 = np.cross(e1, _direction(k.g))
        e2 /= np.linalg.norm(e2)
    centre = k.p - radius * e1
    angle = k.g.uniform(LEAST_MM, min(350.0, 5.5 * radius)) / radius
    end, via = (centre + radius * (np.cos(a) * e1 + np.sin(a) * e2) for a in (angle, 0.45 * angle))
    if k.rule == "sphere":
        k.csv = [_list(centre)]
    line = f"  - arc: {{via: {_list(via)}, to: {k.place(end, k.R_end)}}}"
    return [line], lambda x: _from_circle(x, centre, np.cross(e1, e2), radius)


def _circle(k: Sketch) -> tuple[list[str], Aside | None]:
    k.R_end = k.R
    k.rule = str(k.g.choice(["tangent", "fixed"]))
    radius = k.g.uniform(LEAST_MM / 6.28, 70.0)
    centre, normal = k.p - radius * k.e1, np.cross(k.e1, k.e2)
    if k.g.random() < 0.5:
        line = f"{{centre: {_list(centre)}, normal: {_list(normal)}}}"
    else:
        points = [centre + radius * (np.cos(a) * k.e1 + np.sin(a) * k.e2) for a in (1.9, 4.0)]
        line = f"{{via: [{_list(points[0])}, {_list(points[1])}]}}"
    return [f"  - circle: {line}"], lambda x: _from_circle(x, centre, normal, radius)


def _helix(k: Sketch) -> tuple[list[str], Aside | None]:
    k.R_end = k.R
    k.rule = str(k.g.choice(["tangent", "fixed"]))
    radius, pitch = k.g.uniform(30.0, 60.0), k.g.uniform(5.0, 40.0)
    turn = k.g.choice([-1.0, 1.0]) * k.g.uniform(400.0, 800.0)
    centre, normal = k.p - radius * k.e1, np.cross(k.e1, k.e2)
    text = f"centre: {_list(centre)}, normal: {_list(normal)}"
    line = f"  - helix: {{{text}, turn_deg: {turn:.9f}, pitch_mm: {pitch:.9f}}}"
    rise = pitch * float(np.sign(turn))

    def aside(x: Floats) -> Floats:
        """Beside the cylinder, and above the turn that is nearest."""
        off = x - centre
        height, across = off @ normal, np.stack([off @ k.e1, off @ k.e2])
        angle = np.arctan2(across[1], across[0])
        above = height - rise * angle / (2.0 * np.pi)
        above -= pitch * np.round(above / pitch)
        return np.asarray(np.hypot(np.hypot(*across) - radius, above))

    return [line], aside


def _spline(k: Sketch) -> tuple[list[str], Aside | None]:
    if np.array_equal(k.R, k.R_end):
        k.rule = str(k.g.choice(["tangent", "fixed"]))
    count = int(k.g.integers(3, 6))
    points, p = [], k.p
    for i in range(count):
        away = 90.0 * k.e1 + k.g.uniform(-45.0, 45.0) * k.e2
        p = p + away
        share = (i + 1) / count
        points.append(k.place(p, k.between(share), share))
    return [f"  - spline: {{through: [{', '.join(points)}]}}"], None


def _polyline(k: Sketch) -> tuple[list[str], Aside | None]:
    k.R_end = k.R
    k.rule = str(k.g.choice(["tangent", "fixed"]))
    count, length = int(k.g.integers(20, 200)), k.g.uniform(220.0, 350.0)
    u = np.linspace(0.0, 1.0, count + 1)[1:]
    swing, waves = k.g.uniform(0.0, 0.1) * length, k.g.uniform(1.0, 3.0)
    side = swing * np.sin(waves * np.pi * u)
    rows = k.p + (length * u)[:, None] * k.e1 + side[:, None] * k.e2
    names, columns = ["x_mm", "y_mm", "z_mm"], rows
    if k.by_cranks:
        names += ["theta7_deg", "theta8_deg", "theta9_deg"]
        cranks = k.wrist.begin + u[:, None] * (k.wrist.end - k.wrist.begin)
        columns = np.hstack([rows, cranks])
    k.csv = [",".join(names), *(_list(row)[1:-1] for row in columns)]
    return ["  - polyline: {csv: path.csv}"], None


FIGURES = {
    "lin": _lin,
    "corner": _corner,
    "arc": _arc,
    "circle": _circle,
    "helix": _helix,
    "spline": _spline,
    "polyline": _polyline,
}


def _rule(k: Sketch) -> str:
    if k.rule == "sphere":
        return f"{{normal_to: sphere, centre: {k.csv.pop()}}}"
    return "" if k.rule == "interpolated" else k.rule


def _from_lines(x: Floats, corners: list[Floats]) -> Floats:
    """Distance from the nearest of the segments between corners."""
    found = []
    for a, b in pairwise(corners):
        share = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        found.append(np.linalg.norm(x - a - share[:, None] * (b - a), axis=1))
    return np.asarray(np.min(found, axis=0))


def _from_circle(x: Floats, centre: Floats, normal: Floats, radius: float) -> Floats:
    height = (x - centre) @ normal
    across = np.linalg.norm(x - centre - height[:, None] * normal, axis=1)
    return np.asarray(np.hypot(height, across - radius))


def _direction(g: Generator) -> Floats:
    v = g.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def _across(g: Generator) -> Floats:
    angle = g.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _turn_vector(v: Floats) -> Floats:
    """The rotation about v by its length (Rodrigues)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))


def _turn_of(R: Floats) -> Floats:
    """The vector of a rotation by less than half a turn."""
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
    sine = float(np.linalg.norm(v))
    return v if sine == 0.0 else v * np.arctan2(sine, (np.trace(R) - 1.0) / 2.0) / sine


def _list(values: object) -> str:
    return "[" + ", ".join(f"{float(x):.9f}" for x in np.asarray(values, dtype=np.float64)) + "]"
