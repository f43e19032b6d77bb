"""`krl export`: the robot program's files with a cell's own line numbers, or with the lines off."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from sphmctl.drivers import krc_interface as krc
from sphmctl.emulators.krc_files import Numbers, controller_files
from sphmctl.emulators.krl.parse import parse
from sphmctl.emulators.krl.printer import to_text
from tests.cli.rig import REPOSITORY, Sphmctl

SHIPPED = REPOSITORY / "firmware" / "krc"
NAMES = ("sph_run.src", "sph_run.dat", "sph_sps.src")
LINES = {"wrist_ok": 17, "knot": 19, "arm_moving": 20}


def cell(folder: Path, lines: dict[str, int] | None, board_id: int | None = 200) -> Path:
    content = yaml.safe_load((REPOSITORY / "configs" / "cells" / "lab.yaml").read_text())
    content["wrist"]["board_id"] = board_id
    content["arm"].pop("lines", None)
    if lines is not None:
        content["arm"]["lines"] = lines
    path = folder / "cell.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def changed_lines(folder: Path) -> set[str]:
    """Lines of the exported files that are not in the shipped ones."""
    changed: set[str] = set()
    for name in NAMES:
        shipped = set((SHIPPED / name).read_text().splitlines())
        changed |= set((folder / name).read_text().splitlines()) - shipped
    return changed


def test_without_a_board_the_files_are_the_shipped_ones_and_it_says_that_the_lines_are_off(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    told = sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, None, None))
    assert told.code == 0
    assert "lines to the board: off: a wrist that fails stops the arm through this" in told.out
    assert changed_lines(tmp_path / "stick") == set()
    assert b"\r\n" in (tmp_path / "stick" / "sph_run.src").read_bytes()


def test_the_cells_line_numbers_are_filled_in_and_nothing_else_changes(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    told = sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, LINES), "--json")
    assert (told.code, told.document["lines"], told.document["checksum"]) == (0, LINES, krc.CHECK)
    assert changed_lines(tmp_path / "stick") == {
        "DECL GLOBAL INT SPH_IN_OK=17",
        "GLOBAL SIGNAL SPH_OK $IN[17]",
        "DECL GLOBAL INT SPH_OUT_KNOT=19",
        "DECL GLOBAL INT SPH_OUT_MOVING=20",
    }
    assert sphmctl("krl", "check", "stick").code == 0


def test_the_emulated_controller_with_lines_runs_what_is_exported(
    sphmctl: Sphmctl, tmp_path: Path
) -> None:
    sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, LINES))
    exported = {to_text(parse((tmp_path / "stick" / n).read_text(), n)) for n in NAMES}
    loaded = {to_text(module) for module in controller_files("SPH_RUN", lines=Numbers(17, 19, 20))}
    assert exported < loaded


def test_other_files_are_not_written_over_unless_told(sphmctl: Sphmctl, tmp_path: Path) -> None:
    path = cell(tmp_path, LINES)
    assert sphmctl("krl", "export", "stick", "--cell", path).code == 0
    assert sphmctl("krl", "export", "stick", "--cell", path).code == 0
    own = tmp_path / "stick" / "sph_run.dat"
    own.write_bytes(b"\xffmine")
    told = sphmctl("krl", "export", "stick", "--cell", path)
    assert (told.code, own.read_bytes()) == (3, b"\xffmine")
    assert "sph_run.dat: is there and different; add --force" in told.err
    assert sphmctl("krl", "export", "stick", "--cell", path, "--force").code == 0
    assert own.read_bytes() != b"\xffmine"


def test_a_board_without_line_numbers_is_refused(sphmctl: Sphmctl, tmp_path: Path) -> None:
    told = sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, None))
    assert told.code == 3
    assert "arm.lines: the cell has a board, so give the numbers of its lines" in told.err
    assert not (tmp_path / "stick").exists()


def test_lines_without_a_board_are_refused(sphmctl: Sphmctl, tmp_path: Path) -> None:
    told = sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, LINES, None))
    assert told.code == 3
    assert "arm.lines: there are lines to a board but no board" in told.err


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        (LINES | {"wrist_ok": 1025}, "$IN[1025] never changes on a KRC4"),
        (LINES | {"knot": 1013}, "$OUT[1013] is the controller's own (993 to 1023)"),
        (LINES | {"knot": 20}, "$OUT[20] cannot be both 'knot' and 'arm_moving'"),
        (LINES | {"wrist_ok": 0}, "wrist_ok"),
        ({"wrist_ok": 17}, "knot"),
    ],
)
def test_impossible_line_numbers_are_refused(
    sphmctl: Sphmctl, tmp_path: Path, lines: dict[str, int], sentence: str
) -> None:
    told = sphmctl("krl", "export", "stick", "--cell", cell(tmp_path, lines))
    assert told.code == 3
    assert sentence in told.err


def test_a_folder_that_cannot_be_made_is_named(sphmctl: Sphmctl, tmp_path: Path) -> None:
    (tmp_path / "stick").write_text("a file")
    told = sphmctl("krl", "export", "stick")
    assert told.code == 3
    assert "stick: cannot be written" in told.err
