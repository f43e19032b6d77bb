"""The language, rule by rule; [C] is certain, [M] known from KUKA's manuals, [U] unverified.

Sources of the rules: SI (KSS 8.3, "KRL syntax"), Expert Programming KSS 5.2, public programs.
"""

from __future__ import annotations

import pytest

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.findings import KrlError
from sphmctl.emulators.krl.parse import parse
from tests.emulators.krl.rig import entries, routine, statement, value

HERE = n.Place("", 0)


def name(text: str) -> n.Name:
    return n.Name(HERE, text)


def number(of: int) -> n.IntLiteral:
    return n.IntLiteral(HERE, of)


def binary(operator: str, left: n.Expression, right: n.Expression) -> n.Binary:
    return n.Binary(HERE, operator, left, right)


A, B, C = name("A"), name("B"), name("C")


def test_c_header_lines_are_kept_as_they_are() -> None:
    module = parse("&ACCESS RVP\n&PARAM TEMPLATE = C:\\x\nDEF A()\nEND\n", "a.src")
    assert [header.text for header in module.headers] == ["&ACCESS RVP", "&PARAM TEMPLATE = C:\\x"]


def test_c_a_semicolon_starts_a_comment_but_not_in_a_text() -> None:
    node = statement('S[]="a;b" ; c')
    assert isinstance(node, n.Assign)
    assert node.value == n.StringLiteral(HERE, "a;b")
    assert statement("X=5;") == n.Assign(HERE, name("X"), number(5))


def test_c_folds_are_comments() -> None:
    module = parse("DEF A()\n;FOLD INI;%{PE}\n;ENDFOLD (INI)\nEND", "a.src")
    assert [comment.text for comment in module.comments] == ["FOLD INI;%{PE}", "ENDFOLD (INI)"]


def test_c_long_lines_are_fine() -> None:
    parts = ",".join(f"M{i} {i}" for i in range(200))
    node = value(f"{{{parts}}}")
    assert isinstance(node, n.Aggregate)
    assert len(node.components) == 200


def test_c_case_does_not_count() -> None:
    lower = "def a( )\nif x==#y then\nptp {a1 0} c_ptp\nendif\nend"
    assert parse(lower, "a.src") == parse(lower.upper(), "a.src")


def test_c_a_name_has_at_most_24_characters() -> None:
    routine("INT " + "A" * 24)
    with pytest.raises(KrlError, match=r"a\.src:2: error: .* 25 characters; a name has at most 24"):
        routine("INT " + "A" * 25)


@pytest.mark.parametrize("word", ["STEP", "SEC", "DELAY", "DISTANCE", "PRIO", "IN", "OUT", "ON"])
def test_c_some_words_are_names_as_well(word: str) -> None:
    assert statement(f"{word}=DATE.{word}") == n.Assign(
        HERE, name(word), n.Field(HERE, name("DATE"), word)
    )


def test_c_interrupt_decl_is_a_statement_and_signal_a_declaration() -> None:
    made = routine("SIGNAL S $OUT[5]", "INTERRUPT DECL 3 WHEN X DO F()")
    assert isinstance(made.declarations[0], n.Signal)
    assert isinstance(made.body[0], n.InterruptDeclare)


def test_m_declarations_stand_before_statements() -> None:
    with pytest.raises(KrlError, match=r"a\.src:3: .* before the first statement"):
        routine("X=1", "INT X")


def test_c_ext_lines_of_the_old_style_are_read() -> None:
    (made,) = routine("EXT BAS (BAS_COMMAND :IN,REAL :IN )").declarations
    assert isinstance(made, n.Ext)
    assert [(p.type.name if p.type else "", p.mode) for p in made.parameters] == [
        ("BAS_COMMAND", "IN"),
        ("REAL", "IN"),
    ]


def test_c_a_function_may_give_a_char_array() -> None:
    module = parse('DEFFCT CHAR [32] F()\nRETURN "a"\nENDFCT', "f.src")
    assert isinstance(module, n.Program)
    assert module.routines[0].result == n.TypeName(HERE, "CHAR", (number(32),))


@pytest.mark.parametrize("line", ["DECL GLOBAL INT X", "GLOBAL DECL INT X", "GLOBAL INT X"])
def test_c_decl_and_global_stand_in_any_order(line: str) -> None:
    assert entries(line) == entries("DECL GLOBAL INT X")


def test_c_a_constant_is_global_const() -> None:
    (made,) = entries("GLOBAL CONST INT X=1")
    assert isinstance(made, n.Declare)
    assert (made.is_global, made.is_const) == (True, True)


def test_c_a_data_list_holds_assignments_too() -> None:
    made = entries("DECL FRAME X[3]", "X[3]={X 1.0}", 'S[]="text"')
    assert [type(entry) for entry in made] == [n.Declare, n.Assign, n.Assign]


def test_c_hex_and_binary_numbers() -> None:
    assert value("'HFF'") == n.IntLiteral(HERE, 255, "H")
    assert value("'b0101'") == n.IntLiteral(HERE, 5, "B")


def test_m_reals() -> None:
    assert [value(text) for text in ("1.0", ".5", "1.5E-3", "2.")] == [
        n.RealLiteral(HERE, 1.0),
        n.RealLiteral(HERE, 0.5),
        n.RealLiteral(HERE, 0.0015),
        n.RealLiteral(HERE, 2.0),
    ]


def test_c_an_int_has_32_bits() -> None:
    assert value("-2147483648") == n.Unary(HERE, "-", number(2**31))
    with pytest.raises(KrlError, match="is no INT"):
        value("2147483649")


def test_c_a_blank_behind_the_mark_of_an_enum_value_is_fine() -> None:
    assert value("# A") == value("#a") == n.EnumLiteral(HERE, "A")


def test_c_a_struc_repeats_types_for_groups() -> None:
    (made,) = entries("STRUC T INT A,B, REAL C, CHAR N[24], FRAME R")
    assert isinstance(made, n.Struc)
    assert [(m.type.name, m.name, m.sizes) for m in made.members] == [
        ("INT", "A", ()),
        ("INT", "B", ()),
        ("REAL", "C", ()),
        ("CHAR", "N", (number(24),)),
        ("FRAME", "R", ()),
    ]


def test_c_aggregates_nest_and_have_tags_and_texts() -> None:
    node = value("{T: MODUL[] \"x\",NR 'B01',AX {A1 -1000.0}}")
    assert node == n.Aggregate(
        HERE,
        "T",
        (
            n.Component(HERE, "MODUL", n.StringLiteral(HERE, "x"), is_text=True),
            n.Component(HERE, "NR", n.IntLiteral(HERE, 1, "B")),
            n.Component(
                HERE,
                "AX",
                n.Aggregate(
                    HERE,
                    None,
                    (n.Component(HERE, "A1", n.Unary(HERE, "-", n.RealLiteral(HERE, 1000.0))),),
                ),
            ),
        ),
    )


def test_c_arrays_have_up_to_three_dimensions_and_open_indices() -> None:
    assert value("A[1,B]") == n.Index(HERE, A, (number(1), B))
    assert value("A[]") == n.Index(HERE, A, (None,))
    assert value("A[2,]") == n.Index(HERE, A, (number(2), None))
    with pytest.raises(KrlError, match="at most 3 dimensions"):
        value("A[1,1,1,1]")


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("A==B AND C==A", binary("==", binary("==", A, binary("AND", B, C)), A)),
        ("NOT A AND B", binary("AND", n.Unary(HERE, "NOT", A), B)),
        ("A OR B AND C", binary("OR", A, binary("AND", B, C))),
        ("A EXOR B AND C", binary("EXOR", A, binary("AND", B, C))),
        ("A OR B EXOR C", binary("OR", A, binary("EXOR", B, C))),
        ("A B_OR B B_AND C", binary("B_OR", A, binary("B_AND", B, C))),
        ("A+B*C", binary("+", A, binary("*", B, C))),
        ("A-B-C", binary("-", binary("-", A, B), C)),
        ("A/B*C", binary("*", binary("/", A, B), C)),
        ("-A*B", binary("*", n.Unary(HERE, "-", A), B)),
        ("A AND B+C", binary("AND", A, binary("+", B, C))),
        ("(A==B) AND C", binary("AND", binary("==", A, B), C)),
    ],
)
def test_c_operators_bind_in_the_order_of_the_manual(text: str, tree: n.Expression) -> None:
    assert value(text) == tree


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("A:B:C", binary(":", binary(":", A, B), C)),
        ("A:B*C", binary("*", binary(":", A, B), C)),
    ],
)
def test_m_the_geometric_operator_binds_tightest_of_two_sided_ones(
    text: str, tree: n.Expression
) -> None:
    assert value(text) == tree


def test_c_assignment_is_no_operator() -> None:
    with pytest.raises(KrlError, match="'=C' cannot stand behind 'A=B'"):
        routine("A=B=C")


def test_c_if_has_then_and_else_and_no_elseif() -> None:
    made = routine("IF A THEN", "EXIT", "ELSE", "HALT", "ENDIF").body[0]
    assert made == n.If(HERE, A, (n.Simple(HERE, "EXIT"),), (n.Simple(HERE, "HALT"),))
    with pytest.raises(KrlError, match=r"a\.src:3: error: KRL has no ELSEIF"):
        routine("IF A THEN", "ELSEIF B THEN", "ENDIF")


def test_c_switch_has_lists_and_a_default_and_comments_before_its_first_case() -> None:
    made = routine("SWITCH A", "", ";x", "CASE 1,2", "CASE 3", "HALT", "DEFAULT", "ENDSWITCH")
    assert made.body[0] == n.Switch(
        HERE,
        A,
        (
            n.Case(HERE, (number(1), number(2))),
            n.Case(HERE, (number(3),), (n.Simple(HERE, "HALT"),)),
        ),
        (),
    )


def test_c_loops() -> None:
    step = n.Unary(HERE, "-", number(1))
    assert routine("FOR A=3 TO 1 STEP -1", "ENDFOR").body[0] == n.For(
        HERE, A, number(3), number(1), step
    )
    assert routine("WHILE A", "ENDWHILE").body[0] == n.While(HERE, A)
    assert routine("REPEAT", "UNTIL A").body[0] == n.Repeat(HERE, A, (), HERE)
    assert routine("LOOP", "ENDLOOP").body[0] == n.Loop(HERE)


def test_c_goto_and_label() -> None:
    assert routine("L:", "GOTO L").body == (n.Label(HERE, "L"), n.Goto(HERE, "L"))


def test_c_waits() -> None:
    assert statement("WAIT FOR A") == n.WaitFor(HERE, A)
    assert statement("WAIT SEC 0") == n.WaitSec(HERE, number(0))


@pytest.mark.parametrize("word", ["EXIT", "HALT", "CONTINUE", "RESUME", "ON_ERROR_PROCEED"])
def test_c_statements_of_one_word(word: str) -> None:
    assert statement(word).__class__ is n.Simple


def test_c_arguments_can_be_left_out() -> None:
    assert statement("F(,2)") == n.Call(HERE, "F", (None, number(2)))
    assert statement("F ( )") == n.Call(HERE, "F", ())


def test_c_parameters_say_in_or_out() -> None:
    module = parse("DEF F(X :IN,Y[,]:OUT)\nINT X\nINT Y[2,2]\nEND", "f.src")
    assert isinstance(module, n.Program)
    assert module.routines[0].parameters == (
        n.Parameter(HERE, "X", "IN"),
        n.Parameter(HERE, "Y", "OUT", 2),
    )
    with pytest.raises(KrlError, match=r"f\.src:1"):
        parse("DEF F(X)\nINT X\nEND", "f.src")


@pytest.mark.parametrize("kind", ["PTP", "LIN", "PTP_REL", "LIN_REL", "SPTP", "SLIN"])
def test_c_motions_with_approximation(kind: str) -> None:
    node = statement(f"{kind} A C_PTP C_DIS")
    assert isinstance(node, n.Motion)
    assert (node.kind, node.target, node.blends) == (kind, A, ("C_PTP", "C_DIS"))


def test_c_circ_has_an_auxiliary_point_and_an_angle() -> None:
    node = statement("CIRC A,B,CA 90 C_VEL")
    assert node == n.Motion(HERE, "CIRC", B, A, number(90), ("C_VEL",))


def test_c_s_motions_take_settings() -> None:
    node = statement("SPTP A WITH $VEL_AXIS[1]=SVEL_JOINT(100.0),$TOOL=STOOL2(B) C_SPL")
    assert isinstance(node, n.Motion)
    assert len(node.settings) == 2
    with pytest.raises(KrlError, match="PTP takes no WITH"):
        routine("PTP A WITH $TOOL=B")


def test_c_triggers() -> None:
    node = statement("TRIGGER WHEN DISTANCE=1 DELAY=-20 DO SPS_TRIG(1) PRIO=-1")
    assert isinstance(node, n.Trigger)
    assert (node.kind, node.value, node.on_start) == ("DISTANCE", number(1), False)
    assert node.delay == n.Unary(HERE, "-", number(20))
    path = statement("TRIGGER WHEN PATH=-3.5 ONSTART DELAY=0 DO $CYCFLAG[1]=A")
    assert isinstance(path, n.Trigger)
    assert (path.kind, path.on_start, path.priority) == ("PATH", True, None)


def test_c_interrupts() -> None:
    node = statement("GLOBAL INTERRUPT DECL A WHEN $IN[1]==FALSE DO F(1)")
    assert isinstance(node, n.InterruptDeclare)
    assert (node.is_global, node.priority) == (True, A)
    assert statement("INTERRUPT OFF") == n.InterruptSwitch(HERE, "OFF")
    assert statement("INTERRUPT DISABLE 3") == n.InterruptSwitch(HERE, "DISABLE", number(3))


@pytest.mark.parametrize(("line", "kind"), [("BRAKE", ""), ("BRAKE F", "F"), ("BRAKE FF", "FF")])
def test_c_brakes(line: str, kind: str) -> None:
    node = statement(line)
    assert isinstance(node, n.Brake)
    assert node.kind == kind


def test_c_signals_span_outputs_or_are_off() -> None:
    made = entries("SIGNAL A $OUT[1] TO $OUT[8]", "SIGNAL $X FALSE")
    assert isinstance(made[0], n.Signal)
    assert made[0].last == n.Index(HERE, name("$OUT"), (number(8),))
    assert made[1] == n.Signal(HERE, "$X", None)


def test_c_pulse() -> None:
    output = n.Index(HERE, name("$OUT"), (A,))
    expected = n.Pulse(HERE, output, n.BoolLiteral(HERE, True), n.RealLiteral(HERE, 0.3))
    assert statement("PULSE($OUT[A],TRUE,0.3)") == expected


def test_every_node_knows_its_file_and_line() -> None:
    made = routine("X=1", "", "IF A THEN", "Y=2", "ENDIF")
    inner = made.body[1]
    assert isinstance(inner, n.If)
    assert (inner.at, inner.then[0].at) == (n.Place("a.src", 4), n.Place("a.src", 5))
    assert made.end == n.Place("a.src", 7)
