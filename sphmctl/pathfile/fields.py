"""Values of the path file's fields: what each may be, and the short ways to write it."""

from __future__ import annotations

import re
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, Field

from sphmctl.yamlfile import (
    ANGLE_LIMIT_DEG,
    POSITION_LIMIT_MM,
    Numbers,
    check_numbers,
    check_pose,
    shown,
    wrong,
)

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.+-]{0,63}")
"""Names end up in folder names and tables."""

TURN_LIMIT_DEG = 36_000.0
"""A hundred turns; more is a mistake, and long to look at point by point."""

BLEND_LIMIT_MM = 1000.0
"""More than the arm's reach."""

HEAVE_LIMIT_MM = 200.0
"""Twice the wrist's own; whether it can is the planner's to say."""

TILT_LIMIT_DEG = 90.0
"""A platform on its edge."""


def check_name(value: str) -> str:
    """A name, if it is one."""
    if not NAME.fullmatch(value):
        raise wrong(
            f"{shown(value)} is no name; use up to 64 letters, digits, spaces and _ . + -, "
            "with a letter or digit first"
        )
    return value


def as_policy(value: Any) -> Any:
    """A policy by its name alone."""
    if isinstance(value, str):
        return {"policy": value}
    return value


def as_rule(value: Any) -> Any:
    """A rule for the orientation by its name alone."""
    if isinstance(value, str):
        if value == "normal_to":
            raise wrong("write {normal_to: plane, normal: [...]}, or with cylinder or sphere")
        return {"rule": value}
    if isinstance(value, dict) and "rule" in value:
        raise wrong("write the rule's name itself: fixed, interpolated or tangent")
    return value


def as_target(value: Any) -> Any:
    """A point's name, or a point with the move's keys."""
    if isinstance(value, str):
        return {"point": value}
    if not isinstance(value, dict):
        raise wrong(f"{shown(value)} should be a point's name or {{pose: ...}}")
    if "point" in value:
        raise wrong("write the point's name itself, with 'speed:' and 'wrist:' beside the move")
    return value


def as_place(value: Any) -> Any:
    """A point by its name, as numbers, or as a named one is written."""
    if isinstance(value, str):
        return {"point": value}
    if isinstance(value, tuple):
        return {"pose": value} if len(value) == 6 else {"xyz_mm": value}
    if not isinstance(value, dict) or "point" in value or "xyz_mm" in value:
        raise wrong(
            f"{shown(value)} should be a point's name, [x, y, z], [x, y, z, a, b, c] or "
            "{pose: ...}"
        )
    return value


def as_span(value: Any) -> Any:
    """One number for begin and end, or both."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (float(value), float(value))
    if not isinstance(value, tuple) or len(value) != 2:
        raise wrong(f"{shown(value)} should be a number or [at the begin, at the end]")
    return value


def as_base(value: Any) -> Any:
    """A frame's name or a pose."""
    if isinstance(value, str):
        return value
    if not isinstance(value, tuple) or not all(type(item) in (int, float) for item in value):
        raise wrong(f"{shown(value)} should be a frame's name or six numbers [x, y, z, a, b, c]")
    return check_pose(tuple(float(item) for item in value))


def _cranks(values: Numbers) -> Numbers:
    return check_numbers(values, 3, "theta7, theta8, theta9 in degrees", ANGLE_LIMIT_DEG)


def _joints(values: Numbers) -> Numbers:
    return check_numbers(values, 9, "a1 to a6, theta7 to theta9 in degrees", ANGLE_LIMIT_DEG)


def _xyz(values: Numbers) -> Numbers:
    return check_numbers(values, 3, "x, y, z in mm", POSITION_LIMIT_MM)


def _direction(values: Numbers) -> Numbers:
    check_numbers(values, 3, "x, y, z of a direction", POSITION_LIMIT_MM)
    if max(abs(value) for value in values) < 1e-9:
        raise wrong(f"{shown(values)} has no direction; give for example [0, 0, 1]")
    return values


def _pitch(value: float) -> float:
    if value <= 0.0:
        raise wrong(
            f"{value:g} is no pitch; give the rise per turn as a positive number, and turn "
            "'normal' round to go the other way"
        )
    return value


def _turn(value: float) -> float:
    if value == 0.0:
        raise wrong("0 degrees is no turn; give for example 360")
    return value


def check_point(pose: Numbers | None, joints: Numbers | None, cranks: Numbers | None) -> None:
    """Refuse a point that is given twice or not at all."""
    if (pose is None) == (joints is None):
        raise wrong("give a point either 'pose' or 'joints_deg'")
    if joints is not None and cranks is not None:
        raise wrong("'joints_deg' holds the cranks already; leave this out", "cranks_deg")


Cranks: TypeAlias = Annotated[Numbers, AfterValidator(_cranks)]
Joints: TypeAlias = Annotated[Numbers, AfterValidator(_joints)]
Name: TypeAlias = Annotated[str, AfterValidator(check_name)]
Xyz: TypeAlias = Annotated[Numbers, AfterValidator(_xyz)]
Direction: TypeAlias = Annotated[Numbers, AfterValidator(_direction)]
Turn: TypeAlias = Annotated[
    float, Field(ge=-TURN_LIMIT_DEG, le=TURN_LIMIT_DEG), AfterValidator(_turn)
]
Heave: TypeAlias = Annotated[float, Field(ge=0.0, le=HEAVE_LIMIT_MM)]
Tilt: TypeAlias = Annotated[float, Field(ge=0.0, le=TILT_LIMIT_DEG)]
Pitch: TypeAlias = Annotated[float, Field(le=POSITION_LIMIT_MM), AfterValidator(_pitch)]
Blend: TypeAlias = Annotated[float, Field(gt=0.0, le=BLEND_LIMIT_MM)]
