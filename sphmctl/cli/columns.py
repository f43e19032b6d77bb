"""CSV files of joints and poses: columns read with their places, others carried through as text."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
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

TOGETHER = 1000
"""Rows written at one go: more are not faster, and their numbers would fill the memory."""

UNITS = {"deg": "degrees", "mm": "millimetres"}


@dataclass(frozen=True)
class Columns:
    """A CSV file's content.

    Attributes:
        file: the name to show.
        header: the columns' names.
        rows: each row as it stands in the file, without the end of its line.
        lines: where each row begins in the file, from 1.
        quoted: whether there is a quotation mark in it, so that a comma need not end a field.
    """

    file: str
    header: tuple[str, ...]
    rows: list[str]
    lines: list[int]
    quoted: bool

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
        out = self._fast_numbers(at)
        if out is None:
            out = self._numbers_with_gaps(names, at)
        whole = np.isfinite(out).all(axis=1)
        for row in np.flatnonzero(~whole).tolist():
            texts = self._texts(row, at)
            if any(text.strip() for text in texts):
                self._refuse(row, names, texts)
        return out

    def _fast_numbers(self, at: Sequence[int]) -> Floats | None:
        """What numpy reads at once; None where a row has to be looked at by itself."""
        if self.quoted or not self.rows:
            return None
        try:
            out = np.loadtxt(self.rows, delimiter=",", comments=None, usecols=at, ndmin=2)
        except ValueError:
            return None
        return out if len(out) == len(self.rows) else None

    def _numbers_with_gaps(self, names: Sequence[str], at: Sequence[int]) -> Floats:
        """The numbers, NaN in empty rows; other texts are refused."""
        out = np.full((len(self.rows), len(at)), nan)
        for row in range(len(self.rows)):
            texts = self._texts(row, at)
            if not any(text.strip() for text in texts):
                continue
            try:
                out[row] = [float(text) for text in texts]
            except ValueError:
                self._refuse(row, names, texts)
        return out

    def _texts(self, row: int, at: Sequence[int]) -> list[str]:
        fields = _split(self.rows[row])
        return [fields[index] for index in at]

    def write(self, stream: TextIO, names: Sequence[str], values: Floats) -> None:
        """The rows with columns (n, len(names)) added, or replaced where there are such already.

        Rows of NaN become empty fields.
        """
        header = [*self.header, *(name for name in names if name not in self.header)]
        at = [header.index(name) for name in names]
        csv.writer(stream, lineterminator="\n").writerow(header)
        rows = zip(self.rows, _tails(values), strict=True)
        if at == list(range(len(self.header), len(header))):
            stream.writelines(f"{row},{tail}\n" for row, tail in rows)
            return
        writer = csv.writer(stream, lineterminator="\n")
        room = [""] * (len(header) - len(self.header))
        for row, tail in rows:
            writer.writerow(_placed([*_split(row), *room], at, tail.split(",")))

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
    file, last = str(path), 0
    rows: list[str] = []
    lines: list[int] = []
    quoted, commas = False, 0
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            for row, begin, end in _records(stream):
                last = end
                if not row:
                    continue
                quoted = quoted or '"' in row
                if not rows:
                    commas = len(_split(row)) - 1
                found = len(_split(row)) - 1 if quoted else row.count(",")
                if found != commas:
                    raise InvalidError(
                        f"{found + 1} fields, but line {lines[0]} names {commas + 1} columns",
                        f"{file}, line {begin}",
                    )
                if len(rows) > MOST_ROWS:
                    raise InvalidError(f"more than {MOST_ROWS} rows; split the file", file)
                rows.append(row)
                lines.append(begin)
    except FileNotFoundError:
        raise InvalidError("there is no such file", file) from None
    except UnicodeDecodeError:
        raise InvalidError("the text is not UTF-8; save it as UTF-8", file) from None
    except csv.Error as problem:
        raise InvalidError(f"not valid CSV: {problem}", f"{file}, line {last + 1}") from None
    except OSError as problem:
        reason = problem.strerror or str(problem)
        raise InvalidError(f"the file cannot be read: {reason}", file) from None
    if not rows:
        raise InvalidError("the file is empty; its first line should name the columns", file)
    header = tuple(name.strip() for name in _split(rows[0]))
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise InvalidError(f"the column {twice!r} is there twice", f"{file}, line {lines[0]}")
    return Columns(file, header, rows[1:], lines[1:], quoted)


def _records(stream: TextIO) -> Iterator[tuple[str, int, int]]:
    """Each record's text, and the first and the last line it stands on.

    A line is a record up to the first quotation mark: from there on `csv` tells where each ends.
    """
    for number, line in enumerate(stream, start=1):
        if '"' in line:
            taken: list[str] = []
            reader, last = csv.reader(_noted(chain([line], stream), taken), strict=True), number - 1
            for _ in reader:
                begin, last = last + 1, number - 1 + reader.line_num
                yield "".join(taken).rstrip("\r\n"), begin, last
                taken.clear()
            return
        yield line.rstrip("\r\n"), number, number


def _noted(lines: Iterable[str], taken: list[str]) -> Iterator[str]:
    for line in lines:
        taken.append(line)
        yield line


def _split(row: str) -> list[str]:
    """The fields of a record."""
    if '"' not in row:
        return row.split(",")
    return next(csv.reader(StringIO(row, newline=""), strict=True))


def _tails(values: Floats) -> Iterator[str]:
    """Each row of numbers (n, k) as fields; empty ones for a row of NaN."""
    count = values.shape[1]
    row = ",".join(["%.12g"] * count)
    for i in range(0, len(values), TOGETHER):
        rounded = np.round(values[i : i + TOGETHER], DECIMALS) + 0.0  # turns -0.0 into 0.0
        text = "\n".join([row] * len(rounded)) % tuple(rounded.ravel().tolist())
        for line in text.split("\n"):
            yield "," * (count - 1) if "nan" in line else line


def _placed(fields: list[str], at: Sequence[int], texts: Sequence[str]) -> list[str]:
    """The fields with those at some places replaced."""
    for index, text in zip(at, texts, strict=True):
        fields[index] = text
    return fields
