"""Both links of the compiled firmware, by the cycle: how late bytes are, and that none is lost.

The limits are the project's own: first start bit on the bus 15 us after a frame's last stop bit;
towards the host each byte one byte time and 5 us late; the direction pin down 5 us after the last
stop bit. `pytest -s` prints the figures.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from sphmctl import clock
from sphmctl.emulators.board import BUS, HOST, Byte
from sphmctl.wire import board_table as table
from tests.firmware.rig import BOARD, PING, SYNC_READ, SYNC_WRITE, WRITE, instruction
from tests.firmware.simulated import (
    BOOT_US,
    BROADCAST,
    BYTE_US,
    GOAL,
    IDS,
    POSITION,
    SETTLED_US,
    SYNC_READ_17,
    SYNC_WRITE_29,
    TURNAROUND_US,
    Simulated,
    judge,
    noise,
    read,
    us,
    values,
)
from tests.wire import dxl_reference
from tools.bench.soak_board import Cell, soak

DOWN_US = 15.0
UP_US = BYTE_US + 5.0

CROWDED_US = 1000.0
"""Of a servo's byte while the host sends too, which no host of ours does: late, but not lost."""

RELEASE_US = 5.0

PAUSE_US = 100.0
"""Between two frames on the bus when the second one waits for its end; not a limit of the project,
but without one a servo's answer could not be played."""

FAST_SYNC_READ, BULK_READ, BULK_WRITE, REG_WRITE = 0x8A, 0x92, 0x93, 4


@pytest.fixture
def board(built: Path) -> Iterator[Simulated]:
    """A board that lets goals pass."""
    rig = Simulated(built)
    rig.run_until(BOOT_US)
    rig.write(table.BUS_WATCHDOG, 0)
    yield rig
    rig.board.close()


def silent_frame(rng: random.Random, size: int) -> bytes:
    """A frame of `size` bytes, before stuffing, that nobody answers."""
    code, first = rng.choice([(SYNC_WRITE, GOAL), (WRITE, GOAL[:2]), (BULK_WRITE, b"\x01" + GOAL)])
    return instruction(BROADCAST, code, first + noise(rng, max(1, size - 10 - len(first))))


def any_frame(rng: random.Random) -> bytes:
    """An instruction for servos."""
    servo = rng.choice(IDS)
    size = rng.choice((1, 4, 17, 60, 120, 180, rng.randrange(1, 230)))
    return rng.choice(
        [
            SYNC_WRITE_29,
            SYNC_READ_17,
            instruction(servo, PING),
            instruction(BROADCAST, PING),
            read(servo, 132, 4),
            instruction(servo, WRITE, GOAL[:2] + noise(rng, size)),
            instruction(servo, REG_WRITE, GOAL[:2] + noise(rng, size)),
            instruction(BROADCAST, FAST_SYNC_READ, POSITION + bytes(IDS)),
            instruction(BROADCAST, BULK_READ, b"".join(bytes((i,)) + POSITION for i in IDS)),
            silent_frame(rng, size),
            instruction(servo, rng.randrange(0x10, 0x80)),
        ]
    )


@dataclass
class Link:
    """What one frame after the other, each to an idle board, has shown; us."""

    late: list[float] = field(default_factory=list)
    lead: list[float] = field(default_factory=list)
    release: list[float] = field(default_factory=list)

    def note(self, board: Simulated, frame_end_us: float) -> None:
        """One frame."""
        first_us, last_us = us(board.bus[0].end_s) - BYTE_US, us(board.bus[-1].end_s)
        ((rise_us, fall_us),) = board.driving()
        self.late.append(first_us - frame_end_us)
        self.lead.append(first_us - rise_us)
        self.release.append(fall_us - last_us)


def test_a_frame_for_the_servos_starts_on_the_bus_and_the_pin_frames_it(board: Simulated) -> None:
    rng = random.Random(1)
    link = Link()
    for _ in range(330):
        board.forget()
        frame = any_frame(rng)
        end_us = board.put(HOST, frame, board.now_us + 10 + 400 * rng.random())
        board.run_until(end_us + BYTE_US * len(frame) + SETTLED_US)
        assert values(board.bus) == frame
        link.note(board, end_us)
    judge("host to bus, first start bit after the frame's end", link.late, DOWN_US)
    judge("direction pin up before the first start bit", link.lead, DOWN_US)
    judge("direction pin down after the last stop bit", link.release, RELEASE_US)
    assert board.board.faults == []


def lateness(board: Simulated, ends_us: list[float]) -> list[float]:
    """How late each byte's end is at the host, by its end on the bus."""
    return [us(byte.end_s) - end_us for byte, end_us in zip(board.host, ends_us, strict=True)]


def from_servos(
    board: Simulated, rng: random.Random, answers: list[bytes], at_us: float
) -> list[float]:
    """Let servos answer from `at_us` on; each byte's end."""
    ends: list[float] = []
    for answer in answers:
        end_us = board.put(BUS, answer, at_us)
        ends += [end_us - BYTE_US * left for left in reversed(range(len(answer)))]
        at_us = end_us + rng.choice((0.0, rng.uniform(*TURNAROUND_US)))
    return ends


def status(rng: random.Random, servo: int, size: int) -> bytes:
    """A servo's status."""
    return dxl_reference.status(servo, noise(rng, size))


def test_each_byte_of_a_servo_reaches_the_host_in_time(board: Simulated) -> None:
    rng = random.Random(2)
    late: list[float] = []
    for _ in range(150):
        size = rng.choice((1, 4, 30, 189, 200, rng.randrange(200)))
        ids = rng.choice(((1,), IDS))
        question = instruction(
            BROADCAST, SYNC_READ, b"\x84\x00" + size.to_bytes(2, "little") + bytes(ids)
        )
        end_us = board.put(HOST, question, board.now_us + 100 * rng.random())
        begin_us = end_us + DOWN_US + BYTE_US * len(question) + rng.uniform(*TURNAROUND_US)
        board.forget()
        answers = [status(rng, servo, size) for servo in ids]
        ends_us = from_servos(board, rng, answers, begin_us)
        board.run_until(ends_us[-1] + 300)
        assert values(board.bus) == question
        assert values(board.host) == b"".join(answers)
        late += lateness(board, ends_us)
    judge("bus to host, end of each byte", late, UP_US)
    board.check_counters()


@pytest.mark.parametrize("most_gap_us", [0.0, 60.0])
def test_frames_back_to_back_all_reach_the_bus_in_order(
    board: Simulated, most_gap_us: float
) -> None:
    rng = random.Random(3)
    for number in range(60):
        board.forget()
        frames = [
            rng.choice((SYNC_WRITE_29, silent_frame(rng, rng.randrange(14, 200))))
            for _ in range(rng.randrange(1, 6))
        ]
        frames.append(silent_frame(rng, 20) if number % 2 else instruction(BROADCAST, PING))
        at_us = board.now_us + 400 * rng.random()
        for frame in frames:
            at_us = board.put(HOST, frame, at_us) + rng.uniform(0, most_gap_us)
        sent = b"".join(frames)
        board.run_until(at_us + BYTE_US * len(sent) + SETTLED_US)
        assert values(board.bus).hex() == sent.hex()
        check_pin(board, [len(frame) for frame in frames])
    board.check_counters()


def check_pin(board: Simulated, sizes: list[int]) -> None:
    """The direction pin is up in each frame, and down soon after it unless the next one begins."""
    spans = board.driving()
    at = 0
    for size in sizes:
        frame = board.bus[at : at + size]
        begin_us, end_us = us(frame[0].end_s) - BYTE_US, us(frame[-1].end_s)
        (span,) = [(rise, fall) for rise, fall in spans if rise <= begin_us < fall]
        at += size
        next_us = us(board.bus[at].end_s) - BYTE_US if at < len(board.bus) else float("inf")
        assert span[1] >= end_us
        assert span[1] <= end_us + RELEASE_US or next_us <= end_us + RELEASE_US


def test_the_cycle_of_a_run_back_to_back_at_any_phase(board: Simulated) -> None:
    rng = random.Random(4)
    late: list[float] = []
    pause: list[float] = []
    first, second = len(SYNC_WRITE_29), len(SYNC_READ_17)
    for _ in range(100):
        board.forget()
        sent = SYNC_WRITE_29 + SYNC_READ_17
        end_us = board.put(HOST, sent, board.now_us + 400 * rng.random())
        bus_end_us = end_us + BYTE_US * first + DOWN_US + PAUSE_US
        begin_us = bus_end_us + rng.uniform(*TURNAROUND_US)
        answers = [status(rng, servo, 4) for servo in IDS]
        ends_us = from_servos(board, rng, answers, begin_us)
        board.run_until(ends_us[-1] + 200)
        assert values(board.bus).hex() == sent.hex()
        pause.append(us(board.bus[first].end_s) - BYTE_US - us(board.bus[first - 1].end_s))
        assert pause[-1] <= PAUSE_US
        assert values(board.host).hex() == b"".join(answers).hex()
        check_pin(board, [first, second])
        late += lateness(board, ends_us)
    judge("pause between both frames on the bus", pause, PAUSE_US)
    judge("bus to host in the full cycle, end of each byte", late, UP_US)
    board.check_counters()


def test_200_byte_frames_without_a_gap_are_not_lost_on_the_way_down(board: Simulated) -> None:
    rng = random.Random(5)
    board.forget()
    frames = [instruction(BROADCAST, SYNC_WRITE, GOAL + rng.randbytes(186)) for _ in range(5)]
    sent = b"".join(frames)
    end_us = board.put(HOST, sent, board.now_us)
    board.run_until(end_us + 10 * SETTLED_US)
    assert values(board.bus) == sent
    check_pin(board, [len(frame) for frame in frames])
    board.check_counters()


def test_200_byte_statuses_one_behind_the_other_are_not_lost_on_the_way_up(
    board: Simulated,
) -> None:
    rng = random.Random(6)
    board.forget()
    answers = [status(rng, 1 + number % 3, 189) for number in range(40)]
    ends_us: list[float] = []
    at_us = board.now_us + 50
    for answer in answers:
        end_us = board.put(BUS, answer, at_us)
        ends_us += [end_us - BYTE_US * left for left in range(len(answer) - 1, -1, -1)]
        at_us = end_us + TURNAROUND_US[0]
    board.run_until(at_us + SETTLED_US)
    assert values(board.host) == b"".join(answers)
    judge("bus to host, 40 times 200 bytes, end of each byte", lateness(board, ends_us), UP_US)
    board.check_counters()


def test_200_byte_streams_both_ways_at_once_are_not_lost(board: Simulated) -> None:
    rng = random.Random(7)
    late: list[float] = []
    question = instruction(BROADCAST, SYNC_READ, b"\x00\x00\xbd\x00" + bytes(IDS))
    for _ in range(60):
        board.forget()
        end_us = board.put(HOST, question, board.now_us + 400 * rng.random())
        begin_us = end_us + DOWN_US + BYTE_US * len(question) + rng.uniform(*TURNAROUND_US)
        answers = [status(rng, servo, 189) for servo in IDS]
        ends_us = from_servos(board, rng, answers, begin_us)
        frames = [instruction(BROADCAST, SYNC_WRITE, GOAL + noise(rng, 186)) for _ in range(1)]
        at_us = rng.uniform(end_us, ends_us[-1])
        last_us = board.put(HOST, b"".join(frames), at_us)
        board.run_until(max(last_us, ends_us[-1]) + 4 * BYTE_US * 210 + 500)
        assert values(board.host).hex() == b"".join(answers).hex()
        assert values(board.bus).hex() == (question + b"".join(frames)).hex()
        check_pin(board, [len(question), *map(len, frames)])
        late += lateness(board, ends_us)
    judge("bus to host while the host sends, end of each byte", late, CROWDED_US)
    board.check_counters()


BURST_LIMIT_S = 0.025
"""Six reads of 200 bytes take 15 ms."""

DRAIN_S = 3e-3
"""Frames that nobody answers may follow the last status: six of 29 bytes take 1.7 ms."""


async def burst(cell: Cell, rng: random.Random) -> None:
    """2 to 6 frames without a gap to servos and board; bus and host see all of it in order."""
    asked = [ask_one(rng) for _ in range(rng.randrange(2, 7))]
    sent: list[int] = []
    hear = cell.board.on.byte[BUS]

    def note(byte: Byte) -> None:
        sent.append(byte.value)
        hear(byte)

    cell.board.on.byte[BUS] = note
    ids = [servo for _, ids in asked for servo in ids]
    await cell.exchange(b"".join(frame for frame, _ in asked), ids, BURST_LIMIT_S)
    await asyncio.sleep(DRAIN_S)
    cell.board.on.byte[BUS] = hear
    assert bytes(sent) == b"".join(frame for frame, ids in asked if ids != (BOARD,))


def ask_one(rng: random.Random) -> tuple[bytes, tuple[int, ...]]:
    """A frame, and who answers it."""
    servo = rng.choice(IDS)
    return rng.choice(
        [
            (SYNC_WRITE_29, ()),
            (SYNC_READ_17, IDS),
            (read(servo, 132, 4), (servo,)),
            (instruction(servo, PING), (servo,)),
            (read(servo, 0, 200), (servo,)),
            (instruction(BOARD, PING), (BOARD,)),
            (read(BOARD, table.OUTPUTS.address, 84), (BOARD,)),
        ]
    )


async def bursts(firmware: Path, count: int) -> None:
    rng = random.Random(8)
    cell = Cell(firmware, rng)
    try:
        await cell.start()
        for _ in range(count):
            await burst(cell, rng)
            await asyncio.sleep(1e-3 * rng.random())
        cell.check()
        await cell.state()
    finally:
        cell.close()


def test_2_to_6_frames_in_a_row_are_answered_in_order_by_servos_and_board(built: Path) -> None:
    clock.run(bursts(built, 60), virtual=True)


@pytest.mark.parametrize("rate_hz", [50.0, 100.0])
def test_four_seconds_of_the_full_cycle_pass_without_one_error(built: Path, rate_hz: float) -> None:
    figures = clock.run(soak(built, rate_hz, 4.0, print), virtual=True)
    print(figures.line())
    assert figures.cycles == 4 * rate_hz
