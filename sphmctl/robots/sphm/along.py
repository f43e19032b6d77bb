"""Continuous joints along a path of tool poses, also through A5 = 0, where A4 and A6 are open."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.kr6_model import SINGULAR_SINE
from sphmctl.robots.sphm.chain import RANGES9, flange_target, join, margin_of, turned

# A joint that moves further than this (rad, 20 degrees) between two poses of a path is taken to
# have changed branch. It only ranks the branches to start on; nothing is refused for it.
JUMP_RAD = 0.35


def inverse_along(
    T: ArrayLike,
    wrist: ArrayLike,
    start: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    limits: ArrayLike = RANGES9,
    mount_yaw: float = 0.0,
) -> Floats:
    """Joints (n, 9) along tool poses (n, 4, 4), each row the answer nearest to the row before.

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
    cranks = kr6.snap_to_range(np.asarray(wrist, dtype=np.float64), limits[6:])
    cranks = np.broadcast_to(cranks, (len(T), 3))
    target = flange_target(T, cranks, tool, mount_yaw)
    branches = kr6.inverse(target)
    if len(T) == 0:
        return np.empty((0, 9))
    if start is not None:
        before = np.asarray(start, dtype=np.float64)[None, :6]
        walked = _walk(target, branches, range(len(T)), before, limits[:6])
        return join(walked, cranks)[:, 0]
    anchor = _anchor(branches, limits[:6])
    before = kr6.inverse_in_range(target[anchor], limits[:6])
    walked = _walk(target, branches, range(anchor, len(T)), before, limits[:6])
    walked[:anchor] = _walk(target, branches, range(anchor - 1, -1, -1), before, limits[:6])[
        :anchor
    ]
    return join(walked[:, _best_start(walked, limits[:6]), None], cranks)[:, 0]


def _anchor(branches: Floats, limits: Floats) -> int:
    """The first pose that settles the joints of all its answers: none of them has A5 = 0."""
    answers = kr6.snap_to_range(turned(branches, limits.mean(axis=1), limits), limits)
    answered = np.asarray(~np.isnan(answers).any(axis=-1))
    some = answered.any(axis=1)
    settled = some & ~(answered & _singular(branches)).any(axis=1)
    return int(np.argmax(settled if settled.any() else some))


def _singular(branches: Floats) -> NDArray[np.bool_]:
    """Which branches have axes 4 and 6 in line, by the same measure as the arm's inverse."""
    return np.asarray(np.abs(np.sin(branches[..., 4])) < 2.0 * SINGULAR_SINE)


def _walk(
    target: Floats, branches: Floats, rows: Iterable[int], before: Floats, limits: Floats
) -> Floats:
    """Arm joints (n, S, 6) from each of the starts `before` (S, 6), row after row."""
    out = np.full((len(target), len(before), 6), np.nan)
    singular = np.asarray(_singular(branches).any(axis=1))
    pick = np.arange(len(before))
    for row in rows:
        answers = branches[row]
        if singular[row]:
            answers = np.stack([kr6.inverse(target[row], near) for near in before])
        answers = kr6.snap_to_range(turned(answers, before[:, None], limits), limits)
        step = np.abs(answers - before[:, None]).max(axis=-1)  # NaN where out of range
        step = np.where(np.isnan(step), np.inf, step)
        nearest = step.argmin(axis=-1)
        found = np.isfinite(step[pick, nearest])
        chosen = np.where(found[:, None], answers[pick, nearest], np.nan)
        before = np.where(found[:, None], chosen, before)
        out[row] = chosen
    return out


def _best_start(walked: Floats, limits: Floats) -> int:
    """Which of the starts of (n, S, 6) leads along the path best."""
    missing = np.isnan(walked[..., 0]).sum(axis=0)
    with np.errstate(invalid="ignore"):
        jumps = (np.abs(np.diff(walked, axis=0)).max(axis=-1) > JUMP_RAD).sum(axis=0)
    margin = np.fmin.reduce(margin_of(walked, limits), axis=0, initial=np.inf)
    return int(np.lexsort((-margin, jumps, missing))[0])
