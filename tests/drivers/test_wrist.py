"""The wrist on three emulated servos: what is examined, armed, exchanged and switched off."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable

import numpy as np
import pytest

from sphmctl import clock
from sphmctl.config import emulated_cell
from sphmctl.drivers import xl430
from sphmctl.drivers.connect import make_wrist
from sphmctl.drivers.link import MemoryLink
from sphmctl.drivers.wrist import CrankScale, Wrist, within
from sphmctl.emulators.cell import EmulatedCell, Setup
from sphmctl.emulators.xl430 import Servo
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats
from tests.emulators.servo_rig import crc
from tests.system.rig import Wire

SYNC_WRITE_2048 = bytes.fromhex(
    "FF FF FD 00 FE 16 00 83 74 00 04 00 01 00 08 00 00 02 00 08 00 00 03 00 08 00 00 78 4B"
)
"""Goal 2048 to servos 1, 2, 3; CRC by dynamixel-sdk."""

SYNC_READ_BODY = bytes.fromhex("FF FF FD 00 FE 0A 00 82 E0 00 12 00 01 02 03")
"""Sync read of 18 bytes from 224, by the packet tables of the e-manual."""

TORQUE_ON_1 = bytes.fromhex("FF FF FD 00 01 06 00 03 40 00 01 DB 66")
WATCHDOG_OFF_1 = bytes.fromhex("FF FF FD 00 01 06 00 03 62 00 00 76 E4")


class Bench:
    """A wrist driver on emulated servos, with the wire between them."""

    def __init__(self, setup: Setup | None = None) -> None:
        self.emulated = EmulatedCell(1, setup)
        self.servos: tuple[Servo, ...] = self.emulated.servos
        self.wire = Wire(self._attach)
        made = self.emulated.setup
        cell = emulated_cell()
        parts = {"ids": made.ids, "zero_ticks": made.zero_ticks, "direction": made.direction}
        cell = cell.model_copy(update={"wrist": cell.wrist.model_copy(update=parts)})
        self.wrist: Wrist = make_wrist(cell, self.wire.open)

    def _attach(self, end: MemoryLink) -> None:
        self.emulated.bus.attach(end, 1_000_000)

    def ticks(self) -> list[float]:
        self.emulated.world.advance()
        return [servo.true_ticks for servo in self.servos]

    def torques(self) -> list[int]:
        return [servo.table["torque_enable"] for servo in self.servos]

    async def keep_up(self, seconds: float, cranks: Floats | None = None) -> list[list[float]]:
        """Exchange at 100 Hz for a while; the true positions after each cycle."""
        seen = []
        for _ in range(round(seconds / 0.01)):
            await self.wrist.exchange(cranks)
            seen.append(self.ticks())
            await asyncio.sleep(0.005)
        return seen


Test = Callable[[Bench], Awaitable[None]]


def _with_bench(test: Test, setup: Setup | None = None) -> None:
    async def main() -> None:
        bench = Bench(setup)
        await bench.wrist.connect()
        try:
            await test(bench)
        finally:
            await bench.wrist.close()
            await bench.emulated.close()

    clock.run(main(), virtual=True)


def _radians(*degrees: float) -> Floats:
    result: Floats = np.radians(np.array(degrees))
    return result


def test_a_wrist_in_order_passes_every_look() -> None:
    async def test(bench: Bench) -> None:
        findings = await bench.wrist.examine()
        assert [f.name for f in findings if not f.ok] == []
        assert len(findings) == 3 * 9
        await bench.wrist.verify()
        assert bench.torques() == [0, 0, 0]

    _with_bench(test)


WRONG: dict[str, tuple[Callable[[Servo], object], str, str]] = {
    "model": (lambda s: s.table.__setitem__("model_number", 1020), "model number: 1020", "1060"),
    "firmware": (lambda s: s.table.__setitem__("firmware_version", 41), "firmware: 41", "42"),
    "return delay": (
        lambda s: s.table.__setitem__("return_delay_time", 250),
        "Return Delay Time (9): 250",
        "set it to 0, at most 10",
    ),
    "drive mode": (lambda s: s.table.__setitem__("drive_mode", 4), "Drive Mode (10): 4", "to 0"),
    "operating mode": (
        lambda s: s.table.__setitem__("operating_mode", 4),
        "Operating Mode (11): 4",
        "set it to 3",
    ),
    "homing offset": (
        lambda s: s.table.__setitem__("homing_offset", -5),
        "Homing Offset (20): -5",
        "set it to 0",
    ),
    "highest position": (
        lambda s: s.table.__setitem__("max_position_limit", 2000),
        "Position Limits (52, 48): 0 to 2000",
        "they must include 1365 to 2730",
    ),
    "lowest position": (
        lambda s: s.table.__setitem__("min_position_limit", 1400),
        "Position Limits (52, 48): 1400 to 4095",
        "they must include 1365 to 2730",
    ),
    "hardware error": (
        lambda s: s.raise_error(5),
        "Hardware Error Status (70): overload",
        "remove the cause, then reboot the servo",
    ),
    "missing": (lambda s: s.unplug(), "does not answer", "check power, cable, id and baud rate"),
}


@pytest.mark.parametrize("what", WRONG)
def test_each_wrong_setting_is_found_with_servo_value_and_remedy(what: str) -> None:
    spoil, found, remedy = WRONG[what]

    async def test(bench: Bench) -> None:
        spoil(bench.servos[1])
        wrong = [f for f in await bench.wrist.examine() if not f.ok]
        assert len(wrong) == 1
        assert "servo 2 (leg 2)" in wrong[0].name
        assert found in f"{wrong[0].name}: {wrong[0].detail}"
        assert remedy in wrong[0].remedy
        with pytest.raises(DeviceError) as raised:
            await bench.wrist.verify()
        assert remedy in str(raised.value)

    _with_bench(test)


def test_a_status_return_level_that_hides_refusals_is_found() -> None:
    async def test(bench: Bench) -> None:
        bench.servos[0].table["status_return_level"] = 1
        wrong = [f for f in await bench.wrist.examine() if not f.ok]
        assert [f.name for f in wrong] == ["servo 1 (leg 1), Status Return Level (68)"]

    _with_bench(test)


@pytest.mark.parametrize("direction", [(1, 1, 1), (-1, 1, -1)])
def test_torque_on_holds_where_the_cranks_are(direction: tuple[int, int, int]) -> None:
    setup = (
        Setup(cranks_deg=(17.0, 60.0, 111.0), zero_ticks=(2731, 1365, 2731), direction=direction)
        if direction[0] < 0
        else Setup(cranks_deg=(17.0, 60.0, 111.0))
    )

    async def test(bench: Bench) -> None:
        for servo in bench.servos:
            # A goal left by somebody else, far away.
            servo.table["goal_position"] = 300
        before = bench.ticks()
        await bench.wrist.arm(math.radians(30.0))
        assert bench.torques() == [1, 1, 1]
        for now in await bench.keep_up(0.5):
            assert now == pytest.approx(before, abs=1.0)
        assert [servo.table["bus_watchdog"] for servo in bench.servos] == [25, 25, 25]

    _with_bench(test, setup)


def test_arming_writes_goal_before_torque_and_the_watchdog_last() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        sent = [data for _, data in bench.wire.frames if data[4] == 1]
        writes = [int.from_bytes(data[8:10], "little") for data in sent if data[7] == 3]
        assert writes == [64, 98, 168, 108, 116, 64, 116, 98]
        assert TORQUE_ON_1 in sent
        assert sent.index(WATCHDOG_OFF_1) < sent.index(TORQUE_ON_1)

    _with_bench(test)


def test_a_servo_left_with_torque_on_and_its_watchdog_tripped_is_armed_without_motion() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        # Nobody exchanges any more: the watchdogs trip after 500 ms and forget the profiles.
        await asyncio.sleep(0.6)
        bench.emulated.world.advance()
        assert [servo.table["bus_watchdog"] for servo in bench.servos] == [-1, -1, -1]
        before = bench.ticks()
        await bench.wrist.arm(math.radians(30.0))
        for now in await bench.keep_up(0.5):
            assert now == pytest.approx(before, abs=1.0)
        state = await bench.wrist.exchange(None)
        assert [s and s.telemetry.watchdog for s in state.servos] == [25, 25, 25]

    _with_bench(test)


def test_the_profile_caps_a_goal_that_jumps() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        begin_s = asyncio.get_running_loop().time()
        await bench.keep_up(0.5, _radians(110.0, 60.0, 60.0))
        rows = np.array(bench.emulated.truth(begin_s, begin_s + 10.0))
        speeds = np.diff(rows[:, 7]) / np.diff(rows[:, 0])
        # 1.5 times 30 degrees a second, rounded up to 33 units of 0.229 rpm: 45.3.
        assert speeds.max() == pytest.approx(45.3, abs=0.2)

    _with_bench(test)


@pytest.mark.parametrize("leg", [0, 1, 2])
def test_a_failure_while_arming_leaves_torque_off_on_all(leg: int) -> None:
    async def test(bench: Bench) -> None:
        bench.servos[leg].raise_error(5)
        with pytest.raises(DeviceError, match=f"servo {leg + 1} refused a write of address 64"):
            await bench.wrist.arm(math.radians(30.0))
        assert bench.torques() == [0, 0, 0]
        assert not bench.wrist.armed

    _with_bench(test)


def test_arming_that_is_given_up_leaves_torque_off_on_all() -> None:
    async def test(bench: Bench) -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.09):
                await bench.wrist.arm(math.radians(30.0))
        assert any(data == TORQUE_ON_1 for _, data in bench.wire.frames)
        assert bench.torques() == [0, 0, 0]

    _with_bench(test)


def test_disarming_takes_torque_and_watchdog_off_and_reports_nothing() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        assert await bench.wrist.disarm() == []
        assert bench.torques() == [0, 0, 0]
        assert [servo.table["bus_watchdog"] for servo in bench.servos] == [0, 0, 0]

    _with_bench(test)


def test_disarming_reaches_the_other_servos_when_one_is_gone() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        bench.servos[0].unplug()
        problems = await bench.wrist.disarm()
        assert len(problems) == 1
        assert "servo 1: torque off was not confirmed" in problems[0]
        assert bench.torques() == [0, 0, 0]

    _with_bench(test)


def test_disarming_over_a_lost_port_names_every_servo() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        bench.wire.cut()
        await asyncio.sleep(0.001)
        assert len(await bench.wrist.disarm()) == 3

    _with_bench(test)


def test_a_silent_servo_is_none_and_its_crank_unknown() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        bench.servos[2].unplug()
        state = await bench.wrist.exchange(_radians(60.0, 60.0, 60.0))
        assert [servo is None for servo in state.servos] == [False, False, True]
        assert np.isnan(state.cranks).tolist() == [False, False, True]

    _with_bench(test)


def test_one_cycle_is_one_sync_write_and_one_sync_read_in_one_piece() -> None:
    async def test(bench: Bench) -> None:
        crank = (2048 - 1365) * 2.0 * math.pi / 4096.0
        before = len(bench.wire.frames)
        sent_s = asyncio.get_running_loop().time()
        state = await bench.wrist.exchange(np.full(3, crank))
        sync_read = SYNC_READ_BODY + crc(SYNC_READ_BODY)
        assert [d for _, d in bench.wire.frames[before:]] == [SYNC_WRITE_2048 + sync_read]
        # The servos look at themselves when the last of 46 bytes has come, at 10 us each.
        assert state.at_s == pytest.approx(sent_s + 46 * 10e-6)

    _with_bench(test)


def test_without_goals_a_cycle_only_reads() -> None:
    async def test(bench: Bench) -> None:
        before = len(bench.wire.frames)
        await bench.wrist.exchange(None)
        frames = [d for _, d in bench.wire.frames[before:]]
        assert frames == [SYNC_READ_BODY + crc(SYNC_READ_BODY)]

    _with_bench(test)


def test_signs_and_zeros_follow_the_cell_file_both_ways() -> None:
    setup = Setup(
        cranks_deg=(10.0, 50.0, 100.0),
        zero_ticks=(1365, 2730, 1000),
        direction=(1, -1, 1),
    )

    async def test(bench: Bench) -> None:
        assert np.degrees(await bench.wrist.read_cranks()) == pytest.approx(
            (10.0, 50.0, 100.0), abs=0.09
        )
        await bench.wrist.arm(math.radians(60.0))
        await bench.keep_up(1.5, _radians(30.0, 20.0, 80.0))
        assert bench.emulated.true_joints_deg()[6:] == pytest.approx((30.0, 20.0, 80.0), abs=0.2)
        state = await bench.wrist.exchange(None)
        assert np.degrees(state.cranks) == pytest.approx((30.0, 20.0, 80.0), abs=0.2)
        # Counts of leg 2 fall while its crank rises: 2730 - 20 / 360 * 4096.
        assert bench.ticks()[1] == pytest.approx(2730 - 227.6, abs=2.0)

    _with_bench(test, setup)


def test_velocities_have_the_sign_of_the_crank() -> None:
    setup = Setup(zero_ticks=(1365, 2730, 1365), direction=(1, -1, 1))

    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(60.0))
        await bench.keep_up(0.2, _radians(100.0, 100.0, 60.0))
        state = await bench.wrist.exchange(_radians(100.0, 100.0, 60.0))
        speeds = [math.degrees(servo.velocity) for servo in state.servos if servo]
        assert speeds[0] == pytest.approx(speeds[1], rel=0.05)
        assert speeds[0] > 50.0
        assert speeds[2] == 0.0

    _with_bench(test, setup)


def test_counts_and_angles_are_inverse_and_stay_within_one_turn() -> None:
    scale = CrankScale((1365, 2730, 1000), (1, -1, 1))
    assert scale.ticks(_radians(0.0, 0.0, 0.0)) == [1365, 2730, 1000]
    assert scale.ticks(_radians(90.0, 90.0, 90.0)) == [2389, 1706, 2024]
    assert math.degrees(scale.crank(1, 1706)) == pytest.approx(90.0)
    assert [within(t) for t in (-1, 0, 4095, 4096)] == [0, 0, 4095, 4095]


def test_the_watchdog_stops_servos_that_hear_nothing() -> None:
    async def test(bench: Bench) -> None:
        await bench.wrist.arm(math.radians(30.0))
        await bench.keep_up(0.1, _radians(115.0, 60.0, 60.0))
        await asyncio.sleep(0.55)
        stopped = bench.ticks()
        await asyncio.sleep(1.0)
        assert bench.ticks() == stopped
        assert stopped[0] < 1365 + 115 / 360 * 4096 - 100
        state = await bench.wrist.exchange(None)
        watchdogs = [servo.telemetry.watchdog for servo in state.servos if servo]
        assert watchdogs == [xl430.WATCHDOG_TRIPPED] * 3

    _with_bench(test)
