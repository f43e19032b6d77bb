"""One session with a cell: connect, verify, approach, play, settle, disarm, close.

Nothing moves before `play`, and `play` leaves the robot standing with the wrist's torque off, or
says what it could not see.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sphmctl import planner
from sphmctl.config import Cell
from sphmctl.daemon.board_report import board_begins
from sphmctl.daemon.examine_arm import LINES_OFF, examine_arm, examine_level, remedies
from sphmctl.daemon.follow import Lead
from sphmctl.daemon.record import Events
from sphmctl.daemon.stream import Motion, StopRequestedError
from sphmctl.daemon.watch import MEASURED_TOLERANCE_RAD
from sphmctl.daemon.wrist_loop import Hold, WristLoop
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.wrist import Wrist
from sphmctl.errors import DeviceError, SphmctlError, UsageError
from sphmctl.motion import JOINT_NAMES, Floats, Plan

AT_START_RAD = math.radians(0.5)
"""Closer than this to the plan's start the approach is not worth a question."""

APPROACH_SHARE = 0.25
"""Joint speed of the approach move at 100 %, as a share of every joint's limit."""

APPROACH_M_S = 0.25
"""Speed of the platform on the approach at 100 %, m/s: what T1 allows, for nobody checked its way.
At the 10 % of a real cell it is 25 mm/s."""

RowSink = Callable[[float, Floats, float], None]
Consent = Callable[[str], Awaitable[bool]]


@dataclass
class Outcome:
    """How a run ended.

    Attributes:
        outcome: completed, stopped or faulted.
        cause: why, if not completed.
        unconfirmed: what could not be seen to be safe at the end, one sentence each.
        remedy: what to do to go on, if it faulted.
        begin_s, end_s: host times of the plan's motion; NaN if it never began.
        board: the board's identity, and its counters at begin and end; None without a board.
    """

    outcome: str = "completed"
    cause: str = ""
    unconfirmed: list[str] = field(default_factory=list)
    remedy: str = ""
    begin_s: float = math.nan
    end_s: float = math.nan
    board: dict[str, Any] | None = None


class Session:
    """A cell that is connected.

    Args:
        cell: its description.
        arm, wrist: its devices, not connected yet.
        events: where to report.
    """

    def __init__(self, cell: Cell, arm: KukaArm, wrist: Wrist, events: Events) -> None:
        self._cell = cell
        self._arm = arm
        self._wrist = wrist
        self._events = events

    def report_to(self, events: Events) -> None:
        """Report to `events` from now on."""
        self._events = events

    async def open(self) -> None:
        """Connect both devices.

        Raises:
            DeviceError: either of them cannot be reached.
        """
        results = await asyncio.gather(
            self._arm.connect(), self._wrist.connect(), return_exceptions=True
        )
        for result in results:
            if isinstance(result, BaseException):
                await self.close()
                raise result
        self._events.add("connected")

    async def close(self) -> None:
        """Close both devices; may be called again."""
        await asyncio.gather(self._arm.close(), self._wrist.close(), return_exceptions=True)

    async def examine_arm(self) -> list[Finding]:
        """Look whether this is the right robot with the right program, ready to move."""
        return await examine_arm(self._cell, self._arm)

    async def examine_wrist(self) -> list[Finding]:
        """Look at the board, if there is one, and at the three servos."""
        return await self._wrist.examine()

    async def examine_level(self) -> list[Finding]:
        """Compare "wrist ok" at both ends of its wire; nothing where no wire is connected."""
        state = await self._arm.read_state()
        if self._wrist.board is None or state.wrist is krc.Wrist.NONE:
            return []
        return [examine_level(state, await self._wrist.board.state())]

    async def verify(self) -> None:
        """Refuse a cell that is not ready.

        Raises:
            DeviceError: the first thing that is not right, and its remedy.
        """
        found = await self.examine_arm()
        _refuse(found)
        await self._wrist.verify()
        _refuse(await self.examine_level())
        for finding in found:
            if finding.detail == LINES_OFF:
                self._events.add("lines off", message=f"{finding.name}: {finding.detail}")
        self._events.add("verified")

    async def measured(self) -> Floats:
        """All nine joints as both devices measure them now, rad, shape (9,)."""
        arm = await self._arm.read_axes()
        return np.concatenate((arm, await self._wrist.read_cranks()))

    async def prepare(self, plan: Plan, speed: float, consent: Consent) -> Plan | None:
        """Plan the way to the plan's start, and ask once whether the robot may move.

        Args:
            plan: what to drive.
            speed: share (0, 1] by which the plan was scaled; the approach is, too.
            consent: answers the question.

        Returns:
            The approach move; None when the robot stands at the start.

        Raises:
            UsageError: no consent.
            DeviceError, InfeasibleError: the robot stands where it cannot start from.
        """
        start = await self.measured()
        self._within_ranges(start)
        away = np.abs(start - plan.joints[0])
        approach = None
        if away.max() > AT_START_RAD:
            approach = self._approach(start, plan.joints[0], speed)
        if not await consent(_question(plan, approach, away)):
            raise UsageError("no consent to move: nothing was moved")
        return approach

    async def play(
        self,
        plan: Plan,
        approach: Plan | None,
        stop: asyncio.Event,
        on_row: RowSink,
        on_progress: Callable[[float], None],
    ) -> Outcome:
        """Arm, approach the plan's start, drive the plan, settle, disarm.

        Args:
            plan: what to drive.
            approach: the way to its start, from `prepare`.
            stop: set it for a controlled stop.
            on_row: takes (time since the begin, measured joints, plan time) once a cycle.
            on_progress: takes the plan time reached.

        Raises:
            DeviceError: the robot was moved since `prepare`, or arming failed; nothing moved.
        """
        speeds = [
            np.abs(np.diff(p.joints[:, 6:], axis=0) / np.diff(p.t)[:, None]).max()
            for p in (approach, plan)
            if p is not None
        ]
        first = plan if approach is None else approach
        await self._still_there(first)
        record = await board_begins(self._wrist.board, self._events)
        await self._wrist.arm(float(max(speeds)))
        self._events.add("armed")
        on_board = None if record is None else record.take
        loop = WristLoop(self._wrist, first.joints[0, 6:], self._events, on_board)
        task = asyncio.create_task(loop.run(), name="wrist loop")
        outcome = Outcome(board=None if record is None else record.report)
        lead = Lead()
        try:
            if approach is not None:
                self._events.add("approach", seconds=round(approach.duration_s, 3))
                await self._drive(approach, loop, lead, stop, outcome, _no_row, _no_progress)
            if outcome.outcome == "completed":
                self._events.add("motion begins", seconds=round(plan.duration_s, 3))
                await self._drive(plan, loop, lead, stop, outcome, on_row, on_progress, main=True)
        finally:
            loop.source = Hold(loop.goal)
            loop.end()
            await asyncio.gather(task, return_exceptions=True)
            await self._disarm(outcome)
            if record is not None:
                await record.end()
        self._events.add(outcome.outcome, cause=outcome.cause, late_cycles=loop.late_cycles)
        if outcome.outcome == "faulted":
            outcome.remedy = await self._remedy()
            self._events.add("to go on", message=outcome.remedy)
        return outcome

    async def _remedy(self) -> str:
        """What to do to go on, as far as the controller tells."""
        try:
            steps = remedies(await self.examine_arm())
        except DeviceError:
            return (
                "look at the robot, mend the connection, see what `sphmctl doctor` says, run again"
            )
        return f"{steps or 'see to what the fault names'}, then run again"

    async def _still_there(self, first: Plan) -> None:
        """Refuse when somebody moved the robot while the question stood."""
        away = np.abs(await self.measured() - first.joints[0])
        worst = int(np.argmax(away))
        if away[worst] > 2.0 * AT_START_RAD:
            raise DeviceError(
                f"{JOINT_NAMES[worst]} was moved by {math.degrees(away[worst]):.1f} degrees while "
                "the question stood; start the run again",
                "cell",
            )

    async def _drive(
        self,
        plan: Plan,
        loop: WristLoop,
        lead: Lead,
        stop: asyncio.Event,
        outcome: Outcome,
        on_row: RowSink,
        on_progress: Callable[[float], None],
        *,
        main: bool = False,
    ) -> None:
        """Drive one plan; whatever ends it, both halves are brought to a stand first."""
        motion = Motion(
            plan,
            self._arm,
            loop,
            self._cell.ranges_rad,
            lead,
            self._events,
            on_row,
            on_progress,
        )
        outcome.outcome, outcome.cause = "faulted", "the run was cancelled"
        try:
            await motion.play(stop)
            outcome.outcome, outcome.cause = "completed", ""
        except StopRequestedError as error:
            outcome.outcome, outcome.cause = "stopped", str(error)
        except SphmctlError as error:
            outcome.outcome, outcome.cause = "faulted", str(error)
            if not self._events.told("fault", message=outcome.cause):
                self._events.add("fault", message=outcome.cause)
        finally:
            if main:
                outcome.begin_s = motion.begin_s
            if outcome.outcome != "completed":
                await self._stop(motion, loop, outcome)
            if main:
                outcome.end_s = asyncio.get_running_loop().time()
        self._events.add(
            "delays learnt", lead_ms=[round(1000.0 * float(s), 2) for s in lead.seconds]
        )

    async def _stop(self, motion: Motion, loop: WristLoop, outcome: Outcome) -> None:
        if math.isnan(motion.begin_s):
            loop.hold()
            return
        problem = await motion.brake()
        if problem:
            outcome.unconfirmed.append(problem)
        self._events.add("standing" if problem is None else "standstill not seen", message=problem)

    async def _disarm(self, outcome: Outcome) -> None:
        problems = await self._wrist.disarm()
        try:
            await self._arm.command(krc.Command.IDLE)
        except DeviceError as error:
            problems.append(f"the controller was not told to be idle: {error.message}")
        for problem in problems:
            self._events.add("disarm", message=problem)
        outcome.unconfirmed += problems

    def _approach(self, start: Floats, goal: Floats, speed: float) -> Plan:
        """The way to the start: as fast as the joints may, or the platform, if that is less."""
        share = APPROACH_SHARE * speed
        approach = planner.approach(start, goal, self._cell, share)
        fastest = _platform_m_s(approach)
        if fastest > APPROACH_M_S * speed:
            share *= APPROACH_M_S * speed / fastest
            approach = planner.approach(start, goal, self._cell, share)
        return approach

    def _within_ranges(self, joints: Floats) -> None:
        ranges = self._cell.ranges_rad
        excess = np.maximum(ranges[:, 0] - joints, joints - ranges[:, 1])
        worst = int(np.argmax(excess))
        if excess[worst] > MEASURED_TOLERANCE_RAD:
            low, high = np.degrees(ranges[worst])
            raise DeviceError(
                f"{JOINT_NAMES[worst]} stands at {math.degrees(joints[worst]):.2f} degrees, "
                f"outside {low:g} to {high:g}; move it back by hand or by the pendant",
                "cell",
            )


def _refuse(findings: list[Finding]) -> None:
    """Raise the first thing that is not right, with all that is to be done."""
    for finding in findings:
        if not finding.ok:
            message = f"{finding.name}: {finding.detail}; {remedies(findings)}"
            raise DeviceError(message, "controller")


def _no_row(at_s: float, joints: Floats, tau_s: float) -> None:
    """The approach leaves no rows."""


def _no_progress(tau_s: float) -> None:
    """The approach shows no progress."""


def _platform_m_s(plan: Plan) -> float:
    """The fastest that the plan's tool point moves, m/s."""
    if len(plan.t) < 2:
        return 0.0
    steps = np.linalg.norm(np.diff(plan.tool[:, :3, 3], axis=0), axis=1)
    return float((steps / np.diff(plan.t)).max())


def _question(plan: Plan, approach: Plan | None, away: Floats) -> str:
    text = f"{plan.name}: {plan.duration_s:.1f} s"
    if approach is None:
        return f"{text}. The robot stands at the start. Move now?"
    worst = int(np.argmax(away))
    return (
        f"{text}. The robot is not at the start ({JOINT_NAMES[worst]} is "
        f"{math.degrees(away[worst]):.1f} degrees away): it first drives there in a straight line "
        f"of joint space ({approach.duration_s:.1f} s, at most "
        f"{1000.0 * _platform_m_s(approach):.0f} mm/s). Is the way free? Move now?"
    )
