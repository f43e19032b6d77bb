"""A pseudo-terminal as a byte pipe: the serial port that any client can open; no protocol."""

from __future__ import annotations

import asyncio
import contextlib
import os
import termios
import tty
from collections.abc import Callable
from pathlib import Path

READ_BYTES = 4096
"""One read; the kernel's buffer for a pseudo-terminal is as large."""

UNREAD_BYTES = 16_384
"""What is kept for a client that does not read; beyond it bytes are lost, as on a serial port."""

_RATES = {
    getattr(termios, f"B{rate}"): rate
    for rate in (9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
}
_OUTPUT_SPEED = 5  # place in the list of termios.tcgetattr


def _ignore(_: bytes) -> None:
    """Bytes that nobody asked for."""


class PseudoTerminal:
    """The emulator's end of a pseudo-terminal; needs a running loop.

    The other end is kept open here too, so that clients may come and go.

    Args:
        link: a symbolic link to set up for the device; an old link is replaced, a file is not.

    Raises:
        FileExistsError: something that is not a symbolic link stands at `link`.
    """

    def __init__(self, link: Path | None = None) -> None:
        if link is not None and link.exists() and not link.is_symlink():
            raise FileExistsError(f"{link}: exists and is no symbolic link; name another place")
        self.on_bytes: Callable[[bytes], None] = _ignore
        self.on_lost: Callable[[], None] = lambda: None
        self._loop = asyncio.get_running_loop()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._unread = bytearray()
        self._link = link
        if link is not None:
            _set_link(link, self.path)
        self._loop.add_reader(self._master, self._readable)
        self._open = True

    def baud(self) -> int | None:
        """The rate that the client has set, bit / s; None when no servo knows it."""
        return _RATES.get(termios.tcgetattr(self._slave)[_OUTPUT_SPEED])

    def write(self, data: bytes) -> None:
        """Send `data` to the client; what it leaves unread for too long is lost."""
        if not self._open:
            return
        if not self._unread:
            data = data[self._send(data) :]
        if data:
            self._unread += data[: UNREAD_BYTES - len(self._unread)]
            self._loop.add_writer(self._master, self._writable)

    def close(self) -> None:
        """Close both ends and take the link away, unless it already points elsewhere."""
        if not self._open:
            return
        self._open = False
        self._loop.remove_reader(self._master)
        self._loop.remove_writer(self._master)
        os.close(self._master)
        os.close(self._slave)
        if self._link is not None:
            with contextlib.suppress(OSError):
                if os.readlink(self._link) == self.path:
                    self._link.unlink()

    def _readable(self) -> None:
        try:
            data = os.read(self._master, READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            self.close()
            self.on_lost()
            return
        if data:
            self.on_bytes(data)

    def _send(self, data: bytes | bytearray) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def _writable(self) -> None:
        del self._unread[: self._send(self._unread)]
        if not self._unread:
            self._loop.remove_writer(self._master)


def _set_link(link: Path, target: str) -> None:
    """Point `link` at `target` in one step: a client sees the old device or the new one."""
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(link)
