"""DYNAMIXEL Protocol 2.0, receiving side: bytes to frames to statuses. No port, no time-outs.

A status (ROBOTIS e-manual, Protocol 2.0, "Status Packet"), little-endian:

    FF FF FD 00 | id | length u16 | 55 | error | data ... | CRC u16

The length counts what follows it. In instruction and status packets an FD is stuffed in after each
FF FF FD from the instruction on. The answer to a fast read comes from id FE, is never stuffed, and
holds a block `error | id | data ... | CRC` for each device, each CRC over all bytes before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from struct import unpack_from
from typing import Final

from sphmctl.errors import DeviceError

HEADER: Final = b"\xff\xff\xfd\x00"
BROADCAST_ID: Final = 0xFE
MAX_ID: Final = 0xFC
STATUS: Final = 0x55

# The error byte: bit 7 says "read Hardware Error Status", the rest is a number (e-manual,
# Protocol 2.0, "Error").
ALERT: Final = 0x80
ERROR_TEXTS: Final = {
    1: "result fail: the servo could not carry out the instruction",
    2: "instruction error: unknown instruction, or an Action with nothing registered",
    3: "CRC error: the instruction arrived damaged",
    4: "data range error: the value is outside the item's range, or the Bus Watchdog has tripped",
    5: "data length error: fewer bytes than the item has",
    6: "data limit error: the value is beyond a limit set in the servo",
    7: "access error: read-only or undefined address, or an EEPROM write with torque on",
}

# The longest frame taken for one. A read of the whole XL430 table is 673 bytes; a damaged length
# beyond this would only make us wait. dynamixel-sdk draws the same line (RXPACKET_MAX_LEN).
MAX_FRAME_BYTES: Final = 1024

# Bytes kept while no frame is complete; a bus transaction of three servos is below 300 bytes.
BUFFER_LIMIT_BYTES: Final = 4 * MAX_FRAME_BYTES

# Id, length and instruction follow the header; the CRC ends the frame.
_DATA_AT: Final = 8
_MIN_FRAME_BYTES: Final = 10
_MIN_STATUS_BYTES: Final = 11
_IDS: Final = frozenset((*range(MAX_ID + 1), BROADCAST_ID))
_STUFFED: Final = b"\xff\xff\xfd\xfd"
_PLAIN: Final = b"\xff\xff\xfd"


class DxlProtocolError(DeviceError):
    """A frame that is whole but not what was asked for."""


class ServoRefusedError(DeviceError):
    """A servo answered with an error number.

    Attributes:
        device_id: the servo's id.
        error: the number, 1 to 7 in the e-manual's table.
    """

    def __init__(self, device_id: int, error: int) -> None:
        super().__init__(describe_error(error), f"servo {device_id}")
        self.device_id = device_id
        self.error = error


@dataclass(frozen=True, slots=True)
class Status:
    """One device's answer.

    Attributes:
        device_id: who answered.
        error: error number without the alert bit, 0 for none.
        alert: whether the device asks to have its Hardware Error Status read; the data are valid.
        data: the bytes read, unstuffed.
    """

    device_id: int
    error: int
    alert: bool
    data: bytes


def describe_error(error: int) -> str:
    """What an error number means."""
    return ERROR_TEXTS.get(error, f"error number {error}, which the e-manual does not define")


def _crc_table() -> tuple[int, ...]:
    """What two bytes leave behind, for all 65,536 of them: half the steps of the usual table.

    x^16 + x^15 + x^2 + 1, start 0, no reflection (e-manual, "CRC Calculation").
    """
    of_byte = []
    for byte in range(256):
        remainder = byte << 8
        for _ in range(8):
            remainder = (remainder << 1) ^ (0x18005 if remainder & 0x8000 else 0)
        of_byte.append(remainder)
    shifted = ((first << 8 & 0xFF00) ^ of_byte[first >> 8] for first in of_byte)
    return tuple(high ^ low for high in shifted for low in of_byte)


_CRC: Final = _crc_table()


def crc16(data: bytes, start: int = 0) -> int:
    """The CRC over `data`, going on from the CRC `start` of what came before."""
    crc = start
    table = _CRC
    odd = len(data) & 1
    if odd:
        crc = (crc << 8 & 0xFF00) ^ table[crc >> 8 ^ data[0]]
    for word in unpack_from(f">{len(data) >> 1}H", data, odd):
        crc = table[crc ^ word]
    return crc


class Splitter:
    """Cuts a byte stream into frames with a correct CRC; finds the next header after garbage.

    Attributes:
        garbage_bytes: bytes that belonged to no frame.
        crc_errors: frames that were complete but damaged.
        header_errors: headers with an id or a length that no frame has.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.garbage_bytes = 0
        self.crc_errors = 0
        self.header_errors = 0

    @property
    def pending_bytes(self) -> int:
        """Bytes received that no frame has used yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> None:
        """Takes what the port delivered, cut anywhere; beyond the limit the oldest bytes go."""
        self._buffer += data
        if len(self._buffer) > BUFFER_LIMIT_BYTES:
            self._drop(len(self._buffer) - BUFFER_LIMIT_BYTES)

    def discard(self) -> int:
        """Forgets what is left of an earlier transaction; returns the number of bytes."""
        left = len(self._buffer)
        self._drop(left)
        return left

    def skip_stalled(self) -> None:
        """Gives up the frame waited for: its length may be damaged, whole ones may follow it."""
        if len(self._buffer) >= len(HEADER):
            self._drop(len(HEADER))

    def next_frame(self) -> bytes | None:
        """The next whole frame, header to CRC and still stuffed, or None when more is needed.

        A frame is cut by its length: its CRC may look like a header.
        """
        buffer = self._buffer
        while buffer:
            if not buffer.startswith(HEADER):
                self._seek()
            if len(buffer) < 7:
                return None
            size = buffer[5] + (buffer[6] << 8) + 7
            if not _MIN_FRAME_BYTES <= size <= MAX_FRAME_BYTES or buffer[4] not in _IDS:
                self.header_errors += 1
            elif len(buffer) < size:
                return None
            else:
                frame = bytes(buffer[:size])
                if crc16(frame[:-2]) == frame[-2] + (frame[-1] << 8):
                    del buffer[:size]
                    return frame
                self.crc_errors += 1
            # Only the header goes: a whole frame may stand in what a damaged length claimed.
            self._drop(len(HEADER))
        return None

    def _seek(self) -> None:
        """Drops what precedes the next header, or what cannot become one."""
        at = self._buffer.find(HEADER)
        if at < 0:
            kept = next(n for n in (3, 2, 1, 0) if self._buffer.endswith(HEADER[:n]))
            at = len(self._buffer) - kept
        self._drop(at)

    def _drop(self, count: int) -> None:
        self.garbage_bytes += count
        del self._buffer[:count]


def parse_status(frame: bytes) -> Status:
    """The status in a frame that a `Splitter` returned.

    Raises:
        DxlProtocolError: it is no status; on a bus that echoes it is our own instruction.
    """
    _check_status(frame)
    error = frame[_DATA_AT]
    data = frame[_DATA_AT:-2].replace(_STUFFED, _PLAIN)[1:]
    return Status(frame[4], error & ~ALERT, error >= ALERT, data)


def parse_fast_status(frame: bytes, lengths: Sequence[tuple[int, int]]) -> tuple[Status, ...]:
    """The statuses of a fast sync or fast bulk read.

    Args:
        frame: from a `Splitter`.
        lengths: (device id, number of data bytes) as asked for, in order.

    Raises:
        DxlProtocolError: another set of devices or lengths, or a device's CRC is wrong.
    """
    size = _DATA_AT + sum(length + 4 for _, length in lengths)
    _check_status(frame)
    if frame[4] != BROADCAST_ID:
        raise DxlProtocolError(f"status of id {frame[4]}; id 254 would be right for a fast read")
    if len(frame) != size:
        raise DxlProtocolError(f"fast status of {len(frame)} bytes; {size} would be right")
    statuses = []
    at = _DATA_AT
    crc = crc16(frame[:at])
    for device_id, length in lengths:
        end = at + 2 + length
        if frame[at + 1] != device_id:
            raise DxlProtocolError(f"data of servo {frame[at + 1]}; {device_id} would be right")
        crc = crc16(frame[at:end], crc)
        if crc != frame[end] + (frame[end + 1] << 8):
            raise DxlProtocolError("wrong CRC; the devices disagree", f"servo {device_id}")
        crc = crc16(frame[end : end + 2], crc)
        error = frame[at]
        data = frame[at + 2 : end]
        statuses.append(Status(device_id, error & ~ALERT, error >= ALERT, data))
        at = end + 2
    return tuple(statuses)


def expect_data(status: Status, length: int) -> bytes:
    """The data of a status, once it holds no error number and the right number of bytes.

    An alert passes: its data are valid, and refusing them would hide the fault's cause.

    Raises:
        ServoRefusedError: the error number is not 0.
        DxlProtocolError: more or fewer bytes than asked for.
    """
    if status.error:
        raise ServoRefusedError(status.device_id, status.error)
    if len(status.data) != length:
        raise DxlProtocolError(
            f"{len(status.data)} data bytes; {length} would be right", f"servo {status.device_id}"
        )
    return status.data


def _check_status(frame: bytes) -> None:
    if frame[7] != STATUS or len(frame) < _MIN_STATUS_BYTES:
        raise DxlProtocolError(
            f"instruction {frame[7]:#04x} in {len(frame)} bytes; "
            f"a status (0x55) of {_MIN_STATUS_BYTES} bytes or more would be right"
        )
