"""The interpreter against generated programs that a controller would load."""

from __future__ import annotations

import re

from hypothesis import event, given, settings
from hypothesis import strategies as st

from sphmctl.emulators.krl.nodes import Module
from sphmctl.emulators.krl.parse import parse
from tests.emulators.interpreter.rig import Rig

DATA = """DEFDAT T PUBLIC
ENUM COLOUR RED,GREEN,BLUE
STRUC PART INT N, REAL W, BOOL OK, COLOUR C, CHAR TAG[4], AXIS Q
DECL PART P={N 1,W 2.5,OK TRUE,C #RED,TAG[] "ab",Q {A1 5}}
DECL PART L[3]
L[1]={N 3,W 0.5,OK FALSE,C #BLUE,TAG[] "c",Q {A1 1}}
L[2]={N 4}
INT I=1
INT J=2
INT A[4]
A[1]=1
A[2]=7
A[3]=0
INT K[2,2]
K[1,2]=2
REAL R=0.5
REAL U
BOOL B=FALSE
BOOL V=TRUE
CHAR S[8]
BOOL OK
INT O
DECL STATE_T ST
S[]="abc"
DECL COLOUR C=#BLUE
FRAME F={X 1,Y 2,Z 3,A 10,B 20,C 30}
INT MARK=0
ENDDAT"""

ROUTINES = """
DEFFCT INT TWICE(X :IN)
INT X
RETURN X+X
ENDFCT
DEF GIVE(X :OUT)
INT X
X=X+1
END
DEF PAUSE()
BRAKE
WAIT SEC 0.02
PTP_REL {A6 3}
END
DEF LEAVE()
BRAKE
RESUME
END
DEF NOTE()
MARK=MARK+1
END"""

SETTING = """BAS(#INITMOV,0)
$TOOL=$NULLFRAME
$BASE=$NULLFRAME
INTERRUPT DECL 10 WHEN $FLAG[1] DO PAUSE()
INTERRUPT DECL 11 WHEN $FLAG[2] DO LEAVE()
INTERRUPT ON
PTP $AXIS_ACT
WORK()
END
DEF WORK()"""

CYCLES = 60

ints: st.SearchStrategy[str] = st.deferred(
    lambda: st.one_of(
        st.sampled_from(
            [
                "I",
                "J",
                "A[2]",
                "A[I]",
                "A[J]",
                "K[1,2]",
                "K[I,J]",
                "P.N",
                "L[1].N",
                "L[I].N",
                "MARK",
            ]
        ),
        st.integers(-5, 400).map(lambda number: f"({number})"),
        st.sampled_from(["'HFF'", "$OV_PRO", "$ADVANCE", "$ROB_TIMER"]),
        st.sampled_from(["STRLEN(S[])", "STRFIND(1,S[],P.TAG[])"]),
        st.builds("({}{}{})".format, ints, st.sampled_from("+-*/"), ints),
        st.builds("({} B_AND {})".format, ints, ints),
        st.builds("TWICE({})".format, ints),
        st.builds("ABS({})".format, ints),
    )
)
reals: st.SearchStrategy[str] = st.deferred(
    lambda: st.one_of(
        st.sampled_from(
            ["R", "U", "P.W", "L[2].W", "P.Q.A1", "F.X", "$VEL.CP", "$VEL_AXIS[1]", "$AXIS_ACT.A1"]
        ),
        st.sampled_from(["0.25", "40.0", "(-3.5)", "0.0"]),
        st.builds("({}{}{})".format, reals | ints, st.sampled_from("+-*/"), reals),
        st.builds(
            "{}({})".format, st.sampled_from(["SIN", "COS", "TAN", "ACOS", "SQRT", "ABS"]), reals
        ),
        st.builds("ATAN2({},{})".format, reals, reals),
    )
)
bools: st.SearchStrategy[str] = st.deferred(
    lambda: st.one_of(
        st.sampled_from(
            ["B", "V", "TRUE", "FALSE", "P.OK", "L[3].OK", "$OUT[3]", "$IN[4]", "$FLAG[5]", "$T1"]
        ),
        st.sampled_from(["(C==#RED)", "(P.C<C)", 'STRCOMP(S[],"ab")']),
        st.builds("({}{}{})".format, ints, st.sampled_from(["==", "<>", "<", ">="]), ints),
        st.builds("({}>{})".format, reals, reals),
        st.builds("({} {} {})".format, bools, st.sampled_from(["AND", "OR", "EXOR"]), bools),
        st.builds("(NOT {})".format, bools),
    )
)
motions = st.builds(
    "{} {{{} {}}}{}".format,
    st.just("PTP_REL"),
    st.sampled_from([f"A{axis}" for axis in range(1, 7)]),
    st.integers(-12, 12),
    st.sampled_from(["", " C_PTP", " C_DIS"]),
)
int_targets = st.sampled_from(["I", "J", "A[2]", "A[I]", "K[I,J]", "P.N", "L[J].N"])
real_targets = st.sampled_from(["R", "U", "P.W", "L[I].W", "F.X", "$VEL_AXIS[2]"])
bool_targets = st.sampled_from(["B", "V", "P.OK", "$OUT[3]", "$FLAG[5]"])

FIXED = """L[2]=P; P=L[1]; P.Q={A1 1}; F=INV_POS(F):F; P.TAG[]="xyz"; C=#GREEN; S[]=P.TAG[]
I=STRADD(S[],P.TAG[]); OK=STRTOINT("7",I); GIVE(I); GIVE(J); GIVE(A[3]); NOTE()
ON_ERROR_PROCEED; CONTINUE; WAIT SEC 0.01; WAIT SEC 0; HALT; RETURN; BRAKE; RESUME
I=2147483647; R=1.0E30; $ADVANCE=1; $ADVANCE=3; $APO.CPTP=80; $BASE.X=5; ERR_CLEAR($ERR)
$TIMER_STOP[1]=FALSE; I=$TIMER[1]; PULSE($OUT[3],TRUE,0.05); $CYCFLAG[1]=$FLAG[1] AND NOT B
INTERRUPT OFF 10; INTERRUPT ON 10; INTERRUPT DISABLE; INTERRUPT ENABLE
TRIGGER WHEN DISTANCE=1 DELAY=-10 DO NOTE() PRIO=-1
TRIGGER WHEN DISTANCE=0 DELAY=5 DO $FLAG[1]=TRUE
LIN_REL {Z 10} C_DIS; LIN_REL {X -20} #TOOL; PTP {A6 400}; PTP $AXIS_RET
O=0; SREAD("1 2",ST,O,"%d %d",I,J); SWRITE(S[],ST,O,"%d",I); CAST_TO(S[],O,I,R)
CAST_FROM(S[],O,J,U,OK)"""

simple = st.one_of(
    st.builds("{}={}".format, int_targets, ints),
    st.builds("I={}".format, reals),
    st.builds("{}={}".format, real_targets, reals),
    st.builds("{}={}".format, bool_targets, bools),
    st.builds("$FLAG[{}]={}".format, st.integers(1, 2), bools),
    st.sampled_from(re.split(r"; |\n", FIXED)),
    st.builds("WAIT FOR {}".format, bools),
    motions,
)

Lines = list[str]


def _joined(parts: list[Lines]) -> Lines:
    return [line for part in parts for line in part]


def _blocks(inner: st.SearchStrategy[Lines]) -> st.SearchStrategy[Lines]:
    body = st.lists(inner, max_size=3).map(_joined)
    return st.one_of(
        st.builds(lambda c, a, b: [f"IF {c} THEN", *a, "ELSE", *b, "ENDIF"], bools, body, body),
        st.builds(lambda c, a: [f"WHILE {c}", *a, "ENDWHILE"], bools, body),
        st.builds(lambda c, a: ["REPEAT", *a, f"UNTIL {c}"], bools, body),
        st.builds(lambda a: ["LOOP", *a, "EXIT", "ENDLOOP"], body),
        st.builds(lambda a, b, c: [f"FOR J={a} TO {b}", *c, "ENDFOR"], ints, ints, body),
        st.builds(
            lambda x, a, b: [f"SWITCH {x}", "CASE 1,2", *a, "DEFAULT", *b, "ENDSWITCH"],
            ints,
            body,
            body,
        ),
    )


bodies = st.lists(
    st.recursive(simple.map(lambda line: [line]), _blocks, max_leaves=6), min_size=1, max_size=12
).map(_joined)


def modules(body: Lines) -> tuple[Module, Module]:
    """A program that calls WORK with these lines, and its data list."""
    text = "\n".join(("DEF T()", SETTING, *body, "END", ROUTINES))
    return parse(text, "t.src"), parse(DATA, "t.dat")


@settings(max_examples=60, deadline=None)
@given(bodies, st.integers(0, CYCLES))
def test_a_generated_program_runs_or_stops_with_its_line(body: Lines, press: int) -> None:
    rig = Rig(*modules(body))
    rig.krc.select("T")
    assert rig.krc.start()
    for cycle in range(CYCLES):
        rig.cycles()
        if cycle == press:
            rig.krc.confirm()
            rig.krc.start()
    event(rig.krc.state)
    assert rig.krc.state in ("P_ACTIVE", "P_STOP", "P_END")
    for message in rig.krc.messages:
        assert message.text
        assert message.line > 0 or not message.stops or "limit" in message.text
