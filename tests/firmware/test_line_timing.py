"""The lines of the compiled firmware, by the cycle: how fast "wrist ok" falls, and edge stamps.

The limits are the project's own: 1 ms after the watchdog time, 1 ms after the stop was pressed,
4 us for the stamp of an edge of "knot". `pytest -s` prints the figures.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from sphmctl.emulators.board import BUS, DIRECTION_PIN, HOST
from sphmctl.emulators.lines import KNOT_PIN, STOP_PIN
from sphmctl.wire import board_table as table
from tests.firmware.rig import (
    ACTION,
    BOARD,
    PING,
    REBOOT,
    REG_WRITE,
    SYNC_WRITE,
    WRITE,
    instruction,
)
from tests.firmware.simulated import (
    BOOT_US,
    BROADCAST,
    BYTE_US,
    GOAL,
    IDS,
    SYNC_READ_17,
    SYNC_WRITE_29,
    Simulated,
    judge,
    noise,
    read,
    statuses,
    us,
    values,
)
from tests.wire import dxl_reference

FALL_US = 1000.0
STAMP_US = 4.0

BABBLED_US = 10_000.0
"""The same while damaged frames fill the host's wire without a gap: they are looked at too."""

LATEST_US = 12_000.0
"""So long is looked on, to have a figure of what fails."""

UNIT_US = 20_000.0
"""One digit of Bus Watchdog (e-manual, XL430-W250)."""

DEBOUNCE_US = 2000.0
"""Of "knot"; PROTOCOL.md."""

CYCLE_US = 2500.0
"""Twice as much traffic as at any rate that a run has."""

TRAFFIC = {"nothing": FALL_US, "servos": FALL_US, "host": BABBLED_US, "both": BABBLED_US}
"""What is on the wires, and how late "wrist ok" may fall."""


@pytest.fixture
def dark(built: Path) -> Iterator[Simulated]:
    """A board that is about to be powered up."""
    rig = Simulated(built)
    yield rig
    rig.board.close()


@pytest.fixture
def board(dark: Simulated) -> Simulated:
    """A board that has just booted, in its safe state."""
    dark.run_until(BOOT_US)
    return dark


def talk(
    board: Simulated, rng: random.Random, traffic: str, begin_us: float, end_us: float
) -> None:
    """Fill the wires without a gap: statuses of servos, and what no host should say."""
    if traffic in ("servos", "both"):
        at_us = begin_us
        while at_us < end_us:
            at_us = board.put(BUS, dxl_reference.status(rng.choice(IDS), noise(rng, 189)), at_us)
    if traffic in ("host", "both"):
        at_us = begin_us
        while at_us < end_us:
            at_us = board.put(HOST, damaged(rng), at_us)


def damaged(rng: random.Random) -> bytes:
    """A goal for servos or something for the board, its CRC wrong: no sign of a living host."""
    frame = instruction(rng.choice((1, BOARD, BROADCAST)), WRITE, GOAL[:2] + noise(rng, 150))
    return frame[:-1] + bytes((frame[-1] ^ 0x40,))


def fall_us(board: Simulated) -> float:
    """When "wrist ok" fell; it did nothing else."""
    edges = board.ok_edges()
    assert [level for _, level in edges] == [False]
    return edges[0][0]


def recover(board: Simulated) -> None:
    """Until everything on the wires is done with, also what the board had to hold back."""
    board.run_until(board.now_us + 30_000)


@pytest.mark.parametrize("traffic", TRAFFIC)
def test_wrist_ok_falls_when_the_host_has_been_silent_for_the_watchdog_time(
    board: Simulated, traffic: str
) -> None:
    rng = random.Random(traffic)
    late: list[float] = []
    for number in range(16):
        units = 2 if number == 0 else 1
        board.arm(units)
        board.forget()
        last = rng.choice((instruction(BOARD, PING), read(BOARD, 0, 16), SYNC_WRITE_29))
        end_us = board.put(HOST, last, board.now_us + 2000 * rng.random())
        due_us = end_us + units * UNIT_US
        talk(board, rng, traffic, end_us + 1000, due_us + LATEST_US)
        board.run_until(due_us + LATEST_US)
        late.append(fall_us(board) - due_us)
        recover(board)
    judge(f"wrist ok after the watchdog time, {traffic} on the wires", late, TRAFFIC[traffic])


@pytest.mark.parametrize("traffic", TRAFFIC)
def test_wrist_ok_falls_when_the_stop_is_pressed(board: Simulated, traffic: str) -> None:
    rng = random.Random(traffic)
    late: list[float] = []
    for _ in range(16):
        board.arm(100)
        board.forget()
        begin_us = board.now_us + 100
        pressed_us = board.drive(STOP_PIN, True, begin_us + 500 + 4000 * rng.random())
        talk(board, rng, traffic, begin_us, pressed_us + LATEST_US)
        board.run_until(pressed_us + LATEST_US)
        late.append(fall_us(board) - pressed_us)
        recover(board)
        board.board.drive(STOP_PIN, False)
        recover(board)
    judge(f"wrist ok after the stop was pressed, {traffic} on the wires", late, TRAFFIC[traffic])


def test_after_the_watchdog_time_the_servos_are_told_to_hold(board: Simulated) -> None:
    board.arm(1)
    board.forget()
    board.run_until(board.now_us + UNIT_US + 1000)
    # Bus Watchdog of every servo at its shortest (e-manual, XL430-W250, "Bus Watchdog").
    assert values(board.bus) == instruction(BROADCAST, WRITE, b"\x62\x00\x01")
    told_us = us(board.bus[-1].end_s) - fall_us(board)
    judge("hold at the servos after wrist ok fell", [told_us], FALL_US)


def goals(rng: random.Random) -> bytes:
    """A frame that would move a servo."""
    code, parameters = rng.choice(
        (
            (WRITE, GOAL[:2] + bytes(4)),
            (REG_WRITE, GOAL[:2] + bytes(4)),
            (SYNC_WRITE, GOAL + b"\x01" + bytes(4)),
            (ACTION, b""),
        )
    )
    return instruction(
        BROADCAST if code == SYNC_WRITE else rng.choice((1, 2, BROADCAST)), code, parameters
    )


def goals_until(
    board: Simulated, rng: random.Random, begin_us: float, end_us: float, gap_us: float = 0.0
) -> float:
    """A host that knows nothing of resets and goes on sending goals; when the last one ends."""
    at_us = begin_us
    while at_us < end_us:
        at_us = board.put(HOST, goals(rng), at_us + gap_us)
    return at_us


def test_at_power_up_wrist_ok_stays_low_and_no_goal_passes(dark: Simulated) -> None:
    end_us = goals_until(dark, random.Random(1), 0.0, 15_000.0)
    question = read(1, 132, 4)
    dark.put(HOST, question, end_us + 30_000)
    dark.run_until(end_us + 40_000)
    assert dark.ok_edges() == []
    assert values(dark.bus) == question
    assert len([edge for edge in dark.edges if edge.pin == DIRECTION_PIN]) == 2
    assert {(one.device_id, one.error) for one in statuses(dark.host)} == {(1, 4), (2, 4)}


def reset_amid_goals(board: Simulated, rng: random.Random, how: str) -> None:
    """Goals, and a reset somewhere among them; until the board runs again.

    A Reboot waits its turn behind goals that nobody answers, 3 ms for each.
    """
    begin_us = board.now_us
    at_us = goals_until(board, rng, begin_us, begin_us + 3000, 500.0)
    if how == "Reboot":
        at_us = board.put(HOST, instruction(BOARD, REBOOT), at_us)
    goals_until(board, rng, at_us, begin_us + 60_000)
    if how == "the button":
        board.run_until(begin_us + 1000 + 2000 * rng.random())
        board.board.reset()
    board.run_until(begin_us + 130_000)


@pytest.mark.parametrize("how", ["the button", "Reboot"])
def test_at_a_reset_wrist_ok_falls_and_no_goal_passes_after_it(board: Simulated, how: str) -> None:
    rng = random.Random(how)
    resets: list[float] = []
    board.board.on.reset = resets.append
    falls: list[float] = []
    for _ in range(5):
        resets.clear()
        board.arm(100)
        board.forget()
        reset_amid_goals(board, rng, how)
        (reset_us,) = map(us, resets)
        falls.append(max(0.0, fall_us(board) - reset_us))
        assert [byte for byte in board.bus if us(byte.end_s) > reset_us] == []
        assert board.read(table.BUS_WATCHDOG, table.BUS_WATCHDOG) == {"BUS_WATCHDOG": 255}
    judge(f"wrist ok after a reset by {how}", falls, 0.0)


def background(board: Simulated, rng: random.Random, begin_us: float, end_us: float) -> None:
    """The full cycle of a run, again and again."""
    sent = SYNC_WRITE_29 + SYNC_READ_17
    at_us = begin_us
    while at_us < end_us:
        answer_us = board.put(HOST, sent, at_us) + BYTE_US * len(SYNC_WRITE_29) + 150
        for servo in IDS:
            answer = dxl_reference.status(servo, rng.randbytes(4))
            answer_us = board.put(BUS, answer, answer_us) + 50
        at_us += CYCLE_US


def knots(board: Simulated, edges: int) -> tuple[int, list[int]]:
    """The number of debounced edges, and the stamps of the newest `edges` of them, oldest first."""
    state = board.read(table.KNOT_EDGES, table.KNOT_RAW_EDGES)
    count = state["KNOT_EDGES"]
    numbers = range(count - edges + 1, count + 1)
    return count, [state[f"KNOT_STAMP_{number % 4}"] for number in numbers]


@pytest.mark.parametrize(("traffic", "bounces"), [(False, 0), (False, 3), (True, 0)])
def test_edges_of_knot_are_stamped_when_they_come(
    board: Simulated, traffic: bool, bounces: int
) -> None:
    rng = random.Random(bounces)
    board.write(table.BUS_WATCHDOG, 0)
    zero_us = board.clock_start_us()
    off: list[float] = []
    level = True
    for number in range(1, 26):
        at_us = board.now_us + 1000
        driven: list[float] = []
        for _ in range(4):
            at_us += 1.5 * DEBOUNCE_US + 1500 * rng.random()
            level = not level
            driven.append(board.drive(KNOT_PIN, level, at_us))
            for _ in range(2 * rng.randrange(bounces + 1)):
                at_us += rng.choice((60.0, 200.0)) * (1 + rng.random())
                level = not level
                board.drive(KNOT_PIN, level, at_us)
        end_us = at_us + DEBOUNCE_US + 1000
        if traffic:
            background(board, rng, board.now_us + CYCLE_US * rng.random(), end_us - CYCLE_US)
        board.run_until(end_us + CYCLE_US)
        count, stamps = knots(board, 4)
        assert count == 4 * number
        off += [stamp - (edge - zero_us) for stamp, edge in zip(stamps, driven, strict=True)]
    name = f"stamp of knot, traffic {traffic}, up to {2 * bounces} bounces"
    judge(name, off, STAMP_US, -STAMP_US)
    board.check_counters()


@pytest.mark.parametrize("traffic", [False, True])
def test_the_newest_edge_of_a_burst_has_its_stamp_before_any_debouncing(
    board: Simulated, traffic: bool
) -> None:
    rng = random.Random(4)
    board.write(table.BUS_WATCHDOG, 0)
    zero_us = board.clock_start_us()
    off: list[float] = []
    level = True
    edges = 0
    for _ in range(60):
        at_us = board.now_us + 500 + 500 * rng.random()
        if traffic:
            background(board, rng, board.now_us, at_us)
        for _ in range(rng.randrange(1, 8)):
            at_us += 250 + 500 * rng.random()
            level = not level
            edge_us = board.drive(KNOT_PIN, level, at_us)
            edges += 1
        board.run_until(at_us + CYCLE_US)
        state = board.read(table.KNOT_RAW_STAMP, table.KNOT_RAW_EDGES)
        off.append(state["KNOT_RAW_STAMP"] - (edge_us - zero_us))
        if not traffic:
            assert state["KNOT_RAW_EDGES"] == edges
    judge(f"stamp of a burst's newest edge, traffic {traffic}", off, STAMP_US, -STAMP_US)
    board.check_counters()
