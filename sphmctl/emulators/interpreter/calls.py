"""Calls, assignments, and what interrupts and triggers do later. Part of the compiler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sphmctl.emulators.interpreter import functions
from sphmctl.emulators.interpreter.code import Code, Fn, Instruction, Pause
from sphmctl.emulators.interpreter.expressions import Expressions, Target, Typed
from sphmctl.emulators.interpreter.faults import NOT_ALLOWED, KrlFaultError, invalid
from sphmctl.emulators.interpreter.values import Box, Cell, converter_or_none, fresh
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.blending import FRAMES
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.functions import FUNCTIONS
from sphmctl.emulators.krl.statements import root
from sphmctl.emulators.krl.walking import inside as all_inside
from sphmctl.emulators.krl_text import Array, Bool, Int, Real

if TYPE_CHECKING:
    from sphmctl.emulators.interpreter.compiler import Builder

Arguments = Callable[[Any], list[Box]]


@dataclass(frozen=True)
class Action:
    """What an interrupt or trigger does: something at once, or a call.

    Attributes:
        prepare: where the right side is to be looked at when a trigger is planned: gives what
            to do when it fires.
    """

    perform: Fn | None = None
    code: Code | None = None
    arguments: Arguments | None = None
    prepare: Callable[[Any], Fn] | None = None


@dataclass(frozen=True)
class Wish:
    """A TRIGGER that waits for the next motion."""

    kind: str
    value: float
    delay_ms: float
    on_start: bool
    priority: int
    action: Action


def refuse(node: n.Call) -> Typed:
    """For places where no routine can be called."""
    if node.name in FUNCTIONS:
        message = f"{node.name} cannot be called here"
    else:
        message = f"the routine {node.name} cannot be called here; assign its result before"
    raise fail(node.at, "call", message)


def inside(builder: Builder, node: n.Call) -> Typed:
    """A call as a part of an expression."""
    code = builder.names.routine(node.name)
    if code is None:
        return functions.compiled(builder, node)
    if code.result is None:
        raise fail(node.at, "call", f"{node.name} gives no value")
    temp = builder.temp()
    builder.emit(_call(code, arguments(builder, code, node), temp))
    kind, name = code.result, f"{node.name}()"

    def result(f: Any) -> Any:
        value = f.temps[temp]
        if value is None:
            raise invalid(name)
        return value

    return Typed(result, kind)


def statement(builder: Builder, node: n.Call) -> None:
    """A call as a statement."""
    code = builder.names.routine(node.name)
    if code is None:
        fn = functions.compiled(builder, node).fn

        def perform(f: Any) -> None:
            fn(f)

        builder.emit(perform)
        return
    builder.emit(_call(code, arguments(builder, code, node), -1))


def _call(code: Code, give: Arguments, temp: int) -> Instruction:
    def call(f: Any) -> None:
        f.machine.call(code, give(f), temp)

    return call


def arguments(builder: Builder, code: Code, node: n.Call) -> Arguments:
    """The boxes of the parameters of a call; a parameter left out stays undefined."""
    given = () if node.arguments == (None,) else node.arguments
    if len(given) > len(code.parameters):
        message = f"{code.name} takes {len(code.parameters)} arguments, not {len(given)}"
        raise fail(node.at, "arguments", message)
    makers: list[Fn] = []
    for number, parameter in enumerate(code.parameters):
        argument = given[number] if number < len(given) else None
        makers.append(_argument(builder, code, parameter, argument))
    return lambda f: [make(f) for make in makers]


def _argument(
    builder: Builder, code: Code, parameter: n.Parameter, argument: n.Expression | None
) -> Fn:
    name = parameter.name
    if argument is None:
        # The routine may not be compiled yet: its types are looked up as it is called.
        return lambda _: Cell(None if code.locals[name].is_open else fresh(code.locals[name].kind))
    expressions = builder.expressions
    if parameter.mode == "OUT" and isinstance(argument, n.Name | n.Field | n.Index):
        return expressions.reference(argument).box
    if isinstance(argument, n.Aggregate):
        made: list[Fn] = []

        def later(f: Any) -> Cell:
            if not made:
                made.append(expressions.constant(argument, code.locals[name].kind, name))
            return Cell(made[0](f))

        return later
    typed = expressions.of(argument)
    fn = typed.fn
    known: list[Callable[[Any], Any]] = []

    def give(f: Any) -> Cell:
        if not known:
            known.append(converter_or_none(code.locals[name].kind, name))
        return Cell(known[0](fn(f)))

    return give


def assignment(builder: Builder, node: n.Assign) -> Instruction:
    """`target=value`."""
    target = builder.expressions.reference(node.target)
    _check_writable(node, target)
    base = node.target.base if isinstance(node.target, n.Index) else node.target
    if isinstance(base, n.Name) and base.name == "$CYCFLAG" and isinstance(node.target, n.Index):
        return _cyclic(builder, node.target, node.value)
    fn = builder.value(node.value, target.name, target.kind)
    box = target.box
    guarded = isinstance(base, n.Name) and base.name == "$GEAR_JERK"
    if root(node.target).name in FRAMES:
        return _frame(box, fn)

    def assign(f: Any) -> None:
        value = fn(f)
        if guarded and f.machine.interrupted:
            raise KrlFaultError(NOT_ALLOWED, "$GEAR_JERK is write-protected in an interrupt")
        box(f).value = value

    return assign


def _frame(box: Fn, fn: Fn) -> Instruction:
    """$TOOL, $BASE or a component: a change is counted while a motion is planned."""

    def assign(f: Any) -> None:
        holder, value = box(f), fn(f)
        if holder.value != value:
            f.machine.note_frame()
        holder.value = value

    return assign


def _check_writable(node: n.Assign, target: Target) -> None:
    if not target.writable:
        raise fail(node.at, "const", f"{target.name} can only be read")
    if isinstance(target.kind, Array):
        message = f"{target.name} is an array; its elements are assigned one by one"
        raise fail(node.at, "array", message)


def _cyclic(builder: Builder, target: n.Index, value: n.Expression) -> Instruction:
    """$CYCFLAG[n] takes the expression itself, looked at again in each cycle."""
    number = target.indices[0]
    if number is None:
        raise fail(target.at, "array", "$CYCFLAG needs its index")
    index = builder.value(number, "$CYCFLAG", Int())
    expressions = Expressions(builder.names, builder.code.locals, refuse)
    fn = expressions.constant(value, Bool(), "$CYCFLAG")

    def store(f: Any) -> None:
        f.machine.keep_cyclic(index(f), fn, f)

    return store


# Events


def event(builder: Builder, node: n.Statement) -> None:
    """TRIGGER, INTERRUPT, BRAKE and PULSE."""
    if isinstance(node, n.Trigger):
        _trigger(builder, node)
    elif isinstance(node, n.InterruptDeclare):
        _declare(builder, node)
    elif isinstance(node, n.InterruptSwitch):
        _switch(builder, node)
    elif isinstance(node, n.Brake):
        fast = node.kind != ""

        def brake(f: Any) -> Pause | None:
            pause: Pause | None = f.machine.brake(fast)
            return pause

        builder.emit(brake)
    elif isinstance(node, n.Pulse):
        builder.sync()
        fn = _pulse(builder.expressions, node)

        def pulse(f: Any) -> None:
            fn(f)

        builder.emit(pulse)
    else:
        raise fail(node.at, "statement", "this statement is not emulated")


def _pulse(expressions: Expressions, node: n.Pulse) -> Fn:
    output = expressions.reference(node.output)
    level = expressions.constant(node.level, Bool(), "PULSE")
    duration_s = expressions.constant(node.duration, Real(), "PULSE")
    return lambda f: f.machine.terminals.pulse(output.box(f), level(f), duration_s(f))


def _action(builder: Builder, node: n.Assign | n.Call | n.Pulse) -> Action:
    expressions = Expressions(builder.names, builder.code.locals, refuse)
    if isinstance(node, n.Pulse):
        return Action(perform=_pulse(expressions, node))
    if isinstance(node, n.Call):
        return _action_call(builder, node)
    if isinstance(node.target, n.Index) and node.target.base == n.Name(node.at, "$CYCFLAG"):
        store = _cyclic(builder, node.target, node.value)
        return Action(perform=store)
    target = expressions.reference(node.target)
    _check_writable(node, target)
    fn = expressions.constant(node.value, target.kind, target.name)

    def perform(f: Any) -> None:
        target.box(f).value = fn(f)

    def prepare(f: Any) -> Fn:
        box, value = target.box(f), fn(f)

        def put(_: Any) -> None:
            box.value = value

        return put

    return Action(perform=perform, prepare=prepare)


def _action_call(builder: Builder, node: n.Call) -> Action:
    code = builder.names.routine(node.name)
    if code is None:
        fn = functions.compiled(builder, node).fn
        return Action(perform=fn)
    own = builder.code.locals
    for argument in node.arguments:
        for part in all_inside(argument) if argument is not None else ():
            if isinstance(part, n.Name) and part.name in own:
                message = (
                    f"{part.name} is gone with its routine; what an interrupt or trigger hands "
                    "over stands in a data list"
                )
                raise fail(node.at, "arguments", message)
    return Action(code=code, arguments=arguments(builder, code, node))


def _trigger(builder: Builder, node: n.Trigger) -> None:
    value = builder.value(node.value, node.kind, Real())
    delay = builder.value(node.delay, "DELAY", Real()) if node.delay else lambda _: 0.0
    priority = builder.value(node.priority, "PRIO", Int()) if node.priority else lambda _: -1
    action = _action(builder, node.action)
    kind, on_start = node.kind, node.on_start

    def add(f: Any) -> None:
        wish = Wish(kind, value(f), delay(f), on_start, priority(f), action)
        f.machine.add_trigger(wish, f)

    builder.emit(add)


def _declare(builder: Builder, node: n.InterruptDeclare) -> None:
    priority = builder.value(node.priority, "the priority", Int())
    expressions = Expressions(builder.names, builder.code.locals, refuse)
    condition = expressions.constant(node.condition, Bool(), "the condition")
    action = _action(builder, node.action)
    is_global = node.is_global

    def declare(f: Any) -> Pause | None:
        pause: Pause | None = f.machine.declare_interrupt(
            priority(f), condition, action, is_global, f
        )
        return pause

    builder.emit(declare)


def _switch(builder: Builder, node: n.InterruptSwitch) -> None:
    mode = node.mode
    priority = builder.value(node.priority, "the priority", Int()) if node.priority else None

    def switch(f: Any) -> None:
        f.machine.switch_interrupt(mode, None if priority is None else priority(f))

    builder.emit(switch)
