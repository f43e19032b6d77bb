"""What the tests of the simulator share: compiled test sketches, and a board that notes all."""

from __future__ import annotations

import subprocess
from pathlib import Path

from sphmctl.emulators.board import BUS, HOST, Board, Byte, Edge, Options

SKETCHES = Path(__file__).parent / "sketches"

BOOTLOADER = Path(
    "/usr/share/arduino/hardware/arduino/avr/bootloaders/stk500v2/stk500boot_v2_mega2560.hex"
)
"""Debian's arduino-core-avr."""

FLAGS = ("-mmcu=atmega2560", "-DF_CPU=16000000UL", "-std=gnu++11", "-Os", "-Wall", "-Wextra")

PING_1 = bytes.fromhex("FFFFFD0001030001194E")
STATUS_1 = bytes.fromhex("FFFFFD000107005500060426655D")
"""Ping of ID 1 and its status (model 1030, firmware 38): ROBOTIS e-manual, Protocol 2.0, "Ping"."""


def compile_sketch(name: str, folder: Path, *defines: str) -> Path:
    """The hex file of a test sketch; whatever is missing fails the test."""
    stem = "-".join((name, *(define.replace("=", "") for define in defines)))
    elf, image = folder / f"{stem}.elf", folder / f"{stem}.hex"
    if not image.exists():
        source = str(SKETCHES / f"{name}.cpp")
        options = [f"-D{define}" for define in defines]
        subprocess.run(["avr-g++", *FLAGS, *options, source, "-o", str(elf)], check=True)
        subprocess.run(
            ["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(elf), str(image)], check=True
        )
    return image


class Rig:
    """A held board 1 ms after power-up, with everything it has done since."""

    def __init__(self, options: Options) -> None:
        self.board = Board(options)
        self.sent: dict[int, list[Byte]] = {HOST: [], BUS: []}
        self.edges: list[Edge] = []
        self.board.on.byte = {port: heard.append for port, heard in self.sent.items()}
        self.board.on.edge = self.edges.append
        self.board.run_us(1000)

    def values(self, port: int = HOST) -> bytes:
        """The bytes sent by a USART so far."""
        return bytes(byte.value for byte in self.sent[port])

    def kinds(self) -> set[str]:
        """What the simulator objected to."""
        return {fault.kind for fault in self.board.faults}

    def ask(self, data: bytes, time_us: float = 500) -> bytes:
        """Send to the firmware as its host; what comes back meanwhile."""
        before = len(self.sent[HOST])
        self.board.put(HOST, data)
        self.board.run_us(time_us)
        return self.values()[before:]
