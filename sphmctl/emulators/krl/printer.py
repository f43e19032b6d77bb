"""A tree back to KRL text, such that parsing it gives the same tree.

Comments come out on lines of their own, before what they stood beside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sphmctl.emulators.krl import nodes as n

INDENT = "  "

_BLOCK_WORDS = {n.For: "FOR", n.While: "WHILE", n.Loop: "LOOP"}


def to_text(module: n.Module) -> str:
    """The module as a file."""
    page = _Page(module.comments)
    for header in module.headers:
        page.put(0, header.text)
    if isinstance(module, n.Program):
        for routine in module.routines:
            _routine(page, routine)
    else:
        page.put(module.at.line, f"DEFDAT {module.name}{' PUBLIC' if module.is_public else ''}")
        for entry in module.entries:
            text = statement(entry) if isinstance(entry, n.Assign) else declaration(entry)
            page.put(entry.at.line, text)
        page.flush()
        page.put(0, "ENDDAT")
    page.flush()
    return "\n".join(page.lines) + "\n"


class _Page:
    """The lines so far, and the comments still to come."""

    def __init__(self, comments: Sequence[n.Comment]) -> None:
        self.lines: list[str] = []
        self._comments = list(reversed(comments))

    def put(self, line: int, text: str, level: int = 0) -> None:
        """Write a line that stood on `line`, behind the comments up to there."""
        while self._comments and self._comments[-1].at.line <= line:
            self.lines.append(f"{INDENT * level};{self._comments.pop().text}")
        self.lines.append(INDENT * level + text)

    def flush(self) -> None:
        """Write the comments that are left."""
        while self._comments:
            self.lines.append(f";{self._comments.pop().text}")


def _routine(page: _Page, routine: n.Routine) -> None:
    page.put(routine.at.line, routine_head(routine))
    for entry in routine.declarations:
        page.put(entry.at.line, declaration(entry))
    _body(page, routine.body, 0)
    page.put(routine.end.line, "ENDFCT" if routine.result else "END")


def routine_head(routine: n.Routine) -> str:
    """The DEF or DEFFCT line."""
    word = f"DEFFCT {_type(routine.result)}" if routine.result else "DEF"
    mark = "GLOBAL " if routine.is_global else ""
    return f"{mark}{word} {routine.name}({', '.join(map(_parameter, routine.parameters))})"


def _parameter(part: n.Parameter) -> str:
    name = part.type.name if part.type else part.name
    brackets = f"[{',' * (part.dimensions - 1)}]" if part.dimensions else ""
    return f"{name}{brackets} :{part.mode}"


def _type(kind: n.TypeName) -> str:
    return kind.name + _sizes(kind.sizes)


def _sizes(sizes: Sequence[n.Expression | None]) -> str:
    return f"[{','.join(_optional(size) for size in sizes)}]" if sizes else ""


def _optional(node: n.Expression | None) -> str:
    return "" if node is None else expression(node)


def declaration(node: n.Declaration) -> str:
    """A declaration's line."""
    if isinstance(node, n.Ext):
        parameters = ", ".join(map(_parameter, node.parameters))
        word = f"EXTFCT {_type(node.result)}" if node.result else "EXT"
        return f"{word} {node.name}({parameters})"
    mark = "GLOBAL " if node.is_global else ""
    if isinstance(node, n.Declare):
        const = "CONST " if node.is_const else ""
        names = ",".join(map(_declarator, node.variables))
        return f"DECL {mark}{const}{node.type.name} {names}"
    if isinstance(node, n.Struc):
        parts = (f"{part.type.name} {part.name}{_sizes(part.sizes)}" for part in node.members)
        return f"{mark}STRUC {node.name} {', '.join(parts)}"
    if isinstance(node, n.Enum):
        return f"{mark}ENUM {node.name} {','.join(node.members)}"
    if node.first is None:
        return f"{mark}SIGNAL {node.name} FALSE"
    last = f" TO {expression(node.last)}" if node.last else ""
    return f"{mark}SIGNAL {node.name} {expression(node.first)}{last}"


def _declarator(part: n.Declarator) -> str:
    value = "" if part.value is None else f"={expression(part.value)}"
    return f"{part.name}{_sizes(part.sizes)}{value}"


def _body(page: _Page, body: Iterable[n.Statement], level: int) -> None:
    for node in body:
        _statement(page, node, level + 1)


def _statement(page: _Page, node: n.Statement, level: int) -> None:
    page.put(node.at.line, statement(node), level)
    if isinstance(node, n.If):
        _body(page, node.then, level)
        if node.otherwise:
            page.put(0, "ELSE", level)
            _body(page, node.otherwise, level)
        page.put(0, "ENDIF", level)
    elif isinstance(node, n.Switch):
        for case in node.cases:
            page.put(case.at.line, f"CASE {','.join(map(expression, case.values))}", level)
            _body(page, case.body, level)
        if node.default is not None:
            page.put(0, "DEFAULT", level)
            _body(page, node.default, level)
        page.put(0, "ENDSWITCH", level)
    elif isinstance(node, n.Repeat):
        _body(page, node.body, level)
        page.put(node.until_at.line, f"UNTIL {expression(node.until)}", level)
    elif isinstance(node, n.For | n.While | n.Loop):
        _body(page, node.body, level)
        page.put(0, f"END{_BLOCK_WORDS[type(node)]}", level)


def statement(node: n.Statement) -> str:
    """A statement's line; of a block, the line that opens it."""
    if isinstance(node, n.Motion):
        return _motion(node)
    if isinstance(node, n.Trigger | n.InterruptDeclare | n.InterruptSwitch):
        return _event(node)
    if isinstance(node, n.If | n.Switch | n.For | n.While | n.Repeat | n.Loop):
        return _opening(node)
    if isinstance(node, n.Assign):
        return f"{expression(node.target)}={expression(node.value)}"
    if isinstance(node, n.Call):
        return expression(node)
    if isinstance(node, n.Return):
        return f"RETURN {_optional(node.value)}".rstrip()
    if isinstance(node, n.Pulse):
        parts = (node.output, node.level, node.duration)
        return f"PULSE({','.join(map(expression, parts))})"
    return _word(node)


def _word(
    node: n.Label | n.Goto | n.Simple | n.WaitFor | n.WaitSec | n.Brake,
) -> str:
    if isinstance(node, n.Label):
        return f"{node.name}:"
    if isinstance(node, n.Goto):
        return f"GOTO {node.label}"
    if isinstance(node, n.Simple):
        return node.word
    if isinstance(node, n.WaitFor):
        return f"WAIT FOR {expression(node.condition)}"
    if isinstance(node, n.WaitSec):
        return f"WAIT SEC {expression(node.duration)}"
    return f"BRAKE {node.kind}".rstrip()


def _opening(node: n.If | n.Switch | n.For | n.While | n.Repeat | n.Loop) -> str:
    if isinstance(node, n.If):
        return f"IF {expression(node.condition)} THEN"
    if isinstance(node, n.Switch):
        return f"SWITCH {expression(node.subject)}"
    if isinstance(node, n.While):
        return f"WHILE {expression(node.condition)}"
    if isinstance(node, n.For):
        step = f" STEP {expression(node.step)}" if node.step else ""
        start, end = expression(node.start), expression(node.end)
        return f"FOR {expression(node.counter)}={start} TO {end}{step}"
    return "LOOP" if isinstance(node, n.Loop) else "REPEAT"


def _motion(node: n.Motion) -> str:
    via = f"{expression(node.via)}," if node.via else ""
    text = f"{node.kind} {via}{expression(node.target)}"
    if node.angle:
        text += f",CA {expression(node.angle)}"
    if node.settings:
        text += f" WITH {','.join(map(statement, node.settings))}"
    frame = (f"#{node.frame}",) if node.frame else ()
    return " ".join((text, *node.blends, *frame))


def _event(node: n.Trigger | n.InterruptDeclare | n.InterruptSwitch) -> str:
    if isinstance(node, n.InterruptSwitch):
        return f"INTERRUPT {node.mode} {_optional(node.priority)}".rstrip()
    if isinstance(node, n.InterruptDeclare):
        mark = "GLOBAL " if node.is_global else ""
        when = f"{expression(node.priority)} WHEN {expression(node.condition)}"
        return f"{mark}INTERRUPT DECL {when} DO {statement(node.action)}"
    start = " ONSTART" if node.on_start else ""
    delay = f" DELAY={expression(node.delay)}" if node.delay else ""
    priority = f" PRIO={expression(node.priority)}" if node.priority else ""
    when = f"{node.kind}={expression(node.value)}{start}{delay}"
    return f"TRIGGER WHEN {when} DO {statement(node.action)}{priority}"


def expression(node: n.Expression) -> str:
    """An expression, in parentheses only where it was written so or needs them."""
    if isinstance(node, n.Binary):
        return _binary(node)
    if isinstance(node, n.Unary):
        space = " " if node.operator.isidentifier() else ""
        text = f"{node.operator}{space}{_operand(node.operand, n.UNARY_PRECEDENCE)}"
        return f"({text})" if node.grouped else text
    if isinstance(node, n.Field):
        return f"{expression(node.base)}.{node.name}"
    if isinstance(node, n.Index):
        return expression(node.base) + _sizes(node.indices)
    if isinstance(node, n.Call):
        return f"{node.name}({','.join(map(_optional, node.arguments))})"
    if isinstance(node, n.Aggregate):
        tag = f"{node.tag}: " if node.tag else ""
        return f"{{{tag}{','.join(map(_component, node.components))}}}"
    return _leaf(node)


def _component(part: n.Component) -> str:
    value = _operand(part.value, n.UNARY_PRECEDENCE)
    return f"{part.name}{'[]' if part.is_text else ''} {value}"


def _leaf(
    node: n.IntLiteral | n.RealLiteral | n.BoolLiteral | n.StringLiteral | n.EnumLiteral | n.Name,
) -> str:
    if isinstance(node, n.IntLiteral):
        form = {"": "d", "H": "X", "B": "b"}[node.base]
        digits = f"{node.value:{form}}"
        return f"'{node.base}{digits}'" if node.base else digits
    if isinstance(node, n.BoolLiteral):
        return "TRUE" if node.value else "FALSE"
    if isinstance(node, n.StringLiteral):
        return f'"{node.value}"'
    if isinstance(node, n.RealLiteral):
        return repr(node.value).upper()
    return f"#{node.name}" if isinstance(node, n.EnumLiteral) else node.name


def _binary(node: n.Binary) -> str:
    level = n.PRECEDENCE[node.operator]
    left = _operand(node.left, level)
    right = _operand(node.right, level + 1)
    space = " " if node.operator.isidentifier() or node.operator == ":" else ""
    text = f"{left}{space}{node.operator}{space}{right}"
    return f"({text})" if node.grouped else text


def _operand(node: n.Expression, level: int) -> str:
    """An operand of an operator that binds with `level`."""
    text = expression(node)
    if isinstance(node, n.Binary) and not node.grouped and n.PRECEDENCE[node.operator] < level:
        return f"({text})"
    return text
