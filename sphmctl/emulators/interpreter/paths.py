"""`SPH_KNOT[3].Q.A1` as text to the place in a variable that it means."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from sphmctl.emulators.interpreter.values import UNSET, Box, Letter, Part
from sphmctl.emulators.krl_text import Array, Char, Struct, Text, Type

NAME = re.compile(r"\s*([A-Z_$][\w$]*)", re.IGNORECASE)
_STEP = re.compile(
    r"\s*(?:\[\s*((?:\d{1,6}\s*)?(?:,\s*(?:\d{1,6}\s*)?)*)\]|\.\s*([A-Z_$][\w$]*))",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Steps:
    """The way into a variable: names of fields and indices from 0, and the type it leads to."""

    steps: tuple[str | int, ...]
    kind: Type


def steps_of(text: str, at: int, kind: Type, bare: bool = False) -> Steps | None:
    """What stands behind a variable's name; None where it leads nowhere.

    Args:
        bare: whether an array may stand without its empty brackets.
    """
    steps: list[str | int] = []
    whole = bare
    text = text.rstrip()
    while at < len(text):
        match = _STEP.match(text, at)
        if match is None:
            return None
        at = match.end()
        indices, field = match.groups()
        if field is not None:
            inner = dict(kind.fields).get(field.upper()) if isinstance(kind, Struct) else None
            if inner is None:
                return None
            steps.append(field.upper())
            kind = inner
            continue
        for word in indices.split(","):
            if not word.strip():
                whole = True
                continue
            inner = _element(kind, int(word))
            if inner is None:
                return None
            steps.append(int(word) - 1)
            kind = inner
    is_array = isinstance(kind, Array | Text)
    return Steps(tuple(steps), kind) if whole or not is_array else None


def _element(kind: Type, index: int) -> Type | None:
    if isinstance(kind, Array) and 1 <= index <= kind.size:
        return kind.element
    if isinstance(kind, Text) and 1 <= index <= kind.size:
        return Char()
    return None


def box_at(box: Box, kind: Type, steps: tuple[str | int, ...]) -> Box:
    """The box at the end of a way."""
    for step in steps:
        if isinstance(kind, Text):
            box, kind = Letter(box, int(step), kind.size), Char()
        elif isinstance(kind, Struct):
            box, kind = Part(box.value, step), dict(kind.fields)[str(step)]
        elif isinstance(kind, Array):
            box, kind = Part(box.value, step), kind.element
    return box


def value_at(value: Any, steps: tuple[str | int, ...]) -> Any:
    """The value at the end of a way; None where a holder was never set."""
    for step in steps:
        if isinstance(value, str):
            letter = value[int(step) : int(step) + 1]
            value = None if letter in ("", UNSET) else letter
        elif value is not None:
            value = value[step]
    return value
