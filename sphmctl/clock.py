"""Event loops: one with precise timers for the robot, one whose time jumps for dry runs and tests.

Control code asks only the running loop for the time and waits only on the loop's timers, so
that daemon, drivers and emulators run unchanged on either.
"""

from __future__ import annotations

import asyncio
import ctypes
import math
import os
import selectors
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")

CLOCK_MONOTONIC = 1
"""Linux <time.h>: the clock of `time.monotonic`, which asyncio uses."""

TFD_TIMER_ABSTIME = 1
"""Linux <sys/timerfd.h>: the time given is an instant of the clock, not a duration."""

SAME_INSTANT_S = 1e-6
"""A timer set for this much later will do: asyncio hands over durations, which lose some hundred
nanoseconds on the way to an instant, differently in each wait."""

URGENT_PRIORITY = 50
"""Real-time priority of a running cell: what ros2_control uses, below the kernel's own."""

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
    the wait instead. It is set anew only for an earlier instant: the loop asks again when a wait
    ends too soon, and most waits end by a file, with the timers as they were.
    """

    def __init__(self) -> None:
        super().__init__()
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._timer = self._libc.timerfd_create(CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
        if self._timer < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create failed")
        self.register(self._timer, selectors.EVENT_READ)
        self._set_for_s = math.inf

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As `EpollSelector.select`, to the precision of the kernel's timers."""
        if timeout is not None and timeout > 0:
            at_s = time.monotonic() + timeout
            if at_s + SAME_INSTANT_S < self._set_for_s:
                self._set_timer(at_s)
            timeout = None
        events = super().select(timeout)
        for at, (key, _) in enumerate(events):
            if key.fd == self._timer:
                del events[at]
                os.read(self._timer, 8)
                self._set_for_s = math.inf
                break
        return events

    def close(self) -> None:
        """Close the timer and the epoll."""
        os.close(self._timer)
        super().close()

    def _set_timer(self, at_s: float) -> None:
        seconds, rest = divmod(at_s, 1.0)
        value = _TimeSpec(int(seconds), int(rest * 1e9) + 1)
        spec = _TimerSpec(_TimeSpec(0, 0), value)
        self._libc.timerfd_settime(self._timer, TFD_TIMER_ABSTIME, ctypes.byref(spec), None)
        self._set_for_s = at_s


class _JumpSelector(selectors.SelectSelector):
    """A selector that never waits: asked to, it moves the clock instead."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = VIRTUAL_START_S
        self.companion: Callable[[float, float], float] | None = None

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None:
            raise RuntimeError("nothing is scheduled any more: every task waits for another one")
        until_s = self.now_s + max(timeout, 0.0)
        if self.companion is not None and until_s > self.now_s:
            until_s = self.companion(self.now_s, until_s)
        self.now_s = until_s
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop whose time jumps to the next timer; files and sockets are never looked at."""

    def __init__(self) -> None:
        self._jump = _JumpSelector()
        super().__init__(self._jump)

    def time(self) -> float:
        """Virtual seconds."""
        return self._jump.now_s

    def accompany(self, ahead: Callable[[float, float], float] | None) -> None:
        """Let a simulation outside the loop live in its time; None ends that.

        Args:
            ahead: called with now and the instant (s) to which time is about to jump; lives up to
                there, or to the instant at which it has something for the loop, which it returns.
        """
        self._jump.companion = ahead


@contextmanager
def urgent() -> Iterator[bool]:
    """Run before ordinary programs meanwhile, where this user may; says whether he may.

    Without it two busy programs make a loop late by milliseconds, and now and then by hundreds.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(URGENT_PRIORITY))
    except PermissionError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, *before)


def precise_loop() -> asyncio.AbstractEventLoop:
    """A stock event loop with precise timers."""
    return asyncio.SelectorEventLoop(PreciseSelector())


def run(main: Coroutine[Any, Any, T], *, virtual: bool = False) -> T:
    """Run `main` on a loop of its own, cancelling what is left over, as `asyncio.run` does."""
    factory = VirtualLoop if virtual else precise_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        return runner.run(main)
