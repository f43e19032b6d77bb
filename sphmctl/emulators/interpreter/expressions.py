"""Expressions and references to closures over a frame. Not responsible for calls of routines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sphmctl.emulators.interpreter.code import Fn, Local
from sphmctl.emulators.interpreter.faults import OUT_OF_RANGE, KrlFaultError, invalid
from sphmctl.emulators.interpreter.memory import Names, Variable
from sphmctl.emulators.interpreter.operators import (
    BITS,
    COMPARE,
    INTEGER,
    LOGIC,
    SINGLE,
    chain,
    mixed,
)
from sphmctl.emulators.interpreter.values import (
    UNSET,
    Letter,
    Part,
    converter,
    copier,
    fresh,
    is_set,
    kind_name,
    real,
    whole,
)
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl_text import (
    Array,
    Bool,
    Char,
    Enum,
    Int,
    Real,
    Struct,
    Text,
    Type,
)


@dataclass(frozen=True)
class Typed:
    """A compiled expression; `kind` is None where only the value tells its type."""

    fn: Fn
    kind: Type | None


@dataclass(frozen=True)
class Target:
    """A compiled reference.

    Attributes:
        raw: the value, which may be None.
        box: what can be handed over by :OUT, and written.
        name: for messages.
        is_local: whether it begins with a variable of the routine.
    """

    raw: Fn
    box: Fn
    kind: Type
    name: str
    writable: bool
    is_local: bool


Calls = Callable[[n.Call], Typed]


class Expressions:
    """Compiles in one scope.

    Args:
        names: the module's.
        local: the routine's variables.
        calls: what becomes of a call inside of an expression.
    """

    def __init__(self, names: Names, local: dict[str, Local], calls: Calls) -> None:
        self.names = names
        self.local = local
        self._calls = calls

    def constant(self, node: n.Expression, kind: Type, name: str) -> Fn:
        """A value for a variable of a type, converted and copied."""
        if isinstance(node, n.Aggregate):
            return self._aggregate(node, kind, name)
        if isinstance(node, n.EnumLiteral) and isinstance(kind, Enum):
            if node.name not in kind.members:
                raise fail(node.at, "enum", f"#{node.name} is no {kind.name}")
            member = node.name
            return lambda _: member
        typed = self.of(node)
        inner = typed.fn
        if typed.kind == kind and not isinstance(kind, Struct | Array | Text):
            return inner
        convert = copier(kind) if typed.kind == kind else converter(kind, name)

        def give(f: Any) -> Any:
            value = inner(f)
            if value is None or not is_set(value):
                raise invalid(what)
            return convert(value)

        what = _text(node)
        return give

    def of(self, node: n.Expression) -> Typed:
        """Any expression, its scalar value checked to be set.

        Raises:
            KrlError: it is not understood.
        """
        if isinstance(node, n.Name | n.Field | n.Index):
            return self._value(self.reference(node))
        if isinstance(node, n.Unary):
            return self._unary(node)
        if isinstance(node, n.Binary):
            return self._binary(node)
        if isinstance(node, n.Call):
            return self._calls(node)
        if isinstance(node, n.Aggregate):
            kind = self._aggregate_kind(node)
            return Typed(self._aggregate(node, kind, kind_name(kind)), kind)
        value, kind_of = _literal(node)
        return Typed(lambda _: value, kind_of)

    def _value(self, target: Target) -> Typed:
        raw, name = target.raw, target.name
        if isinstance(target.kind, Struct | Array):
            return Typed(raw, target.kind)
        is_text = isinstance(target.kind, Text)

        def give(f: Any) -> Any:
            value = raw(f)
            if value is None:
                raise invalid(name)
            return value.replace(UNSET, " ") if is_text and UNSET in value else value

        return Typed(give, target.kind)

    # References

    def reference(self, node: n.Reference) -> Target:
        """A reference as something to read, write or hand over."""
        if isinstance(node, n.Name):
            return self._name(node)
        base = self.reference(node.base)
        if isinstance(node, n.Field):
            return self._field(node, base)
        for position, index in enumerate(node.indices):
            if index is not None:
                base = self._index(base, index, f"index {position + 1}")
        return base

    def _name(self, node: n.Name) -> Target:
        found: Local | Variable | None = self.local.get(node.name)
        if isinstance(found, Local):
            index = found.index
            return Target(
                lambda f: f.cells[index].value,
                lambda f: f.cells[index],
                found.kind,
                node.name,
                writable=True,
                is_local=True,
            )
        found = self.names.variable(node.name)
        if found is None:
            raise fail(node.at, "undeclared", f"{node.name} is not declared")
        box = found.box
        return Target(
            lambda _: box.value, lambda _: box, found.kind, node.name, found.writable, False
        )

    def _field(self, node: n.Field, base: Target) -> Target:
        kind = dict(base.kind.fields).get(node.name) if isinstance(base.kind, Struct) else None
        if kind is None:
            raise fail(node.at, "field", f"{base.name} has no component {node.name}")
        raw, part = base.raw, node.name
        name = f"{base.name}.{part}"

        def give(f: Any) -> Any:
            holder = raw(f)
            return None if holder is None else holder[part]

        def box(f: Any) -> Any:
            return Part(raw(f), part)

        return Target(give, box, kind, name, base.writable, base.is_local)

    def _index(self, base: Target, node: n.Expression, what: str) -> Target:
        index = self.constant(node, Int(), what)
        raw, base_box, kind, name = base.raw, base.box, base.kind, base.name
        if not isinstance(kind, Array | Text):
            raise fail(node.at, "array", f"{name} is no array")
        size = kind.size

        def place(f: Any) -> int:
            number: int = index(f)
            if 1 <= number <= size:
                return number - 1
            raise KrlFaultError(OUT_OF_RANGE, f"{name}[{number}]: the array ends at {size}")

        if isinstance(kind, Text):
            return Target(
                lambda f: Letter(base_box(f), place(f), size).value,
                lambda f: Letter(base_box(f), place(f), size),
                Char(),
                f"{name}[]",
                base.writable,
                base.is_local,
            )

        def give(f: Any) -> Any:
            holder = raw(f)
            at = place(f)
            if holder is None:
                raise invalid(name)
            if at < len(holder):
                return holder[at]
            raise KrlFaultError(OUT_OF_RANGE, f"{name}[{at + 1}]: it ends at {len(holder)}")

        return Target(
            give,
            lambda f: Part(raw(f), place(f)),
            kind.element,
            f"{name}[]",
            base.writable,
            base.is_local,
        )

    # Operators

    def _unary(self, node: n.Unary) -> Typed:
        inner = self.of(node.operand)
        fn, kind = inner.fn, inner.kind
        if node.operator == "NOT":
            return Typed(lambda f: not fn(f), Bool())
        if node.operator == "B_NOT":
            return Typed(lambda f: ~fn(f), Int())
        if node.operator == "-":
            if isinstance(kind, Int):
                return Typed(lambda f: whole(-fn(f)), Int())
            return Typed(lambda f: -fn(f), kind)
        return inner

    def _binary(self, node: n.Binary) -> Typed:
        name = node.operator
        left, right = self.of(node.left), self.of(node.right)
        if name == ":":
            return Typed(_apply(chain, left.fn, right.fn), right.kind)
        if name in COMPARE:
            return Typed(self._compare(node, left, right), Bool())
        if name in LOGIC:
            return Typed(_apply(LOGIC[name], left.fn, right.fn), Bool())
        if name in BITS:
            return Typed(_apply(BITS[name], left.fn, right.fn), Int())
        kinds = (left.kind, right.kind)
        if None in kinds:
            return Typed(_apply(mixed(name), left.fn, right.fn), None)
        if not all(isinstance(kind, Int | Real) for kind in kinds):
            raise fail(node.at, "type", f"{name} takes numbers")
        if any(isinstance(kind, Real) for kind in kinds):
            return Typed(_apply(SINGLE[name], left.fn, right.fn), Real())
        return Typed(_apply(INTEGER[name], left.fn, right.fn), Int())

    def _compare(self, node: n.Binary, left: Typed, right: Typed) -> Fn:
        for side in (left, right):
            if isinstance(side.kind, Struct | Array):
                raise fail(node.at, "type", "structures and arrays cannot be compared")
        compare = COMPARE[node.operator]
        if node.operator not in ("==", "<>"):
            kind = left.kind if isinstance(left.kind, Enum) else right.kind
            if isinstance(kind, Enum):
                order = kind.members.index
                inner = compare
                return _apply(lambda a, b: inner(order(a), order(b)), left.fn, right.fn)
        return _apply(compare, left.fn, right.fn)

    # Aggregates

    def _aggregate_kind(self, node: n.Aggregate) -> Type:
        if node.tag is not None:
            return self.names.type(node.at, node.tag)
        parts = {part.name for part in node.components}
        for name in ("FRAME", "POS", "E6POS", "E6AXIS"):
            kind = self.names.type(node.at, name)
            if isinstance(kind, Struct) and parts <= set(dict(kind.fields)):
                return kind
        raise fail(node.at, "aggregate", "write the type of this aggregate: {TYPE: ..}")

    def _aggregate(self, node: n.Aggregate, kind: Type, name: str) -> Fn:
        if not isinstance(kind, Struct):
            raise fail(node.at, "aggregate", f"{name} is no structure")
        if node.tag is not None and node.tag != kind.name:
            typed = self.of(node)
            return _apply_one(converter(kind, name), typed.fn)
        fields = dict(kind.fields)
        parts: list[tuple[str, Fn]] = []
        for part in node.components:
            if part.name not in fields:
                raise fail(part.at, "aggregate", f"{kind.name} has no component {part.name}")
            way = f"{name}.{part.name}"
            parts.append((part.name, self.constant(part.value, fields[part.name], way)))

        def make(f: Any) -> Any:
            made = fresh(kind)
            for part_name, fn in parts:
                made[part_name] = fn(f)
            return made

        return make


def _apply(compute: Callable[[Any, Any], Any], left: Fn, right: Fn) -> Fn:
    return lambda f: compute(left(f), right(f))


def _apply_one(compute: Callable[[Any], Any], inner: Fn) -> Fn:
    return lambda f: compute(inner(f))


def _literal(node: n.Expression) -> tuple[Any, Type | None]:
    if isinstance(node, n.IntLiteral):
        return node.value, Int()
    if isinstance(node, n.RealLiteral):
        return real(node.value), Real()
    if isinstance(node, n.BoolLiteral):
        return node.value, Bool()
    if isinstance(node, n.StringLiteral):
        kind = Char() if len(node.value) == 1 else Text(max(1, len(node.value)))
        return node.value, kind
    if isinstance(node, n.EnumLiteral):
        return node.name, None
    raise fail(node.at, "expression", "this is no value")


def _text(node: n.Expression) -> str:
    if isinstance(node, n.Name):
        return node.name
    if isinstance(node, n.Field):
        return f"{_text(node.base)}.{node.name}"
    if isinstance(node, n.Index):
        return f"{_text(node.base)}[]"
    return "the value"
