"""Commissioning: servos in any state become the wrist's, or a sentence says why not."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Sequence

import pytest

from sphmctl import clock
from sphmctl.config import Cell, emulated_cell
from sphmctl.daemon.commission import Job, Outcome, assign, commission
from sphmctl.daemon.servo_scan import BAUD_CODES, Found
from sphmctl.daemon.servo_setup import limits_ticks, settings
from sphmctl.drivers.connect import make_wrist
from sphmctl.drivers.link import Link, MemoryLink, memory_pair
from sphmctl.emulators.servo_bus import ServoBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.errors import DeviceError, InvalidError, UsageError

CELL = emulated_cell()
RNG = random.Random(5)

# ROBOTIS e-manual, XL430-W250: what the emulated cell needs. Crank angles of 0 to 120 degrees are
# the ticks 1365 to 2730.3, and 1 degree is 11.4 ticks.
READY = {
    "baud_rate": 3,
    "return_delay_time": 0,
    "drive_mode": 0,
    "operating_mode": 3,
    "secondary_id": 255,
    "homing_offset": 0,
    "pwm_limit": 885,
    "velocity_limit": 265,
    "max_position_limit": 2742,
    "min_position_limit": 1354,
    "startup_configuration": 0,
    "shutdown": 52,
    "torque_enable": 0,
}


def factory(**options: int) -> Servo:
    """A servo as it comes out of its box, but for `options`."""
    return Servo(RNG, **({"baud_code": 1, "return_delay": 250} | options))


class Bench:
    """Servos on a bus in memory, and everything that commissioning said and asked."""

    def __init__(self, servos: Sequence[Servo], answer: bool = True) -> None:
        self.servos = servos
        self.answer = answer
        self.told: list[str] = []
        self.asked: list[str] = []
        self.noise = b""

    def run(self, wanted_id: int | None = None, cell: Cell = CELL) -> Outcome:
        """Commission, on the virtual clock."""
        return clock.run(self._run(wanted_id, cell), virtual=True)

    async def _run(self, wanted_id: int | None, cell: Cell) -> Outcome:
        world = World(asyncio.get_running_loop().time)
        bus = ServoBus(world, self.servos, RNG)

        async def open_at(baud: int) -> Link:
            if baud == 4_500_000:
                raise DeviceError("the port cannot have this rate")
            here, there = memory_pair()
            bus.attach(there, baud)
            self._click(there)
            return here

        async def consent(question: str) -> bool:
            self.asked.append(question)
            return self.answer

        return await commission(Job(open_at, "servos", cell, wanted_id), self.told.append, consent)

    def _click(self, there: MemoryLink) -> None:
        asyncio.get_running_loop().call_later(0.01, there.write, self.noise)

    def fails(self, wanted_id: int | None = None) -> str:
        """The sentence with which it ends; nothing was changed."""
        before = [bytes(servo.table.memory[:64]) for servo in self.servos]
        with pytest.raises(DeviceError) as caught:
            self.run(wanted_id)
        assert [bytes(servo.table.memory[:64]) for servo in self.servos] == before
        assert not self.asked
        return caught.value.message


def assert_ready(servo: Servo, servo_id: int) -> None:
    """It has what the e-manual's table should show now."""
    assert {name: servo.table[name] for name in READY} == READY
    assert servo.id == servo_id


def test_a_servo_from_its_box_is_set_up_explained_and_asked_for() -> None:
    servo = factory()
    bench = Bench([servo])
    outcome = bench.run()
    assert_ready(servo, 1)
    assert outcome.missing == (2, 3)
    assert outcome.skipped == (4_500_000,)
    changed = {(c.name, c.before, c.after) for c in outcome.tasks[0].changes}
    assert changed == {
        ("Return Delay Time", 250, 0),
        ("Max Position Limit", 4095, 2742),
        ("Min Position Limit", 0, 1354),
        ("Baud Rate", 1, 3),
    }
    assert len(bench.asked) == 1
    said = "\n".join(bench.told)
    for word in ("found id 1 at 57600 baud", "Return Delay Time (9): 250 -> 0", "read back"):
        assert word in said


@pytest.mark.parametrize("baud", [b for b in BAUD_CODES if b != 4_500_000])
@pytest.mark.parametrize("servo_id", [0, 1, 252])
def test_it_is_found_at_any_rate_and_id(baud: int, servo_id: int) -> None:
    servo = factory(servo_id=servo_id, baud_code=BAUD_CODES[baud])
    Bench([servo]).run()
    assert_ready(servo, 1)


def test_servos_hung_on_one_after_the_other_get_the_ids_in_turn() -> None:
    servos: list[Servo] = []
    for _ in range(3):
        servos.append(factory(start_ticks=2000 + 17 * len(servos)))
        outcome = Bench(servos).run()
    assert [servo.id for servo in servos] == [1, 2, 3]
    assert outcome.missing == ()
    for number, servo in enumerate(servos, 1):
        assert_ready(servo, number)


def test_a_wrist_set_up_this_way_passes_its_own_examination() -> None:
    servos = [factory(servo_id=i) for i in (1, 2, 3)]
    Bench(servos).run()

    async def verify() -> None:
        bus = ServoBus(World(asyncio.get_running_loop().time), servos, RNG)

        async def opener() -> Link:
            here, there = memory_pair()
            bus.attach(there)
            return here

        wrist = make_wrist(CELL, opener)
        await wrist.connect()
        await wrist.verify()
        await wrist.close()

    clock.run(verify(), virtual=True)


def test_whatever_was_changed_before_is_set_right() -> None:
    servo = factory(servo_id=9)
    wrong = {
        "drive_mode": 5,
        "operating_mode": 4,
        "secondary_id": 7,
        "homing_offset": -100,
        "pwm_limit": 300,
        "velocity_limit": 100,
        "startup_configuration": 3,
        "shutdown": 0,
        "torque_enable": 1,
    }
    for name, value in wrong.items():
        servo.table[name] = value
    bench = Bench([servo])
    outcome = bench.run(wanted_id=3)
    assert_ready(servo, 3)
    before = {change.name: change.before for change in outcome.tasks[0].changes}
    assert before["Homing Offset"] == -100
    assert any("torque goes off" in line for line in bench.told)


def test_a_ready_servo_is_left_alone_and_nobody_asked() -> None:
    servo = factory()
    Bench([servo]).run()
    bench = Bench([servo], answer=False)
    assert bench.run().tasks[0].changes == ()
    assert not bench.asked


def test_without_consent_nothing_changes() -> None:
    servo = factory()
    before = bytes(servo.table.memory)[:120]
    bench = Bench([servo], answer=False)
    with pytest.raises(UsageError, match="nothing was changed"):
        bench.run()
    assert bytes(servo.table.memory)[:120] == before


def test_other_models_are_refused() -> None:
    assert (
        "model 1020; an XL430-W250 is 1060"
        in Bench([factory(), factory(servo_id=2, model=1020)]).fails()
    )


def test_old_firmware_is_refused() -> None:
    assert "firmware 41; update it to 42" in Bench([factory(firmware=41)]).fails()


def test_two_servos_under_one_id_are_refused() -> None:
    told = Bench([factory(start_ticks=1000), factory(start_ticks=3001)]).fails()
    assert "connect one at a time" in told


def test_two_whose_pings_differ_are_refused_too() -> None:
    told = Bench([factory(firmware=45), factory(firmware=46)]).fails()
    assert "57600 baud; connect one at a time" in told


def test_noise_that_nobody_can_read_is_refused_but_not_a_click() -> None:
    bench = Bench([factory()])
    bench.noise = b"\x55" * 8
    assert "connect one at a time" in bench.fails()
    bench.noise = b"\x00" * 3
    bench.run()


def test_more_servos_than_legs_are_refused() -> None:
    assert "4 servos for 3 legs" in Bench([factory(servo_id=i) for i in range(1, 5)]).fails()


def test_a_servo_with_a_hardware_error_is_refused() -> None:
    servo = factory()
    servo.raise_error(5)
    assert "reports overload; remove the cause" in Bench([servo]).fails()


def test_an_empty_bus_is_told_with_what_to_look_at() -> None:
    told = Bench([]).fails()
    assert "no servo answers at any of 7 rates; check its power and its cable" in told
    assert "USB adapter" in told


def test_a_wanted_id_is_for_one_servo_and_one_of_the_cell_s() -> None:
    assert "--id is for one" in Bench([factory(), factory(servo_id=2)]).fails(wanted_id=3)
    with pytest.raises(InvalidError, match="id 9 is none of the cell's: 1, 2, 3"):
        Bench([factory()]).run(wanted_id=9)


def test_the_board_on_the_bus_is_no_servo() -> None:
    servo = factory()
    Bench([servo, factory(servo_id=200, model=60200, baud_code=3)]).run()
    assert_ready(servo, 1)


def test_a_servo_that_does_not_take_a_value_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    servo = factory()
    write = servo.write

    def deaf(address: int, data: bytes, *, as_group: bool = False) -> int:
        return 0 if address == 48 else write(address, data, as_group=as_group)

    monkeypatch.setattr(servo, "write", deaf)
    with pytest.raises(DeviceError, match="Max Position Limit is 4095, not 2742"):
        Bench([servo]).run()


def test_a_run_that_was_cut_off_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    servo = factory()
    write = servo.write

    def cut(address: int, data: bytes, *, as_group: bool = False) -> int:
        # Result fail (e-manual, Protocol 2.0, "Error").
        return 1 if address == 52 else write(address, data, as_group=as_group)

    monkeypatch.setattr(servo, "write", cut)
    with pytest.raises(DeviceError, match="refused a write of address 52"):
        Bench([servo]).run()
    assert servo.table["return_delay_time"] == 0
    monkeypatch.setattr(servo, "write", write)
    Bench([servo]).run()
    assert_ready(servo, 1)


def test_one_at_the_cell_s_rate_keeps_an_id_before_a_new_one() -> None:
    new, old = Found(57_600, 2, 1060, 46), Found(1_000_000, 2, 1060, 46)
    assert assign((new, old), CELL.wrist, None, "") == [(old, 2), (new, 1)]


def test_limits_follow_the_mounting() -> None:
    wrist = CELL.wrist.model_copy(update={"zero_ticks": (1365, 2730, 5), "direction": (1, -1, 1)})
    cell = CELL.model_copy(update={"wrist": wrist})
    assert limits_ticks(cell, 0) == (1354, 2742)
    assert limits_ticks(cell, 1) == (1353, 2741)
    assert limits_ticks(cell, 2) == (0, 1382)


def test_old_firmware_has_no_startup_configuration_to_write() -> None:
    since = {item.name: item.since for item in settings((0, 4095))}
    assert since["Startup Configuration"] == 45
    servo = factory(firmware=44)
    Bench([servo]).run()
    assert_ready(servo, 1)
