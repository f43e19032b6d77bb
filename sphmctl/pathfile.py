"""The path file: named points and moves, still in millimetres and degrees; knows no robot."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from sphmctl.yamlfile import (
    ANGLE_LIMIT_DEG,
    STRICT,
    Document,
    Loc,
    Numbers,
    Pose,
    Version,
    check_numbers,
    check_pose,
    load,
    nearest,
    shown,
    wrong,
)

Kind: TypeAlias = Literal["ptp", "lin", "dwell_s"]

POLICIES = ("cranks", "fixed", "auto")
"""Wrist policies that the planner can do."""

LATER_POLICIES = ("level", "tilt")
"""Wrist policies that are promised for a later version."""

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.+-]{0,63}")
"""Names end up in folder names and tables."""

DWELL_LIMIT_S = 3600.0
"""One hour; a longer rest is two runs."""


@dataclass(frozen=True)
class Speed:
    """How fast: the tool on straight lines, the joints (% of their limits) in other moves."""

    tcp_mm_s: float = 100.0
    tcp_mm_s2: float = 500.0
    joint_percent: float = 20.0
    joint_acceleration_percent: float = 20.0


@dataclass(frozen=True)
class Wrist:
    """Where the crank angles come from.

    Attributes:
        policy: "cranks" (as the points say), "fixed" (they stay), "auto" (chosen at each point).
        cranks_deg: for "fixed": the angles to keep; None: those at the move's start.
    """

    policy: str = "cranks"
    cranks_deg: Numbers | None = None


@dataclass(frozen=True)
class Point:
    """A place to go to: a pose of the tool in the base, or nine joint angles.

    Attributes:
        name: "" for a point written inside its move.
        pose: x, y, z mm and A, B, C deg (KUKA's R = Rz(A) Ry(B) Rx(C)), or None.
        joints_deg: A1..A6, theta7..theta9, or None.
        cranks_deg: theta7..theta9 that go with `pose`, or None.
    """

    name: str
    pose: Numbers | None = None
    joints_deg: Numbers | None = None
    cranks_deg: Numbers | None = None


@dataclass(frozen=True)
class Move:
    """One move of a path.

    Attributes:
        number: from 1.
        line: where it stands in the file.
        kind: "ptp", "lin" or "dwell_s".
        point: where it goes; None for a rest.
        dwell_s: how long it rests; 0 for a motion.
    """

    number: int
    line: int
    kind: Kind
    point: Point | None
    dwell_s: float
    speed: Speed
    wrist: Wrist

    @property
    def title(self) -> str:
        """`move 3 (lin to C)`."""
        if self.point is None:
            return f"move {self.number} (dwell {self.dwell_s:g} s)"
        return (
            f"move {self.number} ({self.kind}{f' to {self.point.name}' if self.point.name else ''})"
        )

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


def load_path(path: str | FilePath) -> Path:
    """Read a path file.

    Raises:
        InvalidError: with file, line, column, field, value and what would be right.
    """
    model, document = load(path, _PathModel)
    points = {name: _point(name, item) for name, item in model.points.items()}
    return Path(
        model.name,
        model.tool,
        model.base,
        tuple(
            _move(document, index, item, model, points) for index, item in enumerate(model.moves)
        ),
        points,
        document.file,
        document.line(("tool",)),
        document.line(("base",)),
    )


def _name(value: str) -> str:
    if not NAME.fullmatch(value):
        raise wrong(
            f"{shown(value)} is no name; use up to 64 letters, digits, spaces and _ . + -, "
            "with a letter or digit first"
        )
    return value


def _policy(value: Any) -> Any:
    if isinstance(value, str):
        return {"policy": value}
    return value


def _target(value: Any) -> Any:
    if isinstance(value, str):
        return {"point": value}
    if not isinstance(value, dict):
        raise wrong(f"{shown(value)} should be a point's name or {{pose: ...}}")
    if "point" in value:
        raise wrong("write the point's name itself, with 'speed:' and 'wrist:' beside the move")
    return value


def _base(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if not isinstance(value, tuple) or not all(type(item) in (int, float) for item in value):
        raise wrong(f"{shown(value)} should be a frame's name or six numbers [x, y, z, a, b, c]")
    return check_pose(tuple(float(item) for item in value))


def _cranks(values: Numbers) -> Numbers:
    return check_numbers(values, 3, "theta7, theta8, theta9 in degrees", ANGLE_LIMIT_DEG)


def _joints(values: Numbers) -> Numbers:
    return check_numbers(values, 9, "a1 to a6, theta7 to theta9 in degrees", ANGLE_LIMIT_DEG)


def _check_point(pose: Numbers | None, joints: Numbers | None, cranks: Numbers | None) -> None:
    if (pose is None) == (joints is None):
        raise wrong("give a point either 'pose' or 'joints_deg'")
    if joints is not None and cranks is not None:
        raise wrong("'joints_deg' holds the cranks already; leave this out", "cranks_deg")


Cranks: TypeAlias = Annotated[Numbers, AfterValidator(_cranks)]
Joints: TypeAlias = Annotated[Numbers, AfterValidator(_joints)]
Name: TypeAlias = Annotated[str, AfterValidator(_name)]


class _SpeedModel(BaseModel):
    model_config = STRICT
    tcp_mm_s: Annotated[float, Field(ge=0.1, le=10_000)] | None = None
    tcp_mm_s2: Annotated[float, Field(ge=1, le=100_000)] | None = None
    joint_percent: Annotated[float, Field(ge=0.1, le=100)] | None = None
    joint_acceleration_percent: Annotated[float, Field(ge=0.1, le=100)] | None = None

    def over(self, speed: Speed) -> Speed:
        """`speed` with what is given here in its place."""
        return replace(speed, **self.model_dump(exclude_none=True))


class _WristModel(BaseModel):
    model_config = STRICT
    policy: str
    cranks_deg: Cranks | None = None

    @model_validator(mode="after")
    def _check(self) -> _WristModel:
        known = "available are " + ", ".join(POLICIES)
        if self.policy in LATER_POLICIES:
            raise wrong(f"the wrist policy '{self.policy}' is not available yet; {known}")
        if self.policy not in POLICIES:
            hint = nearest(self.policy, POLICIES)
            raise wrong(f"{shown(self.policy)} is no wrist policy{hint}; {known}")
        if self.cranks_deg is not None and self.policy != "fixed":
            raise wrong("only the policy 'fixed' takes 'cranks_deg'", "cranks_deg")
        return self


Policy: TypeAlias = Annotated[_WristModel, BeforeValidator(_policy)]


class _PointModel(BaseModel):
    model_config = STRICT
    pose: Pose | None = None
    joints_deg: Joints | None = None
    cranks_deg: Cranks | None = None

    @model_validator(mode="after")
    def _check(self) -> _PointModel:
        _check_point(self.pose, self.joints_deg, self.cranks_deg)
        return self


class _TargetModel(BaseModel):
    model_config = STRICT
    point: Annotated[str | None, Field(exclude=True)] = None
    pose: Pose | None = None
    joints_deg: Joints | None = None
    cranks_deg: Cranks | None = None
    speed: _SpeedModel | None = None
    wrist: Policy | None = None

    @model_validator(mode="after")
    def _check(self) -> _TargetModel:
        if self.point is None:
            _check_point(self.pose, self.joints_deg, self.cranks_deg)
        return self


Target: TypeAlias = Annotated[_TargetModel, BeforeValidator(_target)]


class _MoveModel(BaseModel):
    model_config = STRICT
    ptp: Target | None = None
    lin: Target | None = None
    dwell_s: Annotated[float, Field(gt=0, le=DWELL_LIMIT_S)] | None = None
    speed: _SpeedModel | None = None
    wrist: Policy | None = None

    @model_validator(mode="after")
    def _check(self) -> _MoveModel:
        kinds = [item for item in (self.ptp, self.lin, self.dwell_s) if item is not None]
        if len(kinds) != 1:
            raise wrong("a move is one of 'ptp: ...', 'lin: ...' or 'dwell_s: ...'")
        if self.dwell_s is not None and (self.speed or self.wrist):
            raise wrong("a rest takes neither 'speed' nor 'wrist'")
        target = self.ptp or self.lin
        for key in ("speed", "wrist"):
            if getattr(self, key) and target and getattr(target, key):
                raise wrong(f"'{key}' is given twice: inside the point and beside it", key)
        return self


class _PathModel(BaseModel):
    model_config = STRICT
    version: Version
    name: Name
    tool: str | None = None
    base: Annotated[Any, BeforeValidator(_base)] = "world"
    speed: _SpeedModel = _SpeedModel()
    wrist: Policy = _WristModel(policy="cranks")
    points: dict[str, _PointModel] = {}
    moves: Annotated[tuple[_MoveModel, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> _PathModel:
        for name in self.points:
            if not NAME.fullmatch(name):
                raise wrong(f"{shown(name)} is no name for a point", "points", name)
        if self.moves[0].ptp is None:
            raise wrong("a path begins with 'ptp: ...' to its start", "moves", 0)
        return self


def _point(name: str, item: _PointModel | _TargetModel) -> Point:
    return Point(name, item.pose, item.joints_deg, item.cranks_deg)


def _move(
    document: Document, index: int, item: _MoveModel, model: _PathModel, points: dict[str, Point]
) -> Move:
    line = document.line(("moves", index))
    speed = model.speed.over(Speed())
    if item.dwell_s is not None:
        return Move(index + 1, line, "dwell_s", None, item.dwell_s, speed, Wrist())
    kind: Kind = "ptp" if item.ptp is not None else "lin"
    target = item.ptp or item.lin
    assert target is not None  # the model checked it
    loc: Loc = ("moves", index, kind)
    if target.point is None:
        point = _point("", target)
    elif target.point in points:
        point = points[target.point]
    else:
        known = tuple(points)
        hint = nearest(target.point, known) or f"; known are {', '.join(known) or 'none'}"
        raise document.error(loc, f"there is no point {shown(target.point)}{hint}")
    own_speed, own_wrist = item.speed or target.speed, item.wrist or target.wrist or model.wrist
    wrist = Wrist(own_wrist.policy, own_wrist.cranks_deg)
    if wrist.policy == "cranks" and point.pose is not None and point.cranks_deg is None:
        raise document.error(
            loc, "the wrist policy 'cranks' needs 'cranks_deg' at this point, or choose another"
        )
    return Move(
        index + 1, line, kind, point, 0.0, own_speed.over(speed) if own_speed else speed, wrist
    )
