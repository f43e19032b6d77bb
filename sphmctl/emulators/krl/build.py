"""What the grammar's rules make of a line: one method for each rule, called by the parser.

Not responsible for the grammar itself, nor for what several lines make together. The children of
a rule are its tokens (strings) and what its inner rules have made, in the order of the grammar.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, TypeAlias

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl import words
from sphmctl.emulators.krl.findings import Finding, KrlError

MAX_DEPTH = 100
"""Levels of one expression, the terms of a sum included: what reads the tree goes down it by
recursion, and no public program has a third of this."""

MAX_INT = 2**31
"""INT has 32 bits (SI, "Data types"); this one only behind a minus."""

Children: TypeAlias = list[Any]


def fail(at: n.Place, code: str, message: str) -> KrlError:
    """An error at a place, to be raised."""
    return KrlError((Finding(at.file, at.line, "error", code, message),))


class Expressions:
    """The rules of expressions; `at` is the place that every node made gets."""

    def __init__(self) -> None:
        self.at = n.Place("", 0)
        self._depths: dict[int, tuple[int, Any]] = {}

    def begin(self, at: n.Place) -> None:
        """Expect the line at this place."""
        self.at = at
        self._depths.clear()

    def refuse(self, message: str, code: str = "syntax") -> KrlError:
        """An error on the present line, to be raised."""
        return fail(self.at, code, message)

    def deep(self, node: Any, *inner: Any) -> Any:
        """`node`, having counted how deep it goes."""
        depth = 1 + max((self._depths.get(id(part), (0, None))[0] for part in inner), default=0)
        if depth > MAX_DEPTH:
            raise self.refuse(
                f"the expression goes over {MAX_DEPTH} levels deep; cut it up", "size"
            )
        # The node is kept, so that no later one can have its id.
        self._depths[id(node)] = (depth, node)
        return node

    def used_name(self, token: str) -> str:
        """A name that is used."""
        name = token.upper()
        if name in words.RESERVED or name in words.BASIC_TYPES:
            raise self.refuse(f"{name} is a word of KRL; a value is due here")
        return name

    def int_literal(self, c: Children) -> n.IntLiteral:
        """`12`."""
        value = int(c[0]) if len(c[0]) <= 20 else MAX_INT + 1
        if value > MAX_INT:
            raise self.refuse(f"{c[0][:24]} is no INT; the largest is {MAX_INT - 1}", "range")
        return n.IntLiteral(self.at, value)

    def bits_literal(self, c: Children) -> n.IntLiteral:
        """`'HFF'` or `'B01'`."""
        base, digits = c[0][1:2].upper(), c[0][2:-1]
        allowed = {"H": "0123456789ABCDEF", "B": "01"}.get(base, "")
        if not digits or not set(digits.upper()) <= set(allowed):
            raise self.refuse(f"{c[0][:40]} is no number; write 'H0F' or 'B0101'")
        value = int(digits[:80], 16 if base == "H" else 2)
        if value >= 2 * MAX_INT:
            raise self.refuse(f"{c[0][:40]} has over 32 bits, which INT has", "range")
        return n.IntLiteral(self.at, value, base)

    def real_literal(self, c: Children) -> n.RealLiteral:
        """`1.5E-3`."""
        value = float(c[0])
        if value > 3.4028235e38:
            raise self.refuse(f"{c[0][:24]} is no REAL; the largest is 3.4E+38", "range")
        return n.RealLiteral(self.at, value)

    def true(self, _: Children) -> n.BoolLiteral:
        """`TRUE`."""
        return n.BoolLiteral(self.at, True)

    def false(self, _: Children) -> n.BoolLiteral:
        """`FALSE`."""
        return n.BoolLiteral(self.at, False)

    def string_literal(self, c: Children) -> n.StringLiteral:
        """`"text"`."""
        return n.StringLiteral(self.at, c[0][1:-1])

    def enum_literal(self, c: Children) -> n.EnumLiteral:
        """`#NAME`."""
        return n.EnumLiteral(self.at, c[0][1:].strip(" \t").upper())

    def name(self, c: Children) -> n.Name:
        """A reference of one name."""
        return n.Name(self.at, self.used_name(c[0]))

    def field(self, c: Children) -> n.Field:
        """`base.NAME`."""
        made: n.Field = self.deep(n.Field(self.at, c[0], c[1].upper()), c[0])
        return made

    def size(self, c: Children) -> n.Expression | None:
        """One index, or none."""
        return c[0] if c else None

    def indexed(self, c: Children) -> n.Index:
        """`base[i,j]`."""
        made: n.Index = self.deep(n.Index(self.at, c[0], self.dimensioned(c[1:])), *c)
        return made

    def dimensioned(self, sizes: Children) -> tuple[Any, ...]:
        """Indices or sizes, not more than there can be."""
        if len(sizes) > n.MAX_DIMENSIONS:
            raise self.refuse(f"an array has at most {n.MAX_DIMENSIONS} dimensions", "array")
        return tuple(sizes)

    def argument(self, c: Children) -> n.Expression | None:
        """One argument, or none."""
        return c[0] if c else None

    def call(self, c: Children) -> n.Call:
        """`NAME(a,,b)`; a single argument left out is no argument."""
        arguments = () if c[1:] == [None] else tuple(c[1:])
        made: n.Call = self.deep(n.Call(self.at, self.used_name(c[0]), arguments), *arguments)
        return made

    def value_component(self, c: Children) -> n.Component:
        """`X 1.0`."""
        made: n.Component = self.deep(n.Component(self.at, c[0].upper(), c[1]), c[1])
        return made

    def text_component(self, c: Children) -> n.Component:
        """`NAME[] "text"`."""
        if not isinstance(c[1], n.StringLiteral):
            raise self.refuse(f"{c[0].upper()}[] takes a text in quotation marks")
        return n.Component(self.at, c[0].upper(), c[1], is_text=True)

    def aggregate(self, c: Children) -> n.Aggregate:
        """`{FRAME: X 1}`."""
        tag = None if c[0] is None else c[0].upper()
        seen: set[str] = set()
        for component in c[1:]:
            if component.name in seen:
                raise self.refuse(f"{component.name} stands twice in the aggregate", "double")
            seen.add(component.name)
        made: n.Aggregate = self.deep(n.Aggregate(self.at, tag, tuple(c[1:])), *c[1:])
        return made

    def unary(self, c: Children) -> n.Unary:
        """`NOT x`."""
        made: n.Unary = self.deep(n.Unary(self.at, c[0].upper(), c[1]), c[1])
        return made

    def binary(self, c: Children) -> n.Binary:
        """`a + b`."""
        made: n.Binary = self.deep(n.Binary(self.at, c[1].upper(), c[0], c[2]), c[0], c[2])
        return made

    def group(self, c: Children) -> n.Expression:
        """`(x)`: kept as a mark on an operation, nothing else needs it."""
        inner: n.Expression = c[0]
        if not isinstance(inner, n.Unary | n.Binary):
            return inner
        made: n.Expression = (
            self.deep(replace(inner, grouped=True), inner.operand)
            if isinstance(inner, n.Unary)
            else self.deep(replace(inner, grouped=True), inner.left, inner.right)
        )
        return made


def optional(children: Children, word: str) -> tuple[bool, Children]:
    """Whether the optional first token is there, and the children behind it."""
    there = bool(children) and str(children[0]).upper() == word and isinstance(children[0], str)
    return there, children[1:] if there else children


BlendWord = Literal["C_PTP", "C_DIS", "C_VEL", "C_ORI", "C_SPL"]
