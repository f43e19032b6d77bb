"""An arm that drives a plan's blocks with pauses, an override and holds; for the follower's tests.

Independent of the emulator: it knows plan time only, and reads joints out of the plan.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sphmctl.daemon.follow import Follower
from sphmctl.motion import Floats, Plan

STEP_S = 0.001
CYCLE_STEPS = 12
BEGIN_S = 500.0

REST_STEPS = 50
"""A rest: longer than a pause between two blocks."""

BEGIN_STEPS = 80
"""After a rest: two looks, a lead and the pause of the controller's cycle."""


@dataclass
class Course:
    """How this arm drives.

    Attributes:
        start_s: from the first published knot to its first motion.
        gap_s: pause between two blocks.
        override: share of speed, by time since the begin.
        held: whether the arm stands on its path, by time since the begin.
        noise_s: error of the host times of cycles, at most.
        ahead_s: how far ahead predictions are judged.
    """

    start_s: float = 0.03
    gap_s: float = 0.012
    override: Callable[[float], float] = lambda t: 1.0
    held: Callable[[float], bool] = lambda t: False
    noise_s: float = 0.001
    ahead_s: float = 0.035


@dataclass
class Seen:
    """What the follower said, beside what was.

    Attributes:
        true: (time, true plan time, whether the arm moves), each millisecond.
        predicted: (time it is about, plan time) of each prediction.
        now: (time, plan time) that the follower held to be the present one.
    """

    true: list[tuple[float, float, bool]] = field(default_factory=list)
    predicted: list[tuple[float, float]] = field(default_factory=list)
    now: list[tuple[float, float]] = field(default_factory=list)

    def errors_s(self) -> Floats:
        """Errors of the predictions about an arm in motion, a while after it began.

        A begin from a rest cannot be foretold, and near a rest plan time says little.
        """
        table = np.array([(t, tau) for t, tau, _ in self.true])
        settled = self._well_under_way()
        index = np.rint((np.array([t for t, _ in self.predicted]) - BEGIN_S) / STEP_S).astype(int)
        inside = index < len(table)
        told = np.array([tau for _, tau in self.predicted])[inside]
        index = index[inside]
        result: Floats = (told - table[index, 1])[settled[index]]
        return result

    def _well_under_way(self) -> NDArray[np.bool_]:
        under_way = np.zeros(len(self.true), dtype=bool)
        resting, since = REST_STEPS, 0
        for index, (_, _, moving) in enumerate(self.true):
            resting = 0 if moving else resting + 1
            since = 0 if resting >= REST_STEPS else since + 1
            under_way[index] = moving and since > BEGIN_STEPS
        return under_way


def drive(plan: Plan, course: Course, seed: int, limit_s: float = 60.0) -> tuple[Follower, Seen]:
    """Drive a plan to its end while a follower watches, fed like the daemon feeds it."""
    rng = random.Random(seed)
    follower = Follower(plan, BEGIN_S)
    blocks = [piece for piece in follower.pieces if piece.sequence]
    seen = Seen()
    at, tau, passed = 0, float(plan.t[0]), 0
    wait_s, published = course.start_s, 0
    cycle = (BEGIN_S, plan.joints[0, :6], 0, 1.0, True)
    look_s = BEGIN_S
    for step in range(round(limit_s / STEP_S)):
        now_s = BEGIN_S + step * STEP_S
        share, held = course.override(step * STEP_S), course.held(step * STEP_S)
        moving = False
        if at < len(blocks) and blocks[at].sequence <= published and not held and share > 0.0:
            if wait_s > 0.0:
                wait_s -= STEP_S
            else:
                moving = True
                tau = max(tau, float(plan.t[blocks[at].first])) + share * STEP_S
                if tau >= plan.t[blocks[at].last]:
                    tau = float(plan.t[blocks[at].last])
                    passed, at, wait_s = blocks[at].sequence, at + 1, course.gap_s
        seen.true.append((now_s, tau, moving))
        if step % CYCLE_STEPS == 0:
            joints = np.array([np.interp(tau, plan.t, plan.joints[:, i]) for i in range(6)])
            noise_s = rng.uniform(-course.noise_s, course.noise_s)
            cycle = (now_s + noise_s, joints, passed, share, held or share == 0.0)
        if now_s >= look_s:
            at_s, joints, done, override, stopped = cycle
            follower.update(joints, at_s, done, override, stopped)
            look_s = now_s + rng.choice((0.002, 0.0045))
            published = max(published, follower.open_sequence)
            follower.publish(published)
            seen.predicted.append((now_s + course.ahead_s, follower.tau(now_s + course.ahead_s)))
            seen.now.append((now_s, follower.tau(now_s)))
            if follower.piece is None:
                return follower, seen
    raise AssertionError("the follower did not reach the end of the plan")
