"""KUKAVARPROXY's frames as its server reads and writes them, mistakes included; pure functions.

Re-expressed from ImtsSrl/KUKAVARPROXY (release of 2019): src/frmMain.frm, sockServer_Read, and
src/basMain.bas, readMsg and splitMsg. A frame is id (2 bytes), length of the rest (2), function
(1), then blocks of length (2) and text; all big-endian.
"""

from __future__ import annotations

from dataclasses import dataclass

READ, WRITE, READ_ARRAY, WRITE_ARRAY = 0, 1, 2, 3

HEAD = 4
"""Bytes of id and length."""

BLOCKS_LIMIT = 10
"""splitMsg's array `sString(9)` holds ten blocks."""

INTEGER_HIGH = 32767
"""The server computes lengths and positions in 16-bit signed integers; beyond, it gives up."""

TEXT = "latin-1"
"""The server keeps bytes in strings; one byte is one character."""


@dataclass(frozen=True)
class Request:
    """One request that the server executes: its blocks as name and value, empty when missing."""

    id: bytes
    function: int
    name: str
    value: str


def requests(event: bytes) -> list[Request]:
    """The requests that the server finds in the bytes of one read event.

    A frame that lacks one to four bytes is still executed with what is there, because the server
    compares the length field with the bytes including the head; after that it gives up on the
    event. A frame that lacks more is dropped.
    """
    found: list[Request] = []
    rest = event
    if len(rest) < HEAD:
        return found
    head, length = rest[:2], int.from_bytes(rest[2:4], "big")
    while length <= INTEGER_HIGH and len(rest) >= length and len(rest) > HEAD:
        # From the sixth byte on `length` bytes, one too many: the function was counted, too.
        blocks = _blocks(rest[5 : 5 + length])
        if blocks is not None:
            name, value = (*blocks, b"", b"")[:2]
            found.append(Request(head, rest[4], name.decode(TEXT), value.decode(TEXT)))
        if len(rest) < length + HEAD:
            break
        rest = rest[length + HEAD :]
        if len(rest) >= HEAD:
            head, length = rest[:2], int.from_bytes(rest[2:4], "big")
    return found


def _blocks(message: bytes) -> list[bytes] | None:
    """The message's blocks; None where the server runs into an error."""
    blocks: list[bytes] = []
    at = 0
    # One byte left over counts as the end.
    while at + 1 < len(message):
        length = int.from_bytes(message[at : at + 2], "big")
        at += 2
        if at + 1 + length > INTEGER_HIGH or len(blocks) == BLOCKS_LIMIT:
            return None
        blocks.append(message[at : at + length])
        at += length
    return blocks


def answer(function: int, text: bytes, *, success: bool) -> bytes:
    """A reply without its head: function, length and text, then the flag as a block of one byte."""
    flag = b"\x00\x01\x01" if success else b"\x00\x01\x00"
    return bytes((function,)) + (len(text) & 0xFFFF).to_bytes(2, "big") + text + flag


def framed(request_id: bytes, body: bytes) -> bytes:
    """A reply as it is sent; its body is empty for a function that the server does not know."""
    return request_id + (len(body) & 0xFFFF).to_bytes(2, "big") + body


def words(text: str) -> bytes:
    """A list of numbers as function 2 packs it for a PLC: 16 bits each, nothing for a single one.

    Raises:
        ValueError: when one is no number; the server then gives up on the event.
    """
    parts = text.split(" ") if text else []
    if len(parts) < 2:
        return b""
    return b"".join((round(float(part)) & 0xFFFF).to_bytes(2, "big") for part in parts)


def numbers(value: str) -> list[str]:
    """The numbers that function 3 finds in a value, as texts; half a word at the end counts 0."""
    data = value.encode(TEXT)
    count = round(len(data) / 2)
    pairs = (data[2 * at : 2 * at + 2] for at in range(count))
    return [str(int.from_bytes(pair, "big") if len(pair) == 2 else 0) for pair in pairs]
