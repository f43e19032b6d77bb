"""C3 Bridge's messages as its server reads and builds them; pure functions of bytes.

Re-expressed from ulsu-tech/c3bridge-server (1.4.0): source/client.cpp, messagereader.cpp,
messagebuilder.cpp; numbers of functions and errors: include/c3bi.h. A message is tag (2 bytes),
length of the rest (2), function (1), payload; a reply adds error code (2) and success flag (1).
Numbers are big-endian, texts of functions above 1 UTF-16, little-endian, counted in units of two.
"""

from __future__ import annotations

READ_ASCII, WRITE_ASCII, READ, WRITE, READ_MANY, WRITE_MANY = 0, 1, 4, 5, 6, 7
PROGRAM, INFO, FEATURES, CONFIRM_ALL = 10, 13, 14, 63

ERROR_GENERAL, SUCCESS = 0, 1
ERROR_NOT_IMPLEMENTED, ERROR_PROTOCOL, ERROR_LONG_ANSWER = 7, 9, 10

HEADER = 5
"""Bytes up to the function, which the server reads first."""

PAYLOAD_LIMIT = 0xFFFF - 1 - 3
"""A reply's length field holds function, payload and footer."""

ASCII = "latin-1"
"""Stands for the controller's code page; the variables hold ASCII."""

WIDE = "utf-16-le"


class ShortError(Exception):
    """The payload ends before what the server wants to read from it."""


class Reader:
    """Takes a payload apart, as `MessageReader` does.

    Raises:
        ShortError: from each method, when the payload does not hold so much.
    """

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._at = 0

    def take(self, size: int) -> bytes:
        """The next bytes."""
        end = self._at + size
        if end > len(self._payload):
            raise ShortError
        data, self._at = self._payload[self._at : end], end
        return data

    def byte(self) -> int:
        """An unsigned number of one byte."""
        return self.take(1)[0]

    def short(self) -> int:
        """A signed number of two bytes."""
        return int.from_bytes(self.take(2), "big", signed=True)

    def ascii(self) -> str:
        """A text of 8-bit characters with its length."""
        return self.take(int.from_bytes(self.take(2), "big")).decode(ASCII)

    def wide(self) -> str:
        """A UTF-16 text with its length; a lone half of a pair passes, as in a BSTR."""
        units = int.from_bytes(self.take(2), "big")
        return self.take(2 * units).decode(WIDE, "surrogatepass")


def ascii_text(text: str) -> bytes:
    """A text of 8-bit characters with its length."""
    data = text.encode(ASCII, "replace")
    return (len(data) & 0xFFFF).to_bytes(2, "big") + data


def wide_text(text: str) -> bytes:
    """A UTF-16 text with its length in units of two bytes."""
    data = text.encode(WIDE, "surrogatepass")
    return (len(data) // 2 & 0xFFFF).to_bytes(2, "big") + data


def reply(tag: bytes, function: int, payload: bytes, code: int, *, success: bool) -> bytes:
    """A whole reply; its payload must fit."""
    length = (1 + len(payload) + 3).to_bytes(2, "big")
    return tag + length + bytes((function,)) + payload + code.to_bytes(2, "big") + bytes((success,))
