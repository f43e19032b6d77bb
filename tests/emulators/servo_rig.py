"""A servo bus on the virtual clock, and instructions with the SDK's CRC, for tests beside it."""

from __future__ import annotations

import asyncio
import random
import struct
from collections.abc import Callable, Sequence

from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler

from sphmctl.clock import VirtualLoop
from sphmctl.emulators.adapter import Usb
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo

_SDK = Protocol2PacketHandler()


def crc(data: bytes) -> bytes:
    """The two CRC bytes of a frame, by dynamixel-sdk."""
    value: int = _SDK.updateCRC(0, list(data), len(data))
    return value.to_bytes(2, "little")


def frame(servo_id: int, code: int, params: bytes = b"") -> bytes:
    """An instruction without stuffing."""
    head = b"\xff\xff\xfd\x00" + bytes((servo_id,)) + struct.pack("<H", len(params) + 3)
    body = head + bytes((code,)) + params
    return body + crc(body)


def write(servo_id: int, address: int, data: bytes) -> bytes:
    """A write instruction."""
    return frame(servo_id, 0x03, struct.pack("<H", address) + data)


def read(servo_id: int, address: int, size: int) -> bytes:
    """A read instruction."""
    return frame(servo_id, 0x02, struct.pack("<HH", address, size))


def sync_read(ids: Sequence[int], address: int, size: int, code: int = 0x82) -> bytes:
    """A sync read, or a fast one."""
    return frame(0xFE, code, struct.pack("<HH", address, size) + bytes(ids))


class MemoryPipe:
    """What the bus writes, with the virtual time of each piece."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.on_bytes: Callable[[bytes], None]
        self.on_lost: Callable[[], None]
        self.closed = False
        self.pieces: list[tuple[float, bytes]] = []
        self._clock = clock

    def write(self, data: bytes) -> None:
        self.pieces.append((self._clock(), data))

    def close(self) -> None:
        self.closed = True


class Rig:
    """Servos, bus and host link in virtual time."""

    def __init__(
        self,
        servos: Sequence[Servo] | None = None,
        *,
        usb: Usb = "none",
        pacing: bool = True,
        baud: int = 1_000_000,
        seed: int = 1,
    ) -> None:
        self.loop = VirtualLoop()
        rng = random.Random(seed)
        if servos is None:
            servos = [Servo(rng, servo_id) for servo_id in (1, 2, 3)]
        self.servos = list(servos)
        self.world = World(self.loop.time)
        self.bus = ServoBus(self.world, self.servos, rng, usb=usb, pacing=pacing)
        self.pipe = MemoryPipe(self.loop.time)
        self.bus.attach(self.pipe, baud)

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.loop.run_until_complete(self.bus.close())
        self.loop.close()

    def ask(self, *data: bytes, wait_s: float = 0.02) -> bytes:
        """Send the pieces at one instant; what has come back `wait_s` later."""

        async def exchange() -> bytes:
            self.pipe.pieces.clear()
            for piece in data:
                self.pipe.on_bytes(piece)
            await asyncio.sleep(wait_s)
            return b"".join(piece for _, piece in self.pipe.pieces)

        return self.loop.run_until_complete(exchange())

    def wait(self, seconds: float) -> None:
        """Let virtual time pass for the world."""
        self.loop.run_until_complete(asyncio.sleep(seconds))
        self.world.advance()

    def error(self, *data: bytes) -> int:
        """Error byte of the one status that answers."""
        answer = self.ask(*data)
        assert len(answer) >= 11, answer.hex(" ")
        return answer[8]

    def value(self, servo_id: int, address: int, size: int) -> int:
        """An item, signed."""
        answer = self.ask(read(servo_id, address, size))
        assert answer[4] == servo_id
        assert len(answer) >= 11 + size, answer.hex(" ")
        params = answer[9:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        return int.from_bytes(params, "little", signed=True)
