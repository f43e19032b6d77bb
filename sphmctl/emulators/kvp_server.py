"""The network side of the emulated controller: a variable server of either flavour, with quirks.

Connections, one queue for all of them, and time; frames and their meaning are the flavour's.
Behaviour after ImtsSrl/KUKAVARPROXY, src/frmMain.frm (release of 2019), and ulsu-tech/
c3bridge-server, source/client.cpp (1.4.0). Not modelled: UDP discovery, and KUKAVARPROXY's count
of clients that may drift after a rejected one.
"""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable
from typing import Literal, Protocol

from sphmctl.emulators.controller import Controller
from sphmctl.emulators.kvp_c3 import C3
from sphmctl.emulators.kvp_flavour import Flavour, HangUpError, Job, UnansweredError
from sphmctl.emulators.kvp_service import Kvp
from sphmctl.emulators.world import World

IDLE_CHECK_S = 1.0
"""Interval of KUKAVARPROXY's timer that looks for idle clients; C3 Bridge's is taken as the same.
"""

INBOX_LIMIT = 4 + 0xFFFF
"""Bytes that a socket keeps for a busy server, the longest message of C3 Bridge; a client that
sends more unasked is cut off here."""

Latency = Literal["measured", "none"]
FlavourName = Literal["kvp", "c3"]


class Pipe(Protocol):
    """An in-memory byte pipe to one client; the server sets the two callbacks."""

    on_bytes: Callable[[bytes], None]
    on_lost: Callable[[], None]

    def write(self, data: bytes) -> None:
        """Send to the client."""

    def close(self) -> None:
        """Hang up."""


class _Client:
    """One connection: how to answer and end it, and what it sent that was not yet read."""

    def __init__(self, write: Callable[[bytes], None], close: Callable[[], None]) -> None:
        self.write = write
        self.close = close
        self.inbox = b""
        self.queued = False
        self.sending = False
        self.heard_s = 0.0


class KvpServer:
    """A variable server in front of one controller; made inside the running loop.

    Args:
        controller: whose variables it shows.
        world: brought to the present before each access to a variable.
        rng: draws the service times.
        latency: "measured", or "none" for replies within the call that brings the request.
        discard_while_busy: forget what arrives while another request is inside the controller, as
            the source says ("Reading pending") and no measurement has shown.
        flavour: "kvp", "c3", or one with settings of its own.
    """

    def __init__(
        self,
        controller: Controller,
        world: World,
        rng: random.Random,
        latency: Latency = "measured",
        *,
        discard_while_busy: bool = False,
        flavour: FlavourName | Flavour = "kvp",
    ) -> None:
        if flavour == "kvp":
            flavour = Kvp(controller.store, rng)
        elif flavour == "c3":
            flavour = C3(controller, rng)
        self._flavour: Flavour = flavour
        self._world = world
        self._instant = latency == "none"
        self._discard = discard_while_busy
        self._loop = asyncio.get_running_loop()
        self._start_s = self._loop.time()
        self._clients: set[_Client] = set()
        self._queue: deque[_Client] = deque()
        self._event: deque[Job] = deque()
        self._present: _Client | None = None
        self._busy = False
        self._service: asyncio.TimerHandle | None = None
        self._idle_check: asyncio.TimerHandle | None = None
        self._listener: asyncio.Server | None = None

    @property
    def clients(self) -> int:
        """Clients that are connected."""
        return len(self._clients)

    async def serve_tcp(self, host: str = "127.0.0.1", port: int = 0) -> int:
        """Listen; returns the port, which the system chooses for 0.

        Raises:
            OSError: when the port is in use.
        """
        self._listener = await self._loop.create_server(lambda: _TcpClient(self), host, port)
        bound: int = self._listener.sockets[0].getsockname()[1]
        return bound

    def attach(self, pipe: Pipe) -> None:
        """Take a client that is connected by an in-memory pipe."""
        client = self.accept(pipe.write, pipe.close)
        if client is None:
            pipe.on_bytes, pipe.on_lost = lambda data: None, lambda: None
        else:
            pipe.on_bytes = lambda data: self.received(client, data)
            pipe.on_lost = lambda: self.lost(client)

    async def close(self) -> None:
        """Stop listening and hang up on everybody; may be called again."""
        for timer in (self._service, self._idle_check):
            if timer is not None:
                timer.cancel()
        self._service = self._idle_check = None
        if self._listener is not None:
            self._listener.close()
        for client in tuple(self._clients):
            self._drop(client)
        if self._listener is not None:
            await self._listener.wait_closed()
            self._listener = None
        # The transports report their end in the loop's next turn.
        await asyncio.sleep(0)

    def accept(self, write: Callable[[bytes], None], close: Callable[[], None]) -> _Client | None:
        """A new connection; None when there are too many, and it was closed."""
        if len(self._clients) >= self._flavour.clients_limit:
            close()
            return None
        client = _Client(write, close)
        client.heard_s = self._loop.time()
        self._clients.add(client)
        if self._idle_check is None:
            self._plan_idle_check()
        return client

    def received(self, client: _Client, data: bytes) -> None:
        """Bytes from a client: they wait in its socket until the server reads them."""
        if client not in self._clients or (self._busy and self._discard):
            return
        if client.sending and self._flavour.deaf_while_sending:
            return
        client.inbox += data
        client.heard_s = self._loop.time()
        if len(client.inbox) > INBOX_LIMIT:
            self._drop(client)
            return
        self._enqueue(client)
        if not self._busy:
            self._serve()

    def lost(self, client: _Client) -> None:
        """The client's connection has ended."""
        self._clients.discard(client)
        client.inbox = b""

    def _drop(self, client: _Client) -> None:
        self.lost(client)
        client.close()

    def _enqueue(self, client: _Client) -> None:
        if not client.queued:
            client.queued = True
            self._queue.append(client)

    def _serve(self) -> None:
        """Work on the queue until it is empty or a request takes its time."""
        self._busy = True
        while self._event or self._next_event():
            if not self._instant:
                delay_s = self._event[0].service_s()
                self._service = self._loop.call_later(delay_s, self._serviced)
                return
            self._finish()
        self._busy = False

    def _serviced(self) -> None:
        self._service = None
        self._finish()
        self._serve()

    def _next_event(self) -> bool:
        """Read once from the next client's socket; False when nobody waits."""
        while self._queue:
            client = self._queue.popleft()
            client.queued = False
            if client not in self._clients:
                continue
            jobs, client.inbox, again, hang_up = self._flavour.take(client.inbox)
            if hang_up:
                self._drop(client)
                continue
            if again:
                self._enqueue(client)
            client.heard_s = self._loop.time()
            self._event.extend(jobs)
            self._present = client
            if self._event:
                return True
        return False

    def _finish(self) -> None:
        """Access the variables now, and answer."""
        job, client = self._event.popleft(), self._present
        self._world.advance()
        try:
            reply = job.run()
        except UnansweredError:
            self._event.clear()
            return
        except HangUpError:
            self._event.clear()
            if client is not None and client in self._clients:
                self._drop(client)
            return
        if client is not None and client in self._clients:
            client.heard_s = self._loop.time()
            client.write(reply)

    def _plan_idle_check(self) -> None:
        passed_s = self._loop.time() - self._start_s
        checks = int(passed_s / IDLE_CHECK_S + 1e-9) + 1
        at_s = self._start_s + checks * IDLE_CHECK_S
        self._idle_check = self._loop.call_at(at_s, self._check_idle)

    def _check_idle(self) -> None:
        self._idle_check = None
        now_s = self._loop.time()
        for client in tuple(self._clients):
            begun = bool(client.inbox)
            limit_s = self._flavour.message_limit_s if begun else self._flavour.idle_limit_s
            if now_s - client.heard_s > limit_s:
                self._drop(client)
        if self._clients:
            self._plan_idle_check()


class _TcpClient(asyncio.Protocol):
    """One TCP connection of the server; asyncio sets TCP_NODELAY on it by itself."""

    def __init__(self, server: KvpServer) -> None:
        self._server = server
        self._client: _Client | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if isinstance(transport, asyncio.Transport):
            # Every byte that the system does not take at once counts as not yet sent.
            transport.set_write_buffer_limits(high=0)
            self._client = self._server.accept(transport.write, transport.close)

    def data_received(self, data: bytes) -> None:
        if self._client is not None:
            self._server.received(self._client, data)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._client is not None:
            self._server.lost(self._client)

    def pause_writing(self) -> None:
        if self._client is not None:
            self._client.sending = True

    def resume_writing(self) -> None:
        if self._client is not None:
            self._client.sending = False
