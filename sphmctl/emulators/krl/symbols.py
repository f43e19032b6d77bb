"""What names mean in a set of modules: types, variables and routines, by scope.

Not responsible for statements. Scopes, innermost first: routine, data list of the same name,
everything global, what the controller predefines. Names of variables and of types are apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.kinds import BOOL, INT, ArrayKind, Basic, EnumKind, Kind, StructKind
from sphmctl.emulators.krl.parse import parse
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.words import BASIC_TYPES

PREDEFINED = Path(__file__).with_name("predefined.dat")

Level = Literal["system", "global", "module", "local"]

MAX_SIGNAL_BITS = 32
"""Of one SIGNAL, since it is read as an INT (SI, "SIGNAL")."""


@dataclass(frozen=True)
class Variable:
    """A declared name with a value.

    Attributes:
        io: "$IN", "$OUT" .. for a SIGNAL, else "".
        value: the number of a constant, where it is known.
    """

    name: str
    kind: Kind | None
    at: n.Place
    level: Level
    is_const: bool = False
    io: str = ""
    value: int | None = None


@dataclass(frozen=True)
class Subprogram:
    """A routine that can be called.

    Attributes:
        parameters: type and mode of each.
        node: its text, where it is one of the modules.
    """

    name: str
    at: n.Place
    parameters: tuple[tuple[Kind | None, str], ...]
    result: Kind | None
    is_function: bool
    is_global: bool
    module: str
    node: n.Routine | None = None


@dataclass
class Scope:
    """Names of one level; `parent` is asked for what is not here."""

    level: Level
    parent: Scope | None = None
    variables: dict[str, Variable] = field(default_factory=dict)
    types: dict[str, Kind] = field(default_factory=dict)
    routines: dict[str, Subprogram] = field(default_factory=dict)
    pending: dict[str, n.Struc] = field(default_factory=dict)

    def variable(self, name: str) -> Variable | None:
        """What a name means here."""
        found = self.variables.get(name)
        return found or (self.parent.variable(name) if self.parent else None)

    def routine(self, name: str) -> Subprogram | None:
        """The routine that a name calls here."""
        found = self.routines.get(name)
        return found or (self.parent.routine(name) if self.parent else None)

    def enums(self) -> Iterable[EnumKind]:
        """All ENUM types that can be seen from here."""
        yield from (kind for kind in self.types.values() if isinstance(kind, EnumKind))
        if self.parent:
            yield from self.parent.enums()


class Declarer:
    """Puts declarations into scopes, and reports what is wrong with them."""

    def __init__(self, report: Report) -> None:
        self._report = report

    def types(self, scope: Scope, entries: Iterable[n.Struc | n.Enum]) -> None:
        """Make types known; a STRUC may stand before the types of its members."""
        for entry in entries:
            if entry.name in scope.types or entry.name in scope.pending:
                self._report.error(entry.at, "double", f"the type {entry.name} is declared twice")
            elif isinstance(entry, n.Enum):
                scope.types[entry.name] = EnumKind(entry.name, entry.members)
            else:
                scope.pending[entry.name] = entry

    def finish(self, scope: Scope) -> None:
        """Work out the types that `types` left for later."""
        while scope.pending:
            self.type(scope, next(iter(scope.pending.values())).at, next(iter(scope.pending)))

    def type(self, scope: Scope, at: n.Place, name: str) -> Kind | None:
        """What the name of a type means."""
        if name in BASIC_TYPES:
            return Basic(name)
        if name in scope.types:
            return scope.types[name]
        if name in scope.pending:
            struc = scope.pending.pop(name)
            scope.types[name] = self._struct(scope, struc)
            return scope.types[name]
        if scope.parent:
            return self.type(scope.parent, at, name)
        self._report.error(
            at, "type", f"the type {name} is not declared; STRUC or ENUM would do it"
        )
        return None

    def _struct(self, scope: Scope, struc: n.Struc) -> StructKind:
        fields: list[tuple[str, Kind | None]] = []
        for member in struc.members:
            kind = self.type(scope, member.at, member.type.name)
            fields.append((member.name, self.array(scope, kind, member.sizes)))
        return StructKind(struc.name, tuple(fields))

    def array(
        self, scope: Scope, kind: Kind | None, sizes: Sequence[n.Expression | None]
    ) -> Kind | None:
        """A type with the sizes of a declaration."""
        if not sizes:
            return kind
        return ArrayKind(kind, tuple(self._size(scope, size) for size in sizes))

    def _size(self, scope: Scope, size: n.Expression | None) -> int | None:
        if size is None:
            return None
        value = size.value if isinstance(size, n.IntLiteral) else None
        if isinstance(size, n.Name) and (constant := scope.variable(size.name)):
            value = constant.value
        if value is None or value < 1:
            self._report.error(size.at, "array", "an array's size is a whole number from 1 on")
            return None
        return value

    def declare(self, scope: Scope, entry: n.Declare | n.Signal, in_list: bool = True) -> None:
        """Make the names of a declaration known."""
        if isinstance(entry, n.Signal):
            self._signal(scope, entry)
            return
        kind = self.type(scope, entry.at, entry.type.name)
        for part in entry.variables:
            self._values(part, entry.is_const, scope.level, in_list)
            value = part.value.value if isinstance(part.value, n.IntLiteral) else None
            self.put(
                scope,
                Variable(
                    part.name,
                    self.array(scope, kind, part.sizes),
                    part.at,
                    scope.level,
                    entry.is_const,
                    value=value if entry.is_const else None,
                ),
            )

    def _values(self, part: n.Declarator, is_const: bool, level: Level, in_list: bool) -> None:
        if part.value is not None and not in_list:
            message = (
                f"{part.name} gets a value in its declaration, which only a data list may do; "
                "assign it in the first statements"
            )
            self._report.error(part.at, "initial", message)
        if is_const and part.value is None and level != "system":
            self._report.error(part.at, "const", f"the constant {part.name} needs its value here")

    def _signal(self, scope: Scope, entry: n.Signal) -> None:
        kind: Kind = BOOL
        io = ""
        if entry.first is not None:
            base = entry.first.base
            io = base.name if isinstance(base, n.Name) else ""
            if io not in ("$IN", "$OUT", "$ANIN", "$ANOUT"):
                message = f"SIGNAL {entry.name} names inputs or outputs: $IN, $OUT, $ANIN or $ANOUT"
                self._report.error(entry.at, "signal", message)
            kind = Basic("REAL") if io in ("$ANIN", "$ANOUT") else BOOL
        if entry.first is not None and entry.last is not None:
            kind = INT
            self._bits(entry, entry.first, entry.last)
        read_only = io in ("$IN", "$ANIN")
        self.put(scope, Variable(entry.name, kind, entry.at, scope.level, read_only, io))

    def _bits(self, entry: n.Signal, first: n.Index, last: n.Index) -> None:
        ends = [index.indices[0] for index in (first, last)]
        numbers = [end.value for end in ends if isinstance(end, n.IntLiteral)]
        if len(numbers) == 2 and not 1 <= numbers[1] - numbers[0] + 1 <= MAX_SIGNAL_BITS:
            message = f"SIGNAL {entry.name} has 1 to {MAX_SIGNAL_BITS} bits, from low to high"
            self._report.error(entry.at, "signal", message)
        if first.base != last.base:
            message = f"SIGNAL {entry.name} goes from one input or output to another of the kind"
            self._report.error(entry.at, "signal", message)

    def put(self, scope: Scope, variable: Variable) -> None:
        """Make one variable known."""
        before = scope.variables.get(variable.name)
        if before is not None:
            where = f"{before.at.file}:{before.at.line}"
            message = f"{variable.name} is declared twice; the first time in {where}"
            self._report.error(variable.at, "double", message)
            return
        scope.variables[variable.name] = variable

    def routine(self, scope: Scope, node: n.Routine, is_global: bool, module: str) -> Subprogram:
        """What callers see of a routine; `scope` is its module's."""
        declared = {
            part.name: (entry.type, part.sizes)
            for entry in node.declarations
            if isinstance(entry, n.Declare)
            for part in entry.variables
        }
        parameters: list[tuple[Kind | None, str]] = []
        for parameter in node.parameters:
            kind: Kind | None = None
            if parameter.name in declared:
                type_name, sizes = declared[parameter.name]
                kind = self.type(scope, type_name.at, type_name.name)
                if parameter.dimensions:
                    kind = ArrayKind(kind, (None,) * parameter.dimensions)
                elif sizes:
                    kind = self.array(scope, kind, sizes)
            parameters.append((kind, parameter.mode))
        return Subprogram(
            node.name, node.at, tuple(parameters), self.result(scope, node.result),
            node.result is not None, is_global, module, node,
        )  # fmt: skip

    def external(self, scope: Scope, entry: n.Ext) -> Subprogram:
        """What an EXT line says of a routine."""
        parameters = []
        for part in entry.parameters:
            kind = self.type(scope, part.at, part.type.name) if part.type else None
            if part.dimensions:
                kind = ArrayKind(kind, (None,) * part.dimensions)
            parameters.append((kind, part.mode))
        result = self.result(scope, entry.result)
        is_function = entry.result is not None
        return Subprogram(
            entry.name, entry.at, tuple(parameters), result, is_function, True, "", None
        )

    def result(self, scope: Scope, kind: n.TypeName | None) -> Kind | None:
        """The type that a function gives."""
        if kind is None:
            return None
        return self.array(scope, self.type(scope, kind.at, kind.name), kind.sizes)


@lru_cache(maxsize=1)
def predefined() -> Scope:
    """What every controller knows; to be read only."""
    module = parse(PREDEFINED.read_text(encoding="ascii"), PREDEFINED.name)
    assert isinstance(module, n.DataList)
    scope = Scope("system")
    declarer = Declarer(Report())
    declarer.types(scope, (e for e in module.entries if isinstance(e, n.Struc | n.Enum)))
    declarer.finish(scope)
    for entry in module.entries:
        if isinstance(entry, n.Declare):
            declarer.declare(scope, entry)
        elif isinstance(entry, n.Ext):
            scope.routines[entry.name] = declarer.external(scope, entry)
    return scope
