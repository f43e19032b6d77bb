"""What a path file says, as plain data: millimetres, degrees, lines and columns of the file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sphmctl.yamlfile import Numbers

Kind: TypeAlias = Literal["ptp", "lin", "dwell_s", "arc", "circle", "helix", "spline", "polyline"]

Rule: TypeAlias = Literal["interpolated", "fixed", "tangent", "normal_to"]

Surface: TypeAlias = Literal["plane", "cylinder", "sphere"]

Range: TypeAlias = tuple[float, float]
"""A quantity at a move's begin and at its end."""


@dataclass(frozen=True)
class Speed:
    """How fast: the tool on its path, the joints (% of their limits) in other moves."""

    tcp_mm_s: float = 100.0
    tcp_mm_s2: float = 500.0
    joint_percent: float = 20.0
    joint_acceleration_percent: float = 20.0


@dataclass(frozen=True)
class Wrist:
    """How the three free joints are used.

    Attributes:
        policy: "cranks" (as the points say), "fixed" (they stay), "level" (the platform stays level
            on the flange), "tilt" (the flange keeps its orientation), "motion" (heave and tilt as
            given here), "auto" (chosen by the planner).
        cranks_deg: for "fixed": the angles to keep; None: those at the move's start.
        heave_mm: for "level" and "motion": at begin and end; None: free. A ptp takes the begin's.
        tilt_deg: for "motion": at begin and end. A ptp takes the begin's.
        tilt_turns: for "motion": how often the tilt's direction turns round along the move.
        tilt_towards_deg: for "motion": its direction at the begin, about the wrist's z from leg 1.
    """

    policy: str = "cranks"
    cranks_deg: Numbers | None = None
    heave_mm: Range | None = None
    tilt_deg: Range = (0.0, 0.0)
    tilt_turns: float = 0.0
    tilt_towards_deg: float = 0.0


@dataclass(frozen=True)
class Orientation:
    """How the tool is turned along a move.

    Attributes:
        rule: "interpolated" (the shortest turn to the end's), "fixed" (the begin's), "tangent" (it
            turns with the path), "normal_to" (its z stands against a surface's outward normal).
        surface: for "normal_to".
        centre_mm: of the sphere, or any point on the cylinder's axis.
        axis: the plane's normal or the cylinder's axis, of any length.
        inside: the tool works from inside: its z points away from centre or axis.
    """

    rule: Rule = "interpolated"
    surface: Surface = "plane"
    centre_mm: Numbers = (0.0, 0.0, 0.0)
    axis: Numbers = (0.0, 0.0, 1.0)
    inside: bool = False


@dataclass(frozen=True)
class Point:
    """A place to go to: a pose of the tool in the base, nine joint angles, or a mere position.

    Attributes:
        name: "" for a point written inside its move.
        pose: x, y, z mm and A, B, C deg (KUKA's R = Rz(A) Ry(B) Rx(C)), or None.
        joints_deg: A1..A6, theta7..theta9, or None.
        cranks_deg: theta7..theta9 that go with `pose`, or None.
        xyz_mm: a position whose orientation is that of the point before it, or None.
    """

    name: str
    pose: Numbers | None = None
    joints_deg: Numbers | None = None
    cranks_deg: Numbers | None = None
    xyz_mm: Numbers | None = None


@dataclass(frozen=True)
class Arc:
    """Part of a circle through a point to the move's `point`; only the place of `via` counts."""

    via: Point


@dataclass(frozen=True)
class Circle:
    """The full circle through the present point and two others, back to the present one."""

    via: tuple[Point, Point]


@dataclass(frozen=True)
class Helix:
    """A turn about an axis from the present point on, which stays at its distance from it.

    Attributes:
        centre: any point on the axis.
        normal: the axis, of any length; positive angles turn about it by the right-hand rule.
        turn_deg: how far.
        pitch_mm: rise along the normal per turn in the sense of `turn_deg`; 0 is a circle.
    """

    centre: Point
    normal: Numbers
    turn_deg: float
    pitch_mm: float = 0.0


@dataclass(frozen=True)
class Spline:
    """A smooth curve from the present point through these; closed: back to the present one."""

    through: tuple[Point, ...]
    closed: bool


@dataclass(frozen=True, eq=False)
class Polyline:
    """Straight lines from the present point through the rows of a CSV file.

    Attributes:
        file: its name as it was opened.
        lines: the line of each row in it, (n,).
        xyz_mm: (n, 3).
        abc_deg: (n, 3), or None.
        cranks_deg: (n, 3), or None.
    """

    file: str
    lines: NDArray[np.int64]
    xyz_mm: NDArray[np.float64]
    abc_deg: NDArray[np.float64] | None
    cranks_deg: NDArray[np.float64] | None


Course: TypeAlias = Arc | Circle | Helix | Spline | Polyline


@dataclass(frozen=True)
class Move:
    """One move of a path.

    Attributes:
        number: from 1.
        line: where it stands in the file.
        kind: what it is.
        point: where it goes; None for a rest, and for moves whose end their course gives.
        dwell_s: how long it rests; 0 for a motion.
        course: the way to the end, for moves other than ptp, lin and dwell_s.
        blend_mm: how far from its end the corner with the next move begins; 0: it stops there.
        column: where it stands in its line.
    """

    number: int
    line: int
    kind: Kind
    point: Point | None
    dwell_s: float
    speed: Speed
    wrist: Wrist
    course: Course | None = None
    orientation: Orientation = Orientation()
    blend_mm: float = 0.0
    column: int = 1

    @property
    def draws(self) -> bool:
        """Whether the tool follows a path: everything but ptp and a rest."""
        return self.kind not in ("ptp", "dwell_s")

    @property
    def title(self) -> str:
        """`move 3 (lin to C)`."""
        if self.kind == "dwell_s":
            return f"move {self.number} (dwell {self.dwell_s:g} s)"
        name = self.point.name if self.point else ""
        return f"move {self.number} ({self.kind}{f' to {name}' if name else ''})"

    @property
    def where(self) -> str:
        """`line 12, move 3 (lin to C)`."""
        return f"line {self.line}, {self.title}"


@dataclass(frozen=True)
class Path:
    """A path file's content.

    Attributes:
        tool: a tool of the cell, or None for the platform centre O7.
        base: a frame of the cell, or x, y, z mm and A, B, C deg.
        file: where it came from.
        tool_line: where `tool` stands in the file.
        base_line: where `base` stands in the file.
    """

    name: str
    tool: str | None
    base: str | Numbers
    moves: tuple[Move, ...]
    points: dict[str, Point]
    file: str
    tool_line: int
    base_line: int
