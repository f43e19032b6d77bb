"""How many stops a way needs.

Between two stops the controller drives a straight line of axis space, which is none of the tool's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.contour import Indices
from sphmctl.planner.legs import Direct
from sphmctl.planner.pace import Pace
from sphmctl.planner.way import SAME_RAD, Way
from sphmctl.robots import kr6
from sphmctl.robots.geometry import angle_between, invert

TOLERANCE_M = 0.0003
"""Of the tool point against the path. The path's tolerance is 0.5 mm; the rest is for the wrist's
lag and the servos' steps."""

TURN_TOLERANCE_RAD = float(np.radians(0.5))
"""Of the tool's orientation, which nobody gave a tolerance for."""

KNOT_LIMIT = 100
"""Knots on a way, and one more for each millimetre: a way that needs more passes too close to a
singularity to be meant."""

LOOKS = 32
"""Rows of a block at which it is looked at, at least, if it has them: the error of a chord is
smooth, and its largest value is missed by 0.1 %."""

AIM = 0.98
"""Of the length that should keep the tolerance just so: the next look is to succeed."""

LEAST_EXCESS = 0.25
"""A block is at most doubled in one look: the way further on may be more bent."""

Leg: TypeAlias = Way | Direct

Took: TypeAlias = Callable[[int, int], float]
"""How long the block between two rows takes, s; infinite where nothing drives it."""


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
        return _excess(self.error_m, self.turn_rad)


def _excess(error_m: float, turn_rad: float) -> float:
    return max(error_m / TOLERANCE_M, turn_rad / TURN_TOLERANCE_RAD)


def knot_limit(way: Way) -> int:
    """How many knots a way may have."""
    return KNOT_LIMIT + int(1000.0 * way.length_m)


def split(way: Way, pace: Pace, took_s: Took) -> Split | None:
    """The way in few blocks that keep the tolerances, with a stop at each mark; None: too many."""
    last = len(way.s) - 1
    if way.straight and all(row in (0, last) for _, row in way.marks):
        return _equal(way)
    return _greedy(way, pace, took_s)


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


def _greedy(way: Way, pace: Pace, took_s: Took) -> Split | None:
    """Each block as long as it may be, from the begin on, where bends and straights alternate.

    All of a block is driven at the pace of its slowest piece: where a stop takes less, it stops.
    """
    last = len(way.s) - 1
    targets = sorted({row for _, row in way.marks if row > 0} | {last})
    edges, length, errors = [0], 16, [(0.0, 0.0)]
    for target in targets:
        while edges[-1] < target:
            begin = edges[-1]
            length = _longest(way, begin, target, length)
            edges.append(_cut(way, pace, took_s, begin, begin + length))
            errors.append(_chord_errors(way, edges[-2:]))
            if len(edges) > knot_limit(way):
                return None
    error, turn = (float(worst) for worst in np.max(errors, axis=0))
    return Split(tuple(edges), error, turn)


def _cut(way: Way, pace: Pace, took_s: Took, begin: int, end: int) -> int:
    """Where a block that may run from row to row ends best: there, or earlier at a step of pace."""
    while (step := pace.best_step(begin, end)) is not None:
        quicker = took_s(begin, step) + took_s(step, end) < took_s(begin, end)
        if not quicker or _excess(*_chord_errors(way, (begin, step))) > 1.0:
            break
        end = step
    return end


def _longest(way: Way, begin: int, target: int, guess: int) -> int:
    """The number of rows of the longest block from `begin` on that keeps the tolerances."""
    most = target - begin
    good, bad = 1, most + 1
    count = min(guess, most)
    while bad - good > 1:
        excess = _excess(*_chord_errors(way, (begin, begin + count)))
        if excess <= 1.0:
            good = count
        else:
            bad = count
        # The error grows with the square of the length; a tenth is not worth another look.
        wanted = int(AIM * count / max(excess, LEAST_EXCESS) ** 0.5)
        if bad - good <= max(1, good // 10) or (excess <= 1.0 and wanted <= good + good // 20):
            break
        count = min(max(wanted, good + 1), bad - 1)
    return good


def _examine(way: Way, count: int) -> Split:
    """Equal blocks, driven as the controller does."""
    edges = tuple(round(i * (len(way.s) - 1) / count) for i in range(count + 1))
    return Split(edges, *_chord_errors(way, edges))


def _chord_errors(way: Way, edges: Sequence[int]) -> tuple[float, float]:
    """Largest distance (m) and turn (rad) off the path on straight lines of axis space.

    The cranks are driven at the arm's progress; also where the chord takes them at equal steps.
    """
    stride = max((edges[-1] - edges[0]) // (LOOKS * (len(edges) - 1)), 1)
    rows, stops = np.arange(edges[0], edges[-1], stride), np.array(edges)
    block = np.searchsorted(stops, rows, "right") - 1
    begin, end = stops[block], stops[block + 1]
    s, arm = way.s, way.joints[:, :6]
    share = (s[rows] - s[begin]) / (s[end] - s[begin])
    chord = arm[begin] + share[:, None] * (arm[end] - arm[begin])
    flange = invert(way.setup.base) @ kr6.forward(chord)
    reached, wanted, tangent = flange @ way.on_flange[rows], way.pose[rows], way.tangents[rows]
    if np.ptp(way.joints[rows, 6:], axis=0).max() > SAME_RAD:
        parts = np.split(np.arange(len(rows)), np.searchsorted(rows, stops[1:-1]))
        cranks = [
            _cranks_at_progress(way.joints[a : b + 1], chord[part], rows[part] - a)
            for (a, b), part in zip(pairwise(edges), parts, strict=True)
        ]
        followed = flange @ way.setup.on_flange(np.concatenate(cranks))
        reached = np.concatenate([reached, followed])
        wanted, tangent = np.concatenate([wanted] * 2), np.concatenate([tangent] * 2)
    apart = reached[:, :3, 3] - wanted[:, :3, 3]
    beside = apart - (apart * tangent).sum(axis=1)[:, None] * tangent
    turn = angle_between(reached[:, :3, :3], wanted[:, :3, :3])
    return float(np.linalg.norm(beside, axis=1).max()), float(turn.max())


def _cranks_at_progress(here: Floats, chord: Floats, rows: Indices) -> Floats:
    """Cranks (k, 3) of the way where its leading axis stands as it does on the chord.

    Args:
        here: joints (n, 9) of a block's rows.
        chord: the arm's on the chord (k, 6) at some of these rows (k,).
    """
    moved = np.abs(here[-1, :6] - here[0, :6])
    lead = int(np.argmax(moved))
    sign = np.sign(here[-1, lead] - here[0, lead])
    along = here[:, lead] * sign
    if moved[lead] == 0.0 or np.any(np.diff(along) <= 0.0):
        return here[rows, 6:]
    wanted = chord[:, lead] * sign
    return np.stack([np.interp(wanted, along, here[:, leg]) for leg in (6, 7, 8)], axis=1)
