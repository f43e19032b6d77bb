"""The wrist's cycle at fixed instants, from arming to disarming; knows no plan.

A cycle that is late is told and not made up for.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Protocol

from sphmctl.daemon.record import Events
from sphmctl.drivers.board import BoardState
from sphmctl.drivers.wrist import Wrist, WristState
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats

CYCLE_S = 0.010
"""The wrist's cycle: behind an ATmega16U2 one exchange lasts up to 6.1 ms, so 100 Hz is safe."""

LATE_S = CYCLE_S
"""A cycle that begins later than this is an event: an instant was missed."""


class GoalSource(Protocol):
    """Where the wrist's goals come from, and where its feedback goes."""

    def goals(self, now_s: float) -> Floats:
        """Crank goals to send now, rad, shape (3,)."""

    def observe(self, state: WristState) -> None:
        """Take one cycle's feedback."""


class Hold:
    """The cranks stay where they are."""

    def __init__(self, cranks: Floats) -> None:
        self._cranks = cranks

    def goals(self, now_s: float) -> Floats:
        """Always the same."""
        return self._cranks

    def observe(self, state: WristState) -> None:
        """Nothing to learn at rest."""


class WristLoop:
    """Exchanges goals and feedback with the wrist at fixed instants, from arming to disarming.

    Args:
        wrist: armed.
        cranks: where they are held at first, rad, shape (3,).
        events: where to report.
        on_board: given the newest state of the board, if there is one, once a cycle.
    """

    def __init__(
        self,
        wrist: Wrist,
        cranks: Floats,
        events: Events,
        on_board: Callable[[BoardState], None] | None = None,
    ) -> None:
        self._wrist = wrist
        self._events = events
        self._on_board = on_board
        self._ending = False
        self.source: GoalSource = Hold(cranks)
        self.latest: WristState | None = None
        self.goal = cranks
        self.late_cycles = 0
        self.fault: str | None = None

    def hold(self) -> None:
        """Stay at the last goal from now on."""
        self.source = Hold(self.goal)

    def end(self) -> None:
        """Leave after the present cycle."""
        self._ending = True

    async def run(self) -> None:
        """Cycle until `end`; a lost port, or a mistake of ours, becomes `fault`."""
        try:
            await self._cycle()
        except DeviceError as error:
            self.fault = str(error)
        except Exception as error:
            # This task must not die unseen: the arm would drive on without the wrist.
            self.fault = f"the wrist's loop failed: {error!r}"
        if self.fault:
            self._events.add("wrist lost", message=self.fault)

    async def _cycle(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while not self._ending:
            late_s = loop.time() - due_s
            if late_s > LATE_S:
                self.late_cycles += 1
                self._events.add("late cycle", late_ms=round(1000.0 * late_s, 3))
                # A missed instant is not made up for.
                due_s += math.floor(late_s / CYCLE_S) * CYCLE_S
            self.goal = self.source.goals(loop.time())
            self.latest = await self._wrist.exchange(self.goal)
            self.source.observe(self.latest)
            if self._on_board is not None and self.latest.board is not None:
                self._on_board(self.latest.board)
            due_s += CYCLE_S
            await asyncio.sleep(max(0.0, due_s - loop.time()))
