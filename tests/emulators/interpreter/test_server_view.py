"""Variables as the variable server reads and writes them by text."""

from __future__ import annotations

from functools import lru_cache

from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.emulators.interpreter import Memory
from sphmctl.emulators.krl_text import Array, Enum, Struct
from tests.emulators.interpreter.rig import Rig, config

DATA = """STRUC P INT N, CHAR S[8], AXIS Q
DECL P L[3]
INT A[2,3]
CHAR T[2,5]
CONST INT K=4
BOOL B
REAL R=1.5
"""


@lru_cache(maxsize=1)
def memory() -> Memory:
    return Rig(config(DATA)).memory


def test_components_are_read_and_written_by_their_path() -> None:
    store = memory()
    assert store.write_text("l[2].q.a3", "1.5")
    assert store.read_text("L[2].Q") == "{AXIS: A3 1.50000}"
    assert store.write_text("L[2]", '{P: N 1, S[] "x", Q {AXIS: A1 2.0}}')
    assert store.read_text("L[2].Q.A3") == ""
    assert store.read_text("L[2].S[]") == '"x"'
    assert store.write_text("T[2,]", '"ab"')
    assert store.read_text("T[2,2]") == '"b"'


def test_a_refused_write_changes_nothing() -> None:
    store = memory()
    for name, text in (
        ("K", "5"), ("R", "TRUE"), ("B", "1"), ("L[4].N", "1"), ("L[1].NO", "1"), ("A[1]", "1"),
        ("A[3,1]", "1"), ("A[0,1]", "1"), ("T[1,0]", "1"), ("L[0].N", "1"),
        ("L", "{N 1}"), ("NOBODY", "1"), ("T[1,]", '"toolong"'), ("", ""),
    ):  # fmt: skip
        before = store.read_text(name)
        assert not store.write_text(name, text), name
        assert store.read_text(name) == before


def test_the_types_of_what_names_lead_to() -> None:
    store = memory()
    assert isinstance(store.kind_of("L[1]"), Struct)
    assert isinstance(store.kind_of("L[]"), Array)
    assert isinstance(store.kind_of("$MODE_OP"), Enum)
    assert store.kind_of("L[1].NO") is None


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(
        st.text(max_size=30),
        st.from_regex(r"(L|A|T|B|R|\$OUT|\$TIMER|\$OV_PRO)(\[[0-9,]*\])?(\.[NSQ])?(\[\])?"),
    ),
    st.one_of(st.text(max_size=30), st.sampled_from(["1", "1.5", '"a"', "#EX", "{N 1}", "TRUE"])),
)
def test_no_name_and_no_text_breaks_it(name: str, text: str) -> None:
    store = memory()
    if store.write_text(name, text):
        assert store.read_text(name) is not None
    store.read_text(name)
