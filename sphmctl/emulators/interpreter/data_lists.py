"""Data lists into memory, and programs into code. Not responsible for running them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from sphmctl.emulators.interpreter.calls import refuse
from sphmctl.emulators.interpreter.code import Code
from sphmctl.emulators.interpreter.compiler import Builder, declare
from sphmctl.emulators.interpreter.expressions import Expressions
from sphmctl.emulators.interpreter.memory import Memory, Names
from sphmctl.emulators.interpreter.options import Options
from sphmctl.emulators.interpreter.signals import Terminals
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.parse import parse, read
from sphmctl.emulators.krl.symbols import PREDEFINED

DELIVERED = Path(__file__).with_name("delivered")


@lru_cache(maxsize=1)
def predefined() -> n.DataList:
    """What every controller declares; its values are those of a $CONFIG.DAT as delivered."""
    module = parse(PREDEFINED.read_text(encoding="ascii"), PREDEFINED.name)
    assert isinstance(module, n.DataList)
    return module


@lru_cache(maxsize=1)
def delivered() -> tuple[n.Program, ...]:
    """Programs that a controller has when it comes."""
    modules = [read(path) for path in sorted(DELIVERED.glob("*.src"))]
    return tuple(module for module in modules if isinstance(module, n.Program))


def submit_program(init: Sequence[str], plc: Sequence[str]) -> n.Module:
    """SPS.SUB with lines in its two user folds, after KUKA's own (KSS 8.3, sps.sub)."""
    lines = [
        "DEF SPS( )",
        ";FOLD USER INIT",
        *init,
        ";ENDFOLD (USER INIT)",
        "LOOP",
        "WAIT FOR NOT($POWER_FAIL)",
        ";FOLD USER PLC",
        *plc,
        ";ENDFOLD (USER PLC)",
        "ENDLOOP",
        "END",
    ]
    return parse("\n".join(lines), "sps.sub")


def load_predefined(memory: Memory) -> None:
    """Declare what every controller has."""
    names = memory.system
    module = predefined()
    for entry in module.entries:
        if isinstance(entry, n.Struc | n.Enum):
            names.note(entry)
    _entries(memory, module, lambda _: names)


def load_lists(memory: Memory, terminals: Terminals, lists: Sequence[n.DataList]) -> None:
    """Declare what data lists hold, with its first values.

    Raises:
        KrlError: with file and line.
    """
    for module in lists:
        for entry in module.entries:
            if isinstance(entry, n.Struc | n.Enum):
                _owner(memory, module, entry.is_global).note(entry)
    for module in lists:
        for entry in module.entries:
            if isinstance(entry, n.Signal):
                terminals.declare(_owner(memory, module, entry.is_global), entry)
        _entries(memory, module, _chooser(memory, module))


def _chooser(memory: Memory, module: n.DataList) -> Any:
    return lambda is_global: _owner(memory, module, is_global)


def _owner(memory: Memory, module: n.DataList, is_global: bool) -> Names:
    """In $CONFIG.DAT everything is global."""
    if module.name.startswith("$") or is_global:
        return memory.globals
    return memory.module(module.name)


def _entries(memory: Memory, module: n.DataList, owner: Any) -> None:
    inner = memory.system if module.name == "$PREDEFINED" else memory.module(module.name)
    expressions = Expressions(inner, {}, refuse)
    nothing: Any = None
    for entry in module.entries:
        if isinstance(entry, n.Declare):
            for part in entry.variables:
                made = memory.declare(owner(entry.is_global), entry, part)
                if part.value is not None:
                    value = expressions.constant(part.value, made.kind, part.name)
                    made.box.value = value(nothing)
        elif isinstance(entry, n.Assign):
            target = expressions.reference(entry.target)
            value = expressions.constant(entry.value, target.kind, target.name)
            target.box(nothing).value = value(nothing)


def load_programs(
    memory: Memory, terminals: Terminals, programs: Sequence[n.Program], options: Options
) -> None:
    """Compile programs; those that a controller comes with where no other has their name.

    Raises:
        KrlError: with file and line.
    """
    own = {program.name for program in programs}
    every = [*(p for p in delivered() if p.name not in own), *programs]
    made: list[tuple[Code, n.Routine, Names]] = []
    for program in every:
        names = memory.module(program.name)
        for number, node in enumerate(program.routines):
            code = declare(node, names, program.name)
            if code.name in names.routines:
                raise fail(node.at, "double", f"the routine {code.name} stands twice")
            names.routines[code.name] = code
            if number == 0 or node.is_global:
                memory.globals.routines[code.name] = code
            made.append((code, node, names))
    for code, node, names in made:
        Builder(code, node, names, terminals, options).build()
