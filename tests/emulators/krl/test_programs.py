"""Whole programs: the shipped ones and some in the style of the field parse, check and print."""

from __future__ import annotations

from pathlib import Path

import pytest

from sphmctl.emulators.krl.parse import parse, read
from sphmctl.emulators.krl.printer import to_text
from sphmctl.emulators.krl.project import check_files, find_files

PROGRAMS = Path(__file__).with_name("programs")
SHIPPED = Path(__file__).parents[3] / "firmware" / "krc"
FILES = find_files([PROGRAMS, SHIPPED])


def test_the_shipped_program_is_clean() -> None:
    checked = check_files([SHIPPED])
    assert checked.findings == ()
    assert len(checked.files) >= 3


@pytest.mark.parametrize("name", ["sph_run.src", "sph_run.dat", "sph_sps.src"])
def test_each_shipped_file_is_clean_by_itself(name: str) -> None:
    assert check_files([SHIPPED / name]).findings == ()


def test_there_are_thirty_programs_and_they_are_clean() -> None:
    assert sum(path.suffix in (".src", ".sub") for path in FILES if path.parent == PROGRAMS) >= 30
    assert check_files([PROGRAMS]).findings == ()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_printed_program_parses_to_the_same_tree(path: Path) -> None:
    tree = read(path)
    assert parse(to_text(tree), str(path)) == tree


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_program_in_small_letters_is_the_same(path: Path) -> None:
    lines = path.read_text(encoding="ascii").splitlines()
    lower = [line if '"' in line or ";" in line or "&" in line else line.lower() for line in lines]
    assert parse("\r\n".join(lower), str(path)) == read(path)
