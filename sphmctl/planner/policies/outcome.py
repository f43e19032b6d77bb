"""What resolving the nine joints gives: joints for every row, or reasons with their rows."""

from __future__ import annotations

from dataclasses import dataclass

from sphmctl.errors import Problem
from sphmctl.motion import Floats


@dataclass(frozen=True)
class Resolved:
    """Nine joints for every row.

    Attributes:
        joints: rad, (n, 9); continuous, within the ranges, each row on its target.
        steep: rows after which a joint moves so far before the next row (0.2 rad) that the way
            between was looked at by itself: it is continuous, but finer rows would show it better.
        cost: what `Auto` compares answers by; see `cost.along`.
    """

    joints: Floats
    steep: tuple[int, ...]
    cost: float


@dataclass(frozen=True)
class Reason:
    """Why a row cannot be reached; `problem.where` is empty, the caller knows the place."""

    row: int
    problem: Problem


@dataclass(frozen=True)
class Unresolved:
    """No way: reasons by rising row, at least one, one for each joint beyond its range."""

    reasons: tuple[Reason, ...]

    @property
    def row(self) -> int:
        """How far the path can be followed."""
        return self.reasons[0].row

    @property
    def problem(self) -> Problem:
        """What ends it there."""
        return self.reasons[0].problem


Outcome = Resolved | Unresolved
