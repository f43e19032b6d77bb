"""Short ways to parse and check a few lines of KRL in the tests."""

from __future__ import annotations

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.check import check
from sphmctl.emulators.krl.findings import Finding
from sphmctl.emulators.krl.parse import parse


def routine(*lines: str) -> n.Routine:
    """The routine of a program with these lines; the first stands in line 2."""
    module = parse("\n".join(("DEF A()", *lines, "END")), "a.src")
    assert isinstance(module, n.Program)
    return module.routines[0]


def statement(line: str) -> n.Statement:
    """The one statement of a program."""
    (only,) = routine(line).body
    return only


def value(text: str) -> n.Expression:
    """The tree of an expression."""
    node = statement(f"X={text}")
    assert isinstance(node, n.Assign)
    return node.value


def entries(*lines: str) -> tuple[n.Declaration | n.Assign, ...]:
    """What a data list with these lines holds."""
    module = parse("\n".join(("DEFDAT A PUBLIC", *lines, "ENDDAT")), "a.dat")
    assert isinstance(module, n.DataList)
    return module.entries


def checked(*texts: str) -> list[tuple[int, str, str]]:
    """Line, severity and code of what is found in programs and lists named a, b, c."""
    return [(finding.line, finding.severity, finding.code) for finding in findings(*texts)]


def findings(*texts: str) -> tuple[Finding, ...]:
    """What is found in whole modules; a text's first name names its file."""
    modules = []
    for text in texts:
        words = text.replace("(", " ").split()
        name = words[words.index("DEFDAT" if "DEFDAT" in words else "DEF") + 1]
        modules.append(parse(text, f"{name}.{'dat' if 'DEFDAT' in words else 'src'}"))
    return check(modules)


def found(*lines: str, data: tuple[str, ...] = ()) -> list[tuple[int, str, str]]:
    """What is found in a program A with these lines, the first in line 2, and its data list."""
    program = "\n".join(("DEF A()", *lines, "END"))
    if not data:
        return checked(program)
    return checked("\n".join(("DEFDAT A PUBLIC", *data, "ENDDAT")), program)
