"""The board's C++ modules on a PC, under sanitizers; plays host, servos and lines."""

from __future__ import annotations

import hashlib
import subprocess
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sphmctl.wire import dxl
from tests.wire import dxl_reference

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
HERE = Path(__file__).resolve().parent

TICKS_PER_US = 2
KNOT, MOVING, STOP = 1, 2, 4

BOARD = 200
PING, READ, WRITE, REG_WRITE, ACTION, REBOOT = 1, 2, 3, 4, 5, 8
SYNC_READ, SYNC_WRITE, BULK_WRITE = 0x82, 0x83, 0x93

OK = dxl.Status(BOARD, 0, False, b"")


def build_settings() -> dict[str, Any]:
    """firmware/board/build.toml."""
    return tomllib.loads((FIRMWARE / "board/build.toml").read_text())


def build_hash() -> int:
    """The number that a build of the present sources carries, as build.toml defines it."""
    settings = build_settings()
    digest = hashlib.sha256()
    for name in sorted(["board/build.toml", *settings["sources"], *settings["headers"]]):
        digest.update(name.encode() + b"\0" + (FIRMWARE / name).read_bytes() + b"\0")
    return int.from_bytes(digest.digest()[:4], "big")


def compile_driver(folder: Path) -> Path:
    """All modules but the registers, with driver.cpp and what plays the registers."""
    modules = [
        FIRMWARE / name
        for name in build_settings()["sources"]
        if name.endswith(".cpp") and name not in ("board/hal_avr.cpp", "main.cpp")
    ]
    program = folder / "driver"
    command = ["g++", "-std=c++11", "-O1", "-g", "-fsanitize=address,undefined"]
    command += ["-fno-sanitize-recover=all", "-Wall", "-Wextra", "-Werror"]
    command += [f"-I{HERE}", f"-I{FIRMWARE / 'board'}", *map(str, modules)]
    command += [str(HERE / "hal_host.cpp"), str(HERE / "driver.cpp"), "-o", str(program)]
    subprocess.run(command, check=True, timeout=100)
    return program


@dataclass
class Seen:
    """What came out of the board during one run; times in us since the driver's start.

    Attributes:
        host: bytes to the host.
        bus: bytes to the servos.
        host_at: when each byte to the host was written.
        bus_at: the same for the bus.
        driving: (time, whether the direction pin drives).
        wrist_ok: (time, level).
        resets: when the board reset itself.
        faults: what no board may do: 0 byte lost, 1 sent undriven, 2 released early.
    """

    host: bytearray = field(default_factory=bytearray)
    bus: bytearray = field(default_factory=bytearray)
    host_at: list[float] = field(default_factory=list)
    bus_at: list[float] = field(default_factory=list)
    driving: list[tuple[float, int]] = field(default_factory=list)
    wrist_ok: list[tuple[float, int]] = field(default_factory=list)
    resets: list[float] = field(default_factory=list)
    faults: list[int] = field(default_factory=list)

    def add(self, what: str, at_us: float, value: int) -> None:
        """One event of the driver."""
        if what == "h":
            self.host.append(value)
            self.host_at.append(at_us)
        elif what == "b":
            self.bus.append(value)
            self.bus_at.append(at_us)
        elif what == "d":
            self.driving.append((at_us, value))
        elif what == "w":
            self.wrist_ok.append((at_us, value))
        elif what == "r":
            self.resets.append(at_us)
        else:
            self.faults.append(value)


class Rig:
    """One driver process; after `start` a board with the stop released and the lines low."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.now_us = 0.0

    def close(self) -> None:
        """Ends the process; it must not have failed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        code = self._process.wait(timeout=10)
        self._process.stdout.close()
        assert code == 0

    def tell(self, line: str) -> list[list[str]]:
        """Sends a command; returns the lines of its answer, in words."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        answer: list[list[str]] = []
        while True:
            words = self._process.stdout.readline().split()
            assert words, f"the driver died at {line[:60]!r}"
            if words[0] == "ok":
                self.now_us = int(words[1]) / TICKS_PER_US
                return answer
            answer.append(words)

    def start(self) -> None:
        """Power-up: stop released, knot and moving without voltage."""
        self.tell(f"low {STOP}")
        self.tell(f"high {KNOT}")
        self.tell(f"high {MOVING}")
        self.tell("start")

    def run(self, time_us: float) -> Seen:
        """Lets the board work for a time."""
        seen = Seen()
        for what, ticks, value in self.tell(f"run {int(time_us * TICKS_PER_US)}"):
            seen.add(what, int(ticks) / TICKS_PER_US, int(value))
        return seen

    def send(self, data: bytes, time_us: float = 0.0) -> Seen:
        """Bytes from the host, without a gap; runs until they are done with, and `time_us` on."""
        self.tell(f"host {data.hex()}")
        return self.run(10 * len(data) + 1500 + time_us)

    def hear(self, data: bytes) -> Seen:
        """Bytes from the servos, now."""
        self.tell(f"bus {data.hex()}")
        return self.run(10 * len(data) + 300)

    def reply(self, data: bytes, delay_us: int = 50) -> None:
        """What the servos answer the next time the board has released the bus."""
        self.tell(f"reply {delay_us * TICKS_PER_US} {data.hex()}")

    def table(self, address: int, size: int = 1) -> int:
        """An item, past the wire."""
        ((_, text),) = self.tell(f"table {address} {size}")
        return int.from_bytes(bytes.fromhex(text), "little")

    def line(self, mask: int, high: bool) -> None:
        """Sets an input pin."""
        self.tell(f"{'high' if high else 'low'} {mask}")

    def write(self, address: int, value: int, size: int = 1) -> dxl.Status:
        """Writes to the board."""
        data = address.to_bytes(2, "little") + value.to_bytes(size, "little")
        return status_of(self.send(instruction(BOARD, WRITE, data)))

    def arm(self) -> None:
        """Everything that wrist ok needs, watchdog at 100 ms."""
        for address, value in ((98, 0), (98, 5), (64, 1), (116, 1)):
            assert self.write(address, value) == OK


def instruction(device_id: int, code: int, parameters: bytes = b"") -> bytes:
    """A frame from the host, by the codec that the tests have of their own."""
    return dxl_reference.frame(device_id, bytes([code]) + parameters)


def statuses_of(seen: Seen) -> list[dxl.Status]:
    """All statuses that came to the host; there was nothing else."""
    splitter = dxl.Splitter()
    splitter.feed(bytes(seen.host))
    statuses = []
    while (frame := splitter.next_frame()) is not None:
        statuses.append(dxl.parse_status(frame))
    assert (splitter.garbage_bytes, splitter.pending_bytes) == (0, 0)
    return statuses


def status_of(seen: Seen) -> dxl.Status:
    """The one status that came to the host."""
    (status,) = statuses_of(seen)
    return status
