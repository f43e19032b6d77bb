"""The quickest time law along a path, laid over the same blocks; what a continuous drive would do.

The controller of the arm stops at every knot, which takes longer: its own time is the blocks'.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.blocks import Block, shares_of
from sphmctl.planner.chord import Leg
from sphmctl.planner.legs import Direct
from sphmctl.planner.places import joint_problem
from sphmctl.planner.ruling import REST, Shares, shares
from sphmctl.planner.timelaw import LABELS, Bounds, Stuck, TimeLaw, time_law
from sphmctl.planner.timing import Slice
from sphmctl.planner.way import TINY_M, Way

DIRECT_ROWS = 65
"""Rows of a straight line of joint space: even steps."""


@dataclass(frozen=True)
class Ideal:
    """Blocks with the quickest law.

    Attributes:
        blocks: one for each that was given.
        laws: of each stretch between two rests, or changes of the limits.
        optimal_s: how long the path would take without jerk limit, rests included.
    """

    blocks: list[Block]
    laws: tuple[TimeLaw, ...]
    optimal_s: float

    def summary(self) -> str:
        """`12.31 s (12.21 s without jerk limit); A2 acceleration binds 41 % of the time, ...`."""
        duration_s = sum(block.duration_s for block in self.blocks)
        texts = [f"{label} {share:.0%}" for label, share in self.shares() if share >= 0.005]
        head = f"{duration_s:.2f} s ({self.optimal_s:.2f} s without jerk limit)"
        return f"{head}; of the time binds: {', '.join(texts)}" if texts else head

    def shares(self) -> Shares:
        """How much of the time each of LABELS binds, and REST is asked for; the most first."""
        rests_s = sum(block.rest_s for block in self.blocks)
        moving = [
            (label, share * law.duration_s) for law in self.laws for label, share in law.shares()
        ]
        return shares([(REST, rests_s), *moving])

    def binding(self, t: Floats) -> tuple[str, ...]:
        """What binds at each plan time (n,): one of LABELS, or REST."""
        names = (*LABELS, REST)
        found = np.full(len(t), len(LABELS))
        begin_s, begins = 0.0, []
        laws: list[TimeLaw | None] = []
        for block in self.blocks:
            # Blocks of one law follow each other: one time runs through all of them.
            law = block.law.law if isinstance(block.law, Slice) else None
            if not laws or law is None or law is not laws[-1]:
                begins.append(begin_s)
                laws.append(law)
            begin_s += block.duration_s
        index = np.searchsorted(begins, t, "right") - 1
        for i, law in enumerate(laws):
            if law is None:
                continue
            rows = np.flatnonzero(index == i)
            rows_s = law.track.s[law.track.rows]
            nearest = np.searchsorted(rows_s, law.s(t[rows] - begins[i]))
            found[rows] = law.binding[np.minimum(nearest, len(law.binding) - 1)]
        return tuple(names[label] for label in found)


def ideal(blocks: list[Block], scale: float, filter_s: float) -> Ideal | Problem:
    """The blocks with the quickest law in place of the controller's.

    Args:
        scale: share of the path's own speed.
        filter_s: length of the filter that bounds the jerk; 0 for none.
    """
    found: list[Block] = []
    laws: list[TimeLaw] = []
    optimal_s = 0.0
    for part in _parts(blocks):
        if part[0].leg is None:
            found += part
            optimal_s += part[0].duration_s
            continue
        strip = _Strip.of(list(_legs(part)))
        law = strip.solve(filter_s)
        if isinstance(law, Problem):
            return law
        law = law.slowed(1.0 / scale)
        laws.append(law)
        optimal_s += law.optimal_s
        found += strip.lay(part, law)
    return Ideal(found, tuple(laws), optimal_s)


def _parts(blocks: list[Block]) -> Iterator[list[Block]]:
    """Runs of blocks under one law: ways one after the other; a direct leg or a rest by itself."""

    def kind(item: tuple[int, Block]) -> int:
        index, block = item
        leg = block.leg
        return -1 if isinstance(leg, Way) and leg.length_m > 0.0 else id(leg) if leg else index

    for _, run in groupby(enumerate(blocks), key=kind):
        yield [block for _, block in run]


def _legs(blocks: list[Block]) -> Iterator[Leg]:
    for _, run in groupby(blocks, key=lambda block: id(block.leg)):
        leg = next(run).leg
        assert leg is not None  # rests are parts of their own
        yield leg


@dataclass(frozen=True)
class _Strip:
    """The rows of some legs, one after the other.

    Attributes:
        begins: where each leg begins along `s`.
        rows: joints (n, 9) at s (n,), tool points (n, 3).
    """

    legs: list[Leg]
    begins: list[float]
    s: Floats
    joints: Floats
    tool: Floats
    bounds: Bounds
    edges: list[int]
    stops: list[int]

    @staticmethod
    def of(legs: list[Leg]) -> _Strip:
        setup = legs[0].setup
        speeds, accelerations = setup.speeds, setup.accelerations
        if legs[0].length_m == 0.0:
            move = legs[0].move_at(0.0)
            speeds, accelerations = shares_of(move.speed, speeds, accelerations)
        begins, stops, edges, asked = [0.0], [], [], []
        s: list[Floats] = [np.zeros(1)]
        joints: list[Floats] = []
        tool: list[Floats] = []
        count = 0
        for leg in legs:
            if isinstance(leg, Direct):
                rows = np.linspace(0.0, 1.0, DIRECT_ROWS)
                q, pose = leg.at(rows)
            else:
                rows, q, pose = leg.s, leg.joints, leg.pose
                inner = np.searchsorted(rows, leg.kinks - TINY_M)
                edges += [count + int(row) for row in inner if 0 < row < len(rows) - 1]
                if leg.length_m > 0.0:
                    asked.append(np.stack(leg.asked))
            first = 0 if not joints else 1
            if first:
                stops.append(count)
            joints.append(q[first:])
            tool.append(pose[first:, :3, 3])
            s.append(begins[-1] + rows[1:])
            begins.append(begins[-1] + float(rows[-1]))
            count += len(rows) - 1
        limits = np.hstack(asked) if asked else (np.inf, np.inf)
        bounds = Bounds(speeds, accelerations, limits[0], limits[1])
        along, q, points = (np.concatenate(part) for part in (s, joints, tool))
        return _Strip(legs, begins[:-1], along, q, points, bounds, edges, stops)

    def solve(self, filter_s: float) -> TimeLaw | Problem:
        law = time_law(
            self.joints, self.s, self.tool, self.bounds, self.edges, self.stops, filter_s
        )
        if isinstance(law, TimeLaw):
            return law
        return self._stuck(law)

    def _stuck(self, stuck: Stuck) -> Problem:
        at = float(self.s[stuck.row])
        number = max(i for i, begin in enumerate(self.begins) if begin <= at)
        leg = self.legs[number]
        span = float(leg.s[-1]) if isinstance(leg, Way) else 1.0
        where = leg.where((at - self.begins[number]) / span)
        if stuck.joint in JOINT_NAMES:
            joint = JOINT_NAMES.index(stuck.joint)
            return joint_problem(where, joint, np.inf, stuck.limit, stuck.kind)
        message = f"the tool has to move there, and its {stuck.kind} is 0"
        return Problem(where, "tool", None, stuck.limit, message)

    def lay(self, blocks: list[Block], law: TimeLaw) -> list[Block]:
        """The blocks with slices of the law."""
        begins = {id(leg): begin for leg, begin in zip(self.legs, self.begins, strict=True)}
        edges = []
        for block in blocks:
            leg = block.leg
            span = float(leg.s[-1]) if isinstance(leg, Way) else 1.0
            edges.append([begins[id(leg)] + u * span for u in block.u])
        s = np.array(edges)
        t = law.t(s[:, 1])
        t[-1] = law.duration_s
        begin_t = np.append(0.0, t[:-1])
        return [
            replace(block, law=Slice(law, (float(a), float(b)), (float(before), float(after))))
            for block, (a, b), before, after in zip(blocks, s, begin_t, t, strict=True)
        ]
