"""When the triggers of a block fire.

DISTANCE=0 is the block's start or the end of the blend into it, DISTANCE=1 its end or the middle
of the blend out of it (KUKA system integrators' manual, "TRIGGER"). A delay outside the half block
before or behind is trimmed silently (robot-forum 34556).
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from sphmctl.emulators.motion.blocks import Trigger
from sphmctl.emulators.motion.contours import ToolPath
from sphmctl.emulators.motion.run import Run

NO_RATE = 1e-9
"""Below this rate of time nothing arrives."""


def place_s(trigger: Trigger, run: Run) -> float:
    """Own time of the block at which the trigger's place is."""
    if trigger.distance == 0:
        return run.head_s
    if trigger.distance == 1:
        return run.profile.duration_s - run.overlap_s / 2.0
    length_mm = run.contour.length_mm if isinstance(run.contour, ToolPath) else 0.0
    path_mm = trigger.path_mm or 0.0
    way = path_mm / length_mm if length_mm > 0.0 else math.copysign(1.0, path_mm)
    return run.profile.time_to(way if trigger.onstart else 1.0 + way)


class Armed:
    """One trigger of one block that has not fired yet."""

    def __init__(self, trigger: Trigger, run: Run) -> None:
        self.trigger = trigger
        self.run = run
        self._due_s: float | None = None

    @property
    def due(self) -> bool:
        """Whether its place is passed, and only the delay is left."""
        return self._due_s is not None

    def fires(self, time_s: float, rate: float) -> float | None:
        """The time at which it fired, when that is now; else None.

        Args:
            time_s: the mover's time, at the end of the step.
            rate: own time by real time in the step.
        """
        delay_s = self.trigger.delay_s
        if self._due_s is None:
            left_s = self._left_s()
            if left_s <= 0.0:
                self._due_s = time_s + left_s / max(rate, NO_RATE) + max(0.0, delay_s)
            elif delay_s < 0.0 and rate > NO_RATE and left_s / rate <= -delay_s:
                return time_s if self._in_window() else None
        if self._due_s is None:
            return None
        if self._due_s <= time_s:
            return self._due_s
        return time_s if self._is_late() else None

    def _left_s(self) -> float:
        """Own time to the place."""
        place, run = place_s(self.trigger, self.run), self.run
        if run.begun:
            return place - run.t_s
        before = run.before
        if before is None or not before.begun:
            return math.inf
        return place + before.follows_s - before.t_s

    def _in_window(self) -> bool:
        """Not before the middle of this block, or for its start of the one before."""
        if self.trigger.distance == 0:
            before = self.run.before
            return before is None or _past_middle(before)
        return _past_middle(self.run)

    def _is_late(self) -> bool:
        """Past the middle of the block behind the place."""
        behind = self.run if self.trigger.distance == 0 else self.run.behind
        return behind is not None and _past_middle(behind)


class Waiting:
    """The triggers of all planned blocks that have not fired."""

    def __init__(self) -> None:
        self._armed: list[Armed] = []

    def arm(self, triggers: Iterable[Trigger], run: Run) -> None:
        """Take those of one more block."""
        self._armed += [Armed(trigger, run) for trigger in triggers]

    def fired(self, time_s: float, rate: float) -> list[tuple[float, int]]:
        """Those that fire in this step, in their order: when, and their tags."""
        if not self._armed:
            return []
        fired: list[tuple[float, int]] = []
        waiting: list[Armed] = []
        for armed in self._armed:
            when_s = armed.fires(time_s, rate)
            if when_s is None:
                waiting.append(armed)
            else:
                fired.append((when_s, armed.trigger.tag))
        self._armed = waiting
        return sorted(fired)

    def forget(self) -> None:
        """Their blocks are forgotten; where only a delay is left, they fire nevertheless."""
        self._armed = [armed for armed in self._armed if armed.due]


def _past_middle(run: Run) -> bool:
    return run.begun and run.t_s >= run.profile.duration_s / 2.0
