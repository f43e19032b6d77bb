"""The tree of KRL expressions, and what every node of the tree has. Part of `nodes`."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Place:
    """Where something stands.

    Attributes:
        file: the path as it was given.
        line: counted from 1.
    """

    file: str
    line: int


@dataclass(frozen=True, slots=True)
class Node:
    """What every node has; the one base class, so that the place is written once."""

    at: Place = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class IntLiteral(Node):
    """`12`, `'HFF'` or `'B0101'`; `base` is "", "H" or "B". Never negative: see Unary."""

    value: int
    base: str = ""


@dataclass(frozen=True, slots=True)
class RealLiteral(Node):
    """`1.5`, `1E-3`; not rounded to KRL's single precision."""

    value: float


@dataclass(frozen=True, slots=True)
class BoolLiteral(Node):
    """`TRUE` or `FALSE`."""

    value: bool


@dataclass(frozen=True, slots=True)
class StringLiteral(Node):
    """`"text"`; one character of it is also a CHAR."""

    value: str


@dataclass(frozen=True, slots=True)
class EnumLiteral(Node):
    """`#NAME`, without the mark."""

    name: str


@dataclass(frozen=True, slots=True)
class Component(Node):
    """`X 1.0` in an aggregate; `is_text` for `NAME[] "text"`."""

    name: str
    value: Expression
    is_text: bool = False


@dataclass(frozen=True, slots=True)
class Aggregate(Node):
    """`{X 1, Y 2}` or `{FRAME: X 1}`; components that are not named are missing, not 0."""

    tag: str | None
    components: tuple[Component, ...]


@dataclass(frozen=True, slots=True)
class Name(Node):
    """A variable, constant or signal, system variables with their `$`."""

    name: str


@dataclass(frozen=True, slots=True)
class Field(Node):
    """`base.NAME`."""

    base: Reference
    name: str


@dataclass(frozen=True, slots=True)
class Index(Node):
    """`base[i,j]`; None where the index is left out: `S[]` is (None,), `T[2,]` is (2, None)."""

    base: Reference
    indices: tuple[Expression | None, ...]


@dataclass(frozen=True, slots=True)
class Call(Node):
    """`NAME(a,,b)`; None for an argument that is left out. Also a statement."""

    name: str
    arguments: tuple[Expression | None, ...]


@dataclass(frozen=True, slots=True)
class Unary(Node):
    """`operator` is one of NOT B_NOT + -; `grouped` when it was written in parentheses."""

    operator: str
    operand: Expression
    grouped: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class Binary(Node):
    """`operator` is one of PRECEDENCE; `grouped` when it was written in parentheses."""

    operator: str
    left: Expression
    right: Expression
    grouped: bool = field(default=False, compare=False)


PRECEDENCE = {
    **dict.fromkeys((":",), 7),
    **dict.fromkeys(("*", "/"), 6),
    **dict.fromkeys(("+", "-"), 5),
    **dict.fromkeys(("AND", "B_AND"), 4),
    **dict.fromkeys(("EXOR", "B_EXOR"), 3),
    **dict.fromkeys(("OR", "B_OR"), 2),
    **dict.fromkeys(("==", "<>", "<", ">", "<=", ">="), 1),
}
"""How tightly a binary operator binds: comparisons loosest (Expert Programming KSS 5.2,
"Priority of operators"; the place of `:` is that of the public grammars); left-associative."""

UNARY_PRECEDENCE = 8

Reference = Name | Field | Index
Expression = (
    IntLiteral
    | RealLiteral
    | BoolLiteral
    | StringLiteral
    | EnumLiteral
    | Aggregate
    | Reference
    | Call
    | Unary
    | Binary
)
