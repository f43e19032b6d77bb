"""Who answers in the first second after a reset: a Mega's bootloader, an Uno's, at which rate.

Asked before avrdude, whose own limit is 30 s and whose words are for its authors. Two protocols:
STK500 version 2 (Atmel AVR068, as Arduino's stk500boot.c for the Mega speaks it) and STK500
(Atmel AVR061, as optiboot on an Uno or Nano speaks it).
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import Any, Literal

from sphmctl.board.port import where
from sphmctl.errors import DeviceError

BAUD = 115_200
"""Rate of the Mega's bootloader (stk500boot.c, BAUDRATE)."""

OTHER_RATES = (57_600, 1_000_000)
"""Rates that bootloaders built by users have."""

UNO_RATES = (115_200, 57_600)
"""optiboot on an Uno or a new Nano; the bootloader of old Nanos."""

DTR_LOW_S = 0.05
"""The reset capacitor sees an edge of DTR: low this long, as avrdude does it, be it by command or
because nobody has the port open."""

BOOT_S = 0.1
"""From the edge to the bootloader's first look at its port."""

ASK_S = 0.25
"""How long an answer may take: 11 bytes are 1 ms, USB adds up to 16 ms."""

ASKS = 3
"""The bootloader listens for 0.8 s after a reset; a byte of line noise can cost one question."""

TOKEN, START, ANSWER_BYTES = 0x0E, 0x1B, 64
SIGN_ON, READ_SIGNATURE, STATUS_OK = 0x01, 0x1B, 0x00
"""AVR068, "Message Format" and "Commands"; answers used here are below 64 bytes."""

GET_SYNC, READ_SIGN, CRC_EOP, IN_SYNC, OK = 0x30, 0x75, 0x20, 0x14, 0x10
"""AVR061, "Commands"."""

MEGA_2560 = bytes((0x1E, 0x98, 0x01))
PARTS = {
    MEGA_2560: "ATmega2560 (Arduino Mega 2560)",
    bytes((0x1E, 0x97, 0x03)): "ATmega1280 (the first Arduino Mega)",
    bytes((0x1E, 0x98, 0x02)): "ATmega2561",
    bytes((0x1E, 0x95, 0x0F)): "ATmega328P (Arduino Uno or Nano)",
    bytes((0x1E, 0x95, 0x14)): "ATmega328 (Arduino Uno or Nano)",
    bytes((0x1E, 0x95, 0x87)): "ATmega32U4 (Arduino Leonardo or Micro)",
    bytes((0x1E, 0x94, 0x06)): "ATmega168 (old Arduino Nano)",
}
"""Signatures, from the chapter "Signature Bytes" of each data sheet."""


@dataclass(frozen=True)
class Answer:
    """A bootloader that answered.

    Attributes:
        protocol: its language.
        baud: the rate at which it was understood.
        signature: its part's three bytes; empty when it does not tell.
    """

    protocol: Literal["stk500v2", "stk500v1"]
    baud: int
    signature: bytes

    @property
    def part(self) -> str:
        """The part in words."""
        told = " ".join(f"{byte:02X}" for byte in self.signature) or "none"
        return PARTS.get(self.signature, f"part with signature {told}")


def find(port: str, baud: int) -> Answer | None:
    """Reset the board and ask who is there: a Mega at `baud`, else an Uno, else other rates.

    Takes 0.2 s when the Mega answers, 6 s when nobody does.

    Raises:
        DeviceError: the port is lost or taken meanwhile.
    """
    others = [rate for rate in (BAUD, *OTHER_RATES) if rate != baud]
    questions = [(_ask_v2, baud), *((_ask_v1, rate) for rate in UNO_RATES)]
    # At last the first one again: a machine with other work may have missed the answer.
    questions += [(_ask_v2, rate) for rate in (*others, baud)]
    try:
        answers = (ask(port, rate) for ask, rate in questions)
        return next((answer for answer in answers if answer is not None), None)
    except OSError as error:
        raise DeviceError(f"it was lost meanwhile: {error}", where(port)) from error


def frame_v2(sequence: int, body: bytes) -> bytes:
    """A message of AVR068: start, sequence, size, token, body, sum (exclusive or of all)."""
    head = bytes((START, sequence)) + len(body).to_bytes(2) + bytes((TOKEN,))
    return head + body + bytes((_xor(head + body),))


def body_v2(data: bytes, sequence: int) -> bytes | None:
    """The body of the first whole message with that number in `data`."""
    for at in range(len(data)):
        head = data[at : at + 5]
        if len(head) == 5 and head[0] == START and head[1] == sequence and head[4] == TOKEN:
            end = at + 5 + int.from_bytes(head[2:4])
            if end < len(data) and _xor(data[at:end]) == data[end]:
                return data[at + 5 : end]
    return None


def _ask_v2(port: str, baud: int) -> Answer | None:
    with contextlib.closing(_reset_and_open(port, baud)) as line:
        if _insist_v2(line, 1, bytes((SIGN_ON,))) is None:
            return None
        signature = b""
        for place in range(3):
            # Answer's place, then the four bytes of "Read Signature Byte" of the data sheet.
            question = bytes((READ_SIGNATURE, 4, 0x30, 0, place, 0))
            body = _insist_v2(line, 2 + place, question) or b""
            signature += body[2:3] if body[1:2] == bytes((STATUS_OK,)) else b""
        return Answer("stk500v2", baud, signature)


def _insist_v2(line: Any, sequence: int, body: bytes) -> bytes | None:
    """Ask until an answer with that number comes, be it a late one to an earlier try."""
    heard = b""
    for _ in range(ASKS):
        line.write(frame_v2(sequence, body))
        end_s = time.monotonic() + ASK_S
        while time.monotonic() < end_s and len(heard) < ANSWER_BYTES:
            heard += line.read(max(1, line.in_waiting))
            answer = body_v2(heard, sequence)
            if answer is not None and answer[:1] == body[:1]:
                return answer
    return None


def _ask_v1(port: str, baud: int) -> Answer | None:
    with contextlib.closing(_reset_and_open(port, baud)) as line:
        for _ in range(ASKS):
            if _exchange_v1(line, GET_SYNC, 0) is not None:
                return Answer("stk500v1", baud, _exchange_v1(line, READ_SIGN, 3) or b"")
    return None


def _exchange_v1(line: Any, command: int, count: int) -> bytes | None:
    line.reset_input_buffer()
    line.write(bytes((command, CRC_EOP)))
    heard = b""
    end_s = time.monotonic() + ASK_S
    while time.monotonic() < end_s and len(heard) < count + 2:
        heard += line.read(count + 2 - len(heard))
    if len(heard) == count + 2 and heard[0] == IN_SYNC and heard[-1] == OK:
        return heard[1:-1]
    return None


def _reset_and_open(port: str, baud: int) -> Any:
    """The port, just after the edge of DTR that resets an Arduino."""
    import serial

    time.sleep(DTR_LOW_S)
    try:
        line = serial.Serial(port, baud, timeout=ASK_S / 5, write_timeout=ASK_S, exclusive=True)
    except (OSError, ValueError) as error:
        raise DeviceError(f"it cannot be opened at {baud} baud: {error}", where(port)) from error
    # A pseudo-terminal has no modem lines; there opening alone is the edge.
    with contextlib.suppress(OSError):
        line.dtr = False
        time.sleep(DTR_LOW_S)
        line.dtr = True
    time.sleep(BOOT_S)
    line.reset_input_buffer()
    return line


def _xor(data: bytes) -> int:
    value = 0
    for byte in data:
        value ^= byte
    return value
