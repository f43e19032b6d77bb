"""A controller on a hand-moved clock, and what a well-behaved daemon would write to it."""

from __future__ import annotations

import random

from sphmctl.emulators.controller import Controller, Options
from sphmctl.emulators.krl_text import Value
from sphmctl.emulators.world import World

HOME = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
RUN, HOLD, STOP = 1, 2, 3
IDLE, READY, RUNNING, HOLDING, STOPPED, ENDED, FAULT = range(7)


class Rig:
    """A controller; `beating` writes a new heartbeat every 40 ms, as a living daemon does."""

    def __init__(self, options: Options | None = None, seed: int = 1) -> None:
        self.now_s = 500.0
        self.world = World(lambda: self.now_s)
        self.controller = Controller(self.world, random.Random(seed), options)
        self.beating = True
        self.truth: list[tuple[float, ...]] = []
        self._beat = 0
        self.world.watch(self._row, lambda _, row: self.truth.append(row))

    def _row(self) -> tuple[float, ...]:
        return (*self.controller.true_joints_deg(), 0.0, 0.0, 0.0)

    def wait_ms(self, time_ms: int) -> None:
        """Let time pass, writing heartbeats."""
        for _ in range(time_ms):
            self.now_s += 0.001
            self.world.advance()
            if self.beating and self.world.index % 40 == 0:
                self._beat += 1
                self.write("SPH_BEAT", str(self._beat))

    def write(self, name: str, text: str) -> None:
        """Write a variable that must accept it."""
        assert self.controller.store.write_text(name, text), f"{name} = {text} was refused"

    def read(self, name: str) -> str | None:
        """A variable's text at this instant."""
        self.world.advance()
        return self.controller.store.read_text(name)

    def state(self, field: str) -> Value:
        """A field of SPH_STATE at this instant."""
        self.world.advance()
        state = self.controller.store.get("SPH_STATE")
        assert isinstance(state, dict)
        value: Value = state[field]
        return value

    def session(self, number: int = 1) -> None:
        """Begin a session and wait until it is taken."""
        for name in ("SPH_CMD", "SPH_WR", "SPH_LAST"):
            self.write(name, "0")
        self.write("SPH_SESSION", str(number))
        self.wait_for(number, 40, "SESSION")
        assert self.state("STATUS") == READY

    def knot(
        self,
        number: int,
        joints_deg: tuple[float, ...],
        velocity: float = 50.0,
        acceleration: float = 100.0,
    ) -> None:
        """Write one knot and announce it."""
        axes = ", ".join(f"A{axis} {q:.6f}" for axis, q in enumerate(joints_deg, start=1))
        external = ", ".join(f"E{axis} 0.0" for axis in range(1, 7))
        self.write(
            f"SPH_KNOT[{(number - 1) % 64 + 1}]",
            f"{{SPH_KNOT_T: SEQ {number}, VEL {velocity}, ACC {acceleration}, "
            f"Q {{E6AXIS: {axes}, {external}}}}}",
        )
        self.write("SPH_WR", str(number))

    def command(self, number: int) -> None:
        """Write SPH_CMD."""
        self.write("SPH_CMD", str(number))

    def wait_for(self, value: int, limit_ms: int = 5000, field: str = "STATUS") -> None:
        """Wait until a field of SPH_STATE is `value`."""
        for _ in range(limit_ms):
            if self.state(field) == value:
                return
            self.wait_ms(1)
        raise AssertionError(f"{field} is {self.state(field)} and not {value}")

    def wait_for_value(self, name: str, text: str, limit_ms: int = 500) -> None:
        """Wait until a variable is shown as `text`."""
        for _ in range(limit_ms):
            if self.read(name) == text:
                return
            self.wait_ms(1)
        raise AssertionError(f"{name} is {self.read(name)} and not {text}")


def away(angle_deg: float, axis: int = 0) -> tuple[float, ...]:
    """HOME with one axis turned by `angle_deg`."""
    return tuple(q + angle_deg * (n == axis) for n, q in enumerate(HOME))
