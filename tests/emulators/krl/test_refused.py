"""What is no KRL, or no program, is refused at its line with a sentence that says what is right."""

from __future__ import annotations

import pytest

from sphmctl.emulators.krl import source
from sphmctl.emulators.krl.findings import KrlError
from sphmctl.emulators.krl.parse import parse
from tests.emulators.krl.rig import checked, found, routine


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("DEF A()\nMOVE P1\nEND", 2, "no statement begins with MOVE"),
        ("DEF A()\nX=1\nX=(1+2\nEND", 3, "the line ends too early"),
        ("DEF A()\nIF X==1\nENDIF\nEND", 2, "THEN is due"),
        ("DEF A()\nIF X THEN\nEND", 2, "IF is never closed; ENDIF is missing"),
        ("DEF A()\nX=1\nENDIF\nEND", 3, "ENDIF without IF"),
        ("DEF A()\nLOOP\nENDWHILE\nENDLOOP\nEND", 3, "ENDWHILE without WHILE"),
        ("DEF A()\nX=1", 1, "DEF A is never closed; END is missing"),
        ("DEFFCT INT A()\nRETURN 1\nEND", 3, "ENDFCT does"),
        ("X=1\nDEF A()\nEND", 1, "outside of a routine"),
        ("", 1, "the file has no routine"),
        ("DEF A()\nSWITCH X\nX=1\nCASE 1\nENDSWITCH\nEND", 3, "before the first CASE"),
        ("DEF A()\nSWITCH X\nENDSWITCH\nEND", 2, "at least one CASE"),
        ("DEF A()\nX='H'\nEND", 2, "is no number"),
        ("DEF A()\nX='B12'\nEND", 2, "is no number"),
        ('DEF A()\nS[]="abc\nEND', 2, "not closed"),
        ("DEF A()\nX=IF+1\nEND", 2, "IF is a word of KRL"),
        ("DEF A()\nINT GOTO\nEND", 2, "GOTO is a word of KRL"),
        ("DEF A()\nSPLINE\nENDSPLINE\nEND", 2, "SPLINE is not emulated"),
        ("DEF A()\nANOUT ON X=1\nEND", 2, "ANOUT is not emulated"),
        ("DEF A()\nIMPORT INT X IS /R1/B..X\nEND", 2, "IMPORT is not emulated"),
        ("DEF A()\nCALL F()\nEND", 2, "by its name alone"),
        ("DEF A()\nPTP A C_SPL\nEND", 2, "takes no C_SPL"),
        ("DEF A()\nLIN_REL A #WORLD\nEND", 2, "#BASE or #TOOL"),
        ("DEF A()\nX={X 1,X 2}\nEND", 2, "X stands twice"),
        ("DEF A()\nX=1 @ 2\nEND", 2, "'@' cannot stand"),
        ("DEF A()\nTRIGGER WHEN TIME=3 DO X=1\nEND", 2, "DISTANCE or PATH is due"),
    ],
)
def test_a_wrong_line_is_told(text: str, line: int, sentence: str) -> None:
    with pytest.raises(KrlError) as caught:
        parse(text, "a.src")
    first = caught.value.findings[0]
    assert first.line == line
    assert sentence in first.message


def test_a_data_list_holds_no_statements() -> None:
    with pytest.raises(KrlError, match=r"a\.dat:2: .*only declarations and assignments"):
        parse("DEFDAT A\nHALT\nENDDAT", "a.dat")


def test_every_wrong_line_is_told_at_once() -> None:
    with pytest.raises(KrlError) as caught:
        routine("MOVE P1", "X=1", "GOTO", "Y=")
    assert [finding.line for finding in caught.value.findings] == [2, 4, 5]


def test_a_file_that_is_too_large_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "MAX_BYTES", 100)
    with pytest.raises(KrlError, match="over 100"):
        parse("; x\n" * 26, "a.src")
    monkeypatch.undo()
    with pytest.raises(KrlError, match=r"a\.src:1: .*characters"):
        parse("X" * (source.MAX_LINE + 1), "a.src")


@pytest.mark.parametrize("text", ["NOT " * 3000, "-" * 3000, "(1+" * 3000, "1+" * 3000])
def test_an_expression_that_is_too_deep_is_refused(text: str) -> None:
    with pytest.raises(KrlError, match=r"a\.src:2"):
        routine(f"X={text}1{')' * text.count('(')}")


def test_blocks_that_are_too_deep_are_refused() -> None:
    with pytest.raises(KrlError, match="over 50 blocks"):
        routine(*["LOOP"] * 5000, *["ENDLOOP"] * 5000)


@pytest.mark.parametrize(
    ("lines", "line", "code"),
    [
        (("X=1",), 2, "undeclared"),
        (("INT X", "X=Y"), 3, "undeclared"),
        (("$NO_SUCH_THING=1",), 2, "undeclared"),
        (("F()",), 2, "undeclared"),
        (("INT X", "REAL X"), 3, "double"),
        (("DECL NOTYPE X",), 2, "type"),
        (("INT X", "X=TRUE"), 3, "type"),
        (("BOOL X", "X=1"), 3, "type"),
        (("BOOL X", "X=#NOWHERE"), 3, "undeclared"),
        (("FRAME X", "X={X 1,Q 2}"), 3, "undeclared"),
        (("FRAME X", "X.Q=1"), 3, "undeclared"),
        (("INT X[3]", "X[4]=1"), 3, "array"),
        (("INT X[3]", "X[1,1]=1"), 3, "array"),
        (("INT X[3]", "X=1"), 3, "array"),
        (("INT X", "X[1]=1"), 3, "type"),
        (("CHAR X[3]", 'X="abc"'), 3, "array"),
        (("CHAR X[3]", 'X[]="abcd"'), 3, "type"),
        (("INT X=1",), 2, "initial"),
        (("$AXIS_ACT={A1 0}",), 2, "const"),
        (("$IN[1]=TRUE",), 2, "const"),
        (("GOTO NOWHERE",), 2, "goto"),
        (("GOTO L", "LOOP", "L:", "ENDLOOP"), 2, "goto"),
        (("L:", "L:"), 3, "double"),
        (("EXIT",), 2, "exit"),
        (("RETURN 1",), 2, "return"),
        (("REAL I", "FOR I=1 TO 2", "ENDFOR"), 3, "type"),
        (("INT X", "X=0", "SWITCH X", "CASE TRUE", "ENDSWITCH"), 5, "type"),
        (("INT X", "X=0", "SWITCH X", "CASE 1", "CASE 1", "ENDSWITCH"), 6, "double"),
        (("LIN {A1 0}",), 2, "type"),
        (("BOOL B", "B=TRUE", "PTP B"), 4, "type"),
        (("TRIGGER WHEN DISTANCE=2 DELAY=0 DO $OUT[1]=TRUE",), 2, "range"),
        (("INTERRUPT DECL 200 WHEN TRUE DO IR_STOPM()",), 2, "priority"),
        (("PULSE($FLAG[1],TRUE,1)",), 2, "type"),
        (("SIGNAL X $OUT[1] TO $OUT[40]",), 2, "signal"),
        (("INT X", "X=1", "INTERRUPT DECL 9 WHEN TRUE DO BAS(#BASE,X)"), 4, "runtime"),
        (("WAIT FOR 1",), 2, "type"),
        (("INT X", "X=1", "IF X==1 AND X==1 THEN", "ENDIF"), 4, "type"),
    ],
)
def test_a_wrong_program_is_told(lines: tuple[str, ...], line: int, code: str) -> None:
    assert (line, "error", code) in found(*lines)


def test_a_constant_cannot_be_assigned() -> None:
    assert found("X=2", data=("CONST INT X=1",)) == [(2, "error", "const")]


def test_a_function_needs_its_return_on_every_way() -> None:
    text = "DEFFCT INT F(X :IN)\nINT X\nIF X>0 THEN\nRETURN 1\nENDIF\nENDFCT"
    program = f"DEF A()\nINT Y\nY=F(1)\nEND\n{text}"
    assert checked(program) == [(10, "error", "return")]


def test_a_routine_of_another_file_is_called_only_when_it_is_global() -> None:
    other = "DEF B()\nEND\nDEF B_LOCAL()\nEND\nGLOBAL DEF B_GLOBAL()\nEND"
    assert checked("DEF A()\nB()\nB_GLOBAL()\nEND", other) == []
    assert checked("DEF A()\nB_LOCAL()\nEND", other) == [(2, "error", "undeclared")]


def test_variables_of_a_list_are_seen_elsewhere_only_when_global() -> None:
    data = "DEFDAT B PUBLIC\nINT OWN=1\nGLOBAL INT ALL=1\nENDDAT"
    assert checked(data, "DEF A()\nALL=2\nEND") == []
    assert checked(data, "DEF A()\nOWN=2\nEND") == [(2, "error", "undeclared")]
    assert (3, "error", "public") in checked(data.replace(" PUBLIC", ""))
