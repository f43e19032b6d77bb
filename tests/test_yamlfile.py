"""YAML files: data, places, and one clear sentence for everything that can be wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from sphmctl.errors import InvalidError
from sphmctl.yamlfile import DEPTH_LIMIT, SIZE_LIMIT_BYTES, STRICT, load, read


class Inner(BaseModel):
    model_config = STRICT
    port: int
    share: float = 1.0


class Outer(BaseModel):
    model_config = STRICT
    name: str
    arm: Inner
    items: tuple[Inner, ...] = ()
    table: dict[str, Inner] = {}


def told(tmp_path: Path, text: str | bytes) -> str:
    file = tmp_path / "f.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidError) as caught:
        load(file, Outer)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(file))
    assert caught.value.exit_code == 3
    return str(caught.value).removeprefix(str(file))


def test_values_come_with_line_and_column_from_one(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text("a: 1\nb:\n  - x: [1, 2.5, yes]\n")
    document = read(file)
    assert document.data == {"a": 1, "b": ({"x": (1, 2.5, "yes")},)}
    assert document.keys[("b", 0, "x")] == (3, 5)
    assert document.values[("b", 0, "x", 1)] == (3, 12)


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("12", 12),
        ("-3", -3),
        ("0x1F", 31),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("+2.", 2.0),
        ("true", True),
        ("null", None),
        ("~", None),
        ("", None),
        ("no", "no"),
        ("1:30", "1:30"),
        ("2026-01-01", "2026-01-01"),
        ("'12'", "12"),
        ("0123", 123),
    ],
)
def test_plain_words_follow_the_core_schema_of_yaml_1_2(
    tmp_path: Path, written: str, value: object
) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(f"a: {written}\n")
    found = read(file).data["a"]
    assert (type(found), found) == (type(value), value)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (
            "name: x\narm: {prot: 1}",
            "line 2, column 7",
            "arm.prot: this key is not known (did you mean 'port'?)",
        ),
        (
            "name: x\narm: {port: 1}\nqqq: 1",
            "line 3, column 1",
            "known here: name, arm, items, table",
        ),
        (
            "name: x\narm: {port: '1'}",
            "line 2, column 13",
            'arm.port: "1" should be a whole number',
        ),
        ("name: x\narm: {port: 1.0}", "line 2, column 13", "should be a whole number"),
        ("name: x\narm: {port: true}", "line 2, column 13", "true should be a whole number"),
        (
            "name: x\narm: {port: 1, share: x}",
            "line 2, column 23",
            'arm.share: "x" should be a number',
        ),
        ("name: 5\narm: {port: 1}", "line 1, column 7", "name: 5 should be a text"),
        ("name: x", "line 1, column 1", "arm: this key is missing"),
        ("name: x\narm: {}", "line 2, column 6", "arm.port: this key is missing"),
        ("name: x\narm: 3", "line 2, column 6", "arm: 3 should be keys with values"),
        ("name: x\narm: {port: 1}\nitems: 3", "line 3, column 8", "items: 3 should be a list"),
        (
            "name: x\narm: {port: 1}\nitems:\n  - port: 1\n  - prt: 2",
            "line 5, column 5",
            "items[2].prt",
        ),
        (
            "name: x\narm: {port: 1}\ntable: {q: {pot: 2}}",
            "line 3, column 13",
            "did you mean 'port'?",
        ),
        ("name: x\nname: y", "line 2, column 1", "the key 'name' was given before, in line 1"),
        ("name: x\narm: {port: .nan}", "line 2, column 13", "arm.port: .nan cannot be used"),
        ("name: x\narm: {port: 1, share: -.inf}", "line 2, column 23", "give a finite number"),
        ("name: x\narm: {port: 1, share: 1e999}", "line 2, column 23", "too large"),
        ("name: x\narm: {port: " + "9" * 5000 + "}", "line 2, column 13", "too large"),
        ("name: &a x", "line 1, column 7", "no anchors"),
        ("name: *a", "line 1, column 7", "no aliases"),
        ("name: !!python/object:os.system x", "line 1, column 7", "leave out the tag"),
        ("? [a]\n: 1", "line 1, column 3", "a key must be one word"),
        ("name: [1", "line 2, column 1", "not valid YAML"),
        ("name: 'x", "line 1, column", "not valid YAML"),
        ("a: 1\n\tb: 2", "line 2, column 1", "tab"),
        ("name: x\n---\nname: y", "line 2, column 1", "a second document"),
        ("name: \x07", "line 1, column 7", "U+0007"),
        ("name: x\narm: " + "[" * 100_000, "line 2", f"nested deeper than {DEPTH_LIMIT}"),
        (b"name: x\narm: \xff\xfe", "line 2", "UTF-8"),
        ("", "", "the file is empty"),
        ("# nothing\n", "", "the file is empty"),
        ("- a\n- b", "", 'the file holds ["a", "b"]; it should hold keys'),
        ("just words", "", "it should hold keys"),
    ],
)
def test_one_sentence_tells_place_field_value_and_remedy(
    tmp_path: Path, text: str | bytes, place: str, words: str
) -> None:
    sentence = told(tmp_path, text)
    assert place in sentence
    assert words in sentence


def test_a_bomb_of_aliases_is_refused_at_its_first_anchor(tmp_path: Path) -> None:
    bomb = "a: &a [x, x]\n" + "".join(
        f"{n}: &{n} [*{p}, *{p}]\n" for p, n in zip("abcd", "bcde", strict=True)
    )
    assert "line 1, column 4" in told(tmp_path, bomb)


def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    assert "larger than 4 MB" in told(tmp_path, b"#" * (SIZE_LIMIT_BYTES + 1))


def test_missing_and_unreadable_files_are_named(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path / "none.yaml", "there is no such file"),
        (tmp_path, "cannot be read: Is a directory"),
        (Path("a\0b"), "cannot be read"),
    ):
        with pytest.raises(InvalidError, match=words):
            load(path, Outer)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.binary(max_size=200)
    | st.text("abc:-[]{}&*!#'\"|>%@`,? \n\t01.~", max_size=80).map(str.encode)
)
def test_no_content_whatever_ends_in_anything_but_the_error(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "f.yaml"
    file.write_bytes(content)
    with pytest.raises(InvalidError):
        load(file, Outer)
