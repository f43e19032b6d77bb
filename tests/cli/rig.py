"""Runs the command line inside the test's process, and reads what it printed."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from sphmctl.motion import Floats

REPOSITORY = Path(__file__).parents[2]
TABLE_5 = REPOSITORY / "tests" / "vectors" / "octagon_table5.csv"
OCTAGON = REPOSITORY / "configs" / "paths" / "octagon.yaml"


@dataclass(frozen=True)
class Result:
    """What one command left behind."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        """The one JSON document on stdout."""
        loaded: dict[str, Any] = json.loads(self.out, parse_constant=_refuse)
        return loaded

    @property
    def error(self) -> dict[str, Any]:
        """The failure that it tells."""
        told: dict[str, Any] = self.document["error"]
        assert told["exit_code"] == self.code
        return told


Sphmctl: TypeAlias = Callable[..., Result]


def _refuse(word: str) -> float:
    raise AssertionError(f"{word} is not JSON")


def read_csv(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file by column."""
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def listed(numbers: Floats | list[float]) -> str:
    """Numbers as an option takes them."""
    return ",".join(repr(float(number)) for number in numbers)
