"""Ways: contours with all nine joints, by share u of the way (0 to 1); no time in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import Floats
from sphmctl.pathfile import Move
from sphmctl.planner.contour import Contour, Span, WristGoal
from sphmctl.planner.legs import NO_RANGES, Setup
from sphmctl.planner.places import place
from sphmctl.planner.policies import Auto, Cranks, Level, Motion, Policy, Tilt, Unresolved
from sphmctl.planner.redundancy import resolve
from sphmctl.planner.shapes import Shape, Spot
from sphmctl.planner.spline import Track
from sphmctl.planner.turning import Between
from sphmctl.robots import rrs, sphm
from sphmctl.robots.sphm.wrist_grid import heave_range

POINTS = 720
"""Steps on a way, at least, at whose ends it is examined. Knots stand there too: 2, 3, 4, 5, 6, 8,
9 and 10 divide them."""

SPACING_M = 0.0005
"""Distance between the points on long ways."""

TINY_M = 1e-9
"""Arc lengths that differ less are one: rounding."""

SAME_RAD = 1e-9
"""Cranks that differ less are the same: rounding."""

SPOT_M_RAD = 0.1
"""Nominal length of a wrist's motion on the spot, per radian."""

HEAVES = 9
"""From the lowest to the highest, 5 mm apart: begins to which the wrist is led where the heave at
which it stands leads nowhere."""


@dataclass(frozen=True)
class Way:
    """A contour that the robot can follow, at rows that begin at 0 and end at its length.

    Attributes:
        s: arc lengths of the rows, m, (n,).
        joints: rad, (n, 9).
        pose: tool in the base, m, (n, 4, 4).
        begin_cranks: cranks (3,) from which the path's own go on.
    """

    setup: Setup
    contour: Contour
    s: Floats
    joints: Floats
    pose: Floats
    begin_cranks: Floats

    @property
    def length_m(self) -> float:
        """How far the tool point goes."""
        return 0.0 if self.contour.still else self.contour.length_m

    @cached_property
    def u(self) -> Floats:
        """Shares of the way, (n,)."""
        return np.asarray(self.s / self.s[-1])

    @cached_property
    def straight(self) -> bool:
        """Whether the rows stand at equal steps of one piece."""
        return len(self.contour.edges_m) == 2 and bool(np.ptp(np.diff(self.s)) < 1e-9)

    @property
    def marks(self) -> tuple[tuple[str, int], ...]:
        """Names of points and the rows nearest to them."""
        return tuple(
            (name, int(np.abs(self.s - s).argmin())) for name, s in self.contour.marks if name
        )

    @property
    def kinks(self) -> Floats:
        """Arc lengths at which second derivatives may jump, (k,)."""
        wrist = self.contour.wrist
        return (
            self.contour.edges_m if wrist is None else np.union1d(self.contour.edges_m, wrist.s_m)
        )

    @cached_property
    def tangents(self) -> Floats:
        """Unit tangents of the rows, (n, 3)."""
        return self.contour.tangent(self.s)

    @cached_property
    def bends(self) -> Floats:
        """How sharply the tool's way turns from row to row, 1/m, (n - 1,)."""
        turn = np.linalg.norm(np.diff(self.tangents, axis=0), axis=1)
        return np.asarray(turn / np.diff(self.s))

    @cached_property
    def asked(self) -> tuple[Floats, Floats]:
        """Tool speed (m/s) and acceleration (m/s2) asked for between the rows, each (n - 1,)."""
        return self.contour.speeds((self.s[1:] + self.s[:-1]) / 2.0)

    @cached_property
    def on_flange(self) -> Floats:
        """The tool's pose on the flange at the rows, (n, 4, 4)."""
        return self.setup.on_flange(self.joints[:, 6:])

    def at(self, u: Floats) -> tuple[Floats, Floats]:
        """Joints (n, 9) and tool poses (n, 4, 4) at any u (n,): exact, on the way's branch."""
        s = u * self.s[-1]
        near = np.stack([np.interp(s, self.s, column) for column in self.joints.T], axis=1)
        cranks = _cranks(self.contour.wrist_at(s, self.begin_cranks), self.setup)
        if cranks is None:
            smooth = _smooth(s, self.s, self.joints[:, 6:])
            cranks = np.clip(smooth, *self.setup.ranges[6:].T)  # beside an end it overshoots
        pose, setup = self.contour.pose(s), self.setup
        joints = sphm.inverse_best(
            setup.base @ pose, cranks, setup.tool, near, NO_RANGES, setup.mount_yaw
        )
        return joints, pose

    def move_at(self, u: float) -> Move:
        """The move that draws it there."""
        return self.contour.move_at(u * float(self.s[-1]))[0]

    def where(self, u: float) -> str:
        """The place at u in words."""
        return where(self.contour, u * float(self.s[-1]))


@dataclass(frozen=True)
class NoWay:
    """Why a contour cannot be followed."""

    problems: tuple[Problem, ...]


def where(contour: Contour, s: float) -> str:
    """The place at an arc length in words."""
    move, along = contour.move_at(s)
    return move.where if contour.still else place(move, 1.0, along) if along else move.where


def lay(
    contour: Contour,
    setup: Setup,
    begin: Floats | None,
    end: Floats | None = None,
    finer: int = 1,
    policy: Policy | None = None,
) -> Way | NoWay:
    """Follow a contour with all nine joints.

    Args:
        begin: joints (9,) at its begin; None lets them be chosen.
        end: joints (9,) that it has to arrive with, where its wrist policy leaves a choice.
        finer: rows to each one that a way usually has.
        policy: of the wrist, instead of the contour's.
    """
    s = contour.grid(min(SPACING_M, contour.length_m / POINTS) / finer)
    pose = contour.pose(s)
    goal = contour.wrist_at(s, None if begin is None else begin[6:])
    if goal.cranks_rad is not None and np.isnan(goal.cranks_rad).any():
        return NoWay(())  # the cranks are not known: a move before has been refused
    target = setup.base @ pose
    outcome = resolve(target, s, policy or _policy(goal), setup, begin, end)
    if isinstance(outcome, Unresolved):
        told = [
            replace(reason.problem, where=where(contour, float(s[reason.row])))
            for reason in outcome.reasons
        ]
        return NoWay(tuple(told))
    return Way(setup, contour, s, outcome.joints, pose, outcome.joints[0, 6:])


def relocation(contour: Contour, setup: Setup, begin: Floats) -> Contour | None:
    """The wrist's motion on the spot that must come before a contour; None when it stands right.

    Args:
        begin: joints (9,) before it.
    """
    cranks = _cranks(contour.wrist_at(np.zeros(1), begin[6:]), setup)
    if cranks is None or not np.abs(cranks[0] - begin[6:]).max() >= SAME_RAD:
        return None  # where the wrist cannot stand so, the contour's own refusal says why
    values = np.column_stack([np.stack([begin[6:], cranks[0]]), np.zeros(2)])
    return _on_the_spot(contour, "cranks", values, begin[6:], cranks[0])


def held(contour: Contour, setup: Setup, begin: Floats) -> Iterator[tuple[Contour | None, Policy]]:
    """For a free heave: one that is kept all along, and what leads to it on the spot before.

    The heave as it is comes first, then others, the nearest first.

    Args:
        begin: joints (9,) before it.
    """
    if contour.policy not in ("level", "tilt") or contour.wrist is not None:
        return
    direction, tilt, now = rrs.tilt_of(rrs.forward(begin[6:]))
    then = 0.0 if contour.policy == "level" else tilt
    low, high = heave_range(direction, then, setup.ranges[6:])
    others = np.linspace(low, high, HEAVES)
    others = others[np.argsort(np.abs(others - now))]
    for heave in [np.clip(now, low, high), *others]:
        cranks = np.clip(rrs.inverse(direction, then, heave), *setup.ranges[6:].T)
        values = np.array([[now, tilt, direction], [heave, then, direction]])
        stays = np.abs(cranks - begin[6:]).max() < SAME_RAD
        spot = None if stays else _on_the_spot(contour, "motion", values, begin[6:], cranks)
        yield spot, Level(heave) if contour.policy == "level" else Tilt(None, heave)


def _on_the_spot(
    contour: Contour, policy: str, values: Floats, begin: Floats, end: Floats
) -> Contour:
    """The wrist from cranks (3,) to (3,) while the tool stands at a contour's begin.

    Args:
        values: the policy's parameters at begin and end, (2, d).
    """
    move, along = contour.move_at(0.0)
    length = SPOT_M_RAD * float(np.abs(end - begin).max())
    pose = contour.pose(np.zeros(1))[0]
    R = pose[:3, :3]
    shape = Shape(Spot(pose[:3, 3], length), Between(R, R, length))
    span = Span(shape, 0.0, length, (move,), (along, along))
    track = Track.monotone(np.array([0.0, length]), values)
    return Contour((span,), policy, track, True)


def _policy(goal: WristGoal) -> Policy:
    match goal.policy:
        case "level":
            return Level(goal.heave_m)
        case "tilt":
            return Tilt()
        case "auto":
            return Auto()
    if goal.cranks_rad is not None:
        return Cranks(goal.cranks_rad)
    assert goal.heave_m is not None  # "motion" has all three
    assert goal.tilt_rad is not None
    assert goal.direction_rad is not None
    return Motion(goal.heave_m, goal.tilt_rad, goal.direction_rad)


def _cranks(goal: WristGoal, setup: Setup) -> Floats | None:
    """Crank angles (n, 3) that a goal names; None where they are chosen."""
    if goal.cranks_rad is not None:
        return goal.cranks_rad
    if goal.heave_m is None:
        return None
    level = np.zeros(len(goal.heave_m))
    direction = level if goal.direction_rad is None else goal.direction_rad
    tilt = level if goal.tilt_rad is None else goal.tilt_rad
    cranks = rrs.inverse(direction, tilt, goal.heave_m)
    return np.asarray(np.clip(cranks, *setup.ranges[6:].T))


def _smooth(s: Floats, rows: Floats, values: Floats) -> Floats:
    """Values (m, 3) at s (m,) between rows (n,) of values (n, 3): cubic, with their slopes."""
    if len(rows) < 3:
        return np.stack([np.interp(s, rows, column) for column in values.T], axis=1)
    slopes = np.gradient(values, rows, axis=0, edge_order=2)
    i = np.clip(np.searchsorted(rows, s, "right") - 1, 0, len(rows) - 2)
    step = (rows[i + 1] - rows[i])[:, None]
    x = (s - rows[i])[:, None] / step
    left, right = values[i], values[i + 1]
    swing = slopes[i] * step, slopes[i + 1] * step
    change = right - left
    curve = (1.0 - x) * (swing[0] - change) - x * (swing[1] - change)
    return np.asarray(left + x * change + x * (1.0 - x) * curve)
