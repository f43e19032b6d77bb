"""What the benchmarks share: emulators in other processes, and rows of the table. Times nothing."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SPHMCTL = str(Path(sys.executable).with_name("sphmctl"))

READY_LIMIT_S = 60.0
"""To start a child: a second is usual, a busy machine may need several."""

STOP_LIMIT_S = 10.0
"""To end a child after SIGTERM."""

COLUMNS = ("figure", "ours", "reference", "ratio", "aim", "command")


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        figure: what was measured.
        ours, reference: values with their unit; the reference says what it is.
        ratio: ours by the reference; None where they are not compared.
        aim: the largest ratio wanted; None without an aim.
        command: what to type to see it again.
    """

    figure: str
    ours: str
    reference: str
    ratio: float | None
    aim: float | None
    command: str

    def cells(self) -> tuple[str, ...]:
        """The line's cells as text, in the order of COLUMNS."""
        ratio = "" if self.ratio is None else f"{self.ratio:.2f}"
        aim = "" if self.aim is None else f"at most {self.aim:g}"
        if self.ratio is not None and self.aim is not None and self.ratio > self.aim:
            aim += ", missed"
        return self.figure, self.ours, self.reference, ratio, aim, f"`{self.command}`"


def markdown(rows: Iterable[Row]) -> str:
    """The table, aligned, as README shows it."""
    lines = [COLUMNS, *(row.cells() for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(COLUMNS))]
    text = [
        "| "
        + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        + " |"
        for line in lines
    ]
    text.insert(1, "| " + " | ".join("-" * width for width in widths) + " |")
    return "\n".join(text)


@contextmanager
def served(command: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Run a server in another process; yields the JSON line it prints when ready.

    Raises:
        RuntimeError: it ended, or was not ready in time.
    """
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert child.stdout is not None
    late = threading.Timer(READY_LIMIT_S, child.kill)
    late.start()
    try:
        line = child.stdout.readline()
        late.cancel()
        if not line:
            raise RuntimeError(f"{' '.join(command)}: ended before it was ready")
        ready: dict[str, Any] = json.loads(line)
        yield ready
    finally:
        late.cancel()
        child.terminate()
        try:
            child.wait(STOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait(STOP_LIMIT_S)
        child.stdout.close()


def percentile(values: Sequence[float], percent: float) -> float:
    """The value below which `percent` of `values` lie."""
    ordered = sorted(values)
    return ordered[min(int(percent / 100.0 * len(ordered)), len(ordered) - 1)]
