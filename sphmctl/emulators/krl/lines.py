"""One line of KRL to its node, by `grammar.lark`; a line that is none is told in one sentence."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, cast

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl import words
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.build_lines import Line, Lines, no_statement

if TYPE_CHECKING:
    from lark import Lark, UnexpectedInput

GRAMMAR = Path(__file__).with_name("grammar.lark")

MAX_NAMED = 6
"""So many possibilities a sentence lists; more help nobody."""

_OPERATORS = words.words(
    "PLUS MINUS TIMES DIVIDE COLON COMPARE AND B_AND EXOR B_EXOR OR B_OR LSQB DOT"
)
_VALUES = words.words("INT REAL BITS STRING TRUE FALSE NOT B_NOT LBRACE ENUM_VALUE")
_SHOWN = {
    "NAME": "a name",
    "ENUM_VALUE": "a value with #",
    "EQUAL": "=",
    "LPAR": "(",
    "RPAR": ")",
    "LSQB": "[",
    "RSQB": "]",
    "LBRACE": "{",
    "RBRACE": "}",
    "COMMA": ",",
    "COLON": ":",
    "DOT": ".",
    "BLEND": "C_PTP or C_DIS",
    "KIND": "DISTANCE or PATH",
    "BRAKE_KIND": "F",
    "$END": "the line's end",
}


def parse_line(at: n.Place, text: str) -> Line:
    """The node of one line without its comment; heads of blocks come with empty bodies.

    Raises:
        KrlError: the line is no KRL that this package knows.
    """
    from lark import UnexpectedInput

    parser, builder = _parser()
    builder.begin(at)
    try:
        node = parser.parse(text)
    except UnexpectedInput as error:
        raise fail(at, "syntax", _explain(text, error)) from None
    return cast("Line", node)


@lru_cache(maxsize=1)
def _parser() -> tuple[Lark, Lines]:
    """The parser, and the object on which it calls a method for each rule it has seen."""
    from lark import Lark

    builder = Lines()
    grammar = GRAMMAR.read_text(encoding="ascii")
    parser = Lark(grammar, start="line", parser="lalr", transformer=cast("None", builder))
    return parser, builder


def _explain(text: str, error: UnexpectedInput) -> str:
    from lark import UnexpectedToken

    first = text.split("=")[0].split("(")[0].split()[:1]
    word = first[0].upper() if first else ""
    if word in words.NOT_EMULATED or word in words.NO_KRL:
        return no_statement(word)
    at_end = isinstance(error, UnexpectedToken) and error.token.type == "$END"
    column = len(text) + 1 if at_end else max(error.column, 1)
    found = text[column - 1 :].split()[:1]
    if text.count('"') % 2:
        return 'a text is not closed; write a second "'
    seen = f"{found[0][:30]!r} cannot stand" if found else "the line ends too early"
    before = text[: column - 1].split()[-1:]
    place = f" behind {before[0][-30:]!r}" if before else " at the start"
    expected = set(error.accepts or error.expected) if isinstance(error, UnexpectedToken) else set()
    due = _due(expected)
    return f"{seen}{place}; {due}" if due else f"{seen}{place}"


def _due(expected: set[str]) -> str:
    """What may stand at a place, in words."""
    shown: list[str] = []
    rest = set(expected)
    if expected >= _VALUES:
        shown.append("a value")
        rest -= _VALUES | {"NAME", "LPAR", "PLUS", "MINUS"}
    if "COMPARE" in rest:
        rest -= _OPERATORS
        shown.append("an operator" if "MINUS" in expected else "a comparison")
    shown.extend(sorted(_SHOWN.get(token, token) for token in rest))
    if not 0 < len(shown) <= MAX_NAMED:
        return ""
    return f"{' or '.join(shown)} is due"
