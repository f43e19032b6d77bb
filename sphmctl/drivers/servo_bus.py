"""Transactions on the servo bus: a frame out, one status per servo back, in bounded time.

Knows Protocol 2.0's timing, not what the servos are for. One transaction at a time; what is left
of an earlier one is dropped before the next, and a reply counts only under the id asked and with
as many data as asked for, or an error.
"""

from __future__ import annotations

import asyncio

from sphmctl.drivers.link import Link, LinkOpener, ignore_bytes, ignore_loss
from sphmctl.errors import DeviceError
from sphmctl.wire import dxl, dxl_instructions

BITS_PER_BYTE = 10
"""8N1: start bit, eight data bits, stop bit."""

LINK_LATENCY_S = 0.015
"""What USB and the host may add to a transaction. An ATmega16U2 holds bytes back for up to 4.1 ms
(its timer), a host that is busy for some milliseconds more; an FTDI chip in its factory setting
16 ms, which `doctor` asks to change."""

STATUS_OVERHEAD_BYTES = 11
"""Status packet without data: header 4, id, length 2, instruction, error, CRC 2."""

BOARD_SILENCE_S = 2.0
"""Nothing is sent for so long after a board's port was opened. Opening resets an Arduino Mega,
whose bootloader listens for 0.84 s; a byte that it hears meanwhile keeps it there for 5 s, and a
ping every half second for ever (measured with Debian's; arduino/ArduinoCore-avr issue 172)."""

ATTEMPTS = 8
"""At rest, a lost reply is asked for so often in all, over a quarter of a second, which outlasts a
busy host; while streaming never again."""

LATE_TIMER_S = 0.003
"""A time limit that ends this late shows that this process slept: what came meanwhile is unread."""


class ServoBus:
    """A half-duplex bus behind a byte link.

    Args:
        opener: opens a fresh link.
        where: how messages name the port.
        baud: bits per second, for the time limits.
        return_delay_s: longest Return Delay Time of the servos.
        board_id: a board between port and servos, which stores each frame before it forwards it
            and must not hear a byte while it boots; None: a plain adapter.

    Attributes:
        byte_s: time of one byte on the wire.
    """

    def __init__(
        self,
        opener: LinkOpener,
        where: str,
        baud: int,
        return_delay_s: float = 0.000_510,
        board_id: int | None = None,
    ) -> None:
        self._opener = opener
        self._where = where
        self.byte_s = BITS_PER_BYTE / baud
        self._return_delay_s = return_delay_s
        self._board_id = board_id
        self._link: Link | None = None
        self._lock = asyncio.Lock()
        self._splitter = dxl.Splitter()
        self._statuses: dict[int, dxl.Status] = {}
        self._wanted: tuple[int, ...] = ()
        self._data_bytes = 0
        self._waiter: asyncio.Future[None] | None = None
        self._timer: asyncio.TimerHandle

    @property
    def connected(self) -> bool:
        """Whether frames can be sent."""
        return self._link is not None

    async def connect(self) -> None:
        """Open the port and let a board boot; does nothing when it is open.

        Raises:
            DeviceError: the port cannot be opened, or is lost meanwhile.
        """
        async with self._lock:
            if self._link is not None:
                return
            link = await self._opener()
            link.on_bytes = self._take
            link.on_lost = self._lose
            self._link = link
            if self._board_id is not None:
                await self._be_silent()

    async def _be_silent(self) -> None:
        """Leave a board that boots alone, and close when that is given up."""
        try:
            await asyncio.sleep(BOARD_SILENCE_S)
        except BaseException:
            await self.close()
            raise
        if self._link is None:
            raise DeviceError("the port was lost while the board booted", self._where)

    async def close(self) -> None:
        """Close the port; may be called again."""
        link, self._link = self._link, None
        if link is not None:
            # The old port's loss may be reported when a new one is open already.
            link.on_bytes, link.on_lost = ignore_bytes, ignore_loss
            link.close()
        self._expire()

    async def transact(
        self, frame: bytes, ids: tuple[int, ...], data_bytes: int
    ) -> dict[int, dxl.Status]:
        """Send `frame`, and collect one status of each id, until all are in or time is up.

        Args:
            frame: one or more complete instruction packets.
            ids: who answers, in bus order; empty for none.
            data_bytes: length of the data in each status.

        Returns:
            The statuses that came, by id: a silent servo is missing, and does not void the others.

        Raises:
            DeviceError: the port is lost.
        """
        async with self._lock:
            link = self._link
            if link is None:
                raise DeviceError("the port is lost", self._where)
            loop = asyncio.get_running_loop()
            self._splitter.discard()
            self._statuses = {}
            self._wanted, self._data_bytes = ids, data_bytes
            if not ids:
                link.write(frame)
                return {}
            waiter = self._waiter = loop.create_future()
            limit_s = self.limit_s(frame, len(ids), data_bytes)
            self._set_limit(limit_s, limit_s)
            try:
                link.write(frame)
                await waiter
            finally:
                self._timer.cancel()
                self._waiter = None
                self._wanted = ()
            if self._link is None:
                raise DeviceError("the port was lost during a transaction", self._where)
            if len(self._statuses) < len(ids):
                # A status has no number: a late one must come and go before anything else is asked.
                await asyncio.sleep(LINK_LATENCY_S)
            return self._statuses

    def limit_s(self, frame: bytes, replies: int, data_bytes: int) -> float:
        """How long a transaction may take: wire time, return delays, link latency."""
        reply_s = (STATUS_OVERHEAD_BYTES + data_bytes) * self.byte_s + self._return_delay_s
        return self.wire_s(frame) + replies * reply_s + LINK_LATENCY_S

    def wire_s(self, *frames: bytes) -> float:
        """How long frames sent at once are on the wire: the last takes effect at its end.

        A board forwards each when it has it whole: the longest is on the way twice.
        """
        sizes = [len(frame) for frame in frames]
        stored = 0 if self._board_id is None else max(sizes)
        return (sum(sizes) + stored) * self.byte_s

    async def ping(self, servo_id: int) -> dxl.Status | None:
        """The servo's answer to a ping (model number, firmware), or None."""
        return await self._insist(dxl_instructions.ping(servo_id), servo_id, 3)

    async def read(self, servo_id: int, address: int, size: int) -> bytes:
        """Read from a servo's table.

        Raises:
            DeviceError: it is silent or refuses.
        """
        status = await self._insist(dxl_instructions.read(servo_id, address, size), servo_id, size)
        return self._checked(status, servo_id, f"a read of address {address}", size)

    async def write(self, servo_id: int, address: int, data: bytes) -> None:
        """Write to a servo's table.

        Raises:
            DeviceError: it is silent or refuses.
        """
        status = await self._insist(dxl_instructions.write(servo_id, address, data), servo_id, 0)
        self._checked(status, servo_id, f"a write of address {address}", 0)

    async def _insist(self, frame: bytes, servo_id: int, data_bytes: int) -> dxl.Status | None:
        for _ in range(ATTEMPTS):
            statuses = await self.transact(frame, (servo_id,), data_bytes)
            if servo_id in statuses:
                return statuses[servo_id]
        return None

    def _checked(
        self, status: dxl.Status | None, servo_id: int, what: str, data_bytes: int
    ) -> bytes:
        kind = "board" if servo_id == self._board_id else "servo"
        if status is None:
            raise DeviceError(f"{kind} {servo_id} did not answer {what}", self._where)
        try:
            return dxl.expect_data(status, data_bytes)
        except DeviceError as error:
            message = f"{kind} {servo_id} refused {what}: {error.message}"
            raise DeviceError(message, self._where) from error

    def _take(self, data: bytes) -> None:
        self._splitter.feed(data)
        while (frame := self._splitter.next_frame()) is not None:
            try:
                status = dxl.parse_status(frame)
            except dxl.DxlProtocolError:
                # An adapter that echoes sends our own instruction back.
                continue
            fits = status.error or len(status.data) == self._data_bytes
            if fits and status.device_id in self._wanted:
                self._statuses[status.device_id] = status
        if len(self._statuses) == len(self._wanted):
            self._expire()

    def _set_limit(self, wait_s: float, again_s: float) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time() + wait_s
        self._timer = loop.call_at(due_s, self._time_out, due_s, again_s)

    def _time_out(self, due_s: float, again_s: float) -> None:
        """End the transaction; once, when the limit itself came late, wait as long again."""
        if again_s > 0.0 and asyncio.get_running_loop().time() - due_s > LATE_TIMER_S:
            self._set_limit(again_s, 0.0)
        else:
            self._expire()

    def _expire(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    def _lose(self) -> None:
        self._link = None
        self._expire()
