"""A simulated board: the compiled firmware, its serial ports and pins, in held or in real time.

Held, the board stands still until `run_us`, or `ahead` of a virtual loop, lets it go on: every
byte and edge has its exact cycle, and two runs are alike to the cycle. Paced, it follows the
monotonic clock, its host port is a pseudo-terminal, and it waits (briefly) at the end of each
message on the servo bus until this side has seen it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from sphmctl.emulators.board_process import BoardError, Process, simulator

CLOCK_HZ = 16_000_000
"""The board's crystal; the simulator counts its cycles."""

HOST, BUS = 0, 1
"""Numbers of the USARTs."""

_ERRORS = ("overruns", "framing", "collisions", "tx_lost", "tx_ignored", "line_full", "dropped")
SIMULATOR_ERRORS = tuple(f"{name}{port}" for name in _ERRORS for port in (HOST, BUS))
"""Counters in `Board.stats` that stay at 0 while all is well."""

DIRECTION_PIN = "E4"
"""Direction of the half-duplex bus, high while the board drives: D2 of an Arduino Mega, as on
ROBOTIS' DYNAMIXEL Shield."""

LONGEST_RUN_S = 1.0
"""Most simulated time in one exchange, which keeps within the simulator's time limit."""

Mode = Literal["held", "paced"]


@dataclass(frozen=True)
class Byte:
    """A byte that the firmware has sent.

    Attributes:
        end_s: end of its stop bit.
        value: the byte.
        baud: the firmware's rate.
    """

    end_s: float
    value: int
    baud: float


@dataclass(frozen=True)
class Edge:
    """A watched pin has changed."""

    at_s: float
    pin: str
    level: bool


@dataclass(frozen=True)
class Fault:
    """What the simulator objects to.

    Attributes:
        at_s: when.
        kind: `collision`, `tx_lost`, `overrun`, `tx_ignored`, `dead`.
        port: USART number; -1 for `dead`.
    """

    at_s: float
    kind: str
    port: int


@dataclass(frozen=True)
class Options:
    """How a board is set up.

    Attributes:
        firmware: Intel hex file of the sketch; None for a board with a bootloader only.
        bootloader: Intel hex file; then every reset begins in it.
        eeprom: file that keeps the EEPROM between runs.
        host_link: symbolic link to the host's pseudo-terminal (paced).
        bus_pty: whether the bus is a pseudo-terminal too, without servos of ours (paced).
        bus_link: symbolic link to that.
        reset_on_open: whether opening the host's port resets the board, as DTR does on an Arduino.
        direction_pin: None for a full-duplex bus.
    """

    firmware: Path | None
    bootloader: Path | None = None
    eeprom: Path | None = None
    host_link: Path | None = None
    bus_pty: bool = False
    bus_link: Path | None = None
    reset_on_open: bool = True
    direction_pin: str | None = DIRECTION_PIN

    def arguments(self, mode: Mode) -> list[str]:
        """The simulator's command line."""
        words: list[str] = []
        if mode == "paced":
            words += ["--paced", "--pty", _pty(HOST, self.host_link)]
            words += ["--pty", _pty(BUS, self.bus_link)] if self.bus_pty else ["--sync"]
            words += ["--reset-on-open"] if self.reset_on_open else []
        words += ["--bus", self.direction_pin] if self.direction_pin else []
        words += ["--boot", str(self.bootloader)] if self.bootloader else []
        words += ["--eeprom", str(self.eeprom)] if self.eeprom else []
        return words + ([str(self.firmware)] if self.firmware else [])


def _pty(number: int, link: Path | None) -> str:
    if link is not None and link.exists() and not link.is_symlink():
        raise BoardError(f"{link}: exists and is no symbolic link; name another place")
    return f"{number}={link}" if link else str(number)


def _raise(error: BoardError) -> None:
    raise error


@dataclass
class Handlers:
    """Whom the board tells; each may be replaced at any time.

    A loss of the simulator that nobody takes is raised where it is noticed.
    """

    byte: dict[int, Callable[[Byte], None]] = field(default_factory=dict)
    edge: Callable[[Edge], None] = lambda _: None
    fault: Callable[[Fault], None] = lambda _: None
    reset: Callable[[float], None] = lambda _: None
    client: Callable[[int, bool], None] = lambda _port, _opened: None
    lost: Callable[[BoardError], None] = _raise


class Board:
    """A simulated Arduino Mega 2560, powered up and running.

    Times are the running loop's; without a loop (held) they count from power-up.

    Args:
        options: how it is set up.
        mode: "held" or "paced"; paced needs a running loop.
        program: the simulator; compiled when None.

    Raises:
        BoardError: no simulator, or a file it cannot load.
    """

    def __init__(
        self, options: Options, mode: Mode = "held", *, program: Path | None = None
    ) -> None:
        self.on = Handlers()
        self.faults: list[Fault] = []
        self._held = mode == "held"
        self._loop = _running_loop()
        self._process = Process(options.arguments(mode), program or simulator())
        host, bus = self._process.ready.split()
        self.port, self.bus_port = host, bus
        self._origin_s = self._loop.time() if self._loop is not None else 0.0
        self._pending: list[str] = []
        self._baud: dict[int, float] = {}
        self._open = True
        if not self._held:
            if self._loop is None:
                raise BoardError("a paced board needs a running loop")
            self._loop.add_reader(self._process.fd, self._readable)

    # Time --------------------------------------------------------------------------------------

    def time_s(self, cycle: int) -> float:
        """When a cycle was or will be."""
        return self._origin_s + cycle / CLOCK_HZ

    def cycle(self, at_s: float) -> int:
        """The cycle at an instant."""
        return max(0, round((at_s - self._origin_s) * CLOCK_HZ))

    def run_us(self, time_us: float) -> None:
        """Held and without a loop: go on for `time_us`, handling what happens on return."""
        target = self.now_cycle() + round(time_us * CLOCK_HZ / 1e6)
        while (cycle := self.now_cycle()) < target:
            step = min(target, cycle + int(LONGEST_RUN_S * CLOCK_HZ))
            events, _ = self._process.ask(f"through {step}", "at")
            self._handle(events)

    def ahead(self, now_s: float, until_s: float) -> float:
        """Held: go on until the board does something, at most to `until_s`; when that was.

        A virtual loop that is about to jump asks this first, and jumps no further: what the board
        does is then seen at its instant. What has happened is handled in the loop's next turn.
        """
        if not self._open:
            return until_s
        until_s = min(until_s, now_s + LONGEST_RUN_S)
        target = self.cycle(until_s)
        try:
            events, at = self._process.ask(f"to {target}", "at")
        except BoardError as error:
            self._lose(error)
            return until_s
        if events:
            asyncio.get_running_loop().call_soon(self._handle, events)
        return until_s if int(at) >= target else max(now_s, self.time_s(int(at)))

    def now_cycle(self) -> int:
        """Where the board is."""
        return self.stats()["cycle"]

    # Doing -------------------------------------------------------------------------------------

    def put(self, port: int, data: bytes, at_s: float | None = None, baud: float = 0.0) -> None:
        """Let bytes arrive at a USART, back to back, from `at_s` (now) or as soon as it is free.

        Args:
            port: `HOST` (held only) or `BUS`.
            data: what.
            at_s: the first start bit's instant.
            baud: the sender's rate; 0: exactly the firmware's own.
        """
        if self._baud.get(port, 0.0) != baud:
            self._baud[port] = baud
            self._send(f"rate {port} {round(baud)}\n")
        cycle = 0 if at_s is None else self.cycle(at_s)
        self._send(f"put {port} {cycle} {data.hex()}\n")

    def drive(self, pin: str, level: bool | None, at_s: float | None = None) -> None:
        """Drive an input pin, say "L0", from `at_s` (now) on; None lets go of it."""
        cycle = 0 if at_s is None else self.cycle(at_s)
        self._send(f"drive {pin} {-1 if level is None else int(level)} {cycle}\n")

    def watch(self, pin: str) -> None:
        """Tell `on.edge` of each change of a pin."""
        self._send(f"watch {pin}\n")

    def reset(self) -> None:
        """Press the reset button."""
        self._send("reset\n")

    def stats(self) -> dict[str, int]:
        """Counters by name, as `rx_bytes0` or `stack_bytes` (the simulator's README has all)."""
        words = (pair.partition("=") for pair in self._ask("stats", "stats").split())
        return {name: int(value) for name, _, value in words}

    def memory(self, address: int, count: int) -> bytes:
        """Bytes of data memory: registers, I/O and RAM."""
        return bytes.fromhex(self._ask(f"memory {address} {count}", "memory"))

    def close(self) -> None:
        """Power down; the EEPROM is stored and the pseudo-terminals go. May be called again."""
        if self._open:
            self._open = False
            if not self._held and self._loop is not None:
                self._loop.remove_reader(self._process.fd)
            self._process.close()

    # Inside ------------------------------------------------------------------------------------

    def _send(self, lines: str) -> None:
        if not self._open:
            return
        try:
            self._process.send(lines)
        except BoardError as error:
            self._lose(error)

    def _lose(self, error: BoardError) -> None:
        self.close()
        self.on.lost(error)

    def _ask(self, command: str, answer: str) -> str:
        events, rest = self._process.ask(command, answer)
        if events and self._loop is not None:
            self._loop.call_soon(self._handle, events)
        else:
            self._handle(events)
        return rest

    def _readable(self) -> None:
        try:
            self._handle(self._process.read())
        except BoardError as error:
            self._lose(error)

    def _handle(self, lines: list[str]) -> None:
        for line in lines:
            word, *rest = line.split()
            if word == "byte":
                self._handle_byte(rest)
            elif word == "pin":
                self.on.edge(Edge(self.time_s(int(rest[1])), rest[0], rest[2] == "1"))
            elif word == "sync":
                self._send("ack\n")
            elif word == "client":
                self.on.client(int(rest[0]), rest[2] == "1")
            elif word == "reset":
                self.on.reset(self.time_s(int(rest[0])))
            elif word == "origin":
                # The simulator's clock is CLOCK_MONOTONIC, and so is that of asyncio's loops.
                self._origin_s = int(rest[0]) / 1e9
            elif word == "wrong":
                raise BoardError(f"the board simulator does not know: {' '.join(rest)}")
            else:
                self._handle_fault(word, rest)

    def _handle_byte(self, rest: list[str]) -> None:
        handler = self.on.byte.get(int(rest[0]))
        if handler is not None:
            baud = CLOCK_HZ / int(rest[3])
            handler(Byte(self.time_s(int(rest[1])), int(rest[2], 16), baud))

    def _handle_fault(self, kind: str, rest: list[str]) -> None:
        port, cycle = (-1, rest[0]) if kind == "dead" else (int(rest[0]), rest[1])
        fault = Fault(self.time_s(int(cycle)), kind, port)
        self.faults.append(fault)
        self.on.fault(fault)


def _running_loop() -> asyncio.AbstractEventLoop | None:
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
