"""Continuous joints along a path of tool poses, also through A5 = 0, where A4 and A6 are open."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.geometry import TURN
from sphmctl.robots.kr6_model import SINGULAR_SINE
from sphmctl.robots.sphm.chain import RANGES9, flange_target, join, margin_of, turned

# A joint that moves further than this (rad, 20 degrees) between two poses of a path is taken to
# have changed branch. It only ranks the branches to start on; nothing is refused for it.
JUMP_RAD = 0.35
# Rows that are followed at one go: few where branches meet, many on the long ways between.
FEWEST, MOST = 8, 4096
NO_RANGES: Floats = np.array([[-np.inf, np.inf]] * 9)


def inverse_along(
    T: ArrayLike,
    wrist: ArrayLike,
    start: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Floats:
    """Joints (n, 9) along tool poses (n, 4, 4), each row the answer to which the rows before lead.

    That is the nearest to where the step before would go on to: it matters where two branches meet,
    in the stretched arm and near A5 = 0, which the joints then pass as smoothly as the pose does.
    Where A5 = 0 only the sum of A4 and A6 is real: A4 then stays where it was and A6 takes the
    rest, so that the joints pass the singular pose without a step. Every row reproduces its pose.
    Rows may still step where the path has no continuous answer within the limits: the caller checks
    speeds.

    Args:
        T: tool poses, in order.
        wrist: crank angles, broadcast to (n, 3).
        start: joints (9,) just before the first pose. None tries every answer and keeps the one
            with the fewest missing rows, then the fewest jumps, then the largest margin of the arm.
        tool: the tool's frame on the platform, (4, 4); None for the platform centre O7.
        limits: lowest and highest angle of each joint, (9, 2).
        mount_yaw: see `platform_in_flange`.

    Returns:
        NaN rows where there is no answer within the limits; the rows after go on from the last one.
    """
    T, limits = np.asarray(T, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    target, cranks, branches = _answers(T, wrist, tool, limits, mount_yaw)
    if len(T) == 0:
        return np.empty((0, 9))
    if start is not None:
        before = np.asarray(start, dtype=np.float64)[:6]
        return join(_walk(target, branches, before, limits[:6])[:, None], cranks)[:, 0]
    anchor = _anchor(branches, limits[:6])
    starts = kr6.inverse_in_range(target[anchor], limits[:6])
    walked = [_both_ways(target, branches, anchor, before, limits[:6]) for before in starts]
    best = min(range(len(walked)), key=lambda index: _rank(walked[index], limits[:6]))
    return join(walked[best][:, None], cranks)[:, 0]


def branches_along(
    T: ArrayLike,
    wrist: ArrayLike,
    tool: ArrayLike | None = None,
    mount_yaw: float = 0.0,
) -> Floats:
    """Every branch of the arm followed along a path, (K, n, 9) with K at most 8; no ranges.

    Whole turns are those in which the way of A4 and A6 begins within half a turn of zero; the other
    arguments are those of `inverse_along`. K is 0 where no pose at all is reached.
    """
    T = np.asarray(T, dtype=np.float64)
    target, cranks, branches = _answers(T, wrist, tool, NO_RANGES, mount_yaw)
    if len(T) == 0 or np.isnan(branches).all():
        return np.empty((0, len(T), 9))
    anchor = _anchor(branches, RANGES9[:6])
    if np.isnan(branches[anchor]).all():
        anchor = int((~np.isnan(branches[:, :, 0])).any(axis=1).argmax())
    starts = branches[anchor][~np.isnan(branches[anchor, :, 0])]
    walked = [_both_ways(target, branches, anchor, before, NO_RANGES[:6]) for before in starts]
    return join(np.stack(walked, axis=1), cranks).swapaxes(0, 1)


def _answers(
    T: Floats, wrist: ArrayLike, tool: ArrayLike | None, limits: Floats, mount_yaw: float
) -> tuple[Floats, Floats, Floats]:
    """Flange poses (n, 4, 4), cranks (n, 3), and the arm's branches (n, 8, 6) for each pose."""
    cranks = kr6.snap_to_range(np.asarray(wrist, dtype=np.float64), limits[6:])
    target = flange_target(T, cranks, tool, mount_yaw)
    return target, np.broadcast_to(cranks, (len(T), 3)), kr6.inverse(target)


def _anchor(branches: Floats, limits: Floats) -> int:
    """The first pose that settles the joints of all its answers: none of them has A5 = 0."""
    answers = kr6.snap_to_range(turned(branches, limits.mean(axis=1), limits), limits)
    answered = np.asarray(~np.isnan(answers).any(axis=-1))
    some = answered.any(axis=1)
    settled = some & ~(answered & _in_line(branches)).any(axis=1)
    return int(np.argmax(settled if settled.any() else some))


def _in_line(branches: Floats) -> NDArray[np.bool_]:
    """Which branches have axes 4 and 6 in line, by the same measure as the arm's inverse."""
    return np.asarray(np.abs(np.sin(branches[..., 4])) < 2.0 * SINGULAR_SINE)


def _both_ways(
    target: Floats, branches: Floats, anchor: int, before: Floats, limits: Floats
) -> Floats:
    """Arm joints (n, 6) from `before` at row `anchor` to the end, and back to the begin."""
    out = np.empty((len(target), 6))
    out[anchor:] = _walk(target[anchor:], branches[anchor:], before, limits)
    out[:anchor] = _walk(target[:anchor][::-1], branches[:anchor][::-1], before, limits)[::-1]
    return out


def _walk(target: Floats, branches: Floats, before: Floats, limits: Floats) -> Floats:
    """Arm joints (n, 6) from `before` (6,), each row the answer to which the rows before lead."""
    out = np.full((len(target), 6), np.nan)
    if len(target) == 0:
        return out
    kinds, ends = _stretches(branches)
    row, size, part, pace = 0, FEWEST, 0, np.zeros(6)
    while row < len(target):
        while ends[part] <= row:
            part += 1
        stop = min(row + size, ends[part])
        answers = branches[row:stop]
        if kinds[part]:
            alone = stop - row == 1  # plain floats are quicker there
            answers = kr6.inverse(target[row] if alone else target[row:stop], before)
            answers = answers.reshape(-1, 8, 6)
        done = _advance(answers, before, pace, limits)
        out[row : row + len(done)] = done
        size = min(2 * size, MOST) if len(done) == stop - row else FEWEST
        row += len(done)
        if not np.isnan(done[-1, 0]):
            pace = _steady(done[-1] - (done[-2] if len(done) > 1 else before))
            before = done[-1]
    return out


def _stretches(branches: Floats) -> tuple[list[int], list[int]]:
    """Stretches of rows with the same singular answers: which (0 for none), and where they end.

    In such a stretch what the pose leaves open keeps its value, so one hint serves all its rows.
    """
    kind = _in_line(branches) @ (1 << np.arange(8))
    ends = np.append(np.flatnonzero(np.diff(kind)) + 1, len(kind))
    return [int(kind[end - 1]) for end in ends], [int(end) for end in ends]


def _steady(steps: Floats) -> Floats:
    """Steps (..., 6) from row to row, those that are jumps made 0: nothing goes on from them."""
    far = np.abs(steps).max(axis=-1, keepdims=True) > JUMP_RAD
    return np.where(far, 0.0, steps)


def _advance(answers: Floats, before: Floats, pace: Floats, limits: Floats) -> Floats:
    """The first rows (k, 6), k > 0, that go on from `before` without a change of branch.

    The first row is looked at with every turn the limits allow. Where it has no answer, the rows
    are those that have none either; else those whose nearest answer is the same branch.
    """
    first = kr6.snap_to_range(turned(answers[:1], before, limits), limits)[0]
    step = np.nan_to_num(np.abs(first - before - pace).max(axis=-1), nan=np.inf)
    branch = int(step.argmin())
    if np.isinf(step[branch]):
        every = kr6.snap_to_range(turned(answers, before, limits), limits)
        found = ~np.isnan(every).any(axis=-1).all(axis=-1)
        count = int(found.argmax()) if found.any() else len(answers)
        return np.full((count, 6), np.nan)
    apart = np.empty((len(answers) - 1, 8, 6))
    np.subtract(answers[1:], answers[:-1, branch, None], out=apart)
    turns = np.round(apart / TURN)
    apart -= TURN * turns
    paces = _steady(np.vstack([first[branch] - before, apart[:-1, branch]]))[: len(apart)]
    apart -= paces[:, None]
    steps = np.abs(apart, out=apart).max(axis=-1)
    with np.errstate(invalid="ignore"):
        nearest = steps[:, branch] <= np.fmin.reduce(steps, axis=1)
    rows = answers[:, branch].copy()
    rows[1:] -= TURN * np.cumsum(turns[:, branch], axis=0)
    rows = kr6.snap_to_range(rows + TURN * np.round((first[branch] - rows[0]) / TURN), limits)
    rows[0] = first[branch]
    good = nearest & ~np.isnan(rows[1:]).any(axis=-1)
    return rows if good.all() else rows[: 1 + int(good.argmin())]


def _rank(walked: Floats, limits: Floats) -> tuple[int, int, float]:
    """How well a start leads along the path (n, 6); the lowest is best."""
    missing = int(np.isnan(walked[:, 0]).sum())
    with np.errstate(invalid="ignore"):
        jumps = int((np.abs(np.diff(walked, axis=0)).max(axis=-1) > JUMP_RAD).sum())
    margin = float(np.fmin.reduce(margin_of(walked, limits), initial=np.inf))
    return missing, jumps, -margin
