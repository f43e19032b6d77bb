"""The command `krl check`: a linter for KRL programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from sphmctl.cli.common import JsonOption, put
from sphmctl.errors import InvalidError

EXIT_INVALID = 3

app = typer.Typer(
    name="krl",
    no_args_is_help=True,
    help="The robot's program: check KRL files without a controller.",
)


@app.callback()
def krl() -> None:
    """The robot's program: check KRL files without a controller."""


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


def _show(document: dict[str, Any]) -> None:
    for problem in document["problems"]:
        where = f"{problem['file']}:{problem['line']}"
        print(f"{where}: {problem['severity']}: {problem['message']} [{problem['code']}]")
    errors = sum(problem["severity"] == "error" for problem in document["problems"])
    warnings = len(document["problems"]) - errors
    print(f"{len(document['files'])} files: {errors} errors, {warnings} warnings")
