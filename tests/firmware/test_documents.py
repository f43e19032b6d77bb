"""What firmware/board tells about itself: the worked example is played, figures are compared."""

from __future__ import annotations

import asyncio
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from dynamixel_sdk import Protocol2PacketHandler

from sphmctl import clock
from sphmctl.board.image import SHIPPED, load
from sphmctl.emulators.board import BUS, DIRECTION_PIN, HOST, Board, Byte, Edge, Options
from sphmctl.emulators.board_bus import BoardBus
from sphmctl.emulators.lines import KNOT_PIN, MOVING_PIN, OK_PIN, STOP_PIN
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.wire import board_table
from tests.firmware.rig import build_settings
from tools import draw_board, make_board_table

BOARD = Path(__file__).resolve().parents[2] / "firmware/board"
PROTOCOL = BOARD / "PROTOCOL.md"
README = BOARD / "README.md"

ANSWER_S = 0.010
"""Until all has come that follows from a frame: a broadcast Ping takes 5 ms of silence."""

BOOT_S = 2.0
HEAD_BYTES = 7
"""Header, id and length; the length counts what comes behind (e-manual, Protocol 2.0)."""

UNKNOWN = ".."


@dataclass(frozen=True)
class Line:
    """A line of the example: a frame and who sends it, or an act; UNKNOWN bytes are None."""

    number: int
    who: str
    frame: tuple[int | None, ...] = ()


def hex_bytes(text: str) -> tuple[int | None, ...]:
    """The bytes a line begins with; words follow after two spaces."""
    found = re.match(r"(?:(?:[0-9A-F]{2}|\.\.)(?: |$))*", text)
    words = found.group().split() if found else []
    return tuple(None if word == UNKNOWN else int(word, 16) for word in words)


def example(text: str) -> Iterator[Line]:
    """The lines of all blocks marked `wire`, in order."""
    line: Line | None = None
    inside = False
    for number, row in enumerate(text.splitlines(), 1):
        if row.startswith("```"):
            inside = row == "```wire"
        elif inside and row.startswith(" "):
            assert line is not None, f"line {number} continues nothing"
            line = Line(line.number, line.who, line.frame + hex_bytes(row.strip()))
        elif inside:
            if line is not None:
                yield line
            who, _, rest = row.partition(" ")
            sends = who in ("host", "bus", "servo", "board")
            line = Line(number, who, hex_bytes(rest.strip())) if sends else Line(number, row)
    if line is not None:
        yield line


def crc_holds(frame: bytes) -> bool:
    """Whether dynamixel-sdk agrees with the last two bytes."""
    size = len(frame) - 2
    crc = Protocol2PacketHandler().updateCRC(0, list(frame[:size]), size)
    return frame[size:] == int(crc).to_bytes(2, "little")


class Cutter:
    """Cuts a stream into frames by their length."""

    def __init__(self) -> None:
        self._data = b""

    def push(self, value: int) -> bytes | None:
        """A whole frame, once it is there."""
        self._data += bytes((value,))
        if len(self._data) < HEAD_BYTES:
            return None
        if len(self._data) < HEAD_BYTES + int.from_bytes(self._data[5:7], "little"):
            return None
        frame, self._data = self._data, b""
        return frame


class Session(Board):
    """The shipped firmware with three servos; notes who sent what, as the example does."""

    def __init__(self) -> None:
        super().__init__(Options(SHIPPED))
        loop = asyncio.get_running_loop()
        assert isinstance(loop, clock.VirtualLoop)
        loop.accompany(self.ahead)
        self.seen: list[tuple[str, bytes]] = []
        self.wrist_ok = False
        self._said: list[bytes] = []
        self._cutters = {HOST: Cutter(), BUS: Cutter()}
        world = World(loop.time)
        servos = [Servo(random.Random(number), number) for number in (1, 2, 3)]
        for servo in servos:
            world.add(servo)
        BoardBus(self, servos, world.advance)
        self._to_servos = self.on.byte[BUS]
        self.on.byte = {HOST: self._at_host, BUS: self._on_bus}
        self.on.edge = self._at_pin
        self.watch(OK_PIN)
        for pin, level in ((KNOT_PIN, True), (MOVING_PIN, True), (STOP_PIN, False)):
            self.drive(pin, level)

    def put(self, port: int, data: bytes, at_s: float | None = None, baud: float = 0.0) -> None:
        """As the board's; what servos say is noted."""
        if port == BUS:
            self._said.append(data)
        super().put(port, data, at_s, baud)

    def _at_host(self, byte: Byte) -> None:
        frame = self._cutters[HOST].push(byte.value)
        if frame is not None:
            servo = self._said[:1] == [frame]
            self.seen.append(("servo" if servo else "board", frame))
            del self._said[: int(servo)]

    def _on_bus(self, byte: Byte) -> None:
        frame = self._cutters[BUS].push(byte.value)
        if frame is not None:
            self.seen.append(("bus", frame))
        self._to_servos(byte)

    def _at_pin(self, edge: Edge) -> None:
        self.wrist_ok = edge.level

    async def act(self, what: str) -> None:
        """Do what a line says in words, or see that it is so."""
        passes = re.fullmatch(r"(\d+) ms pass", what)
        if passes:
            await asyncio.sleep(int(passes[1]) / 1000)
        elif what.startswith("the port is opened"):
            self.reset()
            await asyncio.sleep(BOOT_S)
        elif what == "the controller toggles knot":
            self.drive(KNOT_PIN, False)
        elif what.startswith("the stop is "):
            self.drive(STOP_PIN, what.endswith("pressed"))
        else:
            assert what.startswith("wrist ok is "), f"nobody knows how to do: {what}"
            assert self.wrist_ok == what.endswith("on"), what


def fits(line: Line, who: str, frame: bytes, sent: bytes) -> bool:
    """Whether a frame is the one that the line shows."""
    if line.who != who or not line.frame:
        return line.who == who and frame == sent
    shown = line.frame
    return len(shown) == len(frame) and all(
        a is None or a == b for a, b in zip(shown, frame, strict=True)
    )


async def play(session: Session, lines: list[Line]) -> None:
    """Play the example and compare."""
    sent = b""
    for line in lines:
        if line.who == "host":
            assert session.seen == [], f"line {line.number}: not in the page before it"
            sent = bytes(value for value in line.frame if value is not None)
            assert len(sent) == len(line.frame), f"line {line.number}: a host knows its bytes"
            assert crc_holds(sent), f"line {line.number}: the CRC is wrong"
            session.put(HOST, sent)
            await asyncio.sleep(ANSWER_S)
        elif line.who in ("bus", "servo", "board"):
            assert session.seen, f"line {line.number}: nothing came"
            who, frame = session.seen.pop(0)
            came = f"line {line.number}: what came is {who} {frame.hex(' ').upper()}"
            assert fits(line, who, frame, sent), came
            assert crc_holds(frame), came
        else:
            await session.act(line.who)
    assert session.seen == [], "not in the page at its end"
    assert session.faults == []


async def play_alone(lines: list[Line]) -> dict[str, int]:
    """Play the example on a board of its own; the simulator's counters at the end."""
    session = Session()
    try:
        await play(session, lines)
        return session.stats()
    finally:
        session.close()


def played(text: str) -> dict[str, int]:
    """The example of a page, on the virtual clock."""
    return clock.run(play_alone(list(example(text))), virtual=True)


def test_the_worked_example_is_what_the_firmware_does() -> None:
    played(PROTOCOL.read_text())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("28 EB 01 7D AF", "28 EB 02 7D AF"),
        ("03 00 01 3B FA", "03 00 01 3B FB"),
        ("wrist ok is on\n", "wrist ok is off\n"),
        ("bus    the same\n", ""),
        ("300 ms pass", "150 ms pass"),
    ],
)
def test_an_example_with_a_mistake_is_noticed(old: str, new: str) -> None:
    text = PROTOCOL.read_text()
    assert old in text
    with pytest.raises(AssertionError):
        played(text.replace(old, new, 1))


def test_the_ranges_of_a_read_are_those_of_the_table() -> None:
    ranges: list[list[int]] = []
    for item in board_table.ITEMS:
        if ranges and ranges[-1][1] + 1 == item.address:
            ranges[-1][1] += item.size
        else:
            ranges.append([item.address, item.address + item.size - 1])
    words = [f"{a} to {b}" if a != b else f"{a}" for a, b in ranges]
    assert f"one of these ranges: {', '.join(words)}." in " ".join(PROTOCOL.read_text().split())


def test_each_hindrance_is_explained_by_its_bit() -> None:
    text = PROTOCOL.read_text()
    for item in make_board_table.read_table().items:
        if item.name == "HINDRANCES":
            for bit, (name, _) in enumerate(item.bits):
                assert f"| {bit} {name}" in text


def test_the_readme_names_each_file_of_the_firmware() -> None:
    settings = build_settings()
    named = set(re.findall(r"`([\w.]+)`", README.read_text()))
    files = {Path(name) for name in settings["sources"] + settings["headers"]}
    missing = {file.name for file in files} - named
    # A module is named once, without its ending.
    assert {name for name in missing if name.partition(".")[0] not in named} == set()


def test_the_readme_tells_the_memory_that_the_shipped_firmware_takes() -> None:
    image = load()
    rows = re.findall(r"\| (?:flash|RAM, variables) \| ([\d,]+) of", README.read_text())
    assert [int(row.replace(",", "")) for row in rows] == [image.flash_bytes, image.ram_bytes], (
        "firmware/board/README.md, Memory: `sphmctl firmware build` tells other figures"
    )


def test_the_stack_goes_no_deeper_than_the_readme_says() -> None:
    told = re.search(r"\| stack, deepest \| (\d+) bytes", README.read_text())
    assert told is not None
    assert played(PROTOCOL.read_text())["stack_bytes"] <= int(told[1])


@pytest.mark.parametrize("pin", [KNOT_PIN, MOVING_PIN, STOP_PIN, OK_PIN, DIRECTION_PIN])
def test_pin_table_and_drawing_show_the_pins_that_the_emulators_use(pin: str) -> None:
    row = re.search(rf"\| (D\d+) \| P{pin}\b", README.read_text())
    assert row is not None
    assert re.search(rf">{row[1]} [^<]*P{pin}\b", draw_board.drawing())


@pytest.mark.parametrize("page", [PROTOCOL, README], ids=lambda page: page.name)
def test_links_lead_to_files(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", page.read_text())
    assert links
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_packages_named_in_the_readme_are_those_of_the_build() -> None:
    text = README.read_text()
    assert all(package in text for package in build_settings()["packages"])
