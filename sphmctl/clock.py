"""Event loops: one with precise timers for the robot, one whose time jumps for dry runs and tests.

Control code asks only the running loop for the time and waits only on the loop's timers, so
that daemon, drivers and emulators run unchanged on either.
"""

from __future__ import annotations

import asyncio
import ctypes
import os
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")

CLOCK_MONOTONIC = 1
"""Linux <time.h>: the clock of `time.monotonic`, which asyncio uses."""

VIRTUAL_START_S = 1000.0
"""Where virtual time begins: not 0, so that nobody mistakes an instant for a duration."""


class _TimeSpec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _TimerSpec(ctypes.Structure):
    """`struct itimerspec` of timerfd_settime(2)."""

    _fields_ = (("interval", _TimeSpec), ("value", _TimeSpec))


class PreciseSelector(selectors.EpollSelector):
    """Epoll whose waits end on time.

    epoll_wait counts whole milliseconds and asyncio rounds up, so that stock timers are 0.7 ms
    late in the median (python/cpython issue 75720). Here a timerfd (Linux, timerfd_create(2)) ends
    the wait instead.
    """

    def __init__(self) -> None:
        super().__init__()
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._timer = self._libc.timerfd_create(CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
        if self._timer < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create failed")
        self.register(self._timer, selectors.EVENT_READ)

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As `EpollSelector.select`, to the precision of the kernel's timers."""
        if timeout is None or timeout <= 0:
            return [event for event in super().select(timeout) if event[0].fd != self._timer]
        seconds, rest = divmod(timeout, 1.0)
        # A zero timer would be a disarmed one.
        value = _TimeSpec(int(seconds), max(1, int(rest * 1e9)))
        spec = _TimerSpec(_TimeSpec(0, 0), value)
        self._libc.timerfd_settime(self._timer, 0, ctypes.byref(spec), None)
        events = super().select(None)
        ours = [event for event in events if event[0].fd != self._timer]
        if len(ours) < len(events):
            os.read(self._timer, 8)
        return ours

    def close(self) -> None:
        """Close the timer and the epoll."""
        os.close(self._timer)
        super().close()


class _JumpSelector(selectors.SelectSelector):
    """A selector that never waits: asked to, it moves the clock instead."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = VIRTUAL_START_S

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            raise RuntimeError("nothing is scheduled any more: every task waits for another one")
        self.now_s += max(timeout, 0.0)
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop whose time jumps to the next timer; files and sockets are never looked at."""

    def __init__(self) -> None:
        self._jump = _JumpSelector()
        super().__init__(self._jump)

    def time(self) -> float:
        """Virtual seconds."""
        return self._jump.now_s


def precise_loop() -> asyncio.AbstractEventLoop:
    """A stock event loop with precise timers."""
    return asyncio.SelectorEventLoop(PreciseSelector())


def run(main: Coroutine[Any, Any, T], *, virtual: bool = False) -> T:
    """Run `main` on a loop of its own, cancelling what is left over, as `asyncio.run` does."""
    factory = VirtualLoop if virtual else precise_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        return runner.run(main)
