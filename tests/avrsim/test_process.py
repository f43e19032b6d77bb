"""The simulator's process from this side: one that dies or stops listening is noticed, in time."""

from __future__ import annotations

from pathlib import Path

import pytest

from sphmctl.emulators import board_process
from sphmctl.emulators.board_process import BoardError, Process

MORE_THAN_A_PIPE_HOLDS = "reset\n" * 100_000


def program(folder: Path, rest: str) -> Path:
    """What says that it is ready, and then does something else."""
    script = folder / "simulator"
    script.write_text(f"#!/bin/sh\necho ready none none\n{rest}\n")
    script.chmod(0o755)
    return script


def test_one_that_takes_no_commands_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = Process([], program(tmp_path, "exec sleep 60"))
    monkeypatch.setattr(board_process, "ANSWER_TIMEOUT_S", 0.2)
    monkeypatch.setattr(board_process, "END_TIMEOUT_S", 0.2)
    try:
        with pytest.raises(BoardError, match=r"did not take a command within 0\.2 s"):
            process.send(MORE_THAN_A_PIPE_HOLDS)
    finally:
        process.close()
    assert not process.running


def test_one_that_has_ended_is_told_with_its_code(tmp_path: Path) -> None:
    process = Process([], program(tmp_path, "exec <&-; exit 7"))
    try:
        with pytest.raises(BoardError, match="ended with code 7"):
            process.send(MORE_THAN_A_PIPE_HOLDS)
    finally:
        process.close()
