"""Byte pipes: real sockets on the loopback, real pseudo-terminals, and memory."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sphmctl import clock
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.drivers.link import Link, StreamLink, memory_pair, open_serial, open_tcp
from sphmctl.errors import DeviceError

LIMIT_S = 2.0


class Taker:
    """Collects what a link delivers."""

    def __init__(self, link: Link) -> None:
        self.data = b""
        self.lost = 0
        self._news = asyncio.Event()
        link.on_bytes, link.on_lost = self._take, self._lose

    async def until(self, met: Callable[[], bool]) -> None:
        """Wait for a condition on what came."""
        async with asyncio.timeout(LIMIT_S):
            while not met():
                self._news.clear()
                await self._news.wait()

    def _take(self, data: bytes) -> None:
        self.data += data
        self._news.set()

    def _lose(self) -> None:
        self.lost += 1
        self._news.set()


@contextmanager
def listener() -> Iterator[tuple[socket.socket, int]]:
    """A TCP listener on the loopback that accepts nobody by itself."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server, server.getsockname()[1]


def closed_port() -> int:
    """A port at which nothing listens."""
    with listener() as (_, port):
        return port


def test_a_closed_port_is_told_in_one_sentence() -> None:
    port = closed_port()
    with pytest.raises(DeviceError) as raised:
        clock.run(open_tcp("127.0.0.1", port, LIMIT_S))
    assert str(raised.value) == (
        f"controller 127.0.0.1:{port}: nothing listens there; is KUKAVARPROXY running, "
        "and is the port right?"
    )
    assert raised.value.exit_code == 5


def test_a_silent_listener_fails_on_the_ping() -> None:
    async def main(port: int) -> None:
        async def connect() -> Link:
            return await open_tcp("127.0.0.1", port, LIMIT_S)

        client = KvpClient(connect, f"controller 127.0.0.1:{port}", timeout_s=0.05)
        with pytest.raises(DeviceError, match=r"no answer to a request for PING within 0\.05 s"):
            await client.connect()
        assert not client.connected

    with listener() as (_, port):
        clock.run(main(port))


def test_tcp_carries_bytes_both_ways_at_once_and_tells_its_loss_once() -> None:
    async def main() -> None:
        with listener() as (server, port):
            link = await open_tcp("127.0.0.1", port, LIMIT_S)
            taker = Taker(link)
            there, _ = server.accept()
            with there:
                there.setblocking(True)
                link.write(b"one frame")
                assert there.recv(100) == b"one frame"
                there.sendall(b"a reply")
                await taker.until(lambda: taker.data == b"a reply")
            await taker.until(lambda: taker.lost == 1)
            link.write(b"dropped")
            link.close()
            link.close()
            await asyncio.sleep(0)
            assert taker.lost == 1

    clock.run(main())


def test_tcp_sends_each_frame_at_once() -> None:
    async def main() -> None:
        with listener() as (_, port):
            link = await open_tcp("127.0.0.1", port, LIMIT_S)
            assert isinstance(link, StreamLink)
            assert link._transport is not None
            wire = link._transport.get_extra_info("socket")
            assert wire.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
            link.close()
            await asyncio.sleep(0)

    clock.run(main())


@contextmanager
def terminal() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: the device's end, and the path of the host's."""
    device, host = os.openpty()
    try:
        yield device, os.ttyname(host)
    finally:
        os.close(device)
        os.close(host)


def _serial(port: str, test: Callable[[Link], Awaitable[None]] | None = None) -> None:
    async def main() -> None:
        link = await open_serial(port, 1_000_000, LIMIT_S)
        try:
            if test is not None:
                await test(link)
        finally:
            link.close()
            await asyncio.sleep(0)

    clock.run(main())


def test_a_serial_port_carries_any_byte_both_ways() -> None:
    everything = bytes(range(256))
    with terminal() as (device, port):

        async def test(link: Link) -> None:
            taker = Taker(link)
            os.set_blocking(device, False)
            arrived = b""
            link.write(everything)
            async with asyncio.timeout(LIMIT_S):
                while len(arrived) < len(everything):
                    await asyncio.sleep(0)
                    with contextlib.suppress(BlockingIOError):
                        arrived += os.read(device, 1000)
            assert arrived == everything
            os.write(device, everything)
            await taker.until(lambda: len(taker.data) >= 256)
            assert taker.data == everything

        _serial(port, test)


def test_a_missing_serial_port_is_told_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DeviceError) as raised:
        _serial(str(tmp_path / "ttyUSB0"))
    assert str(raised.value) == (
        f"serial port {tmp_path}/ttyUSB0: there is no such port; is the cable in, "
        "and is the name right?"
    )


def test_a_serial_port_in_use_is_told_in_one_sentence() -> None:
    with terminal() as (_, port):

        async def test(link: Link) -> None:
            with pytest.raises(DeviceError, match="in use by another program; close that first"):
                await open_serial(port, 1_000_000, LIMIT_S)

        _serial(port, test)
        # Given back, it can be opened again.
        _serial(port)


def test_a_serial_port_without_permission_is_told_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # What the kernel answers to a user outside the group; root would be let in.
    def denied(path: str, flags: int, *args: int) -> int:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)

    with monkeypatch.context() as patch:
        patch.setattr("serial.serialposix.os.open", denied)
        with pytest.raises(DeviceError, match="add your user to the group dialout"):
            _serial("/dev/ttyUSB0")


@pytest.mark.parametrize("name", ["/dev/null", "file", "folder", "nonsense://x", ""])
def test_what_is_no_serial_port_is_an_error_and_not_a_traceback(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    port = str(tmp_path / name) if name in ("file", "folder") else name
    with pytest.raises(DeviceError, match="serial port"):
        _serial(port)


def test_a_serial_port_that_vanishes_tells_its_loss() -> None:
    device, host = os.openpty()
    port = os.ttyname(host)

    async def test(link: Link) -> None:
        taker = Taker(link)
        os.close(host)
        os.close(device)
        await taker.until(lambda: taker.lost == 1)
        link.write(b"dropped")

    _serial(port, test)


def test_a_memory_link_delivers_in_order_in_the_next_turn() -> None:
    async def main() -> None:
        here, there = memory_pair()
        taker = Taker(there)
        here.write(b"a")
        here.write(b"b")
        assert taker.data == b""
        await asyncio.sleep(0)
        assert taker.data == b"ab"

    clock.run(main(), virtual=True)


def test_closing_a_memory_link_tells_the_other_end_once_and_drops_what_follows() -> None:
    async def main() -> None:
        here, there = memory_pair()
        mine, theirs = Taker(here), Taker(there)
        here.close()
        here.close()
        there.write(b"dropped")
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert (mine.lost, theirs.lost, mine.data) == (0, 1, b"")

    clock.run(main(), virtual=True)
