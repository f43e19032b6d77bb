"""The tree of KRL declarations. Part of `nodes`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sphmctl.emulators.krl.expressions import Expression, Index, Node

MAX_DIMENSIONS = 3
"""Of an array: SI, "Arrays"."""


@dataclass(frozen=True, slots=True)
class TypeName(Node):
    """A type; `sizes` only for the result of a function, as in `DEFFCT CHAR[32] F()`."""

    name: str
    sizes: tuple[Expression, ...] = ()


@dataclass(frozen=True, slots=True)
class Declarator(Node):
    """One name of a declaration; a size is None for a parameter's `A[]`."""

    name: str
    sizes: tuple[Expression | None, ...] = ()
    value: Expression | None = None


@dataclass(frozen=True, slots=True)
class Declare(Node):
    """`DECL GLOBAL CONST INT A=1,B=2`."""

    type: TypeName
    variables: tuple[Declarator, ...]
    is_global: bool = False
    is_const: bool = False


@dataclass(frozen=True, slots=True)
class StrucMember(Node):
    """One member of a structure; its type is repeated where KRL writes it once for several."""

    type: TypeName
    name: str
    sizes: tuple[Expression, ...] = ()


@dataclass(frozen=True, slots=True)
class Struc(Node):
    """`STRUC T INT A,B, REAL C`."""

    name: str
    members: tuple[StrucMember, ...]
    is_global: bool = False


@dataclass(frozen=True, slots=True)
class Enum(Node):
    """`ENUM T A,B`."""

    name: str
    members: tuple[str, ...]
    is_global: bool = False


@dataclass(frozen=True, slots=True)
class Signal(Node):
    """`SIGNAL N $OUT[1] TO $OUT[8]`; `first` is None for `SIGNAL $X FALSE`, which has no line."""

    name: str
    first: Index | None
    last: Index | None = None
    is_global: bool = False


@dataclass(frozen=True, slots=True)
class Parameter(Node):
    """`X :IN` by value, `A[] :OUT` by reference; `type` only in EXT, where names do not stand."""

    name: str
    mode: Literal["IN", "OUT"]
    dimensions: int = 0
    type: TypeName | None = None


@dataclass(frozen=True, slots=True)
class Ext(Node):
    """`EXT BAS(BAS_COMMAND :IN,REAL :IN)`; `EXTFCT` has a result."""

    name: str
    parameters: tuple[Parameter, ...]
    result: TypeName | None = None


Declaration = Declare | Struc | Enum | Signal | Ext
