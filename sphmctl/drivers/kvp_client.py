"""Reads and writes KRL variables over KUKAVARPROXY: one connection, one request in flight.

Knows no robot. A request that fails in time or form closes the connection, because a late reply
could be taken for the next one's; `connect` opens a new one, which the owner does only at rest.
"""

from __future__ import annotations

import asyncio
import contextlib

from sphmctl.drivers.link import Link, LinkOpener, ignore_bytes, ignore_loss
from sphmctl.errors import DeviceError
from sphmctl.wire import kvp

REQUEST_TIMEOUT_S = 0.8
"""One request. The longest stall in 100,000 published reads on one connection is 0.03 s, on five
connections 0.62 s (ivareri/KUKAVARPROXY_tests): beyond this nothing will come any more."""

KEEP_ALIVE_S = 10.0
"""KUKAVARPROXY drops a client after 30 s of silence (ImtsSrl/KUKAVARPROXY issue 11)."""

SAME_INSTANT_S = 0.001
"""A keep-alive this early will do: a wait for a rounding error would never end."""


class KvpClient:
    """A client of one KUKAVARPROXY server.

    Args:
        opener: opens a fresh link to the server.
        where: how messages name the server.
        timeout_s: time limit of each request.
    """

    def __init__(self, opener: LinkOpener, where: str, timeout_s: float = REQUEST_TIMEOUT_S):
        self._opener = opener
        self._where = where
        self._timeout_s = timeout_s
        self._lock = asyncio.Lock()
        self._link: Link | None = None
        self._decoder = kvp.Decoder()
        self._waiter: asyncio.Future[kvp.Reply] | None = None
        self._waits_for = ""
        self._limit_s = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._request_id = 0
        self._last_used_s = 0.0
        self._keep_alive: asyncio.Task[None] | None = None
        self.requests = 0

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._link is not None

    async def connect(self) -> None:
        """Open the connection and see that a KUKAVARPROXY answers; does nothing when it is open."""
        if self._link is not None:
            return
        link = await self._opener()
        self._decoder = kvp.Decoder()
        link.on_bytes = self._take
        link.on_lost = self._lose
        self._link = link
        try:
            await self.ping()
        except BaseException:
            # A link whose first answer was wrong must not pass for an open connection.
            self._drop("the first PING was not answered")
            raise
        if self._keep_alive is None or self._keep_alive.done():
            self._keep_alive = asyncio.create_task(self._stay_alive(), name="kvp keep-alive")

    async def close(self) -> None:
        """Close the connection; may be called again."""
        task, self._keep_alive = self._keep_alive, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        self._drop("the connection was closed")

    async def read(self, name: str) -> str:
        """The value of a variable as text.

        Raises:
            DeviceError: no answer in time, a lost connection, or a variable that has no value.
        """
        self._request_id = self._request_id % 0xFFFF + 1
        frame = kvp.encode_read(self._request_id, name)
        return await self._request(frame, self._request_id, kvp.READ, name)

    async def write(self, name: str, value: str) -> None:
        """Write a variable; the server's word that it did is checked.

        Raises:
            DeviceError: no answer in time, a lost connection, or a refusal.
        """
        self._request_id = self._request_id % 0xFFFF + 1
        frame = kvp.encode_write(self._request_id, name, value)
        await self._request(frame, self._request_id, kvp.WRITE, name)

    async def ping(self) -> None:
        """Ask the server, not the robot, for a sign of life."""
        answer = await self.read("PING")
        if answer != "PONG":
            self._drop("a PING was not answered with PONG")
            raise DeviceError(f"a PING was answered with {answer!r}, not PONG", self._where)

    async def _request(self, frame: bytes, request_id: int, function: int, name: str) -> str:
        # `async with` would cost twice as much as this, in each cycle.
        await self._lock.acquire()
        try:
            link = self._link
            if link is None:
                raise DeviceError("the connection is lost", self._where)
            waiter = self._expect_reply(name)
            link.write(frame)
            reply = await waiter
        except asyncio.CancelledError:
            # The reply is still to come: on this connection it would meet the next request.
            self._drop("a request was given up")
            raise
        finally:
            self._waiter = None
            self._lock.release()
        self.requests += 1
        try:
            return kvp.reply_to_value(reply, request_id, function, name)
        except kvp.KvpProtocolError as error:
            self._drop(error.message)
            raise

    def _expect_reply(self, name: str) -> asyncio.Future[kvp.Reply]:
        loop = asyncio.get_running_loop()
        self._waiter, self._waits_for = loop.create_future(), name
        self._last_used_s = loop.time()
        self._limit_s = self._last_used_s + self._timeout_s
        # One timer serves many requests: to set and cancel it in each would cost as much as the
        # codec.
        if self._timer is None:
            self._timer = loop.call_at(self._limit_s, self._look_at_limit)
        return self._waiter

    def _take(self, data: bytes) -> None:
        try:
            self._decoder.feed(data)
            reply = self._decoder.next_reply()
        except DeviceError as error:
            self._drop(error.message)
            return
        if reply is not None and self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(reply)

    def _look_at_limit(self) -> None:
        timer, self._timer = self._timer, None
        if timer is None or self._waiter is None:
            return
        if timer.when() < self._limit_s:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_at(self._limit_s, self._look_at_limit)
            return
        name = self._waits_for
        self._drop(f"no answer to a request for {name} within {self._timeout_s:g} s")

    def _lose(self) -> None:
        self._drop("the connection was closed by the other side")

    def _drop(self, reason: str) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        link, self._link = self._link, None
        if link is not None:
            # The old link's loss may be reported when a new one is open already.
            link.on_bytes, link.on_lost = ignore_bytes, ignore_loss
            link.close()
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_exception(DeviceError(reason, self._where))

    async def _stay_alive(self) -> None:
        loop = asyncio.get_running_loop()
        while self._link is not None:
            left_s = self._last_used_s + KEEP_ALIVE_S - loop.time()
            if left_s > SAME_INSTANT_S:
                await asyncio.sleep(left_s)
            else:
                with contextlib.suppress(DeviceError):
                    await self.ping()
