"""C3 Bridge's own frames as bytes: several variables in one request, UTF-16 text, error codes.

Only for a server that says `C3 BRIDGE INTERFACE` when `@PROXY_TYPE` is read with kvp.py's function
0: others give the same function numbers other meanings. Numbers are big-endian, a length counts
what follows it, a text is its number of 16-bit units (u16) and UTF-16, little-endian:

    request  id u16 | length u16 | function u8 | name text [| value text]               4, 5
             id u16 | length u16 | function u8 | count u8 | per item name [, value]     6, 7
    reply    id u16 | length u16 | function u8 | value text | error u16 | flag u8       4, 5
             ... function u8 | count u8 | per item error u8, value text | error | flag  6, 7

Source: C3 Bridge Interface, Application Protocol Specification, revision 5, sections 3.1 to 3.5.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from struct import Struct
from typing import Final, NoReturn

from sphmctl.errors import DeviceError, InvalidError
from sphmctl.wire import kvp

READ: Final = 4
WRITE: Final = 5
READ_MANY: Final = 6
WRITE_MANY: Final = 7

# What a C3 Bridge answers to a read of @PROXY_TYPE (specification, section 2.2).
TYPE: Final = "C3 BRIDGE INTERFACE"

# Function 6 is wrong before 1.2, function 7 before 1.3 (specification, sections 3.5.7 and 3.5.8).
FIRST_RIGHT_VERSION: Final = (1, 3)

# The count of variables is one byte.
COUNT_LIMIT: Final = 255

# The request's length field, which counts from the function on.
LENGTH_LIMIT: Final = 0xFFFF

# Function, count and tail of a reply without a variable; one more than program control's.
MIN_REPLY_LENGTH: Final = 5

SUCCESS: Final = 1
PROTOCOL_ERROR: Final = 9
LONG_ANSWER: Final = 10
_ERRORS = {
    2: "access denied",
    3: "wrong argument",
    4: "no memory",
    5: "wrong pointer",
    6: "unexpected",
    7: "not implemented",
    8: "no interface to the controller",
    PROTOCOL_ERROR: "request not understood",
    LONG_ANSWER: "answer too long",
}

_HEAD = Struct(">HHB")
_TAIL = Struct(">HB")
_VERBS = {READ: "read", WRITE: "write", READ_MANY: "read", WRITE_MANY: "write"}


def encode_read(request_id: int, name: str) -> bytes:
    """One frame that reads a variable."""
    return _frame(request_id, READ, _name(name), name)


def encode_write(request_id: int, name: str, value: str) -> bytes:
    """One frame that writes KRL text into a variable."""
    return _frame(request_id, WRITE, _name(name) + _value(name, value), name)


def encode_read_many(request_id: int, names: Sequence[str]) -> bytes:
    """One frame that reads several variables."""
    parts = [_name(name) for name in names]
    return _frame(request_id, READ_MANY, _count(parts) + b"".join(parts), _all(names))


def encode_write_many(request_id: int, values: Sequence[tuple[str, str]]) -> bytes:
    """One frame that writes several variables in this order; a refused one stops none of them."""
    parts = [_name(name) + _value(name, value) for name, value in values]
    where = _all([name for name, _ in values])
    return _frame(request_id, WRITE_MANY, _count(parts) + b"".join(parts), where)


def version(text: str) -> tuple[int, int]:
    """The numbers of @PROXY_VERSION, "1.4 (OPEN SOURCE)"; (0, 0) for what is no version."""
    match = re.match(r"(\d{1,4})\.(\d{1,4})", text)
    return (int(match[1]), int(match[2])) if match else (0, 0)


class Decoder:
    """Cuts a byte stream into replies; after one error it is dead and the connection must end."""

    def __init__(self) -> None:
        self._buffer = b""
        self._failure = ""

    @property
    def pending_bytes(self) -> int:
        """Bytes received that no reply has used yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> None:
        """Takes what the connection delivered, cut anywhere."""
        if self._failure:
            raise kvp.KvpProtocolError(self._failure)
        self._buffer += data
        if len(self._buffer) > kvp.BUFFER_LIMIT_BYTES:
            self._fail(
                f"more than {kvp.BUFFER_LIMIT_BYTES} bytes without a request; "
                "one reply to each request would be right"
            )

    def next_reply(self) -> kvp.Reply | None:
        """The next complete reply, or None when more bytes are needed."""
        if self._failure:
            raise kvp.KvpProtocolError(self._failure)
        buffer = self._buffer
        if len(buffer) < _HEAD.size:
            return None
        request_id, length, function = _HEAD.unpack_from(buffer)
        if length < MIN_REPLY_LENGTH:
            self._fail(f"reply length {length}; at least {MIN_REPLY_LENGTH} would be right")
        if function not in _VERBS:
            self._fail(f"reply function {function}; {READ} to {WRITE_MANY} would be right")
        end = 4 + length
        if len(buffer) < end:
            return None
        code, flag = _TAIL.unpack_from(buffer, end - _TAIL.size)
        if flag > 1:
            self._fail(f"reply flag {flag}; 0 (failed) or 1 (done) would be right")
        items = self._items(function, buffer[_HEAD.size : end - _TAIL.size], code)
        self._buffer = buffer[end:]
        return kvp.Reply(request_id, function, "", flag == 1, code, items)

    def _items(self, function: int, payload: bytes, code: int) -> tuple[tuple[int, str], ...]:
        if function in (READ, WRITE):
            value, at = self._text(payload, 0)
            found = [(code, value)]
        else:
            found, at = [], 1
            for _ in range(payload[0]):
                if at == len(payload):
                    self._fail(f"a reply with {len(found)} variables; {payload[0]} would be right")
                value, end = self._text(payload, at + 1)
                found.append((payload[at], value))
                at = end
        if at != len(payload):
            self._fail(f"a reply with {len(payload) - at} bytes left over; none would be right")
        return tuple(found)

    def _text(self, payload: bytes, at: int) -> tuple[str, int]:
        """The text at a place, and the place behind it."""
        units = int.from_bytes(payload[at : at + 2], "big")
        end = at + 2 + 2 * units
        if end > len(payload) or at + 2 > len(payload):
            self._fail(f"a value of {units} characters in a reply that ends before its end")
        try:
            return payload[at + 2 : end].decode("utf-16-le"), end
        except UnicodeDecodeError:
            self._fail("a value that is no UTF-16 text")

    def _fail(self, message: str) -> NoReturn:
        self._failure = message
        self._buffer = b""
        raise kvp.KvpProtocolError(message)


def reply_to_values(
    reply: kvp.Reply, request_id: int, function: int, names: Sequence[str]
) -> list[str]:
    """The values of a reply that answers this request, in order, blanks around them removed.

    Raises:
        KvpProtocolError: the reply belongs to another request; the connection must end.
        VariableRefusedError: the controller refused one of the variables.
        VariableEmptyError: a read came back done but empty.
        DeviceError: the values are too long for one reply.
    """
    kvp.check_answers(reply, request_id, function, _all(names))
    if len(reply.items) != len(names):
        if not reply.items and reply.code == LONG_ANSWER:
            raise DeviceError("the values are too long for one reply; read fewer", _all(names))
        raise kvp.KvpProtocolError(
            f"a reply with {len(reply.items)} variables (error {_error(reply.code)}); "
            f"{len(names)} would be right",
            _all(names),
        )
    values = []
    for name, (code, text) in zip(names, reply.items, strict=True):
        if code != SUCCESS or (not reply.ok and len(names) == 1):
            raise kvp.VariableRefusedError(
                f"the controller refused to {_VERBS[function]} it (error {_error(code)}); "
                "a declared global variable of the right type would be right",
                where=name,
            )
        value = text.strip()
        if function in (READ, READ_MANY) and not value:
            raise kvp.empty(name)
        values.append(value)
    if not reply.ok:
        raise kvp.KvpProtocolError("a failed reply without a failed variable", _all(names))
    return values


def _error(code: int) -> str:
    return f"{code}, {_ERRORS[code]}" if code in _ERRORS else str(code)


def _all(names: Sequence[str]) -> str:
    return ", ".join(names)


def _frame(request_id: int, function: int, payload: bytes, where: str) -> bytes:
    kvp.check_id(request_id, where)
    length = 1 + len(payload)
    if length > LENGTH_LIMIT:
        raise InvalidError(
            f"a request of {length} bytes; at most {LENGTH_LIMIT} would be right", where[:40]
        )
    return _HEAD.pack(request_id, length, function) + payload


def _count(parts: Sequence[bytes]) -> bytes:
    if not 1 <= len(parts) <= COUNT_LIMIT:
        raise InvalidError(f"{len(parts)} variables; 1 to {COUNT_LIMIT} would be right")
    return bytes((len(parts),))


def _name(name: str) -> bytes:
    return _text_bytes(kvp.checked_name(name), name)


def _value(name: str, value: str) -> bytes:
    return _text_bytes(kvp.checked_value(name, value), name)


def _text_bytes(text: str, where: str) -> bytes:
    data = text.encode("utf-16-le")
    if len(data) > LENGTH_LIMIT:
        raise InvalidError(
            f"a text of {len(data)} bytes; at most {LENGTH_LIMIT} would be right", where[:40]
        )
    return (len(data) // 2).to_bytes(2, "big") + data
