"""Lines to a module: blocks are joined, the order of declarations and statements is kept.

Every wrong line is told, not only the first: a wrong line is left out and the rest is read on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl.build_lines import Line, Mark, Until
from sphmctl.emulators.krl.findings import Finding, KrlError
from sphmctl.emulators.krl.lines import parse_line
from sphmctl.emulators.krl.source import Source

MAX_BLOCKS = 50
"""Blocks within one another: what reads the tree goes down it by recursion."""

MAX_FINDINGS = 100
"""Errors of one file that are told; behind that the file is something else than KRL."""

CLOSERS = {
    "ENDIF": "IF", "ELSE": "IF", "CASE": "SWITCH", "DEFAULT": "SWITCH", "ENDSWITCH": "SWITCH",
    "ENDFOR": "FOR", "ENDWHILE": "WHILE", "UNTIL": "REPEAT", "ENDLOOP": "LOOP", "END": "DEF",
    "ENDFCT": "DEFFCT", "ENDDAT": "DEFDAT",
}  # fmt: skip


class Reader:
    """A source's lines one at a time, with what was wrong so far."""

    def __init__(self, source: Source) -> None:
        self._lines = source.lines
        self._next = 0
        self._depth = 0
        self.last = n.Place(source.file, source.lines[-1][0].line if source.lines else 1)
        self.findings: list[Finding] = []
        self.present: Line | None = None
        self.advance()

    def advance(self) -> None:
        """Go to the next line that can be read; `present` is None behind the last."""
        while self._next < len(self._lines):
            at, text = self._lines[self._next]
            self._next += 1
            try:
                self.present = parse_line(at, text)
            except KrlError as error:
                self.tell(error)
            else:
                return
        self.present = None

    def tell(self, error: KrlError) -> None:
        """Note an error and read on.

        Raises:
            KrlError: there are too many.
        """
        self.findings.extend(error.findings)
        if len(self.findings) >= MAX_FINDINGS:
            raise KrlError(tuple(self.findings))

    def wrong(self, at: n.Place, message: str, code: str = "structure") -> None:
        """Note an error of one place."""
        self.tell(fail(at, code, message))

    def body(self, opened: n.Place, closers: tuple[str, ...]) -> n.Body:
        """Statements up to the line that closes the block, which stays `present`."""
        self._depth += 1
        if self._depth > MAX_BLOCKS:
            raise fail(opened, "size", f"over {MAX_BLOCKS} blocks stand within one another")
        statements: list[n.Statement] = []
        while (line := self.present) is not None:
            word = closing_word(line)
            if word in closers or word in ("END", "ENDFCT", "ENDDAT", "DEF", "DEFDAT"):
                break
            self.advance()
            if word in CLOSERS:
                self.wrong(line.at, f"{word} without {CLOSERS[word]}")
            elif isinstance(line, n.Declaration):
                self.wrong(line.at, "a declaration stands before the first statement", "order")
            else:
                statements.append(self._whole(line))
        self._depth -= 1
        return tuple(statements)

    def close(self, opened: n.Place, opener: str, closer: str) -> n.Place:
        """Take the line that closes a block; its place."""
        line = self.present
        if line is None or closing_word(line) != closer:
            self.wrong(opened, f"{opener} is never closed; {closer} is missing")
            return line.at if line else self.last
        self.advance()
        return line.at

    def _whole(self, line: Line) -> n.Statement:
        """The statement that begins with a line, its bodies read."""
        if isinstance(line, n.If):
            then = self.body(line.at, ("ELSE", "ENDIF"))
            otherwise: n.Body = ()
            if isinstance(self.present, Mark) and self.present.word == "ELSE":
                self.advance()
                otherwise = self.body(line.at, ("ENDIF",))
            self.close(line.at, "IF", "ENDIF")
            return replace(line, then=then, otherwise=otherwise)
        if isinstance(line, n.Switch):
            return self._switch(line)
        if isinstance(line, n.For | n.While):
            word = "FOR" if isinstance(line, n.For) else "WHILE"
            body = self.body(line.at, (f"END{word}",))
            self.close(line.at, word, f"END{word}")
            return replace(line, body=body)
        if isinstance(line, Mark):
            return self._marked(line)
        # Everything else that `body` lets through is a statement of one line.
        assert not isinstance(line, n.Declaration | n.Case | n.Routine | n.DataList | Until)
        return line

    def _marked(self, line: Mark) -> n.Statement:
        if line.word == "LOOP":
            body = self.body(line.at, ("ENDLOOP",))
            self.close(line.at, "LOOP", "ENDLOOP")
            return n.Loop(line.at, body)
        body = self.body(line.at, ("UNTIL",))
        until = self.present
        self.close(line.at, "REPEAT", "UNTIL")
        if isinstance(until, Until):
            return n.Repeat(line.at, until.condition, body, until.at)
        return n.Repeat(line.at, n.BoolLiteral(line.at, True), body, line.at)

    def _switch(self, line: n.Switch) -> n.Switch:
        ends = ("CASE", "DEFAULT", "ENDSWITCH")
        before = self.body(line.at, ends)
        if before:
            self.wrong(before[0].at, "a statement stands before the first CASE")
        cases: list[n.Case] = []
        default: n.Body | None = None
        while (head := self.present) is not None and closing_word(head) in ("CASE", "DEFAULT"):
            self.advance()
            body = self.body(line.at, ends)
            if default is not None:
                self.wrong(head.at, "DEFAULT is the last branch of its SWITCH")
            if isinstance(head, n.Case):
                cases.append(replace(head, body=body))
            else:
                default = body
        if not cases:
            self.wrong(line.at, "a SWITCH has at least one CASE")
        self.close(line.at, "SWITCH", "ENDSWITCH")
        return replace(line, cases=tuple(cases), default=default)


def closing_word(line: Line) -> str:
    """The word by which a line ends or divides a block or a module; "" when it does not."""
    if isinstance(line, Mark):
        return "" if line.word in ("LOOP", "REPEAT") else line.word
    kinds: tuple[tuple[type, str], ...] = (
        (Until, "UNTIL"),
        (n.Case, "CASE"),
        (n.Routine, "DEF"),
        (n.DataList, "DEFDAT"),
    )
    return next((word for kind, word in kinds if isinstance(line, kind)), "")


def read_program(source: Source, kind: str) -> n.Program:
    """A .src or .sub file.

    Raises:
        KrlError: with everything that is wrong in it.
    """
    reader = Reader(source)
    routines: list[n.Routine] = []
    while (line := reader.present) is not None:
        reader.advance()
        if isinstance(line, n.Routine):
            routines.append(_routine(reader, line))
        else:
            reader.wrong(line.at, "outside of a routine; a line stands between DEF and END")
            _skip(reader, lambda line: isinstance(line, n.Routine))
    if not routines and not reader.findings:
        reader.wrong(reader.last, "the file has no routine; it begins with DEF NAME()")
    if reader.findings:
        raise KrlError(tuple(reader.findings))
    return n.Program(
        routines[0].at,
        "sub" if kind == "sub" else "src",
        source.headers,
        source.comments,
        tuple(routines),
    )


def read_data_list(source: Source) -> n.DataList:
    """A .dat file.

    Raises:
        KrlError: with everything that is wrong in it.
    """
    reader = Reader(source)
    head = reader.present
    if not isinstance(head, n.DataList):
        if not reader.findings:
            at = head.at if head else reader.last
            reader.wrong(at, "a data list begins with DEFDAT NAME")
        raise KrlError(tuple(reader.findings))
    reader.advance()
    entries: list[n.Declaration | n.Assign] = []
    while (line := reader.present) is not None and closing_word(line) != "ENDDAT":
        reader.advance()
        if isinstance(line, n.Declaration | n.Assign):
            entries.append(line)
        else:
            reader.wrong(line.at, "only declarations and assignments stand in a data list")
    reader.close(head.at, "DEFDAT", "ENDDAT")
    if reader.present is not None:
        reader.wrong(reader.present.at, "nothing stands behind ENDDAT")
    if reader.findings:
        raise KrlError(tuple(reader.findings))
    return replace(head, headers=source.headers, comments=source.comments, entries=tuple(entries))


def _routine(reader: Reader, head: n.Routine) -> n.Routine:
    declarations: list[n.Declaration] = []
    while isinstance(line := reader.present, n.Declaration):
        declarations.append(line)
        reader.advance()
    closer = "ENDFCT" if head.result else "END"
    body = reader.body(head.at, (closer,))
    while isinstance(line := reader.present, Mark) and line.word in ("END", "ENDFCT", "ENDDAT"):
        if line.word == closer:
            break
        opener = "DEFFCT" if head.result else "DEF"
        reader.wrong(line.at, f"{line.word} cannot close {opener} {head.name}; {closer} does")
        reader.advance()
        return replace(head, declarations=tuple(declarations), body=body, end=line.at)
    end = reader.close(head.at, f"{'DEFFCT' if head.result else 'DEF'} {head.name}", closer)
    return replace(head, declarations=tuple(declarations), body=body, end=end)


def _skip(reader: Reader, wanted: Callable[[Line], bool]) -> None:
    while reader.present is not None and not wanted(reader.present):
        reader.advance()
