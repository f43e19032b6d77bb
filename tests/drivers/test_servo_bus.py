"""Transactions on the servo bus: partial answers, garbage, stale bytes, time limits, a lost port.

Frames of the servos are those of tests/vectors/dxl_frames.toml and the ROBOTIS e-manual.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable

import pytest

from sphmctl import clock
from sphmctl.drivers.servo_bus import ATTEMPTS, LINK_LATENCY_S, ServoBus
from sphmctl.errors import DeviceError
from tests.drivers.far_end import FarEnd

READ_1 = bytes.fromhex("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15")
REPLY_1 = bytes.fromhex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0")
SYNC_READ = bytes.fromhex("FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA")
REPLY_2 = bytes.fromhex("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE")
EMPTY_1 = bytes.fromhex("FF FF FD 00 01 04 00 55 00 A1 0C")
ACCESS_ERROR_1 = bytes.fromhex("FF FF FD 00 01 04 00 55 07 B0 8C")
ALERT_1 = bytes.fromhex("FF FF FD 00 01 04 00 55 80 A2 8F")

POSITION, SIZE = 132, 4

Test = Callable[[ServoBus, FarEnd], Awaitable[None]]


def _with_bus(test: Test, baud: int = 1_000_000) -> None:
    async def main() -> None:
        far = FarEnd()
        bus = ServoBus(far.open, "wrist", baud)
        await bus.connect()
        try:
            await test(bus, far)
        finally:
            await bus.close()
        assert len(asyncio.all_tasks()) == 1

    clock.run(main(), virtual=True)


def _sends(*pieces: bytes) -> Callable[[FarEnd, bytes], None]:
    """Answers each request with the pieces, one after the other."""

    def answer(far: FarEnd, request: bytes) -> None:
        for index, piece in enumerate(pieces):
            far.send(piece, 0.001 * (index + 1))

    return answer


def test_a_read_sends_the_manuals_frame_and_returns_the_data() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(REPLY_1)
        assert await bus.read(1, POSITION, SIZE) == bytes((166, 0, 0, 0))
        assert [data for _, data in far.pieces] == [READ_1]

    _with_bus(test)


def test_a_transaction_ends_with_the_last_status_and_not_at_its_time_limit() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(REPLY_1, REPLY_2)
        begin_s = asyncio.get_running_loop().time()
        statuses = await bus.transact(SYNC_READ, (1, 2), SIZE)
        assert asyncio.get_running_loop().time() - begin_s == pytest.approx(0.002)
        assert {i: s.data[0] for i, s in statuses.items()} == {1: 166, 2: 31}

    _with_bus(test)


@pytest.mark.parametrize(("replies", "known"), [((REPLY_1,), {1}), ((REPLY_2,), {2}), ((), set())])
def test_a_silent_servo_does_not_void_the_others(
    replies: tuple[bytes, ...], known: set[int]
) -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(*replies)
        begin_s = asyncio.get_running_loop().time()
        statuses = await bus.transact(SYNC_READ, (1, 2), SIZE)
        assert set(statuses) == known
        # 16 bytes out, two statuses of 15 back, at 10 us; two return delays; the link; and time
        # for a late status to come and go.
        limit_s = 46 * 10e-6 + 2 * 510e-6 + 2 * LINK_LATENCY_S
        assert asyncio.get_running_loop().time() - begin_s == pytest.approx(limit_s)

    _with_bus(test)


def test_garbage_an_echo_and_a_damaged_frame_before_a_reply_are_dropped() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        damaged = REPLY_2[:10] + b"\x55" + REPLY_2[11:]
        far.answer = _sends(b"\x00\xff\xff" + SYNC_READ + damaged + REPLY_1)
        assert set(await bus.transact(SYNC_READ, (1, 2), SIZE)) == {1}

    _with_bus(test)


def test_replies_byte_by_byte_are_put_together() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(*(bytes((byte,)) for byte in REPLY_1[:10]), REPLY_1[10:])
        assert (await bus.transact(READ_1, (1,), SIZE))[1].data[0] == 166

    _with_bus(test)


def test_the_reply_of_a_servo_that_was_not_asked_does_not_count() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(REPLY_2)
        assert await bus.transact(READ_1, (1,), SIZE) == {}

    _with_bus(test)


def test_a_status_with_another_number_of_bytes_is_not_the_answer() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(EMPTY_1, REPLY_1)
        assert (await bus.transact(READ_1, (1,), SIZE))[1].data[0] == 166

    _with_bus(test)


def test_stale_bytes_are_dropped_before_the_next_transaction() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        # All but the last byte of an old reply: its rest must not complete with what follows.
        far.send(REPLY_1[:-1])
        await asyncio.sleep(0.01)
        far.answer = _sends(REPLY_1[-1:])
        assert await bus.transact(READ_1, (1,), SIZE) == {}
        far.answer = None
        far.send(REPLY_1)
        await asyncio.sleep(0.01)
        far.answer = _sends(REPLY_2)
        assert set(await bus.transact(SYNC_READ, (1, 2), SIZE)) == {2}

    _with_bus(test)


def test_a_lost_reply_is_asked_for_again_at_rest() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        def third(far: FarEnd, request: bytes) -> None:
            if len(far.pieces) == ATTEMPTS:
                far.send(REPLY_1, 0.001)

        far.answer = third
        assert await bus.read(1, POSITION, SIZE) == bytes((166, 0, 0, 0))
        assert len(far.pieces) == ATTEMPTS

    _with_bus(test)


def test_a_late_reply_is_let_pass_before_the_question_is_repeated() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        limit_s = bus.limit_s(READ_1, 1, SIZE)

        def late(far: FarEnd, request: bytes) -> None:
            # The first reply comes too late by half the link's latency, the second in time.
            far.send(REPLY_1, limit_s + LINK_LATENCY_S / 2 if len(far.pieces) == 1 else 0.001)

        far.answer = late
        await bus.read(1, POSITION, SIZE)
        far.answer = _sends()
        with pytest.raises(DeviceError):
            await bus.read(1, POSITION, SIZE)

    _with_bus(test)


def test_a_silent_servo_is_named_after_three_attempts() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        with pytest.raises(
            DeviceError, match="wrist: servo 1 did not answer a read of address 132"
        ):
            await bus.read(1, POSITION, SIZE)
        assert len(far.pieces) == ATTEMPTS
        assert await bus.ping(1) is None

    _with_bus(test)


def test_a_refusal_names_servo_address_and_reason() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(ACCESS_ERROR_1)
        with pytest.raises(DeviceError, match="servo 1 refused a write of address 9: access error"):
            await bus.write(1, 9, b"\0")

    _with_bus(test)


def test_an_alert_alone_is_no_refusal() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(ALERT_1)
        await bus.write(1, 64, b"\0")

    _with_bus(test)


def test_a_write_to_nobody_in_particular_does_not_wait() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        begin_s = asyncio.get_running_loop().time()
        assert await bus.transact(SYNC_READ, (), 0) == {}
        assert asyncio.get_running_loop().time() == begin_s

    _with_bus(test)


@pytest.mark.parametrize(("baud", "limit_ms"), [(1_000_000, 16.77), (57_600, 23.0), (9_600, 61.3)])
def test_time_limits_grow_with_the_wire_time(baud: int, limit_ms: float) -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        # 29 + 14 bytes out and no more than 15 + 3 back: 43 bytes of 10 bits and one delay.
        frame = bytes(29 + 14 - 15)
        assert 1e3 * bus.limit_s(frame, 1, SIZE) == pytest.approx(
            1e3 * (43 * 10 / baud + 0.00051 + 0.015)
        )
        assert 1e3 * bus.limit_s(frame, 1, SIZE) == pytest.approx(limit_ms, rel=0.06)
        assert bus.wire_s(frame) == pytest.approx(28 * 10 / baud)

    _with_bus(test, baud)


def test_transactions_at_the_same_time_take_turns() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = _sends(REPLY_1)
        values = await asyncio.gather(*(bus.read(1, POSITION, SIZE) for _ in range(5)))
        assert values == [bytes((166, 0, 0, 0))] * 5
        times = [t for t, _ in far.pieces]
        assert min(b - a for a, b in itertools.pairwise(times)) == pytest.approx(0.001)

    _with_bus(test)


def test_a_port_that_is_lost_fails_at_once_and_can_be_opened_again() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        far.answer = lambda far, request: far.end.close()
        begin_s = asyncio.get_running_loop().time()
        with pytest.raises(DeviceError, match="the port was lost during a transaction"):
            await bus.read(1, POSITION, SIZE)
        assert asyncio.get_running_loop().time() == begin_s
        assert not bus.connected
        with pytest.raises(DeviceError, match="the port is lost"):
            await bus.read(1, POSITION, SIZE)
        await bus.connect()
        far.answer = _sends(REPLY_1)
        await bus.read(1, POSITION, SIZE)

    _with_bus(test)


def test_closing_ends_a_transaction_and_an_old_ports_loss_does_not_end_the_new_one() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        pending = asyncio.create_task(bus.transact(READ_1, (1,), SIZE))
        await asyncio.sleep(0.001)
        old = far.end
        await bus.close()
        with pytest.raises(DeviceError, match="lost"):
            await pending
        await bus.connect()
        old.close()
        await asyncio.sleep(0.001)
        assert bus.connected

    _with_bus(test)


def test_a_transaction_that_is_given_up_leaves_nothing_for_the_next() -> None:
    async def test(bus: ServoBus, far: FarEnd) -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.001):
                await bus.transact(READ_1, (1,), SIZE)
        far.send(REPLY_1)
        await asyncio.sleep(0.001)
        assert await bus.transact(READ_1, (1,), SIZE) == {}

    _with_bus(test)
