"""KUKAVARPROXY frames as bytes: requests out, replies in. No socket, no time-outs, no KRL values.

All numbers are big-endian; a length counts the bytes after itself, strings are 8-bit text:

    request  id u16 | length u16 | function u8 | name length u16, name [| value length u16, value]
    reply    id u16 | length u16 | function u8 | value length u16, value | tail, 3 bytes

Sources: ImtsSrl/KUKAVARPROXY src/basMain.bas and ulsu-tech/c3bridge-server include/c3bi.h.
KUKAVARPROXY builds the tail as a flag with a length (00 01 01 or 00 01 00), C3 Bridge as an error
code and a flag (00 01 01 or 00 00 00): the last byte is the flag in both.
"""

from __future__ import annotations

from functools import lru_cache
from struct import Struct
from typing import Final, NamedTuple, NoReturn

from sphmctl.errors import DeviceError, InvalidError

READ: Final = 0
WRITE: Final = 1

# KUKAVARPROXY parses each TCP read on its own and executes a cut frame with a cut value
# (basMain.bas), so a request must fit one Ethernet segment (1460 bytes) with room for a tunnel.
REQUEST_LIMIT_BYTES: Final = 1400

# The ids are 16-bit numbers that the servers echo without reading them.
MAX_REQUEST_ID: Final = 0xFFFF

# A reply's length covers at least function, value length and tail.
MIN_REPLY_LENGTH: Final = 6

# Two of the longest replies a 16-bit length can announce: with one request in flight more can only
# be a stream of something else.
BUFFER_LIMIT_BYTES: Final = 2 * (4 + 0xFFFF)

# A control loop reads the same few variables in each cycle.
CACHED_NAMES: Final = 64

_HEAD = Struct(">HHBH")
_READ = Struct(">HBH")
_LENGTH = Struct(">H")
_FUNCTION_NAMES = {READ: "read", WRITE: "write"}


class KvpProtocolError(DeviceError):
    """The byte stream is not what was asked for: only a new connection is in step again."""


class VariableRefusedError(DeviceError):
    """The controller does not read or write this variable."""


class VariableEmptyError(DeviceError):
    """The read succeeded without a value: the variable is unknown, or has none yet."""


class Reply(NamedTuple):
    """One reply as it came, not yet compared with its request. To make a dataclass takes thrice.

    Attributes:
        code: the error code of c3.py's replies, whose values stand in `items` instead.
        items: error code and value of each variable.
    """

    request_id: int
    function: int
    value: str
    ok: bool
    code: int = 0
    items: tuple[tuple[int, str], ...] = ()


def encode_read(request_id: int, name: str) -> bytes:
    """One frame that reads a variable."""
    check_id(request_id, name)
    return request_id.to_bytes(2, "big") + _read_after_id(name)


def encode_write(request_id: int, name: str, value: str) -> bytes:
    """One frame that writes KRL text into a variable."""
    check_id(request_id, name)
    text = _encode_name(name)
    content = _encode_value(name, value)
    length = len(text) + len(content) + 5
    _check_size(length + 4, name)
    head = _HEAD.pack(request_id, length, WRITE, len(text))
    return head + text + _LENGTH.pack(len(content)) + content


class Decoder:
    """Cuts a byte stream into replies; after one error it is dead and the connection must end."""

    def __init__(self) -> None:
        # Nearly always one whole reply arrives at once: bytes are then kept and cut without a copy.
        self._buffer = b""
        self._failure = ""

    @property
    def pending_bytes(self) -> int:
        """Bytes received that no reply has used yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> None:
        """Takes what the connection delivered, cut anywhere."""
        if self._failure:
            raise KvpProtocolError(self._failure)
        buffer = self._buffer = self._buffer + data if self._buffer else data
        if len(buffer) > BUFFER_LIMIT_BYTES:
            self._fail(
                f"more than {BUFFER_LIMIT_BYTES} bytes without a request; "
                "one reply to each request would be right"
            )

    def next_reply(self) -> Reply | None:
        """The next complete reply, or None when more bytes are needed."""
        buffer = self._buffer
        if len(buffer) < 7:
            self._check_start()
            return None
        request_id, length, function, value_length = _HEAD.unpack_from(buffer)
        if value_length != length - MIN_REPLY_LENGTH or function > WRITE:
            self._fail_head(length, function, value_length)
        end = 4 + length
        if len(buffer) < end:
            return None
        flag = buffer[end - 1]
        if flag > 1:
            self._fail(f"reply flag {flag}; 0 (failed) or 1 (done) would be right")
        self._buffer = buffer[end:]
        return Reply(request_id, function, buffer[7 : end - 3].decode("latin-1"), flag == 1)

    def _check_start(self) -> None:
        """Notices as early as can be that the stream has failed, or fails."""
        if self._failure:
            raise KvpProtocolError(self._failure)
        if len(self._buffer) >= 4:
            length = int.from_bytes(self._buffer[2:4], "big")
            if length < MIN_REPLY_LENGTH:
                self._fail_head(length, READ, 0)

    def _fail_head(self, length: int, function: int, value_length: int) -> NoReturn:
        if length < MIN_REPLY_LENGTH:
            self._fail(f"reply length {length}; at least {MIN_REPLY_LENGTH} would be right")
        if function > WRITE:
            self._fail(f"reply function {function}; 0 (read) or 1 (write) would be right")
        self._fail(
            f"reply length {length} with a value of {value_length} bytes; "
            f"{length - MIN_REPLY_LENGTH} would be right"
        )

    def _fail(self, message: str) -> NoReturn:
        self._failure = message
        self._buffer = b""
        raise KvpProtocolError(message)


def reply_to_value(reply: Reply, request_id: int, function: int, name: str) -> str:
    """The value of a reply that answers this request, blanks around it removed.

    Raises:
        KvpProtocolError: the reply belongs to another request; the connection must end.
        VariableRefusedError: the controller refused.
        VariableEmptyError: a read came back done but empty.
    """
    check_answers(reply, request_id, function, name)
    if not reply.ok:
        raise VariableRefusedError(
            f"the controller refused to {_FUNCTION_NAMES[function]} it; "
            "a declared global variable of the right type would be right",
            where=name,
        )
    value = reply.value.strip()
    if function == READ and not value:
        raise empty(name)
    return value


def check_answers(reply: Reply, request_id: int, function: int, where: str) -> None:
    """Refuse a reply to another request than this one."""
    if reply.request_id != request_id:
        raise KvpProtocolError(
            f"reply with id {reply.request_id}; {request_id} would be right", where
        )
    if reply.function != function:
        raise KvpProtocolError(
            f"reply to function {reply.function}; {function} would be right", where
        )


def empty(name: str) -> VariableEmptyError:
    """The error of a read that came back done, but without a value."""
    return VariableEmptyError(
        "the controller returned no value; a declared variable that has been given one "
        "would be right",
        where=name,
    )


@lru_cache(maxsize=CACHED_NAMES)
def _read_after_id(name: str) -> bytes:
    text = _encode_name(name)
    _check_size(len(text) + 7, name)
    return _READ.pack(len(text) + 3, READ, len(text)) + text


def check_id(request_id: int, name: str) -> None:
    """Refuse a number that does not fit the id."""
    if not 0 <= request_id <= MAX_REQUEST_ID:
        raise InvalidError(f"request id {request_id}; 0 to {MAX_REQUEST_ID} would be right", name)


def checked_name(name: str) -> str:
    """The name; KRL names are ASCII (KUKA, KSS System Integrators, "Names in KRL")."""
    if not (name and name.isascii() and name.isprintable()):
        raise InvalidError(f"variable name {name!r}; printable ASCII text would be right")
    return name


def checked_value(name: str, value: str) -> str:
    """The value of a variable of this name, if it is one line of text."""
    if not (value and value.isprintable()):
        raise InvalidError(f"value {value!r}; printable text on one line would be right", name)
    return value


def _encode_name(name: str) -> bytes:
    return checked_name(name).encode("ascii")


def _encode_value(name: str, value: str) -> bytes:
    try:
        return checked_value(name, value).encode("latin-1")
    except UnicodeEncodeError:
        raise InvalidError(
            f"value {value!r}; characters of Latin-1 only would be right", name
        ) from None


def _check_size(size_bytes: int, name: str) -> None:
    if size_bytes < REQUEST_LIMIT_BYTES:
        return
    place = name if len(name) <= 40 else f"{name[:40]}..."
    raise InvalidError(
        f"a request of {size_bytes} bytes; fewer than {REQUEST_LIMIT_BYTES} would be right, "
        "since the server executes a request that arrives in two parts with a cut value",
        place,
    )
