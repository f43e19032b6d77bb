"""The command `run`: a path on the cell, real or emulated."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sphmctl.cli.common import CellOption, JsonOption, cell_of, put, say
from sphmctl.errors import InvalidError, SphmctlError, UsageError

if TYPE_CHECKING:
    import asyncio

    from sphmctl.cli.emulation import BoardKind
    from sphmctl.daemon.run import Job

EXIT_DEVICE = 5
EXIT_FAULT = 6
EXIT_SIGNAL = {signal.SIGHUP: 129, signal.SIGINT: 130, signal.SIGTERM: 143}
"""128 and the signal's number: Ctrl-C, a request to end, and a terminal that went away."""

PROGRESS_STEP_S = 0.1
"""How often the progress bar is drawn, s of the plan."""


def run(
    path: Annotated[Path, typer.Argument(help="The path file.", metavar="PATH")],
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Emulate both devices of the cell, paced in real time."),
    ] = False,
    virtual: Annotated[
        bool,
        typer.Option("--virtual", help="Emulated devices only: as fast as it computes, in memory."),
    ] = False,
    runs_dir: Annotated[
        Path, typer.Option("--runs-dir", metavar="DIR", help="Where the run's folder is made.")
    ] = Path("runs"),
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT",
            help="Scale the plan in time, same path. Else the cell's speed_percent; real cells 10.",
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask before motion on a real cell.")
    ] = False,
    board: Annotated[
        str,
        typer.Option(help="Behind an emulated wrist: none, or simulated (runs the real firmware)."),
    ] = "none",
    seed: Annotated[int, typer.Option(help="What the emulated devices draw from.")] = 0,
    cell: CellOption = None,
    as_json: JsonOption = False,
) -> int:
    """Drive a path with all nine joints, and leave a record of it.

    The plan is made and checked before anything moves. Then both devices are connected and
    verified, the robot drives slowly to the start if it is not there, and the wrist follows the
    arm along the path. Ctrl-C stops both in order.

    Example: sphmctl run configs/paths/octagon.yaml --dry-run
    """
    from sphmctl import clock
    from sphmctl.cli.emulation import announce, board_kind, with_board
    from sphmctl.daemon.run import Job
    from sphmctl.pathfile import inputs, load_path
    from sphmctl.planner.process import plan_apart

    chosen = cell_of(cell)
    chosen = with_board(chosen.for_dry_run() if dry_run else chosen, board_kind(board))
    emulated = len(chosen.emulated_devices) == 2
    announce(chosen)
    if virtual:
        if not emulated:
            raise UsageError("--virtual is for emulated devices only; add --dry-run", "--virtual")
        say("VIRTUAL: on a clock that jumps, in memory")
    if not emulated and not yes and not (sys.stdin and sys.stdin.isatty()):
        raise UsageError("this cell is real and nobody can be asked: add --yes", "consent")
    percent = chosen.plan_speed_percent if speed is None else speed
    if not 0.0 < percent <= 100.0:
        raise InvalidError(f"{percent:g} percent; give more than 0, at most 100", "--speed")
    wanted = load_path(path)
    kept = inputs(wanted)
    plan = plan_apart(wanted, chosen, percent / 100.0)
    now = datetime.now().astimezone()
    job = Job(plan, chosen, percent / 100.0, kept, runs_dir, now, "virtual" if virtual else "real")
    running = _run(job, board_kind(board), seed, virtual, emulated or yes)
    summary, code = clock.run(running, virtual=virtual)
    put(as_json, summary, _show)
    return code


async def _run(
    job: Job, board: BoardKind, seed: int, virtual: bool, agreed: bool
) -> tuple[dict[str, Any], int]:
    import asyncio

    from sphmctl.cli.emulation import open_devices
    from sphmctl.daemon.run import run_job

    stop = asyncio.Event()
    received: list[int] = []
    with _signals(stop, received), _progress(job.plan.duration_s) as on_progress:
        devices = await open_devices(job.cell, board=board, seed=seed, virtual=virtual)
        try:
            summary = await run_job(
                job,
                devices.arm,
                devices.wrist,
                _agree if agreed else lambda question: _ask(question, stop),
                stop,
                on_progress,
                _echo,
                devices.truth,
            )
        except SphmctlError as error:
            if devices.losses:
                # What the drivers saw is only its consequence.
                raise devices.losses[0] from error
            # Before any motion; a Ctrl-C while connecting or at the question leaves as a Ctrl-C.
            if received:
                error.exit_code = EXIT_SIGNAL[signal.Signals(received[0])]
            raise
        finally:
            await devices.close()
    if devices.losses:
        say(f"sphmctl: {devices.losses[0]}; the record is in {summary['run_dir']}")
        return summary, EXIT_DEVICE
    code = 0 if summary["outcome"] == "completed" else EXIT_FAULT
    if summary["outcome"] == "stopped" and received:
        code = EXIT_SIGNAL[signal.Signals(received[0])]
    return summary, code


@contextmanager
def _signals(stop: asyncio.Event, received: list[int]) -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into a request for a controlled stop."""
    import asyncio

    loop = asyncio.get_running_loop()

    def stop_now() -> None:
        stop.set()
        say("\nstopping both devices; the emergency stop is on the pendant")

    def request(number: int, frame: object) -> None:
        received.append(number)
        if len(received) == 1:
            loop.call_soon_threadsafe(stop_now)

    before = {number: signal.signal(number, request) for number in EXIT_SIGNAL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _progress(duration_s: float) -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda tau_s: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s"),
        TimeRemainingColumn(),
    )
    shown_s = -PROGRESS_STEP_S
    bar = Progress(*columns, console=Console(stderr=True), auto_refresh=False)
    task = bar.add_task("on the path", total=duration_s)

    def show(tau_s: float) -> None:
        nonlocal shown_s
        if shown_s < 0.0:
            # Not before: a live bar takes the terminal, which a question may still need.
            bar.start()
        if tau_s - shown_s >= PROGRESS_STEP_S or tau_s >= duration_s > shown_s:
            shown_s = tau_s
            bar.update(task, completed=tau_s)
            bar.refresh()

    try:
        yield show
    finally:
        bar.stop()


async def _agree(question: str) -> bool:
    """Nothing to ask: emulated devices, or --yes."""
    return True


async def _ask(question: str, stop: asyncio.Event) -> bool:
    """Ask at the terminal; the loop goes on meanwhile, and Ctrl-C is a no."""
    import asyncio
    import termios

    loop = asyncio.get_running_loop()
    # What was typed before the question is no answer to it.
    termios.tcflush(sys.stdin, termios.TCIFLUSH)
    answered = asyncio.Event()
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    loop.add_reader(sys.stdin.fileno(), answered.set)
    waits = [asyncio.ensure_future(event.wait()) for event in (answered, stop)]
    try:
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    finally:
        loop.remove_reader(sys.stdin.fileno())
        for wait in waits:
            wait.cancel()
    return not stop.is_set() and sys.stdin.readline().strip().lower() in ("y", "yes")


def _echo(name: str, fields: dict[str, Any]) -> None:
    """Say what a user wants to know while it happens."""
    if name in ("fault", "wrist lost", "standstill not seen", "disarm", "to go on"):
        say(f"{name}: {fields.get('message', '')}")
    elif name == "lines off":
        say(fields["message"])
    elif name == "approach":
        say(f"approaching the start, {fields['seconds']:.1f} s")
    elif name == "standing":
        say("both devices stand")


def _show(summary: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(title=f"{summary['outcome']}{_because(summary)}", title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right")
    tracking, skew = summary["tracking"], summary["skew_ms"]
    rows = (
        ("duration", summary["duration_s"], "s", 2),
        ("planned", summary["planned_s"], "s", 2),
        ("farthest joint from the plan", tracking["max_joint_deg"], "deg", 3),
        ("farthest tool point from the plan", tracking["max_tcp_mm"], "mm", 3),
        ("skew, median", skew["p50"], "ms", 2),
        ("skew, 99 %", skew["p99"], "ms", 2),
        ("skew, largest", skew["max"], "ms", 2),
        ("instants that count for skew", _percent(skew["share_counted"]), "%", 1),
        ("largest crank error", summary["max_crank_error_deg"], "deg", 3),
    )
    for name, value, unit, digits in rows:
        table.add_row(name, "-" if value is None else f"{value:.{digits}f} {unit}")
    console.print(table)
    for note in summary["unconfirmed"]:
        console.print(f"NOT CONFIRMED: {note}", style="bold red", markup=False)
    print(f"report: {Path(summary['run_dir']) / 'report.html'}")


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _because(summary: dict[str, Any]) -> str:
    return f": {summary['cause']}" if summary["cause"] else ""
