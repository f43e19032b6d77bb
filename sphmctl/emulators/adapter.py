"""A USB serial adapter as an ATmega16U2: when bytes from the bus reach the host; no protocol.

Host to bus is immediate, as the chip passes each USB packet on at once.
"""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable
from typing import Literal

Usb = Literal["16u2", "none"]

FLUSH_S = 256 * 256 / 16e6
"""Period of the chip's flush, s: timer 0 at 16 MHz / 256 overflows every 4.096 ms.

Arduino-usbserial.c (LUFA), Arduino Uno: `TCCR0B = (1 << CS02)` and the test of `TOV0`.
"""

NEARLY_FULL = 96
"""Bytes waiting above which the chip flushes at once (`BUFFER_NEARLY_FULL`, same source)."""


class Adapter:
    """Holds bytes that arrive on the bus until the chip would hand them to the host.

    Args:
        usb: the chip; "none" hands each piece over when its last byte has arrived.
        rng: draws the phase of the flush timer.
        deliver: takes what the host gets.
    """

    def __init__(self, usb: Usb, rng: random.Random, deliver: Callable[[bytes], None]) -> None:
        if usb not in ("16u2", "none"):
            raise ValueError(f"adapter: usb is {usb!r}, must be '16u2' or 'none'")
        self._usb = usb
        self._phase_s = rng.uniform(0.0, FLUSH_S)
        self._deliver = deliver
        self._waiting: deque[tuple[float, float, bytes]] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def put(self, begin_s: float, byte_s: float, data: bytes) -> None:
        """Let `data` arrive on the bus side, a byte every `byte_s` from `begin_s` (loop time)."""
        self._waiting.append((begin_s, byte_s, data))
        # A flush that is set stands, unless this makes the chip nearly full before it.
        if self._timer is None or sum(len(piece[2]) for piece in self._waiting) > NEARLY_FULL:
            self._set_timer()

    def drop(self) -> None:
        """Forget what waits."""
        self._waiting.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _set_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._waiting:
            at = self._next_flush_s()
            self._timer = asyncio.get_running_loop().call_at(at, self._flush, at)

    def _next_flush_s(self) -> float:
        begin_s, byte_s, data = self._waiting[0]
        if self._usb == "none":
            return begin_s + len(data) * byte_s
        periods = (begin_s + byte_s - self._phase_s) // FLUSH_S + 1
        tick_s = self._phase_s + periods * FLUSH_S
        count = 0
        for begin_s, byte_s, data in self._waiting:
            if count + len(data) > NEARLY_FULL:
                return min(tick_s, begin_s + (NEARLY_FULL + 1 - count) * byte_s)
            count += len(data)
        return tick_s

    def _flush(self, at_s: float) -> None:
        """Hand over every byte that has arrived by `at_s`; a frame may be torn in two."""
        self._timer = None
        out = bytearray()
        while self._waiting:
            begin_s, byte_s, data = self._waiting[0]
            # The margin keeps a byte that arrives on this very instant.
            arrived = int((at_s - begin_s) / byte_s + 1e-6) if at_s > begin_s else 0
            if arrived >= len(data):
                out += data
                self._waiting.popleft()
                continue
            if arrived > 0:
                out += data[:arrived]
                self._waiting[0] = (begin_s + arrived * byte_s, byte_s, data[arrived:])
            break
        self._set_timer()
        if out:
            self._deliver(bytes(out))
