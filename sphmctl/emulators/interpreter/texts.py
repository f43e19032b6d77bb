"""KRL's string functions (SI, "String functions"; SREAD and SWRITE from "CREAD/CWRITE")."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter.code import Fn
from sphmctl.emulators.interpreter.expressions import Target, Typed
from sphmctl.emulators.interpreter.values import UNSET
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.words import words
from sphmctl.emulators.krl_text import Bool, Int, RefusedError, Text, Type, parse, real_text

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.compiler import Builder

TEXTS = words(
    """STRADD STRCLEAR STRCOMP STRCOPY STRDECLLEN STRFIND STRLEN STRTOBOOL STRTOINT STRTOREAL
    STRTOSTRING STRTOFRAME STRTOPOS STRTOE3POS STRTOE6POS STRTOAXIS STRTOE3AXIS STRTOE6AXIS
    SWRITE"""
)

SHOW: dict[str, Callable[[Any], Any]] = {
    "d": int,
    "x": int,
    "X": int,
    "s": lambda value: _plain(value),
    "c": str,
}

_FORMAT = re.compile(r"%([-+ 0#]*)(\d*)(?:\.(\d+))?([dxXfeEgscb%])")


def compiled(builder: Builder, node: n.Call) -> Typed:
    """A call of a string function."""
    parts = [part for part in node.arguments if part is not None]
    if node.name == "SWRITE":
        return Typed(_swrite(builder, parts), None)
    if node.name in ("STRCOMP", "STRFIND"):
        values = [builder.expressions.of(part).fn for part in parts]
        if node.name == "STRCOMP":
            return Typed(lambda f: _same(*[value(f) for value in values]), Bool())
        return Typed(lambda f: _found(*[value(f) for value in values]), Int())
    if node.name in ("STRLEN", "STRDECLLEN"):
        return _length_of(node.name, readable(builder, parts[0]))
    if node.name == "STRCLEAR":
        return Typed(_cleared(writable(builder, parts[0])), Bool())
    if node.name in ("STRADD", "STRCOPY"):
        first, source = writable(builder, parts[0]), builder.expressions.of(parts[1]).fn
        if node.name == "STRADD":
            return Typed(_added(first, source), Int())
        return Typed(_copied(first, source), Bool())
    text = builder.expressions.of(parts[0]).fn
    return Typed(_converted(text, writable(builder, parts[1])), Bool())


def readable(builder: Builder, node: n.Expression) -> Target:
    """A text that a function looks at: a variable, or one in quotes."""
    if isinstance(node, n.StringLiteral):
        value = node.value
        return Target(lambda _: value, lambda _: None, Text(max(1, len(value))), "", False, False)
    return writable(builder, node, reads_only=True)


def writable(builder: Builder, node: n.Expression, reads_only: bool = False) -> Target:
    """A variable that a function writes.

    Raises:
        KrlError: something else stands there, or it can only be read.
    """
    if not isinstance(node, n.Name | n.Field | n.Index):
        raise fail(node.at, "arguments", "a variable must stand here")
    target = builder.expressions.reference(node)
    if not (target.writable or reads_only):
        raise fail(node.at, "const", f"{target.name} can only be read")
    return target


def _length(value: Any) -> int:
    return len(value.rstrip(UNSET)) if value else 0


def _length_of(name: str, target: Target) -> Typed:
    if name == "STRLEN":
        return Typed(lambda f: _length(target.raw(f)), Int())
    size = _size(target)
    return Typed(lambda _: size, Int())


def _cleared(target: Target) -> Fn:
    def clear(f: Any) -> bool:
        target.box(f).value = None
        return True

    return clear


def _size(target: Target) -> int:
    return target.kind.size if isinstance(target.kind, Text) else 0


def _added(target: Target, source: Fn) -> Fn:
    def add(f: Any) -> int:
        made = (target.raw(f) or "").rstrip(UNSET) + source(f)
        if len(made) > _size(target):
            return 0
        target.box(f).value = made
        return len(made)

    return add


def _copied(target: Target, source: Fn) -> Fn:
    def copy(f: Any) -> bool:
        made = source(f)
        if len(made) > _size(target):
            return False
        target.box(f).value = made
        return True

    return copy


def _same(one: str, other: str, mode: str = "CASE_SENS") -> bool:
    return one == other if mode == "CASE_SENS" else one.upper() == other.upper()


def _found(start: int, text: str, wanted: str, mode: str = "CASE_SENS") -> int:
    """The place, from 1, of a text in another one from `start` on; 0 for nowhere."""
    if mode != "CASE_SENS":
        text, wanted = text.upper(), wanted.upper()
    return text.find(wanted, max(0, start - 1)) + 1


def _converted(text: Fn, target: Target) -> Fn:
    def convert(f: Any) -> bool:
        source = text(f).strip()
        if isinstance(target.kind, Text):
            source = f'"{source}"'
        try:
            target.box(f).value = parse(target.kind, source)
        except RefusedError:
            return False
        return True

    return convert


def _swrite(builder: Builder, parts: list[n.Expression]) -> Fn:
    """SWRITE(text[],state,offset,format[],values..): writes from the offset on, and moves it."""
    text, state, offset = (writable(builder, part) for part in parts[:3])
    pattern = builder.expressions.of(parts[3]).fn
    values = [builder.expressions.of(part) for part in parts[4:]]

    def write(f: Any) -> None:
        made, used = formatted(pattern(f), [(v.fn(f), v.kind) for v in values])
        at = offset.raw(f) or 0
        whole = (text.raw(f) or "")[:at].ljust(at) + made
        fits = len(whole) <= _size(text)
        if fits:
            text.box(f).value = whole
            offset.box(f).value = len(whole)
        status = {"RET1": "DATA_OK" if fits else "FMT_ERR", "HITS": used, "LENGTH": len(made)}
        state.box(f).value = status

    return write


def formatted(pattern: str, values: list[tuple[Any, Type | None]]) -> tuple[str, int]:
    """A format with its values put in, and how many were used."""
    left = list(values)

    def one(match: re.Match[str]) -> str:
        flags, width, digits, mark = match.groups()
        if mark == "%":
            return "%"
        value: Any = left.pop(0)[0] if left else 0
        if mark == "b":
            value, mark = int(value), "d"
        precision = f".{digits}" if digits else ""
        return str(f"%{flags}{width}{precision}{mark}" % SHOW.get(mark, float)(value))

    made = _FORMAT.sub(one, pattern)
    return made, len(values) - len(left)


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return real_text(value) if isinstance(value, float) else str(value)
