"""A plan that waits while an interrupt routine moves the arm by itself. State only."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from sphmctl.emulators.motion.run import Run
from sphmctl.emulators.motion.triggers import Waiting


@dataclass(frozen=True)
class Aside:
    """What the mover keeps of it.

    Attributes:
        run: the block that was interrupted; `back` the way back to a path that was left before.
        queue: the blocks behind it.
    """

    run: Run | None
    back: Run | None
    queue: deque[Run]
    triggers: Waiting

    @property
    def bco(self) -> bool:
        """Whether a block coincidence run is among it."""
        return any(run.bco for run in (self.run, *self.queue) if run is not None)
