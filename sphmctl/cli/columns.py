"""CSV files of joints and poses: columns read with their places, others carried through as text."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import nan
from pathlib import Path
from typing import NoReturn, TextIO

import numpy as np

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats

JOINT_COLUMNS = (
    *(f"a{axis}_deg" for axis in range(1, 7)),
    *(f"theta{leg}_deg" for leg in range(7, 10)),
)
POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")

MOST_ROWS = 1_000_000
"""An hour of plan at 4 ms a row; more would not fit into a Raspberry Pi's memory."""

DECIMALS = 9
"""Of the numbers written: 1e-9 degrees of every joint move the tool by less than 1e-7 mm."""

UNITS = {"deg": "degrees", "mm": "millimetres"}


@dataclass(frozen=True)
class Columns:
    """A CSV file's content.

    Attributes:
        file: the name to show.
        header: the columns' names.
        rows: the fields as text, one for each column.
        lines: where each row begins in the file, from 1.
    """

    file: str
    header: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]

    def where(self, row: int, name: str = "") -> str:
        """`joints.csv, line 12, column a1_deg`."""
        column = f", column {name}" if name else ""
        return f"{self.file}, line {self.lines[row]}{column}"

    def numbers(self, names: Sequence[str]) -> Floats:
        """Columns as numbers, (n, len(names)); NaN for a row in which all of them are empty.

        Raises:
            InvalidError: a column is missing, or a field is not a finite number.
        """
        at = [self._index(name, names) for name in names]
        try:
            flat = [float(fields[index]) for fields in self.rows for index in at]
        except ValueError:
            flat = self._with_gaps(names, at)
        out = np.array(flat).reshape(-1, len(names))
        whole = np.isfinite(out).all(axis=1)
        for row in np.flatnonzero(~whole).tolist():
            texts = [self.rows[row][index] for index in at]
            if any(text.strip() for text in texts):
                self._refuse(row, names, texts)
        return out

    def _with_gaps(self, names: Sequence[str], at: Sequence[int]) -> list[float]:
        """The numbers of a file with empty rows, NaN there; other texts are refused."""
        flat: list[float] = []
        for row, fields in enumerate(self.rows):
            texts = [fields[index] for index in at]
            if not any(text.strip() for text in texts):
                flat += [nan] * len(at)
                continue
            try:
                flat += [float(text) for text in texts]
            except ValueError:
                self._refuse(row, names, texts)
        return flat

    def write(self, stream: TextIO, names: Sequence[str], values: Floats) -> None:
        """The rows with columns (n, len(names)) added, or replaced where there are such already.

        Rows of NaN become empty fields.
        """
        header = [*self.header, *(name for name in names if name not in self.header)]
        at = [header.index(name) for name in names]
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        rounded = np.round(values, DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0
        text, gap = ",".join(["%.12g"] * len(names)), "," * (len(names) - 1)
        added = at == list(range(len(self.header), len(header)))
        lost = np.isnan(rounded[:, 0])
        room = [""] * (len(header) - len(self.header))
        for fields, numbers, empty in zip(self.rows, rounded.tolist(), lost.tolist(), strict=True):
            tail = gap if empty else text % tuple(numbers)
            out = [*fields, tail] if added else _placed([*fields, *room], at, tail.split(","))
            line = ",".join(out)
            if _is_plain(line, len(header)):
                stream.write(line + "\n")  # a third of the time that csv takes
            else:
                writer.writerow([*fields, *tail.split(",")] if added else out)

    def _index(self, name: str, names: Sequence[str]) -> int:
        if name not in self.header:
            raise InvalidError(
                f"the column {name} is missing; needed are {', '.join(names)}, separated by commas",
                f"{self.file}, line 1",
            )
        return self.header.index(name)

    def _refuse(self, row: int, names: Sequence[str], texts: Sequence[str]) -> NoReturn:
        """Point at the first field of a row that is not a finite number."""
        for name, text in zip(names, texts, strict=True):
            try:
                good = abs(float(text)) < float("inf")
            except ValueError:
                good = False
            if not good:
                unit = UNITS[name.rsplit("_", 1)[1]]
                raise InvalidError(
                    f"{text[:60]!r} is not a finite number; give {unit}", self.where(row, name)
                )
        raise AssertionError("the row was refused, so one of its fields is wrong")


def read_columns(path: Path) -> Columns:
    """Read a CSV file whose first line names the columns; empty lines do not count.

    Raises:
        InvalidError: the file cannot be read, or is not a table.
    """
    file, line = str(path), 0
    rows: list[list[str]] = []
    lines: list[int] = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            for fields, begin, end in _records(stream):
                line = end
                if not fields:
                    continue
                if rows and len(fields) != len(rows[0]):
                    raise InvalidError(
                        f"{len(fields)} fields, but line {lines[0]} names {len(rows[0])} columns",
                        f"{file}, line {begin}",
                    )
                if len(rows) > MOST_ROWS:
                    raise InvalidError(f"more than {MOST_ROWS} rows; split the file", file)
                rows.append(fields)
                lines.append(begin)
    except FileNotFoundError:
        raise InvalidError("there is no such file", file) from None
    except UnicodeDecodeError:
        raise InvalidError("the text is not UTF-8; save it as UTF-8", file) from None
    except csv.Error as problem:
        raise InvalidError(f"not valid CSV: {problem}", f"{file}, line {line + 1}") from None
    except OSError as problem:
        reason = problem.strerror or str(problem)
        raise InvalidError(f"the file cannot be read: {reason}", file) from None
    if not rows:
        raise InvalidError("the file is empty; its first line should name the columns", file)
    header = tuple(name.strip() for name in rows[0])
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise InvalidError(f"the column {twice!r} is there twice", f"{file}, line {lines[0]}")
    return Columns(file, header, rows[1:], lines[1:])


def _records(stream: TextIO) -> Iterator[tuple[list[str], int, int]]:
    """The fields of each record, and the first and the last line it stands on.

    Lines are split at their commas, which takes a fifth of the time of `csv`, up to the first
    quotation mark: the rest is for `csv`.
    """
    for number, line in enumerate(stream, start=1):
        if '"' in line:
            reader, last = csv.reader(chain([line], stream), strict=True), number - 1
            for fields in reader:
                begin, last = last + 1, number - 1 + reader.line_num
                yield fields, begin, last
            return
        bare = line.rstrip("\r\n")
        yield bare.split(",") if bare else [], number, number


def _placed(fields: list[str], at: Sequence[int], texts: Sequence[str]) -> list[str]:
    """The fields with those at some places replaced."""
    for index, text in zip(at, texts, strict=True):
        fields[index] = text
    return fields


def _is_plain(line: str, count: int) -> bool:
    """Whether fields joined by commas are what `csv` would write."""
    special = '"' in line or "\n" in line or "\r" in line
    return bool(line) and not special and line.count(",") == count - 1
