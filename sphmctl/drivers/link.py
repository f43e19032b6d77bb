"""Byte pipes to a device: TCP, serial port, memory. Knows nothing of what the bytes mean."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
import termios
from collections.abc import Awaitable, Callable
from typing import Protocol

from sphmctl.errors import DeviceError


class Link(Protocol):
    """A connected byte pipe; its owner sets both callbacks before the first byte can arrive."""

    on_bytes: Callable[[bytes], None]
    on_lost: Callable[[], None]

    def write(self, data: bytes) -> None:
        """Send `data` in one piece; after the loss of the link it is dropped."""

    def close(self) -> None:
        """Close; may be called again."""


LinkOpener = Callable[[], Awaitable[Link]]
"""Opens a fresh link, or raises DeviceError."""


def ignore_bytes(data: bytes) -> None:
    """What a link does with bytes until somebody wants them: nothing."""


def ignore_loss() -> None:
    """What a link does about its loss until somebody wants to know: nothing."""


class StreamLink(asyncio.Protocol):
    """A link over an asyncio transport, socket or serial port alike."""

    def __init__(self) -> None:
        self.on_bytes: Callable[[bytes], None] = ignore_bytes
        self.on_lost: Callable[[], None] = ignore_loss
        self.connected = asyncio.get_running_loop().create_future()
        self._transport: asyncio.WriteTransport | None = None
        self._serial_file: int | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.WriteTransport)
        self._transport = transport
        port = transport.get_extra_info("serial")
        self._serial_file = None if port is None else port.fileno()
        if not self.connected.done():
            self.connected.set_result(None)

    def data_received(self, data: bytes) -> None:
        self.on_bytes(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self.on_lost()

    def write(self, data: bytes) -> None:
        """Send `data` in one piece."""
        transport = self._transport
        if transport is None:
            return
        if self._serial_file is not None and transport.get_write_buffer_size() == 0:
            # pyserial-asyncio sends in the loop's next turn, a quarter of a cycle's cost later.
            data = data[_sent(self._serial_file, data) :]
        if data:
            transport.write(data)

    def close(self) -> None:
        """Drop what is unsent and close."""
        self._serial_file = None
        if self._transport is not None:
            self._transport.abort()


def _sent(file: int, data: bytes) -> int:
    """How many bytes went out at once; what is wrong, if anything, the transport finds out."""
    try:
        return os.write(file, data)
    except OSError:
        return 0


async def open_tcp(host: str, port: int, timeout_s: float) -> Link:
    """Connect to a TCP server.

    Raises:
        DeviceError: nothing listens there, or no answer within `timeout_s`.
    """
    where = f"controller {host}:{port}"
    try:
        async with asyncio.timeout(timeout_s):
            transport, link = await asyncio.get_running_loop().create_connection(
                StreamLink, host, port
            )
    except TimeoutError as error:
        raise DeviceError(f"no connection within {timeout_s:g} s", where) from error
    except OSError as error:
        raise DeviceError(_tcp_reason(error), where) from error
    # The server parses each TCP read event by itself, so a frame must leave at once and whole.
    transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


def _tcp_reason(error: OSError) -> str:
    if isinstance(error, socket.gaierror):
        return "no such host; give the controller's address in arm.host"
    if error.errno == errno.ECONNREFUSED:
        return "nothing listens there; is KUKAVARPROXY running, and is the port right?"
    return f"{error.strerror or error}; is the controller on, and the cable in?"


async def open_serial(port: str, baud: int, timeout_s: float) -> Link:
    """Open a serial port for this process alone.

    Raises:
        DeviceError: there is no such port, it is in use, or it may not be opened.
    """
    import serial
    import serial_asyncio

    where = f"serial port {port}"
    loop = asyncio.get_running_loop()
    try:
        _, link = await serial_asyncio.create_serial_connection(
            loop, StreamLink, url=port, baudrate=baud, exclusive=True
        )
    except (serial.SerialException, termios.error) as error:
        raise DeviceError(_serial_reason(error), where) from error
    except ValueError as error:
        # A name with "://" in it, or a rate that the port cannot have.
        raise DeviceError(f"{error}; give the path of a serial device", where) from error
    assert isinstance(link, StreamLink)
    # create_serial_connection returns before connection_made has run.
    try:
        async with asyncio.timeout(timeout_s):
            await link.connected
    except TimeoutError as error:
        raise DeviceError(f"it did not open within {timeout_s:g} s", where) from error
    return link


def _serial_reason(error: Exception) -> str:
    if "Inappropriate ioctl" in str(error):
        return "it is no serial port; give the device of the servos' adapter"
    if not isinstance(error, OSError):
        return str(error)
    if error.errno == errno.ENOENT:
        return "there is no such port; is the cable in, and is the name right?"
    if error.errno == errno.EACCES:
        return "no permission to open it; add your user to the group dialout and log in again"
    if error.errno == errno.EBUSY or "exclusively lock" in str(error):
        return "it is in use by another program; close that first"
    return str(error)


class MemoryLink:
    """One end of a pipe inside the process; made in pairs by `memory_pair`."""

    def __init__(self) -> None:
        self.on_bytes: Callable[[bytes], None] = ignore_bytes
        self.on_lost: Callable[[], None] = ignore_loss
        self._peer: MemoryLink | None = None

    def join(self, peer: MemoryLink) -> None:
        """Be the other end of `peer`."""
        self._peer = peer

    def write(self, data: bytes) -> None:
        """Deliver `data` to the other end in the loop's next turn."""
        if self._peer is not None:
            asyncio.get_running_loop().call_soon(self._peer.on_bytes, data)

    def close(self) -> None:
        """Part both ends; the other one is told."""
        peer, self._peer = self._peer, None
        if peer is not None:
            peer.lose()

    def lose(self) -> None:
        """The other end has closed."""
        self._peer = None
        asyncio.get_running_loop().call_soon(self.on_lost)


def memory_pair() -> tuple[MemoryLink, MemoryLink]:
    """Both ends of a new pipe."""
    one, other = MemoryLink(), MemoryLink()
    one.join(other)
    other.join(one)
    return one, other
