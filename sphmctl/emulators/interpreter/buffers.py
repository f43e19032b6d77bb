"""SREAD, CAST_TO and CAST_FROM: values out of texts and buffers (KUKA, "CREAD/CWRITE").

A character that was never set counts as the byte 0.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter.code import Fn
from sphmctl.emulators.interpreter.expressions import Target, Typed
from sphmctl.emulators.interpreter.faults import OUT_OF_RANGE, KrlFaultError, invalid
from sphmctl.emulators.interpreter.texts import readable, writable
from sphmctl.emulators.interpreter.values import UNSET, converter
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl_text import Bool, Char, Enum, Int, Real, Text, Type

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.compiler import Builder

BUFFERS = ("SREAD", "CAST_TO", "CAST_FROM")

BYTES = "latin-1"
"""A CHAR is a byte."""

_FORMAT = re.compile(r"\s+|%%|%(\d*)([diuxXfeEgGsc])|[^%]|%")

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"

_WORDS = {
    **dict.fromkeys("diu", r"[-+]?\d+"),
    **dict.fromkeys("xX", r"[-+]?(?:0[xX])?[0-9a-fA-F]+"),
    **dict.fromkeys("feEgG", _NUMBER),
    "s": r"\S+",
    "c": r"[\s\S]",
}
"""What each mark of a format takes, after C's scanf."""


@dataclass(frozen=True)
class Scanned:
    """What a format found.

    Attributes:
        values: as texts with the mark of each.
        end: place behind the last that fitted.
        complete: whether all of the format fitted.
    """

    values: tuple[tuple[str, str], ...]
    end: int
    complete: bool


def compiled(builder: Builder, node: n.Call) -> Typed:
    """A call of one of the three."""
    parts = [part for part in node.arguments if part is not None]
    make = {"SREAD": _sread, "CAST_TO": _cast_to, "CAST_FROM": _cast_from}[node.name]
    return Typed(make(builder, parts), None)


def _size(text: Target, node: n.Expression) -> int:
    if isinstance(text.kind, Text):
        return text.kind.size
    raise fail(node.at, "arguments", "a CHAR array must stand here")


def _cast_to(builder: Builder, parts: list[n.Expression]) -> Fn:
    """CAST_TO(buffer[],offset,values..)."""
    text, offset = (writable(builder, part) for part in parts[:2])
    size = _size(text, parts[0])
    values = [builder.expressions.of(part) for part in parts[2:]]

    def put(f: Any) -> None:
        data = b"".join(_packed(value.fn(f), value.kind) for value in values)
        at = _place(offset, f)
        whole = (text.raw(f) or "").ljust(at, UNSET)
        made = whole[:at] + data.decode(BYTES) + whole[at + len(data) :]
        if len(made) > size:
            raise KrlFaultError(OUT_OF_RANGE, f"{len(made)} characters for {text.name}")
        text.box(f).value = made
        offset.box(f).value = at + len(data)

    return put


def _cast_from(builder: Builder, parts: list[n.Expression]) -> Fn:
    """CAST_FROM(buffer[],offset,variables..)."""
    text, offset = readable(builder, parts[0]), writable(builder, parts[1])
    size = _size(text, parts[0])
    wanted = [writable(builder, part) for part in parts[2:]]

    def take(f: Any) -> None:
        at = _place(offset, f)
        data = (text.raw(f) or "").ljust(size, UNSET).encode(BYTES, "replace")
        for target in wanted:
            value, at = _unpacked(target, data, at)
            target.box(f).value = value
        offset.box(f).value = at

    return take


def _place(offset: Target, f: Any) -> int:
    at = offset.raw(f)
    if at is None:
        raise invalid(offset.name)
    if at < 0:
        raise KrlFaultError(OUT_OF_RANGE, f"{offset.name} = {at} is below 0")
    return int(at)


def _sread(builder: Builder, parts: list[n.Expression]) -> Fn:
    """SREAD(text[],state,offset,format[],variables..): reads from the offset on, and moves it."""
    text, state, offset = readable(builder, parts[0]), *(writable(builder, p) for p in parts[1:3])
    pattern = builder.expressions.of(parts[3]).fn
    wanted = [writable(builder, part) for part in parts[4:]]

    def read(f: Any) -> None:
        at = _place(offset, f)
        source = (text.raw(f) or "").rstrip(UNSET)
        found = scanned(pattern(f), source, at)
        hits = 0
        for (word, mark), target in zip(found.values, wanted, strict=False):
            value = _value(word, mark, target.kind)
            target.box(f).value = converter(target.kind, target.name)(value)
            hits += 1
        status = "DATA_OK" if found.complete else "DATA_END" if at >= len(source) else "FMT_ERR"
        state.box(f).value = {"RET1": status, "HITS": hits, "LENGTH": found.end - at}
        offset.box(f).value = found.end

    return read


def scanned(pattern: str, text: str, at: int) -> Scanned:
    """A format against a text from `at` on, as C's scanf does it."""
    values: list[tuple[str, str]] = []
    for part in _FORMAT.finditer(pattern):
        mark = part[2]
        if mark is None:
            literal = "%" if part[0] == "%%" else part[0]
            match = re.compile(r"\s*" if literal.isspace() else re.escape(literal)).match(text, at)
        else:
            blank = re.compile("" if mark == "c" else r"\s*").match(text, at)
            begin = blank.end() if blank else at
            end = begin + int(part[1]) if part[1] else len(text)
            match = re.compile(_WORDS[mark]).match(text, begin, end)
        if match is None:
            return Scanned(tuple(values), at, False)
        at = match.end()
        if mark is not None:
            values.append((match[0], mark))
    return Scanned(tuple(values), at, True)


def _value(word: str, mark: str, kind: Type) -> Any:
    if mark in "diu":
        number: Any = int(word)
    elif mark in "xX":
        number = int(word, 16)
    elif mark in "feEgG":
        number = float(word)
    else:
        return word
    return number != 0 if isinstance(kind, Bool) else number


def _packed(value: Any, kind: Type | None) -> bytes:
    """Little-endian, INT and REAL of four bytes, BOOL, CHAR and ENUM of one (guess for ENUM)."""
    if isinstance(kind, Real):
        return struct.pack("<f", value)
    if isinstance(kind, Enum):
        return bytes((kind.members.index(value),))
    if isinstance(value, bool):
        return bytes((value,))
    if isinstance(value, int):
        return struct.pack("<i", value)
    if isinstance(value, str):
        return value.encode(BYTES, "replace")
    raise KrlFaultError(OUT_OF_RANGE, "CAST_TO takes numbers, BOOL, CHAR and ENUM")


def _unpacked(target: Target, data: bytes, at: int) -> tuple[Any, int]:
    kind = target.kind
    size = kind.size if isinstance(kind, Text) else 4 if isinstance(kind, Int | Real) else 1
    part = data[at : at + size]
    if len(part) < size:
        raise KrlFaultError(OUT_OF_RANGE, f"the buffer ends before {target.name}")
    if isinstance(kind, Int | Real):
        (value,) = struct.unpack("<f" if isinstance(kind, Real) else "<i", part)
        if not math.isfinite(value):
            raise KrlFaultError(OUT_OF_RANGE, f"{target.name}: these bytes are no REAL")
        return value, at + size
    if isinstance(kind, Bool):
        return part != b"\0", at + size
    if isinstance(kind, Text | Char):
        return part.decode(BYTES), at + size
    if isinstance(kind, Enum) and part[0] < len(kind.members):
        return kind.members[part[0]], at + size
    raise KrlFaultError(OUT_OF_RANGE, f"{target.name}: CAST_FROM finds no value of its type")
