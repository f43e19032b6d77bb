"""The emulated arm in motion: a queue of planned blocks, driven by time alone.

Knows no program and no variable. Whoever owns it feeds blocks as an advance run delivers them and
is told what happens; the world advances it. A brake keeps what is planned, `discard` forgets it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from sphmctl.emulators.motion.aside import Aside
from sphmctl.emulators.motion.blend import link
from sphmctl.emulators.motion.blocks import AxisLimitError, Block, Event, Kind, MotionError
from sphmctl.emulators.motion.contours import ToolPath
from sphmctl.emulators.motion.figures import MODES, STEP_S, Joints, Options, beyond
from sphmctl.emulators.motion.governor import brake_limits, next_share, ramp_limits
from sphmctl.emulators.motion.reins import Reins
from sphmctl.emulators.motion.run import Run, joints_at, plan, way_back
from sphmctl.emulators.motion.slowing import coasted, fitting_step
from sphmctl.emulators.motion.triggers import Waiting

STEP_US = round(STEP_S * 1e6)
AT_REST: Joints = (0.0,) * 6
DEFAULTS = Options()


class Mover:
    """The arm; at first at rest without blocks, drives on, with a BCO run to come.

    Args:
        start_deg: the axes.
        tell: called with each event, from within `advance`, `feed` and the commands.
        options: what no document settles.

    Attributes:
        joints_deg: the true axes A1..A6.
        speed_deg_s: their mean speeds in the last step.
        override_percent: $OV_PRO; to be set at any time.
        mode: $MODE_OP, to be set at any time; "T1" caps speeds.
    """

    def __init__(
        self, start_deg: Joints, tell: Callable[[Event], None], options: Options = DEFAULTS
    ) -> None:
        axis = beyond(start_deg)
        if len(start_deg) != 6 or axis is not None:
            raise ValueError(f"start_deg {start_deg} is not six axes inside their limits")
        self.joints_deg: Joints = tuple(start_deg)
        self.speed_deg_s: Joints = AT_REST
        self.override_percent = 100.0
        self._mode = "EX"
        self._options = options
        self._tell_event = tell
        self._time_us = self._carry_us = 0
        self._queue: deque[Run] = deque()
        self._run: Run | None = None
        self._back: Run | None = None
        self._coast: Joints | None = None
        self._triggers = Waiting()
        self._aside: list[Aside] = []
        self._reins = Reins()
        self._share = self._rate = 0.0
        self._bco = True
        self._begins_s = 0.0
        self._was_moving = False
        self._slowed: Run | None = None
        self._ramp = ramp_limits(options)
        self._brakes = brake_limits(options, False), brake_limits(options, True)

    @property
    def time_s(self) -> float:
        """Time advanced so far."""
        return self._time_us / 1e6

    @property
    def mode(self) -> str:
        """$MODE_OP."""
        return self._mode

    @mode.setter
    def mode(self, mode: str) -> None:
        if mode not in MODES:
            raise ValueError(f"mode {mode!r} is not one of {', '.join(MODES)}")
        self._mode = mode

    @property
    def drives(self) -> bool:
        """Whether the drives are on."""
        return self._reins.drives

    @property
    def held(self) -> bool:
        """Whether a brake, a stop or the drives keep it from moving."""
        return self._reins.held

    @property
    def needs_bco(self) -> bool:
        """Whether the next block will be the block coincidence run."""
        return self._bco

    @property
    def running(self) -> Run | None:
        """What the main run pointer is on; it has `tag`, `block` and `contour`."""
        run = self._run
        return run.follower if run is not None and run.finished else run

    @property
    def queued(self) -> int:
        """Blocks planned and not begun: what $ADVANCE counts."""
        return len(self._queue)

    @property
    def planned_end_deg(self) -> Joints:
        """Where everything planned ends: the start of the next block."""
        last = self._last()
        return self.joints_deg if last is None else last.contour.end_deg

    @property
    def moving(self) -> bool:
        """Whether it moves or is about to in its next steps ($PRO_MOVE)."""
        if self._coast is not None:
            return True
        if self._reins.held:
            return self._share > 0.0 and self._run is not None
        if self._run is None and not self._queue and self._back is None:
            return False
        override = self.override_percent > 0.0 or self._options.moving_at_override_0
        return self._share > 0.0 or override

    def feed(self, block: Block) -> None:
        """Plan a block behind the others.

        Raises:
            MotionError: for what the controller refuses; AxisLimitError beyond the limits.
        """
        if self._reins.dropping:
            raise RuntimeError("no block can be planned before the arm stands after a discard")
        try:
            run = plan(block, self.planned_end_deg, self._options, self._bco)
        except AxisLimitError as error:
            self._tell(Kind.AXIS_LIMIT, block.tag, str(error))
            raise
        run.ready_s = self.time_s + self._options.plan_s
        last = self._last()
        if last is not None:
            link(last, run, self._options)
        self._queue.append(run)
        self._triggers.arm(block.triggers, run)
        if self._bco:
            self._bco = False
            self._tell(Kind.BCO_NEEDED, block.tag)

    def brake(self, fast: bool = False) -> None:
        """BRAKE, or BRAKE F: come to rest on the path and keep what is planned."""
        self._reins.harden(fast)
        self._reins.braked = True

    def release(self) -> None:
        """The interrupt routine that braked has ended: go on."""
        self._reins.braked = False

    def set_aside(self) -> None:
        """At standstill after a brake: keep the plan until `take_up`, and let a routine move."""
        if self.moving:
            raise RuntimeError("nothing can be set aside before the arm stands")
        self._aside.append(Aside(self._run, self._back, self._queue, self._triggers))
        self._run = self._back = None
        self._queue, self._triggers = deque(), Waiting()
        self._reins.braked = False

    def take_up(self) -> None:
        """What was set aside last is planned again, behind the way back to where it was left."""
        aside = self._aside.pop()
        self._run, self._back = aside.run, aside.back
        self._queue, self._triggers = aside.queue, aside.triggers
        self._reins.braked = True
        self._return()

    def drop_aside(self) -> None:
        """What was set aside last is forgotten."""
        self._bco |= self._aside.pop().bco

    def discard(self) -> None:
        """RESUME: come to rest, forget what is planned, and let go of the brake."""
        self._reins.harden(False)
        self._reins.dropping = True
        self._settle()

    def select(self) -> None:
        """Select, reset or deselect: like `discard`; the next block is a BCO run."""
        self._bco = True
        self._aside.clear()
        self.discard()

    def stop(self, category: int) -> None:
        """STOP 0 leaves the path, drives off; STOP 1 on it, then drives off; STOP 2 on it."""
        if category not in (0, 1, 2):
            raise ValueError(f"stop category {category} is not 0, 1 or 2")
        self._reins.stop(category)
        if category == 0 and any(self.speed_deg_s) and self._coast is None:
            self._coast = self.speed_deg_s
        self._settle()

    def start(self) -> bool:
        """Start key or start signal: undo a stop; False while the drives are off."""
        if not self._reins.drives or self._coast is not None:
            return False
        self._reins.stopped = False
        return True

    def drives_on(self) -> None:
        """Switch the drives on; a stop remains until `start`."""
        self._reins.drives = True

    def drives_off(self) -> None:
        """Switch the drives off."""
        self.stop(self._options.drives_off_stop)

    def advance(self, dt_s: float) -> None:
        """Let time pass, in whole steps of 4 ms; what is left of it counts next time."""
        self._carry_us += round(dt_s * 1e6)
        while self._carry_us >= STEP_US:
            self._carry_us -= STEP_US
            self._time_us += STEP_US
            self._step()

    def _step(self) -> None:
        before = self.joints_deg
        if self._coast is not None:
            self._step_coast(self._coast)
        else:
            if self._run is None and self._back is None:
                self._begin()
            run = self._run if self._back is None else self._back
            if run is not None:
                self._step_run(run)
        after = self.joints_deg
        if after is not before:
            self.speed_deg_s = tuple([(after[i] - before[i]) / STEP_S for i in range(6)])
        elif self.speed_deg_s is not AT_REST:
            self.speed_deg_s = AT_REST
        for time_s, tag in self._triggers.fired(self.time_s, self._rate):
            self._tell(Kind.TRIGGER, tag, time_s=time_s)
        self._settle()

    def _begin(self) -> None:
        queue = self._queue
        if not queue or self._reins.held or self.time_s < max(self._begins_s, queue[0].ready_s):
            return
        run = queue.popleft()
        run.begun = True
        self._run = run
        self._share = self._wanted(run)
        self._tell(Kind.ENTERED, run.tag, time_s=self.time_s - STEP_S)

    def _wanted(self, run: Run) -> float:
        share = max(0.0, min(100.0, self.override_percent)) / 100.0
        return min(share, run.t1_cap) if self._mode == "T1" else share

    def _step_run(self, run: Run) -> None:
        held, before = self._reins.held, self._share
        wanted = 0.0 if held else self._wanted(run)
        self._rate = 0.0
        if before == wanted == 0.0:
            return
        limits = self._brakes[self._reins.fast] if held else self._ramp
        share = next_share(before, wanted, run, limits)
        wished_s = (before + share) / 2.0 * STEP_S
        self._follow(run, run.t_s + wished_s)
        try:
            ahead_s, joints_deg, slowed = fitting_step(
                run, wished_s, self.joints_deg, self._mode == "T1"
            )
        except MotionError as error:
            # A blend cut through where the arm does not reach: there is no path to brake on.
            self._tell(Kind.AXIS_LIMIT, run.tag, str(error))
            self.stop(0)
            return
        self._rate = ahead_s / STEP_S
        self._share = self._rate if ahead_s < wished_s else share
        run.t_s += ahead_s
        if run.follower is not None:
            run.follower.t_s = run.t_s - run.follows_s
        self.joints_deg = joints_deg
        self._watch(run, slowed)
        self._pass(run, ahead_s)

    def _watch(self, run: Run, slowed: int | None) -> None:
        """Tell what a path did to the axes; PTP keeps their limits by itself."""
        if slowed is not None and self._slowed is not run:
            self._slowed = run
            self._tell(Kind.SLOWED, run.tag, f"A{slowed + 1}")
        axis = beyond(self.joints_deg) if isinstance(run.contour, ToolPath) else None
        if axis is not None and not self._reins.stopped:
            self._tell(Kind.AXIS_LIMIT, run.tag, f"A{axis + 1}")
            self.stop(1)

    def _follow(self, run: Run, t_s: float) -> None:
        """Begin the next block where the blend begins; or give the blend up."""
        if run.overlap_s == 0.0 or run.follower is not None or t_s < run.follows_s:
            return
        if self._queue[0].ready_s > self.time_s:
            run.overlap_s, run.reason = 0.0, "next block planned too late"
            return
        follower = self._queue.popleft()
        follower.begun, follower.head_s = True, run.overlap_s
        run.follower = follower

    def _pass(self, run: Run, ahead_s: float) -> None:
        """Tell what was passed in a step that ended at the run's present time."""
        duration_s, follower = run.profile.duration_s, run.follower

        def when_s(t_s: float) -> float:
            return self.time_s - (STEP_S * (run.t_s - t_s) / ahead_s if ahead_s > 0.0 else 0.0)

        middle_s = duration_s - run.overlap_s / 2.0
        if run.t_s >= middle_s and not run.finished and run.block is not None:
            run.finished = True
            self._tell(Kind.FINISHED, run.tag, time_s=when_s(middle_s))
            if follower is not None:
                self._tell(Kind.ENTERED, follower.tag, time_s=when_s(middle_s))
        if run.t_s < duration_s:
            return
        if run.behind is not None:
            run.behind.before = None
        if follower is not None:
            self._run = follower
            self._tell(Kind.BLENDED, run.tag, time_s=when_s(duration_s))
        else:
            self._end(run)

    def _end(self, run: Run) -> None:
        """The end of a block in an exact stop."""
        self.joints_deg = run.contour.end_deg
        self._begins_s = self.time_s + self._options.exact_stop_s
        self._share = 0.0
        if run is self._back:
            self._back = None
            self._tell(Kind.RETURNED)
            return
        self._run = None
        if run.block is not None and run.block.approximation:
            self._tell(Kind.EXACT_STOP, run.tag, run.reason)
        if run.bco:
            self._reins.stopped |= self._mode in self._options.bco_stops_in
            self._tell(Kind.BCO_REACHED, run.tag)

    def _step_coast(self, speed_deg_s: Joints) -> None:
        """STOP 0; at its end, the way back to the path if there is one."""
        self.joints_deg, self._coast = coasted(self.joints_deg, speed_deg_s, self._options)
        if any(self._coast):
            return
        self._coast = None
        self._return()

    def _return(self) -> None:
        """Plan the way back to the path, where there is one and the arm is beside it."""
        self._share = 0.0
        run = self._run or (self._queue[0] if self._queue else None)
        if run is not None:
            path_deg = joints_at(run, run.t_s, self.joints_deg)
            if path_deg != self.joints_deg:
                self._back = way_back(self.joints_deg, path_deg, self._options)

    def _last(self) -> Run | None:
        if self._queue:
            return self._queue[-1]
        run = self._run
        return run if run is None or run.follower is None else run.follower

    def _settle(self) -> None:
        """What happens at standstill, once."""
        reins, moving = self._reins, self.moving
        if reins.held and not moving:
            reins.at_rest()
            if reins.dropping:
                self._forget()
        if self._was_moving and not moving:
            self._was_moving = False
            self._tell(Kind.STANDSTILL)
        else:
            self._was_moving = moving

    def _forget(self) -> None:
        runs = [run for run in (self._run, *self._queue) if run is not None]
        self._bco = self._bco or any(run.bco for run in runs)
        self._queue.clear()
        self._run = self._back = None
        self._triggers.forget()
        self._share = 0.0
        self._reins.dropping = self._reins.braked = False

    def _tell(
        self, kind: Kind, tag: int = -1, detail: str = "", time_s: float | None = None
    ) -> None:
        self._tell_event(Event(kind, self.time_s if time_s is None else time_s, tag, detail))
