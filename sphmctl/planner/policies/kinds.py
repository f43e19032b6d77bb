"""The wrist policies by name: what each holds, as data.

The arm has six joints and a tool pose takes them all, so the wrist's three are free. A policy says
what is done with them. `n` is the number of rows of the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from sphmctl.motion import Floats


@dataclass(frozen=True)
class Cranks:
    """The crank angles themselves, row by row: rad, (n, 3)."""

    cranks: Floats


@dataclass(frozen=True)
class Fixed:
    """One set of crank angles for the whole path: rad, (3,). The wrist is then a rigid tool."""

    cranks: Floats


@dataclass(frozen=True)
class Level:
    """The platform stays parallel to the flange: the three cranks are equal.

    Attributes:
        heave_m: height of the platform over the wrist's base plane, (n,); None leaves it free: it
            is then chosen along the whole path, from the start's on, so that the arm moves little.
    """

    heave_m: Floats | None = None


@dataclass(frozen=True)
class Tilt:
    """The flange keeps an orientation and the wrist tilts the tool.

    The wrist has no torsion, so it cannot hold the flange's turn about its own axis as well: the
    flange's z stays where it is, and the flange turns about it as the tool's orientation asks for.

    Attributes:
        flange: (3, 3), in the arm's base frame; only its z counts. None keeps that of the start, or
            without a start the platform's at the first row (the wrist is then level there).
        heave_m: (n,), as for `Level`.
    """

    flange: Floats | None = None
    heave_m: Floats | None = None


@dataclass(frozen=True)
class Motion:
    """A motion of the platform on the flange, row by row, each (n,).

    Attributes:
        heave_m: height of the platform over the wrist's base plane.
        tilt_rad: the angle between the platform's normal and the flange's.
        direction_rad: where the normal leans, from leg 1 about the flange's z.
    """

    heave_m: Floats
    tilt_rad: Floats
    direction_rad: Floats


@dataclass(frozen=True)
class Auto:
    """The planner chooses arm branch and crank angles together, best along the whole path.

    Attributes:
        also: other policies whose answer is to be considered beside those of `Level` and `Tilt`:
            `Auto` is at least as good as each of them, by its own cost, and finds a way where one
            of them does.
    """

    also: tuple[Known | Level | Tilt, ...] = ()


Known: TypeAlias = Cranks | Fixed | Motion
Policy: TypeAlias = Known | Level | Tilt | Auto
