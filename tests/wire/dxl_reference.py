"""Protocol 2.0 written down a second time, slowly: bitwise CRC, stuffing byte by byte."""

from __future__ import annotations

from collections.abc import Sequence


def crc(data: bytes) -> int:
    """CRC-16/UMTS, one bit at a time (check value of b"123456789": 0xFEE8)."""
    register = 0
    for byte in data:
        for bit in range(7, -1, -1):
            carry = (register >> 15) ^ (byte >> bit & 1)
            register = (register << 1 & 0xFFFF) ^ (0x8005 if carry else 0)
    return register


def stuff(body: bytes) -> bytes:
    """An FD after each FF FF FD, as a transmitter does it."""
    out = bytearray()
    for at, byte in enumerate(body):
        out.append(byte)
        if body[max(at - 2, 0) : at + 1] == b"\xff\xff\xfd":
            out.append(0xFD)
    return bytes(out)


def frame(device_id: int, body: bytes) -> bytes:
    """Header to CRC around an instruction byte and its parameters."""
    stuffed = stuff(body)
    length = (len(stuffed) + 2).to_bytes(2, "little")
    packet = b"\xff\xff\xfd\x00" + bytes([device_id]) + length + stuffed
    return packet + crc(packet).to_bytes(2, "little")


def status(device_id: int, data: bytes, error: int = 0) -> bytes:
    """A status packet."""
    return frame(device_id, bytes([0x55, error]) + data)


def fast_status(blocks: Sequence[tuple[int, int, bytes]]) -> bytes:
    """The shared answer to a fast read from (id, error, data), never stuffed."""
    length = 1 + sum(len(data) + 4 for _, _, data in blocks)
    packet = b"\xff\xff\xfd\x00\xfe" + length.to_bytes(2, "little") + b"\x55"
    for device_id, error, data in blocks:
        packet += bytes([error, device_id]) + data
        packet += crc(packet).to_bytes(2, "little")
    return packet
