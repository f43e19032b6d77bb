"""Fixtures: sketches compiled once per session, boards that are powered down at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from sphmctl.emulators.board import Options
from tests.avrsim.rig import Rig, compile_sketch

Sketch = Callable[..., Path]
MakeRig = Callable[..., Rig]


@pytest.fixture(scope="session")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Sketch:
    """Compiles a test sketch with defines."""
    folder = tmp_path_factory.mktemp("sketches")

    def compile_one(name: str, *defines: str) -> Path:
        return compile_sketch(name, folder, *defines)

    return compile_one


@pytest.fixture
def rig(sketch: Sketch) -> Iterator[MakeRig]:
    """Starts a held board with a test sketch."""
    rigs: list[Rig] = []

    def start(name: str, *defines: str, eeprom: Path | None = None) -> Rig:
        rigs.append(Rig(Options(sketch(name, *defines), eeprom=eeprom)))
        return rigs[-1]

    yield start
    for one in rigs:
        one.board.close()
