"""The commands `krl check`, a linter for KRL programs, and `krl export`, the robot's own files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put
from sphmctl.errors import InvalidError

EXIT_INVALID = 3

app = typer.Typer(
    name="krl",
    no_args_is_help=True,
    help="The robot's program: write its files for a cell, check KRL files without a controller.",
)


@app.callback()
def krl() -> None:
    """The robot's program: write its files for a cell, check KRL files without a controller."""


@app.command("check")
def check(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILES", help="KRL files (.src, .dat, .sub), or folders of them."),
    ],
    as_json: JsonOption = False,
) -> int:
    """Check KRL files: language, names and types, and the traps that a controller does not tell.

    The data list beside a program is checked with it, and the other files of the folder are read
    for their global names. Ends with 3 when something is an error; warnings alone end with 0.

    Example: sphmctl krl check firmware/krc
    """
    from sphmctl.emulators.krl.project import NoKrlError, check_files

    try:
        checked = check_files(files)
    except NoKrlError as error:
        raise InvalidError(str(error), str(error.path)) from error
    document = {
        "files": [str(path) for path in checked.files],
        "problems": [
            {
                "file": finding.file,
                "line": finding.line,
                "severity": finding.severity,
                "code": finding.code,
                "message": finding.message,
            }
            for finding in checked.findings
        ],
    }
    put(as_json, document, _show)
    return EXIT_INVALID if checked.errors else 0


@app.command("export")
def export(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where the files are written; made when missing.")
    ],
    force: Annotated[
        bool, typer.Option("--force", help="Write over files that are there and different.")
    ] = False,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Write the robot program's files for a cell, to be copied onto its controller.

    The numbers of the lines to the board come from the cell file, arm.lines. A cell without a
    board gets the lines off.

    Example: sphmctl krl export stick --cell lab.yaml
    """
    from sphmctl.daemon.examine_arm import LINES_OFF, lines_of
    from sphmctl.drivers import krc_interface as krc
    from sphmctl.drivers.krc_program import program_texts

    chosen = cell_of(cell)
    lines = lines_of(chosen)
    if chosen.wrist.board_id is not None and lines is None:
        raise InvalidError(
            "the cell has a board, so give the numbers of its lines, for example "
            "lines: {wrist_ok: 17, knot: 17, arm_moving: 18}",
            "arm.lines",
        )
    if chosen.wrist.board_id is None and chosen.arm.lines is not None:
        raise InvalidError(
            "there are lines to a board but no board: give wrist.board_id, or leave arm.lines out",
            "arm.lines",
        )
    texts = program_texts(lines)
    _write(folder, texts, force)
    document = {
        "files": [str(folder / name) for name in texts],
        "version": krc.VERSION,
        "checksum": krc.CHECK,
        "lines": None if lines is None else dataclasses.asdict(lines),
    }
    put(as_json, document, lambda document: _show_export(document, LINES_OFF))
    return 0


def _write(folder: Path, texts: dict[str, str], force: bool) -> None:
    """All files or none; the line ends are those of the controller's Windows."""
    try:
        for name, text in texts.items():
            there = folder / name
            if force or not there.exists():
                continue
            if there.read_text(encoding="ascii", errors="replace") != text:
                raise InvalidError("is there and different; add --force to replace it", str(there))
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="ascii", newline="\r\n")
    except OSError as error:
        raise InvalidError(f"cannot be written: {error.strerror}", str(folder)) from error


def _show_export(document: dict[str, Any], lines_off: str) -> None:
    for name in document["files"]:
        print(name)
    lines = document["lines"]
    if lines is None:
        print(f"lines to the board: {lines_off}")
    else:
        numbers = (lines["wrist_ok"], lines["knot"], lines["arm_moving"])
        print(
            "lines to the board: wrist ok $IN[{}], knot $OUT[{}], arm moving $OUT[{}]".format(
                *numbers
            )
        )
    print(f"version {document['version']}, checksum {document['checksum']}")
    print('next: firmware/krc/README.md, "Copy the files"; then sphmctl doctor')


def _show(document: dict[str, Any]) -> None:
    for problem in document["problems"]:
        where = f"{problem['file']}:{problem['line']}"
        print(f"{where}: {problem['severity']}: {problem['message']} [{problem['code']}]")
    errors = sum(problem["severity"] == "error" for problem in document["problems"])
    warnings = len(document["problems"]) - errors
    print(f"{len(document['files'])} files: {errors} errors, {warnings} warnings")
