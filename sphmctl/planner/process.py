"""Planning in a process of its own, at low priority, so that a running loop is not delayed.

A thread would not do: Python runs one at a time. The answer comes back in pieces that are read
without holding the interpreter, and its arrays are used where they were read to, not copied.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from io import BufferedReader, BufferedWriter
from typing import Any, Generic, TypeVar

from sphmctl.config import Cell
from sphmctl.errors import SphmctlError
from sphmctl.motion import Plan
from sphmctl.pathfile import Path
from sphmctl.planner.plan import plan

T = TypeVar("T")

NICE = 5
"""A third of the turns beside a process of normal priority, all of an idle core. At 19, the lowest,
importing numpy takes minutes on a busy machine."""

TIME_LIMIT_S = 600.0
"""Ten minutes; a plan of 100,000 points takes less than one."""

LENGTH_BYTES = 8
"""Every piece of the answer follows its length in so many bytes."""

# Nice first: importing numpy is the larger half of a short plan. A caller in the real-time class
# (`clock.urgent`) would hand that on as well.
CHILD = (
    "import os; os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0)); os.nice({nice}); "
    "from sphmctl.planner.process import serve; serve()"
)
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Numpy's libraries would take every core."""


class Errand(Generic[T]):
    """A call that another process makes."""

    def __init__(self, function: Callable[..., T], *args: Any) -> None:
        """Start it. The function is one of a module, and all arguments can be pickled."""
        self._cancelled = threading.Event()
        self._request = pickle.dumps((function, args), protocol=5)
        self._process = subprocess.Popen(
            [sys.executable, "-c", CHILD.format(nice=NICE)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )

    @property
    def ended(self) -> bool:
        """Whether its process is gone."""
        return self._process.poll() is not None

    def cancel(self) -> None:
        """End it, from any thread; `take` then raises at once. Does nothing when it is over."""
        self._cancelled.set()
        self._process.kill()

    def take(self, timeout_s: float = TIME_LIMIT_S) -> T:
        """Wait for the answer; once only. Blocks: an event loop calls it in a thread.

        Raises:
            SphmctlError: the time is over, it was cancelled, or the process has died.
            Exception: whatever the function raised.
        """
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        expired = threading.Event()

        def expire() -> None:
            expired.set()
            self._process.kill()

        timer = threading.Timer(timeout_s, expire)
        timer.start()
        try:
            with _writer(stdin.fileno()) as requests, _reader(stdout.fileno()) as answers:
                _send(requests, [self._request])
                pieces = _receive(answers)
        except (EOFError, OSError):
            raise self._no_answer(timeout_s if expired.is_set() else None) from None
        except BaseException:
            self._process.kill()
            raise
        finally:
            timer.cancel()
            with self._process:
                pass  # closes both pipes, and waits for its end
        good, answer = pickle.loads(pieces[0], buffers=pieces[1:])
        if not good:
            raise answer
        result: T = answer
        return result

    def _no_answer(self, limit_s: float | None) -> SphmctlError:
        if self._cancelled.is_set():
            return SphmctlError("planning was cancelled")
        if limit_s is not None:
            return SphmctlError(f"planning took longer than {limit_s:g} s and was ended")
        code = self._process.wait()
        how = (
            f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        )
        hint = "; is there enough memory?" if code == -signal.SIGKILL else ""
        return SphmctlError(f"planning gave no answer: its process {how}{hint}")


def plan_apart(path: Path, cell: Cell, speed: float = 1.0, timeout_s: float = TIME_LIMIT_S) -> Plan:
    """As `planner.plan`, with the same errors, in a process of its own. Blocks, as `take` does."""
    return Errand(plan, path, cell, speed).take(timeout_s)


def serve() -> None:
    """The other process: one call from standard input, its answer to standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the caller's to act on
    answers = _writer(os.dup(1))
    os.dup2(2, 1)  # what the function prints must not get into the answer
    buffers: list[pickle.PickleBuffer] = []
    try:
        function, args = pickle.loads(_receive(_reader(0))[0])
        threading.Thread(target=_end_with_caller, daemon=True).start()
        head = pickle.dumps((True, function(*args)), protocol=5, buffer_callback=buffers.append)
    except Exception as problem:
        buffers.clear()
        if not isinstance(problem, SphmctlError):
            problem.add_note("".join(traceback.format_exception(problem)))
        head = pickle.dumps((False, problem), protocol=5)
    _send(answers, [head, *(buffer.raw() for buffer in buffers)])


def _end_with_caller() -> None:
    """Nothing more is sent, so the request's pipe says one thing: that its other end is gone."""
    os.read(0, 1)
    os._exit(1)


def _reader(fd: int) -> BufferedReader:
    return open(fd, "rb", closefd=False)


def _writer(fd: int) -> BufferedWriter:
    return open(fd, "wb", closefd=False)


def _send(stream: BufferedWriter, pieces: list[Any]) -> None:
    """Their number, then each with its length."""
    stream.write(len(pieces).to_bytes(LENGTH_BYTES))
    for piece in pieces:
        stream.write(len(piece).to_bytes(LENGTH_BYTES))
        stream.write(piece)
    stream.flush()


def _receive(stream: BufferedReader) -> list[bytearray]:
    """What `_send` sent. Raises EOFError."""
    count = int.from_bytes(_exactly(stream, LENGTH_BYTES))
    return [_exactly(stream, int.from_bytes(_exactly(stream, LENGTH_BYTES))) for _ in range(count)]


def _exactly(stream: BufferedReader, count: int) -> bytearray:
    """So many bytes, read to where they stay."""
    piece = bytearray(count)
    view = memoryview(piece)
    while view:
        got = stream.readinto(view)
        if not got:
            raise EOFError
        view = view[got:]
    return piece
