"""How many stops a way needs.

Between two stops the controller drives a straight line of axis space, which is none of the tool's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.legs import Direct
from sphmctl.planner.way import Way
from sphmctl.robots.geometry import angle_between

TOLERANCE_M = 0.0003
"""Of the tool point against the path. The path's tolerance is 0.5 mm; the rest is for the wrist's
lag and the servos' steps."""

TURN_TOLERANCE_RAD = float(np.radians(0.5))
"""Of the tool's orientation, which nobody gave a tolerance for."""

KNOT_LIMIT = 100
"""Knots on a way, and one more for each millimetre: a way that needs more passes too close to a
singularity to be meant."""

Leg: TypeAlias = Way | Direct


@dataclass(frozen=True)
class Split:
    """A way cut into blocks.

    Attributes:
        edges: the rows of the way at which blocks begin and end, rising from 0.
        error_m: largest distance of the tool point from the path.
        turn_rad: largest difference from the path's orientation.
    """

    edges: tuple[int, ...]
    error_m: float
    turn_rad: float

    @property
    def count(self) -> int:
        """How many blocks."""
        return len(self.edges) - 1

    @property
    def excess(self) -> float:
        """The larger error as a share of its tolerance."""
        return max(self.error_m / TOLERANCE_M, self.turn_rad / TURN_TOLERANCE_RAD)


def knot_limit(way: Way) -> int:
    """How many knots a way may have."""
    return KNOT_LIMIT + int(1000.0 * way.length_m)


def split(way: Way) -> Split | None:
    """The way in few blocks that keep the tolerances, with a stop at each mark; None: too many."""
    last = len(way.s) - 1
    if way.straight and all(row in (0, last) for _, row in way.marks):
        return _equal(way)
    return _greedy(way)


def _equal(way: Way) -> Split | None:
    """As few equal blocks as possible: the simplest to look at, and right for a line."""
    found = _examine(way, 1)
    while found.excess > 1.0:
        # The error falls with the square of the count; the step stays short of that.
        count = max(found.count + 1, int(found.count * found.excess**0.5 * 0.9))
        if count > knot_limit(way):
            return None
        found = _examine(way, count)
    while found.count > 1:
        fewer = _examine(way, found.count - 1)
        if fewer.excess > 1.0:
            break
        found = fewer
    return found


def _greedy(way: Way) -> Split | None:
    """Each block as long as it may be, from the begin on, where bends and straights alternate."""
    last = len(way.s) - 1
    targets = sorted({row for _, row in way.marks if row > 0} | {last})
    edges, length, errors = [0], 16, [(0.0, 0.0)]
    for target in targets:
        while edges[-1] < target:
            begin = edges[-1]
            length = _longest(way, begin, target, length)
            edges.append(begin + length)
            errors.append(_chord_errors(way, begin, begin + length))
            if len(edges) > knot_limit(way):
                return None
    error, turn = (float(worst) for worst in np.max(errors, axis=0))
    return Split(tuple(edges), error, turn)


def _longest(way: Way, begin: int, target: int, guess: int) -> int:
    """The number of rows of the longest block from `begin` on that keeps the tolerances."""

    def fits(count: int) -> bool:
        error, turn = _chord_errors(way, begin, begin + count)
        return error <= TOLERANCE_M and turn <= TURN_TOLERANCE_RAD

    most = target - begin
    good, bad = 1, most + 1
    count = min(guess, most)
    while bad - good > 1:
        if fits(count):
            good = count
        else:
            bad = count
        count = min(2 * good, most) if bad > most else (good + bad) // 2
        # A tenth more or less is not worth another look.
        if bad - good <= max(1, good // 10):
            break
    return good


def _examine(way: Way, count: int) -> Split:
    """Equal blocks, driven as the controller does."""
    edges = tuple(round(i * (len(way.s) - 1) / count) for i in range(count + 1))
    errors = [_chord_errors(way, begin, end) for begin, end in pairwise(edges)]
    error, turn = (float(worst) for worst in np.max(errors, axis=0))
    return Split(edges, error, turn)


def _chord_errors(way: Way, begin: int, end: int) -> tuple[float, float]:
    """Largest distance (m) and turn (rad) off the path on a straight line of axis space.

    The cranks are driven at the arm's progress; also where the chord takes them at equal steps.
    """
    here = way.joints[begin : end + 1]
    share = (way.s[begin : end + 1] - way.s[begin]) / (way.s[end] - way.s[begin])
    chord = here[0] + share[:, None] * (here[-1] - here[0])
    plain, followed = here.copy(), here.copy()
    plain[:, :6] = followed[:, :6] = chord[:, :6]
    followed[:, 6:] = _cranks_at_progress(here, chord)
    reached = way.setup.tool_pose(np.concatenate([plain, followed]))
    wanted = np.concatenate([way.pose[begin : end + 1]] * 2)
    apart = reached[:, :3, 3] - wanted[:, :3, 3]
    tangent = np.concatenate([way.contour.tangent(way.s[begin : end + 1])] * 2)
    beside = apart - (apart * tangent).sum(axis=1)[:, None] * tangent
    turn = angle_between(reached[:, :3, :3], wanted[:, :3, :3])
    return float(np.linalg.norm(beside, axis=1).max()), float(turn.max())


def _cranks_at_progress(here: Floats, chord: Floats) -> Floats:
    """Cranks (n, 3) of the way where its leading axis stands as it does on the chord."""
    moved = np.abs(here[-1, :6] - here[0, :6])
    lead = int(np.argmax(moved))
    along = here[:, lead] * np.sign(here[-1, lead] - here[0, lead])
    if moved[lead] == 0.0 or np.any(np.diff(along) <= 0.0):
        return here[:, 6:]
    wanted = chord[:, lead] * np.sign(here[-1, lead] - here[0, lead])
    return np.stack([np.interp(wanted, along, here[:, leg]) for leg in (6, 7, 8)], axis=1)
