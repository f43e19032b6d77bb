"""Places on a path in words, and the sentences that refuse what the robot cannot do there."""

from __future__ import annotations

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move

RANGE_TOLERANCE_RAD = float(np.radians(1e-6))
"""Rounding of joints that stand on the edge of their range, as the octagon's cranks do."""


def place(move: Move, u: float, length_m: float) -> str:
    """`line 12, move 3 (lin to C), 41.2 mm along`."""
    if length_m > 0.0:
        return f"{move.where}, {u * length_m * 1000.0:.1f} mm along"
    return move.where if u in (0.0, 1.0) else f"{move.where}, {u * 100.0:.0f} % of the way"


def joint_problem(where: str, joint: int, value: float, limit: float, kind: str) -> Problem:
    """A joint beyond its range ("angle"), "speed" or "acceleration"; value, limit in rad, s."""
    unit = {"angle": "degrees", "speed": "degrees/s", "acceleration": "degrees/s2"}[kind]
    value_deg, limit_deg = (round(float(np.degrees(x)), 9) for x in (value, limit))
    bound = "at least" if kind == "angle" and value < limit else "at most"
    name = JOINT_NAMES[joint]
    article = "an" if kind == "acceleration" else "a"
    needs = "would have to stand at" if kind == "angle" else f"would need {article} {kind} of"
    return Problem(
        where,
        name,
        value_deg,
        limit_deg,
        f"{name} {needs} {value_deg:.6g} {unit}; {bound} {limit_deg:.6g} is allowed",
    )


def range_problems(where: str, joints: Floats, ranges: Floats) -> list[Problem]:
    """One problem for each of the joints (9,) or (6,) that is beyond its range."""
    found = []
    for index, (value, (low, high)) in enumerate(zip(joints, ranges, strict=False)):
        if value < low - RANGE_TOLERANCE_RAD or value > high + RANGE_TOLERANCE_RAD:
            limit = low if value < low else high
            found.append(joint_problem(where, index, float(value), float(limit), "angle"))
    return found
