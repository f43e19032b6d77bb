"""KRL values as text: forms captured from controllers, round trips, and what must be refused."""

from __future__ import annotations

import contextlib
import math
import re
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import DeviceError, InvalidError
from sphmctl.wire import krl
from sphmctl.wire.krl import Aggregate, Enum

# The state structure of firmware/krc/INTERFACE.md, written as a KRC4 writes structures.
STATE = (
    "{SPH_STATE_T: VERSION 1, SESSION 1234567, STATUS 2, FAULT 0, RD 12, DONE 9, BEAT 431, "
    "TIME 123456, OV 100, MOVING TRUE, STOPPED FALSE, DRIVES TRUE, SAFE TRUE, STOPMESS FALSE, "
    "MODE #EX, Q {E6AXIS: A1 -35.8241692, A2 -92.22486, A3 90, A4 -0.000443798432, "
    "A5 -3.821331E-04, A6 298.000, E1 0.0, E2 0.0, E3 0.0, E4 0.0, E5 0.0, E6 0.0}}"
)

NAMES = st.from_regex(r"[A-Za-z_$][A-Za-z0-9_$]{0,23}", fullmatch=True)
STRINGS = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters='"'))
REALS = st.floats(width=32, allow_nan=False, allow_infinity=False, allow_subnormal=False)
SCALARS = (
    st.booleans() | st.integers(krl.MIN_INT, krl.MAX_INT) | REALS | STRINGS | st.builds(Enum, NAMES)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.builds(
        Aggregate, st.dictionaries(NAMES, inner, max_size=5), st.none() | NAMES
    ),
    max_leaves=20,
)


def to_single(value: krl.KrlValue) -> krl.KrlValue:
    """The value as a controller keeps it: reals in single precision."""
    if isinstance(value, Aggregate):
        return Aggregate({k: to_single(v) for k, v in value.fields.items()}, value.tag)
    if isinstance(value, float):
        return float(struct.unpack("f", struct.pack("f", value))[0])
    return value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("35", 35),
        ("-1", -1),
        ("+7", 7),
        (" 35 ", 35),
        ("-92.22486", -92.22486),
        ("-3.821331E-04", -3.821331e-4),
        ("-35.8241692", -35.8241692),
        ("0.0", 0.0),
        ("298.000", 298.0),
        ("-0.000443798432", -0.000443798432),
        ("1E3", 1000.0),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("5.", 5.0),
        ("TRUE", True),
        ("FALSE", False),
        ("true", True),
        ("#T1", Enum("T1")),
        ("#EX", Enum("EX")),
        ("#P_ACTIVE", Enum("P_ACTIVE")),
        ('"xxxxxxxxxx"', "xxxxxxxxxx"),
        ('""', ""),
        ('"{a, b: 1,5}"', "{a, b: 1,5}"),
        ("'C'", "C"),
        ("'B'", "B"),
        ("'B0101'", 5),
        ("'HFF'", 255),
        ("'hff'", 255),
        ("'HFFFFFFFF'", -1),
        ("'B" + "1" * 32 + "'", -1),
    ],
)
def test_a_scalar_is_read(text: str, value: krl.KrlValue) -> None:
    parsed = krl.parse(text)
    assert parsed == value
    assert type(parsed) is type(value)


@pytest.mark.parametrize("text", ["NaN", "NAN", "{A1 NaN}"])
def test_nan_is_read(text: str) -> None:
    value = krl.parse(text)
    number = value.fields["A1"] if isinstance(value, Aggregate) else value
    assert isinstance(number, float)
    assert math.isnan(number)


def test_the_state_structure_is_read_with_all_its_fields() -> None:
    value = krl.parse(STATE)
    assert isinstance(value, Aggregate)
    assert value.tag == "SPH_STATE_T"
    fields = dict(value.fields)
    axes = fields.pop("Q")
    assert fields == {
        "VERSION": 1, "SESSION": 1234567, "STATUS": 2, "FAULT": 0, "RD": 12, "DONE": 9,
        "BEAT": 431, "TIME": 123456, "OV": 100, "MOVING": True, "STOPPED": False,
        "DRIVES": True, "SAFE": True, "STOPMESS": False, "MODE": Enum("EX"),
    }  # fmt: skip
    arm = {
        "A1": -35.8241692, "A2": -92.22486, "A3": 90, "A4": -0.000443798432,
        "A5": -3.821331e-4, "A6": 298.0,
    }  # fmt: skip
    assert axes == Aggregate(arm | {f"E{i}": 0.0 for i in range(1, 7)}, "E6AXIS")
    assert list(value.fields)[:2] == ["VERSION", "SESSION"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        # The forms of a state block's capture, shortened: positions nested under their names.
        (
            "{KR_STATE_BLK: AXIS_ACT {E6AXIS: A1 0.0, A2 -90}, OV_PRO 25, POWER_FAIL FALSE}",
            Aggregate(
                {
                    "AXIS_ACT": Aggregate({"A1": 0.0, "A2": -90}, "E6AXIS"),
                    "OV_PRO": 25,
                    "POWER_FAIL": False,
                },
                "KR_STATE_BLK",
            ),
        ),
        # JOpenShowVar writes no type; ROS drivers put two blanks after it.
        ("{X 2.0, Y 1.0, S 0.0}", Aggregate({"X": 2.0, "Y": 1.0, "S": 0.0})),
        ("{E6AXIS:  A1 1.5}", Aggregate({"A1": 1.5}, "E6AXIS")),
        ("{E6POS: X 1, S 2, T 35}", Aggregate({"X": 1, "S": 2, "T": 35}, "E6POS")),
        # Forms of public data lists.
        (
            '{MODUL[] "x",NR 1,AX {A1 1000.0}}',
            Aggregate({"MODUL[]": "x", "NR": 1, "AX": Aggregate({"A1": 1000.0})}),
        ),
        ("{S 'B010',OPTION 'HA'}", Aggregate({"S": 2, "OPTION": 10})),
        ("{N[1] 5, N[2] 6}", Aggregate({"N[1]": 5, "N[2]": 6})),
        ("{N[1,2] 5}", Aggregate({"N[1,2]": 5})),
        ("{N[1, 2] 5,T 'x'}", Aggregate({"N[1, 2]": 5, "T": "x"})),
        ("{}", Aggregate({})),
        ("{ FRAME : }", Aggregate({}, "FRAME")),
    ],
)
def test_a_structure_is_read(text: str, value: Aggregate) -> None:
    assert krl.parse(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "ends early"),
        ("   ", "ends early"),
        ("{", "ends early"),
        ("{A1 1", "ends early"),
        ("{A1 1,", "ends early"),
        ("{A1", "ends early"),
        ("{A1 1, B {C 2}", "ends early"),
        ("{E6AXIS: A1 1, A2", "ends early"),
        ("1 2", "'2' after the value"),
        ("{A1 1}}", "'}' after the value"),
        ("{A1 1 A2 2}", "'A2' after component 'A1'; , or } would be right"),
        ("{A1 1,}", "ends early"),
        ("{A1 }", "'}'; a value"),
        ("{A1 ,}", "','; a value"),
        ("{A1 1, 2 3}", "'2'; a component name"),
        ("{A1 1, A1 2}", "component 'A1' twice"),
        ("{1X: A1 2}", "'1X'; a KRL name"),
        ("}", "'}'; a value"),
        ("hello", "'hello'; a value"),
        ("#", "''; a KRL name"),
        ("#1", "'1'; a KRL name"),
        ('"abc', "'\"'; a value"),
        ("'", '"\'"; a value'),
        ("''", "one character"),
        ("'CC'", "'CC'; 'B0101', 'HFF' or one character"),
        ("'B012'", "'B012'"),
        ("'HXY'", "'HXY'"),
        ("'B" + "0" * 33 + "'", "one character would be right"),
        ("'H1FFFFFFFF'", "at most 32 bits"),
        ("1_000", "'1_000'; a value"),
        ("٣", "'٣'; a value"),
        ("inf", "'inf'; a value"),
        ("Infinity", "'Infinity'; a value"),
        ("1E999", "number 1E999; at most 3.4e+38"),
        ("-1E999", "number -1E999"),
        ("--1", "'--1'; a number"),
        ("1.2.3", "'1.2.3'; a number"),
        ("-", "'-'; a number"),
        ("E", "'E'; a number"),
        ("9" * 65, "a value would be right"),
        ("[", "'['; a value"),
        ("{A1 1 " + "x" * 5000 + "}", "after component 'A1'"),
        ("{" + "x-" * 5000 + " 1}", "a component name"),
        ("'" + "x" * 5000 + "'", "one character would be right"),
        ("x" * 70000, "70000 characters; at most 65535"),
    ],
)
def test_a_text_that_is_no_value_is_refused_in_one_sentence(text: str, message: str) -> None:
    with pytest.raises(krl.KrlSyntaxError) as caught:
        krl.parse(text)
    assert message in caught.value.message
    assert isinstance(caught.value, DeviceError)
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize(
    ("text", "number"), [("1,5", "1,5"), ("{E6AXIS: A1 -35,82, A2 1,0}", "-35,82")]
)
def test_a_decimal_comma_is_named_as_such(text: str, number: str) -> None:
    message = rf"decimal comma in '{number}'; a decimal point would be right"
    with pytest.raises(krl.KrlSyntaxError, match=message):
        krl.parse(text)


def test_nesting_has_a_limit_in_both_directions() -> None:
    def nested(depth: int) -> str:
        return "{A " * depth + "1" + "}" * depth

    value = krl.parse(nested(krl.MAX_DEPTH))
    assert krl.format_value(value) == nested(krl.MAX_DEPTH)
    with pytest.raises(krl.KrlSyntaxError, match="nested deeper than 16"):
        krl.parse(nested(krl.MAX_DEPTH + 1))
    with pytest.raises(krl.KrlSyntaxError, match="nested deeper than 16"):
        krl.parse("{A " * 20000)
    with pytest.raises(InvalidError, match="nested deeper than 16"):
        krl.format_value(Aggregate({"A": value}))


@given(st.text(st.sampled_from("{}:,#\"'[]$ ABE019.+-_\n"), max_size=40) | st.text(max_size=40))
def test_random_text_gives_a_value_or_a_syntax_error(text: str) -> None:
    with contextlib.suppress(krl.KrlSyntaxError):
        krl.parse(text)


@given(st.integers(0, len(STATE) - 1))
def test_a_state_that_was_cut_anywhere_is_refused(size: int) -> None:
    with pytest.raises(krl.KrlSyntaxError):
        krl.parse(STATE[:size])


@given(VALUES)
def test_what_is_written_is_read_back(value: krl.KrlValue) -> None:
    assert to_single(krl.parse(krl.format_value(value))) == to_single(value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "TRUE"),
        (False, "FALSE"),
        (0, "0"),
        (-2147483648, "-2147483648"),
        (100.0, "100.0"),
        (-35.8241692, "-35.8241692"),
        (1 / 3, "0.333333333"),
        (0.00025, "0.00025"),
        (1e-5, "1.0E-05"),
        (-1.23456789012e-7, "-1.23456789E-07"),
        (3.4028234663852886e38, "3.40282347E+38"),
        (1e-300, "0.0"),
        (Enum("T1"), "#T1"),
        ("abc", '"abc"'),
        (
            Aggregate({"TEXT[]": "x", "Q": Aggregate({"A1": 1}), "N[2]": 3}, "T"),
            '{T: TEXT[] "x", Q {A1 1}, N[2] 3}',
        ),
        (Aggregate({}), "{}"),
    ],
)
def test_a_value_is_written_as_krl_writes_it(value: krl.KrlValue, text: str) -> None:
    assert krl.format_value(value) == text


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, "number nan; a number within"),
        (math.inf, "number inf"),
        (-1e39, r"number -1e\+39"),
        (2**31, r"number 2147483648; .* \(INT\) would be right"),
        (-(2**31) - 1, "number -2147483649"),
        ('a"b', "without quotes would be right"),
        ("a\nb", "printable text"),
        (Enum(""), "name ''; letters"),
        (Enum("A B"), "name 'A B'"),
        (Aggregate({"A B": 1}), "name 'A B'"),
        (Aggregate({"A": 1}, "X:"), "name 'X:'"),
        (Aggregate({"A": math.nan}), "number nan"),
    ],
)
def test_a_value_that_krl_does_not_have_is_refused(value: krl.KrlValue, message: str) -> None:
    with pytest.raises(InvalidError, match=message):
        krl.format_value(value)


def test_an_axis_aggregate_has_all_twelve_components() -> None:
    text = krl.axis_aggregate(-170.123456, -90, 90.0, 1e-6, 0.0, 350)
    assert text == (
        "{E6AXIS: A1 -170.123456, A2 -90.0, A3 90.0, A4 1.0E-06, A5 0.0, A6 350.0, "
        "E1 0.0, E2 0.0, E3 0.0, E4 0.0, E5 0.0, E6 0.0}"
    )


@given(st.lists(st.floats(-360, 360, width=32), min_size=6, max_size=6))
def test_axis_angles_keep_single_precision(axes_deg: list[float]) -> None:
    text = krl.axis_aggregate(*axes_deg)
    numbers = [float(n) for n in re.findall(r"A\d ([^,}]+)", text)]
    single = [struct.unpack("f", struct.pack("f", n))[0] for n in numbers]
    assert single == [a if abs(a) >= krl.MIN_REAL else 0.0 for a in axes_deg]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_an_axis_aggregate_without_a_number_is_refused(bad: float) -> None:
    with pytest.raises(InvalidError, match=r"A3 (nan|inf|-inf); a number"):
        krl.axis_aggregate(0, 0, bad, 0, 0, 0)


def test_an_axis_aggregate_needs_six_angles() -> None:
    with pytest.raises(InvalidError, match="5 axis angles; six"):
        krl.axis_aggregate(0, 0, 0, 0, 0)


def test_an_enumeration_value_prints_as_in_krl() -> None:
    assert str(Enum("EX")) == "#EX"
