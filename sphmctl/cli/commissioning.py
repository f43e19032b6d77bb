"""The command `commission`: servos from the factory's state to what the cell needs."""

from __future__ import annotations

import asyncio
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put, say
from sphmctl.errors import InvalidError, UsageError

if TYPE_CHECKING:
    from sphmctl.config import Cell
    from sphmctl.daemon.commission import Outcome
    from sphmctl.drivers.link import Link

OPEN_TIMEOUT_S = 5.0
"""To open the port: a USB adapter takes milliseconds."""


def commission(
    port: Annotated[str, typer.Option(metavar="PORT", help="The servos' serial port.")],
    servo_id: Annotated[
        int | None,
        typer.Option("--id", metavar="ID", help="The id for the one servo on the bus."),
    ] = None,
    baud: Annotated[
        int | None, typer.Option(metavar="BAUD", help="Look at this rate only, not at all eight.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before changes.")] = False,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Set up servos for the wrist: find them at any baud rate and id, then set what the cell needs.

    Explains each change and asks before it makes any; then reads all back. Sets
    id, baud rate, return delay, drive mode, operating mode and limits. Moves
    nothing; torque goes off.

    New servos all have id 1: connect the first one alone, then add one after the
    other, on a USB adapter. A servo whose id is one of the cell's keeps it, the
    others get the lowest one free.

    Example: sphmctl commission --port /dev/ttyUSB0
    """
    from sphmctl import clock
    from sphmctl.board.port import look_at
    from sphmctl.daemon.commission import Job
    from sphmctl.daemon.commission import commission as set_up
    from sphmctl.daemon.servo_scan import BAUD_CODES
    from sphmctl.drivers.link import open_serial

    chosen = cell_of(cell)
    if baud is not None and baud not in BAUD_CODES:
        rates = ", ".join(map(str, sorted(BAUD_CODES)))
        raise InvalidError(f"{baud} is no rate of an XL430; give one of {rates}", "--baud")

    async def open_at(rate: int) -> Link:
        return await open_serial(port, rate, OPEN_TIMEOUT_S)

    look_at(port, "USB adapter")
    say(_cell_line(chosen))
    bauds = BAUD_CODES if baud is None else (baud,)
    job = Job(open_at, f"servos on {port}", chosen, servo_id, tuple(bauds))
    outcome = clock.run(set_up(job, say, _agree if yes else _ask))
    put(as_json, {"port": port} | _document(outcome), _show)
    return 0


def _cell_line(cell: Cell) -> str:
    """Which cell decides on ids, rate and limits."""
    from sphmctl.config import emulated_cell

    ids = ", ".join(map(str, cell.wrist.ids))
    wanted = f"servos with the ids {ids} at {cell.wrist.baud} baud"
    if cell == emulated_cell():
        return f"no cell file: {wanted}; for cranks that are mounted otherwise give --cell FILE"
    return f"cell {cell.name}: {wanted}"


async def _agree(question: str) -> bool:
    return True


async def _ask(question: str) -> bool:
    """Ask at the terminal, in a way that lets Ctrl-C through."""
    import termios

    if not sys.stdin.isatty():
        raise UsageError(
            "without a terminal nobody can be asked, and nothing was changed; to agree to all "
            "changes add --yes",
            "commission",
        )
    # What was typed before the question is no answer to it.
    termios.tcflush(sys.stdin, termios.TCIFLUSH)
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    loop = asyncio.get_running_loop()
    answered = asyncio.Event()
    loop.add_reader(sys.stdin.fileno(), answered.set)
    try:
        await answered.wait()
    finally:
        loop.remove_reader(sys.stdin.fileno())
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _document(outcome: Outcome) -> dict[str, Any]:
    return {
        "servos": [
            {
                "id": task.new_id,
                "leg": task.leg + 1,
                "found": asdict(task.found),
                "changes": [asdict(change) for change in task.changes],
            }
            for task in outcome.tasks
        ],
        "missing_ids": list(outcome.missing),
        "skipped_baud": list(outcome.skipped),
    }


def _show(document: dict[str, Any]) -> None:
    for servo in document["servos"]:
        count = len(servo["changes"])
        state = f"{count} items changed and read back" if count else "was ready"
        print(f"servo {servo['id']} (leg {servo['leg']}): {state}")
    if document["missing_ids"]:
        missing = ", ".join(map(str, document["missing_ids"]))
        print(f"still missing: {missing}; connect the next servo too and run this again")
    else:
        print("all servos of the cell are set up; next: sphmctl doctor")
