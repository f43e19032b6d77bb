"""The parser against generated trees, and against lines that no one would write."""

from __future__ import annotations

import string
import time
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.check import check
from sphmctl.emulators.krl.findings import Finding, KrlError
from sphmctl.emulators.krl.parse import parse
from sphmctl.emulators.krl.printer import to_text
from sphmctl.emulators.krl.words import BASIC_TYPES, RESERVED

AT = n.Place("a.src", 0)

names = st.text(string.ascii_uppercase + "_", min_size=1, max_size=8).filter(
    lambda text: text not in RESERVED and text not in (*BASIC_TYPES, "CA", "UNTIL")
)
places = st.just(AT)
literals = st.one_of(
    st.builds(n.IntLiteral, places, st.integers(0, 2**31), st.sampled_from(["", "H", "B"])),
    st.builds(n.RealLiteral, places, st.floats(0, 3e38).map(float)),
    st.builds(n.BoolLiteral, places, st.booleans()),
    st.builds(n.StringLiteral, places, st.text(" ;&#{}abcXYZ019", max_size=12)),
    st.builds(n.EnumLiteral, places, names),
)
simple_names = st.builds(n.Name, places, names)


def _references(inner: st.SearchStrategy[n.Expression]) -> st.SearchStrategy[n.Reference]:
    indices = st.lists(st.none() | inner, min_size=1, max_size=3).map(tuple)
    fields = st.builds(n.Field, places, simple_names, names)
    return st.one_of(
        simple_names,
        fields,
        st.builds(n.Index, places, simple_names | fields, indices),
    )


def _larger(inner: st.SearchStrategy[n.Expression]) -> st.SearchStrategy[n.Expression]:
    parts = st.lists(st.builds(n.Component, places, names, inner), min_size=1, max_size=3)
    unique = parts.filter(lambda c: len({part.name for part in c}) == len(c)).map(tuple)
    arguments = st.lists(st.none() | inner, max_size=3).map(tuple)
    return st.one_of(
        _references(inner),
        st.builds(n.Call, places, names, arguments.filter(lambda a: a != (None,))),
        st.builds(n.Unary, places, st.sampled_from(["NOT", "B_NOT", "+", "-"]), inner),
        st.builds(n.Binary, places, st.sampled_from(sorted(n.PRECEDENCE)), inner, inner),
        st.builds(n.Aggregate, places, st.none() | names, unique),
    )


# Deferred, so that hypothesis does not write the whole grammar into each message.
expressions: st.SearchStrategy[n.Expression] = st.deferred(
    lambda: st.recursive(st.one_of(literals, simple_names), _larger, max_leaves=6)
)
targets = _references(expressions)
assigns = st.builds(n.Assign, places, targets, expressions)
lines = st.one_of(
    assigns,
    st.builds(n.Label, places, names),
    st.builds(n.Goto, places, names),
    st.builds(n.Return, places, st.none() | expressions),
    st.builds(n.WaitFor, places, expressions),
    st.builds(n.WaitSec, places, expressions),
    st.builds(n.Brake, places, st.sampled_from(["", "F", "FF"])),
    st.builds(n.Pulse, places, targets, expressions, expressions),
    st.builds(n.Simple, places, st.sampled_from(["EXIT", "HALT", "CONTINUE", "RESUME"])),
    st.builds(
        n.Motion,
        places,
        st.sampled_from(["PTP", "LIN", "PTP_REL", "LIN_REL"]),
        expressions,
        blends=st.sampled_from([(), ("C_PTP",), ("C_DIS", "C_VEL")]),
    ),
    st.builds(
        n.Trigger,
        places,
        st.sampled_from(["DISTANCE", "PATH"]),
        expressions,
        assigns,
        st.none() | expressions,
        st.none() | expressions,
    ),
    st.builds(n.InterruptDeclare, places, expressions, expressions, assigns, st.booleans()),
    st.builds(n.InterruptSwitch, places, st.sampled_from(["ON", "OFF"]), st.none() | expressions),
)


def _blocks(inner: st.SearchStrategy[n.Statement]) -> st.SearchStrategy[n.Statement]:
    body = st.lists(inner, max_size=3).map(tuple)
    cases = st.lists(
        st.builds(n.Case, places, st.lists(expressions, min_size=1, max_size=2).map(tuple), body),
        min_size=1,
        max_size=2,
    ).map(tuple)
    optional = st.none() | expressions
    return st.one_of(
        st.builds(n.If, places, expressions, body, body),
        st.builds(n.Switch, places, expressions, cases, st.none() | body),
        st.builds(n.For, places, targets, expressions, expressions, optional, body),
        st.builds(n.While, places, expressions, body),
        st.builds(n.Repeat, places, expressions, body, places),
        st.builds(n.Loop, places, body),
    )


statements: st.SearchStrategy[n.Statement] = st.deferred(
    lambda: st.recursive(lines, _blocks, max_leaves=4)
)


@settings(max_examples=60, deadline=None)
@given(st.lists(statements, max_size=4).map(tuple))
def test_a_printed_tree_parses_to_itself(body: n.Body) -> None:
    tree = n.Program(AT, "src", (), (), (n.Routine(AT, "A", (), AT, body=body),))
    assert parse(to_text(tree), "a.src") == tree


operations: st.SearchStrategy[n.Expression] = st.recursive(
    simple_names,
    lambda inner: st.one_of(
        st.builds(n.Binary, places, st.sampled_from(["-", "/", ":", "AND", "=="]), inner, inner),
        st.builds(n.Unary, places, st.sampled_from(["NOT", "-"]), inner),
    ),
    max_leaves=8,
)


@settings(max_examples=60, deadline=None)
@given(operations)
def test_parentheses_are_printed_where_the_tree_needs_them(value: n.Expression) -> None:
    body = (n.Assign(AT, n.Name(AT, "X"), value),)
    tree = n.Program(AT, "src", (), (), (n.Routine(AT, "A", (), AT, body=body),))
    assert parse(to_text(tree), "a.src") == tree


WORDS = st.sampled_from(
    [*sorted(RESERVED), "X", "$OUT", "INT", "#A", "1", "1.5", "'HF'", '"a"', "=", "==", "(", ")"]
    + ["[", "]", "{", "}", ",", ".", ":", "+", "-", "<", "\n", "\n", "\n", "@", "DO", "FOR", "F()"]
)


@settings(max_examples=80, deadline=None)
@given(st.lists(WORDS, max_size=40).map(" ".join), st.sampled_from(["src", "dat", "sub"]))
def test_words_at_random_are_parsed_or_refused(text: str, suffix: str) -> None:
    _parse_or_refuse(text, suffix)
    _parse_or_refuse(f"DEF A()\n{text}\nEND", suffix)


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=200), st.sampled_from(["src", "dat"]))
def test_any_text_is_parsed_or_refused(text: str, suffix: str) -> None:
    _parse_or_refuse(text, suffix)


PROGRAMS = sorted(Path(__file__).with_name("programs").iterdir())

LONGEST_S = 2.0
"""Processor time in which any damaged program must be read; undamaged ones take some ms."""

damages = st.lists(
    st.tuples(
        st.sampled_from(["drop", "double", "swap", "put", "cut"]),
        st.integers(0, 10_000),
        st.one_of(WORDS, st.text(max_size=3)),
    ),
    min_size=1,
    max_size=6,
)


def _damaged(parts: list[str], damage: list[tuple[str, int, str]]) -> list[str]:
    for kind, number, text in damage:
        at = number % max(1, len(parts))
        if kind == "put":
            parts[at:at] = [text]
        elif kind == "drop":
            del parts[at : at + 1]
        elif kind == "double":
            parts[at:at] = parts[at : at + 1]
        elif kind == "swap":
            parts[at : at + 2] = parts[at : at + 2][::-1]
        else:
            del parts[at:]
    return parts


@settings(max_examples=120, deadline=None)
@given(st.sampled_from(PROGRAMS), st.booleans(), damages)
def test_a_damaged_program_is_parsed_or_refused_soon(
    path: Path, by_lines: bool, damage: list[tuple[str, int, str]]
) -> None:
    text = path.read_text(encoding="ascii")
    parts = text.splitlines(keepends=True) if by_lines else list(text)
    begin_s = time.process_time()
    _parse_or_refuse("".join(_damaged(parts, damage)), path.suffix[1:])
    assert time.process_time() - begin_s < LONGEST_S


def _parse_or_refuse(text: str, suffix: str) -> None:
    module: n.Module | None = None
    found: tuple[Finding, ...] = ()
    try:
        module = parse(text, f"a.{suffix}")
    except KrlError as error:
        found = error.findings
    if module is not None:
        found = check([module])
        assert parse(to_text(module), f"a.{suffix}") == module
    last = text.count("\n") + text.count("\r") + 1
    assert all(1 <= finding.line <= last and finding.message for finding in found)
