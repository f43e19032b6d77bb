"""The board simulator's process: compiled when needed, started, spoken to in lines; knows no loop.

Its source is a program of its own (tools/avrsim of a checkout) and never part of the package.
"""

from __future__ import annotations

import hashlib
import os
import select
import subprocess
import tempfile
import time
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "tools" / "avrsim"
"""Where a checkout has the simulator's source; an installed package has none."""

PACKAGES = "gcc libc6-dev libsimavr-dev"
"""Debian packages that compiling it takes."""

FLAGS = ("-std=gnu11", "-D_GNU_SOURCE", "-O2", "-g", "-Wall", "-Wextra", "-Werror")
LIBRARIES = ("-lsimavr", "-lutil")

COMPILE_TIMEOUT_S = 60.0
"""Time limit of the compiler, which takes 2 s."""

ANSWER_TIMEOUT_S = 20.0
"""Time limit of one answer: a simulated second takes 0.1 to 0.3 s, on a laden machine 2 s."""

END_TIMEOUT_S = 2.0
"""How long the process may take to end when told to, before it is killed."""

READ_BYTES = 1 << 16


class BoardError(Exception):
    """The board cannot be simulated: what is missing, or what the simulator said."""


def simulator(flags: tuple[str, ...] = (), source: Path = SOURCE) -> Path:
    """The simulator's program, compiled on first use and kept in the user's cache.

    Args:
        flags: for the compiler, beside the usual ones (a test's sanitizers).
        source: folder of the C files.

    Raises:
        BoardError: no source, no compiler, or it does not compile.
    """
    files = sorted(source.glob("*.[ch]"))
    if not files:
        raise BoardError(
            f"{source}: the board simulator's source is not there; it comes with a checkout of "
            "the repository, not with the installed package"
        )
    options = (*FLAGS, *flags)
    digest = hashlib.sha256(" ".join(options).encode())
    for file in files:
        digest.update(file.read_bytes())
    program = _cache() / f"avrsim-{digest.hexdigest()[:16]}"
    if not program.exists():
        _compile([*options, *map(str, source.glob("*.c"))], program)
    return program


def _cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(base) / "sphmctl"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BoardError(f"{folder}: cannot keep the board simulator there: {error}") from error
    return folder


def _compile(arguments: list[str], program: Path) -> None:
    """Compile beside `program`, then put it in place: two at once do not hurt each other."""
    with tempfile.TemporaryDirectory(dir=program.parent) as folder:
        fresh = Path(folder) / "avrsim"
        command = ["gcc", *arguments, "-o", str(fresh), *LIBRARIES]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=COMPILE_TIMEOUT_S, check=False
            )
        except FileNotFoundError as error:
            raise BoardError(f"no gcc; install it: apt-get install {PACKAGES}") from error
        except subprocess.TimeoutExpired as error:
            raise BoardError(f"gcc took longer than {COMPILE_TIMEOUT_S:g} s") from error
        if done.returncode != 0:
            first = next((line for line in done.stderr.splitlines() if "error" in line), "")
            raise BoardError(
                f"the board simulator does not compile; are these installed: {PACKAGES}? {first}"
            )
        fresh.replace(program)


class Process:
    """A running simulator; its first line is awaited here.

    Args:
        arguments: for the program.
        program: which one.

    Raises:
        BoardError: it ended at once; the message is what it said.
    """

    def __init__(self, arguments: list[str], program: Path) -> None:
        self._popen = subprocess.Popen(
            [str(program), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            # A terminal's Ctrl-C is for whoever started us, who then ends this process in order.
            start_new_session=True,
        )
        assert self._popen.stdin is not None
        assert self._popen.stdout is not None
        self._to = self._popen.stdin.fileno()
        self.fd = self._popen.stdout.fileno()
        self._rest = b""
        self.early: list[str] = []
        try:
            self.early, self.ready = self._until("ready", ANSWER_TIMEOUT_S)
        except BoardError:
            self.close()
            raise

    @property
    def running(self) -> bool:
        """Whether it still runs."""
        return self._popen.poll() is None

    def send(self, lines: str) -> None:
        """Give commands, each with its line end.

        Raises:
            BoardError: the process has ended or does not take them in time.
        """
        data = lines.encode()
        end_s = time.monotonic() + ANSWER_TIMEOUT_S
        try:
            while data:
                left_s = max(0.0, end_s - time.monotonic())
                if not select.select([], [self._to], [], left_s)[1]:
                    limit = f"within {ANSWER_TIMEOUT_S:g} s"
                    raise BoardError(f"the board simulator did not take a command {limit}")
                # A pipe that is ready takes so much without blocking.
                data = data[os.write(self._to, data[: select.PIPE_BUF]) :]
        except OSError as error:
            raise BoardError(self._obituary()) from error

    def ask(self, command: str, answer: str) -> tuple[list[str], str]:
        """Give a command and wait for the line that begins with `answer`.

        Returns:
            The events that came before it, and the rest of that line.

        Raises:
            BoardError: the process has ended or does not answer in time.
        """
        self.send(command + "\n")
        return self._until(answer, ANSWER_TIMEOUT_S)

    def read(self) -> list[str]:
        """The whole lines that have come; blocks when there are none."""
        data = os.read(self.fd, READ_BYTES)
        if not data:
            raise BoardError(self._obituary())
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode() for line in lines]

    def _until(self, answer: str, timeout_s: float) -> tuple[list[str], str]:
        events: list[str] = []
        end_s = time.monotonic() + timeout_s
        while True:
            left_s = end_s - time.monotonic()
            if left_s <= 0 or not select.select([self.fd], [], [], left_s)[0]:
                raise BoardError(f"the board simulator did not answer within {timeout_s:g} s")
            for line in self.read():
                word, _, rest = line.partition(" ")
                if word == answer:
                    return events, rest
                if word == "wrong":
                    raise BoardError(f"the board simulator does not know: {rest}")
                events.append(line)

    def _obituary(self) -> str:
        try:
            self._popen.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return "the board simulator closed its line"
        said = self._popen.stderr.read().decode().strip() if self._popen.stderr else ""
        return said or f"the board simulator ended with code {self._popen.returncode}"

    def close(self) -> None:
        """End the process; it stores its EEPROM first. May be called again."""
        popen = self._popen
        for pipe in (popen.stdin, popen.stdout):
            if pipe is not None:
                pipe.close()
        try:
            popen.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            popen.kill()
            popen.wait()
        if popen.stderr is not None:
            popen.stderr.close()
