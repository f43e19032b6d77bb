"""DYNAMIXEL Protocol 2.0 frames as a servo sees them: finds instructions, builds statuses; no I/O.

Written from the ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0", a second time and on purpose: the
host's codec is tested against this one.

    FF FF FD 00 | ID | LEN_L LEN_H | INST | [ERR] | PARAMS... | CRC_L CRC_H     (chapters 3, 4)
"""

from __future__ import annotations

from dataclasses import dataclass

HEADER = b"\xff\xff\xfd\x00"
"""Header and reserved byte; inside a frame stuffing makes FF FF FD FD of it."""

PREFIX_BYTES = 7
"""Header, ID and length: what must be there before the frame's end is known."""

MIN_LENGTH = 3
"""Smallest LEN: an instruction and two CRC bytes."""

MAX_LENGTH = 1024
"""Largest LEN a servo takes in; its whole table is 662 bytes, so that no honest frame is longer."""

STATUS = 0x55
"""Instruction code of an answer."""

BROADCAST = 0xFE
"""The ID that everybody obeys."""

CRC_POLYNOMIAL = 0x8005
"""CRC-16 of the e-manual's chapter "CRC Calculation": from 0, no reflection, no final xor."""


def _crc_row(high_byte: int) -> int:
    register = high_byte << 8
    for _ in range(8):
        register = (register << 1) ^ (CRC_POLYNOMIAL if register & 0x8000 else 0)
    return register & 0xFFFF


_CRC_ROWS = tuple(_crc_row(byte) for byte in range(256))


def crc16(data: bytes | bytearray, crc: int = 0) -> int:
    """CRC-16 of `data`, going on from `crc`."""
    rows = _CRC_ROWS
    for byte in data:
        crc = ((crc << 8) & 0xFF00) ^ rows[(crc >> 8) ^ byte]
    return crc


def status_frame(servo_id: int, error: int, params: bytes = b"") -> bytes:
    """A status, stuffed (e-manual, chapters "Status Packet" and "Processing Order")."""
    body = bytes((STATUS, error)) + params
    if b"\xff\xff\xfd" in body:
        body = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    frame = HEADER + bytes((servo_id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return frame + crc16(frame).to_bytes(2, "little")


@dataclass(frozen=True)
class Instruction:
    """An instruction whose CRC was right, unstuffed, and how its bytes lay in the stream.

    Attributes:
        servo_id: whom it addresses; `BROADCAST` for all.
        code: what to do.
        params: the rest, stuffing removed.
        wire_bytes: length on the wire.
        trailing_bytes: bytes of the same `feed` that came after its last one.
    """

    servo_id: int
    code: int
    params: bytes
    wire_bytes: int
    trailing_bytes: int


class FrameFinder:
    """Cuts a byte stream into instructions; skips noise and frames with a wrong CRC."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.crc_errors = 0

    @property
    def partial(self) -> bool:
        """Whether the start of a frame, or noise that could be one, is held back."""
        return bool(self._buffer)

    def drop(self) -> None:
        """Forget what has begun."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[Instruction]:
        """Take in `data` and return the instructions that it completes."""
        buffer = self._buffer
        buffer += data
        found: list[Instruction] = []
        while self._seek_header():
            if len(buffer) < PREFIX_BYTES:
                break
            length = int.from_bytes(buffer[5:7], "little")
            end = PREFIX_BYTES + length
            if not MIN_LENGTH <= length <= MAX_LENGTH:
                del buffer[: len(HEADER)]
                continue
            if len(buffer) < end:
                break
            crc = int.from_bytes(buffer[end - 2 : end], "little")
            if crc16(buffer[: end - 2]) != crc:
                # A cut frame swallows the start of the next one, whose header is still in here.
                self.crc_errors += 1
                del buffer[: len(HEADER)]
                continue
            if buffer[7] != STATUS:
                found.append(self._instruction(end))
            del buffer[:end]
        return found

    def _seek_header(self) -> bool:
        buffer = self._buffer
        start = buffer.find(HEADER)
        if start < 0:
            keep = next((n for n in (3, 2, 1) if buffer.endswith(HEADER[:n])), 0)
            del buffer[: len(buffer) - keep]
            return False
        del buffer[:start]
        return True

    def _instruction(self, end: int) -> Instruction:
        buffer = self._buffer
        params = bytes(buffer[8 : end - 2]).replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        return Instruction(buffer[4], buffer[7], params, end, len(buffer) - end)
