"""What runs, but hardly as it was meant, is a warning at its line."""

from __future__ import annotations

import pytest

from sphmctl.emulators.krl.check import check
from sphmctl.emulators.krl.parse import parse
from tests.emulators.krl.rig import checked, found

START = ("BAS(#INITMOV,0)", "PTP XHOME")


def test_c_comparisons_that_bind_looser_than_they_look() -> None:
    lines = ("BOOL P,Q", "P=TRUE", "Q=TRUE", "P=P==Q AND TRUE", "P=(P==Q) AND TRUE")
    assert found(*lines) == [(5, "warning", "precedence")]


def test_m_an_int_division_that_loses_its_rest() -> None:
    assert found("REAL R", "R=1/2", "R=1/2.0") == [(3, "warning", "division")]


def test_c_a_local_variable_that_nothing_sets() -> None:
    assert found("INT X", "INT Y", "Y=X") == [(4, "warning", "undefined")]


def test_c_speeds_that_are_never_set() -> None:
    codes = found("PTP XHOME")
    assert codes == [(2, "warning", "velocity")] * 2
    assert found(*START) == []
    some = [f"${kind}_AXIS[{axis}]=20" for kind in ("VEL", "ACC") for axis in range(1, 6)]
    assert found(*some, "PTP XHOME") == [(12, "warning", "velocity")] * 2


@pytest.mark.parametrize(
    "stop",
    [
        "$OUT[1]=TRUE",
        "IF $IN[1] THEN\nENDIF",
        "PULSE($OUT[1],TRUE,0.1)",
        "WAIT SEC 0",
        "HALT",
        "WAIT FOR $FLAG[1]",
        "$ACT_BASE=1",
        "$FLAG[1]=$AXIS_ACT.A1>0",
    ],
)
def test_c_what_stops_the_advance_run_between_approximated_motions(stop: str) -> None:
    assert found(*START, "PTP XHOME1 C_PTP", stop, "PTP XHOME2") == [(5, "warning", "blend")]
    assert found(*START, "PTP XHOME1", stop, "PTP XHOME2") == []
    assert found(*START, "PTP XHOME1 C_PTP", "CONTINUE", stop, "PTP XHOME2") == []


def test_c_an_output_in_a_blended_loop() -> None:
    lines = (*START, "LOOP", "PTP XHOME C_PTP", "$OUT[1]=TRUE", "ENDLOOP")
    assert found(*lines) == [(6, "warning", "blend")]


def test_c_a_stop_in_a_routine_that_is_called_between() -> None:
    lines = "\n".join((*START, "PTP XHOME1 C_PTP", "B()", "PTP XHOME2"))
    program = f"DEF A()\n{lines}\nEND\nDEF B()\nWAIT SEC 1\nEND"
    assert checked(program) == [(5, "warning", "blend")]


def test_c_plain_variables_and_a_wait_for_the_empty_ring_do_not_disturb() -> None:
    lines = (*START, "LOOP", "IF RD==WR THEN", "WAIT FOR RD<>WR", "ELSE")
    more = ("PTP XHOME C_PTP", "RD=RD+1", "ENDIF", "ENDLOOP")
    assert found(*lines, *more, data=("INT RD=0", "INT WR=0")) == []


def test_c_a_signal_on_an_output_counts_as_the_output() -> None:
    lines = ("SIGNAL LAMP $OUT[1]", *START, "PTP XHOME1 C_PTP", "LAMP=TRUE", "PTP XHOME2")
    assert found(*lines) == [(6, "warning", "blend")]


def test_c_a_frame_changed_behind_an_approximated_motion() -> None:
    lines = (*START, "PTP XHOME1 C_PTP", "$BASE=$NULLFRAME", "PTP XHOME2")
    assert found(*lines) == [(5, "warning", "frame")]


def test_c_a_ptp_before_a_lin_needs_two_words() -> None:
    assert found(*START, "PTP XHOME1 C_PTP", "LIN {X 1}") == [(4, "warning", "blend")]
    assert found(*START, "PTP XHOME1 C_PTP C_DIS", "LIN {X 1}") == []


def test_m_the_first_motion_is_a_ptp() -> None:
    assert found("BAS(#INITMOV,0)", "LIN {X 1}") == [(3, "warning", "first")]


def test_m_brake_belongs_to_an_interrupt() -> None:
    assert found("BRAKE") == [(2, "warning", "interrupt")]
    program = "DEF A()\nINTERRUPT DECL 9 WHEN $FLAG[1] DO B()\nEND\nDEF B()\nBRAKE\nRESUME\nEND"
    assert checked(program) == []


def test_c_bas_does_not_belong_to_an_interrupt() -> None:
    program = "DEF A()\nINTERRUPT DECL 9 WHEN $FLAG[1] DO B()\nEND\nDEF B()\nBAS(#TOOL,1)\nEND"
    assert checked(program) == [(5, "warning", "interrupt")]


def test_m_a_submit_program_neither_waits_nor_moves() -> None:
    lines = ["DEF SPS()", "LOOP", "WAIT FOR NOT($POWER_FAIL)", "WAIT SEC 1", "B()", "ENDLOOP"]
    submit = parse("\n".join([*lines, "END"]), "sps.sub")
    called = parse("DEF B()\nPTP $AXIS_ACT\nEND", "b.src")
    findings = [(f.file, f.line, f.severity, f.code) for f in check([submit, called])]
    assert ("sps.sub", 4, "warning", "submit") in findings
    assert ("b.src", 2, "error", "submit") in findings
    assert ("sps.sub", 3, "warning", "submit") not in findings


def test_c_folds_that_do_not_pair() -> None:
    assert found(";FOLD A", "HALT") == [(2, "warning", "fold")]
    assert found(";ENDFOLD", "HALT") == [(2, "warning", "fold")]
