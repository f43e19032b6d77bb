"""KRL values as text, to Python and back. Not the language: no declarations, no expressions.

What servers send (captures in ivareri/KUKAVARPROXY_tests C++/move_latency.cpp, lexer in
OpenKuka/KukavarClient DataLexer.cs): 35, -3.821331E-04, NaN, TRUE, #T1, "text", 'B0101', 'HFF',
'C', and structures {TAG: NAME value, NAME[] "text", NAME {TAG: ...}}, the tag being optional.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from sphmctl.errors import DeviceError, InvalidError

# A reply frame holds no more text than this: its length is a 16-bit number.
MAX_TEXT_CHARS: Final = 0xFFFF

# Structures inside structures. Controllers nest three or four deep; more is a damaged text.
MAX_DEPTH: Final = 16

# No INT or REAL prints as long as this, and Python refuses whole numbers over 4300 digits.
MAX_NUMBER_CHARS: Final = 64

# INT has 32 bits, REAL is IEEE single precision (KUKA, KSS System Integrators, "Data types").
MIN_INT: Final = -(2**31)
MAX_INT: Final = 2**31 - 1
MAX_REAL: Final = 3.4028234663852886e38
MIN_REAL: Final = 1.1754943508222875e-38

# Nine significant digits name every single-precision number exactly, and KRC4 prints as many.
REAL_DIGITS: Final = 9

# A state structure of 28 values is read hundreds of times a second and few of its tokens are new:
# remembering them saves a third of the time. The bound keeps a stream of new ones from growing.
CACHED_TOKENS: Final = 256

# How much of a text an error message shows.
EXCERPT_CHARS: Final = 60

_INFINITIES: Final = (math.inf, -math.inf)
_WORDS: Final = {"TRUE": True, "FALSE": False, "NAN": math.nan}
_NAME = re.compile(r"[A-Za-z_$][A-Za-z0-9_$]*+")
_COMPONENT = re.compile(rf"{_NAME.pattern}(?:\[[0-9, ]*+\])?+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
# Possessive, so that a hostile text costs linear time. The last alternative is a stray quote or
# bracket, which the parser refuses.
_TOKEN = re.compile(r"""[^\s{},:"'\[]++(?:\[[^\]]*+\])?+|[{},:]|"[^"]*+"|'[^']*+'|\S""")


class KrlSyntaxError(DeviceError):
    """A text that is no KRL value."""


@dataclass(frozen=True, slots=True)
class Enum:
    """One value of an enumeration, without the # that stands before it in KRL."""

    name: str

    def __str__(self) -> str:
        return f"#{self.name}"


@dataclass(frozen=True, slots=True)
class Aggregate:
    """A structure: its components in order, and its type when the text names it.

    A CHAR array keeps its brackets in the name ("TEXT[]"), as KRL writes it.
    """

    fields: Mapping[str, KrlValue]
    tag: str | None = None


KrlValue = bool | int | float | str | Enum | Aggregate


def parse(text: str) -> KrlValue:
    """The value that a KRL text stands for.

    Bit strings ('B0101', 'HFF') become numbers, a CHAR becomes a string of one character.

    Raises:
        KrlSyntaxError: the text is no KRL value; the message says where it goes wrong.
    """
    try:
        return _parse_tokens(_tokens(text))
    except KrlSyntaxError as error:
        message = error.message
        comma = _DECIMAL_COMMA.search(text)
        if comma is not None and "[" not in text:
            message = (
                f"decimal comma in {comma[0]!r}; a decimal point would be right "
                "(region setting of the server's Windows)"
            )
        raise KrlSyntaxError(message, f"KRL value {_excerpt(text)}") from None


def format_value(value: KrlValue) -> str:
    """The KRL text of a value; reals get nine significant digits.

    Raises:
        InvalidError: KRL has no such value: nan, inf, too large, or a string that cannot be quoted.
    """
    return _format_value(value, 0)


def axis_aggregate(*axes_deg: float) -> str:
    """The E6AXIS text of A1 to A6; the external axes E1 to E6 are written as 0.

    All twelve components, because what a variable keeps of the ones left out is not documented.
    """
    if len(axes_deg) != 6:
        raise InvalidError(f"{len(axes_deg)} axis angles; six, A1 to A6, would be right")
    arm = [f"A{i} {_format_real(float(a), f'A{i}')}" for i, a in enumerate(axes_deg, 1)]
    external = [f"E{i} 0.0" for i in range(1, 7)]
    return f"{{E6AXIS: {', '.join(arm + external)}}}"


def _tokens(text: str) -> list[str]:
    if len(text) > MAX_TEXT_CHARS:
        raise KrlSyntaxError(f"{len(text)} characters; at most {MAX_TEXT_CHARS} would be right")
    if '"' in text or "'" in text or "[" in text:
        return _TOKEN.findall(text)
    # Four times faster than the expression, and enough for everything that is read in each cycle.
    spaced = text.replace("{", " { ").replace("}", " } ").replace(",", " , ").replace(":", " : ")
    return spaced.split()


def _parse_tokens(tokens: list[str]) -> KrlValue:
    rest = iter(tokens)
    take = rest.__next__
    try:
        first = take()
        value = _parse_aggregate(take, 1) if first == "{" else _parse_scalar(first)
    except StopIteration:
        raise KrlSyntaxError("the text ends early; a complete value would be right") from None
    extra = next(rest, None)
    if extra is not None:
        raise KrlSyntaxError(f"{_excerpt(extra)} after the value; nothing would be right")
    return value


def _parse_aggregate(take: Callable[[], str], depth: int) -> Aggregate:
    """Everything after an opening brace."""
    if depth > MAX_DEPTH:
        raise KrlSyntaxError(f"nested deeper than {MAX_DEPTH}; less would be right")
    fields: dict[str, KrlValue] = {}
    tag = None
    name = take()
    if name == "}":
        return Aggregate(fields)
    token = take()
    if token == ":":
        tag = _checked_name(name)
        name = take()
        if name == "}":
            return Aggregate(fields, tag)
        token = take()
    while True:
        if _checked_component(name) in fields:
            raise KrlSyntaxError(f"component {_excerpt(name)} twice; once would be right")
        fields[name] = _parse_aggregate(take, depth + 1) if token == "{" else _parse_scalar(token)
        separator = take()
        if separator == "}":
            return Aggregate(fields, tag)
        if separator != ",":
            raise KrlSyntaxError(
                f"{_excerpt(separator)} after component {_excerpt(name)}; , or }} would be right"
            )
        name = take()
        token = take()


@lru_cache(maxsize=CACHED_TOKENS)
def _parse_scalar(token: str) -> KrlValue:
    # Only these characters: float() by itself would take "1_0", "infinity" and Arabic digits.
    if not token.strip("0123456789.+-eE") and len(token) <= MAX_NUMBER_CHARS:
        try:
            number = float(token) if "." in token or "E" in token or "e" in token else int(token)
        except ValueError:
            raise KrlSyntaxError(f"{_excerpt(token)}; a number would be right") from None
        if number in _INFINITIES:
            raise KrlSyntaxError(f"number {token}; at most {MAX_REAL:.3g} would be right")
        return number
    word = _WORDS.get(token.upper())
    if word is not None:
        return word
    first = token[0]
    if first == "#":
        return Enum(_checked_name(token[1:]))
    if first == '"' and len(token) > 1:
        return token[1:-1]
    if first == "'" and len(token) > 1:
        return _parse_literal(token[1:-1])
    raise KrlSyntaxError(f"{_excerpt(token)}; a value would be right")


def _parse_literal(content: str) -> int | str:
    """'B0101' and 'HFF' are INT bit patterns of up to 32 bits, 'C' is a CHAR."""
    if len(content) == 1:
        return content
    base = {"B": 2, "H": 16}.get(content[:1].upper())
    digits = content[1:]
    allowed = "01" if base == 2 else "0123456789abcdefABCDEF"
    if base is None or digits.strip(allowed) or len(digits) > 32:
        raise KrlSyntaxError(f"{_excerpt(content)}; 'B0101', 'HFF' or one character would be right")
    bits = int(digits, base)
    if bits >= 2**32:
        raise KrlSyntaxError(f"{_excerpt(content)}; at most 32 bits would be right")
    return bits - 2**32 if bits > MAX_INT else bits


@lru_cache(maxsize=CACHED_TOKENS)
def _checked_component(name: str) -> str:
    if not _COMPONENT.fullmatch(name):
        raise KrlSyntaxError(f"{_excerpt(name)}; a component name would be right")
    return name


@lru_cache(maxsize=CACHED_TOKENS)
def _checked_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise KrlSyntaxError(f"{_excerpt(name)}; a KRL name would be right")
    return name


def _format_value(value: KrlValue, depth: int) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int):
        if not MIN_INT <= value <= MAX_INT:
            raise InvalidError(f"number {value}; {MIN_INT} to {MAX_INT} (INT) would be right")
        return str(int(value))
    if isinstance(value, float):
        return _format_real(float(value), "number")
    if isinstance(value, str):
        return _format_string(value)
    if isinstance(value, Enum):
        return f"#{_writable(_NAME, value.name)}"
    return _format_aggregate(value, depth + 1)


def _format_aggregate(value: Aggregate, depth: int) -> str:
    if depth > MAX_DEPTH:
        raise InvalidError(f"a structure nested deeper than {MAX_DEPTH}; less would be right")
    components = ", ".join(
        f"{_writable(_COMPONENT, name)} {_format_value(component, depth)}"
        for name, component in value.fields.items()
    )
    tag = "" if value.tag is None else f"{_writable(_NAME, value.tag)}: "
    return f"{{{tag}{components}}}"


def _format_real(number: float, name: str) -> str:
    """Plain or as 1.0E-05, like the controller's own: always with a decimal point."""
    if not abs(number) <= MAX_REAL:
        raise InvalidError(f"{name} {number}; a number within {MAX_REAL:.3g} would be right")
    if abs(number) < MIN_REAL:
        return "0.0"
    mantissa, letter, exponent = f"{number:.{REAL_DIGITS}G}".partition("E")
    point = "" if "." in mantissa else ".0"
    return f"{mantissa}{point}{letter}{exponent}"


def _format_string(text: str) -> str:
    if '"' in text or not text.isprintable():
        raise InvalidError(f"string {text!r}; printable text without quotes would be right")
    return f'"{text}"'


def _writable(pattern: re.Pattern[str], name: str) -> str:
    if not pattern.fullmatch(name):
        raise InvalidError(f"name {name!r}; letters, digits, _ and $ would be right")
    return name


def _excerpt(text: str) -> str:
    return repr(text if len(text) <= EXCERPT_CHARS else f"{text[:EXCERPT_CHARS]}...")
