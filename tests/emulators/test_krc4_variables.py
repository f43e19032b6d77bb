"""KRL values as text, the variable store, and what the system variables show."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.emulators.controller import Options
from sphmctl.emulators.interpreter import Memory
from sphmctl.emulators.krl_text import real_text
from tests.emulators.interpreter.rig import Rig as Programs
from tests.emulators.interpreter.rig import config
from tests.emulators.krc4_rig import HOME, Rig, away

DATA = """STRUC KR_STATE_BLK E6AXIS AXIS_ACT, INT OV_PRO, BOOL POWER_FAIL, CHAR NAME[8]
ENUM COLOUR RED,BLUE
INT N
REAL R
BOOL B
DECL COLOUR C
CHAR LABEL[4]
E6POS P
DECL KR_STATE_BLK BLK
CONST INT FIXED=7
"""


def store() -> Memory:
    return Programs(config(DATA)).memory


# The texts are from public captures of KSS 8 controllers and from KUKA's own .dat files.
@pytest.mark.parametrize(
    "text",
    [
        "-35.8241692",
        "298.000",
        "0.0",
        "-0.000443798432",
        "1339.90503",
        "4500.00",
        "-0.0228880346",
        "-1.32582915",
        "0.500000",
    ],
)
def test_a_real_is_printed_as_a_krc4_prints_it(text: str) -> None:
    assert real_text(float(text)) == text


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float32_survives_being_written_as_text(number: float) -> None:
    variables = store()
    assert variables.write_text("R", real_text(number))
    text = variables.read_text("R")
    assert text is not None
    assert struct.pack("f", float(text) + 0.0) == struct.pack("f", number + 0.0)


@pytest.mark.parametrize(
    ("name", "text", "shown"),
    [
        ("N", "-12", "-12"),
        ("N", "'HFF'", "255"),
        ("N", "'B0101'", "5"),
        ("n", " 3 ", "3"),
        ("R", "5", "5.00000"),
        ("R", "2.44140625E-04", "0.000244140625"),
        ("B", "true", "TRUE"),
        ("C", "#blue", "#BLUE"),
        ("LABEL[]", '"ab"', '"ab"'),
        ("P.X", "2", "2.00000"),
        ("P", "{X 2.0, Y 1.0}", "{E6POS: X 2.00000, Y 1.00000}"),
        ("P", "{E6POS:  X 2.0 , S 2,T 35}", "{E6POS: X 2.00000, S 2, T 35}"),
        (
            "BLK",
            '{KR_STATE_BLK: AXIS_ACT {A1 1E2}, POWER_FAIL FALSE, NAME[] "x, y"}',
            '{KR_STATE_BLK: AXIS_ACT {E6AXIS: A1 100.000}, POWER_FAIL FALSE, NAME[] "x, y"}',
        ),
    ],
)
def test_a_right_value_is_taken_and_shown(name: str, text: str, shown: str) -> None:
    variables = store()
    assert variables.write_text(name, text)
    assert variables.read_text(name) == shown


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("N", "55.5"),
        ("N", "2147483648"),
        ("N", ""),
        ("N", "1 2"),
        ("N", "TRUE"),
        ("$OV_PRO", "101"),
        ("$OV_PRO", "-1"),
        ("R", "NaN"),
        ("R", "1E39"),
        ("R", "1,5"),
        ("B", "1"),
        ("C", "#GREEN"),
        ("C", "RED"),
        ("LABEL[]", '"abcde"'),
        ("LABEL[]", "ab"),
        ("LABEL", '"ab"'),
        ("P", "{E6AXIS: A1 1.0}"),
        ("P", "{X 1.0"),
        ("P", "{}"),
        ("P", "{X 1.0, S 2.0}"),
        ("P", "{X 1.0, Q 2.0}"),
        ("P", "{" * 2000),
        ("BLK", "{AXIS_ACT 5}"),
        ("FIXED", "8"),
        ("NOSUCH", "1"),
        ("N[1]", "1"),
        ("P.NO", "1"),
        ("P.", "1"),
    ],
)
def test_a_wrong_value_is_refused_and_changes_nothing(name: str, text: str) -> None:
    variables = store()
    variables.write_text("N", "1")
    names = ("N", "$OV_PRO", "R", "B", "C", "P", "BLK")
    before = [variables.read_text(known) for known in names]
    assert not variables.write_text(name, text)
    assert [variables.read_text(known) for known in names] == before
    assert variables.read_text("FIXED") == "7"


@given(st.text(max_size=60), st.text(alphabet="{}:,\"#ABEX10.-+' []", max_size=60))
def test_no_name_and_no_value_breaks_the_store(name: str, text: str) -> None:
    variables = store()
    variables.read_text(name)
    variables.write_text(name, text)
    for known in ("N", "R", "LABEL[]", "P", "BLK"):
        variables.write_text(known, text)


def test_a_partial_aggregate_leaves_the_other_components_undefined() -> None:
    variables = store()
    assert variables.write_text("P", "{X 1.0, Y 2.0}")
    assert variables.write_text("P", "{Y 3.0}")
    assert variables.read_text("P.X") == ""
    assert variables.read_text("P") == "{E6POS: Y 3.00000}"


def test_an_undefined_variable_has_an_empty_text_and_an_unknown_one_has_none() -> None:
    variables = store()
    assert variables.read_text("P") == ""
    assert variables.read_text("BLK") == ""
    assert variables.read_text("NOSUCH") is None


def test_names_reach_into_arrays_of_structures_and_out_of_range_they_are_unknown() -> None:
    rig = Rig()
    rig.write("SPH_KNOT[64]", "{SEQ 64, VEL 10.0, ACC 20.0, Q {E6AXIS: A1 1.5}}")
    assert rig.read("sph_knot[ 64 ].q.a1") == "1.50000"
    rig.write("SPH_KNOT[64].Q.A1", "2.5")
    assert rig.read("SPH_KNOT[64]") == (
        "{SPH_KNOT_T: SEQ 64, VEL 10.0000, ACC 20.0000, Q {E6AXIS: A1 2.50000}}"
    )
    assert rig.read("SPH_STATE.DONE") == "0"
    for unknown in ("SPH_KNOT[0]", "SPH_KNOT[65]", "SPH_KNOT", "SPH_KNOT[]x", "SPH_STATE[1]"):
        assert rig.read(unknown) is None, unknown


# Poses computed from the data sheet's chain by hand, X Y Z A B C.
@pytest.mark.parametrize(
    ("joints_deg", "pose"),
    [
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (980, 0, 435, 0, 90, 0)),
        ((0.0, -90.0, 90.0, 0.0, 0.0, 0.0), (525, 0, 890, 0, 90, 0)),
        ((0.0, -90.0, 90.0, 0.0, 90.0, 0.0), (445, 0, 810, 180, 0, 180)),
        (
            (30.0, -60.0, 80.0, 10.0, 45.0, 20.0),
            (595.456, -355.129, 611.585, 178.644, 19.380, -161.813),
        ),
    ],
)
def test_pos_act_is_the_flange_of_the_data_sheet(
    joints_deg: tuple[float, ...], pose: tuple[float, ...]
) -> None:
    rig = Rig(Options(start_deg=joints_deg))
    shown = [float(rig.read(f"$POS_ACT.{name}") or "nan") for name in "XYZABC"]
    assert shown[:3] == pytest.approx(pose[:3], abs=6e-4)
    for got, want in zip(shown[3:], pose[3:], strict=True):
        assert math.remainder(got - want, 360.0) == pytest.approx(0.0, abs=6e-4)


def test_status_and_turn_tell_the_branches_apart() -> None:
    assert Rig().read("$POS_ACT.S") == "2"
    assert Rig().read("$POS_ACT.T") == "2"
    overhead = Rig(Options(start_deg=(-10.0, -130.0, -20.0, 5.0, -30.0, -1.0)))
    assert overhead.read("$POS_ACT.S") == "5"
    assert overhead.read("$POS_ACT.T") == "55"


def test_the_controller_begins_where_the_operators_part_ends() -> None:
    rig = Rig()
    expected = {
        "$MODE_OP": "#EX",
        "$EXT": "TRUE",
        "$T1": "FALSE",
        "$PRO_STATE1": "#P_ACTIVE",
        "$PRO_STATE0": "#P_ACTIVE",
        "$PRO_MODE1": "#GO",
        "$PRO_NAME1[]": '"SPH_RUN"',
        "$PRO_ACT": "TRUE",
        "$PRO_MOVE": "FALSE",
        "$ROB_STOPPED": "TRUE",
        "$STOPMESS": "FALSE",
        "$USER_SAF": "TRUE",
        "$ALARM_STOP": "TRUE",
        "$PERI_RDY": "TRUE",
        "$OV_PRO": "100",
        "$ADVANCE": "3",
        "$AXIS_FOR": "",
        "$AXIS_BACK": "",
        "$VEL_ACT": "0.0",
        "$MODEL_NAME[]": '"#KR6R900 C4SR FLR 230"',
        "$AXIS_ACT.A2": "-90.0000",
        "$OUT[1]": "FALSE",
    }
    assert {name: rig.read(name) for name in expected} == expected
    assert int(rig.read("$KR_SERIALNO") or "0") > 0
    for read_only in ("$AXIS_ACT", "$POS_ACT.X", "$MODE_OP", "$KR_SERIALNO", "$IN[1]"):
        assert not rig.controller.store.write_text(read_only, rig.read(read_only) or "")


def test_a_moving_arm_shows_its_block_and_its_speeds() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(90.0), velocity=50.0)
    rig.command(1)
    rig.wait_ms(400)
    assert rig.read("$AXIS_BACK.A1") == "0.0"
    assert rig.read("$AXIS_FOR.A1") == "90.0000"
    assert rig.read("$VEL_AXIS_ACT [1]") == "50.0000"
    assert (rig.read("$VEL_AXIS_ACT[]") or "").split() == ["50.0000", *["0.0"] * 11]
    assert rig.read("$PRO_MOVE") == "TRUE"
    # The flange is 445 mm from A1, which turns at 180 degrees per second.
    assert float(rig.read("$VEL_ACT") or "0") == pytest.approx(0.445 * math.pi, rel=1e-4)


def test_another_robot_and_a_controller_without_our_program_can_be_played() -> None:
    rig = Rig(Options(model_name="#KR16", program_state="P_FREE", installed=False))
    assert rig.read("$MODEL_NAME[]") == '"#KR16"'
    assert rig.read("$PRO_STATE1") == "#P_FREE"
    assert rig.read("SPH_STATE") is None
    assert not rig.controller.store.write_text("SPH_CMD", "1")
    rig.wait_ms(30)
    assert rig.controller.true_joints_deg() == HOME
    assert Rig(Options(program_version=9)).state("VERSION") == 9
    with pytest.raises(ValueError, match="six joints inside their ranges"):
        Rig(Options(start_deg=(0.0, 90.0, 0.0, 0.0, 0.0, 0.0)))
