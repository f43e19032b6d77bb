"""Finds the servos on a bus at any baud rate and id, in bounded time. Changes nothing."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from sphmctl.drivers import xl430
from sphmctl.drivers.link import Link
from sphmctl.drivers.servo_bus import BITS_PER_BYTE, LINK_LATENCY_S
from sphmctl.errors import DeviceError
from sphmctl.wire import dxl, dxl_instructions

BAUD_CODES = {
    57_600: 1,
    1_000_000: 3,
    115_200: 2,
    2_000_000: 4,
    3_000_000: 5,
    4_000_000: 6,
    4_500_000: 7,
    9_600: 0,
}
"""Baud Rate (8) of an XL430 by rate (ROBOTIS e-manual), in the order of looking: the factory's
rate, the cell's, then the others."""

PING_REPLY_BYTES = 14
"""Header 4, id, length 2, instruction, error, model 2, firmware, CRC 2."""

SLOT_S = 0.003
"""What each possible id is given beside its reply's wire time in a broadcast ping, as
dynamixel-sdk's broadcastPing does. All eight rates together: 11 s."""

NOISE_BYTES = 8
"""So many bytes that form no status are an answer, and not the click of a plug."""

CUSTOM_BAUD = 4_500_000
"""The one rate that is not among Linux' own (<asm-generic/termbits.h>): not every port has it."""

SETTLE_S = 0.02
"""Between two openings: the event loop closes a port in its next turn, and an adapter still sends
what it had got at the old rate (16 ms with an FTDI chip in its factory setting)."""

OpenAt = Callable[[int], Awaitable[Link]]
"""Opens the port at a rate, or raises DeviceError."""


@dataclass(frozen=True)
class Found:
    """A device that answered to a ping."""

    baud: int
    servo_id: int
    model: int
    firmware: int

    @property
    def place(self) -> str:
        """How sentences name it."""
        return f"id {self.servo_id} at {self.baud} baud"

    @property
    def kind(self) -> str:
        """What it is, in words."""
        name = "XL430-W250" if self.model == xl430.MODEL else f"model {self.model}"
        return f"{name}, firmware {self.firmware}"


@dataclass(frozen=True)
class Scan:
    """What a scan saw.

    Attributes:
        found: each answer, by rate and id; a device that answers twice stands here twice.
        garbled: rates at which something answered that could not be read.
        looked: rates looked at.
        skipped: rates that the port cannot have.
    """

    found: tuple[Found, ...]
    garbled: tuple[int, ...]
    looked: tuple[int, ...]
    skipped: tuple[int, ...]


async def scan(open_at: OpenAt, bauds: Sequence[int], tell: Callable[[str], None]) -> Scan:
    """Ping all devices at each rate.

    Raises:
        DeviceError: the port cannot be opened.
    """
    found: list[Found] = []
    garbled: list[int] = []
    skipped: list[int] = []
    for number, baud in enumerate(bauds, 1):
        tell(f"looking for servos at {baud} baud ({number} of {len(bauds)})")
        try:
            link = await open_settled(open_at, baud)
        except DeviceError:
            if baud != CUSTOM_BAUD:
                raise
            tell(f"this port cannot have {baud} baud: not looked there")
            skipped.append(baud)
            continue
        try:
            here, is_garbled = await _ping_all(link, baud)
        finally:
            link.close()
        for one in here:
            tell(f"found {one.place}: {one.kind}")
        found += here
        garbled += [baud] if is_garbled else []
    looked = tuple(baud for baud in bauds if baud not in skipped)
    return Scan(tuple(found), tuple(garbled), looked, tuple(skipped))


async def open_settled(open_at: OpenAt, baud: int) -> Link:
    """Open the port that was perhaps just closed."""
    await asyncio.sleep(SETTLE_S)
    return await open_at(baud)


async def _ping_all(link: Link, baud: int) -> tuple[list[Found], bool]:
    """Everybody's answer at one rate, and whether there was one that cannot be read."""
    splitter = dxl.Splitter()
    link.on_bytes = splitter.feed
    frame = dxl_instructions.ping()
    byte_s = BITS_PER_BYTE / baud
    slots_s = (dxl.MAX_ID + 1) * (PING_REPLY_BYTES * byte_s + SLOT_S)
    link.write(frame)
    await asyncio.sleep(len(frame) * byte_s + slots_s + LINK_LATENCY_S)
    found = []
    while (answer := splitter.next_frame()) is not None:
        try:
            status = dxl.parse_status(answer)
        except dxl.DxlProtocolError:
            # An adapter that echoes sends our own instruction back.
            continue
        if len(status.data) == struct.calcsize("<HB"):
            model, firmware = struct.unpack("<HB", status.data)
            found.append(Found(baud, status.device_id, model, firmware))
    splitter.discard()
    return found, splitter.garbage_bytes >= NOISE_BYTES
