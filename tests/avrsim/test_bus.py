"""The half-duplex bus: what the simulator says of a direction pin that is early, late or right."""

from __future__ import annotations

import pytest

from sphmctl.emulators.board import BUS, HOST
from tests.avrsim.conftest import MakeRig
from tests.avrsim.rig import PING_1, STATUS_1, Rig


def exchange(one: Rig, gap_us: float) -> bytes:
    """A ping whose status starts `gap_us` after a last stop bit that is known beforehand."""
    one.board.put(HOST, PING_1, at_s=0.002)
    one.board.put(BUS, STATUS_1, at_s=0.002 + (len(PING_1) + 1) * 10e-6 + 4e-6 + gap_us * 1e-6)
    one.board.run_us(3000)
    return one.values()


def test_a_right_direction_pin_loses_nothing_either_way(rig: MakeRig) -> None:
    one = rig("forward")
    assert exchange(one, 50) == STATUS_1
    assert one.values(BUS) == PING_1
    assert one.board.faults == []


def test_a_pin_that_falls_before_the_last_stop_bit_is_an_error(rig: MakeRig) -> None:
    one = rig("forward", "EARLY")
    one.ask(PING_1)
    assert one.kinds() == {"tx_lost"}
    assert one.values(BUS) != PING_1


def test_a_pin_that_dips_during_a_byte_is_an_error(rig: MakeRig) -> None:
    one = rig("forward", "DIP")
    one.ask(PING_1)
    assert one.kinds() == {"tx_lost"}
    assert one.values(BUS) == b""


def test_a_transmit_complete_flag_left_from_the_byte_before_is_found_out(rig: MakeRig) -> None:
    one = rig("forward", "STALE")
    for _ in range(20):
        one.ask(PING_1 + PING_1, 1000)
    assert "tx_lost" in one.kinds()


def test_a_pin_that_falls_late_drowns_the_answer(rig: MakeRig) -> None:
    one = rig("forward", "LATE")
    heard = exchange(one, 50)
    assert one.kinds() == {"collision"}
    assert one.board.stats()["collisions1"] == len(STATUS_1) - len(heard) > 0


@pytest.mark.parametrize(("gap_us", "clean"), [(2.5, True), (-8.0, False)])
def test_a_collision_is_a_matter_of_microseconds(rig: MakeRig, gap_us: float, clean: bool) -> None:
    one = rig("forward")
    assert (exchange(one, gap_us) == STATUS_1) == clean
    assert (one.kinds() == set()) == clean


def test_a_byte_from_the_bus_during_one_to_the_bus_is_a_collision(rig: MakeRig) -> None:
    one = rig("forward")
    one.board.put(HOST, bytes(10), at_s=0.002)
    one.board.put(BUS, b"\x00", at_s=0.00205)
    one.board.run_us(2000)
    assert one.kinds() == {"collision"}
    assert one.values() == b""
