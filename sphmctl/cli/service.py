"""The commands around a run: `emulate`, `doctor`, `status`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put, say, until_told
from sphmctl.errors import DeviceError, InvalidError, UsageError

if TYPE_CHECKING:
    from sphmctl.cli.emulation import BoardKind
    from sphmctl.config import Cell
    from sphmctl.emulators.cell import EmulatedCell

EXIT_DEVICE = 5


def emulate(
    kvp_port: Annotated[
        int,
        typer.Option(min=0, max=65535, help="TCP port of the variable server; 0: any free one."),
    ] = 0,
    wrist_link: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A symbolic link to set up for the servos' serial port."),
    ] = None,
    flavour: Annotated[
        str,
        typer.Option(help="The server's flavour: kvp (KUKAVARPROXY) or c3 (C3 Bridge)."),
    ] = "kvp",
    latency: Annotated[
        str, typer.Option(help="Service times of the server: measured, or none.")
    ] = "measured",
    board: Annotated[
        str,
        typer.Option(help="In front of the servos: none, or simulated (runs the real firmware)."),
    ] = "none",
    seed: Annotated[int, typer.Option(help="What the emulated devices draw from.")] = 0,
    truth: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the true joints there, every 4 ms, as CSV."),
    ] = None,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Serve the emulated cell to any client: KUKAVARPROXY on TCP, three XL430 on a serial port.

    Prints one JSON line when ready, then serves until Ctrl-C or SIGTERM; a simulated board that
    dies ends it too, with exit code 5.

    Example: sphmctl emulate --kvp-port 7000 --wrist-link /tmp/wrist
    """
    from sphmctl import clock
    from sphmctl.cli.emulation import board_kind

    if flavour not in ("kvp", "c3"):
        raise UsageError(f"{flavour!r}: give kvp or c3", "--flavour")
    if latency not in ("measured", "none"):
        raise UsageError(f"{latency!r}: give measured or none", "--latency")
    say("EMULATED: no robot will move")
    kind = board_kind(board)
    clock.run(_emulate(cell_of(cell), kind, kvp_port, wrist_link, flavour, latency, seed, truth))
    return 0


async def _emulate(
    cell: Cell,
    board: BoardKind,
    kvp_port: int,
    wrist_link: Path | None,
    flavour: str,
    latency: str,
    seed: int,
    truth: Path | None,
) -> None:
    from sphmctl import clock
    from sphmctl.cli.emulation import setup_of, simulated_board
    from sphmctl.daemon.record import TRUTH_COLUMNS, RowFile
    from sphmctl.emulators.cell import EmulatedCell

    done, lose = until_told()
    try:
        rows = None if truth is None else RowFile(truth, TRUTH_COLUMNS)
    except OSError as error:
        raise InvalidError(f"{error.strerror}; name a new file", str(truth)) from error
    emulated = EmulatedCell(
        seed,
        setup_of(cell),
        latency="none" if latency == "none" else "measured",
        flavour="c3" if flavour == "c3" else "kvp",
        truth=None if rows is None else lambda t_s, joints: rows.row([t_s, *joints]),
        board=simulated_board("paced", wrist_link, lose) if board == "simulated" else None,
    )
    try:
        ready = await _serve(emulated, kvp_port, wrist_link)
        print(json.dumps(ready), flush=True)
        with clock.urgent():
            await done
    finally:
        await emulated.close()
        if rows is not None:
            rows.close()


async def _serve(emulated: EmulatedCell, kvp_port: int, wrist_link: Path | None) -> dict[str, Any]:
    try:
        port, device = await emulated.serve(kvp_port, wrist_link)
    except FileExistsError as error:
        raise InvalidError(str(error), "--wrist-link") from error
    except OSError as error:
        raise DeviceError(
            f"cannot be served: {error.strerror}; choose another port or link",
            f"127.0.0.1:{kvp_port}",
        ) from error
    return {
        "kvp_host": "127.0.0.1",
        "kvp_port": port,
        "wrist_port": device,
        "start_monotonic_s": emulated.world.start_s,
    }


def doctor(cell: CellOption = None, as_json: JsonOption = False) -> int:
    """Look at everything a run needs, and say what to do about what is wrong. Moves nothing.

    Exit code 5 when a check fails.

    Example: sphmctl doctor --cell configs/cells/lab.yaml
    """
    from sphmctl import clock
    from sphmctl.cli.emulation import announce

    chosen = cell_of(cell)
    announce(chosen)
    checks = clock.run(_doctor(chosen))
    put(as_json, {"checks": checks}, _show_checks)
    return 0 if all(check["ok"] for check in checks) else EXIT_DEVICE


async def _doctor(cell: Cell) -> list[dict[str, Any]]:
    from sphmctl.cli.emulation import open_devices
    from sphmctl.daemon.doctor import examine

    devices = await open_devices(cell)
    try:
        findings = await examine(cell, devices.arm, devices.wrist)
    finally:
        await devices.close()
    return [{"name": f.name, "ok": f.ok, "detail": f.detail, "remedy": f.remedy} for f in findings]


def _show_checks(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="doctor", title_justify="left")
    for column in ("", "check", "found", "what to do"):
        table.add_column(column, overflow="fold")
    for check in document["checks"]:
        mark = "[green]ok[/green]" if check["ok"] else "[bold red]no[/bold red]"
        table.add_row(mark, check["name"], check["detail"], check["remedy"])
    Console().print(table)


def status(cell: CellOption = None, as_json: JsonOption = False) -> int:
    """Tell the state of a cell at rest: mode, program, joints, servos. Moves nothing.

    Example: sphmctl status --json
    """
    from sphmctl import clock
    from sphmctl.cli.emulation import announce

    chosen = cell_of(cell)
    announce(chosen)
    put(as_json, clock.run(_status(chosen)), _show_status)
    return 0


async def _status(cell: Cell) -> dict[str, Any]:
    from sphmctl.cli.emulation import open_devices
    from sphmctl.daemon.doctor import state_of

    devices = await open_devices(cell)
    try:
        return await state_of(cell, devices.arm, devices.wrist)
    finally:
        await devices.close()


def _show_status(document: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    cause = f": {document['cause']}" if document["cause"] else ""
    table = Table(title=f"{document['state']}{cause}", title_justify="left")
    table.add_column("device")
    table.add_column("property")
    table.add_column("value", overflow="fold")
    for device in ("arm", "wrist"):
        for name, value in document[device].items():
            table.add_row(device, name, str(value))
    for name, value in (document["board"] or {}).items():
        table.add_row("board", name, str(value))
    Console().print(table)
