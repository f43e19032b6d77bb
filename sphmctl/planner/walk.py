"""Walks through a path's moves: the nine joints at each point, and the blocks between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import Move, Path, Point, Wrist
from sphmctl.planner.blocks import Draft, add_direct, add_rest, add_way
from sphmctl.planner.contour import Contour
from sphmctl.planner.legs import Direct, Setup
from sphmctl.planner.outline import contours
from sphmctl.planner.places import range_problems
from sphmctl.planner.way import SAME_RAD, NoWay, Way, lay, on_the_spot, relocation
from sphmctl.robots import rrs, sphm
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
        finer: rows to each one that a way usually has.
        start: joints (9,) of the start.
        name: of the point it stands on; "" for none.
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

    def go(self, begin: Floats | None) -> None:
        """Walk the whole path from a start (9,), or from none where there is no answer."""
        first, *moves = self.path.moves
        assert first.point is not None  # a path begins with a ptp
        pose, _ = self._target(first, first.point)
        self.start = begin
        self._arrive(first.point.name, begin, pose)
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

    def _follow(self, contour: Contour) -> None:
        """Follow one contour, the wrist led to where it has to begin first."""
        setup, name = self.setup, contour.marks[-1][0] if contour.marks else ""
        if self.joints is not None:
            spot = relocation(contour, setup, self.joints)
            if spot is not None:
                self._lay(spot, "")
        if self.joints is not None and contour.policy in ("level", "tilt"):
            free = lay(contour, setup, None, finer=self.finer)
            if (
                isinstance(free, Way)
                and np.abs(free.begin_cranks - self.joints[6:]).max() > SAME_RAD
            ):
                self._lay(on_the_spot(contour, self.joints[6:], free.begin_cranks), "")
        self._lay(contour, name)

    def _lay(self, contour: Contour, name: str) -> None:
        way = lay(contour, self.setup, self.joints, contour.end_joints, self.finer)
        if isinstance(way, NoWay):
            self.draft.problems += way.problems
            self._arrive(name, None, contour.end)
            return
        add_way(self.draft, way, self._title(contour, name), self.scale)
        self._arrive(name, way.joints[-1], contour.end)
        for s, move, wanted in contour.pins:
            self._check_arrival(move, way.joints[int(np.abs(way.s - s).argmin())], wanted)

    def _title(self, contour: Contour, name: str) -> str:
        """`A to B (move 2)`, or `here to there (moves 2 to 5)`."""
        first, last = contour.place(0.0)[0], contour.place(contour.length_m)[0]
        moves = f"move {first}" if first == last else f"moves {first} to {last}"
        return f"{self.name or 'here'} to {name or 'there'} ({moves})"

    def _check_arrival(self, move: Move, reached: Floats, wanted: Floats) -> None:
        """A way to nine given joints may pass or reach them on another branch."""
        joint = int(np.abs(reached - wanted).argmax())
        if np.abs(reached - wanted)[joint] > ARRIVAL_RAD:
            self.draft.problems.append(_other_branch(move, joint, reached, wanted))

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
        if cranks is not None and np.isnan(cranks).any():
            self.draft.problems.append(_no_such_tilt(move))
            return np.empty((0, 9))
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
        if move.wrist.heave_mm is not None:
            return self._posed(move.wrist)
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

    def _posed(self, wrist: Wrist) -> Floats:
        """Crank angles (3,) of heave, tilt and direction at a move's end."""
        assert wrist.heave_mm is not None  # or there is no pose
        direction = np.radians(wrist.tilt_towards_deg + 360.0 * wrist.tilt_turns)
        cranks = rrs.inverse(direction, np.radians(wrist.tilt_deg[1]), wrist.heave_mm[1] / 1000.0)
        return np.asarray(np.clip(cranks, *self.setup.ranges[6:].T))

    def _arrive(self, name: str, joints: Floats | None, pose: Floats) -> None:
        self.joints, self.pose, self.name = joints, pose, name
        if joints is not None:
            self.near = joints


def _pose(point: Point) -> Floats:
    """A pose point's tool pose in the base, m, (4, 4)."""
    assert point.pose is not None  # the path file has a pose or joints
    return pose_matrix(np.array(point.pose[:3]) / 1000.0, np.radians(point.pose[3:]))


def _no_such_tilt(move: Move) -> Problem:
    """A ptp goes to what the wrist's motion ends with."""
    assert move.wrist.heave_mm is not None  # it is a motion
    tilt, heave = move.wrist.tilt_deg[1], move.wrist.heave_mm[1]
    message = f"the wrist cannot hold a tilt of {tilt:g} degrees at a heave of {heave:g} mm"
    return Problem(move.where, "", tilt, None, message)


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
