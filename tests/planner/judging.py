"""Judges the plan of a random path by differences, formulas and toppra, not by its own checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from sphmctl.motion import Floats
from sphmctl.pathfile import Path
from sphmctl.planner.chord import Leg
from sphmctl.planner.plan import Outcome, draw_up
from sphmctl.planner.sampling import Samples
from sphmctl.planner.topp import Bounds
from sphmctl.planner.way import Way
from sphmctl.robots import sphm
from sphmctl.robots.geometry import angle_between
from tests.planner.many_paths import PEN, Drawing
from tests.planner.toppra_oracle import toppra_duration_s
from tests.planner.witness import CELL

SPOT_SHARE = 0.2
"""Of the joints' limits, where the tool stands: a path's default."""

STEP_S = 0.004
"""The arm controller's step."""

FLAT_M = 1e-9
"""Points nearer to a plane lie in it."""


@dataclass(frozen=True)
class Verdict:
    """What a plan takes and keeps.

    Attributes:
        speed, acceleration: largest shares of the joints' limits, by differences, with and without
            jerk limit.
        tool_speed, tool_acceleration: of what the path asks for.
        beyond_deg: by how much a joint is beyond its range.
        aside_mm: beside the exact figure, by forward kinematics.
        apart_mm: between forward kinematics and the plan's own tool.
        turned_rad: off the orientation that was to stay.
        toppra: duration without jerk limit by toppra's; jerk: with jerk limit by without.
    """

    speed: float
    acceleration: float
    tool_speed: float
    tool_acceleration: float
    beyond_deg: float
    aside_mm: float
    apart_mm: float
    turned_rad: float
    toppra: float
    jerk: float

    def text(self) -> str:
        """All figures in a line."""
        return ", ".join(f"{f.name} {getattr(self, f.name):.6g}" for f in fields(self))

    def failures(self) -> list[str]:
        """What is not as it should be."""
        limits = {
            "speed": 1.005,
            "acceleration": 1.005,
            "tool_speed": 1.005,
            "tool_acceleration": 1.005,
            "beyond_deg": 1e-6,
            "aside_mm": 1e-6,
            "apart_mm": 1e-6,
            "turned_rad": 1e-7,
            "toppra": 1.05,
        }
        found = [f"{name} {getattr(self, name):.6g}" for name in limits]
        return [text for text, n in zip(found, limits, strict=True) if not self._keeps(n, limits)]

    def _keeps(self, name: str, limits: dict[str, float]) -> bool:
        return bool(getattr(self, name) <= limits[name])


def planned(path: Path) -> Outcome:
    """The quickest plan without jerk limit, or the reasons why there is none."""
    return draw_up(path, CELL, 1.0, "optimal", 0.0)


def judge(drawn: Drawing, path: Path, outcome: Outcome) -> Verdict:
    """What a plan takes and keeps."""
    smooth = draw_up(path, CELL, 1.0, "optimal")
    assert outcome.made is not None
    assert smooth.made is not None, smooth.problems
    free, rows = outcome.made.rows, smooth.made.rows
    uses = [_uses(r, outcome, path) for r in (free, rows)]
    low, high = outcome.setup.ranges.T
    beyond = np.degrees(np.maximum(low - free.joints, free.joints - high).max())
    reached = sphm.forward(free.joints, PEN)
    apart = np.linalg.norm(reached[:, :3, 3] - free.tool[:, :3, 3], axis=1).max()
    aside = 0.0 if drawn.aside is None else np.abs(drawn.aside(reached[:, :3, 3] * 1000.0)).max()
    turned = angle_between(reached[0, :3, :3], reached[:, :3, :3]).max() if drawn.still else 0.0
    theirs = sum(_toppra_s(leg) for leg in _legs(outcome))
    own_s = float(free.t[-1])
    speed, acceleration, tool_speed, tool_acceleration = np.max(uses, axis=0).tolist()
    return Verdict(
        speed,
        acceleration,
        tool_speed,
        tool_acceleration,
        beyond_deg=float(max(beyond, 0.0)),
        aside_mm=float(aside),
        apart_mm=float(1000.0 * apart),
        turned_rad=float(turned),
        toppra=own_s / theirs,
        jerk=float(rows.t[-1]) / own_s,
    )


def _uses(rows: Samples, outcome: Outcome, path: Path) -> Floats:
    """Largest shares: joint speed and acceleration, tool speed and acceleration, every 4 ms.

    Rows between two instants of the controller are of knots that are passed without a stop.
    """
    speeds = [move.speed for move in path.moves]
    asked = np.array([[v.tcp_mm_s, v.tcp_mm_s2] for v in speeds]).min(axis=0) / 1000.0
    kept = np.abs(rows.t / STEP_S - np.round(rows.t / STEP_S)) < 1e-6
    found = []
    for values in (rows.joints[kept], rows.tool[kept, :3, 3]):
        dt = np.diff(rows.t[kept])[:, None]
        speed = np.diff(values, axis=0) / dt
        found.append((speed, np.diff(speed, axis=0) / ((dt[1:] + dt[:-1]) / 2.0)))
    (speed, acceleration), (tool_speed, tool_acceleration) = found
    return np.array(
        [
            (np.abs(speed) / outcome.setup.speeds).max(),
            (np.abs(acceleration) / outcome.setup.accelerations).max(),
            np.linalg.norm(tool_speed, axis=1).max() / asked[0],
            np.linalg.norm(tool_acceleration, axis=1).max() / asked[1],
        ]
    )


def _legs(outcome: Outcome) -> Iterator[Leg]:
    """The plan's legs, each once."""
    last: Leg | None = None
    for block in outcome.blocks:
        if block.leg is not None and block.leg is not last:
            last = block.leg
            yield last


def _toppra_s(leg: Leg) -> float:
    """What toppra takes along the rows of a leg, from rest to rest."""
    assert isinstance(leg, Way)  # a random path has no ptp but its first
    speeds, accelerations = leg.setup.speeds, leg.setup.accelerations
    if leg.length_m == 0.0:
        limits = Bounds(speeds * SPOT_SHARE, accelerations * SPOT_SHARE)
        return toppra_duration_s(leg.joints, leg.s, limits)
    asked = [float(values.min()) for values in leg.contour.speeds(leg.s)]
    points = leg.pose[:, :3, 3] - leg.pose[:, :3, 3].mean(axis=0)
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    flat = np.abs(points @ axes[2]).max() < FLAT_M
    tool = points @ axes[:2].T if flat else np.zeros((len(points), 2))
    return toppra_duration_s(leg.joints, leg.s, Bounds(speeds, accelerations, *asked), tool)
