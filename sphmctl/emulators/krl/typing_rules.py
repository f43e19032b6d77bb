"""The types of expressions in a scope: what is not declared or does not fit is reported.

Not responsible for statements. Rules: SI, "Operators" and "Data types"; a type that cannot be
known is None, and nothing is said about it.
"""

from __future__ import annotations

from collections.abc import Sequence

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.functions import FUNCTIONS, Function
from sphmctl.emulators.krl.kinds import (
    BOOL,
    CHAR,
    FRAMES,
    INT,
    NUMBERS,
    REAL,
    AggregateKind,
    AnyEnum,
    ArrayKind,
    EnumKind,
    Kind,
    StructKind,
    fits,
    is_text,
)
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.symbols import Scope, Subprogram

LOGIC = ("AND", "OR", "EXOR")
BITS = ("B_AND", "B_OR", "B_EXOR")
EQUALITY = ("==", "<>")


class Types:
    """Finds the types of expressions in one scope."""

    def __init__(self, scope: Scope, report: Report) -> None:
        self._scope = scope
        self._report = report

    def of(self, node: n.Expression) -> Kind | None:
        """The type of an expression, everything in it checked."""
        if isinstance(node, n.Name | n.Field | n.Index):
            return self.of_reference(node)
        if isinstance(node, n.Call):
            return self.of_call(node, as_statement=False)
        if isinstance(node, n.Unary):
            return self._unary(node)
        if isinstance(node, n.Binary):
            return self._binary(node)
        if isinstance(node, n.Aggregate):
            return self._aggregate(node)
        return self._literal(node)

    def _literal(
        self,
        node: n.IntLiteral | n.RealLiteral | n.BoolLiteral | n.StringLiteral | n.EnumLiteral,
    ) -> Kind | None:
        if isinstance(node, n.EnumLiteral):
            if not any(node.name in kind.members for kind in self._scope.enums()):
                message = f"#{node.name} is a value of no ENUM that is declared"
                self._report.error(node.at, "undeclared", message)
                return None
            return AnyEnum(node.name)
        if isinstance(node, n.StringLiteral):
            return ArrayKind(CHAR, (len(node.value),))
        if isinstance(node, n.BoolLiteral):
            return BOOL
        return INT if isinstance(node, n.IntLiteral) else REAL

    def of_reference(self, node: n.Reference) -> Kind | None:
        """The type of what a name leads to."""
        if isinstance(node, n.Name):
            variable = self._scope.variable(node.name)
            if variable is None:
                self._undeclared(node)
                return None
            return variable.kind
        base = self.of_reference(node.base)
        if isinstance(node, n.Index):
            return self._index(node, base)
        if base is None:
            return None
        if not isinstance(base, StructKind):
            self._wrong(node, f"{base.name} has no parts; {node.name} cannot be taken from it")
            return None
        there, kind = base.field(node.name)
        if not there:
            parts = ", ".join(name for name, _ in base.fields[:12])
            message = f"{base.name} has no part {node.name}; it has {parts}"
            self._report.error(node.at, "undeclared", message)
        return kind

    def _undeclared(self, node: n.Name) -> None:
        if self._scope.routine(node.name):
            message = f"{node.name} is a routine; write {node.name}()"
        elif node.name.startswith("$"):
            message = f"the system variable {node.name} is not known to the emulated controller"
        else:
            message = f"{node.name} is not declared"
        self._report.error(node.at, "undeclared", message)

    def _index(self, node: n.Index, base: Kind | None) -> Kind | None:
        for index in node.indices:
            if index is not None:
                self.need(index, INT, "an index")
        if base is None:
            return None
        if not isinstance(base, ArrayKind):
            self._wrong(node, f"{base.name} is no array and takes no [..]")
            return None
        if len(node.indices) != len(base.sizes):
            count = len(base.sizes)
            self._wrong(node, f"the array has {count} dimension{'s' if count > 1 else ''}", "array")
            return None
        for index, size in zip(node.indices, base.sizes, strict=True):
            if isinstance(index, n.IntLiteral) and not 1 <= index.value <= (size or index.value):
                self._wrong(
                    index, f"the index {index.value} is outside 1 to {size or '..'}", "array"
                )
        return self._element(node, base)

    def _element(self, node: n.Index, base: ArrayKind) -> Kind | None:
        if not any(node.indices):
            return base
        open_at = [i for i, index in enumerate(node.indices) if index is None]
        if not open_at:
            return base.element
        if open_at != [len(node.indices) - 1] or base.element not in (CHAR, None):
            self._wrong(node, "only the last index of a CHAR array can be left out", "array")
            return None
        return ArrayKind(base.element, (base.sizes[-1],))

    def of_call(self, node: n.Call, as_statement: bool) -> Kind | None:
        """The type that a call gives; None also when nothing comes back."""
        routine = self._scope.routine(node.name)
        if routine is None:
            return self._of_built_in(node, as_statement)
        self._arguments(node, routine)
        if not routine.is_function and not as_statement:
            self._wrong(node, f"{node.name} gives no value; a function is written with DEFFCT")
        return routine.result

    def _arguments(self, node: n.Call, routine: Subprogram) -> None:
        count, given = len(routine.parameters), len(node.arguments)
        if given > count:
            self._wrong(node, f"{node.name} takes {count} arguments, not {given}", "arguments")
        elif given < count:
            message = f"{node.name} takes {count} arguments; those left out are undefined in it"
            self._report.warn(node.at, "arguments", message)
        for argument, (kind, mode) in zip(node.arguments, routine.parameters, strict=False):
            if argument is None:
                continue
            own = self.of(argument)
            if mode == "OUT" and not isinstance(argument, n.Name | n.Field | n.Index):
                self._wrong(
                    argument, f"{node.name} writes here (:OUT); a variable is due", "arguments"
                )
            elif mode == "OUT" and isinstance(own, ArrayKind) and not _written_whole(argument):
                self._wrong(argument, "an array is handed over with empty brackets", "arguments")
            if not _argument_fits(kind, own):
                message = f"{_name(own)} cannot be given to {node.name}, which takes {_name(kind)}"
                self._wrong(argument, message)

    def _of_built_in(self, node: n.Call, as_statement: bool) -> Kind | None:
        kinds = [None if part is None else self.of(part) for part in node.arguments]
        function = FUNCTIONS.get(node.name)
        if function is None:
            variable = self._scope.variable(node.name)
            hint = "; an array takes [..]" if variable else ""
            message = f"the routine {node.name} is not known here{hint}"
            self._report.error(node.at, "undeclared", message)
            return None
        if not function.least <= len(kinds) <= function.most:
            span = (
                f"{function.least}"
                if function.least == function.most
                else f"{function.least} to {function.most}"
            )
            self._wrong(node, f"{node.name} takes {span} arguments, not {len(kinds)}", "arguments")
        if not function.result and not as_statement:
            self._wrong(node, f"{node.name} gives no value")
        return self._result(function, kinds)

    def _result(self, function: Function, kinds: Sequence[Kind | None]) -> Kind | None:
        if function.result == "SAME":
            return kinds[0] if kinds else None
        if function.result in ("", "ANY"):
            return None
        basic: dict[str, Kind] = {"INT": INT, "REAL": REAL, "BOOL": BOOL}
        if function.result in basic:
            return basic[function.result]
        scope: Scope | None = self._scope
        while scope is not None and scope.level != "system":
            scope = scope.parent
        return scope.types.get(function.result) if scope else None

    def _unary(self, node: n.Unary) -> Kind | None:
        if node.operator == "NOT":
            self.need(node.operand, BOOL, "NOT")
            return BOOL
        if node.operator == "B_NOT":
            self.need(node.operand, INT, "B_NOT")
            return INT
        kind = self.of(node.operand)
        if kind is not None and kind not in NUMBERS:
            self._wrong(node, f"a sign takes INT or REAL, not {kind.name}")
            return None
        return kind

    def _binary(self, node: n.Binary) -> Kind | None:
        operator = node.operator
        if operator in LOGIC or operator in BITS:
            wanted = BOOL if operator in LOGIC else INT
            self.need(node.left, wanted, operator)
            self.need(node.right, wanted, operator)
            return wanted
        left, right = self.of(node.left), self.of(node.right)
        if operator == ":":
            return self._frames(node, left, right)
        if operator in ("+", "-", "*", "/"):
            for kind in (left, right):
                if kind is not None and kind not in NUMBERS:
                    self._wrong(node, f"{operator} takes INT or REAL, not {kind.name}")
                    return None
            if left is None or right is None:
                return None
            return INT if left == right == INT else REAL
        self._compare(node, left, right)
        return BOOL

    def _frames(self, node: n.Binary, left: Kind | None, right: Kind | None) -> Kind | None:
        for kind in (left, right):
            named = isinstance(kind, StructKind) and kind.name in FRAMES
            if kind is not None and not named and not isinstance(kind, AggregateKind):
                self._wrong(node, f": joins frames and positions, not {kind.name}")
                return None
        return left if isinstance(right, AggregateKind) else right

    def _compare(self, node: n.Binary, left: Kind | None, right: Kind | None) -> None:
        if left is None or right is None:
            return
        if not (fits(left, right) or fits(right, left) or _both_enum_values(left, right)):
            hint = _hint(node)
            self._wrong(node, f"{left.name} and {right.name} cannot be compared{hint}")
            return
        for kind in (left, right):
            whole = isinstance(kind, StructKind | AggregateKind | ArrayKind)
            if whole and not (is_text(kind) and CHAR in (left, right)):
                advice = "STRCOMP does it" if is_text(kind) else "compare its parts"
                self._wrong(node, f"{kind.name} cannot be compared as a whole; {advice}")
                return
            if kind == BOOL and node.operator not in EQUALITY:
                self._wrong(node, f"BOOL has no order; == and <> can stand here{_hint(node)}")
                return

    def _aggregate(self, node: n.Aggregate) -> Kind | None:
        kinds = {part.name: self.of(part.value) for part in node.components}
        if node.tag is None:
            return AggregateKind(tuple(kinds))
        kind = self._type(node.tag)
        if not isinstance(kind, StructKind):
            self._report.error(node.at, "type", f"{node.tag} is no STRUC that is declared")
            return None
        self.fill(node, kind, kinds)
        return kind

    def _type(self, name: str) -> Kind | None:
        scope: Scope | None = self._scope
        while scope is not None:
            if name in scope.types:
                return scope.types[name]
            scope = scope.parent
        return None

    def fill(
        self, node: n.Aggregate, kind: StructKind, kinds: dict[str, Kind | None] | None = None
    ) -> None:
        """Check the components of an aggregate against the structure it is given to."""
        for part in node.components:
            there, wanted = kind.field(part.name)
            if not there:
                parts = ", ".join(name for name, _ in kind.fields[:12])
                message = f"{kind.name} has no part {part.name}; it has {parts}"
                self._report.error(part.at, "undeclared", message)
                continue
            if part.is_text is not is_text(wanted) and wanted is not None:
                brackets = f"{part.name}[]" if is_text(wanted) else part.name
                self._wrong(part, f"this part of {kind.name} is written {brackets}")
                continue
            own = kinds.get(part.name) if kinds else self.of(part.value)
            self.match(part.value, wanted, own, f"{kind.name}.{part.name}")

    def match(self, node: n.Expression, wanted: Kind | None, own: Kind | None, what: str) -> None:
        """Check that a value fits what it is given to."""
        if isinstance(node, n.Aggregate) and isinstance(wanted, StructKind) and node.tag is None:
            self.fill(node, wanted)
            return
        if not fits(wanted, own):
            self._wrong(node, f"{what} is {_name(wanted)}; {_name(own)} cannot be given to it")
            return
        if is_text(wanted) and isinstance(node, n.StringLiteral) and isinstance(wanted, ArrayKind):
            size = wanted.sizes[0]
            if size is not None and len(node.value) > size:
                self._wrong(node, f"{what} has {size} characters, the text {len(node.value)}")

    def need(self, node: n.Expression, wanted: Kind, what: str) -> None:
        """Check that an expression is of a type."""
        own = self.of(node)
        if own is None or own == wanted:
            return
        if wanted in NUMBERS and own in NUMBERS:
            if wanted == INT:
                self._wrong(node, f"{what} takes INT, not REAL")
            return
        self._wrong(node, f"{what} takes {wanted.name}, not {own.name}{_hint(node)}")

    def _wrong(self, node: n.Node, message: str, code: str = "type") -> None:
        self._report.error(node.at, code, message)


def _hint(node: n.Expression) -> str:
    """What to add where the loose binding of comparisons may be the cause."""
    parts = (node.left, node.right) if isinstance(node, n.Binary) else (node,)
    for part in parts:
        if isinstance(part, n.Binary) and not part.grouped and part.operator in LOGIC:
            return "; comparisons bind loosest: put each in parentheses"
    return ""


def _name(kind: Kind | None) -> str:
    return kind.name if kind else "something else"


def _both_enum_values(left: Kind, right: Kind) -> bool:
    return (
        isinstance(left, AnyEnum | EnumKind)
        and isinstance(right, AnyEnum)
        and (isinstance(left, AnyEnum))
    )


def _written_whole(node: n.Expression | None) -> bool:
    return isinstance(node, n.Index) and node.indices[-1] is None


def _argument_fits(kind: Kind | None, own: Kind | None) -> bool:
    if isinstance(kind, ArrayKind) and isinstance(own, ArrayKind):
        same = kind.element is None or own.element is None or fits(kind.element, own.element)
        return same and len(kind.sizes) == len(own.sizes)
    return fits(kind, own)
