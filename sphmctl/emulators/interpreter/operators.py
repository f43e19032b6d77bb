"""What KRL's operators compute, by the types of their operands.

No operator leaves its right side out: both sides of AND and OR are looked at.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from sphmctl.emulators.interpreter.faults import OUT_OF_RANGE, KrlFaultError, invalid
from sphmctl.emulators.interpreter.values import is_set, real, whole
from sphmctl.emulators.motion.frames import Frame as Pose6
from sphmctl.emulators.motion.frames import chained, frame_of, pose_of

Binary = Callable[[Any, Any], Any]

PLACE_PARTS = ("X", "Y", "Z", "A", "B", "C")


def _divide_int(a: int, b: int) -> int:
    """INT by INT cuts off toward 0 (SI, "Arithmetic operators")."""
    if b == 0:
        raise KrlFaultError(OUT_OF_RANGE, "division by 0")
    quotient = abs(a) // abs(b)
    return whole(quotient if (a < 0) == (b < 0) else -quotient)


def _divide_real(a: float, b: float) -> float:
    if b == 0:
        raise KrlFaultError(OUT_OF_RANGE, "division by 0")
    return real(a / b)


INTEGER: dict[str, Binary] = {
    "+": lambda a, b: whole(a + b),
    "-": lambda a, b: whole(a - b),
    "*": lambda a, b: whole(a * b),
    "/": _divide_int,
}

SINGLE: dict[str, Binary] = {
    "+": lambda a, b: real(a + b),
    "-": lambda a, b: real(a - b),
    "*": lambda a, b: real(a * b),
    "/": _divide_real,
}

BITS: dict[str, Binary] = {"B_AND": operator.and_, "B_OR": operator.or_, "B_EXOR": operator.xor}

LOGIC: dict[str, Binary] = {
    "AND": lambda a, b: a and b,
    "OR": lambda a, b: a or b,
    "EXOR": operator.ne,
}

COMPARE: dict[str, Binary] = {
    "==": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


def mixed(name: str) -> Binary:
    """Arithmetic of two numbers whose types show only as they come."""
    integer, single = INTEGER[name], SINGLE[name]

    def compute(a: Any, b: Any) -> Any:
        both = isinstance(a, int) and isinstance(b, int)
        return integer(a, b) if both else single(a, b)

    return compute


def place_of(value: Any, what: str) -> Pose6:
    """X..C of a frame; components that an aggregate left out count as 0 (guess).

    Raises:
        KrlFaultError: nothing of it is set.
    """
    if not is_set(value):
        raise invalid(what)
    x, y, z, a, b, c = (float(value.get(part) or 0.0) for part in PLACE_PARTS)
    return x, y, z, a, b, c


def chain(left: Any, right: Any) -> dict[str, Any]:
    """The geometric operator: the right frame seen from where the left one is seen.

    The result is of the right operand's type and has its S, T and external axes.
    """
    pose = chained(
        pose_of(place_of(left, "the left side of :")),
        pose_of(place_of(right, "the right side of :")),
    )
    made = dict(right)
    made.update(zip(PLACE_PARTS, (real(part) for part in frame_of(pose)), strict=True))
    return made
