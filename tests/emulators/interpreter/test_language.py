"""Rules of files, types, operators and control flow."""

from __future__ import annotations

import pytest

from sphmctl.emulators.krl.findings import KrlError
from sphmctl.emulators.krl.parse import parse
from tests.emulators.interpreter.rig import Rig, config, program


def ran(body: str, data: str, *more: str, head: str = "") -> Rig:
    rig = Rig(program(body, *more, head=head), config(data)).run()
    assert rig.krc.state == "P_END", rig.krc.messages
    return rig


def stopped(body: str, data: str, *more: str, head: str = "") -> str:
    rig = Rig(program(body, *more, head=head), config(data)).run()
    assert rig.krc.state == "P_STOP"
    assert rig.get("$STOPMESS") is True
    return str(rig.krc.messages[-1])


# 1.1 Files and lines


def test_everything_in_config_dat_is_global() -> None:
    """[C] without GLOBAL."""
    assert ran("X=X+1", "INT X=4").get("X") == 5


def test_a_data_list_shares_its_names_with_the_routines_of_its_file_only() -> None:
    """[M] variables in .DAT are shared by all routines of the file; only PUBLIC GLOBAL goes out."""
    data = parse("DEFDAT T PUBLIC\nINT OWN=3\nDECL GLOBAL INT ALL=0\nENDDAT", "t.dat")
    rig = Rig(program("HELP()", "DEF HELP()", "ALL=OWN+1", "END"), data).run()
    assert rig.get("ALL") == 4
    assert rig.text("OWN") is None
    with pytest.raises(KrlError, match=r"u\.src:2: .*OWN is not declared"):
        Rig(program("OWN=1", name="U"), data)


def test_a_global_routine_is_called_from_another_module_and_a_local_one_is_not() -> None:
    """[C] GLOBAL DEF; a file's first routine is global by itself."""
    other = parse("DEF O()\nX=1\nEND\nGLOBAL DEF P()\nX=X+10\nEND\nDEF Q()\nX=0\nEND", "o.src")
    rig = Rig(program("O()\nP()"), other, config("INT X")).run()
    assert rig.get("X") == 11
    with pytest.raises(KrlError, match=r"t\.src:2: .*there is no routine Q"):
        Rig(program("Q()"), other, config("INT X"))


def test_names_and_words_are_not_case_sensitive() -> None:
    """[C] all-lower-case programs run."""
    assert ran("for i=1 to 3\n x=X+I\nendfor", "INT X=0", head="int i").get("X") == 6


def test_a_value_in_a_declaration_stands_only_in_a_data_list() -> None:
    """[M] in .SRC a separate assignment is needed."""
    with pytest.raises(KrlError, match=r"t\.src:2: .*only a data list"):
        Rig(program("X=1", head="INT X=2"))


def test_assignments_in_a_data_list_change_declared_values() -> None:
    """[C] separate assignment lines `x[3]={..}`."""
    data = 'STRUC P INT N, CHAR S[8]\nDECL P L[3]\nL[2]={N 7,S[] "two"}\nL[3].N=8'
    rig = Rig(config(data))
    assert rig.text("L[2]") == '{P: N 7, S[] "two"}'
    assert rig.text("L[3].N") == "8"
    assert rig.text("L[1].N") == ""


# 1.2 Types and literals


def test_an_int_has_32_bits_and_what_is_beyond_stops_the_program() -> None:
    """[C] 32 bit signed; that it stops rather than wraps is a guess."""
    assert ran("X='H7FFFFFFF'", "INT X").get("X") == 2**31 - 1
    assert "beyond KRL's INT" in stopped("X=X+1", "INT X=2147483647")


def test_a_real_has_single_precision() -> None:
    """[M] float32."""
    rig = ran("R=0.1\nB=R==0.1", "REAL R\nBOOL B")
    assert rig.get("R") == 0.10000000149011612
    assert rig.get("B") is True
    assert "beyond KRL's REAL" in stopped("R=1E38*10.0", "REAL R")


def test_bits_may_be_hexadecimal_or_binary() -> None:
    """[C] 'HFF', 'B0101', also inside aggregates."""
    rig = ran("X='HFF'+'B0101'\nP={N 'B11'}", "INT X\nSTRUC T1 INT N\nDECL T1 P")
    assert (rig.get("X"), rig.text("P")) == (260, "{T1: N 3}")


def test_a_string_is_an_array_of_char_taken_whole_or_by_letters() -> None:
    """[C] s[], s[3]."""
    rig = ran('S[]="abc"\nC=S[2]\nS[3]="x"', "CHAR S[8]\nCHAR C")
    assert (rig.text("S[]"), rig.text("C"), rig.text("S[3]")) == ('"abx"', '"b"', '"x"')
    assert "characters" in stopped('S[]="toolong"', "CHAR S[3]")


def test_enums_are_compared_for_equality_and_by_order() -> None:
    """[M] < and > by order of declaration."""
    data = "ENUM E A,B,C\nDECL E V=#B\nBOOL X\nBOOL Y"
    rig = ran("X=V==#B\nY=(V<#C) AND (V>#A)", data)
    assert rig.get("X")
    assert rig.get("Y")
    with pytest.raises(KrlError, match="#Z is no E"):
        ran("V=#Z", data)


def test_a_missing_component_of_an_aggregate_is_undefined_afterwards() -> None:
    """[U] second half of the rule on partial aggregates."""
    rig = ran("F={X 1,Y 2}", "FRAME F={X 9,Y 9,Z 9,A 0,B 0,C 0}")
    assert rig.text("F") == "{FRAME: X 1.00000, Y 2.00000}"


def test_aggregates_may_be_tagged_and_nested() -> None:
    """[C] {E6AXIS: A1 0}, {.. AX {A1 1000.0}}."""
    data = "STRUC N CHAR M[8], INT NR, AXIS AX\nDECL N V"
    rig = ran('V={N: M[] "x",NR 1,AX {AXIS: A1 1000.0}}', data)
    assert rig.text("V") == '{N: M[] "x", NR 1, AX {AXIS: A1 1000.00}}'


def test_an_array_has_up_to_three_dimensions_and_begins_at_1() -> None:
    """[C] 1-based."""
    rig = ran("A[2,3,1]=5\nX=A[2,3,1]", "INT A[2,3,4]\nINT X")
    assert rig.get("X") == 5
    assert rig.text("A[2,3,1]") == "5"
    assert rig.memory.write_text("A[1,1,4]", "7")
    assert rig.text("A[1,1,4]") == "7"
    for index in ("0", "3"):
        assert "the array ends at 2" in stopped(f"A[{index},1,1]=5", "INT A[2,3,4]")


def test_structures_of_a_family_are_assigned_by_their_components() -> None:
    """[M] POS to FRAME drops, AXIS to E6AXIS leaves open."""
    rig = ran("F=P\nE=A", "FRAME F\nPOS P={X 1,S 2}\nAXIS A={A1 4}\nE6AXIS E")
    assert rig.text("F") == "{FRAME: X 1.00000}"
    assert rig.text("E") == "{E6AXIS: A1 4.00000}"


def test_an_assignment_copies_deeply() -> None:
    """[M] values, not references."""
    data = "STRUC S AXIS Q\nDECL S V\nDECL S W"
    rig = ran("V={Q {A1 1}}\nW=V\nV.Q.A1=2", data)
    assert rig.text("W") == "{S: Q {AXIS: A1 1.00000}}"


# 1.3 Operators


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1+2*3", 7),
        ("-7/2", -3),
        ("7/2", 3),
        ("7-2-1", 4),
        ("'B1100' B_AND 'B1010' B_OR 'B1'", 9),
        ("'B1100' B_EXOR 'B1010'", 6),
        ("B_NOT 0", -1),
        ("ABS(-3)", 3),
    ],
)
def test_integers_are_computed_by_precedence_and_cut_toward_zero(text: str, value: int) -> None:
    """[C/M] table of 1.3; INT/INT truncates."""
    assert ran(f"X={text}", "INT X").get("X") == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("TRUE OR TRUE AND FALSE", True),
        ("NOT FALSE AND FALSE", False),
        ("TRUE EXOR TRUE OR TRUE", True),
        ("1+1==2", True),
        ("FALSE==FALSE OR TRUE", False),
        ("2<>3", True),
    ],
)
def test_comparisons_bind_loosest(text: str, value: bool) -> None:
    """[C] FALSE==(FALSE OR TRUE) is FALSE."""
    assert ran(f"X={text}", "BOOL X").get("X") is value


@pytest.mark.parametrize(
    ("real", "whole"), [("2.5", 3), ("-2.5", -3), ("2.4", 2), ("-0.6", -1), ("0.5", 1)]
)
def test_a_real_given_to_an_int_is_rounded(real: str, whole: int) -> None:
    """[M] to the nearest."""
    assert ran(f"X={real}", "INT X").get("X") == whole


def test_int_with_real_gives_real() -> None:
    """[C/M] 7/2.0."""
    assert ran("R=7/2.0", "REAL R").get("R") == 3.5


def test_division_by_zero_stops_the_program() -> None:
    """[M]."""
    assert "division by 0" in stopped("X=1/X", "INT X=0")


def test_the_geometric_operator_chains_frames_and_takes_the_right_type() -> None:
    """[C] FRAME:POS gives POS."""
    data = "FRAME F={X 10,Y 0,Z 0,A 90,B 0,C 0}\nPOS P={X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 35}\nPOS R"
    rig = ran("R=F:P", data)
    value = rig.get("R")
    assert [value[k] for k in "XYZA"] == pytest.approx([8, 1, 3, 90], abs=1e-5)
    assert (value["S"], value["T"]) == (2, 35)


def test_inv_pos_undoes_a_frame() -> None:
    """[C] INV_POS."""
    rig = ran("R=INV_POS(F):F", "FRAME F={X 1,Y 2,Z 3,A 10,B 20,C 30}\nFRAME R")
    assert list(rig.get("R").values()) == pytest.approx([0.0] * 6, abs=1e-4)


def test_trigonometry_is_in_degrees() -> None:
    """[M]."""
    rig = ran(
        "A=SIN(30)\nB=ACOS(0)\nC=ATAN2(1,-1)\nD=TAN(45)\nE=SQRT(2)",
        "REAL A,B,C,D,E",
    )
    got = [rig.get(name) for name in "ABCDE"]
    assert got == pytest.approx([0.5, 90, 135, 1, 1.41421354], rel=1e-6)


# 1.4 Control flow


def test_if_has_one_else() -> None:
    """[C]."""
    assert ran("IF X>3 THEN\nX=1\nELSE\nX=2\nENDIF", "INT X=3").get("X") == 2


@pytest.mark.parametrize(("given", "wanted"), [(1, 10), (2, 10), (3, 30), (4, 99)])
def test_switch_takes_one_branch_and_never_falls_through(given: int, wanted: int) -> None:
    """[C] lists allowed, DEFAULT."""
    body = "SWITCH X\nCASE 1,2\nY=10\nCASE 3\nY=30\nDEFAULT\nY=99\nENDSWITCH"
    assert ran(body, f"INT X={given}\nINT Y=0").get("Y") == wanted


@pytest.mark.parametrize(
    ("head", "count", "end"),
    [("1 TO 3", 3, 4), ("3 TO 1", 0, 3), ("3 TO 1 STEP -1", 3, 0), ("1 TO 6 STEP 2", 3, 7)],
)
def test_for_counts_past_its_end(head: str, count: int, end: int) -> None:
    """[C] syntax, [M] body skipped when already past, counter past the end afterwards."""
    rig = ran(f"FOR I={head}\nN=N+1\nENDFOR", "INT I\nINT N=0")
    assert (rig.get("N"), rig.get("I")) == (count, end)


def test_while_repeat_and_loop_end_as_they_should() -> None:
    """[C]."""
    body = """
WHILE X<3
X=X+1
ENDWHILE
REPEAT
Y=Y+1
UNTIL Y>=5
LOOP
Z=Z+1
IF Z==4 THEN
EXIT
ENDIF
ENDLOOP"""
    rig = ran(body, "INT X=0\nINT Y=9\nINT Z=0")
    assert [rig.get(name) for name in "XYZ"] == [3, 10, 4]


def test_exit_leaves_the_innermost_loop_of_any_kind_also_inside_switch() -> None:
    """[C] Machina leaves a FOR by EXIT inside SWITCH."""
    body = "LOOP\nFOR I=1 TO 9\nSWITCH I\nCASE 3\nEXIT\nENDSWITCH\nENDFOR\nX=X+1\nEXIT\nENDLOOP"
    rig = ran(body, "INT I\nINT X=0")
    assert (rig.get("I"), rig.get("X")) == (3, 1)


def test_goto_jumps_to_its_label() -> None:
    """[C]."""
    assert ran("AGAIN:\nX=X+1\nIF X<4 THEN\nGOTO AGAIN\nENDIF", "INT X=0").get("X") == 4


def test_halt_stops_until_the_start_key() -> None:
    """[M] #P_STOP, start continues."""
    rig = Rig(program("X=1\nHALT\nX=2"), config("INT X=0")).run()
    assert (rig.krc.state, rig.get("X")) == ("P_STOP", 1)
    assert rig.get("$STOPMESS") is False
    assert rig.krc.start()
    rig.cycles(2)
    assert (rig.krc.state, rig.get("X")) == ("P_END", 2)


def test_wait_sec_takes_its_time() -> None:
    """[M]."""
    rig = Rig(program("WAIT SEC 0.5\nX=1"), config("INT X=0"))
    rig.krc.select("T")
    rig.krc.start()
    assert rig.until(lambda: rig.get("X") == 1) == pytest.approx(0.5, abs=0.013)


def test_wait_for_sees_what_is_written_from_outside_in_the_next_cycle() -> None:
    """[M] KRL waits see the 12 ms cycle."""
    rig = Rig(program("WAIT FOR GO\nX=1"), config("INT X=0\nBOOL GO=FALSE"))
    rig.krc.select("T")
    rig.krc.start()
    rig.go(0.2)
    assert rig.get("X") == 0
    assert rig.memory.write_text("GO", "TRUE")
    rig.cycles(1)
    assert rig.get("X") == 1


def test_on_error_proceed_spares_the_next_line_only() -> None:
    """[C] then $ERR.NUMBER > 0; ERR_CLEAR($ERR)."""
    body = "ON_ERROR_PROCEED\nX=U\nY=$ERR.NUMBER\nERR_CLEAR($ERR)\nZ=$ERR.NUMBER"
    rig = ran(body, "INT X=5\nINT U\nINT Y\nINT Z")
    assert rig.get("X") == 5
    assert rig.get("Y") > 0
    assert rig.get("Z") == 0
    assert "U was never set" in stopped("ON_ERROR_PROCEED\nX=1\nX=U", "INT X\nINT U")


def test_end_of_the_selected_program_is_p_end() -> None:
    """[M]."""
    rig = ran("X=1\nRETURN\nX=2", "INT X=0")
    assert (rig.get("X"), rig.text("$PRO_STATE1")) == (1, "#P_END")
    assert not rig.krc.start()


# 1.5 Calls, lifetime, undefined values


def test_in_is_by_value_and_out_by_reference() -> None:
    """[C]."""
    more = ("DEF F(A :IN,B :OUT)", "INT A", "INT B", "A=A+1", "B=A*2", "END")
    rig = ran("F(X,L[2])\nF(3,Y)", "INT X=1\nINT Y\nINT L[3]", *more)
    assert (rig.get("X"), rig.get("Y"), rig.text("L[2]")) == (1, 8, "4")


def test_parameters_may_be_declared_in_any_order_and_structures_handed_over() -> None:
    """[C] `DECL AXIS Y`."""
    more = ("DEF F(Y :OUT,N :IN)", "INT N", "DECL AXIS Y", "Y.A1=N", "END")
    assert ran("F(Q,7)", "AXIS Q", *more).text("Q") == "{AXIS: A1 7.00000}"


def test_arrays_are_handed_over_by_out() -> None:
    """[M] a[] :OUT only."""
    more = ("DEF F(A[] :OUT,M[,] :OUT)", "INT A[]", "INT M[,]", "A[3]=M[2,1]", "END")
    assert ran("F(L[],K[,])", "INT L[3]\nINT K[2,2]\nK[2,1]=6", *more).text("L[3]") == "6"


def test_an_argument_left_out_is_undefined_and_varstate_tells() -> None:
    """[C] F(,2)."""
    more = (
        "DEF F(A :IN,B :IN)", "INT A,B", 'IF VARSTATE("A")==#DECLARED THEN', "X=B", "ENDIF", "END",
    )  # fmt: skip
    assert ran("F(,2)", "INT X=0", *more).get("X") == 2


def test_varstate_knows_three_states() -> None:
    """[C] #DECLARED, #INITIALIZED, #UNKNOWN."""
    body = 'A=VARSTATE("I")\nB=VARSTATE("J")\nC=VARSTATE("NO")\nD=VARSTATE("L[2].N")'
    data = "INT I\nINT J=1\nSTRUC P INT N\nDECL P L[2]\nL[2]={N 1}"
    rig = ran(body, f"{data}\nDECL VAR_STATE A,B,C,D")
    assert [rig.get(name) for name in "ABCD"] == [
        "DECLARED", "INITIALIZED", "UNKNOWN", "INITIALIZED",
    ]  # fmt: skip


def test_variables_of_a_program_are_new_at_each_call() -> None:
    """[M] runtime variables: undefined at each call."""
    more = ("DEF F()", "INT A", 'IF VARSTATE("A")==#INITIALIZED THEN', "X=1", "ENDIF", "A=1", "END")
    assert ran("F()\nF()", "INT X=0", *more).get("X") == 0


def test_variables_of_a_data_list_outlive_calls_and_resets() -> None:
    """[M] keep their value."""
    rig = ran("X=X+1", "INT X=0")
    rig.krc.reset()
    rig.krc.start()
    rig.cycles(2)
    assert rig.get("X") == 2


def test_reading_an_undefined_variable_stops_the_program_at_its_line() -> None:
    """[C] "value invalid"; #P_STOP with $STOPMESS."""
    rig = Rig(program("X=1\nX=U+1"), config("INT X\nINT U")).run()
    message = rig.krc.messages[-1]
    assert (message.line, message.text) == (3, "value invalid: U was never set")
    assert (rig.krc.state, rig.get("$STOPMESS"), rig.get("$PERI_RDY")) == ("P_STOP", True, True)


def test_each_component_is_undefined_by_itself() -> None:
    """[C] $TOOL, $VEL.ORI1 and fresh locals all start that way."""
    assert "Q.A2 was never set" in stopped("Q.A1=1\nR=Q.A1\nR=Q.A2", "REAL R", head="AXIS Q")
    assert "$VEL.CP was never set" in stopped("R=$VEL.CP", "REAL R")


def test_a_function_in_an_expression_is_called_first_and_may_wait() -> None:
    """[C] DEFFCT .. RETURN expr."""
    more = ("DEFFCT INT F(A :IN)", "INT A", "WAIT SEC 0.05", "RETURN A*2", "ENDFCT")
    assert ran("X=1+F(F(3))", "INT X", *more).get("X") == 13


def test_a_function_may_give_text_and_structures() -> None:
    """[C] DEFFCT CHAR [32] F(); struct results occur."""
    more = (
        "DEFFCT CHAR [32] F()", 'RETURN "hello"', "ENDFCT",
        "DEFFCT AXIS G()", "AXIS Q", "Q={A1 5}", "RETURN Q", "ENDFCT",
    )  # fmt: skip
    rig = ran("S[]=F()\nQ=G()", "CHAR S[40]\nAXIS Q", *more)
    assert (rig.text("S[]"), rig.text("Q")) == ('"hello"', "{AXIS: A1 5.00000}")


def test_endless_recursion_stops_the_program() -> None:
    """Guess: a bounded number of routines in one another."""
    assert "in one another" in stopped("T()", "INT X")


def test_an_endless_loop_does_not_hang() -> None:
    """Bounded statements in a cycle."""
    rig = Rig(program("LOOP\nX=X+1\nENDLOOP"), config("INT X=0"))
    rig.krc.select("T")
    rig.krc.start()
    rig.cycles(10)
    assert 100 < rig.get("X") < 10_000
    assert rig.krc.state == "P_ACTIVE"


# Functions


def test_string_functions() -> None:
    """[C] names; meanings SI "String functions"."""
    body = """
A=STRLEN(S[])
B=STRADD(S[],"def")
C=STRFIND(1,S[],"cd")
D=STRCOMP(S[],"ABCDEF",#NOT_CASE_SENS)
E=STRDECLLEN(S[])
OK=STRTOINT("42",F)
OK=STRCOPY(R[],S[])
G=STRTOREAL("x",H)
"""
    data = 'CHAR S[10]\nS[]="abc"\nCHAR R[10]\nINT A,B,C,E,F\nBOOL D,OK,G\nREAL H'
    rig = ran(body, data)
    assert [rig.get(name) for name in "ABCDEF"] == [3, 6, 3, True, 10, 42]
    assert (rig.text("R[]"), rig.get("OK"), rig.get("G")) == ('"abcdef"', True, False)


def test_swrite_formats_from_its_offset_on() -> None:
    """[C] SWRITE builds names with an index."""
    body = 'O=0\nSWRITE(S[],ST,O,"L[%d]=%.2f",I,2.5)'
    rig = ran(body, "CHAR S[20]\nDECL STATE_T ST\nINT O\nINT I=7")
    assert (rig.text("S[]"), rig.get("O")) == ('"L[7]=2.50"', 9)


def test_forward_and_inverse_are_each_others_opposite() -> None:
    """[C] exist; argument order as in krl.functions."""
    body = """
$TOOL=$NULLFRAME
$BASE=$NULLFRAME
P=FORWARD({E6AXIS: A1 10,A2 -80,A3 70,A4 20,A5 30,A6 40},E)
Q=INVERSE(P,{E6AXIS: A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0},E)
"""
    rig = ran(body, "E6POS P\nE6AXIS Q\nINT E")
    found = [rig.get("Q")[f"A{axis}"] for axis in range(1, 7)]
    assert found == pytest.approx([10, -80, 70, 20, 30, 40], abs=1e-3)
    assert rig.get("E") == 0


def test_on_error_proceed_spares_a_line_once() -> None:
    """[C] the next time the line comes, it stops the program."""
    body = """AGAIN:
I=I+1
IF I==1 THEN
ON_ERROR_PROCEED
ENDIF
X=U
IF I<3 THEN
GOTO AGAIN
ENDIF"""
    rig = Rig(program(body), config("INT X\nINT U\nINT I=0")).run()
    assert (rig.krc.state, rig.get("I")) == ("P_STOP", 2)
