"""The simulated USART against the ATmega2560 data sheet, chapter 22, in cycle-exact time."""

from __future__ import annotations

import pytest

from sphmctl.emulators.board import CLOCK_HZ, HOST
from tests.avrsim.conftest import MakeRig

GPIOR0 = 0x3E
"""Data address of a free register in which the sketches leave a byte."""

DIVIDER_115200 = "HOST_DIVIDER=16"
"""UBRR of 115,200 with U2X at 16 MHz: 117,647 baud really (data sheet, table 22-12)."""


def test_an_echo_takes_a_byte_time_and_what_the_loop_needs(rig: MakeRig) -> None:
    one = rig("echo")
    one.board.put(HOST, b"A", at_s=0.002)
    one.board.run_us(2000)
    (byte,) = one.sent[HOST]
    # Start bit at 2000 us, 10 us in, 10 us out, and some 20 instructions of the loop.
    assert 2019.75 < byte.end_s * 1e6 < 2022.5
    assert byte.baud == 1_000_000


def test_the_transmit_buffer_is_refilled_while_a_byte_is_sent(rig: MakeRig) -> None:
    one = rig("interrupts")
    assert one.ask(b"2") == b"22"
    first, second = one.sent[HOST]
    assert round((second.end_s - first.end_s) * CLOCK_HZ) == 160


def test_an_interrupt_takes_the_cycles_of_the_data_sheet(rig: MakeRig) -> None:
    one = rig("interrupts")
    one.board.watch("B7")
    one.board.drive("D0", True)
    one.board.run_us(10)
    one.board.drive("D0", False, at_s=0.0015)
    one.board.run_us(1000)
    (edge,) = one.edges
    # 5 to enter and 3 for the vector's jump (7.8.1); up to 2 for the instruction under way, and one
    # that libsimavr lets run before.
    assert 8 <= round((edge.at_s - 0.0015) * CLOCK_HZ) <= 12


def test_a_stream_comes_through_a_fast_reader_whole(rig: MakeRig) -> None:
    one = rig("echo")
    message = bytes(range(200))
    assert one.ask(message, 3000) == message
    assert one.board.faults == []


def test_a_slow_reader_loses_the_frame_that_the_fourth_start_bit_finds_waiting(
    rig: MakeRig,
) -> None:
    one = rig("echo", "FETCH_DELAY_US=60")
    # 1 is fetched; 2 and 3 fill the buffer, 4 waits in the shift register, 5 begins.
    assert one.ask(b"12345") == b"1235"
    assert one.kinds() == {"overrun"}
    assert one.board.stats()["overruns0"] == 1


def test_transmit_complete_comes_once_after_all_is_sent(rig: MakeRig) -> None:
    one = rig("interrupts")
    one.board.put(HOST, b"ABC")
    one.board.run_us(500)
    completed = one.board.memory(GPIOR0, 1)[0]
    gaps = [b.end_s - a.end_s for a, b in zip(one.sent[HOST], one.sent[HOST][1:], strict=False)]
    pauses = sum(gap > 10.05e-6 for gap in gaps)
    assert completed == 1 + pauses


@pytest.mark.parametrize("baud", [113_000, 115_200, 117_647, 121_000])
def test_a_rate_within_tolerance_is_understood(rig: MakeRig, baud: int) -> None:
    one = rig("echo", DIVIDER_115200)
    one.board.put(HOST, b"right", baud=baud)
    one.board.run_us(2000)
    assert one.values() == b"right"


@pytest.mark.parametrize("baud", [57_600, 230_400, 1_000_000])
def test_a_wrong_rate_gives_garbage(rig: MakeRig, baud: int) -> None:
    one = rig("echo", DIVIDER_115200)
    one.board.put(HOST, b"wrong", baud=baud)
    one.board.run_us(3000)
    assert one.values()
    assert one.values() != b"wrong"


def test_half_the_rate_is_read_as_two_frames(rig: MakeRig) -> None:
    one = rig("echo")
    one.board.put(HOST, b"\x55", baud=500_000)
    one.board.run_us(500)
    # The wire by the reader's bits, each bit sent twice as long:
    # 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 1 1 ...
    # Start at 0, data 1 to 8, stop bit 9 low; next fall at 12, data 13 to 20, stop bit 21 high.
    assert one.values() == bytes((0b01100110, 0b11100110))
    assert one.board.stats()["framing0"] == 1


def test_two_runs_are_alike_to_the_cycle(rig: MakeRig) -> None:
    runs = []
    for _ in range(2):
        one = rig("interrupts")
        one.ask(b"the same again", 1000)
        runs.append((one.sent[HOST], one.board.stats()))
    assert runs[0] == runs[1]
