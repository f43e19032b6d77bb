"""The emulated controller over loopback TCP: py-openshowvar, unchanged, and the bare transport."""

from __future__ import annotations

import asyncio
import random
import socket
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from py_openshowvar import openshowvar

from sphmctl.emulators.controller import Controller
from sphmctl.emulators.kvp_server import KvpServer, Latency
from sphmctl.emulators.world import World

pytestmark = pytest.mark.realtime

HOST = "127.0.0.1"


def on_server(
    story: Callable[[KvpServer, int], Awaitable[None]], latency: Latency = "none"
) -> None:
    """Run a story against a server on a free port."""

    async def main() -> None:
        world = World(asyncio.get_running_loop().time)
        controller = Controller(world, random.Random(5))
        server = KvpServer(controller, world, random.Random(6), latency)
        port = await server.serve_tcp(HOST)
        try:
            await story(server, port)
        finally:
            await server.close()
            await server.close()

    asyncio.run(asyncio.wait_for(main(), 20.0))


@pytest.mark.parametrize("latency", ["none", "measured"])
def test_py_openshowvar_reads_and_writes(latency: Latency) -> None:
    def talk(port: int) -> list[Any]:
        client = openshowvar(HOST, port)
        try:
            return [
                client.read("$OV_PRO", debug=False),
                client.write("$OV_PRO", "42", debug=False),
                client.read("$ov_pro", debug=False),
                client.read("$AXIS_ACT", debug=False),
                client.read("$MODE_OP", debug=False),
                client.write("SPH_KNOT[2].Q", "{E6AXIS: A1 1.5, A2 -90}", debug=False),
                client.read("SPH_KNOT[2].Q", debug=False),
                client.write("$AXIS_ACT", "{A1 0}", debug=False),
                client.read("NOSUCH", debug=False),
            ]
        finally:
            client.close()

    async def story(_: KvpServer, port: int) -> None:
        said = await asyncio.to_thread(talk, port)
        axes = ["0.0", "-90.0000", "90.0000", "0.0", "90.0000", "0.0"]
        shown = [f"A{n} {q}" for n, q in enumerate(axes, start=1)]
        shown += [f"E{n} 0.0" for n in range(1, 7)]
        assert said == [
            b"100",
            b"42",
            b"42",
            f"{{E6AXIS: {', '.join(shown)}}}".encode(),
            b"#EX",
            b"{E6AXIS: A1 1.5, A2 -90}",
            b"{E6AXIS: A1 1.50000, A2 -90.0000}",
            None,
            b"",
        ]

    on_server(story, latency)


def test_a_port_in_use_is_an_error_of_the_caller() -> None:
    async def story(server: KvpServer, port: int) -> None:
        world = World(asyncio.get_running_loop().time)
        second = KvpServer(Controller(world, random.Random(1)), world, random.Random(1))
        with pytest.raises(OSError, match="in use"):
            await second.serve_tcp(HOST, port)
        await second.close()

    on_server(story)


def test_the_eleventh_connection_is_accepted_and_closed() -> None:
    async def story(server: KvpServer, port: int) -> None:
        links = [await asyncio.open_connection(HOST, port) for _ in range(11)]
        assert await links[10][0].read(1) == b""
        for reader, writer in links[:10]:
            writer.write(bytes.fromhex("0007 0007 00 0004 50494e47"))
            reply = await reader.readexactly(14)
            assert reply == bytes.fromhex("0007 000a 00 0004 504f4e47 000101")
        for _, writer in links:
            writer.close()
            await writer.wait_closed()

    on_server(story)


def test_connections_are_without_nagles_delay() -> None:
    async def story(server: KvpServer, port: int) -> None:
        options: list[int] = []
        connected = asyncio.Event()

        class Spy(asyncio.Protocol):
            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                sock = transport.get_extra_info("socket")
                options.append(sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
                connected.set()
                transport.close()

        loop = asyncio.get_running_loop()
        listener = await loop.create_server(Spy, HOST, 0)
        _, writer = await asyncio.open_connection(*listener.sockets[0].getsockname())
        await connected.wait()
        writer.close()
        listener.close()
        assert options == [1]

    on_server(story)


def test_closing_the_server_hangs_up_on_its_clients() -> None:
    async def story(server: KvpServer, port: int) -> None:
        reader, writer = await asyncio.open_connection(HOST, port)
        writer.write(bytes.fromhex("0007 0007 00 0004 50494e47"))
        await reader.readexactly(14)
        await server.close()
        assert await reader.read(1) == b""
        writer.close()
        await writer.wait_closed()
        with pytest.raises(OSError, match=r"(?i)refused|connect"):
            await asyncio.open_connection(HOST, port)

    on_server(story)
