"""Everything that has a name on the controller: types, variables by scope, routines.

Scopes as in `krl.symbols`: data list of the module's name, global, predefined. A box once made
stays where it is, so that compiled programs may hold on to it. The variable server reads and
writes global names by their text.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter.faults import KrlFaultError
from sphmctl.emulators.interpreter.paths import NAME, Steps, box_at, steps_of, value_at
from sphmctl.emulators.interpreter.values import UNSET, Box, Cell, converter, fresh
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl_text import (
    Array,
    Bool,
    Char,
    Enum,
    Int,
    Real,
    RefusedError,
    Struct,
    Text,
    Type,
    parse,
    render,
)

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.code import Code

BASIC: dict[str, Type] = {"INT": Int(), "REAL": Real(), "BOOL": Bool(), "CHAR": Char()}

RANGES: dict[str, Type] = {
    "$OV_PRO": Int(0, 100),
    "$OV_ROB": Int(0, 100),
    "$OV_JOG": Int(0, 100),
    "$ADVANCE": Int(0, 5),
}
"""System variables that take only a part of INT (SI, "System variables")."""

OPEN_SIZE = 1_000_000
"""Size of a parameter's `A[]`: what is handed over has its own."""

PLACES_LIMIT = 4096
"""Names whose way is remembered; more than any client of the variable server asks for."""


@dataclass
class Variable:
    """A name with a value.

    Attributes:
        level: "system", "global" or "module".
        writable: by a program and by the variable server.
    """

    name: str
    kind: Type
    box: Box
    level: str
    writable: bool = True


@dataclass
class Names:
    """Names of one scope; `parent` is asked for what is not here."""

    level: str
    parent: Names | None = None
    variables: dict[str, Variable] = field(default_factory=dict)
    types: dict[str, Type] = field(default_factory=dict)
    routines: dict[str, Code] = field(default_factory=dict)
    pending: dict[str, n.Struc] = field(default_factory=dict)

    def variable(self, name: str) -> Variable | None:
        """What a name means here."""
        found = self.variables.get(name)
        return found or (self.parent.variable(name) if self.parent else None)

    def routine(self, name: str) -> Code | None:
        """The routine that a name calls here."""
        found = self.routines.get(name)
        return found or (self.parent.routine(name) if self.parent else None)

    def enums(self) -> Iterable[Enum]:
        """All ENUM types that can be seen from here."""
        yield from (kind for kind in self.types.values() if isinstance(kind, Enum))
        if self.parent:
            yield from self.parent.enums()

    def note(self, entry: n.Struc | n.Enum) -> None:
        """Make a type known; a STRUC may stand before the types of its members."""
        if isinstance(entry, n.Enum):
            self.types[entry.name] = Enum(entry.name, entry.members)
        else:
            self.pending[entry.name] = entry

    def type(self, at: n.Place, name: str) -> Type:
        """What the name of a type means.

        Raises:
            KrlError: it means nothing.
        """
        if name in BASIC:
            return BASIC[name]
        if name in self.types:
            return self.types[name]
        if name in self.pending:
            struc = self.pending.pop(name)
            self.types[name] = Struct(name, tuple(self._member(part) for part in struc.members))
            return self.types[name]
        if self.parent:
            return self.parent.type(at, name)
        raise fail(at, "type", f"the type {name} is not declared")

    def _member(self, part: n.StrucMember) -> tuple[str, Type]:
        return part.name, self.array(self.type(part.at, part.type.name), part.sizes)

    def array(self, kind: Type, sizes: Iterable[n.Expression | None]) -> Type:
        """A type with the sizes of a declaration; an open size gives OPEN_SIZE."""
        for size in reversed(tuple(sizes)):
            length = self._size(size) if size is not None else OPEN_SIZE
            kind = Text(length) if isinstance(kind, Char) else Array(kind, length)
        return kind

    def _size(self, size: n.Expression) -> int:
        value: Any = size.value if isinstance(size, n.IntLiteral) else None
        if isinstance(size, n.Name) and (constant := self.variable(size.name)):
            value = constant.box.value
        if not isinstance(value, int) or value < 1:
            raise fail(size.at, "array", "an array's size is a whole number from 1 on")
        return value


class Memory:
    """The controller's names. `data_lists.load` fills it, `system` adds what the controller says.

    Attributes:
        globals: what every program sees.
        modules: by the name of the module.
    """

    def __init__(self) -> None:
        self._system = Names("system")
        self.globals = Names("global", self._system)
        self.modules: dict[str, Names] = {}
        self._places: dict[str, tuple[Variable, Steps] | None] = {}

    @property
    def system(self) -> Names:
        """What every controller has."""
        return self._system

    def module(self, name: str) -> Names:
        """The scope of the data list and the programs of one name."""
        return self.modules.setdefault(name, Names("module", self.globals))

    def declare(self, names: Names, entry: n.Declare, part: n.Declarator) -> Variable:
        """Make one variable known, undefined."""
        kind = names.array(names.type(entry.at, entry.type.name), part.sizes)
        kind = RANGES.get(part.name, kind)
        writable = not entry.is_const
        made = Variable(part.name, kind, Cell(fresh(kind)), names.level, writable)
        names.variables[part.name] = made
        self._places.clear()
        return made

    def bind(self, name: str, box: Box, kind: Type | None = None) -> None:
        """Put another box under a system variable's name, before programs are loaded.

        Raises:
            KeyError: no such variable is predefined, and `kind` does not say what it is.
        """
        known = self._system.variables.get(name)
        if known is None:
            if kind is None:
                raise KeyError(name)
            known = Variable(name, kind, box, "system", writable=False)
            self._system.variables[name] = known
        known.box = box
        self._places.clear()

    def get(self, name: str) -> Any:
        """The value of a global variable."""
        return self._known(name).box.value

    def box(self, name: str) -> Box:
        """The box of a global variable."""
        return self._known(name).box

    def put(self, name: str, value: Any) -> None:
        """Set a global variable, whether programs may write it or not."""
        variable = self._known(name)
        variable.box.value = converter(variable.kind, name)(value)

    def _known(self, name: str) -> Variable:
        variable = self.globals.variable(name)
        if variable is None:
            raise KeyError(name)
        return variable

    # As the variable server sees it.

    def kind_of(self, name: str) -> Type | None:
        """The type of what a name leads to; None when it leads nowhere."""
        found = self._find(name)
        return None if found is None else found[1].kind

    def read_text(self, name: str) -> str | None:
        """The text of a variable or a part of it; None when the name is unknown."""
        found = self._find(name)
        if found is None:
            return None
        variable, way = found
        return render(way.kind, value_at(variable.box.value, way.steps)).replace(UNSET, " ")

    def write_text(self, name: str, text: str) -> bool:
        """Set a variable or a part of it; False when that is refused, and nothing changed."""
        found = self._find(name)
        if found is None or not found[0].writable:
            return False
        variable, way = found
        try:
            box_at(variable.box, variable.kind, way.steps).value = parse(way.kind, text)
        except (RefusedError, KrlFaultError):
            return False
        return True

    def _find(self, name: str) -> tuple[Variable, Steps] | None:
        if name in self._places:
            return self._places[name]
        match = NAME.match(name)
        variable = self.globals.variable(match[1].upper()) if match else None
        way = None
        if match is not None and variable is not None:
            way = steps_of(name, match.end(), variable.kind)
        found = None if variable is None or way is None else (variable, way)
        if len(self._places) < PLACES_LIMIT:
            self._places[name] = found
        return found
