"""Checks the statements of one routine: types, constants, jumps, loops and returns."""

from __future__ import annotations

from collections.abc import Iterator

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.kinds import (
    AXES,
    BOOL,
    CHAR,
    FRAMES,
    INT,
    REAL,
    AggregateKind,
    ArrayKind,
    EnumKind,
    Kind,
    StructKind,
    fits,
    is_text,
)
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.symbols import Scope
from sphmctl.emulators.krl.typing_rules import Types
from sphmctl.emulators.krl.words import words

PRIORITIES = range(1, 129)
"""Of interrupts and triggers (SI, "INTERRUPT DECL")."""

POINT_PARTS = words("X Y Z A B C S T E1 E2 E3 E4 E5 E6")
AXIS_PARTS = words("A1 A2 A3 A4 A5 A6 E1 E2 E3 E4 E5 E6")


def bodies(node: n.Statement) -> tuple[n.Body, ...]:
    """The bodies inside a statement."""
    if isinstance(node, n.If):
        return (node.then, node.otherwise)
    if isinstance(node, n.Switch):
        return (*(case.body for case in node.cases), node.default or ())
    if isinstance(node, n.For | n.While | n.Repeat | n.Loop):
        return (node.body,)
    return ()


def walk(body: n.Body) -> Iterator[n.Statement]:
    """All statements of a body, in the order of the text."""
    for node in body:
        yield node
        for inner in bodies(node):
            yield from walk(inner)


def root(node: n.Reference) -> n.Name:
    """The variable that a reference begins with."""
    while not isinstance(node, n.Name):
        node = node.base
    return node


class RoutineCheck:
    """Checks one routine in its scope."""

    def __init__(self, routine: n.Routine, scope: Scope, report: Report) -> None:
        self._routine = routine
        self._scope = scope
        self._report = report
        self._types = Types(scope, report)

    def run(self) -> None:
        """Check everything."""
        self._body(self._routine.body, in_loop=False)
        self._jumps()
        self._missing_return()

    def _body(self, body: n.Body, in_loop: bool) -> None:
        for node in body:
            self._statement(node)
            if isinstance(node, n.Simple) and node.word == "EXIT" and not in_loop:
                self._report.error(node.at, "exit", "EXIT stands outside of a loop")
            loop = in_loop or isinstance(node, n.For | n.While | n.Repeat | n.Loop)
            for inner in bodies(node):
                self._body(inner, loop)

    def _statement(self, node: n.Statement) -> None:
        types = self._types
        if isinstance(node, n.Assign):
            self.assign(node)
        elif isinstance(node, n.Call):
            types.of_call(node, as_statement=True)
        elif isinstance(node, n.If | n.While | n.WaitFor):
            types.need(node.condition, BOOL, "a condition")
        elif isinstance(node, n.Repeat):
            types.need(node.until, BOOL, "a condition")
        elif isinstance(node, n.For):
            self._for(node)
        elif isinstance(node, n.Switch):
            self._switch(node)
        elif isinstance(node, n.WaitSec):
            types.need(node.duration, REAL, "WAIT SEC")
        elif isinstance(node, n.Return):
            self._return(node)
        elif isinstance(node, n.Motion):
            self._motion(node)
        elif isinstance(node, n.Trigger | n.InterruptDeclare):
            self._event(node)
        elif isinstance(node, n.InterruptSwitch) and node.priority is not None:
            self._priority(node.priority, "INTERRUPT")
        elif isinstance(node, n.Pulse):
            self._pulse(node)

    def assign(self, node: n.Assign) -> None:
        """Check an assignment."""
        wanted = self._types.of_reference(node.target)
        own = self._types.of(node.value)
        name = root(node.target).name
        variable = self._scope.variable(name)
        if variable is not None and variable.is_const:
            kind = "an input" if variable.io else "a constant"
            system = variable.level == "system"
            reason = "can only be read" if system else f"is {kind} and cannot be assigned"
            self._report.error(node.at, "const", f"{name} {reason}")
        if isinstance(wanted, ArrayKind) and not is_text(wanted):
            message = f"{name} is an array; it is assigned element by element"
            self._report.error(node.at, "array", message)
            return
        if is_text(wanted) and isinstance(node.target, n.Name | n.Field):
            message = "a text is assigned with empty brackets: NAME[]"
            self._report.error(node.at, "array", message)
            return
        self._types.match(node.value, wanted, own, name)

    def _for(self, node: n.For) -> None:
        self._types.need(node.counter, INT, "a counter")
        for part in (node.start, node.end, node.step):
            if part is not None:
                self._types.need(part, INT, "FOR")
        self._writable(node.counter)
        if isinstance(node.step, n.IntLiteral) and node.step.value == 0:
            self._report.error(node.at, "range", "STEP 0 never reaches the end")

    def _writable(self, node: n.Reference) -> None:
        variable = self._scope.variable(root(node).name)
        if variable is not None and variable.is_const:
            self._report.error(node.at, "const", f"{variable.name} cannot be assigned")

    def _switch(self, node: n.Switch) -> None:
        kind = self._types.of(node.subject)
        if kind is not None and kind not in (INT, CHAR) and not isinstance(kind, EnumKind):
            message = f"SWITCH takes INT, CHAR or an ENUM, not {kind.name}"
            self._report.error(node.at, "type", message)
            return
        seen: set[n.Expression] = set()
        for case in node.cases:
            for value in case.values:
                own = self._types.of(value)
                if not fits(kind, own) or own == REAL:
                    message = f"this CASE never comes: SWITCH is over {kind.name if kind else '?'}"
                    self._report.error(case.at, "type", message)
                if value in seen:
                    self._report.error(case.at, "double", "the value stands in an earlier CASE")
                seen.add(value)

    def _return(self, node: n.Return) -> None:
        name = self._routine.name
        if self._routine.result is None and node.value is not None:
            message = f"{name} is no function; RETURN takes a value only in DEFFCT"
            self._report.error(node.at, "return", message)
        elif self._routine.result is not None and node.value is None:
            message = f"{name} is a function; RETURN needs its value"
            self._report.error(node.at, "return", message)
        if node.value is not None:
            own = self._types.of(node.value)
            routine = self._scope.routine(name)
            wanted = routine.result if routine and self._routine.result else None
            self._types.match(node.value, wanted, own, name)

    def _motion(self, node: n.Motion) -> None:
        points = (node.target,) if node.via is None else (node.via, node.target)
        for point in points:
            self._point(node, point, self._types.of(point))
        if node.angle is not None:
            self._types.need(node.angle, REAL, "CA")
        for setting in node.settings:
            self.assign(setting)

    def _point(self, node: n.Motion, point: n.Expression, kind: Kind | None) -> None:
        joints = node.kind in ("PTP", "PTP_REL", "SPTP")
        if isinstance(kind, AggregateKind):
            parts = set(kind.components)
            good = parts <= POINT_PARTS or (joints and parts <= AXIS_PARTS)
        else:
            names = (*FRAMES, *AXES) if joints else FRAMES
            good = kind is None or (isinstance(kind, StructKind) and kind.name in names)
        if not good:
            own = kind.name if kind else ""
            due = "axes or a point" if joints else "a point of X, Y, Z, A, B, C"
            self._report.error(point.at, "type", f"{node.kind} goes to {due}, not to {own}")

    def _event(self, node: n.Trigger | n.InterruptDeclare) -> None:
        if isinstance(node, n.Trigger):
            self._types.need(node.value, REAL, node.kind)
            if node.delay is not None:
                self._types.need(node.delay, REAL, "DELAY")
            word = "TRIGGER"
            whole = node.kind == "DISTANCE" and isinstance(node.value, n.IntLiteral)
            if whole and node.value not in (n.IntLiteral(node.at, 0), n.IntLiteral(node.at, 1)):
                message = "DISTANCE is 0 (start of the motion) or 1 (its end)"
                self._report.error(node.at, "range", message)
            if isinstance(node.action, n.Call) and node.priority is None:
                message = "a TRIGGER that calls a routine needs PRIO; PRIO=-1 chooses by itself"
                self._report.error(node.at, "priority", message)
        else:
            self._types.need(node.condition, BOOL, "a condition")
            word = "INTERRUPT"
        if node.priority is not None:
            self._priority(node.priority, word)
        self._statement(node.action)
        if isinstance(node.action, n.Call):
            self._no_locals(node.action, word)

    def _no_locals(self, call: n.Call, word: str) -> None:
        for argument in call.arguments:
            if isinstance(argument, n.Name | n.Field | n.Index):
                variable = self._scope.variable(root(argument).name)
                if variable is not None and variable.level == "local":
                    message = (
                        f"{variable.name} may be gone when the {word} calls {call.name}; "
                        "hand over variables of a data list"
                    )
                    self._report.error(argument.at, "runtime", message)

    def _priority(self, node: n.Expression, word: str) -> None:
        self._types.need(node, INT, "a priority")
        automatic = (
            word == "TRIGGER"
            and isinstance(node, n.Unary)
            and node.operator == "-"
            and node.operand == n.IntLiteral(node.at, 1)
        )
        if isinstance(node, n.IntLiteral) and node.value not in PRIORITIES:
            message = f"{node.value} is no priority of {word}; 1 to 128 are, but 40 to 80"
            self._report.error(node.at, "priority", message)
        elif isinstance(node, n.Unary) and not automatic:
            message = f"a priority of {word} is not negative, but for PRIO=-1 of TRIGGER"
            self._report.error(node.at, "priority", message)
        elif isinstance(node, n.IntLiteral) and 40 <= node.value <= 80:
            message = (
                f"priority {node.value} belongs to the system; 1, 2, 4 to 39, 81 to 128 do not"
            )
            self._report.warn(node.at, "priority", message)

    def _pulse(self, node: n.Pulse) -> None:
        self._types.need(node.output, BOOL, "PULSE")
        self._types.need(node.level, BOOL, "PULSE")
        self._types.need(node.duration, REAL, "PULSE")
        variable = self._scope.variable(root(node.output).name)
        if variable is not None and "$OUT" not in (variable.io, variable.name):
            message = f"PULSE takes an output, $OUT[n] or a SIGNAL on one, not {variable.name}"
            self._report.error(node.at, "type", message)

    def _jumps(self) -> None:
        labels: dict[str, tuple[tuple[int, ...], n.Label]] = {}
        gotos: list[tuple[tuple[int, ...], n.Goto]] = []

        def collect(body: n.Body, path: tuple[int, ...]) -> None:
            for number, node in enumerate(body):
                if isinstance(node, n.Label):
                    if node.name in labels:
                        message = f"the label {node.name} stands twice in {self._routine.name}"
                        self._report.error(node.at, "double", message)
                    labels[node.name] = (path, node)
                elif isinstance(node, n.Goto):
                    gotos.append((path, node))
                for branch, inner in enumerate(bodies(node)):
                    collect(inner, (*path, number, branch))

        collect(self._routine.body, ())
        for path, goto in gotos:
            if goto.label not in labels:
                message = f"{self._routine.name} has no label {goto.label}"
                self._report.error(goto.at, "goto", message)
            elif path[: len(labels[goto.label][0])] != labels[goto.label][0]:
                message = f"{goto.label} stands inside a loop or branch, into which nothing jumps"
                self._report.error(goto.at, "goto", message)

    def _missing_return(self) -> None:
        if self._routine.result is not None and not _ends(self._routine.body):
            message = f"{self._routine.name} can come to its end without RETURN"
            self._report.error(self._routine.end, "return", message)


def _ends(body: n.Body) -> bool:
    """Whether nothing comes to the end of a body; a GOTO is trusted to go elsewhere."""
    last = next((node for node in reversed(body) if not isinstance(node, n.Label)), None)
    if isinstance(last, n.Return | n.Goto):
        return True
    if isinstance(last, n.If):
        return _ends(last.then) and _ends(last.otherwise)
    if isinstance(last, n.Switch):
        branches = [case.body for case in last.cases]
        return last.default is not None and all(map(_ends, [*branches, last.default]))
    if isinstance(last, n.Loop):
        return not any(_leaves(node) for node in last.body)
    return False


def _leaves(node: n.Statement) -> bool:
    """Whether an EXIT in a statement leaves the loop around it."""
    if isinstance(node, n.Simple):
        return node.word == "EXIT"
    if isinstance(node, n.If | n.Switch):
        return any(_leaves(inner) for body in bodies(node) for inner in body)
    return False
