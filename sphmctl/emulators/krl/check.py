"""Checks a set of KRL modules as one controller would hold them.

Errors are what the controller refuses or stops at; warnings, in `traps`, are what runs otherwise
than it looks. Rules: SI, "KRL syntax"; what a rule cannot know it leaves alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.findings import Finding
from sphmctl.emulators.krl.kinds import ArrayKind, StructKind
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.statements import RoutineCheck
from sphmctl.emulators.krl.symbols import Declarer, Scope, Subprogram, predefined
from sphmctl.emulators.krl.traps import find_traps
from sphmctl.emulators.krl.typing_rules import Types
from sphmctl.emulators.krl.walking import Part


def check(modules: Sequence[n.Module]) -> tuple[Finding, ...]:
    """Everything that is found, by file and line."""
    return _Check(modules).run()


class _Check:
    def __init__(self, modules: Sequence[n.Module]) -> None:
        self._report = Report()
        self._declarer = Declarer(self._report)
        self._modules = modules
        self._lists = [module for module in modules if isinstance(module, n.DataList)]
        self._programs = [module for module in modules if isinstance(module, n.Program)]
        self._globals = Scope("global", predefined())
        self._scopes: dict[str, Scope] = {}

    def run(self) -> tuple[Finding, ...]:
        for module in self._modules:
            self._head(module)
        self._declare_types()
        self._declare_variables()
        self._declare_routines()
        parts = [part for program in self._programs for part in self._program(program)]
        find_traps(parts, self._report)
        return self._report.sorted()

    def _scope(self, name: str) -> Scope:
        """Of the data list and the routines of one name."""
        return self._scopes.setdefault(name, Scope("module", self._globals))

    def _head(self, module: n.Module) -> None:
        stem = PurePath(module.at.file).stem.upper()
        word = "first routine" if isinstance(module, n.Program) else "data list"
        if module.name != stem:
            message = f"the {word} is {module.name}; it has the name of the file, {stem}"
            self._report.error(module.at, "name", message)
        folds = 0
        for comment in module.comments:
            text = comment.text.strip().upper()
            folds += text.startswith("FOLD") - text.startswith("ENDFOLD")
            if folds < 0:
                self._report.warn(comment.at, "fold", "ENDFOLD without FOLD")
                folds = 0
        if folds:
            at = module.comments[-1].at
            self._report.warn(at, "fold", f"{folds} FOLD of this file without ENDFOLD")

    def _owner(self, module: n.DataList, is_global: bool, at: n.Place) -> Scope:
        """Where a declaration of a data list goes; in $CONFIG.DAT everything is global."""
        if module.name.startswith("$"):
            return self._globals
        if is_global and not module.is_public:
            message = f"GLOBAL needs DEFDAT {module.name} PUBLIC"
            self._report.error(at, "public", message)
        return self._globals if is_global else self._scope(module.name)

    def _declare_types(self) -> None:
        for module in self._lists:
            for entry in module.entries:
                if isinstance(entry, n.Struc | n.Enum):
                    scope = self._owner(module, entry.is_global, entry.at)
                    self._declarer.types(scope, (entry,))
        for scope in (self._globals, *self._scopes.values()):
            self._declarer.finish(scope)

    def _declare_variables(self) -> None:
        for module in self._lists:
            for entry in module.entries:
                if isinstance(entry, n.Declare | n.Signal):
                    scope = self._owner(module, entry.is_global, entry.at)
                    self._declarer.declare(scope, entry)
                elif isinstance(entry, n.Ext):
                    self._external(self._scope(module.name), entry)
            self._values(module)

    def _values(self, module: n.DataList) -> None:
        scope = self._scope(module.name)
        types = Types(scope, self._report)
        dummy = n.Routine(module.at, module.name, (), module.at)
        checker = RoutineCheck(dummy, scope, self._report)
        for entry in module.entries:
            if isinstance(entry, n.Assign):
                checker.assign(entry)
            elif isinstance(entry, n.Declare):
                for part in entry.variables:
                    variable = scope.variable(part.name)
                    if part.value is not None and variable is not None:
                        own = types.of(part.value)
                        types.match(part.value, variable.kind, own, part.name)

    def _external(self, scope: Scope, entry: n.Ext) -> None:
        """Of EXT, only what is not known better counts."""
        scope.routines.setdefault(entry.name, self._declarer.external(scope, entry))

    def _declare_routines(self) -> None:
        for program in self._programs:
            scope = self._scope(program.name)
            for number, node in enumerate(program.routines):
                is_global = number == 0 or node.is_global
                with_locals = self._with_types(scope, node)
                made = self._declarer.routine(with_locals, node, is_global, program.name)
                self._add(scope, made)
                if is_global:
                    self._add(self._globals, made)

    def _with_types(self, scope: Scope, node: n.Routine) -> Scope:
        """A module's scope with the types of one routine, for its parameters."""
        inner = Scope("local", scope)
        own = [entry for entry in node.declarations if isinstance(entry, n.Struc | n.Enum)]
        silent = Declarer(Report())
        silent.types(inner, own)
        silent.finish(inner)
        return inner

    def _add(self, scope: Scope, made: Subprogram) -> None:
        before = scope.routines.get(made.name)
        if before is not None and before.node is not None:
            message = f"the routine {made.name} stands twice; also in {_where(before.at)}"
            self._report.error(made.at, "double", message)
            return
        scope.routines[made.name] = made

    def _program(self, program: n.Program) -> Iterable[Part]:
        module_scope = self._scope(program.name)
        for node in program.routines:
            scope = Scope("local", module_scope)
            own = [entry for entry in node.declarations if isinstance(entry, n.Struc | n.Enum)]
            self._declarer.types(scope, own)
            self._declarer.finish(scope)
            for entry in node.declarations:
                if isinstance(entry, n.Declare | n.Signal):
                    self._declarer.declare(scope, entry, in_list=False)
                elif isinstance(entry, n.Ext) and scope.routine(entry.name) is None:
                    self._external(scope, entry)
            self._parameters(node, scope)
            RoutineCheck(node, scope, self._report).run()
            yield Part(program, node, scope)

    def _parameters(self, node: n.Routine, scope: Scope) -> None:
        seen: set[str] = set()
        for parameter in node.parameters:
            if parameter.name in seen:
                message = f"the parameter {parameter.name} stands twice"
                self._report.error(parameter.at, "double", message)
            seen.add(parameter.name)
            variable = scope.variables.get(parameter.name)
            if variable is None:
                message = f"the parameter {parameter.name} of {node.name} has no declaration"
                self._report.error(parameter.at, "undeclared", message)
                continue
            is_array = isinstance(variable.kind, ArrayKind)
            if is_array and parameter.mode == "IN" and not isinstance(variable.kind, StructKind):
                message = f"the array {parameter.name} is handed over by :OUT only"
                self._report.error(parameter.at, "arguments", message)


def _where(at: n.Place) -> str:
    return f"{at.file}:{at.line}"
