"""Building: the shipped image is what the sources give; what is missing is named."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from pathlib import Path

import pytest

from sphmctl.board import build as building
from sphmctl.board.image import SHIPPED, hex_bytes, load, note_of, sha256_of
from sphmctl.errors import InvalidError

SHIPPING_COMPILER = "5.4.0"
"""Debian 12's avr-gcc, with which the shipped image is built; another one gives other bytes."""


def test_the_shipped_image_is_what_the_sources_give(tmp_path: Path) -> None:
    built = building.build(tmp_path / "board.hex")
    shipped = load()
    mend = "run: sphmctl firmware build --out sphmctl/board/board.hex"
    assert built.build_hash == shipped.build_hash, mend
    assert (built.version, built.protocol) == (shipped.version, shipped.protocol), mend
    version = subprocess.run(["avr-gcc", "-dumpversion"], capture_output=True, text=True)
    if version.stdout.strip() == SHIPPING_COMPILER:
        assert built.hex.read_bytes() == SHIPPED.read_bytes(), mend
        assert note_of(built.hex).read_text() == note_of(SHIPPED).read_text(), mend


def test_the_build_hash_is_that_of_the_rule_in_build_toml(tmp_path: Path) -> None:
    (tmp_path / "board").mkdir()
    (tmp_path / "board" / "build.toml").write_bytes(b"flags")
    (tmp_path / "main.cpp").write_bytes(b"int b;")
    (tmp_path / "a.h").write_bytes(b"int a;")
    recipe = building.Recipe("m", (), ("main.cpp",), ("a.h",), (), {})
    text = b"a.h\0int a;\0board/build.toml\0flags\0main.cpp\0int b;\0"
    assert f"{recipe.build_hash(tmp_path):08x}" == hashlib.sha256(text).hexdigest()[:8]


def test_another_flag_or_define_gives_another_hash(tmp_path: Path) -> None:
    folder = tmp_path / "firmware"
    shutil.copytree(building.FIRMWARE, folder)
    hashes = [building.recipe_of(folder).build_hash(folder)]
    recipe = folder / "board" / "build.toml"
    for old, new in (('"-O2"', '"-Os"'), ('"1000000UL"', '"115200UL"')):
        text = recipe.read_text()
        assert old in text
        recipe.write_text(text.replace(old, new))
        hashes.append(building.recipe_of(folder).build_hash(folder))
    assert len(set(hashes)) == 3


def test_a_missing_compiler_is_told_with_its_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(InvalidError) as caught:
        building.build(tmp_path / "board.hex")
    for word in ("avr-g++", "apt install", "gcc-avr", "avr-libc", "binutils-avr"):
        assert word in caught.value.message


def test_without_a_checkout_flashing_is_pointed_at(tmp_path: Path) -> None:
    with pytest.raises(InvalidError, match=r"takes a checkout.*firmware flash"):
        building.build(tmp_path / "board.hex", tmp_path / "firmware")


def test_a_source_that_does_not_compile_is_told_by_its_first_error(tmp_path: Path) -> None:
    folder = tmp_path / "firmware"
    shutil.copytree(building.FIRMWARE, folder)
    main = folder / "main.cpp"
    main.write_text(main.read_text() + "\nint x = ;\n")
    with pytest.raises(InvalidError, match=r"avr-g\+\+ refuses: main\.cpp:.* error"):
        building.build(tmp_path / "board.hex", folder)
    assert not (tmp_path / "board.hex").exists()


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(InvalidError, match="cannot be written"):
        building.build(tmp_path / "none" / "board.hex")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "end record is missing"),
        (":0100000001FE\n", "end record is missing"),
        (":0100000001FF\n:00000001FF\n", "no Intel hex record"),
        ("hello\n", "no Intel hex record"),
        (":xy\n", "no Intel hex record"),
    ],
)
def test_a_file_that_is_no_hex_file_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "x.hex"
    file.write_text(text)
    with pytest.raises(InvalidError, match=words):
        hex_bytes(file)


def test_only_data_records_count(tmp_path: Path) -> None:
    # An extended address, 3 bytes of data (Wikipedia, "Intel HEX", "Record structure"), the end.
    file = tmp_path / "x.hex"
    file.write_text(":020000021000EC\n:0300300002337A1E\n:00000001FF\n")
    assert hex_bytes(file) == 3


def test_an_image_that_was_changed_is_refused(tmp_path: Path) -> None:
    copy = tmp_path / "board.hex"
    copy.write_bytes(SHIPPED.read_bytes())
    with pytest.raises(InvalidError, match=r"note beside board\.hex is missing"):
        load(copy)
    note_of(copy).write_text(note_of(SHIPPED).read_text())
    assert load(copy).sha256 == sha256_of(SHIPPED)
    copy.write_bytes(SHIPPED.read_bytes() + b":00000001FF\n")
    with pytest.raises(InvalidError, match="its note says"):
        load(copy)
