"""Ways through a tree: what stands inside a node, and which routine calls which."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.statements import walk
from sphmctl.emulators.krl.symbols import Scope

_BODIES = frozenset(("body", "then", "otherwise", "default"))


@dataclass(frozen=True)
class Part:
    """One routine with what surrounds it."""

    program: n.Program
    routine: n.Routine
    scope: Scope

    @property
    def key(self) -> tuple[str, str]:
        """Module and routine, unique in a set of modules."""
        return (self.program.name, self.routine.name)


def inside(node: n.Node) -> Iterator[n.Node]:
    """A node and all that stands in it, but for the statements of a block."""
    yield node
    for entry in fields(node):
        if entry.name in _BODIES:
            continue
        value = getattr(node, entry.name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, n.Node):
                yield from inside(part)


def at_once(node: n.Statement) -> Iterator[n.Node]:
    """What the interpreter looks at as it passes a statement: nothing that an event does later."""
    if isinstance(node, n.Trigger):
        for part in (node.value, node.delay, node.priority):
            if part is not None:
                yield from inside(part)
    elif not isinstance(node, n.InterruptDeclare):
        yield from inside(node)


class Calls:
    """Which routine calls which, at once or by an event."""

    def __init__(self, parts: Iterable[Part]) -> None:
        self.parts = {part.key: part for part in parts}
        self.direct = {key: self._called(part) for key, part in self.parts.items()}

    def _called(self, part: Part) -> tuple[tuple[str, str], ...]:
        found: dict[tuple[str, str], None] = {}
        for statement in walk(part.routine.body):
            for node in at_once(statement):
                if isinstance(node, n.Call) and (key := self.target(part, node)):
                    found[key] = None
        return tuple(found)

    def target(self, part: Part, call: n.Call) -> tuple[str, str] | None:
        """The routine that a call reaches, where its text is there."""
        routine = part.scope.routine(call.name)
        key = (routine.module, routine.name) if routine else ("", "")
        return key if key in self.parts else None

    def reach(self, start: Iterable[tuple[str, str]]) -> list[Part]:
        """The routines that are reached from some, these first."""
        order = list(dict.fromkeys(start))
        seen = set(order)
        for key in order:
            for called in self.direct[key]:
                if called not in seen:
                    seen.add(called)
                    order.append(called)
        return [self.parts[key] for key in order]

    def interrupted(self) -> list[Part]:
        """The routines that interrupts call, and what these call."""
        start = []
        for part in self.parts.values():
            for node in walk(part.routine.body):
                if isinstance(node, n.InterruptDeclare) and isinstance(node.action, n.Call):
                    key = self.target(part, node.action)
                    start.extend([key] if key else [])
        return self.reach(start)
