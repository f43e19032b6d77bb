"""The controller's store of typed KRL variables, reached by name as the variable server does.

Not responsible for what the variables mean, nor for any protocol. Names are not case-sensitive;
`NAME[3]`, `NAME.FIELD` and `NAME[]` (all of an array or of a CHAR array) reach into a variable.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from sphmctl.emulators.krl_text import (
    Array,
    RefusedError,
    Struct,
    Text,
    Type,
    Value,
    parse,
    render,
    undefined,
)

PLACES_LIMIT = 4096
"""Names whose way into the store is remembered; more than any client asks for."""

_STEP = re.compile(r"\s*(?:\[\s*(\d{0,6})\s*\]|\.\s*([A-Z_$][\w$]*))", re.IGNORECASE)
_NAME = re.compile(r"\s*([A-Z_$][\w$]*)", re.IGNORECASE)


@dataclass
class Variable:
    """One declared variable; `source`, where there is one, computes its value at each look."""

    kind: Type
    value: Value
    writable: bool
    source: Callable[[], Value] | None
    text: str | None = None

    def look(self) -> Value:
        """The present value."""
        return self.value if self.source is None else self.source()


@dataclass(frozen=True)
class _Place:
    """Where a name leads: into `variable` by `steps` (field names, and indices from 0)."""

    variable: Variable
    steps: tuple[str | int, ...]
    kind: Type


class Store:
    """All variables of one controller."""

    def __init__(self) -> None:
        self._variables: dict[str, Variable] = {}
        self._places: dict[str, _Place] = {}

    def declare(
        self,
        name: str,
        kind: Type,
        value: Value = None,
        *,
        writable: bool = False,
        source: Callable[[], Value] | None = None,
    ) -> Variable:
        """Make a variable known; without `value` and `source` it is undefined."""
        start = undefined(kind) if value is None else value
        variable = Variable(kind, start, writable, source)
        self._variables[name.upper()] = variable
        return variable

    def get(self, name: str) -> Value:
        """The value of a declared variable, by the name it was declared with."""
        return self._variables[name].look()

    def put(self, name: str, value: Value) -> None:
        """Set a variable from the controller's side: no check of type or access."""
        variable = self._variables[name]
        variable.value = value
        variable.text = None

    def kind_of(self, name: str) -> Type | None:
        """The type of what a name leads to; None when it leads nowhere."""
        place = self._find(name)
        return None if place is None else place.kind

    def read_text(self, name: str) -> str | None:
        """The text of a variable or a part of it; None when the name is unknown."""
        place = self._find(name)
        if place is None:
            return None
        variable = place.variable
        if place.steps or variable.source is not None:
            return render(place.kind, _walk(variable.look(), place.steps))
        if variable.text is None:
            variable.text = render(variable.kind, variable.value)
        return variable.text

    def write_text(self, name: str, text: str) -> bool:
        """Set a variable or a part of it; False when that is refused, and nothing changed."""
        place = self._find(name)
        if place is None or not place.variable.writable:
            return False
        try:
            value = parse(place.kind, text)
        except RefusedError:
            return False
        variable = place.variable
        variable.text = None
        if not place.steps:
            variable.value = value
            return True
        holder = _walk(variable.value, place.steps[:-1])
        last = place.steps[-1]
        if isinstance(holder, dict):
            holder[str(last)] = value
        elif isinstance(holder, list):
            holder[int(last)] = value
        return True

    def _find(self, name: str) -> _Place | None:
        place = self._places.get(name)
        if place is None:
            place = self._resolve(name)
            if place is not None and len(self._places) < PLACES_LIMIT:
                self._places[name] = place
        return place

    def _resolve(self, name: str) -> _Place | None:
        match = _NAME.match(name)
        variable = self._variables.get(match[1].upper()) if match else None
        if match is None or variable is None:
            return None
        rest = name.rstrip()
        steps: list[str | int] = []
        kind: Type = variable.kind
        whole = False
        at = match.end()
        while at < len(rest):
            match = _STEP.match(rest, at)
            if match is None or whole:
                return None
            at = match.end()
            index, field = match.groups()
            if field is not None and isinstance(kind, Struct):
                parts = dict(kind.fields)
                if field.upper() not in parts:
                    return None
                steps.append(field.upper())
                kind = parts[field.upper()]
            elif index and isinstance(kind, Array) and 1 <= int(index) <= kind.size:
                steps.append(int(index) - 1)
                kind = kind.element
            elif index == "" and isinstance(kind, Array | Text):
                whole = True
            else:
                return None
        # An array stands for itself only with its empty brackets.
        if isinstance(kind, Array | Text) is not whole:
            return None
        return _Place(variable, tuple(steps), kind)


def _walk(value: Value, steps: tuple[str | int, ...]) -> Value:
    for step in steps:
        if isinstance(value, dict):
            value = value[str(step)]
        elif isinstance(value, list):
            value = value[int(step)]
    return value
