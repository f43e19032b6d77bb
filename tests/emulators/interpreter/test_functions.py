"""KRL's built-in functions, one by one."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.emulators.interpreter.buffers import scanned
from sphmctl.emulators.krl.findings import KrlError
from tests.emulators.interpreter.rig import Rig, config, program
from tests.emulators.interpreter.test_language import ran, stopped

DATA = """CHAR S[16]
CHAR W[8]
CHAR L
INT I,J,O
REAL R
BOOL OK
ENUM COLOUR RED,GREEN
DECL COLOUR C
DECL STATE_T ST"""


@pytest.mark.parametrize(
    ("call", "name", "text"),
    [
        ("I=STRADD(S[],\"cd\")", "S[]", '"abcd"'),
        ("I=STRADD(S[],\"cd\")", "I", "4"),
        ("I=STRADD(S[],\"0123456789ABCDEF\")", "I", "0"),
        ("OK=STRCLEAR(S[])", "S[]", ""),
        ("OK=STRCOMP(S[],\"AB\")", "OK", "FALSE"),
        ("OK=STRCOMP(S[],\"AB\",#NOT_CASE_SENS)", "OK", "TRUE"),
        ("OK=STRCOPY(W[],S[])", "W[]", '"ab"'),
        ("OK=STRCOPY(W[],\"nine long\")", "OK", "FALSE"),
        ("I=STRDECLLEN(S[])", "I", "16"),
        ("I=STRLEN(S[])", "I", "2"),
        ("I=STRFIND(1,S[],\"b\")", "I", "2"),
        ("I=STRFIND(2,S[],\"a\")", "I", "0"),
        ("I=STRFIND(1,S[],\"B\",#NOT_CASE_SENS)", "I", "2"),
        ("OK=STRTOINT(\"-7\",I)", "I", "-7"),
        ("OK=STRTOINT(\"7.5\",I)", "OK", "FALSE"),
        ("OK=STRTOREAL(\"2.5\",R)", "R", "2.50000"),
        ("OK=STRTOBOOL(\"TRUE\",OK)", "OK", "TRUE"),
        ("OK=STRTOSTRING(\"xy\",W[])", "W[]", '"xy"'),
        ("I=ABS(-3)", "I", "3"),
        ("R=ABS(-2.5)", "R", "2.50000"),
        ("R=ASIN(0.5)", "R", "30.0000"),
    ],
)  # fmt: skip
def test_a_function_gives_what_the_manual_says(call: str, name: str, text: str) -> None:
    """[C] names of krl.md 1.3's list, [M] meanings."""
    assert ran(f'S[]="ab"\n{call}', DATA).text(name) == text


@pytest.mark.parametrize(
    ("kind", "text"),
    [("FRAME", "{X 1,Y 2}"), ("POS", "{POS: X 1,S 2}"), ("E6POS", "{X 1,E1 3}"), ("AXIS", "{A1 4}"),
     ("E3POS", "{X 1,E3 3}"), ("E3AXIS", "{A1 4,E1 5}"), ("E6AXIS", "{E6AXIS: A6 4}")],
)  # fmt: skip
def test_texts_become_structures(kind: str, text: str) -> None:
    """[C] names STRTOFRAME and its kin."""
    rig = ran(f'OK=STRTO{kind}("{text}",P)', f"{DATA}\n{kind} P")
    assert rig.get("OK") is True
    assert rig.text("P")
    assert ran(f'OK=STRTO{kind}("x",P)', f"{DATA}\n{kind} P").get("OK") is False


@pytest.mark.parametrize("call", ['STRCLEAR("a")', 'STRADD("a","b")', 'STRTOINT("1",2)'])
def test_what_a_function_writes_must_be_a_variable(call: str) -> None:
    """[M] refused as the program is loaded."""
    with pytest.raises(KrlError, match=r"t\.src:2: .*a variable must stand here"):
        Rig(program(call), config(DATA))


def test_a_constant_is_not_written_by_a_function() -> None:
    """[C] GLOBAL CONST."""
    with pytest.raises(KrlError, match=r"t\.src:2: .*K can only be read"):
        Rig(program('OK=STRTOINT("1",K)'), config(f"{DATA}\nCONST INT K=2"))


def test_sread_takes_values_by_its_format_and_moves_its_offset() -> None:
    """[C] SREAD is used; [M] state, hits and offset."""
    body = 'O=2\nSREAD("x:12 7.5 word TRUE",ST,O,"%d %f %s",I,R,W[])'
    rig = ran(body, DATA)
    assert (rig.get("I"), rig.get("R"), rig.text("W[]")) == (12, 7.5, '"word"')
    assert (rig.get("O"), rig.text("ST.RET1"), rig.text("ST.HITS")) == (13, "#DATA_OK", "3")


@pytest.mark.parametrize(
    ("text", "pattern", "hits", "state"),
    [("12", "%d,%d", 1, "FMT_ERR"), ("", "%d", 0, "DATA_END"), ("a1", "%d", 0, "FMT_ERR"),
     ("FF 3", "%x %1d", 2, "DATA_OK"), ("12345", "%2d%d", 2, "DATA_OK")],
)  # fmt: skip
def test_sread_says_how_far_it_came(text: str, pattern: str, hits: int, state: str) -> None:
    """[M] #DATA_OK, #DATA_END, #FMT_ERR."""
    rig = ran(f'O=0\nSREAD("{text}",ST,O,"{pattern}",I,J)', DATA)
    assert (rig.text("ST.HITS"), rig.text("ST.RET1")) == (str(hits), f"#{state}")


def test_swrite_and_sread_are_each_others_opposite() -> None:
    """[C] both are used."""
    body = 'O=0\nSWRITE(S[],ST,O,"%d;%1.2f",42,2.25)\nO=0\nSREAD(S[],ST,O,"%d;%f",I,R)'
    rig = ran(body, DATA)
    assert (rig.text("S[]"), rig.get("I"), rig.get("R")) == ('"42;2.25"', 42, 2.25)


def test_cast_to_puts_little_endian_bytes_and_cast_from_takes_them() -> None:
    """[C] both are used; [M] four bytes of INT and REAL, one of BOOL, CHAR."""
    body = """O=1
CAST_TO(S[],O,258,2.5,TRUE,L,C)
J=O
O=1
CAST_FROM(S[],O,I,R,OK,L,C)"""
    rig = ran(f'L="x"\nC=#GREEN\n{body}', DATA)
    wanted = (258, 2.5, True, "x", "GREEN")
    assert tuple(rig.get(name) for name in ("I", "R", "OK", "L", "C")) == wanted
    assert (rig.get("J"), rig.get("O")) == (12, 12)
    buffer = rig.get("S")[1:].encode("latin-1")
    assert buffer == struct.pack("<if", 258, 2.5) + b"\x01x\x01"


def test_a_cast_beyond_its_buffer_stops_the_program() -> None:
    """[M] the buffer's size is what its declaration says."""
    assert "9 characters for W" in stopped("O=5\nCAST_TO(W[],O,1)", DATA)
    assert "the buffer ends before I" in stopped("O=5\nCAST_FROM(W[],O,I)", DATA)
    assert "O was never set" in stopped("CAST_FROM(W[],O,I)", DATA)
    assert "these bytes are no REAL" in stopped(
        "O=0\nCAST_TO(W[],O,-1)\nO=0\nCAST_FROM(W[],O,R)", DATA
    )


@settings(max_examples=100, deadline=None)
@given(st.text("%dxfsc 1.-+a:5", max_size=12), st.text(max_size=20), st.integers(0, 25))
def test_no_format_and_no_text_breaks_sread(pattern: str, text: str, at: int) -> None:
    found = scanned(pattern, text, min(at, len(text)))
    assert found.end <= len(text)


def test_what_is_not_emulated_is_refused_with_file_and_line() -> None:
    """Never skipped."""
    with pytest.raises(KrlError, match=r"t\.src:2: .*COLLMON_TOL_PRO is not emulated"):
        Rig(program("I=COLLMON_TOL_PRO(1)"), config(DATA))
