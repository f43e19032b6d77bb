"""What every command shares: the cell it works on, its options, its output, its way to fail."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import signal
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from sphmctl.errors import DeviceError, InvalidError

if TYPE_CHECKING:
    import asyncio

    from sphmctl.config import Cell

CELL_VARIABLE = "SPHMCTL_CELL"
DEFAULT_CELL = Path("cell.yaml")

_parts = itertools.count()
"""Numbers the files being written, so that one command may write several beside each other."""

JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else.")
]
CellOption = Annotated[
    Path | None,
    typer.Option(
        "--cell",
        metavar="FILE",
        help="The cell file. Else $SPHMCTL_CELL, else ./cell.yaml, else the packaged emulation.",
    ),
]


def cell_of(option: Path | None) -> Cell:
    """The cell that the options, the environment and the folder name.

    Raises:
        InvalidError: the file is missing, unreadable or wrong.
    """
    from sphmctl.config import emulated_cell, load_cell

    named = os.environ.get(CELL_VARIABLE)
    if option is not None:
        return load_cell(option)
    if named:
        return load_cell(Path(named))
    if DEFAULT_CELL.exists():
        return load_cell(DEFAULT_CELL)
    return emulated_cell()


def say(text: str) -> None:
    """A line for people, on stderr: stdout is for results.

    Nobody reading it must not keep a stop from happening.
    """
    with contextlib.suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)


def put(as_json: bool, document: dict[str, Any], show: Callable[[dict[str, Any]], None]) -> None:
    """Print a result: as one JSON document, or by `show`."""
    if as_json:
        print(json.dumps(finite(document)), flush=True)
    else:
        show(document)


def finite(value: Any) -> Any:
    """`value` with NaN and infinities as null, which JSON can hold."""
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value


def until_told() -> tuple[asyncio.Future[None], Callable[[DeviceError], None]]:
    """What a command that serves waits for: Ctrl-C, SIGTERM, or the loss of what it serves.

    Returns:
        The end to await, and what to call with a loss, which it then raises.
    """
    import asyncio

    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()

    def end() -> None:
        if not done.done():
            done.set_result(None)

    def lose(error: DeviceError) -> None:
        if not done.done():
            done.set_exception(error)

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end)
    return done, lose


def numbers(text: str, count: int, option: str) -> list[float]:
    """Comma-separated numbers of an option.

    Raises:
        InvalidError: not `count` finite numbers.
    """
    words = text.split(",")
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InvalidError(
            f"{text!r} is not a list of numbers; give {count}, separated by commas", option
        ) from error
    if len(values) != count or not all(abs(value) < float("inf") for value in values):
        raise InvalidError(
            f"{text!r} has {len(values)} numbers; give {count} finite ones, separated by commas",
            option,
        )
    return values


@contextmanager
def whole_file(path: Path) -> Iterator[TextIO]:
    """A text file that appears at `path` when the block ends, and not at all when it fails.

    It is made at the start, beside `path`, so that a folder that is missing is told before the
    work. A device or a pipe is written as it is.

    Raises:
        InvalidError: it cannot be written.
    """
    if path.is_dir():
        raise InvalidError("this is a folder; name a file", str(path))
    special = path.exists() and not path.is_file()
    final = path if special else Path(os.path.realpath(path))
    # The name's checksum keeps apart what is written at once, and short what may be long.
    mark = f"{os.getpid()}.{zlib.crc32(os.fsencode(final.name)):08x}"
    part = final if special else final.with_name(f".{mark}.part")
    try:
        with part.open("w", encoding="utf-8", newline="") as stream:
            yield stream
        if not special:
            part.replace(final)
    except BaseException as problem:
        if not special:
            part.unlink(missing_ok=True)
        if not isinstance(problem, OSError) or isinstance(problem, BrokenPipeError):
            raise
        reason = problem.strerror or str(problem)
        hint = "; make the folder first" if not final.parent.is_dir() else ""
        raise InvalidError(f"the file cannot be written: {reason}{hint}", str(path)) from problem
