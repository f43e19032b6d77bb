"""KRL values in boxes: types, undefined components, copies and conversions.

Types and the shape of values are those of `krl_text`: None is what was never set, a structure is a
dict, an array a list, a CHAR array a str in which UNSET marks the characters that were never set.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

from sphmctl.emulators.interpreter.faults import OUT_OF_RANGE, KrlFaultError, invalid
from sphmctl.emulators.krl_text import (
    INT_HIGH,
    INT_LOW,
    Array,
    Bool,
    Char,
    Enum,
    Int,
    Real,
    RefusedError,
    Struct,
    Text,
    Type,
    float32,
    undefined,
)

UNSET = "\0"
"""A character of a CHAR array that was never set, between others that were."""

Convert = Callable[[Any], Any]


class Box(Protocol):
    """Anything that holds a value: a variable, a component, a system variable."""

    value: Any


class Cell:
    """A variable of its own."""

    __slots__ = ("value",)

    def __init__(self, value: Any = None) -> None:
        self.value = value


class Part:
    """A component that is handed over by :OUT: an entry of a list or dict."""

    __slots__ = ("_holder", "_key")

    def __init__(self, holder: Any, key: Any) -> None:
        self._holder = holder
        self._key = key

    @property
    def value(self) -> Any:
        """The present value."""
        return self._holder[self._key]

    @value.setter
    def value(self, value: Any) -> None:
        self._holder[self._key] = value


class Live:
    """A system variable that is computed at each look; without `put` it can only be read."""

    __slots__ = ("_get", "_put")

    def __init__(self, get: Callable[[], Any], put: Callable[[Any], None] | None = None) -> None:
        self._get = get
        self._put = put

    @property
    def value(self) -> Any:
        """The present value."""
        return self._get()

    @value.setter
    def value(self, value: Any) -> None:
        if self._put is not None:
            self._put(value)


class Letter:
    """One character of a CHAR array."""

    __slots__ = ("_index", "_size", "_text")

    def __init__(self, text: Box, index: int, size: int) -> None:
        self._text = text
        self._index = index
        self._size = size

    @property
    def value(self) -> Any:
        """The character; None when it was never set."""
        text = self._text.value or ""
        letter = text[self._index : self._index + 1]
        return None if letter in ("", UNSET) else letter

    @value.setter
    def value(self, value: str) -> None:
        text = (self._text.value or "").ljust(self._index, UNSET)
        self._text.value = text[: self._index] + value + text[self._index + 1 :]


def fresh(kind: Type) -> Any:
    """A value of which nothing was ever set."""
    return undefined(kind)


def rounded(number: float) -> int:
    """A REAL given to an INT: the nearest, halves away from 0 (SI, "Data types")."""
    return math.floor(number + 0.5) if number >= 0.0 else math.ceil(number - 0.5)


def real(number: float) -> float:
    """A REAL of single precision.

    Raises:
        KrlFaultError: it is beyond what a REAL can hold.
    """
    try:
        return float32(number)
    except RefusedError as error:
        raise KrlFaultError(OUT_OF_RANGE, str(error)) from None


def whole(number: int) -> int:
    """An INT of 32 bits.

    Raises:
        KrlFaultError: it has more.
    """
    if INT_LOW <= number <= INT_HIGH:
        return number
    raise KrlFaultError(OUT_OF_RANGE, f"{number} is beyond KRL's INT")


def is_set(value: Any) -> bool:
    """Whether anything of a value was ever set."""
    if isinstance(value, dict):
        return any(is_set(part) for part in value.values())
    if isinstance(value, list):
        return any(is_set(part) for part in value)
    return value is not None


def fully_set(value: Any) -> bool:
    """Whether all of a value was set."""
    if isinstance(value, dict):
        return all(fully_set(part) for part in value.values())
    if isinstance(value, list):
        return all(fully_set(part) for part in value)
    return value is not None


def copy_of(value: Any) -> Any:
    """A deep copy."""
    if isinstance(value, dict):
        return {name: copy_of(part) for name, part in value.items()}
    if isinstance(value, list):
        return [copy_of(part) for part in value]
    return value


def copier(kind: Type) -> Convert:
    """How a value of a type is copied; flat structures the quick way."""
    if isinstance(kind, Struct):
        deep = tuple(
            (name, copier(part)) for name, part in kind.fields if isinstance(part, Struct | Array)
        )
        if not deep:
            return dict

        def copy_struct(value: dict[str, Any]) -> dict[str, Any]:
            made = dict(value)
            for name, copy in deep:
                made[name] = copy(made[name])
            return made

        return copy_struct
    return copy_of if isinstance(kind, Array) else _same


def _same(value: Any) -> Any:
    return value


def converter(kind: Type, name: str) -> Convert:
    """How any value is brought into a variable of a type; `name` is for messages.

    The function raises KrlFaultError when the value is undefined, or none of the type.
    """
    if isinstance(kind, Struct):
        return _struct_converter(kind, name)
    if isinstance(kind, Array):
        inner = converter_or_none(kind.element, name)
        size = kind.size

        def convert_list(value: Any) -> Any:
            if not isinstance(value, list) or len(value) != size:
                raise KrlFaultError(OUT_OF_RANGE, f"{name} is an array of {size}")
            return [inner(part) for part in value]

        return convert_list
    return _scalar_converter(kind, name)


def converter_or_none(kind: Type, name: str) -> Convert:
    """Like `converter`, but what was never set stays so."""
    inner = converter(kind, name)
    return lambda value: inner(value) if is_set(value) else undefined(kind)


def _struct_converter(kind: Struct, name: str) -> Convert:
    parts = tuple((part, converter_or_none(inner, f"{name}.{part}")) for part, inner in kind.fields)

    def convert(value: Any) -> Any:
        if not isinstance(value, dict):
            raise invalid(name) if value is None else wrong(name, kind)
        return {part: inner(value.get(part)) for part, inner in parts}

    return convert


def wrong(name: str, kind: Type) -> KrlFaultError:
    """A value of another type."""
    return KrlFaultError(OUT_OF_RANGE, f"{name} takes only a {kind_name(kind)}")


def _scalar_converter(kind: Type, name: str) -> Convert:
    def convert(value: Any) -> Any:
        if value is None:
            raise invalid(name)
        return _scalar(kind, name, value)

    return convert


def _scalar(kind: Type, name: str, value: Any) -> Any:
    if isinstance(kind, Real) and isinstance(value, int | float) and not isinstance(value, bool):
        return real(value)
    if isinstance(kind, Int) and isinstance(value, int | float) and not isinstance(value, bool):
        number = value if isinstance(value, int) else rounded(value)
        if kind.low <= number <= kind.high:
            return number
        message = f"{name}: {number} is outside {kind.low} to {kind.high}"
        raise KrlFaultError(OUT_OF_RANGE, message)
    if isinstance(kind, Bool) and isinstance(value, bool):
        return value
    if isinstance(kind, Enum) and value in kind.members:
        return value
    size = kind.size if isinstance(kind, Text) else 1
    if isinstance(kind, Text | Char) and isinstance(value, str):
        if len(value) <= size:
            return value
        raise KrlFaultError(OUT_OF_RANGE, f"{len(value)} characters for {name}[{size}]")
    raise wrong(name, kind)


def kind_name(kind: Type | None) -> str:
    """A type as KRL writes it."""
    if isinstance(kind, Struct | Enum):
        return kind.name
    if isinstance(kind, Text):
        return f"CHAR[{kind.size}]"
    if isinstance(kind, Array):
        return f"{kind_name(kind.element)}[{kind.size}]"
    return "?" if kind is None else type(kind).__name__.upper()
