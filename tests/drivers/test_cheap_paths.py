"""What the drivers do to be cheap in each cycle, where it could go wrong: limits and writes."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable

import pytest

from sphmctl import clock
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.drivers.link import Link, open_serial
from sphmctl.errors import DeviceError
from tests.drivers.far_end import FarEnd, kvp_name, kvp_reply

TIMEOUT_S = 0.8
OPEN_LIMIT_S = 5.0
MORE_THAN_A_TERMINAL_TAKES = 200_000


def _server(far: FarEnd, request: bytes) -> None:
    """Answers a PING at once, SLOW late but in time, and nothing else."""
    name = kvp_name(request)
    if name == "PING":
        far.send(kvp_reply(request, "PONG"))
    elif name == "SLOW":
        far.send(kvp_reply(request, "1"), after_s=0.75 * TIMEOUT_S)


def test_each_request_has_the_whole_limit_whatever_came_before() -> None:
    async def main() -> float:
        client = KvpClient(FarEnd(_server).open, "controller", TIMEOUT_S)
        await client.connect()
        for _ in range(5):
            assert await client.read("SLOW") == "1"
        loop = asyncio.get_running_loop()
        asked_s = loop.time()
        with pytest.raises(DeviceError, match=r"no answer to a request for SILENT within 0\.8 s"):
            await client.read("SILENT")
        took_s = loop.time() - asked_s
        await client.close()
        return took_s

    assert clock.run(main(), virtual=True) == pytest.approx(TIMEOUT_S, abs=1e-6)


def test_a_limit_does_not_outlive_its_connection() -> None:
    async def main() -> str:
        far = FarEnd(_server)
        client = KvpClient(far.open, "controller", TIMEOUT_S)
        await client.connect()
        await client.close()
        await asyncio.sleep(0.5 * TIMEOUT_S)
        await client.connect()
        await asyncio.sleep(0.25 * TIMEOUT_S)
        # The first connection's limit passes while this request is under way.
        value = await client.read("SLOW")
        await client.close()
        return value

    assert clock.run(main(), virtual=True) == "1"


def _on_terminal(story: Callable[[Link, int], Awaitable[None]]) -> None:
    async def main() -> None:
        device, host = os.openpty()
        os.set_blocking(device, False)
        try:
            link = await open_serial(os.ttyname(host), 1_000_000, OPEN_LIMIT_S)
            try:
                async with asyncio.timeout(OPEN_LIMIT_S):
                    await story(link, device)
            finally:
                link.close()
                await asyncio.sleep(0)
        finally:
            os.close(device)
            os.close(host)

    clock.run(main())


def test_a_serial_frame_leaves_before_the_loops_next_turn() -> None:
    async def story(link: Link, device: int) -> None:
        link.write(b"frame")
        assert os.read(device, 100) == b"frame"

    _on_terminal(story)


def test_what_a_serial_port_does_not_take_at_once_follows_in_order() -> None:
    async def story(link: Link, device: int) -> None:
        sent = bytes(range(256)) * (MORE_THAN_A_TERMINAL_TAKES // 256)
        link.write(sent)
        link.write(b"the end")
        got = bytearray()
        while len(got) < len(sent) + 7:
            try:
                got += os.read(device, 65_536)
            except BlockingIOError:
                await asyncio.sleep(0)
        assert bytes(got) == sent + b"the end"

    _on_terminal(story)


def test_a_closed_serial_link_sends_nothing_more() -> None:
    async def story(link: Link, device: int) -> None:
        link.close()
        link.write(b"too late")
        await asyncio.sleep(0)
        with pytest.raises(BlockingIOError):
            os.read(device, 100)

    _on_terminal(story)
