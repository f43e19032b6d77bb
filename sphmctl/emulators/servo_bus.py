"""The servos' bus and its adapter: when bytes are on the wire, and who hears them.

Half duplex at 10 bits per byte. An instruction takes effect when its last byte has arrived; a
reply follows after return delay and turnaround; whatever comes meanwhile waits for the wire.
"""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from sphmctl.emulators.adapter import Adapter, Usb
from sphmctl.emulators.dxl_frame import FrameFinder, Instruction
from sphmctl.emulators.pseudo_terminal import PseudoTerminal
from sphmctl.emulators.servo_instructions import Reply, answer
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo

BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""

MAX_GAP_S = 1.5e-3
"""Silence within an instruction after which servos drop it, s (e-manual, Protocol 2.0)."""


class Pipe(Protocol):
    """The bus' end of a byte link."""

    on_bytes: Callable[[bytes], None]
    on_lost: Callable[[], None]

    def write(self, data: bytes) -> None:
        """Send to the host."""

    def close(self) -> None:
        """Hang up."""


class ServoBus:
    """Servos on one wire behind a USB adapter; one host at a time.

    Args:
        world: gives time to the servos, which join it here.
        servos: those on the bus.
        rng: draws the adapter's phase.
        usb: the adapter's chip.
        pacing: False answers at once: no wire time, no delays, no adapter (for benchmarks).
    """

    def __init__(
        self,
        world: World,
        servos: Sequence[Servo],
        rng: random.Random,
        *,
        usb: Usb = "16u2",
        pacing: bool = True,
    ) -> None:
        self.servos = tuple(servos)
        self._world = world
        for servo in self.servos:
            world.add(servo)
        self._pacing = pacing
        self._adapter = Adapter(usb, rng, self._deliver)
        self._pipe: Pipe | None = None
        self._baud: Callable[[], int | None] = lambda: None
        self._finder = FrameFinder()
        self._sent_until_s = 0.0  # the host's own bytes are on the wire until then
        self._busy_until_s = 0.0  # as far as the wire's use is decided
        self._queue: deque[tuple[float, float, Instruction]] = deque()  # last byte, duration
        self._timer: asyncio.TimerHandle | None = None

    def attach(self, pipe: Pipe, baud: int = 1_000_000) -> None:
        """Serve `pipe`, whose host talks at `baud`; a pipe served before is left alone."""
        self._serve(pipe, lambda: baud)

    def open_pty(self, link: Path | None = None) -> str:
        """Serve a new pseudo-terminal at the rate its client sets; return its device path.

        Args:
            link: symbolic link to the device, removed again by `close`.
        """
        terminal = PseudoTerminal(link)
        self._serve(terminal, terminal.baud)
        return terminal.path

    async def close(self) -> None:
        """Hang up; the servos live on as long as somebody advances the world."""
        pipe = self._pipe
        self._lose()
        if pipe is not None:
            pipe.close()

    def _serve(self, pipe: Pipe, baud: Callable[[], int | None]) -> None:
        self._lose()
        self._pipe = pipe
        self._baud = baud
        pipe.on_bytes = self._hear
        pipe.on_lost = self._lose

    def _lose(self) -> None:
        self._pipe = None
        self._finder.drop()
        self._queue.clear()
        self._adapter.drop()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _deliver(self, data: bytes) -> None:
        if self._pipe is not None:
            self._pipe.write(data)

    def _hear(self, data: bytes) -> None:
        """Take bytes from the host: onto the wire, whole instructions into the queue."""
        now_s = asyncio.get_running_loop().time()
        baud = self._baud()
        byte_s = BITS_PER_BYTE / baud if baud and self._pacing else 0.0
        if now_s - self._sent_until_s > MAX_GAP_S:
            self._finder.drop()
        self._sent_until_s = max(now_s, self._sent_until_s) + len(data) * byte_s
        if baud is None:
            self._finder.drop()
            return
        for packet in self._finder.feed(data):
            if self._pacing:
                last_s = self._sent_until_s - packet.trailing_bytes * byte_s
                self._queue.append((last_s, packet.wire_bytes * byte_s, packet))
            else:
                self._deliver(b"".join(reply.data for reply in self._obey(packet, baud)))
        self._set_timer()

    def _set_timer(self) -> None:
        if self._timer is None and self._queue:
            last_s, duration_s, _ = self._queue[0]
            at = max(last_s, self._busy_until_s + duration_s)
            self._timer = asyncio.get_running_loop().call_at(at, self._arrive, at)

    def _arrive(self, at_s: float) -> None:
        """The queue's first instruction is complete on the wire."""
        self._timer = None
        _, _, packet = self._queue.popleft()
        baud = self._baud()
        self._busy_until_s = at_s
        if baud is not None:
            for reply in self._obey(packet, baud):
                begin_s = self._busy_until_s + reply.delay_s
                byte_s = BITS_PER_BYTE / baud
                self._busy_until_s = begin_s + len(reply.data) * byte_s
                self._adapter.put(begin_s, byte_s, reply.data)
        self._set_timer()

    def _obey(self, packet: Instruction, baud: int) -> list[Reply]:
        self._world.advance()
        hearing = [servo for servo in self.servos if servo.listening and servo.baud == baud]
        return answer(packet, hearing)
