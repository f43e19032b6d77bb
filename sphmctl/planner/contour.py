"""Contours: what the tool follows without a stop, by arc length; no joints and no time in it.

A contour is a chain of spans. Tangent, tool orientation and wrist run on smoothly from span to
span; where they would not, the contour ends and the arm stands. outline.py makes them from moves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sphmctl.motion import Floats
from sphmctl.pathfile import Move
from sphmctl.planner.shapes import Shape
from sphmctl.planner.spline import Track
from sphmctl.robots.geometry import angle_between

Indices: TypeAlias = NDArray[np.intp]

STEP_RAD = 0.05
"""Mean turn of tangent, tool or wrist within a piece from one row of a grid to the next; in the
middle of a corner twice that, 6 degrees: differences of fourth order err by 1e-5."""


LEAST_CELL_M = 1e-12
"""Between two joints; less is rounding."""


@dataclass(frozen=True)
class Span:
    """A piece of one shape, and the move that it belongs to.

    Attributes:
        begin_m: arc length of the shape at which the span begins.
        length_m: how far it goes.
        moves: the move; two for a corner, which belongs half to each.
        along_m: how far along the first move the span begins, and along the last it ends.
    """

    shape: Shape
    begin_m: float
    length_m: float
    moves: tuple[Move, ...]
    along_m: tuple[float, float]

    def place(self, s_m: float) -> tuple[Move, float]:
        """The move and the way along it at s from the span's begin, m."""
        if len(self.moves) == 1:
            return self.moves[0], self.along_m[0] + s_m
        half = self.length_m / 2.0
        if s_m < half:
            return self.moves[0], self.along_m[0] + (s_m / half) * self.cut_m
        return self.moves[1], self.along_m[1] * (s_m / half - 1.0)

    @property
    def cut_m(self) -> float:
        """For a corner: how far before the end of its first move it begins (and after, ends)."""
        return self.along_m[1]


@dataclass(frozen=True)
class WristGoal:
    """What the wrist is to do at arc lengths s (n,).

    Attributes:
        policy: "cranks", "fixed", "level", "tilt", "motion" or "auto".
        cranks_rad: (n, 3), for "cranks" and "fixed".
        heave_m: (n,), for "motion", and for "level" unless it is free.
        tilt_rad, direction_rad: (n,), for "motion"; directions may pass full turns.
    """

    policy: str
    cranks_rad: Floats | None = None
    heave_m: Floats | None = None
    tilt_rad: Floats | None = None
    direction_rad: Floats | None = None


@dataclass(frozen=True)
class Contour:
    """A chain of spans that is driven without a stop.

    Attributes:
        spans: at least one.
        policy: of the wrist, all along.
        wrist: its parameters, see `wrist_at`; None for policies without.
        still: the tool point stands: it turns on the spot, or the wrist moves alone; the arc length
            is nominal.
        marks: names of points and the arc length at which they are passed, or nearest, m.
        pins: arc lengths at which a move gives all nine joints, that move, and these (9,), rad.
    """

    spans: tuple[Span, ...]
    policy: str
    wrist: Track | None
    still: bool = False
    marks: tuple[tuple[str, float], ...] = ()
    pins: tuple[tuple[float, Move, Floats], ...] = ()

    @cached_property
    def edges_m(self) -> Floats:
        """Arc lengths at which spans meet, with both ends, (k + 1,); bend may jump there."""
        return np.concatenate([[0.0], np.cumsum([span.length_m for span in self.spans])])

    @property
    def length_m(self) -> float:
        """Arc length of the whole."""
        return float(self.edges_m[-1])

    @property
    def end(self) -> Floats:
        """Tool pose in the path's base at its end, (4, 4)."""
        return np.asarray(self.pose(np.array([self.length_m]))[0])

    @property
    def end_joints(self) -> Floats | None:
        """The nine joints that the path gives for its end."""
        at_end = [q for s, _, q in self.pins if s > self.length_m - LEAST_CELL_M]
        return at_end[-1] if at_end else None

    def pose(self, s_m: Floats) -> Floats:
        """Tool poses in the path's base (n, 4, 4) at arc lengths s (n,)."""
        return self._follow(s_m)[0]

    def tangent(self, s_m: Floats) -> Floats:
        """Unit tangents (n, 3) at arc lengths s (n,); 0 where the tool point stands."""
        return self._follow(s_m)[1]

    def place(self, s_m: float) -> tuple[int, float]:
        """Number of the move at s, and how far along that move, mm."""
        move, along = self.move_at(s_m)
        return move.number, float(1000.0 * along)

    def move_at(self, s_m: float) -> tuple[Move, float]:
        """The move at s, and how far along that move, m."""
        i = int(self._span_of(np.array([s_m]))[0])
        return self.spans[i].place(s_m - float(self.edges_m[i]))

    def speeds(self, s_m: Floats) -> tuple[Floats, Floats]:
        """Tool speed (m/s) and acceleration (m/s2) asked for at s (n,); lower in corners."""
        asked = [
            [
                min(move.speed.tcp_mm_s for move in span.moves) / 1000.0,
                min(move.speed.tcp_mm_s2 for move in span.moves) / 1000.0,
            ]
            for span in self.spans
        ]
        rows = np.array(asked)[self._span_of(s_m)]
        return rows[:, 0], rows[:, 1]

    def wrist_at(self, s_m: Floats, begin_cranks_rad: Floats | None = None) -> WristGoal:
        """What the wrist is to do at s (n,).

        Args:
            begin_cranks_rad: cranks (3,) at the contour's begin, from which "cranks" and "fixed"
                go on; None: those at its end, if the path gives them, else NaN.
        """
        if self.wrist is None:
            return WristGoal(self.policy)
        values = self.wrist.at(s_m)[0]
        if self.policy == "level":
            return WristGoal(self.policy, heave_m=values[:, 0])
        if self.policy == "motion":
            heave, tilt, direction = values.T
            return WristGoal(self.policy, None, heave, tilt, direction)
        if begin_cranks_rad is None:
            last = self.wrist.values[-1]
            begin_cranks_rad = last[:3] if last[3] == 0.0 else np.full(3, np.nan)
        return WristGoal(self.policy, values[:, :3] + values[:, 3:] * begin_cranks_rad)

    def grid(self, spacing_m: float) -> Floats:
        """Rising arc lengths (n,) from 0 to the length, with every joint of two pieces among them.

        At most `spacing_m` apart, and less where tangent, tool or wrist turn, see STEP_RAD.
        """
        joints = self.joints_m
        size = np.diff(joints)
        middle = joints[:-1] + size / 2.0
        steps = np.maximum(size / spacing_m, self._turn(joints, middle) / STEP_RAD)
        counts = np.maximum(np.ceil(steps - 1e-9), 1.0).astype(np.intp)
        cell = np.repeat(np.arange(len(size)), counts)
        first = np.cumsum(counts) - counts
        share = (np.arange(len(cell)) - first[cell]) / counts[cell]
        return np.concatenate([joints[cell] + share * size[cell], joints[-1:]])

    @cached_property
    def joints_m(self) -> Floats:
        """Arc lengths at which pieces meet: spans, points of splines, corners of polylines."""
        found = [np.zeros(1)]
        for span, edge in zip(self.spans, self.edges_m, strict=False):
            inner = span.shape.way.joints_m - span.begin_m
            inner = inner[(inner > 0.0) & (inner < span.length_m)]
            found += [edge + inner, np.array([edge + span.length_m])]
        joints = np.concatenate(found)
        joints[-1] = self.length_m
        # Where a span was cut close to a joint, rounding would leave a cell without length.
        keep = np.append(True, np.diff(joints) > LEAST_CELL_M)
        if not keep[-1]:
            keep[-2:] = False, True
        return np.asarray(joints[keep])

    def _turn(self, joints: Floats, middle: Floats) -> Floats:
        """The largest turn within each cell: of tangent, tool, wrist; rad, (cells,)."""
        points = np.append(np.stack([joints[:-1], middle], axis=1).ravel(), self.length_m)
        poses, t = self._follow(points)
        half_turns = angle_between(poses[:-1, :3, :3], poses[1:, :3, :3])
        bends = 2.0 * np.arcsin(np.clip(np.linalg.norm(np.diff(t, axis=0), axis=1) / 2.0, 0.0, 1.0))
        turns = np.maximum(bends[0::2] + bends[1::2], half_turns[0::2] + half_turns[1::2])
        if self.wrist is not None and self.policy != "level":
            ends, middles = self.wrist.at(joints)[0], self.wrist.at(middle)[0]
            moved = np.abs(middles - ends[:-1]) + np.abs(ends[1:] - middles)
            turns = np.maximum(turns, moved.max(axis=1))
        return np.asarray(turns)

    def _follow(self, s_m: Floats) -> tuple[Floats, Floats]:
        """Tool poses (n, 4, 4) and tangents (n, 3)."""
        poses, tangents = np.empty((len(s_m), 4, 4)), np.empty((len(s_m), 3))
        for span, rows, s in self._spread(s_m):
            poses[rows], tangents[rows] = span.shape.follow(s)
        return poses, tangents

    def _span_of(self, s_m: Floats) -> Indices:
        return np.asarray(
            np.clip(np.searchsorted(self.edges_m, s_m, "right") - 1, 0, len(self.spans) - 1)
        )

    def _spread(self, s_m: Floats) -> Iterator[tuple[Span, Indices, Floats]]:
        """For each span that is met: the rows in it, and their arc lengths in its shape."""
        index = self._span_of(s_m)
        order = np.argsort(index, kind="stable")
        met, begins = np.unique(index[order], return_index=True)
        for i, rows in zip(met, np.split(order, begins[1:]), strict=True):
            span = self.spans[i]
            inside = np.clip(s_m[rows] - self.edges_m[i], 0.0, span.length_m)
            yield span, rows, np.minimum(span.begin_m + inside, span.shape.length_m)
