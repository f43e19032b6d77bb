"""Nine joints for a path of tool poses: the arm's branch and the wrist's pose, by a policy.

The arm's six joints follow from the tool's pose once the three cranks are known. A policy gives the
cranks (`Cranks`, `Fixed`, `Motion`, `Level` and `Tilt` with a heave), leaves one parameter free
(`Level`, `Tilt`), or all three (`Auto`). What is free is found in a graph over the whole path, then
refined and smoothed; the arm is then solved in closed form at every row.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from sphmctl.errors import InvalidError, Problem
from sphmctl.motion import Floats
from sphmctl.planner.legs import Setup
from sphmctl.planner.policies import cost
from sphmctl.planner.policies.families import Family, FreeFamily, LevelFamily, TiltFamily
from sphmctl.planner.policies.free import resolve_best
from sphmctl.planner.policies.kinds import Auto, Cranks, Fixed, Level, Motion, Policy, Tilt
from sphmctl.planner.policies.known import ARRIVAL_RAD, Task, resolve_cranks
from sphmctl.planner.policies.outcome import Outcome, Reason, Resolved, Unresolved
from sphmctl.robots import kr6, rrs
from sphmctl.robots.sphm.wrist_grid import heave_range, steepest_tilt

HEAVE_TOLERANCE_M = 1e-9
"""A heave so far beyond what a tilt allows stands on the edge: rounding of mm with six decimals."""

HELD_SHARES = (0.5, 0.25, 0.75, 0.05, 0.95)
"""Of the range of a free heave: what is tried without change where the search fails."""


def resolve(
    target: ArrayLike,
    s_m: ArrayLike,
    policy: Policy,
    setup: Setup,
    start: ArrayLike | None = None,
    end: ArrayLike | None = None,
) -> Outcome:
    """Joints for every row, or the rows and reasons why not.

    Args:
        target: tool poses in the arm's base frame, (n, 4, 4), n > 0; rows 0.5 mm apart suit.
        s_m: how far along the path each row is, not falling, (n,).
        policy: what is done with the wrist.
        setup: the robot; its `base` is not used.
        start: joints (9,) of the first row; None lets the arm's branch be chosen.
        end: joints (9,) that the last row has to have; None for any.

    Raises:
        InvalidError: shapes that do not fit each other.
    """
    T, s = np.asarray(target, dtype=np.float64), np.asarray(s_m, dtype=np.float64)
    if T.ndim != 3 or T.shape[1:] != (4, 4) or len(T) == 0 or s.shape != (len(T),):
        raise InvalidError(f"tool poses have shape {T.shape} and arc lengths {s.shape}")
    given = [None if q is None else np.asarray(q, dtype=np.float64) for q in (start, end)]
    return _resolve(Task(T, cost.way(T, s), setup, *given), policy)


def _resolve(task: Task, policy: Policy) -> Outcome:
    rows = len(task.target)
    match policy:
        case Cranks(cranks) | Fixed(cranks):
            return resolve_cranks(task, _rows(cranks, rows, 3))
        case Motion(heave_m, tilt, direction):
            return _posed(task, _rows(direction, rows), _rows(tilt, rows), _rows(heave_m, rows))
        case Level(heave_m):
            if heave_m is None:
                family = LevelFamily.of(rows, task.setup.ranges)
                return _misfit(task, None) or _one_free(task, family)
            level = np.zeros(rows)
            return _posed(task, level, level, _rows(heave_m, rows))
        case Tilt(flange, heave_m):
            return _tilt(task, flange, heave_m)
        case Auto(also):
            others = (_resolve(task, other) for other in (*also, Level(), Tilt()))
            free = FreeFamily.of(rows, task.setup.ranges)
            also_between = _chain(others, _between(task, free))
            return resolve_best(task, free, also_between, _fallback(task))


def _chain(*parts: Iterator[Outcome]) -> Iterator[Outcome]:
    for part in parts:
        yield from part


def _between(task: Task, family: Family) -> Iterator[Outcome]:
    """The wrist's pose straight from the start's to the end's, where both are given."""
    if task.start is not None and task.end is not None:
        yield _straight(task, family, *(family.values(q[6:]) for q in (task.start, task.end)))


def _straight(task: Task, family: Family, begin: Floats, end: Floats) -> Outcome:
    """Joints for a family's parameters (d,) that run straight from a begin to an end."""
    share = task.way_m[:, None] / max(float(task.way_m[-1]), cost.SHORTEST_M)
    values = np.clip(begin + share * (end - begin), family.low, family.high)
    return resolve_cranks(task, np.asarray(family.cranks(np.arange(len(values)), values)))


def _one_free(task: Task, family: Family) -> Outcome:
    """The best heaves, never worse than the one that is given, if one is."""
    return resolve_best(task, family, _held(task, family), _constant(task, family))


def _held(task: Task, family: Family) -> Iterator[Outcome]:
    """The heave as it is given: kept, or straight from the start's to the end's."""
    given = [family.values(q[6:]) for q in (task.start, task.end) if q is not None]
    if given:
        yield _straight(task, family, given[0], given[-1])


def _constant(task: Task, family: Family) -> Iterator[Outcome]:
    """Heaves without change, where none is given and the wrist can hold them all along."""
    low, high = family.low.max(axis=0), family.high.min(axis=0)
    if task.start is None and task.end is None and (low <= high).all():
        for share in HELD_SHARES:
            yield _straight(task, family, *[low + share * (high - low)] * 2)


def _fallback(task: Task) -> Iterator[Outcome]:
    """What a wrist that keeps its pose can do."""
    for given in (task.start, task.end):
        if given is not None:
            yield _resolve(task, Fixed(given[6:]))


def _rows(values: ArrayLike, rows: int, *width: int) -> Floats:
    """Values for every row."""
    array = np.asarray(values, dtype=np.float64)
    try:
        return np.array(np.broadcast_to(array, (rows, *width)))
    except ValueError:
        raise InvalidError(
            f"the wrist's values have shape {array.shape}; the path has {rows} rows"
        ) from None


def _posed(task: Task, direction: Floats, tilt: Floats, heave_m: Floats) -> Outcome:
    """Joints for wrist poses that are known."""
    problem = impossible(task.setup, direction, tilt, heave_m)
    if problem is not None:
        return Unresolved((problem,))
    low, high = heave_range(direction, tilt, task.setup.ranges[6:])
    cranks = rrs.inverse(direction, tilt, np.clip(heave_m, low, high))
    return resolve_cranks(task, np.clip(cranks, *task.setup.ranges[6:].T))


def impossible(
    setup: Setup, direction: Floats, tilt: Floats, heave_m: Floats | None = None
) -> Reason | None:
    """The first row (of n) whose tilt, or heave if one is given, the wrist cannot hold."""
    low, high = heave_range(direction, tilt, setup.ranges[6:])
    wrong = ~(low <= high + HEAVE_TOLERANCE_M)
    if heave_m is not None:
        beyond = (heave_m < low - HEAVE_TOLERANCE_M) | (heave_m > high + HEAVE_TOLERANCE_M)
        wrong = wrong | beyond | ~np.isfinite(heave_m)
    if not wrong.any():
        return None
    row = int(wrong.argmax())
    most = float(np.degrees(steepest_tilt(direction[row], setup.ranges[6:])))
    value = float(np.degrees(tilt[row]))
    towards = float(np.degrees(direction[row])) % 360.0
    if heave_m is None or low[row] > high[row]:
        message = (
            f"the wrist would have to tilt by {value:.4g} degrees towards {towards:.4g} degrees; "
            f"at most {most:.4g} is possible there"
        )
        return Reason(row, Problem("", "", value, most, message))
    heave = float(heave_m[row]) * 1e3
    bounds = float(low[row]) * 1e3, float(high[row]) * 1e3
    message = (
        f"the wrist would have to hold a heave of {heave:.6g} mm; tilted by {value:.4g} degrees "
        f"towards {towards:.4g} degrees it goes from {bounds[0]:.4f} to {bounds[1]:.4f} mm"
    )
    return Reason(row, Problem("", "", heave, bounds[0 if heave < bounds[0] else 1], message))


def _tilt(task: Task, flange: Floats | None, heave_m: Floats | None) -> Outcome:
    """The flange's z stays, the wrist makes the rest."""
    setup, rows = task.setup, len(task.target)
    platform = task.target[:, :3, :3] @ setup.tool[:3, :3].T
    if flange is not None:
        normal = np.asarray(flange, dtype=np.float64)[:, 2]
    elif task.start is not None:
        normal = kr6.forward(task.start[:6])[:3, 2]
    else:
        normal = platform[0, :, 2]
    direction, tilt = leaning(platform, normal)
    if heave_m is not None:
        return _posed(task, direction, tilt, _rows(heave_m, rows))
    problem = impossible(setup, direction, tilt)
    if problem is not None:
        return Unresolved((problem,))
    limits = setup.ranges[6:]
    low, high = heave_range(direction, tilt, limits)
    family = TiltFamily(low[:, None], np.maximum(low, high)[:, None], direction, tilt, limits)
    return _misfit(task, normal) or _one_free(task, family)


def leaning(platform: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Direction and tilt, (n,), of platforms (n, 3, 3) on a flange whose z is `normal` (3,)."""
    # The flange's z from the platform is (-sin t cos s, -sin t sin s, cos t): see `rrs.inverse`.
    x, y, z = (normal @ platform).T
    return np.arctan2(-y, -x), np.arctan2(np.hypot(x, y), z)


def _misfit(task: Task, normal: Floats | None) -> Unresolved | None:
    """Why joints given for the first or last row are none of the policy's.

    Args:
        normal: the flange's z that is to be kept; None when the platform is to be level.
    """
    for row, given in ((0, task.start), (len(task.target) - 1, task.end)):
        if given is None:
            continue
        if normal is None:
            value = float(rrs.tilt_of(rrs.forward(given[6:]))[1])
            what = "the platform is tilted against the flange"
        else:
            apart = np.linalg.norm(kr6.forward(given[:6])[:3, 2] - normal)
            value = float(2.0 * np.arcsin(min(float(apart) / 2.0, 1.0)))
            what = "the flange leans away from the orientation it has to keep"
        if value > ARRIVAL_RAD:
            degrees = float(np.degrees(value))
            place = "begin" if row == 0 else "end"
            message = (
                f"{what} by {degrees:.4g} degrees at the {place}, and the policy asks for 0; "
                "choose another policy, or use ptp between"
            )
            return Unresolved((Reason(row, Problem("", "", degrees, 0.0, message)),))
    return None


__all__ = [
    "Outcome",
    "Reason",
    "Resolved",
    "Unresolved",
    "impossible",
    "leaning",
    "resolve",
]
