"""The graph of arm branches and wrist poses along a path, and the cheapest way through it.

Layers are rows of the path some 20 mm apart. A layer's nodes are all answers of the arm, whole
turns included, for a grid of wrist poses of the policy's family; an edge joins two nodes between
which no joint jumps. Dynamic programming gives the global optimum over these nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sphmctl.errors import Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.planner.legs import Setup
from sphmctl.planner.policies import cost
from sphmctl.planner.policies.families import Family, Flags, Rows
from sphmctl.planner.policies.known import Task
from sphmctl.planner.policies.outcome import Reason
from sphmctl.robots import kr6, sphm
from sphmctl.robots.sphm.chain import join

STEP_RAD: Floats = np.array([0.5] * 6 + [0.65] * 3)
"""A joint that would move further between two layers has jumped: 30 degrees on 20 mm. The cranks
may go from one pose of the coarse grid to the next."""

COARSEST = (5, 3, 2, 6, 7, 8, 4, 0, 1)
"""The joints in the order in which they tell nodes apart: whole turns and branches first."""


@dataclass(frozen=True)
class Seed:
    """A way that is known to be continuous: joints (n, 9) for every row of the path."""

    joints: Floats


@dataclass(frozen=True)
class Ridge:
    """The cheapest way over the layers.

    Attributes:
        rows: of the path, (L,).
        values: the family's parameters, (L, d).
        joints: rad, (L, 9).
        pinned: which layers have to stay as they are, (L,).
    """

    rows: Rows
    values: Floats
    joints: Floats
    pinned: Flags


@dataclass(frozen=True)
class Layer:
    """Nodes of one row: joints (m, 9), parameters (m, d), and the seed (or -1) each is of, (m,)."""

    joints: Floats
    values: Floats
    seed: Rows

    def at(self, nodes: Rows) -> Layer:
        """Some of the nodes."""
        return Layer(self.joints[nodes], self.values[nodes], self.seed[nodes])


@dataclass
class Edges:
    """From nodes a of a layer to nodes b of the next one, each (e,), and what they cost."""

    a: Rows
    b: Rows
    price: Floats


def layer_rows(way_m: Floats, spacing_m: float) -> Rows:
    """The first and last row, and rows about `spacing_m` apart between."""
    count = max(1, int(np.ceil(way_m[-1] / spacing_m)))
    rows = np.searchsorted(way_m, np.linspace(0.0, way_m[-1], count + 1))
    rows[0], rows[-1] = 0, len(way_m) - 1
    return np.unique(rows)


def cheapest(
    task: Task, family: Family, rows: Rows, seeds: tuple[Seed, ...], dense: bool
) -> Ridge | Reason:
    """The cheapest way over the layers at `rows`, or why there is none."""
    way_m = task.way_m[rows]
    here = _layer(task, family, int(rows[0]), seeds, dense)
    near = cost.closeness(here.joints, task.setup.ranges)
    total, layers, came = near * cost.SHORTEST_M, [here], [np.zeros(0, dtype=np.int64)]
    for row, length in zip(rows[1:], np.diff(way_m), strict=True):
        if len(here.joints) == 0:
            break
        reached, here = layers[-1], _layer(task, family, int(row), seeds, dense)
        length = max(float(length), cost.SHORTEST_M)
        edges = _edges(reached, here, length, task.setup, family.through_rad)
        close = cost.closeness(here.joints, task.setup.ranges)
        edges.price += total[edges.a] + length * (near[edges.a] + close[edges.b]) / 2.0
        nodes, origin, total = _least(edges)
        if len(nodes) == 0:
            return _stuck(task, family, rows, [*layers, here])
        here, near = here.at(nodes), close[nodes]
        layers.append(here)
        came.append(origin)
    if len(here.joints) == 0:
        return _stuck(task, family, rows, layers)
    pick = [int(total.argmin())]
    for back in reversed(came[1:]):
        pick.append(int(back[pick[-1]]))
    chosen = list(zip(layers, reversed(pick), strict=True))
    return Ridge(
        rows,
        np.array([layer.values[node] for layer, node in chosen]),
        np.array([layer.joints[node] for layer, node in chosen]),
        np.isin(rows, _given(task)),
    )


def _given(task: Task) -> list[int]:
    """The rows whose joints are given."""
    ends = ((0, task.start), (len(task.target) - 1, task.end))
    return [row for row, joints in ends if joints is not None]


def _layer(task: Task, family: Family, row: int, seeds: tuple[Seed, ...], dense: bool) -> Layer:
    """All nodes of a row; the given joints alone where the row's are given."""
    for end, given in ((0, task.start), (len(task.target) - 1, task.end)):
        if row == end and given is not None:
            return Layer(given[None], family.values(given[6:])[None], np.full(1, -1))
    low, high = family.low[row], family.high[row]
    values = low + family.shares(dense) * (high - low)
    joints, index = _answers(task, family, row, values)
    known = np.array([seed.joints[row] for seed in seeds]).reshape(-1, 9)
    own = [family.values(q[6:]) for q in known]
    return Layer(
        np.vstack([joints, known]),
        np.vstack([values[index], *own]),
        np.append(np.full(len(joints), -1), np.arange(len(known))),
    )


def _answers(task: Task, family: Family, row: int, values: Floats) -> tuple[Floats, Rows]:
    """All joints (m, 9) within the ranges for parameters (k, d), and which k each is of."""
    setup = task.setup
    cranks = family.cranks(np.full(len(values), row), values)
    flange = sphm.flange_target(task.target[row], cranks, setup.tool, setup.mount_yaw)
    joints = join(kr6.inverse_in_range(flange, setup.ranges[:6]), cranks)
    index, answer = np.nonzero(~np.isnan(joints[..., 0]))
    return joints[index, answer], index


def _edges(before: Layer, here: Layer, length: float, setup: Setup, through_rad: float) -> Edges:
    """What the travel from nodes to nodes costs where no joint jumps.

    A seed may follow itself however far it goes: its way between has been looked at.
    """
    weights = cost.seconds_per_rad(setup)
    a, b = _near(before.joints, here.joints)
    swing = cost.swing(before.joints[a], here.joints[b], np.array(length), setup, through_rad)
    own = [
        (int(origin), int(node))
        for node in np.flatnonzero(here.seed >= 0)
        for origin in np.flatnonzero(before.seed == here.seed[node])
    ]
    extra = np.array(own, dtype=np.int64).reshape(-1, 2)
    a, b = np.append(a, extra[:, 0]), np.append(b, extra[:, 1])
    travel = np.square((here.joints[b] - before.joints[a]) * weights).sum(axis=-1) / length
    travel[: len(swing)] += swing
    possible = np.isfinite(travel)
    return Edges(a[possible], b[possible], travel[possible])


def _near(a: Floats, b: Floats) -> tuple[Rows, Rows]:
    """Between which of joints (m, 9) and (k, 9) no joint jumps: indices of a and of b."""
    first, *others = COARSEST
    order = np.argsort(a[:, first], kind="stable")
    sorted_a = a[order, first]
    begin = np.searchsorted(sorted_a, b[:, first] - STEP_RAD[first])
    count = np.searchsorted(sorted_a, b[:, first] + STEP_RAD[first], side="right") - begin
    high = np.repeat(np.arange(len(b)), count)
    low = order[np.arange(len(high)) + np.repeat(begin - (np.cumsum(count) - count), count)]
    for joint in others:
        kept = np.abs(a[low, joint] - b[high, joint]) <= STEP_RAD[joint]
        low, high = low[kept], high[kept]
    return low, high


def _least(edges: Edges) -> tuple[Rows, Rows, Floats]:
    """The nodes that are reached, where from, and at what price."""
    order = np.lexsort((edges.a, edges.price, edges.b))
    nodes, first = np.unique(edges.b[order], return_index=True)
    best = order[first]
    return nodes, edges.a[best], edges.price[best]


def _stuck(task: Task, family: Family, rows: Rows, layers: list[Layer]) -> Reason:
    """Why the last layer cannot be reached."""
    at = int(rows[len(layers) - 1])
    if len(layers[-1].joints) > 0:
        before = int(rows[len(layers) - 2])
        return _torn(before, layers[-2], layers[-1])
    reachable = int(rows[len(layers) - 2]) if len(layers) > 1 else -1
    while at - reachable > 1:
        middle = (at + reachable) // 2
        if has_answer(task, family, middle):
            reachable = middle
        else:
            at = middle
    return Reason(at, _unreachable(task, family, at))


def has_answer(task: Task, family: Family, row: int) -> bool:
    """Whether a row is reached at any wrist pose of the dense grid."""
    return len(_layer(task, family, row, (), dense=True).joints) > 0


def _torn(row: int, before: Layer, here: Layer) -> Reason:
    """The jump of the edge that comes nearest to being continuous."""
    steps = np.abs(before.joints[:, None] - here.joints)
    least = np.unravel_index((steps / STEP_RAD).max(axis=-1).argmin(), steps.shape[:2])
    joint = int((steps[least] / STEP_RAD).argmax())
    name, value = JOINT_NAMES[joint], float(np.degrees(steps[least][joint]))
    limit = float(np.degrees(STEP_RAD[joint]))
    message = (
        "no arm branch and wrist pose that was tried leads on from here: the smoothest would turn "
        f"{name} {value:.4g} degrees at once; lead the path round, or use ptp"
    )
    return Reason(row, Problem("", name, value, limit, message))


def _unreachable(task: Task, family: Family, row: int) -> Problem:
    """What keeps the wrist pose that misses by least from reaching a row."""
    setup = task.setup
    values = family.low[row] + family.shares(True) * (family.high[row] - family.low[row])
    found: list[tuple[bool, float, Problem]] = []
    for cranks in family.cranks(np.full(len(values), row), values):
        problem = sphm.why_not(task.target[row], cranks, setup.tool, setup.ranges, setup.mount_yaw)
        if problem is not None and problem.value is not None and problem.limit is not None:
            found.append((problem.joint == "", abs(problem.value - problem.limit), problem))
    closed = Problem("", "theta7", None, None, "the wrist does not close at any allowed pose")
    if not found:
        return closed
    nearest = min(found, key=lambda miss: miss[:2])[2]
    message = f"{nearest.message}: so at the wrist pose, of all allowed ones, that misses by least"
    return replace(nearest, message=message)
