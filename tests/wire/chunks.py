"""The ways in which a byte stream can arrive, and the golden frames."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

VECTORS = Path(__file__).parent.parent / "vectors"


def load(name: str) -> dict[str, list[dict[str, Any]]]:
    """A file of golden frames; each entry's `hex` becomes bytes."""
    tables: dict[str, list[dict[str, Any]]] = tomllib.loads((VECTORS / name).read_text())
    for entries in tables.values():
        for entry in entries:
            entry["hex"] = bytes.fromhex(entry["hex"])
    return tables


def cut(data: bytes, sizes: list[int]) -> Iterator[bytes]:
    """`data` in pieces of these sizes, over and over."""
    at = index = 0
    while at < len(data):
        size = sizes[index % len(sizes)]
        yield data[at : at + size]
        at += size
        index += 1
