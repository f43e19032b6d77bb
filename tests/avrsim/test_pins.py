"""Pins, resets, timers and memories of the simulated board."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from sphmctl.emulators.board import CLOCK_HZ, HOST
from tests.avrsim.conftest import MakeRig
from tests.avrsim.rig import Rig

POWER, EXTERNAL, WATCHDOG = 1, 2, 8
"""Bits of MCUSR, data sheet 12.5.1."""

NOMINAL_15_MS = 16.0
"""The watchdog's shortest but one period: 2048 cycles of 128 kHz, ms (data sheet, table 12-2)."""


def cycles(seconds: float) -> int:
    return round(seconds * CLOCK_HZ)


@pytest.mark.parametrize("length", [100, 1000, 16_000])
def test_a_pulse_is_as_long_as_the_sketch_counts_to_the_cycle(rig: MakeRig, length: int) -> None:
    one = rig("pins", f"PULSE_CYCLES={length}")
    one.board.watch("B7")
    one.ask(b"u", 2000)
    rise, fall = one.edges
    assert (rise.pin, rise.level, fall.level) == ("B7", True, False)
    assert cycles(fall.at_s - rise.at_s) == length


def test_inputs_read_what_drives_them_or_their_pull_up(rig: MakeRig) -> None:
    one = rig("pins", "PULSE_CYCLES=100")
    assert one.ask(b"p") == b"\x01\x00"  # PB0 is pulled up, PL0 is not
    one.board.drive("B0", False)
    one.board.drive("L0", True)
    assert one.ask(b"p") == b"\x00\x01"
    one.board.drive("B0", None)
    one.board.drive("L0", None)
    assert one.ask(b"p") == b"\x01\x00"


def press(one: Rig) -> None:
    one.board.reset()


def starve(one: Rig) -> None:
    one.board.put(HOST, b"r")


@pytest.mark.parametrize(("how", "cause"), [(press, EXTERNAL), (starve, WATCHDOG)])
def test_a_reset_has_its_cause_and_leaves_inputs_as_they_are_driven(
    rig: MakeRig, how: object, cause: int
) -> None:
    one = rig("pins", "PULSE_CYCLES=100")
    assert one.ask(b"c") == bytes((POWER,))
    one.board.drive("L0", True)
    one.board.drive("B0", False)
    press(one) if how is press else starve(one)
    one.board.run_us(30_000)
    assert one.ask(b"c") == bytes((cause,))
    assert one.ask(b"p") == b"\x00\x01"


def test_the_watchdog_bites_after_its_nominal_time(rig: MakeRig) -> None:
    one = rig("pins", "PULSE_CYCLES=100")
    bitten: list[float] = []
    one.board.on.reset = bitten.append
    one.board.put(HOST, b"r", at_s=0.002)
    one.board.run_us(30_000)
    (at_s,) = bitten
    assert NOMINAL_15_MS < at_s * 1e3 - 2.0 < NOMINAL_15_MS + 0.05


def test_an_output_falls_at_a_reset(rig: MakeRig) -> None:
    one = rig("pins", "PULSE_CYCLES=1000000")
    one.board.watch("B7")
    one.ask(b"u")
    one.board.reset()
    one.board.run_us(100)
    assert [edge.level for edge in one.edges] == [True, False]


def test_input_capture_stamps_edges_within_a_quarter_of_a_microsecond(rig: MakeRig) -> None:
    one = rig("capture")
    begin_s = 0.002
    for i, level in enumerate((True, False, True)):
        one.board.drive("L0", level, begin_s + i * 250e-6)
    one.board.run_us(3000)
    raw = one.values()[1:]
    stamps = [int.from_bytes(raw[i : i + 2], "little") for i in range(0, 6, 2)]
    gaps = [(b - a) & 0xFFFF for a, b in pairwise(stamps)]
    assert gaps == [pytest.approx(4000, abs=4)] * 2


def test_the_eeprom_outlives_the_power(rig: MakeRig, tmp_path: Path) -> None:
    image = tmp_path / "eeprom.bin"
    first = rig("memory", eeprom=image)
    assert first.ask(b"r") == b"\xff"
    assert first.ask(b"wZ", 10_000) == b"k"
    first.board.close()
    assert rig("memory", eeprom=image).ask(b"r") == b"Z"


def test_the_deepest_stack_is_known(rig: MakeRig) -> None:
    one = rig("memory")
    before = one.board.stats()["stack_bytes"]
    one.ask(b"s", 2000)
    assert before < 20
    assert 500 < one.board.stats()["stack_bytes"] < 530
