"""A mover with a record of every step and every event, and numerical differentiation."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from sphmctl.emulators.motion import Apo, Block, Event, Kind, Mover, Options, Ptp, Trigger

HOME = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
STEP_S = 0.004

# KUKA machine data of the robot, 6000 rpm through the gears.
SPEED_DEG_S = (360.0, 300.0, 360.0, 381.2, 388.3, 615.1)
ACCELERATION_DEG_S2 = Options().acceleration_deg_s2

Row = tuple[float, ...]


class Rig:
    """A mover that has had its BCO run at `start`, and what it did since."""

    def __init__(
        self,
        start: Row = HOME,
        options: Options | None = None,
        mode: str = "EX",
        bco: bool = True,
    ) -> None:
        self.events: list[Event] = []
        self.mover = Mover(start, self.events.append, options or Options())
        self.mover.mode = mode
        if bco:
            self.mover.feed(Block(0, ptp(start).motion))
            self.mover.advance(0.1)
            assert self.mover.start()
        self.events.clear()
        self.start_s = self.mover.time_s
        self.rows: list[Row] = [self.mover.joints_deg]

    def go(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.mover.advance(STEP_S)
            self.rows.append(self.mover.joints_deg)

    def until(self, done: Callable[[], bool], limit_s: float = 60.0) -> float:
        start_s = self.mover.time_s
        while not done():
            assert self.mover.time_s - start_s < limit_s, "it did not happen"
            self.go(STEP_S)
        return self.mover.time_s - start_s

    def rest(self, limit_s: float = 60.0) -> float:
        return self.until(lambda: not self.mover.moving, limit_s)

    def kinds(self, *kinds: Kind) -> list[tuple[Kind, int]]:
        return [(e.kind, e.tag) for e in self.events if not kinds or e.kind in kinds]

    def first(self, kind: Kind, tag: int | None = None) -> Event:
        return next(e for e in self.events if e.kind == kind and tag in (None, e.tag))

    def speeds(self) -> list[Row]:
        return [
            tuple((y - x) / STEP_S for x, y in zip(a, b, strict=True))
            for a, b in pairwise(self.rows)
        ]

    def accelerations(self) -> list[Row]:
        zero = (0.0,) * 6
        return [
            tuple((y - x) / STEP_S for x, y in zip(a, b, strict=True))
            for a, b in pairwise([zero, *self.speeds(), zero])
        ]

    def assert_smooth(self, share: float = 1.0, factor: float = 1.0) -> None:
        """No axis faster than its maximum, none accelerated beyond `share` of 100 %."""
        for row in self.speeds():
            for value, limit in zip(row, SPEED_DEG_S, strict=True):
                assert abs(value) <= limit * factor * (1.0 + 1e-6) + 1e-6
        for row in self.accelerations():
            for value, limit in zip(row, ACCELERATION_DEG_S2, strict=True):
                assert abs(value) <= limit * share * (1.0 + 1e-6) + 1e-5


def ptp(
    target: Row,
    tag: int = 1,
    velocity: float = 100.0,
    acceleration: float = 100.0,
    words: tuple[str, ...] = (),
    apo: Apo | None = None,
    triggers: tuple[Trigger, ...] = (),
) -> Block:
    motion = Ptp(target, (velocity,) * 6, (acceleration,) * 6)
    return Block(tag, motion, words, apo or Apo(), triggers)


def plus(start: Row, *steps: float) -> Row:
    """`start` with the first axes turned by `steps`."""
    return tuple(q + (steps[i] if i < len(steps) else 0.0) for i, q in enumerate(start))
