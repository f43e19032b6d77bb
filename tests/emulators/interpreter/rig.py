"""An interpreter on a real mover, driven step by step, with little programs as text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from sphmctl.emulators.interpreter import Interpreters, Options, Panel
from sphmctl.emulators.krl.nodes import Module
from sphmctl.emulators.krl.parse import parse, read
from sphmctl.emulators.motion import Event, Mover
from sphmctl.emulators.motion import Options as MotionOptions

HOME = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
STEP_S = 0.004
CYCLE_STEPS = 3
FIRMWARE = Path(__file__).parents[3] / "firmware" / "krc"


class Rig:
    """Programs on an arm; `start` it, then let time `go`."""

    def __init__(
        self,
        *modules: Module,
        options: Options | None = None,
        motion: MotionOptions | None = None,
        mode: str = "EX",
    ) -> None:
        self.events: list[Event] = []
        self.mover = Mover(HOME, self.events.append, motion or MotionOptions())
        self.mover.mode = mode
        self.panel = Panel()
        self.steps = 0
        self.krc = Interpreters(
            modules, self.mover, self.panel, lambda: self.time_s, self.timer_ms, options
        )
        self.memory = self.krc.memory
        self.told: list[Event] = []

    @property
    def time_s(self) -> float:
        return self.steps * STEP_S

    def timer_ms(self) -> int:
        return 3_600_000 + self.steps * 4

    def step(self) -> None:
        self.steps += 1
        self.mover.advance(STEP_S)
        told = list(self.events)
        self.events.clear()
        self.told += told
        self.krc.react(told)
        if self.steps % CYCLE_STEPS == 0:
            self.krc.cycle()

    def go(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def cycles(self, count: int = 1) -> None:
        for _ in range(count * CYCLE_STEPS):
            self.step()

    def until(self, done: Callable[[], bool], limit_s: float = 30.0) -> float:
        begin = self.time_s
        while not done():
            assert self.time_s - begin < limit_s, f"it did not happen; {self.krc.messages}"
            self.step()
        return self.time_s - begin

    def run(self, name: str = "T", limit_s: float = 30.0) -> Rig:
        """Select, start and run to the end."""
        self.krc.select(name)
        assert self.krc.start()
        self.until(lambda: self.krc.state != "P_ACTIVE", limit_s)
        return self

    def get(self, name: str) -> Any:
        return self.memory.get(name)

    def text(self, name: str) -> str | None:
        return self.memory.read_text(name)


def program(body: str, *more: str, head: str = "", name: str = "T") -> Module:
    """`DEF T()` with declarations, statements and more routines."""
    lines = [f"DEF {name}()", *head.strip().splitlines(), *body.strip().splitlines(), "END", *more]
    return parse("\n".join(lines), f"{name.lower()}.src")


def config(text: str) -> Module:
    """$CONFIG.DAT."""
    return parse(f"DEFDAT $CONFIG\n{text}\nENDDAT", "$config.dat")


def shipped() -> list[Module]:
    """The files of firmware/krc."""
    files = sorted(FIRMWARE.glob("*.src")) + sorted(FIRMWARE.glob("*.dat"))
    return [read(path) for path in files]
