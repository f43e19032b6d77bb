"""Runs avrdude on the Mega's bootloader, in bounded time, and tells in words how it ended."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sphmctl.board.port import where
from sphmctl.errors import DeviceError

PROGRAMMER, PART = "wiring", "m2560"
"""avrdude's names of the Mega's bootloader (STK500 version 2 behind a DTR reset) and chip."""

PACKAGE = "avrdude"
"""The Debian package."""

SILENCE_TIMEOUT_S = 5.0
"""Time limit of its silence: it tells of every fiftieth of its work, 0.05 s apart. Its own limit is
30 s for each try, and for a port that goes away none at all."""

START_TIMEOUT_S, KILOBYTE_TIMEOUT_S = 6.0, 1.0
"""Time limit of the whole, for a board that keeps it talking: it takes 0.4 s and, writing and
verifying, 0.25 s a kilobyte (measured on a pseudo-terminal with the simulated board), which a
machine with other work makes three times as much."""

READ_BYTES = 4096

MISMATCHES = ("verification error", "verification mismatch", "content mismatch")

Action = Literal["write", "verify"]


@dataclass(frozen=True)
class Outcome:
    """How avrdude ended.

    Attributes:
        ok: it did what was asked for.
        mismatch: it could read the flash, and that differs from the file.
        said: its last words.
    """

    ok: bool
    mismatch: bool
    said: str


def require() -> str:
    """The program.

    Raises:
        DeviceError: it is not installed.
    """
    program = shutil.which("avrdude")
    if program is None:
        raise DeviceError(
            f"avrdude not found; install it: sudo apt install {PACKAGE}", "this computer"
        )
    return program


def run(action: Action, port: str, baud: int, hex_file: Path, flash_bytes: int) -> Outcome:
    """Write a hex file to the flash and verify it, or verify only.

    Raises:
        DeviceError: avrdude is missing, or did not end within its time limit.
    """
    memory = f"flash:{action[0]}:{hex_file.resolve()}:i"
    command = [require(), "-c", PROGRAMMER, "-p", PART, "-P", port, "-b", str(baud), "-D"]
    limit_s = START_TIMEOUT_S + KILOBYTE_TIMEOUT_S * flash_bytes / 1024
    try:
        code, said = _listen([*command, "-U", memory], limit_s)
    except TimeoutError as error:
        raise DeviceError(
            "avrdude came to no end: the board stopped answering; unplug it, plug it in again and "
            "try once more",
            where(port),
        ) from error
    except OSError as error:
        raise DeviceError(f"avrdude cannot be run: {error}", where(port)) from error
    lines = [line for line in map(str.strip, said.splitlines()) if _tells(line)]
    mismatch = any(word in line for line in lines for word in MISMATCHES)
    return Outcome(code == 0, mismatch, "; ".join(lines[-2:]))


def _listen(command: list[str], limit_s: float) -> tuple[int, str]:
    """Exit code and standard error of a command that keeps talking; killed when it does not."""
    end_s = time.monotonic() + limit_s
    said = b""
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        assert process.stderr is not None
        try:
            while True:
                left_s = min(SILENCE_TIMEOUT_S, end_s - time.monotonic())
                if left_s <= 0 or not select.select([process.stderr], [], [], left_s)[0]:
                    raise TimeoutError
                data = os.read(process.stderr.fileno(), READ_BYTES)
                if not data:
                    return process.wait(SILENCE_TIMEOUT_S), said.decode(errors="replace")
                said += data
        except subprocess.TimeoutExpired as error:
            raise TimeoutError from error
        finally:
            process.kill()


def _tells(line: str) -> bool:
    """Whether a line of avrdude's is news: no progress, no thanks, nothing on modem lines."""
    return bool(line) and not any(word in line for word in (" | ", "TIOCM", "Thank you"))
