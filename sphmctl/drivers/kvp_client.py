"""Reads and writes KRL variables over KUKAVARPROXY or C3 Bridge: one request in flight.

Finds out which server it is by reading, and asks C3 Bridge for several variables at once; knows no
robot. A request that fails in time or form closes the connection, because a late reply could be
taken for the next one's; `connect` opens a new one, which the owner does only at rest.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Literal, TypeVar

from sphmctl.drivers.link import Link, LinkOpener, ignore_bytes, ignore_loss
from sphmctl.errors import DeviceError
from sphmctl.wire import c3, kvp

REQUEST_TIMEOUT_S = 0.8
"""One request. The longest stall in 100,000 published reads on one connection is 0.03 s, on five
connections 0.62 s (ivareri/KUKAVARPROXY_tests): beyond this nothing will come any more."""

KEEP_ALIVE_S = 10.0
"""KUKAVARPROXY drops a client after 30 s of silence (ImtsSrl/KUKAVARPROXY issue 11)."""

SAME_INSTANT_S = 0.001
"""A keep-alive this early will do: a wait for a rounding error would never end."""


BATCH = 64
"""Variables in one request: at the 6 ms of the slowest in a thousand published accesses, a write
and its reading again for each take the whole of a request's time limit."""

Flavour = Literal["auto", "kvp", "c3"]
Result = TypeVar("Result")


class KvpClient:
    """A client of one variable server.

    Args:
        opener: opens a fresh link to the server.
        where: how messages name the server.
        timeout_s: time limit of each request.
        flavour: "kvp" for the functions that every server has, "c3" to insist on C3 Bridge's own,
            "auto" to use them where they are found.
    """

    def __init__(
        self,
        opener: LinkOpener,
        where: str,
        timeout_s: float = REQUEST_TIMEOUT_S,
        flavour: Flavour = "kvp",
    ):
        self._opener = opener
        self._where = where
        self._timeout_s = timeout_s
        self._lock = asyncio.Lock()
        self._link: Link | None = None
        self._wanted = flavour
        self._found = flavour == "kvp"
        self._c3 = False
        self._decoder: kvp.Decoder | c3.Decoder = kvp.Decoder()
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

    @property
    def flavour(self) -> Flavour:
        """Which functions are used: "kvp" or "c3"."""
        return "c3" if self._c3 else "kvp"

    async def connect(self) -> None:
        """Open the connection and see which server answers; does nothing when it is open.

        Raises:
            DeviceError: no server, or not the one that was asked for.
        """
        if self._link is not None:
            return
        link = await self._opener()
        self._decoder = c3.Decoder() if self._c3 else kvp.Decoder()
        link.on_bytes = self._take
        link.on_lost = self._lose
        self._link = link
        try:
            await self.ping()
            # To connect again is urgent while an arm brakes, and a server does not change.
            if not self._found:
                self._c3 = await self._is_c3()
                self._found = True
        except BaseException:
            # A link whose first answers were wrong must not pass for an open connection.
            self._drop("the first requests were not answered")
            raise
        if self._c3:
            self._decoder = c3.Decoder()
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
        number = self._next_id()
        if self._c3:
            frame = c3.encode_read(number, name)
            values = await self._request(
                frame, name, lambda reply: c3.reply_to_values(reply, number, c3.READ, (name,))
            )
            return values[0]
        return await self._request(
            kvp.encode_read(number, name),
            name,
            lambda reply: kvp.reply_to_value(reply, number, kvp.READ, name),
        )

    async def write(self, name: str, value: str) -> None:
        """Write a variable; the server's word that it did is checked.

        Raises:
            DeviceError: no answer in time, a lost connection, or a refusal.
        """
        number = self._next_id()
        if self._c3:
            frame = c3.encode_write(number, name, value)
            await self._request(
                frame, name, lambda reply: c3.reply_to_values(reply, number, c3.WRITE, (name,))
            )
            return
        await self._request(
            kvp.encode_write(number, name, value),
            name,
            lambda reply: kvp.reply_to_value(reply, number, kvp.WRITE, name),
        )

    async def read_many(self, names: Sequence[str]) -> list[str]:
        """The values of several variables, in one request where the server can.

        Raises:
            DeviceError: as for `read`, of the first variable that is to blame.
        """
        if not self._c3:
            return [await self.read(name) for name in names]
        values: list[str] = []
        for at in range(0, len(names), BATCH):
            values += await self._read_batch(names[at : at + BATCH])
        return values

    async def write_many(self, values: Sequence[tuple[str, str]]) -> None:
        """Write several variables in this order, in one request where the server can.

        C3 Bridge goes on after a refused one and reads each again: where the order guards a motion,
        or time matters, write one by one.

        Raises:
            DeviceError: as for `write`, of the first variable that is to blame.
        """
        if not self._c3:
            for name, value in values:
                await self.write(name, value)
            return
        for at in range(0, len(values), BATCH):
            await self._write_batch(values[at : at + BATCH])

    async def ping(self) -> None:
        """Ask the server, not the robot, for a sign of life."""
        answer = await self.read("PING")
        if answer != "PONG":
            self._drop("a PING was not answered with PONG")
            raise DeviceError(f"a PING was answered with {answer!r}, not PONG", self._where)

    async def _is_c3(self) -> bool:
        """Whether C3 Bridge's functions may be used; asked with a read that every server has."""
        kind = await self._word("@PROXY_TYPE")
        version = await self._word("@PROXY_VERSION") if kind == c3.TYPE else ""
        right = kind == c3.TYPE and c3.version(version) >= c3.FIRST_RIGHT_VERSION
        if not right and self._wanted == "c3":
            first = ".".join(str(part) for part in c3.FIRST_RIGHT_VERSION)
            raise DeviceError(
                f"flavour is c3, but the server says it is {f'{kind} {version}'.strip()!r}; "
                f"C3 Bridge from version {first} on, or flavour auto, would be right",
                self._where,
            )
        return right

    async def _word(self, name: str) -> str:
        """What the server says of itself; empty where it does not know the word."""
        try:
            return await self.read(name)
        except (kvp.VariableEmptyError, kvp.VariableRefusedError):
            return ""

    async def _read_batch(self, names: Sequence[str]) -> list[str]:
        number = self._next_id()
        return await self._request(
            c3.encode_read_many(number, names),
            ", ".join(names),
            lambda reply: c3.reply_to_values(reply, number, c3.READ_MANY, names),
        )

    async def _write_batch(self, values: Sequence[tuple[str, str]]) -> None:
        number = self._next_id()
        names = [name for name, _ in values]
        await self._request(
            c3.encode_write_many(number, values),
            ", ".join(names),
            lambda reply: c3.reply_to_values(reply, number, c3.WRITE_MANY, names),
        )

    def _next_id(self) -> int:
        self._request_id = self._request_id % 0xFFFF + 1
        return self._request_id

    async def _request(
        self, frame: bytes, name: str, judge: Callable[[kvp.Reply], Result]
    ) -> Result:
        """Send one request; what `judge` makes of its reply."""
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
            return judge(reply)
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
