"""The command line as a fixture, in a folder of its own, on the packaged cell."""

from __future__ import annotations

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
