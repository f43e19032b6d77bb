"""What `auto` looks for at a choice of cranks, and the way up from a first choice, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.geometry import TURN, invert
from sphmctl.robots.kr6_model import (
    FOREARM_ANGLE_RAD,
    FOREARM_LENGTH_M,
    RANGE_TOLERANCE_RAD,
    UPPER_ARM_M,
)
from sphmctl.robots.sphm.chain import platform_in_flange, turned
from sphmctl.robots.sphm.minimax import best_steps
from sphmctl.robots.sphm.slopes import joint_slopes

Rows = NDArray[np.intp]

# Beyond a limit the value is the margin, negative, less this: far below any other, and yet a slope
# to climb back on. No margin and no distance reaches it (rad).
BEYOND_RAD = 100.0
GROW = 1.5  # the box of steps, where the last one went to its side
# The way to the edge of the reach ends before it: steps may use this share of what is left, and
# what goes beyond counts as a loss of so much margin (rad/m).
REACH_SHARE, REACH_WEIGHT = 0.9, 1000.0
REACH_LEFT_M = 2e-5
# A start that is after so many steps so far (rad) below its pose's best is given up.
GIVE_UP = {2: 0.2, 3: 0.1, 6: 0.02, 10: 0.005}


@dataclass(frozen=True)
class Pace:
    """How carefully to climb.

    Attributes:
        first_rad, last_rad: the box of steps at the start, and where it ends.
        shrink: what the box shrinks by where the slopes mislead.
        least_gain_rad: what gains less is the top.
        steps: at most.
    """

    first_rad: float
    last_rad: float
    shrink: float
    least_gain_rad: float
    steps: int


FAST = Pace(0.35, 5e-3, 0.35, 1e-5, 12)  # from 20 to 0.3 degrees
FINE = Pace(0.05, 2e-4, 0.5, 0.0, 40)  # from 3 to 0.01 degrees


@dataclass(frozen=True)
class Field:
    """The poses that are searched, and what a choice of cranks is worth there.

    Attributes:
        T: tool poses, (n, 4, 4).
        tool: the tool's frame on the platform, (4, 4).
        near: joints to stay near to, (n, 9), or None.
        limits: (9, 2).
        mount_yaw: see `platform_in_flange`.
    """

    T: Floats
    tool: Floats
    near: Floats | None
    limits: Floats
    mount_yaw: float

    def beyond(self, cranks: Floats) -> Floats:
        """What to put behind a tool pose to get the flange's, (m, 4, 4), at cranks (m, 3)."""
        return invert(platform_in_flange(cranks, self.mount_yaw) @ self.tool)

    def branches(self, rows: Rows, cranks: Floats, beyond: Floats) -> tuple[Floats, Floats]:
        """The arm's branches (m, 8, 6) of poses `rows` (m,), and what each is worth, (m, 8).

        Of whole turns the one that `auto` means; -inf where the arm does not reach.
        """
        low, high = self.limits[:6].T
        flange = self.T[rows] @ beyond
        if self.near is None:
            middle = 0.5 * (low + high)
            q = kr6.inverse(flange) - middle
            q -= TURN * np.round(q / TURN)
            margin = _least(0.5 * (high - low) - np.abs(q))
            q += middle
        else:
            hint = self.near[rows, :6]
            q = turned(kr6.inverse(flange, hint), hint[:, None], self.limits[:6])
            margin = _least(np.minimum(q - low, high - q))
        margin = np.minimum(margin, self._crank_margin(cranks)[:, None])
        value = margin
        if self.near is not None:
            off, off_cranks = q - self.near[rows, None, :6], cranks - self.near[rows, 6:]
            squares = (off * off).sum(axis=-1) + (off_cranks * off_cranks).sum(axis=-1)[:, None]
            value = margin - np.sqrt(squares / 9.0)
        value = np.where(margin >= -RANGE_TOLERANCE_RAD, value, margin - BEYOND_RAD)
        return q, np.nan_to_num(value, nan=-np.inf)

    def best(self, rows: Rows, cranks: Floats) -> tuple[Floats, Floats]:
        """The joints (m, 9) of the best branch, and what they are worth, (m,)."""
        q, value = self.branches(rows, cranks, self.beyond(cranks))
        pick, each = value.argmax(axis=1), np.arange(len(rows))
        return np.concatenate([q[each, pick], cranks], axis=1), value[each, pick]

    def _crank_margin(self, cranks: Floats) -> Floats:
        low, high = self.limits[6:].T
        return np.asarray(np.minimum(cranks - low, high - cranks).min(axis=-1))


@dataclass
class _Slopes:
    """The field's functions at the starts' joints, made linear; the last is that of the reach."""

    values: Floats  # (19, m)
    slopes: Floats  # (19, 3, m)
    tilt: Floats | None  # (3, m)

    @staticmethod
    def empty(count: int, near: bool) -> _Slopes:
        slopes = np.zeros((19, 3, count))
        slopes[6:9], slopes[15:18] = np.eye(3)[:, :, None], -np.eye(3)[:, :, None]
        return _Slopes(np.zeros((19, count)), slopes, np.zeros((3, count)) if near else None)

    def update(self, at: Rows, field: Field, rows: Rows, joints: Floats, value: Floats) -> None:
        """Take those of the starts `at` anew; the others are those of all starts."""
        q = np.ascontiguousarray(joints[at].T)
        low, high = field.limits.T[:, :, None]
        arm, reach = joint_slopes(q, field.mount_yaw)
        self.slopes[:6, :, at], self.slopes[9:15, :, at] = arm, -arm
        margins = np.concatenate([q - low, high - q])
        bend = np.cos(q[2] - FOREARM_ANGLE_RAD)
        both = 2.0 * UPPER_ARM_M * FOREARM_LENGTH_M
        distance = np.sqrt(UPPER_ARM_M**2 + FOREARM_LENGTH_M**2 + both * bend)
        left = REACH_SHARE * (UPPER_ARM_M + FOREARM_LENGTH_M - distance - REACH_LEFT_M)
        self.values[:18, at] = margins
        self.values[18, at] = margins.min(axis=0) + REACH_WEIGHT * left
        self.slopes[18, :, at] = -REACH_WEIGHT * reach.T
        if self.tilt is not None and field.near is not None:
            off = q - field.near[rows[at]].T
            distance = np.maximum(np.sqrt((off * off).mean(axis=0)), RANGE_TOLERANCE_RAD)
            tilt = -(off[:, None] * self.slopes[:9, :, at]).sum(axis=0) / (9.0 * distance)
            self.tilt[:, at] = np.where(value[at] < -BEYOND_RAD / 2.0, 0.0, tilt)

    def steps(self, at: Rows, low: Floats, high: Floats) -> Floats:
        """The best steps (3, k) of the starts `at` within a box."""
        tilt = None if self.tilt is None else self.tilt[:, at]
        return best_steps(self.values[:, at], self.slopes[:, :, at], low, high, tilt)


def climb(
    field: Field, rows: Rows, joints: Floats, value: Floats, pace: Pace
) -> tuple[Floats, Floats]:
    """From joints (m, 9) of poses `rows` (m,) to the top of each one's hill: joints and value.

    Steps to the best point of the functions made linear, in a box that shrinks where they mislead.
    """
    joints, value = joints.copy(), value.copy()
    low, high = field.limits[6:].T[:, :, None]
    box, live = np.full(len(rows), pace.first_rad), np.arange(len(rows))
    slopes, moved = _Slopes.empty(len(rows), field.near is not None), live
    for count in range(pace.steps):
        live, moved = _still(count, live, rows, value), _still(count, moved, rows, value)
        if not len(live):
            break
        if len(moved):
            slopes.update(moved, field, rows, joints, value)
        here = joints[live, 6:].T
        least, most = np.maximum(-box[live], low - here), np.minimum(box[live], high - here)
        step = slopes.steps(live, np.minimum(least, 0.0), np.maximum(most, 0.0))
        tried, found = field.best(rows[live], np.clip(here + step, low, high).T)
        with np.errstate(invalid="ignore"):
            gain = found - value[live]
        better = gain > 0.0
        joints[live[better]], value[live[better]] = tried[better], found[better]
        length = np.abs(step).max(axis=0)
        wider = np.where(length > 0.99 * box[live], GROW, 1.0) * box[live]
        box[live] = np.where(better, wider, pace.shrink * np.minimum(box[live], length))
        going = (box[live] > pace.last_rad) & ~(better & (gain < pace.least_gain_rad))
        moved, live = live[better & going], live[going]
    return joints, value


def _still(count: int, starts: Rows, rows: Rows, value: Floats) -> Rows:
    """The starts that are not given up after so many steps."""
    if count not in GIVE_UP or not len(starts):
        return starts
    best = np.full(int(rows.max()) + 1, -np.inf)
    np.maximum.at(best, rows, value)
    return starts[value[starts] > best[rows[starts]] - GIVE_UP[count]]


def _least(x: Floats) -> Floats:
    """The smallest along the last, short axis, which numpy's own `min` takes five times as long."""
    out = np.minimum(x[..., 0], x[..., 1])
    for i in range(2, x.shape[-1]):
        np.minimum(out, x[..., i], out=out)
    return np.asarray(out)
