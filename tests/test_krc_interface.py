"""The KRL program's interface says the same in its document, its data list and the daemon."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sphmctl.drivers import krc_interface as krc

KRC = Path(__file__).parents[1] / "firmware" / "krc"
SOURCES = ("sph_run.src", "sph_run.dat", "sph_sps.src")

NAME_LIMIT = 24
"""Characters in a KRL name, at most."""

Table = dict[str, list[str]]


def tables() -> dict[str, Table]:
    """The tables of INTERFACE.md: what precedes each -> first cell of each row -> other cells."""
    found: dict[str, Table] = {}
    title = ""
    for line in (KRC / "INTERFACE.md").read_text().splitlines():
        if not line.startswith("|"):
            title = line.strip("# ").split(":")[0].strip("` ") or title
            continue
        first, *rest = (cell.strip() for cell in line.strip("|").split("|"))
        if first not in ("name", "field") and not first.startswith("---"):
            found.setdefault(title, {})[first] = rest
    return found


def statements(file: str) -> list[str]:
    """The statements of a KRL file: no header lines, comments or blank lines."""
    lines = (line.split(";")[0].strip() for line in (KRC / file).read_text().splitlines())
    return [line for line in lines if line and not line.startswith("&")]


def numbers_of_document() -> dict[str, int]:
    return {name: int(cells[0]) for name, cells in tables()["Numbers"].items()}


def numbers_of_data_list() -> dict[str, int]:
    found = (
        re.fullmatch(r"GLOBAL CONST INT SPH_(\w+)=(-?\d+)", line)
        for line in statements("sph_run.dat")
    )
    return {match[1]: int(match[2]) for match in found if match}


def fields_of_document(structure: str) -> dict[str, str]:
    return {name: cells[0] for name, cells in tables()[structure].items()}


def fields_of_data_list(structure: str) -> dict[str, str]:
    """A GLOBAL STRUC line: `TYPE A,B, TYPE C`; a type holds for the names up to the next type."""
    (text,) = (
        line.removeprefix(f"GLOBAL STRUC {structure} ")
        for line in statements("sph_run.dat")
        if line.startswith(f"GLOBAL STRUC {structure} ")
    )
    fields: dict[str, str] = {}
    kind = ""
    for part in text.split(","):
        words = part.split()
        if len(words) == 2:
            kind = words[0]
        fields[words[-1]] = kind
    return fields


def declarations() -> dict[str, tuple[str, str]]:
    """DECL GLOBAL lines of the data list: name -> type with its array size, initial value."""
    found = (
        re.fullmatch(r"DECL GLOBAL (\w+) (\w+)(\[\d+\])?(?:=(.*))?", line)
        for line in statements("sph_run.dat")
    )
    return {m[2]: (m[1] + (m[3] or ""), m[4] or "") for m in found if m}


def aggregate(text: str) -> dict[str, str]:
    """The fields of one KRL aggregate; nested ones stay text."""
    fields = re.findall(r"(\w+) (\{[^{}]*\}|[^,{}]+)", text.strip()[1:-1])
    return dict(fields)


def test_the_numbers_are_the_same_in_document_daemon_and_data_list() -> None:
    document = numbers_of_document()
    assert len(document) == 25
    assert list(krc.NUMBERS.items()) == list(document.items())
    assert {n: v for n, v in numbers_of_data_list().items() if n != "CHECK"} == document


def test_the_checksum_is_that_of_the_documents_tables_everywhere() -> None:
    found = tables()
    lines = [f"{name}={cells[0]}" for name, cells in found["Numbers"].items()]
    for title in ("Variables", krc.KNOT_TYPE, krc.STATE_TYPE):
        lines += [f"{name}:{cells[0]}" for name, cells in found[title].items()]
    check = zlib.crc32("\n".join(lines).encode()) % 2**31
    assert check == krc.CHECK
    assert numbers_of_data_list()["CHECK"] == check
    assert aggregate(declarations()[krc.STATE][1])["CHECK"] == str(check)


def test_any_change_of_the_interface_changes_the_checksum() -> None:
    def swapped(table: Mapping[str, Any]) -> dict[str, Any]:
        first, second, *rest = table
        return {name: table[name] for name in (second, first, *rest)}

    tables: list[Mapping[str, Any]] = [
        krc.NUMBERS,
        krc.VARIABLES,
        krc.KNOT_FIELDS,
        krc.STATE_FIELDS,
    ]
    assert krc.checksum(*tables) == krc.CHECK
    for place, table in enumerate(tables):
        changed = [*tables[:place], swapped(table), *tables[place + 1 :]]
        assert krc.checksum(*changed) != krc.CHECK


def test_the_variables_are_the_same_in_document_daemon_and_data_list() -> None:
    document = {name: cells[0] for name, cells in tables()["Variables"].items()}
    assert len(document) == 7
    assert dict(krc.VARIABLES) == document
    declared = declarations()
    assert {name: declared[name][0] for name in document} == document


@pytest.mark.parametrize(
    ("structure", "fields"),
    [(krc.KNOT_TYPE, krc.KNOT_FIELDS), (krc.STATE_TYPE, krc.STATE_FIELDS)],
)
def test_a_structure_has_the_same_fields_in_the_same_order_everywhere(
    structure: str, fields: dict[str, str]
) -> None:
    document = list(fields_of_document(structure).items())
    assert document
    assert list(fields.items()) == document
    assert list(fields_of_data_list(structure).items()) == document


def test_everything_that_is_read_before_it_is_written_has_an_initial_value() -> None:
    values = {name: value for name, (_, value) in declarations().items()}
    # A session fills the ring, and the program's start the limits.
    assert {name for name, value in values.items() if not value} == {
        krc.KNOT,
        "SPH_LOW",
        "SPH_HIGH",
    }
    written_by_daemon = (krc.WRITTEN, krc.LAST, krc.COMMAND, krc.SESSION, krc.BEAT)
    assert {values[name] for name in written_by_daemon} == {"0"}
    assert values["SPH_BRAKE"] == "TRUE"


def test_the_initial_aggregates_are_complete_and_carry_the_version() -> None:
    values = {name: value for name, (_, value) in declarations().items()}
    state = aggregate(values[krc.STATE])
    assert list(state) == list(krc.STATE_FIELDS)
    assert state["VERSION"] == str(krc.VERSION)
    assert state["STATUS"] == str(int(krc.Status.IDLE))
    assert list(aggregate(values["SPH_EMPTY"])) == list(krc.KNOT_FIELDS)
    axes = [f"A{i}" for i in range(1, 7)] + [f"E{i}" for i in range(1, 7)]
    assert list(aggregate(state["Q"])) == axes


def test_the_submit_part_fills_every_field_of_the_state() -> None:
    filled = {
        match[1]
        for line in statements("sph_sps.src")
        if (match := re.match(r"STATE\.(\w+)=", line))
    }
    assert filled == set(krc.STATE_FIELDS)


@pytest.mark.parametrize("file", SOURCES)
def test_the_program_uses_only_names_that_are_declared(file: str) -> None:
    text = "\n".join(statements("sph_run.dat"))
    known = set(re.findall(r"\bSPH_\w+", text))
    for source in SOURCES:
        for line in statements(source):
            if match := re.match(r"(?:GLOBAL )?DEF(?:FCT \w+|DAT)? (SPH_\w+)", line):
                known.add(match[1])
    used = {name for line in statements(file) for name in re.findall(r"\bSPH_\w+", line)}
    assert used <= known


@pytest.mark.parametrize("file", SOURCES)
def test_names_fit_and_blocks_close(file: str) -> None:
    lines = statements(file)
    names = {name for line in lines for name in re.findall(r"[A-Za-z_$]\w*", line)}
    assert {name for name in names if len(name) > NAME_LIMIT} == set()
    first = [line.split("(")[0].split()[0] for line in lines]
    for opening, closing in (("IF", "ENDIF"), ("LOOP", "ENDLOOP"), ("FOR", "ENDFOR")):
        assert first.count(opening) == first.count(closing)
    routines = sum(re.match(r"(GLOBAL )?DEF ", line) is not None for line in lines)
    assert routines == first.count("END")
    assert first.count("DEFFCT") == first.count("ENDFCT")
    folds = (KRC / file).read_text()
    assert folds.count(";FOLD") == folds.count(";ENDFOLD")


def test_the_stream_reads_nothing_that_stops_the_advance_run() -> None:
    lines = statements("sph_run.src")
    begin = lines.index("LOOP", lines.index("DEF SPH_STREAM()"))
    end = lines.index("WAIT SEC 0", begin)
    system = {name for line in lines[begin:end] for name in re.findall(r"\$\w+", line)}
    assert system == {"$VEL_AXIS", "$ACC_AXIS"}
