"""Paths to be timed, known in closed form, and what their stream takes of the limits.

The stream is differentiated here by plain differences of samples 4 ms apart, whatever the planner's
own derivatives say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sphmctl.planner.timelaw import TimeLaw
from sphmctl.planner.topp import Bounds
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix

Floats = NDArray[np.float64]
Course = Callable[[Floats], tuple[Floats, Floats]]

SPEEDS = np.radians([360.0, 300, 360, 381, 388, 615, 366, 366, 366])
ACCELERATIONS = np.array([21.7, 6.89, 31.4, 133, 136, 268, 60, 60, 60])
SAMPLE_S = 0.004

OCTAGON_MM = [
    (623.563, 0.0049, -179.999550, 120),
    (583.523, 107.628, -169.549522, 90),
    (470.077, 159.941, -161.209423, 60),
    (358.786, 117.551, -161.859372, 30),
    (310.334, 0.0043, -179.999206, 0),
    (358.789, -117.54, -198.138900, 30),
    (470.08, -159.93, -198.789264, 60),
    (583.525, -107.61, -190.448733, 90),
    (623.563, 0.0049, -179.999550, 120),
]
"""x, y, the tool's turn about z and the cranks, in degrees, of the paper's points A to H and A."""


@dataclass(frozen=True)
class Way:
    """A path on a grid, and in between.

    Attributes:
        at: joints (m, 9) and tool points (m, 3) at any s (m,).
        cuts: rows where two shapes meet.
    """

    s: Floats
    at: Course
    cuts: tuple[int, ...] = ()

    @property
    def joints(self) -> Floats:
        return self.at(self.s)[0]

    @property
    def tool(self) -> Floats:
        return self.at(self.s)[1]


def bounds(tool_speed: float = np.inf, tool_acceleration: float = np.inf) -> Bounds:
    return Bounds(SPEEDS, ACCELERATIONS, tool_speed, tool_acceleration)


def waves(seed: int, rows: int, moving: int = 9) -> Way:
    """Random smooth joints: four sines each; the tool point does not move."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(-0.4, 0.4, (4, moving)) / np.arange(1, 5)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (4, moving))

    def at(s: Floats) -> tuple[Floats, Floats]:
        joints = np.zeros((len(s), 9))
        for k in range(4):
            joints[:, :moving] += height[k] * np.sin((k + 1) * np.pi * s[:, None] + phase[k])
        return joints, np.zeros((len(s), 3))

    return Way(np.linspace(0.0, 1.0, rows), at)


def grid(lengths: list[float], spacing: float) -> tuple[Floats, tuple[int, ...]]:
    """s at about equal spacing with a row at every joint of pieces, and these rows."""
    ends = np.append(0.0, np.cumsum(lengths))
    pieces = [
        np.linspace(low, high, max(int(np.ceil((high - low) / spacing)), 8), endpoint=False)
        for low, high in pairwise(ends)
    ]
    cuts = np.cumsum([len(piece) for piece in pieces])[:-1]
    return np.append(np.concatenate(pieces), ends[-1]), tuple(int(cut) for cut in cuts)


def rounded_square(radius_m: float, side_m: float, spacing_m: float) -> Way:
    """A square with round corners before the arm, pen down: curvature jumps eight times."""
    straight, turn = side_m - 2.0 * radius_m, np.pi * radius_m / 2.0
    s, cuts = grid([straight, turn] * 4, spacing_m)

    def points(s: Floats) -> Floats:
        corner = np.minimum(np.floor(s / (straight + turn)), 3.0)
        u = s - corner * (straight + turn)
        bend = np.maximum(u - straight, 0.0) / radius_m
        x = np.minimum(u, straight) + radius_m * np.sin(bend) + radius_m - side_m / 2.0
        y = radius_m * (1.0 - np.cos(bend)) - side_m / 2.0
        c, d = np.cos(corner * np.pi / 2.0), np.sin(corner * np.pi / 2.0)
        return np.column_stack([0.5 + x * c - y * d, x * d + y * c, np.full(len(s), 0.1)])

    def poses(s: Floats) -> tuple[Floats, Floats]:
        down = np.tile(pose_matrix([0.0, 0.0, 0.0], [np.pi, 0.0, np.pi]), (len(s), 1, 1))
        down[:, :3, 3] = points(s)
        return down, np.full((len(s), 3), np.radians(60.0))

    return Way(s, _resolved(poses), cuts)


def octagon(spacing_m: float) -> Way:
    """The paper's octagon; its corners are the cuts."""
    corners = np.array(OCTAGON_MM)
    lengths = np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1) / 1000.0
    s, cuts = grid(list(lengths), spacing_m)
    ends = np.append(0.0, np.cumsum(lengths))

    def poses(s: Floats) -> tuple[Floats, Floats]:
        x, y, turn, crank = (np.interp(s, ends, column) for column in corners.T)
        pose = np.array(
            [
                pose_matrix([a / 1000.0, b / 1000.0, 0.0], [np.radians(c), 0.0, np.pi])
                for a, b, c in zip(x, y, turn, strict=True)
            ]
        )
        return pose, np.repeat(np.radians(crank)[:, None], 3, axis=1)

    return Way(s, _resolved(poses), cuts)


def _resolved(poses: Callable[[Floats], tuple[Floats, Floats]]) -> Course:
    """Joints and tool points along poses, all on the branch of elbow up and hand not turned."""
    pen = pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0])
    home = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0, 60.0, 60.0, 60.0])
    first, cranks = poses(np.zeros(1))
    start = sphm.inverse(first[0], pen, cranks[0], home, sphm.RANGES9, 0.0).joints[0]
    anywhere = np.array([[-np.inf, np.inf]] * 9)

    def at(s: Floats) -> tuple[Floats, Floats]:
        pose, crank = poses(s)
        return sphm.inverse_along(pose, crank, start, pen, anywhere, 0.0), pose[:, :3, 3]

    return at


def stream_use(law: TimeLaw, way: Way, limits: Bounds, phases: int = 5) -> Floats:
    """Largest shares, by differences: joint speed, joint acceleration, tool speed and acceleration.

    Streams begin at `phases` instants within the first 4 ms; before and after, everything rests.
    """
    worst = np.zeros(4)
    for phase in range(phases):
        begin = -3.0 * SAMPLE_S + phase * SAMPLE_S / phases
        t = np.arange(begin, law.duration_s + 3.0 * SAMPLE_S, SAMPLE_S)
        joints, tool = way.at(law.s(t))
        rate = np.abs(np.diff(joints, axis=0)) / SAMPLE_S
        force = np.abs(np.diff(joints, 2, axis=0)) / SAMPLE_S**2
        tool_rate = np.linalg.norm(np.diff(tool, axis=0), axis=1) / SAMPLE_S
        tool_force = np.linalg.norm(np.diff(tool, 2, axis=0), axis=1) / SAMPLE_S**2
        found = [
            (rate / limits.joint_speeds).max(),
            (force / limits.joint_accelerations).max(),
            (tool_rate / limits.tool_speed).max(),
            (tool_force / limits.tool_acceleration).max(),
        ]
        worst = np.maximum(worst, found)
    return worst
