"""The command `sphmctl`: its commands, and how an error becomes a sentence and an exit code.

Heavy imports (numpy, pydantic, the devices) stand inside the commands, so that --help and shell
completion cost little more than typer.
"""

from __future__ import annotations

import json
import os
import sys

import typer
import typer.exceptions

from sphmctl.cli import (
    commissioning,
    exporting,
    firmware,
    kinematics,
    krl,
    plans,
    runs,
    service,
    workspace,
)
from sphmctl.cli.common import say
from sphmctl.errors import SphmctlError

USAGE_EXIT = 2
FILE_EXIT = 3
BROKEN_PIPE_EXIT = 141
"""128 + SIGPIPE, as the shell reports it."""

app = typer.Typer(
    name="sphmctl",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help=(
        "Plays one path on a KUKA KR6 R900 and the 3-RRS parallel wrist on its flange, in step.\n\n"
        "Begin with [bold]sphmctl run configs/paths/octagon.yaml --dry-run[/bold]: both devices "
        "are emulated, nothing moves. Software stops are not a safety function: the emergency "
        "stop, the gates and the enabling switch of the cell are."
    ),
)

app.command("fk")(kinematics.fk)
app.command("ik")(kinematics.ik)
app.command("check")(plans.check)
app.command("plan")(plans.plan)
app.command("run")(runs.run)
app.command("emulate")(service.emulate)
app.command("doctor")(service.doctor)
app.command("status")(service.status)
app.command("workspace")(workspace.workspace)
app.command("commission")(commissioning.commission)
app.add_typer(firmware.app)
app.add_typer(krl.app)
app.add_typer(exporting.app)


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command; returns the exit code, having said on the way what was wrong."""
    as_json = "--json" in arguments
    try:
        result = app(arguments, prog_name="sphmctl", standalone_mode=False)
    except SphmctlError as error:
        _fail(as_json, error.exit_code, error.message, error.where)
        return error.exit_code
    except typer.exceptions.TyperException as error:
        # Without any arguments typer prints its help, and has nothing to say.
        _fail(as_json, USAGE_EXIT, error.format_message() or "give a command", "command line")
        return USAGE_EXIT
    except typer.exceptions.Abort:
        _fail(as_json, 130, "interrupted", "")
        return 130
    except BrokenPipeError:
        # Nobody reads any more; Python must not try to flush once again on its way out.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE_EXIT
    except OSError as error:
        _fail(as_json, FILE_EXIT, error.strerror or str(error), str(error.filename or "output"))
        return FILE_EXIT
    return result if isinstance(result, int) else 0


def _fail(as_json: bool, exit_code: int, message: str, where: str) -> None:
    if as_json:
        error = {"exit_code": exit_code, "message": message, "where": where}
        print(json.dumps({"error": error}), flush=True)
    say(f"sphmctl: {where}: {message}" if where else f"sphmctl: {message}")
