"""Walks through a path's moves: the nine joints at each point, and the blocks between them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, groupby

import numpy as np

from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move, Path, Point
from sphmctl.planner.blocks import Draft, add_direct, add_rest, add_way
from sphmctl.planner.contour import Contour
from sphmctl.planner.legs import Direct, Setup
from sphmctl.planner.outline import contours
from sphmctl.planner.places import range_problems
from sphmctl.planner.policies import Policy
from sphmctl.planner.redundancy import impossible, leaning
from sphmctl.planner.way import NoWay, Way, held, lay, relocation
from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.geometry import pose_matrix
from sphmctl.robots.sphm.wrist_grid import heave_range

HOME: Floats = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0, 60.0, 60.0, 60.0])
"""Where a start given as a pose takes its branch from: elbow up, hand not turned over."""

STARTS = 6
"""Branches of the start that are tried before a path is refused."""

ARRIVAL_RAD = 1e-6
"""How close a line to `joints_deg` must come to these joints; more is another branch or turn."""


SLOWER = 1.02
"""So much longer may a way take than with the heave kept, for the arm to move less."""


@dataclass(frozen=True)
class Step:
    """A contour, the name of the point at its end, and the wrist's policy if it is another one."""

    contour: Contour
    name: str
    policy: Policy | None = None


@dataclass
class Walker:
    """Where the walk has come to.

    Attributes:
        joints: (9,), or None after a move that could not be resolved.
        pose: tool in the base, (4, 4), or None.
        near: the last joints known, to choose branches by.
        finer: rows to each one that a way usually has.
        start: joints (9,) of the start.
        name: of the point it stands on; "" for none.
        policy: of the wrist in the move that led there.
    """

    path: Path
    setup: Setup
    scale: float
    finer: int = 1
    draft: Draft = field(default_factory=Draft)
    joints: Floats | None = None
    pose: Floats | None = None
    near: Floats = field(default_factory=HOME.copy)
    start: Floats | None = None
    name: str = ""
    policy: str = ""

    def go(self, begin: Floats | None) -> None:
        """Walk the whole path from a start (9,), or from none where there is no answer."""
        first, *moves = self.path.moves
        assert first.point is not None  # a path begins with a ptp
        pose, _ = self._target(first, first.point)
        self.start = begin
        self._arrive(first.point.name, begin, pose)
        self.policy = first.wrist.policy
        for draws, run in groupby(moves, key=lambda move: move.draws):
            if draws:
                self._draw(tuple(run))
                continue
            for move in run:
                self._move(move)

    def _move(self, move: Move) -> None:
        if move.point is None:
            add_rest(self.draft, move, self.scale)
            return
        pose, joints = self._target(move, move.point)
        if joints is not None and self.joints is not None:
            add_direct(self.draft, Direct(self.setup, move, self.joints, joints), self.scale)
        self._arrive(move.point.name, joints, pose)
        self.policy = move.wrist.policy

    def _draw(self, run: tuple[Move, ...]) -> None:
        """Follow consecutive moves along a path of the tool."""
        assert self.pose is not None  # a path begins with a ptp
        cranks = None if self.joints is None else self.joints[6:]
        try:
            found = contours(self.path.file, run, self.pose, self.setup.tool_pose, cranks)
        except InfeasibleError as problem:
            self.draft.problems += problem.problems
            self._arrive("", None, self.pose)
            return
        for contour in found:
            self._follow(contour)
        self.policy = run[-1].wrist.policy

    def _follow(self, contour: Contour) -> None:
        """Follow one contour, the wrist led to where it has to begin first."""
        name = contour.marks[-1][0] if contour.marks else ""
        ways = self._ways(contour, name)
        draft, joints = self._driven(next(ways))
        reason = draft.refusals[0].message if draft.refusals else ""
        for tried, steps in enumerate(ways):
            other, arrived = self._driven(steps)
            if _duration_s(draft) > SLOWER * _duration_s(other):
                draft, joints = other, arrived
            if not draft.refusals:
                if tried > 0:
                    told = (
                        f"{_title(steps[-1], self.name)}: the wrist goes to another heave first; "
                    )
                    draft.notes.append(f"{told}from where it is {reason}")
                break
        self.draft.extend(draft)
        self._arrive(name, joints, contour.end)

    def _ways(self, contour: Contour, name: str) -> Iterator[tuple[Step, ...]]:
        """What is tried, one after the other, to follow a contour; at least one.

        Where a heave is free: the best heaves from the present one on; the present one kept, which
        is the better way if it takes less time; then others kept, after a motion on the spot.
        """
        whole = Step(contour, name)
        if self.joints is None:
            yield (whole,)
            return
        heaves = held(contour, self.setup, self.joints)
        first = next(heaves, None)
        if first is None:
            yield _steps(relocation(contour, self.setup, self.joints), whole)
            return
        yield _steps(first[0], whole)
        for spot, policy in chain([first], heaves):
            yield _steps(spot, replace(whole, policy=policy))

    def _driven(self, steps: tuple[Step, ...]) -> tuple[Draft, Floats | None]:
        """What steps, one after the other, make of it; and the joints (9,) in the end."""
        draft, joints, here = Draft(), self.joints, self.name
        for step in steps:
            contour = step.contour
            way = lay(
                contour, self.setup, joints, contour.end_joints, self.finer, policy=step.policy
            )
            if isinstance(way, NoWay):
                draft.problems += way.problems
                return draft, None
            add_way(draft, way, _title(step, here), self.scale)
            draft.problems += _missed(way)
            joints, here = way.joints[-1], step.name
        return draft, joints

    def _target(self, move: Move, point: Point) -> tuple[Floats, Floats | None]:
        """The tool pose in the base, and the joints nearest to where we are, of a move's point."""
        if point.joints_deg is not None:
            joints = np.radians(point.joints_deg)
            problems = range_problems(move.where, joints, self.setup.ranges)
            self.draft.problems += problems
            return self.setup.tool_pose(joints), None if problems else joints
        pose = _pose(point)
        answers = self.answers(move, point, pose)
        return pose, answers[0] if len(answers) else None

    def answers(self, move: Move, point: Point, pose: Floats) -> Floats:
        """All joints (k, 9) for a pose point, nearest first; none, with the reason in the draft."""
        world = self.setup.base @ pose
        tool, ranges, yaw = self.setup.tool, self.setup.ranges, self.setup.mount_yaw
        if move.wrist.policy == "auto":
            found = sphm.auto(world, tool, self.near, ranges, yaw)
            cranks = None if np.isnan(found).any() else found[6:]
        else:
            posed = self._cranks(move, point, world)
            if isinstance(posed, Problem):
                self.draft.problems.append(posed)
                return np.empty((0, 9))
            cranks = posed
        if cranks is not None:
            joints = sphm.inverse(world, tool, cranks, self.near, ranges, yaw).joints
            if len(joints):
                return joints
        reason = sphm.why_not(world, cranks, tool, ranges, yaw, move.where)
        if reason is not None:
            self.draft.problems.append(reason)
        return np.empty((0, 9))

    def _cranks(self, move: Move, point: Point, world: Floats) -> Floats | Problem:
        """Crank angles (3,) with which a ptp arrives at a tool pose in the arm's base."""
        given = point.cranks_deg
        if move.wrist.heave_mm is not None:
            # Where its profile begins, for what comes next to go on from there.
            pose = move.wrist.tilt_towards_deg, move.wrist.tilt_deg[0]
            direction, tilt = np.radians(pose)[:, None]
            return self._posed(move, direction, tilt, np.array([move.wrist.heave_mm[0] / 1000.0]))
        if given is None and self.policy == move.wrist.policy == "tilt" and self.joints is not None:
            return self._leant(move, world, self.joints)
        if move.wrist.policy == "fixed":
            if move.wrist.cranks_deg is not None:
                given = move.wrist.cranks_deg
            elif self.joints is not None:
                return self.joints[6:]
            elif self.start is not None:
                return self.near[6:]
        if given is None and move.wrist.policy in ("level", "tilt"):
            return np.full(3, self.near[6:].mean())
        if given is None:
            raise InvalidError(
                f"{move.title}: the wrist policy '{move.wrist.policy}' needs 'cranks_deg', in the "
                "policy or at the first point",
                f"{self.path.file}, line {move.line}",
            )
        return np.radians(given)

    def _leant(self, move: Move, world: Floats, begin: Floats) -> Floats | Problem:
        """The wrist that keeps the flange's z of joints (9,), at their heave if possible."""
        platform = world[None, :3, :3] @ self.setup.tool[:3, :3].T
        direction, tilt = leaning(platform, kr6.forward(begin[:6])[:3, 2])
        low, high = heave_range(direction, tilt, self.setup.ranges[6:])
        heave = np.clip(rrs.tilt_of(rrs.forward(begin[6:]))[2], low, np.maximum(low, high))
        posed = self._posed(move, direction, tilt, heave)
        if isinstance(posed, Problem):
            message = (
                f"to keep the flange's direction {posed.message}; give the point 'cranks_deg' to "
                "keep another one from there on"
            )
            return replace(posed, message=message)
        return posed

    def _posed(
        self, move: Move, direction: Floats, tilt: Floats, heave_m: Floats
    ) -> Floats | Problem:
        """Crank angles (3,) of direction, tilt and heave, each (1,)."""
        reason = impossible(self.setup, direction, tilt, heave_m)
        if reason is not None:
            return replace(reason.problem, where=move.where)
        cranks = rrs.inverse(direction, tilt, heave_m)[0]
        return np.asarray(np.clip(cranks, *self.setup.ranges[6:].T))

    def _arrive(self, name: str, joints: Floats | None, pose: Floats) -> None:
        self.joints, self.pose, self.name = joints, pose, name
        if joints is not None:
            self.near = joints


def _duration_s(draft: Draft) -> float:
    """How long the arm's controller takes; for ever where there are problems."""
    return math.inf if draft.refusals else sum(block.duration_s for block in draft.blocks)


def _steps(spot: Contour | None, whole: Step) -> tuple[Step, ...]:
    return (whole,) if spot is None else (Step(spot, ""), whole)


def _title(step: Step, here: str) -> str:
    """`A to B (move 2)`, or `here to there (moves 2 to 5)`."""
    contour = step.contour
    first, last = contour.place(0.0)[0], contour.place(contour.length_m)[0]
    moves = f"move {first}" if first == last else f"moves {first} to {last}"
    return f"{here or 'here'} to {step.name or 'there'} ({moves})"


def _pose(point: Point) -> Floats:
    """A pose point's tool pose in the base, m, (4, 4)."""
    assert point.pose is not None  # the path file has a pose or joints
    return pose_matrix(np.array(point.pose[:3]) / 1000.0, np.radians(point.pose[3:]))


def _missed(way: Way) -> Iterator[Problem]:
    """Nine joints that the path gives, and the way passes or reaches otherwise."""
    for s, move, wanted in way.contour.pins:
        reached = way.joints[int(np.abs(way.s - s).argmin())]
        joint = int(np.abs(reached - wanted).argmax())
        if np.abs(reached - wanted)[joint] > ARRIVAL_RAD:
            yield _other_branch(move, joint, reached, wanted)


def _other_branch(move: Move, joint: int, reached: Floats, wanted: Floats) -> Problem:
    name = JOINT_NAMES[joint]
    value, limit = float(np.degrees(reached[joint])), float(np.degrees(wanted[joint]))
    why = (
        "its wrist policy has it so; give the point as a pose, or use the policy 'cranks'"
        if joint >= 6
        else "it is another branch; give the point as a pose, or use ptp"
    )
    message = (
        f"the way arrives with {name} at {value:.6g} degrees, not at the point's {limit:.6g}: {why}"
    )
    return Problem(move.where, name, value, limit, message)


def walks(path: Path, setup: Setup, scale: float, finer: int = 1) -> Iterator[Walker]:
    """Walks of a path from each branch of its start, the nearest first; at least one."""
    scout = Walker(path, setup, scale)
    first = path.moves[0]
    assert first.point is not None  # a path begins with a ptp
    begins: list[Floats | None] = []
    if first.point.joints_deg is not None:
        begins.append(np.radians(first.point.joints_deg))
    else:
        begins += list(scout.answers(first, first.point, _pose(first.point))[:STARTS])
    for begin in begins or [None]:
        walker = Walker(path, setup, scale, finer)
        walker.go(begin)
        yield walker
