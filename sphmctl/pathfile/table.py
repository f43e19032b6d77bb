"""Points of a polyline as a CSV file: columns by name, read as one array, no object per row."""

from __future__ import annotations

import csv
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from sphmctl.errors import InvalidError
from sphmctl.pathfile.model import Polyline
from sphmctl.yamlfile import ANGLE_LIMIT_DEG, POSITION_LIMIT_MM, nearest, read_text, shown

PLACE = ("x_mm", "y_mm", "z_mm")
TURN = ("a_deg", "b_deg", "c_deg")
CRANKS = ("theta7_deg", "theta8_deg", "theta9_deg")
COLUMNS = (*PLACE, *TURN, *CRANKS)

SIZE_LIMIT_BYTES = 64_000_000
"""Half a million rows with all columns; a larger file is a mistake, and slow to read."""

SAME_MM = 1e-6
"""Rows closer than this are one place: far below any stated accuracy, far above rounding."""


def read_polyline(file: str, cranks_needed: bool) -> Polyline:
    """Read a table of points. Raises InvalidError with line, column, value and what is right."""
    header, body, first_line = _split(file)
    names = _names(file, header, first_line)
    filled = {number: line for number, line in enumerate(body, first_line + 1) if line.strip()}
    if not filled:
        raise InvalidError("there is no row of points below the names", file)
    lines = np.array(list(filled), dtype=np.int64)
    try:
        rows = np.loadtxt(filled.values(), delimiter=",", comments=None, ndmin=2, quotechar='"')
    except ValueError:
        _explain(file, names, filled)
    if rows.shape[1] != len(names):
        _explain(file, names, filled)
    _check_values(file, names, rows, lines)
    xyz = _part(rows, names, PLACE)
    assert xyz is not None  # _names asked for it
    _check_apart(file, xyz, lines)
    if cranks_needed and CRANKS[0] not in names:
        raise InvalidError(
            f"the wrist policy 'cranks' needs the columns {', '.join(CRANKS)}; add them, or "
            "choose another policy",
            f"{file}, line {first_line}",
        )
    return Polyline(file, lines, xyz, _part(rows, names, TURN), _part(rows, names, CRANKS))


def _split(file: str) -> tuple[str, list[str], int]:
    """The line of names, the lines below it, and the number of that line."""
    text = read_text(file, SIZE_LIMIT_BYTES)
    rows = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for index, row in enumerate(rows):
        if row.strip():
            return row, rows[index + 1 :], index + 1
    raise InvalidError(f"the file is empty; its first line should be {','.join(COLUMNS)}", file)


def _names(file: str, header: str, line: int) -> list[str]:
    names = [name.strip().strip('"') for name in header.split(",")]
    for column, name in enumerate(names, 1):
        where = f"{file}, line {line}, column {column}"
        if name not in COLUMNS:
            hint = nearest(name, COLUMNS) or f"; known are {', '.join(COLUMNS)}"
            raise InvalidError(f"{shown(name)} is no column of a polyline{hint}", where)
        if name in names[: column - 1]:
            raise InvalidError(f"the column {name} is there twice; leave one out", where)
    for group in (PLACE, TURN, CRANKS):
        missing = [name for name in group if name not in names]
        if missing and (group is PLACE or len(missing) < len(group)):
            raise InvalidError(
                f"the column {missing[0]} is missing; give {', '.join(group)}",
                f"{file}, line {line}",
            )
    return names


def _explain(file: str, names: list[str], filled: dict[int, str]) -> NoReturn:
    """Find the row that cannot be read, the slow way."""
    for number, line in filled.items():
        values = next(csv.reader([line]))
        if len(values) != len(names):
            raise InvalidError(
                f"the row has {len(values)} values; the first line names {len(names)} columns",
                f"{file}, line {number}",
            )
        for column, value in enumerate(values, 1):
            if not _is_number(value):
                raise InvalidError(
                    f"{names[column - 1]}: {shown(value)} should be a number such as 12.5",
                    f"{file}, line {number}, column {column}",
                )
    raise InvalidError("the file cannot be read as a table of numbers", file)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python's alone


def _check_values(
    file: str, names: list[str], rows: NDArray[np.float64], lines: NDArray[np.int64]
) -> None:
    limits = [POSITION_LIMIT_MM if name in PLACE else ANGLE_LIMIT_DEG for name in names]
    beyond = ~(np.abs(rows) <= np.array(limits))
    if beyond.any():
        row, column = (int(x[0]) for x in np.nonzero(beyond))
        value = rows[row, column]
        why = f"is out of range; at most {limits[column]:g} is allowed"
        raise InvalidError(
            f"{names[column]}: {value:g} {'is no number' if np.isnan(value) else why}",
            f"{file}, line {lines[row]}, column {column + 1}",
        )


def _check_apart(file: str, xyz: NDArray[np.float64], lines: NDArray[np.int64]) -> None:
    same = np.linalg.norm(np.diff(xyz, axis=0), axis=1) < SAME_MM
    if same.any():
        row = int(same.argmax())
        raise InvalidError(
            f"the row is the same place as line {lines[row]}; leave one of them out",
            f"{file}, line {lines[row + 1]}",
        )


def _part(
    rows: NDArray[np.float64], names: list[str], group: tuple[str, ...]
) -> NDArray[np.float64] | None:
    if group[0] not in names:
        return None
    return np.ascontiguousarray(rows[:, [names.index(name) for name in group]])
