"""The far end of a memory link, in the test's hand: what came, and what is sent back when."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable

from sphmctl.drivers.link import Link, MemoryLink, memory_pair
from sphmctl.errors import DeviceError


class FarEnd:
    """Opens memory links and notes what arrives; `answer` is called with each piece.

    Attributes:
        pieces: (time, bytes) of everything received.
        opened: links opened so far; `gone` refuses more.
        lost: whether the driver has closed the present link.
    """

    def __init__(self, answer: Callable[[FarEnd, bytes], None] | None = None) -> None:
        self.pieces: list[tuple[float, bytes]] = []
        self.opened = 0
        self.lost = False
        self.gone = False
        self.answer = answer
        self.end = MemoryLink()

    async def open(self) -> Link:
        """The driver's end of a new link."""
        if self.gone:
            raise DeviceError("nothing listens there")
        here, there = memory_pair()
        there.on_bytes = self._take
        there.on_lost = self._lose
        self.end, self.lost = there, False
        self.opened += 1
        return here

    def send(self, data: bytes, after_s: float = 0.0) -> None:
        """Send to the driver, now or later."""
        end = self.end
        if after_s:
            asyncio.get_running_loop().call_later(after_s, end.write, data)
        else:
            end.write(data)

    def _take(self, data: bytes) -> None:
        self.pieces.append((asyncio.get_running_loop().time(), data))
        if self.answer is not None:
            self.answer(self, data)

    def _lose(self) -> None:
        self.lost = True


def kvp_reply(request: bytes, value: str, *, ok: bool = True, identity: int | None = None) -> bytes:
    """A KUKAVARPROXY reply (basMain.bas): id, length, function, value length, value, tail."""
    sent_id, _, function = struct.unpack_from(">HHB", request)
    text = value.encode("latin-1")
    head = struct.pack(
        ">HHBH", sent_id if identity is None else identity, len(text) + 6, function, len(text)
    )
    return head + text + bytes((0, 1, ok))


def kvp_name(request: bytes) -> str:
    """The variable that a request names."""
    (size,) = struct.unpack_from(">H", request, 5)
    return request[7 : 7 + size].decode()
