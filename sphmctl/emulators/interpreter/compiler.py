"""Routines to instructions: declarations, assignments, control flow. Calls and motions elsewhere.

A statement becomes one or several closures over the frame; calls inside of expressions are drawn
out in front of it, left to right. Control flow becomes jumps, so that GOTO, EXIT and RETURN need
no unwinding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sphmctl.emulators.interpreter import calls, motions
from sphmctl.emulators.interpreter.code import Code, Fn, Instruction, Local, Pause
from sphmctl.emulators.interpreter.expressions import Expressions, Typed
from sphmctl.emulators.interpreter.memory import Names
from sphmctl.emulators.interpreter.options import Options
from sphmctl.emulators.interpreter.signals import Signal, Terminals
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.blending import STOPPING, STOPPING_WRITES
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.functions import STOPS_ADVANCE
from sphmctl.emulators.krl.statements import root
from sphmctl.emulators.krl.walking import inside
from sphmctl.emulators.krl_text import Bool, Int, Real


@dataclass
class Mark:
    """An instruction to jump to, once its place is known."""

    at: int = -1


def declare(node: n.Routine, module: Names, name: str) -> Code:
    """A routine as its callers see it; `Builder.build` fills it."""
    result = None
    if node.result is not None:
        result = module.array(module.type(node.at, node.result.name), node.result.sizes)
    return Code(node.name, name, node.at, node.parameters, result)


class Builder:
    """Compiles one routine."""

    def __init__(
        self, code: Code, node: n.Routine, module: Names, terminals: Terminals, options: Options
    ) -> None:
        self.code = code
        self.names = Names("local", module)
        self.options = options
        self.at = node.at
        self.number = 0
        self.expressions = Expressions(self.names, code.locals, self._call)
        self._node = node
        self._terminals = terminals
        self._exits: list[Mark] = []
        self._labels: dict[str, Mark] = {}

    def build(self) -> None:
        """Compile the routine's text."""
        self._declarations()
        self.body(self._node.body)
        self.at = self._node.end
        self.number += 1
        self.emit(_end)
        for name, mark in self._labels.items():
            if mark.at < 0:
                raise fail(self._node.at, "goto", f"there is no label {name}")

    # Declarations

    def _declarations(self) -> None:
        declared: dict[str, tuple[n.Declare, n.Declarator]] = {}
        for entry in self._node.declarations:
            if isinstance(entry, n.Struc | n.Enum):
                self.names.note(entry)
            elif isinstance(entry, n.Signal):
                self._terminals.declare(self.names, entry)
            elif isinstance(entry, n.Declare):
                declared.update({part.name: (entry, part) for part in entry.variables})
        for parameter in self.code.parameters:
            if parameter.name not in declared:
                message = f"the parameter {parameter.name} has no declaration"
                raise fail(parameter.at, "undeclared", message)
            self._local(*declared.pop(parameter.name), parameter)
        for entry_, part in declared.values():
            self._local(entry_, part, None)

    def _local(self, entry: n.Declare, part: n.Declarator, parameter: n.Parameter | None) -> None:
        if part.value is not None:
            message = f"{part.name} gets a value in its declaration, which only a data list may do"
            raise fail(part.at, "initial", message)
        kind = self.names.type(entry.at, entry.type.name)
        sizes = part.sizes
        if parameter is not None and parameter.dimensions:
            sizes = (None,) * parameter.dimensions
        kind = self.names.array(kind, sizes)
        self.code.locals[part.name] = Local(len(self.code.kinds), kind, None in sizes)
        self.code.kinds.append(kind)

    # Instructions

    def emit(self, instruction: Instruction) -> None:
        """Put an instruction behind the others."""
        self.code.instructions.append(instruction)
        self.code.places.append(self.at)
        self.code.numbers.append(self.number)

    def temp(self) -> int:
        """A place of the frame for a value of the compiler's."""
        self.code.temps += 1
        return self.code.temps - 1

    def here(self) -> Mark:
        """A mark at the next instruction."""
        return Mark(len(self.code.instructions))

    def put(self, mark: Mark) -> None:
        """Let a mark be at the next instruction."""
        mark.at = len(self.code.instructions)

    def value(self, node: n.Expression, what: str, kind: Any) -> Fn:
        """An expression of a wanted type."""
        return self.expressions.constant(node, kind, what)

    def condition(self, node: n.Expression) -> Fn:
        """A BOOL."""
        return self.value(node, "a condition", Bool())

    def _call(self, node: n.Call) -> Typed:
        return calls.inside(self, node)

    def sync(self, *parts: n.Node) -> None:
        """Stop the advance run where one of these makes it stop; without any, always."""
        if parts and not any(self._stops(part) for part in parts):
            return
        number = self.number

        def wait(f: Any) -> Pause | None:
            if f.continued == number or not f.machine.ahead:
                return None
            return Pause.AGAIN

        self.emit(wait)

    def _stops(self, part: n.Node) -> bool:
        for node in inside(part):
            if isinstance(node, n.Call) and node.name in STOPS_ADVANCE:
                return True
            if isinstance(node, n.Name) and self._stopping(node.name):
                return True
        return isinstance(part, n.Assign) and root(part.target).name in STOPPING_WRITES

    def _stopping(self, name: str) -> bool:
        if name in STOPPING or (name == "$FLAG" and self.options.flags_stop_advance):
            return True
        variable = None if name in self.code.locals else self.names.variable(name)
        return variable is not None and isinstance(variable.box, Signal)

    def jump(self, mark: Mark) -> None:
        """Go on at a mark."""

        def go(f: Any) -> None:
            f.pc = mark.at

        self.emit(go)

    def jump_unless(self, condition: Fn, mark: Mark) -> None:
        """Go on at a mark when a condition is FALSE."""

        def go(f: Any) -> None:
            if not condition(f):
                f.pc = mark.at

        self.emit(go)

    # Statements

    def body(self, body: n.Body) -> None:
        """Compile statements."""
        for node in body:
            self.number += 1
            self.at = node.at
            self._statement(node)

    def _statement(self, node: n.Statement) -> None:
        if isinstance(node, n.Assign):
            self.sync(node)
            self.emit(calls.assignment(self, node))
        elif isinstance(node, n.Call):
            self.sync(node)
            calls.statement(self, node)
        elif isinstance(node, n.If):
            self._if(node)
        elif isinstance(node, n.For):
            self._for(node)
        elif isinstance(node, n.Switch):
            self._switch(node)
        elif isinstance(node, n.While | n.Repeat | n.Loop):
            self._loop(node)
        elif isinstance(node, n.Simple | n.Label | n.Goto | n.Return):
            self._word(node)
        elif isinstance(node, n.WaitFor | n.WaitSec):
            self._wait(node)
        elif isinstance(node, n.Motion):
            motions.motion(self, node)
        else:
            calls.event(self, node)

    def _if(self, node: n.If) -> None:
        otherwise, end = Mark(), Mark()
        self.sync(node.condition)
        self.jump_unless(self.condition(node.condition), otherwise)
        self.body(node.then)
        if node.otherwise:
            self.jump(end)
        self.put(otherwise)
        self.body(node.otherwise)
        self.put(end)

    def _switch(self, node: n.Switch) -> None:
        end, subject = Mark(), self.temp()
        self.sync(node.subject)
        typed = self.expressions.of(node.subject)
        fn, kind = typed.fn, typed.kind

        def keep(f: Any) -> None:
            f.temps[subject] = fn(f)

        self.emit(keep)
        for case in node.cases:
            following = Mark()
            self.number += 1
            self.at = case.at
            values = [
                self.value(v, "CASE", kind) if kind else self.expressions.of(v).fn
                for v in case.values
            ]
            self.jump_unless(_is_one_of(subject, values), following)
            self.body(case.body)
            self.jump(end)
            self.put(following)
        self.body(node.default or ())
        self.put(end)

    def _for(self, node: n.For) -> None:
        last, by = self.temp(), self.temp()
        self.sync(node.start, node.end, node.counter, *([node.step] if node.step else []))
        start = self.value(node.start, "FOR", Int())
        end = self.value(node.end, "TO", Int())
        step = self.value(node.step, "STEP", Int()) if node.step else lambda _: 1
        target = self.expressions.reference(node.counter)

        def begin(f: Any) -> None:
            target.box(f).value = start(f)
            f.temps[last], f.temps[by] = end(f), step(f)

        def inside_range(f: Any) -> bool:
            now, limit = target.raw(f), f.temps[last]
            return bool(now <= limit) if f.temps[by] > 0 else bool(now >= limit)

        def count(f: Any) -> None:
            target.box(f).value = target.raw(f) + f.temps[by]

        self.emit(begin)
        self._around(node.body, inside_range, count)

    def _around(self, body: n.Body, condition: Fn, behind: Instruction) -> None:
        top, end = self.here(), Mark()
        self.jump_unless(condition, end)
        self._inner(body, end)
        self.emit(behind)
        self.jump(top)
        self.put(end)

    def _inner(self, body: n.Body, end: Mark) -> None:
        self._exits.append(end)
        self.body(body)
        self._exits.pop()

    def _loop(self, node: n.While | n.Repeat | n.Loop) -> None:
        top, end = self.here(), Mark()
        if isinstance(node, n.While):
            self.sync(node.condition)
            self.jump_unless(self.condition(node.condition), end)
        self._inner(node.body, end)
        if isinstance(node, n.Repeat):
            self.number += 1
            self.at = node.until_at
            self.sync(node.until)
            self.jump_unless(self.condition(node.until), top)
        else:
            self.jump(top)
        self.put(end)

    def _word(self, node: n.Simple | n.Label | n.Goto | n.Return) -> None:
        if isinstance(node, n.Label):
            self.put(self._labels.setdefault(node.name, Mark()))
        elif isinstance(node, n.Goto):
            self.jump(self._labels.setdefault(node.label, Mark()))
        elif isinstance(node, n.Return):
            self._return(node)
        elif node.word == "EXIT":
            if not self._exits:
                raise fail(node.at, "exit", "EXIT stands outside of a loop")
            self.jump(self._exits[-1])
        else:
            self._special(node.word)

    def _special(self, word: str) -> None:
        following = self.number + 1
        if word in ("HALT", "RESUME"):
            if word == "HALT":
                self.sync()
            self.emit(_halt if word == "HALT" else _resume)
            return

        def note(f: Any) -> None:
            if word == "CONTINUE":
                f.continued = following
            else:
                f.guarded = following

        self.emit(note)

    def _return(self, node: n.Return) -> None:
        if node.value is None:
            self.emit(_end)
            return
        self.sync(node.value)
        if self.code.result is None:
            raise fail(node.at, "return", "only a function, from DEFFCT, returns a value")
        fn = self.value(node.value, f"{self.code.name}()", self.code.result)
        self.emit(lambda f: f.machine.leave(fn(f)))

    def _wait(self, node: n.WaitFor | n.WaitSec) -> None:
        self.sync()
        top = self.here()
        if isinstance(node, n.WaitSec):
            duration_s = self.value(node.duration, "WAIT SEC", Real())
            self.emit(lambda f: f.machine.wait_until(f, duration_s))
            return
        condition = self.condition(node.condition)

        def wait(f: Any) -> Pause | None:
            if f.machine.may_look() and condition(f):
                f.machine.looked()
                return None
            f.pc = top.at
            return Pause.CYCLE

        self.emit(wait)


def _end(f: Any) -> Pause | None:
    pause: Pause | None = f.machine.leave(None)
    return pause


def _halt(f: Any) -> Pause | None:
    pause: Pause | None = f.machine.halt()
    return pause


def _resume(f: Any) -> Pause | None:
    pause: Pause | None = f.machine.resume()
    return pause


def _is_one_of(subject: int, values: list[Fn]) -> Fn:
    def compare(f: Any) -> bool:
        wanted = f.temps[subject]
        return any(value(f) == wanted for value in values)

    return compare
