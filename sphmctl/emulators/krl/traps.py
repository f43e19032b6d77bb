"""Warnings: what runs on a controller, but hardly as it was meant.

Sources: SI, "KRL syntax" and "Submit interpreter"; Expert Programming KSS 5.2, "Priority of
operators", "PTP motions" and "Interrupts".
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.blending import find_blending_traps
from sphmctl.emulators.krl.functions import FUNCTIONS
from sphmctl.emulators.krl.kinds import INT, REAL
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.statements import root, walk
from sphmctl.emulators.krl.symbols import Scope
from sphmctl.emulators.krl.typing_rules import LOGIC, Types
from sphmctl.emulators.krl.walking import Calls, Part, at_once, inside

AXES = 6
SUBMIT_MOTION = "the submit interpreter cannot move the arm"
VELOCITY_COMMANDS = frozenset(("INITMOV", "PTP_PARAMS", "CP_PARAMS", "VEL_PTP", "VEL_CP"))


def find_traps(parts: Iterable[Part], report: Report) -> None:
    """Look at all routines of a set of modules."""
    calls = Calls(parts)
    for part in calls.parts.values():
        _expressions(part, report)
        _never_assigned(part, report)
    _submit(calls, report)
    _interrupts(calls, report)
    _motions(calls, report)
    find_blending_traps(calls, report)


def _expressions(part: Part, report: Report) -> None:
    types = Types(part.scope, Report())
    for statement in walk(part.routine.body):
        for node in inside(statement):
            if not isinstance(node, n.Binary):
                continue
            if n.PRECEDENCE[node.operator] == 1:
                _loose(node, report)
            if node.operator in ("+", "-", "*") and REAL in (
                types.of(node.left),
                types.of(node.right),
            ):
                _division(node.left, types, report)
                _division(node.right, types, report)
        if isinstance(statement, n.Assign) and types.of_reference(statement.target) == REAL:
            _division(statement.value, types, report)


def _loose(node: n.Binary, report: Report) -> None:
    for side in (node.left, node.right):
        logic = isinstance(side, n.Binary) and side.operator in LOGIC
        negation = isinstance(side, n.Unary) and side.operator == "NOT"
        chain = isinstance(side, n.Binary) and n.PRECEDENCE[side.operator] == 1
        risky = logic or negation or chain
        if risky and isinstance(side, n.Unary | n.Binary) and not side.grouped:
            message = (
                f"comparisons bind loosest in KRL: {side.operator} is worked out before "
                f"{node.operator}; put parentheses around what belongs together"
            )
            report.warn(node.at, "precedence", message)


def _division(node: n.Expression, types: Types, report: Report) -> None:
    if isinstance(node, n.Binary) and node.operator == "/" and types.of(node) == INT:
        message = "INT divided by INT loses what is behind the point; write one of them as 1.0"
        report.warn(node.at, "division", message)


def _never_assigned(part: Part, report: Report) -> None:
    """Local variables are undefined at each call; reading one stops the program."""
    parameters = {parameter.name for parameter in part.routine.parameters}
    own = {
        name
        for name, variable in part.scope.variables.items()
        if name not in parameters and not variable.io and not variable.is_const
    }
    written: set[str] = set()
    read: dict[str, n.Place] = {}
    for statement in walk(part.routine.body):
        targets = _targets(part.scope, statement)
        written.update(root(target).name for target in targets)
        for node in inside(statement):
            if isinstance(node, n.Name) and not any(node is root(target) for target in targets):
                read.setdefault(node.name, node.at)
    for name in sorted(own & (read.keys() - written)):
        report.warn(read[name], "undefined", f"{name} is read, but nothing gives it a value")


def _targets(scope: Scope, statement: n.Statement) -> list[n.Reference]:
    """What a statement writes, or may write."""
    targets: list[n.Reference] = []
    if isinstance(statement, n.For):
        targets.append(statement.counter)
    for node in inside(statement):
        if isinstance(node, n.Assign):
            targets.append(node.target)
        elif isinstance(node, n.Call):
            routine, built_in = scope.routine(node.name), FUNCTIONS.get(node.name)
            for number, argument in enumerate(node.arguments):
                modes = [mode for _, mode in routine.parameters] if routine else []
                by_routine = number >= len(modes) or modes[number] == "OUT"
                written = number in built_in.writes if built_in and not routine else by_routine
                if written and isinstance(argument, n.Name | n.Field | n.Index):
                    targets.append(argument)
    return targets


def _submit(calls: Calls, report: Report) -> None:
    start = [key for key, part in calls.parts.items() if part.program.kind == "sub"]
    for part in calls.reach(start):
        for node in walk(part.routine.body):
            if isinstance(node, n.Motion):
                report.error(node.at, "submit", f"{SUBMIT_MOTION}; {node.kind} belongs to a .src")
            elif isinstance(node, n.Brake) or node == n.Simple(node.at, "RESUME"):
                report.error(node.at, "submit", "BRAKE and RESUME belong to the robot interpreter")
            elif isinstance(node, n.WaitSec | n.WaitFor) or node == n.Simple(node.at, "HALT"):
                # The first line of the loop of every SPS.SUB as delivered.
                names = {inner.name for inner in inside(node) if isinstance(inner, n.Name)}
                if "$POWER_FAIL" not in names:
                    message = "the submit interpreter serves others as well and must not wait"
                    report.warn(node.at, "submit", message)


def _interrupts(calls: Calls, report: Report) -> None:
    routines = calls.interrupted()
    keys = {part.key for part in routines}
    for part in routines:
        for node in walk(part.routine.body):
            if isinstance(node, n.Call) and node.name == "BAS":
                message = "BAS cannot set up motion in an interrupt; do it before"
                report.warn(node.at, "interrupt", message)
            elif isinstance(node, n.Assign) and root(node.target).name == "$ADVANCE":
                report.warn(node.at, "interrupt", "$ADVANCE stays as it is in an interrupt")
    for part in calls.parts.values():
        if part.key in keys or part.program.kind == "sub":
            continue
        for node in walk(part.routine.body):
            if isinstance(node, n.Brake) or node == n.Simple(node.at, "RESUME"):
                word = "BRAKE" if isinstance(node, n.Brake) else "RESUME"
                message = f"{word} works only in a routine that an interrupt calls; none calls this"
                report.warn(node.at, "interrupt", message)


def _motions(calls: Calls, report: Report) -> None:
    """Speeds and the first motion, seen from each program that no other one calls."""
    called = {key for start, keys in calls.direct.items() for key in keys if key[0] != start[0]}
    for part in calls.parts.values():
        program = part.program
        if part.routine is not program.routines[0] or part.key in called or program.kind == "sub":
            continue
        reached = calls.reach([part.key])
        statements = [node for inner in reached for node in walk(inner.routine.body)]
        _speeds(statements, report)
        first = _first_motion(calls, part, set())
        if first is not None and not first.kind.endswith("PTP"):
            message = f"the first motion is {first.kind}; it has to be a PTP to a full position"
            report.warn(first.at, "first", message)


def _first_motion(calls: Calls, part: Part, seen: set[tuple[str, str]]) -> n.Motion | None:
    seen.add(part.key)
    for statement in walk(part.routine.body):
        if isinstance(statement, n.Motion):
            return statement
        for node in at_once(statement):
            key = calls.target(part, node) if isinstance(node, n.Call) else None
            if key is not None and key not in seen:
                found = _first_motion(calls, calls.parts[key], seen)
                if found is not None:
                    return found
    return None


def _speeds(statements: Sequence[n.Statement], report: Report) -> None:
    for node in statements:
        if isinstance(node, n.Call) and node.name == "BAS" and node.arguments:
            command = node.arguments[0]
            if isinstance(command, n.EnumLiteral) and command.name in VELOCITY_COMMANDS:
                return
    joint = [m for m in statements if isinstance(m, n.Motion) and m.kind in ("PTP", "PTP_REL")]
    path = [m for m in statements if isinstance(m, n.Motion) and m.kind[:3] in ("LIN", "CIR")]
    for name in ("$VEL_AXIS", "$ACC_AXIS"):
        missing = _axes_unset(statements, name)
        if joint and missing:
            axes = ", ".join(map(str, missing))
            message = f"{name} is not set for axis {axes} before this PTP; BAS(#INITMOV,0) does it"
            report.warn(joint[0].at, "velocity", message)
    for name in ("$VEL", "$ACC"):
        assigned = any(isinstance(a, n.Assign) and root(a.target).name == name for a in statements)
        if path and not assigned:
            message = f"{name}.CP is not set before this motion; BAS(#INITMOV,0) does it"
            report.warn(path[0].at, "velocity", message)


def _axes_unset(statements: Sequence[n.Statement], name: str) -> list[int]:
    """The axes that no assignment names; an index that is no number stands for all."""
    missing = set(range(1, AXES + 1))
    for node in statements:
        if isinstance(node, n.Assign) and root(node.target).name == name:
            index = node.target.indices[0] if isinstance(node.target, n.Index) else None
            missing -= {index.value} if isinstance(index, n.IntLiteral) else missing
    return sorted(missing)
