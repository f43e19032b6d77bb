"""The true state of the emulated cell, driven by time alone; knows no protocol.

Parts (arm, servos) are stepped on one fixed grid. Whoever looks at a part first calls `advance`,
which steps the world up to the present instant: how often somebody looks cannot change what
happens.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Protocol

STEP_US = 1000
"""Grid of the world, us: the arm needs 4 ms and 12 ms, the servos a finer one."""

TRUTH_STEPS = 4
"""Steps between two rows of truth: 4 ms, as the run folder promises."""

TRUTH_LIMIT_ROWS = 900_000
"""One hour of truth at 4 ms, 72 MB; when it is full the older half is dropped."""

JOINTS = 9


class Part(Protocol):
    """Something whose state changes by time."""

    def step(self, index: int) -> None:
        """Go from grid instant `index - 1` to `index` (world time = index * 1 ms)."""


class World:
    """The cell's clock, its parts, and the record of its true joints.

    Args:
        clock: seconds, monotonic; the running loop's `time`.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.start_s = clock()
        self.index = 0
        self._parts: list[Part] = []
        self._truth: Callable[[], tuple[float, ...]] | None = None
        self._sink: Callable[[float, tuple[float, ...]], None] | None = None
        self._rows = array("d")

    def add(self, part: Part) -> None:
        """Let `part` live in this world; parts are stepped in the order of joining."""
        self._parts.append(part)

    def watch(
        self,
        truth: Callable[[], tuple[float, ...]],
        sink: Callable[[float, tuple[float, ...]], None] | None = None,
    ) -> None:
        """Record `truth()` (nine true joints, deg) every 4 ms, and hand each row to `sink`."""
        self._truth = truth
        self._sink = sink

    @property
    def time_s(self) -> float:
        """World time of the last step, s since the start."""
        return self.index * STEP_US / 1e6

    def advance(self) -> None:
        """Step every part up to the present instant."""
        target = int((self._clock() - self.start_s) * 1e6 / STEP_US + 1e-6)
        while self.index < target:
            self.index += 1
            for part in self._parts:
                part.step(self.index)
            if self._truth is not None and self.index % TRUTH_STEPS == 0:
                self._record(self._truth())

    def _record(self, joints: tuple[float, ...]) -> None:
        if self._sink is not None:
            self._sink(self.time_s, joints)
        if len(self._rows) >= TRUTH_LIMIT_ROWS * (JOINTS + 1):
            del self._rows[: len(self._rows) // 2]
        self._rows.append(self.time_s)
        self._rows.extend(joints)

    def truth(self, begin_s: float, end_s: float) -> list[tuple[float, ...]]:
        """The rows (world time s, nine joints deg) from one clock instant to another."""
        width = JOINTS + 1
        rows = (tuple(self._rows[i : i + width]) for i in range(0, len(self._rows), width))
        low, high = begin_s - self.start_s, end_s - self.start_s
        return [row for row in rows if low <= row[0] <= high]
