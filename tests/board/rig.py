"""Boards to flash: the simulated Mega behind its bootloader, and other bootloaders as threads."""

from __future__ import annotations

import os
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sphmctl.emulators.board import Options
from sphmctl.emulators.board_process import Process, simulator

BOOTLOADER = Path(
    "/usr/share/arduino/hardware/arduino/avr/bootloaders/stk500v2/stk500boot_v2_mega2560.hex"
)
"""Debian's arduino-core-avr."""


@contextmanager
def mega(firmware: Path | None) -> Iterator[str]:
    """The port of a simulated Mega in real time; None: with its bootloader only."""
    options = Options(firmware, bootloader=BOOTLOADER, bus_pty=True)
    process = Process(options.arguments("paced"), simulator())
    reader = threading.Thread(target=_swallow, args=(process.fd,))
    reader.start()
    try:
        yield process.ready.split()[0]
    finally:
        process.send("quit\n")
        reader.join()
        process.close()


def _swallow(file: int) -> None:
    while os.read(file, 4096):
        pass


@contextmanager
def answering(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """The port of something that answers each piece it hears."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def serve() -> None:
        while piece := os.read(master, 64):
            if piece == b"end":
                return
            os.write(master, answer(piece))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.write(slave, b"end")
        thread.join()
        os.close(master)
        os.close(slave)


def uno(piece: bytes) -> bytes:
    """optiboot on an ATmega328P: AVR061, "Commands"; everything else is noise to it."""
    answers = {b"\x30\x20": b"\x14\x10", b"\x75\x20": b"\x14\x1e\x95\x0f\x10"}
    return answers.get(piece, b"")


def mega_1280(piece: bytes) -> bytes:
    """STK500 version 2 on an ATmega1280: AVR068, "Commands"."""
    if piece[:1] != b"\x1b" or len(piece) < 7:
        return b""
    body = b"\x01\x00\x08AVRISP_2"
    if piece[5] == 0x1B:
        body = bytes((0x1B, 0, b"\x1e\x97\x03"[piece[9]], 0))
    frame = bytes((0x1B, piece[1], 0, len(body), 0x0E)) + body
    total = 0
    for byte in frame:
        total ^= byte
    return frame + bytes((total,))
