"""Walks through a path's moves: the nine joints at each point, and the blocks between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sphmctl.errors import InvalidError, Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move, Path, Point
from sphmctl.planner.blocks import Draft, add_direct, add_line, add_rest
from sphmctl.planner.legs import Direct, Line, Setup
from sphmctl.planner.places import range_problems
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix

HOME: Floats = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0, 60.0, 60.0, 60.0])
"""Where a start given as a pose takes its branch from: elbow up, hand not turned over."""

STARTS = 6
"""Branches of the start that are tried before a path is refused."""

ARRIVAL_RAD = 1e-6
"""How close a line to `joints_deg` must come to these joints; more is another branch or turn."""


@dataclass
class Walker:
    """Where the walk has come to.

    Attributes:
        joints: (9,), or None after a move that could not be resolved.
        pose: tool in the base, (4, 4), or None.
        near: the last joints known, to choose branches by.
        start: joints (9,) of the start.
        name: of the point it stands on; "" for none.
    """

    path: Path
    setup: Setup
    scale: float
    draft: Draft = field(default_factory=Draft)
    joints: Floats | None = None
    pose: Floats | None = None
    near: Floats = field(default_factory=HOME.copy)
    start: Floats | None = None
    name: str = ""

    def go(self, begin: Floats | None) -> None:
        """Walk the whole path from a start (9,), or from none where there is no answer."""
        first, *moves = self.path.moves
        assert first.point is not None  # a path begins with a ptp
        pose, _ = self._target(first, first.point)
        self.start = begin
        self._arrive(first.point, begin, pose)
        for move in moves:
            self._move(move)

    def _move(self, move: Move) -> None:
        if move.point is None:
            add_rest(self.draft, move, self.scale)
            return
        if move.kind == "lin" and self.joints is not None:
            self._line(move, move.point, self.joints)
            return
        pose, joints = self._target(move, move.point)
        if move.kind == "ptp" and joints is not None and self.joints is not None:
            add_direct(self.draft, move, Direct(self.setup, self.joints, joints), self.scale)
        self._arrive(move.point, joints, pose)

    def _line(self, move: Move, point: Point, begin: Floats) -> None:
        """Lay a line from joints (9,) to a point."""
        assert self.pose is not None  # it comes with the joints
        wanted: Floats | None = None
        if point.pose is None or move.wrist.policy == "auto":
            pose, wanted = self._target(move, point)
            if wanted is None:
                self._arrive(point, None, pose)
                return
            cranks = wanted[6:]
        else:
            pose, cranks = _pose(point), self._cranks(move, point)
        leg = Line(self.setup, self.pose, pose, begin, cranks)
        title = f"{self.name or 'here'} to {point.name or 'there'} (move {move.number})"
        reached = add_line(self.draft, move, leg, title, self.scale)
        if reached is None:
            wanted = self._quietly(move, point, pose) if wanted is None else wanted
            self._arrive(point, wanted, pose)
            return
        if point.joints_deg is not None and wanted is not None:
            joint = int(np.abs(reached - wanted).argmax())
            if np.abs(reached - wanted)[joint] > ARRIVAL_RAD:
                self.draft.problems.append(_other_branch(move, joint, reached, wanted))
                reached = wanted
        self._arrive(point, reached, pose)

    def _quietly(self, move: Move, point: Point, pose: Floats) -> Floats | None:
        """Joints to go on from after a line that failed and has been told of."""
        told = len(self.draft.problems)
        answers = self.answers(move, point, pose)
        del self.draft.problems[told:]
        return answers[0] if len(answers) else None

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
            cranks = self._cranks(move, point)
        if cranks is not None:
            joints = sphm.inverse(world, tool, cranks, self.near, ranges, yaw).joints
            if len(joints):
                return joints
        reason = sphm.why_not(world, cranks, tool, ranges, yaw, move.where)
        if reason is not None:
            self.draft.problems.append(reason)
        return np.empty((0, 9))

    def _cranks(self, move: Move, point: Point) -> Floats:
        given = point.cranks_deg
        if move.wrist.policy == "fixed":
            if move.wrist.cranks_deg is not None:
                given = move.wrist.cranks_deg
            elif self.joints is not None:
                return self.joints[6:]
            elif self.start is not None:
                return self.near[6:]
        if given is None:
            raise InvalidError(
                f"{move.title}: the wrist policy 'fixed' needs 'cranks_deg', in the policy or "
                "at the first point",
                f"{self.path.file}, line {move.line}",
            )
        return np.radians(given)

    def _arrive(self, point: Point, joints: Floats | None, pose: Floats) -> None:
        self.joints, self.pose, self.name = joints, pose, point.name
        if joints is not None:
            self.near = joints


def _pose(point: Point) -> Floats:
    """A pose point's tool pose in the base, m, (4, 4)."""
    assert point.pose is not None  # the path file has a pose or joints
    return pose_matrix(np.array(point.pose[:3]) / 1000.0, np.radians(point.pose[3:]))


def _other_branch(move: Move, joint: int, reached: Floats, wanted: Floats) -> Problem:
    name = JOINT_NAMES[joint]
    value, limit = float(np.degrees(reached[joint])), float(np.degrees(wanted[joint]))
    message = (
        f"the line arrives with {name} at {value:.6g} degrees, not at the point's {limit:.6g}: "
        "it is another branch; give the point as a pose, or use ptp"
    )
    return Problem(move.where, name, value, limit, message)


def walk(path: Path, setup: Setup, scale: float) -> Walker:
    """Walk a path from the best branch of its start that leads through; else from the nearest."""
    scout = Walker(path, setup, scale)
    first = path.moves[0]
    assert first.point is not None  # a path begins with a ptp
    if first.point.joints_deg is not None:
        begins = [np.radians(first.point.joints_deg)]
    else:
        begins = list(scout.answers(first, first.point, _pose(first.point))[:STARTS])
    failed: list[Walker] = []
    for begin in begins:
        walker = Walker(path, setup, scale)
        walker.go(begin)
        if not walker.draft.problems:
            return walker
        failed.append(walker)
    if failed:
        return failed[0]
    scout.draft.problems.clear()
    scout.go(None)
    return scout
