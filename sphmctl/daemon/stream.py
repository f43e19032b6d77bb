"""Plays one plan: the arm drives its knots, the cranks follow where the arm is going to be.

Two loops share one event loop: the arm's (read the state, learn its progress, feed knots, beat)
as fast as the controller answers, the wrist's at fixed instants. What either learns that must end
the motion becomes one cause, and the first cause wins.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable

import numpy as np

from sphmctl.daemon.follow import Follower, Lead
from sphmctl.daemon.record import Events
from sphmctl.daemon.watch import Watch
from sphmctl.daemon.wrist_loop import WristLoop
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.kuka import ArmState, KukaArm
from sphmctl.drivers.wrist import WristState
from sphmctl.errors import DeviceError, FaultError
from sphmctl.motion import Floats, Plan

BEAT_S = 0.024
"""Heartbeat period; up to four other requests of 6 ms may come before the next look. The program
wants one at least every 50 ms and holds after 120 ms."""

AHEAD = 8
"""Knots the controller has beyond the one passed: more than its three planned blocks, and few."""

PENDING_LIMIT = 50
"""Wrist states that wait for an arm state to be paired with: half a second."""

STANDSTILL_S = 3.0
"""Time in which a braked arm must be seen to stand; from full speed it needs 0.5 s."""

STILL_RAD = math.radians(0.01)
"""Axes that move less than this between two looks stand: a tenth of an in-position window."""

LOOK_S = 0.040
"""Time between two looks at standstill: three cycles of the controller."""

SETTLE_S = 1.0
"""Time for the cranks to come to rest after the arm; five times the slowest servo's lag."""

RETRY_S = 0.2
"""Pause before a lost controller is asked again, while there is time, to confirm standstill."""

SETTLED_RAD = math.radians(0.1)
"""Cranks that move less than one count between two looks stand."""

AT_GOAL_RAD = math.radians(0.2)
"""Where a crank may come to rest: a dead band of a count, and rounding twice."""


class Motion:
    """One plan on both devices.

    Args:
        plan: what to drive; the arm stands at its first sample.
        arm: the connected arm.
        wrist: the running wrist loop.
        ranges: allowed joint ranges, rad, shape (9, 2).
        lead: what is known of the servos' delays; learns on.
        events: where to report.
        on_row: takes (time since the begin, nine measured joints, plan time) once a wrist cycle.
        on_progress: takes the plan time reached.
    """

    def __init__(
        self,
        plan: Plan,
        arm: KukaArm,
        wrist: WristLoop,
        ranges: Floats,
        lead: Lead,
        events: Events,
        on_row: Callable[[float, Floats, float], None],
        on_progress: Callable[[float], None],
    ) -> None:
        self._plan = plan
        self._arm = arm
        self._wrist = wrist
        self._ranges = ranges
        self._lead = lead
        self._events = events
        self._on_row = on_row
        self._on_progress = on_progress
        self._low = plan.joints[:, 6:].min(axis=0)
        self._high = plan.joints[:, 6:].max(axis=0)
        self._sent = 0
        self._beat_s = -math.inf
        self._cause: str | None = None
        self._braking = False
        self._recording = True
        self._stop = asyncio.Event()
        self._states: deque[ArmState] = deque(maxlen=2)
        self._pending: deque[WristState] = deque(maxlen=PENDING_LIMIT)
        self._follower: Follower
        self._watch: Watch
        self._total = 0
        self.begin_s = math.nan

    def goals(self, now_s: float) -> Floats:
        """Where each crank must be when its servo gets there."""
        follower = self._follower
        goal = np.empty(3)
        for leg in range(3):
            tau = follower.tau(now_s + float(self._lead.seconds[leg]))
            goal[leg] = follower.cranks(tau)[leg]
        return np.clip(goal, self._low, self._high)

    def observe(self, state: WristState) -> None:
        """Learn the servos' delays, and look for a cause to end."""
        tau = self._follower.tau(state.at_s)
        required = self._follower.cranks(tau)
        self._lead.update(required, state.cranks, self._follower.crank_rates(tau))
        self._note(self._watch.wrist(state, required))
        self._pending.append(state)

    async def play(self, stop: asyncio.Event) -> None:
        """Drive the plan to its end and settle.

        Raises:
            FaultError: something ended it; both halves still have to be stopped (`brake`).
            DeviceError: the controller is lost; the same.
            StopRequestedError: `stop` was set; the same.
        """
        self._stop = stop
        await self._prepare()
        loop = asyncio.get_running_loop()
        self.begin_s = loop.time()
        self._wrist.source = self
        if self._total:
            await self._arm.command(krc.Command.RUN)
        while True:
            state = await self._turn()
            self._check()
            ended = state.status is krc.Status.ENDED or not self._total
            if ended and self._follower.piece is None:
                break
            await self._beat()
            await self._feed(state)
        await self.settle()

    async def brake(self) -> str | None:
        """Stop the arm, let the cranks follow it to standstill, and look that both stand.

        Returns:
            None when standstill was seen; else a sentence that says what was not.
        """
        loop = asyncio.get_running_loop()
        self._braking = True
        limit_s = loop.time() + STANDSTILL_S
        told, before = False, None
        while loop.time() < limit_s:
            try:
                if not self._arm.connected:
                    async with asyncio.timeout_at(limit_s):
                        await self._arm.connect()
                if not told:
                    await self._arm.command(krc.Command.STOP)
                    told = True
                state = await self._turn()
            except (DeviceError, TimeoutError) as error:
                self._events.add("controller not reached while stopping", message=str(error))
                await asyncio.sleep(RETRY_S)
                continue
            if before is not None and self._stands(before, state):
                self._wrist.hold()
                return await self._wrist_rest()
            if before is None or state.at_s - before.at_s >= LOOK_S:
                before = state
        self._wrist.hold()
        return (
            "the arm could not be seen to stand; its program brakes by itself when it hears no "
            "heartbeat, but look at the robot and use the emergency stop if it moves"
        )

    async def settle(self) -> None:
        """Wait until both halves rest at the end of the plan.

        Raises:
            FaultError: they do not, in time.
        """
        loop = asyncio.get_running_loop()
        limit_s = loop.time() + SETTLE_S
        before: ArmState | None = None
        cranks = None
        while loop.time() < limit_s:
            state = await self._turn()
            if self._cause or self._wrist.fault:
                raise FaultError(str(self._cause or self._wrist.fault))
            latest = self._wrist.latest
            if before is not None and state.at_s - before.at_s < LOOK_S:
                continue
            now = latest.cranks if latest else None
            if before is not None and cranks is not None and now is not None:
                away = np.abs(now - self._plan.joints[-1, 6:]).max()
                rest = np.abs(now - cranks).max() < SETTLED_RAD and away < AT_GOAL_RAD
                if rest and self._stands(before, state):
                    self._wrist.hold()
                    return
            before, cranks = state, now
        raise FaultError(f"the robot did not come to rest within {SETTLE_S:g} s after the plan")

    async def _prepare(self) -> None:
        """Open a session and give the controller its first knots."""
        self._check()
        state = await self._arm.begin_session()
        self._follower = Follower(self._plan, state.at_s)
        self._watch = Watch(self._ranges, state.session, state.mode)
        self._total = max((p.sequence for p in self._follower.pieces), default=0)
        while await self._feed(state):
            pass
        await self._beat()
        self._check()

    def _check(self) -> None:
        """Leave as soon as there is a reason; looked at before each request that moves the arm."""
        if self._stop.is_set():
            raise StopRequestedError("a stop was asked for")
        cause = self._cause or self._wrist.fault
        if cause:
            raise FaultError(cause)

    async def _turn(self) -> ArmState:
        """Read the arm once and learn from it."""
        state = await self._arm.read_state()
        follower = self._follower
        follower.update(
            state.joints,
            state.at_s,
            state.passed,
            state.override_percent / 100.0,
            state.stopped,
        )
        tau = follower.tau(state.at_s)
        self._note(self._watch.arm(state, follower.off_plan_rad))
        # A hold that nobody here asked for, or a start that did not come, must not last for ever.
        expected = state.override_percent > 0 and state.status is not krc.Status.ENDED
        self._note(self._watch.progress(tau, state.at_s, expected))
        self._states.append(state)
        self._pair()
        self._on_progress(tau)
        return state

    async def _beat(self) -> None:
        now_s = asyncio.get_running_loop().time()
        if now_s - self._beat_s >= BEAT_S:
            self._beat_s = now_s
            await self._arm.beat()

    async def _feed(self, state: ArmState) -> bool:
        """Give the controller one more knot, if it may have one; says whether it got one."""
        sequence = self._sent + 1
        newest = min(self._follower.open_sequence, state.passed + AHEAD)
        if sequence > newest:
            return False
        piece = next(p for p in self._follower.pieces if p.sequence == sequence)
        knot = self._plan.knots[piece.knot]
        await self._arm.write_knot(sequence, knot.joints, knot.velocity, knot.acceleration)
        if sequence == self._total:
            await self._arm.declare_last(sequence)
        self._check()
        await self._arm.publish(sequence)
        self._sent = sequence
        self._follower.publish(sequence)
        return True

    def _pair(self) -> None:
        """Give out the wrist states for which the arm is known just before and after."""
        if len(self._states) < 2:
            return
        early, late = self._states
        while self._pending and self._pending[0].at_s <= late.at_s:
            wrist = self._pending.popleft()
            span_s = late.at_s - early.at_s
            share = (wrist.at_s - early.at_s) / span_s if span_s > 0.0 else 1.0
            arm = early.joints + min(1.0, max(0.0, share)) * (late.joints - early.joints)
            self._record(wrist.at_s, np.concatenate((arm, wrist.cranks)))

    def _record(self, at_s: float, joints: Floats) -> None:
        """Hand out one row; what cannot be recorded ends the motion, but not its braking."""
        if not self._recording:
            return
        try:
            self._on_row(at_s - self.begin_s, joints, self._follower.tau(at_s))
        except OSError as error:
            self._recording = False
            self._note(f"the record cannot be written: {error.strerror}; make room on the disk")

    def _note(self, cause: str | None) -> None:
        if cause is not None and self._cause is None and not self._braking:
            self._cause = cause
            self._events.add("fault", message=cause)

    @staticmethod
    def _stands(before: ArmState, state: ArmState) -> bool:
        moved = float(np.abs(state.joints - before.joints).max())
        return state.stopped and state.at_s - before.at_s >= LOOK_S and moved < STILL_RAD

    async def _wrist_rest(self) -> str | None:
        """Wait until the cranks stand; a sentence if that was not seen."""
        before = None
        for _ in range(round(SETTLE_S / LOOK_S)):
            if self._wrist.fault:
                return f"the wrist could not be seen to stand: {self._wrist.fault}"
            latest = self._wrist.latest
            if before is not None and latest is not None:
                # NaN for a silent servo, which may come back from a power cut meanwhile.
                moved = np.abs(latest.cranks - before.cranks).max()
                if moved < SETTLED_RAD:
                    return None
            before = latest
            await asyncio.sleep(LOOK_S)
        return "the wrist could not be seen to stand"


class StopRequestedError(Exception):
    """The user, or the system, asked for a controlled stop."""
