"""What a drive along the octagon's knots was worth, from the true axes; runs nothing.

Forward kinematics are `sphmctl.robots.kr6`'s, of which the emulator knows nothing. Millimetres are
those of the arm's flange: the wrist takes no part in the comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sphmctl.motion import Floats, Plan
from sphmctl.robots import kr6
from tools.bench.published_runs import Drive

SAME_DEG = 1e-3
"""A block's target is a point of the plan: the text of a value and float32 leave 1e-5."""

STILL_DEG = 1e-6
"""An axis that goes less in 4 ms stands: the emulated world is exact."""

BEGUN_DEG = 0.005
"""The motion begins and ends so far from where the arm stood before and stands after it: a cell is
put at the start only as exactly as it is measured."""

STEP_S = 0.004
"""Between two rows of truth."""

PIECE = 512
"""True places that are compared with the whole plan at a time: some 20 MB."""


@dataclass(frozen=True)
class Path:
    """A complete drive.

    Attributes:
        points, lost: points that should have been targets, and those that no block ever had.
        repeated: blocks to where the arm already stood.
        time_s: from the first motion to the last.
        off_mm: farthest that path and plan are from each other, whenever.
        late_mm: farthest from where the plan is at the same time after the first motion.
        speed_mm_s: highest.
    """

    points: int
    lost: int
    repeated: int
    time_s: float
    off_mm: float
    late_mm: float
    speed_mm_s: float


@dataclass(frozen=True)
class Stop:
    """A stop on the way.

    Attributes:
        way_deg: what the axis that went farthest did after the stop was asked for.
        rest_s: until the arm stood for good.
    """

    way_deg: float
    rest_s: float


def flange_mm(joints_deg: Floats) -> Floats:
    """Places of the flange, shape (n, 3)."""
    result: Floats = 1000.0 * kr6.forward(np.radians(joints_deg))[:, :3, 3]
    return result


def fastest_mm_s(t_s: Floats, places_mm: Floats) -> float:
    """The highest speed between two places."""
    return float((np.linalg.norm(np.diff(places_mm, axis=0), axis=1) / np.diff(t_s)).max())


def planned_mm_s(plan: Plan) -> float:
    """The flange's highest speed on the plan."""
    return fastest_mm_s(plan.t, flange_mm(np.degrees(plan.joints[:, :6])))


def lost_points(drive: Drive) -> int:
    """Points that were no block's target when their turn had come."""
    reached, last = 0, -1
    for block in drive.entered:
        off_deg = np.abs(drive.points_deg[last + 1 :] - np.array(block.target_deg)).max(axis=1)
        found = np.flatnonzero(off_deg < SAME_DEG)
        if len(found):
            last += 1 + int(found[0])
            reached += 1
    return len(drive.points_deg) - reached


def path_of(drive: Drive, plan: Plan) -> Path:
    """The figures of a drive that nobody stopped."""
    first, last = _begin_end(drive.truth[:, 1:])
    t_s = drive.truth[first:last, 0] - drive.truth[first, 0]
    joints_deg = drive.truth[first:last, 1:]
    true_mm, plan_mm = flange_mm(joints_deg), flange_mm(np.degrees(plan.joints[:, :6]))
    then_mm = np.stack([np.interp(t_s, plan.t, axis_mm) for axis_mm in plan_mm.T], axis=1)
    return Path(
        points=len(drive.points_deg),
        lost=lost_points(drive),
        repeated=drive.motions - len(drive.entered),
        time_s=float(t_s[-1]),
        off_mm=max(farthest_mm(true_mm, plan_mm), farthest_mm(plan_mm, true_mm)),
        late_mm=float(np.linalg.norm(true_mm - then_mm, axis=1).max()),
        speed_mm_s=fastest_mm_s(t_s, true_mm),
    )


def _begin_end(joints_deg: Floats) -> tuple[int, int]:
    """The rows of the motion as the bounds of a slice."""
    begun = np.abs(joints_deg - joints_deg[0]).max(axis=1) > BEGUN_DEG
    ended = np.abs(joints_deg - joints_deg[-1]).max(axis=1) > BEGUN_DEG
    return int(begun.argmax()) - 1, len(ended) - int(ended[::-1].argmax()) + 1


def moving_times_s(drive: Drive) -> list[float]:
    """How long the arm moved at a time, from one stand to the next."""
    first, last = _begin_end(drive.truth[:, 1:])
    ways_deg = np.abs(np.diff(drive.truth[first:last, 1:], axis=0)).max(axis=1)
    edges = np.diff(np.concatenate(([0], ways_deg > STILL_DEG, [0])).astype(int))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return [float(s) for s in (ends - begins) * STEP_S]


def farthest_mm(places: Floats, line: Floats) -> float:
    """How far the farthest of the places is from a line of straight pieces."""
    worst = 0.0
    for at in range(0, len(places), PIECE):
        some = places[at : at + PIECE]
        # Squared distance without the place's own square, which is the same for the whole line.
        nearest = ((line**2).sum(axis=1) - 2.0 * some @ line.T).argmin(axis=1)
        beside = [
            _to_piece(some, line[np.maximum(nearest - 1, 0)], line[nearest]),
            _to_piece(some, line[nearest], line[np.minimum(nearest + 1, len(line) - 1)]),
        ]
        worst = max(worst, float(np.minimum(*beside).max()))
    return worst


def _to_piece(places: Floats, begin: Floats, end: Floats) -> Floats:
    way, off = end - begin, places - begin
    square = (way * way).sum(axis=1)
    share = np.clip((off * way).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    result: Floats = np.linalg.norm(off - share[:, None] * way, axis=1)
    return result


def stop_of(drive: Drive) -> Stop:
    """What the arm did after the stop was asked for."""
    after = drive.truth[drive.truth[:, 0] >= drive.stop_s]
    ways_deg = np.abs(np.diff(after[:, 1:], axis=0))
    moves = np.flatnonzero(ways_deg.max(axis=1) > STILL_DEG)
    return Stop(
        way_deg=float(ways_deg.sum(axis=0).max()),
        rest_s=float(after[moves[-1] + 1, 0] - drive.stop_s) if len(moves) else 0.0,
    )
