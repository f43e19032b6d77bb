"""Clients on in-memory pipes to an emulated KUKAVARPROXY, on the virtual clock."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable

from sphmctl.clock import run
from sphmctl.emulators.controller import Controller
from sphmctl.emulators.kvp_flavour import Flavour
from sphmctl.emulators.kvp_server import FlavourName, KvpServer, Latency
from sphmctl.emulators.world import World


class Client:
    """A client's end of a pipe, and the pipe: what came back, and when."""

    def __init__(self) -> None:
        self.on_bytes: Callable[[bytes], None] = lambda data: None
        self.on_lost: Callable[[], None] = lambda: None
        self.closed = False
        self.replies: list[bytes] = []
        self.times_s: list[float] = []
        self.answered = asyncio.Event()

    def write(self, data: bytes) -> None:
        self.replies.append(data)
        self.times_s.append(asyncio.get_running_loop().time())
        self.answered.set()

    def close(self) -> None:
        self.closed = True

    def send(self, text: str) -> None:
        """Send bytes given in hexadecimal."""
        self.on_bytes(bytes.fromhex(text))

    async def waited_ms(self, request: bytes) -> float:
        """Send, and the time until the reply."""
        begin_s = asyncio.get_running_loop().time()
        self.answered.clear()
        self.on_bytes(request)
        await self.answered.wait()
        return (self.times_s[-1] - begin_s) * 1e3

    def ask(self, text: str) -> str:
        """Send, and take the replies that came at once, in hexadecimal."""
        del self.replies[:]
        self.send(text)
        return b"".join(self.replies).hex(" ")


def frame(request_id: int, function: int, *blocks: bytes) -> bytes:
    body = bytes((function,)) + b"".join(len(b).to_bytes(2, "big") + b for b in blocks)
    return request_id.to_bytes(2, "big") + len(body).to_bytes(2, "big") + body


class Cell:
    """A controller and its server inside the running loop."""

    def __init__(
        self,
        latency: Latency,
        discard_while_busy: bool,
        flavour: FlavourName | Callable[[Controller], Flavour],
    ) -> None:
        self.world = World(asyncio.get_running_loop().time)
        self.controller = Controller(self.world, random.Random(5))
        self.server = KvpServer(
            self.controller,
            self.world,
            random.Random(6),
            latency,
            discard_while_busy=discard_while_busy,
            flavour=flavour(self.controller) if callable(flavour) else flavour,
        )

    def client(self) -> Client:
        client = Client()
        self.server.attach(client)
        return client


def on_cell(
    story: Callable[[Cell], Awaitable[None]],
    latency: Latency = "none",
    discard_while_busy: bool = False,
    flavour: FlavourName | Callable[[Controller], Flavour] = "kvp",
) -> None:
    """Run a story on a cell of its own, on the virtual clock."""

    async def main() -> None:
        cell = Cell(latency, discard_while_busy, flavour)
        await story(cell)
        await cell.server.close()

    run(main(), virtual=True)
