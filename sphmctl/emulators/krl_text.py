"""KRL's data types, and their values as the text that the controller shows and accepts.

Not responsible for names, declarations or access rights. A value is a tree: a dict for a structure,
a list for an array, otherwise int, float, bool or str; None is a component that was never set.

Text forms: REAL as KSS 8 prints it (at most nine digits, at least six: `-35.8241692`, `298.000`,
`0.0`), aggregates as in the KUKA.CrossCom captures of the OpenKuka and openshowvar projects.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import TypeAlias

Value: TypeAlias = "int | float | str | dict[str, Value] | list[Value] | None"

INT_LOW, INT_HIGH = -(2**31), 2**31 - 1
"""KRL's INT is 32 bits wide (KUKA system integrators' manual, data types)."""

REAL_DIGITS = 9
"""A float32 needs nine digits to survive being text; KSS 8 prints them."""

REAL_MIN_DIGITS = 6
"""KSS 8 fills a REAL up with zeros to six digits: `298.000`, `4500.00`."""


class RefusedError(ValueError):
    """The text is no value of the type."""


@dataclass(frozen=True)
class Int:
    """INT, where the variable allows only a part of the range, that part."""

    low: int = INT_LOW
    high: int = INT_HIGH


@dataclass(frozen=True)
class Real:
    """REAL: an IEEE float32."""


@dataclass(frozen=True)
class Bool:
    """BOOL."""


@dataclass(frozen=True)
class Text:
    """CHAR[size], read and written as a whole by its name with empty brackets."""

    size: int


@dataclass(frozen=True)
class Char:
    """CHAR: one character."""


@dataclass(frozen=True)
class Enum:
    """ENUM; values are kept without the `#`."""

    name: str
    members: tuple[str, ...]


@dataclass(frozen=True)
class Struct:
    """STRUC, fields in the order of declaration; all names in capitals."""

    name: str
    fields: tuple[tuple[str, Type], ...]


@dataclass(frozen=True)
class Array:
    """An array, counted from 1; of more dimensions, an array of arrays."""

    element: Type
    size: int


Type: TypeAlias = Int | Real | Bool | Char | Text | Enum | Struct | Array

_FLOAT32 = struct.Struct("<f")

_TOKEN = re.compile(
    r"""\s*(?:
        (?P<text>"[^"]*")
      | (?P<bits>'(?:H[0-9A-F]+|B[01]+)')
      | (?P<enum>\#\s*\w+)
      | (?P<number>[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:E[-+]?\d+)?)
      | (?P<name>[A-Z_$][\w$]*(?:\[\])?)
      | (?P<mark>[{}:,])
    )""",
    re.IGNORECASE | re.VERBOSE,
)

_INTEGER = re.compile(r"[-+]?\d{1,10}")


def float32(value: float) -> float:
    """The REAL nearest to `value`.

    Raises:
        RefusedError: when no REAL is near.
    """
    try:
        nearest: float = _FLOAT32.unpack(_FLOAT32.pack(value))[0]
    except OverflowError:
        nearest = math.inf
    if not math.isfinite(nearest):
        raise RefusedError(f"{value} is beyond KRL's REAL")
    return nearest


def undefined(kind: Type) -> Value:
    """A value of the type of which nothing was ever set."""
    if isinstance(kind, Struct):
        return {name: undefined(part) for name, part in kind.fields}
    if isinstance(kind, Array):
        return [undefined(kind.element) for _ in range(kind.size)]
    return None


def real_text(value: float) -> str:
    """A REAL as KSS 8 prints it."""
    number = float32(value)
    if number == 0.0:
        return "0.0"
    mantissa, mark, exponent = f"{number:#.{REAL_DIGITS}g}".partition("e")
    for _ in range(REAL_DIGITS - REAL_MIN_DIGITS):
        if mantissa.endswith("0") and not mantissa.endswith(".0"):
            mantissa = mantissa[:-1]
    if mantissa.endswith("."):
        mantissa += "0"
    return f"{mantissa}E{exponent}" if mark else mantissa


def render(kind: Type, value: Value) -> str:
    """The value's text; empty when nothing of it is set."""
    if isinstance(value, dict) and isinstance(kind, Struct):
        return _render_struct(kind, value)
    if isinstance(value, list) and isinstance(kind, Array):
        return " ".join(filter(None, (render(kind.element, item) for item in value)))
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        return f"#{value}" if isinstance(kind, Enum) else f'"{value}"'
    if isinstance(value, int | float):
        return real_text(value) if isinstance(kind, Real) else str(value)
    return ""


def _render_struct(kind: Struct, value: dict[str, Value]) -> str:
    parts = []
    for name, part in kind.fields:
        text = render(part, value[name])
        if text:
            label = f"{name}[]" if isinstance(part, Text) else name
            parts.append(f"{label} {text}")
    return f"{{{kind.name}: {', '.join(parts)}}}" if parts else ""


def parse(kind: Type, text: str) -> Value:
    """The value that `text` gives to a variable of the type.

    A component that an aggregate does not name is undefined afterwards. An INT takes no REAL, nor
    an `S 0.0`: a client that depends on rounding is better found here than on the robot.

    Raises:
        RefusedError: when the text is no value of the type.
    """
    tokens = _Tokens(text)
    value = _parse(kind, tokens)
    if tokens.kind:
        raise RefusedError(f"{tokens.text!r} after the end of the value")
    return value


class _Tokens:
    """The words of a text, one at a time: `kind` ("" at the end) and `text` of the present one."""

    def __init__(self, text: str) -> None:
        self._all = text.rstrip()
        self._at = 0
        self.kind = ""
        self.text = ""
        self.advance()

    def advance(self) -> str:
        """Go to the next word and return the text of the one left."""
        left = self.text
        if self._at >= len(self._all):
            self.kind = self.text = ""
            return left
        match = _TOKEN.match(self._all, self._at)
        if match is None or match.lastgroup is None:
            raise RefusedError(f"{self._all[self._at :][:20]!r} is no KRL value")
        self._at = match.end()
        self.kind = match.lastgroup
        self.text = match[self.kind]
        return left

    def take(self, kind: str, text: str = "") -> str:
        """The present word, which must be of `kind` and, where given, read `text`."""
        if self.kind != kind or (text and self.text != text):
            raise RefusedError(f"{self.text or 'the end'!r} where {text or kind!r} is due")
        return self.advance()


def _parse(kind: Type, tokens: _Tokens) -> Value:
    if isinstance(kind, Int):
        return _parse_int(kind, tokens)
    if isinstance(kind, Real):
        return float32(float(tokens.take("number")))
    if isinstance(kind, Bool):
        word = tokens.take("name").upper()
        if word not in ("TRUE", "FALSE"):
            raise RefusedError(f"{word} is no BOOL")
        return word == "TRUE"
    if isinstance(kind, Enum):
        member = tokens.take("enum")[1:].strip().upper()
        if member not in kind.members:
            raise RefusedError(f"#{member} is no {kind.name}")
        return member
    if isinstance(kind, Text | Char):
        word = tokens.take("text")[1:-1]
        size = kind.size if isinstance(kind, Text) else 1
        if len(word) > size or (isinstance(kind, Char) and not word):
            raise RefusedError(f"{len(word)} characters for CHAR[{size}]")
        return word
    if isinstance(kind, Struct):
        return _parse_struct(kind, tokens)
    raise RefusedError("an array is written element by element")


def _parse_int(kind: Int, tokens: _Tokens) -> int:
    if tokens.kind == "bits":
        word = tokens.advance()[1:-1]
        number = int(word[1:], 16 if word[0] in "Hh" else 2)
    else:
        word = tokens.take("number")
        if not _INTEGER.fullmatch(word):
            raise RefusedError(f"{word} is no INT")
        number = int(word)
    if not kind.low <= number <= kind.high:
        raise RefusedError(f"{number} is outside {kind.low} to {kind.high}")
    return number


def _parse_struct(kind: Struct, tokens: _Tokens) -> dict[str, Value]:
    parts = dict(kind.fields)
    value = {name: undefined(part) for name, part in kind.fields}
    tokens.take("mark", "{")
    word = tokens.take("name").upper()
    if tokens.text == ":":
        if word != kind.name:
            raise RefusedError(f"{word} is not {kind.name}")
        tokens.advance()
        word = tokens.take("name").upper()
    while True:
        name = word.removesuffix("[]")
        if name not in parts or isinstance(parts[name], Text) is not word.endswith("[]"):
            raise RefusedError(f"{kind.name} has no {word}")
        value[name] = _parse(parts[name], tokens)
        if tokens.text != ",":
            break
        tokens.advance()
        word = tokens.take("name").upper()
    tokens.take("mark", "}")
    return value
