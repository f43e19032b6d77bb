"""Who holds the arm, and how hard it brakes. State only; the mover does the motion."""

from __future__ import annotations


class Reins:
    """The arm moves while nobody holds it and the drives are on.

    Attributes:
        braked: an interrupt routine has braked and not released.
        stopped: a stop of category 0, 1 or 2, or the end of a BCO run; a start undoes it.
        drives: whether the drives are on.
        fast: whether the brake is that of BRAKE F and STOP 1.
        drives_off_at_rest: STOP 1 waits for standstill to switch the drives off.
        dropping: at standstill everything planned is forgotten.
    """

    def __init__(self) -> None:
        self.braked = False
        self.stopped = False
        self.drives = True
        self.fast = False
        self.drives_off_at_rest = False
        self.dropping = False

    @property
    def held(self) -> bool:
        """Whether the arm must come to rest, or stay there."""
        return self.braked or self.stopped or self.dropping or not self.drives

    def harden(self, fast: bool) -> None:
        """A brake under way becomes harder, never softer."""
        self.fast = fast or (self.fast and self.held)

    def stop(self, category: int) -> None:
        """A stop of category 0, 1 or 2."""
        self.harden(category < 2)
        self.stopped = True
        self.drives_off_at_rest |= category == 1
        self.drives = self.drives and category > 0

    def at_rest(self) -> None:
        """What waited for standstill."""
        if self.drives_off_at_rest:
            self.drives = False
            self.drives_off_at_rest = False
