"""A run's folder: every row and every event is on disk when the call returns.

One unbuffered write each: what a killed process had recorded is not lost.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import geometry

JOINT_COLUMNS = (*(f"a{i}_deg" for i in range(1, 7)), "theta7_deg", "theta8_deg", "theta9_deg")
POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
FEEDBACK_COLUMNS = ("t_s", *JOINT_COLUMNS, *POSE_COLUMNS, "tau_s")
TRUTH_COLUMNS = ("t_s", *JOINT_COLUMNS)

FOLDER_ATTEMPTS = 100
"""Runs of one path in one second that still get a folder each."""


def new_folder(runs_dir: Path, name: str, now: datetime) -> Path:
    """Make the folder of a run, `<time>-<path name>`, never one that exists.

    Raises:
        InvalidError: it cannot be made there.
    """
    stem = f"{now:%Y%m%d-%H%M%S}-{re.sub(r'[^A-Za-z0-9_.-]+', '-', name) or 'path'}"
    for attempt in range(FOLDER_ATTEMPTS):
        folder = runs_dir / (stem if attempt == 0 else f"{stem}-{attempt + 1}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidError(
                f"the run's folder cannot be made: {error.strerror}; "
                "give a folder you may write to with --runs-dir",
                str(folder),
            ) from error
        return folder
    raise InvalidError("the run's folder exists already, with every number tried", str(runs_dir))


class RowFile:
    """A CSV file that is written a row at a time, each row in one unbuffered write."""

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        os.write(self._file, (",".join(columns) + "\n").encode())

    def row(self, values: list[float]) -> None:
        """Append one row; a value that is not known (NaN) stays empty."""
        cells = ["" if value != value else f"{value:.6f}" for value in values]
        os.write(self._file, (",".join(cells) + "\n").encode())

    def close(self) -> None:
        """Close the file; may be called again."""
        if self._file >= 0:
            os.close(self._file)
        self._file = -1


def feedback_row(t_s: float, joints: Floats, tool: Floats, tau_s: float) -> list[float]:
    """A row of feedback.csv.

    Args:
        t_s: time since the motion began.
        joints: measured, rad, shape (9,).
        tool: measured tool pose, m, shape (4, 4).
        tau_s: plan time the row was taken for.
    """
    abc = np.degrees(geometry.matrix_to_abc(tool[:3, :3]))
    return [t_s, *np.degrees(joints).tolist(), *(1000.0 * tool[:3, 3]).tolist(), *abc, tau_s]


class Events:
    """events.jsonl: one JSON object a line, each with its time on the run's clock.

    Args:
        path: the file; None: nowhere.
        clock: seconds, monotonic; `t_s` counts from the first event.
        echo: also told of each event, as (name, fields).
    """

    def __init__(
        self,
        path: Path | None,
        clock: Callable[[], float],
        echo: Callable[[str, dict[str, Any]], None] | None = None,
    ) -> None:
        self._clock = clock
        self._start_s = clock()
        self._echo = echo
        self.history: list[tuple[float, str, dict[str, Any]]] = []
        self._file = open(path, "ab", buffering=0) if path else None  # noqa: SIM115
        self._log = (
            structlog.wrap_logger(
                structlog.BytesLogger(self._file),
                processors=[structlog.processors.JSONRenderer(serializer=_json_bytes)],
            )
            if self._file
            else None
        )

    def add(self, name: str, **fields: Any) -> None:
        """Record that something happened."""
        t_s = self.on_clock(self._clock())
        self.history.append((t_s, name, fields))
        if self._log is not None:
            try:
                self._log.info(name, t_s=t_s, **fields)
            except OSError as error:
                # A full disk must not keep anybody from stopping a robot.
                self.close()
                self.add("events not recorded any more", message=error.strerror)
        if self._echo is not None:
            self._echo(name, fields)

    def on_clock(self, at_s: float) -> float:
        """An instant of the clock as `t_s` has it."""
        return round(at_s - self._start_s, 6)

    def told(self, name: str, **fields: Any) -> bool:
        """Whether just this was recorded before."""
        return any(entry[1:] == (name, fields) for entry in self.history)

    def close(self) -> None:
        """Close the file; may be called again."""
        if self._file is not None:
            self._file.close()
            self._log = self._file = None


def _json_bytes(value: Any, **_: Any) -> bytes:
    return json.dumps(value, default=str).encode()


def write_truth(path: Path, rows: list[tuple[float, ...]]) -> None:
    """Write truth.csv from rows of time (s) and nine true joints (deg)."""
    text = [",".join(TRUTH_COLUMNS)]
    text += [",".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\n".join(text) + "\n")
