"""The command line as a fixture, in a folder of its own, on the packaged cell; an empty port."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from sphmctl.cli import main
from tests.cli.rig import Result, Sphmctl


@pytest.fixture
def sphmctl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Sphmctl:
    """Run one command; nothing outside the test decides on the cell."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SPHMCTL_CELL", raising=False)

    def run(*arguments: str | Path | float) -> Result:
        capsys.readouterr()
        code = main.run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Result(code, captured.out, captured.err)

    return run


@pytest.fixture
def terminal() -> Iterator[str]:
    """A serial port at whose other end nobody is."""
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)
