"""More rules of files, types, operators and calls."""

from __future__ import annotations

import pytest

from sphmctl.emulators.krl.findings import KrlError
from sphmctl.emulators.krl.parse import parse
from tests.emulators.interpreter.rig import Rig, config, program
from tests.emulators.interpreter.test_language import ran, stopped


def refused(body: str, data: str, *more: str, head: str = "") -> str:
    """The message with which a program is refused as it is loaded."""
    with pytest.raises(KrlError) as caught:
        Rig(program(body, *more, head=head), config(data))
    return str(caught.value)


# 1.1


def test_an_int_literal_is_fine_where_a_real_is_wanted() -> None:
    """[M] REAL: an INT literal is fine."""
    assert ran("R=3\nR=R*2", "REAL R").get("R") == 6.0


def test_a_text_of_one_letter_is_a_char() -> None:
    """[M] CHAR: one ASCII character, literal "A"."""
    assert ran('C="A"\nOK=C=="A"', "CHAR C\nBOOL OK").get("OK") is True
    assert "2 characters for C[1]" in stopped('C="AB"', "CHAR C")


def test_arrays_are_not_assigned_whole() -> None:
    """[M] no whole-array assignment except CHAR[]."""
    assert "t.src:2: error: L is an array" in refused("L[]=K[]", "INT L[3]\nINT K[3]")
    assert "A takes only a INT" in stopped("A=L", "INT A\nINT L[3]\nL[1]=1")


@pytest.mark.parametrize(
    ("kind", "parts"),
    [
        ("AXIS", "A1 A2 A3 A4 A5 A6"),
        ("E3AXIS", "A6 E1 E3"),
        ("E6AXIS", "A1 E1 E6"),
        ("FRAME", "X Y Z A B C"),
        ("POS", "X C S T"),
        ("E3POS", "X S T E3"),
        ("E6POS", "X S T E6"),
        ("CP", "CP ORI1 ORI2"),
        ("CONT", "CPTP CDIS CORI CVEL"),
        ("LOAD", "M"),
        ("LOAD", "CM.X J.Z"),
        ("JERK_STRUC", "CP ORI"),
    ],
)
def test_predefined_structures_have_their_components(kind: str, parts: str) -> None:
    """[C] OpenKuka's System.Types, bas.src, $config.dat."""
    body = "\n".join(f"V.{part}=2" for part in parts.split())
    assert ran(body, f"DECL {kind} V").text("V")


@pytest.mark.parametrize(
    ("kind", "parts"),
    [("FDAT", "TOOL_NO BASE_NO"), ("PDAT", "VEL ACC APO_DIST"), ("LDAT", "VEL ACC APO_DIST"),
     ("STATE_T", "HITS LENGTH")],
)  # fmt: skip
def test_structures_of_inline_forms_are_known(kind: str, parts: str) -> None:
    """[C] bas.src, $config.dat."""
    body = "\n".join(f"V.{part}=2" for part in parts.split())
    assert ran(body, f"DECL {kind} V").text("V")


# 1.3


def test_structures_are_not_compared() -> None:
    """[M] structs are not comparable."""
    assert "compared" in refused("OK=F==F", "FRAME F\nBOOL OK")


def test_chars_and_bools_are_compared() -> None:
    """[M] == and <> for INT, REAL, CHAR, BOOL, ENUM; < and > also for CHAR."""
    rig = ran('P=C<"b"\nQ=P<>TRUE\nV=(C=="a") EXOR Q', 'CHAR C="a"\nBOOL P\nBOOL Q\nBOOL V')
    assert [rig.get(name) for name in "PQV"] == [True, False, True]


def test_a_comparison_may_be_returned() -> None:
    """[C] RETURN $PRO_STATE1 == ProState."""
    more = (
        "DEFFCT BOOL IS(WANTED :IN)", "DECL PRO_STATE WANTED",
        "RETURN $PRO_STATE1==WANTED", "ENDFCT",
    )  # fmt: skip
    rig = ran("P=IS(#P_ACTIVE)\nQ=IS(#P_FREE)", "BOOL P\nBOOL Q", *more)
    assert (rig.get("P"), rig.get("Q")) == (True, False)


def test_both_sides_of_and_are_looked_at() -> None:
    """[I] no short cut: the right side's fault stops the program."""
    assert "U was never set" in stopped("P=FALSE AND (U>1)", "BOOL P\nINT U")


# 1.4


def test_switch_takes_chars_and_enums() -> None:
    """[C] x INT, CHAR or ENUM."""
    body = """SWITCH C
CASE "a"
X=1
CASE "b"
X=2
ENDSWITCH
SWITCH E
CASE #RED,#BLUE
X=X+10
DEFAULT
X=X+20
ENDSWITCH"""
    data = 'CHAR C="b"\nENUM COLOUR RED,GREEN,BLUE\nDECL COLOUR E=#BLUE\nINT X'
    assert ran(body, data).get("X") == 12


def test_a_switch_without_a_fitting_case_does_nothing() -> None:
    """[C] one branch at most."""
    assert ran("SWITCH X\nCASE 1\nX=9\nENDSWITCH", "INT X=5").get("X") == 5


def test_on_error_proceed_keeps_the_first_error_until_it_is_cleared() -> None:
    """[C] $ERR.NUMBER > 0, then ERR_CLEAR($ERR)."""
    rig = ran("ON_ERROR_PROCEED\nX=1/Y\nX=3\nY=$ERR.LINE_NR", "INT X\nINT Y=0")
    assert (rig.get("X"), rig.get("Y")) == (3, 3)


def test_err_raise_stops_the_program() -> None:
    """[C] ERR_RAISE is used."""
    assert "ERR_RAISE" in stopped("ERR_RAISE($ERR)", "INT X")


# 1.5


def test_a_data_list_is_shared_by_the_routines_of_its_file() -> None:
    """[M] ... and is not seen by the routines of another one."""
    data = parse("DEFDAT T\nINT OWN=3\nENDDAT", "t.dat")
    rig = Rig(program("ADD()\nX=OWN", "DEF ADD()", "OWN=OWN+1", "END"), data, config("INT X")).run()
    assert rig.get("X") == 4


def test_a_routines_variable_hides_the_global_one() -> None:
    """[M] the innermost name counts."""
    assert ran("X=5\nY=X", "INT X=1\nINT Y", head="INT X").get("Y") == 5
    assert ran("X=5", "INT X=1", head="INT X").get("X") == 1


def test_an_aggregate_may_be_handed_over() -> None:
    """[C] INVERSE(P,{E6AXIS: ..},E) and own routines alike."""
    more = ("DEF F(Q :IN)", "AXIS Q", "R=Q.A1", "END")
    assert ran("F({A1 7})", "REAL R", *more).get("R") == 7.0


def test_too_many_arguments_are_refused() -> None:
    """[M]."""
    assert "takes 1 arguments, not 2" in refused("F(1,2)", "INT X", "DEF F(A :IN)", "INT A", "END")


@pytest.mark.parametrize("line", ["SPLINE", "COPEN(:X,Y)", "ANIN ON X=1*$ANIN[1]", "IMPORT X"])
def test_what_the_emulator_does_not_know_is_refused_with_its_line(line: str) -> None:
    """[C] never met in the corpus, or out of this emulator's scope: an error, never skipped."""
    with pytest.raises(KrlError, match=r"t\.src:2: "):
        Rig(program(line), config("INT X,Y"))
