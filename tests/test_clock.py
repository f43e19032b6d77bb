"""The precise loop and the virtual loop."""

from __future__ import annotations

import asyncio
import os
import selectors
import threading
import time

import pytest

from sphmctl import clock


def test_virtual_time_jumps_to_the_next_timer_without_waiting() -> None:
    async def main() -> float:
        loop = asyncio.get_running_loop()
        begin = loop.time()
        await asyncio.sleep(3600.0)
        return loop.time() - begin

    begin_s = time.monotonic()
    assert clock.run(main(), virtual=True) == pytest.approx(3600.0, abs=1e-6)
    assert time.monotonic() - begin_s < 60.0


def test_timers_fire_in_the_order_of_their_instants() -> None:
    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        fired: list[float] = []
        for delay in (0.3, 0.1, 0.2):
            loop.call_later(delay, fired.append, delay)
        await asyncio.sleep(1.0)
        return fired

    assert clock.run(main(), virtual=True) == [0.1, 0.2, 0.3]


def test_a_deadlock_is_an_error_and_not_a_hang() -> None:
    async def main() -> None:
        await asyncio.get_running_loop().create_future()

    with pytest.raises(RuntimeError, match="nothing is scheduled"):
        clock.run(main(), virtual=True)


def test_a_time_limit_ends_a_wait_on_virtual_time() -> None:
    async def main() -> None:
        async with asyncio.timeout(5.0):
            await asyncio.sleep(10.0)

    with pytest.raises(TimeoutError):
        clock.run(main(), virtual=True)


def test_the_precise_loop_is_never_early_and_still_serves_files() -> None:
    async def main() -> bytes:
        loop = asyncio.get_running_loop()
        reader, writer = os.pipe()
        got: asyncio.Future[bytes] = loop.create_future()

        def take() -> None:
            loop.remove_reader(reader)
            got.set_result(os.read(reader, 100))

        loop.add_reader(reader, take)
        loop.call_later(0.003, os.write, writer, b"now")
        for delay_s in (0.0001, 0.0015, 0.02):
            begin = loop.time()
            await asyncio.sleep(delay_s)
            assert loop.time() - begin >= delay_s - 1e-6
        result = await got
        os.close(reader)
        os.close(writer)
        return result

    assert clock.run(main()) == b"now"


def test_a_later_timer_is_kept_when_an_earlier_one_is_cancelled_or_added() -> None:
    async def main() -> list[str]:
        loop = asyncio.get_running_loop()
        begin, fired, done = loop.time(), list[str](), asyncio.Event()

        def note(name: str, due_s: float) -> None:
            assert due_s - 1e-6 <= loop.time() - begin < due_s + 0.5
            fired.append(name)
            if len(fired) == 2:
                done.set()

        loop.call_at(begin + 1.0, note, "last", 1.0)
        # The loop waits for the thread, with its timer set for the last instant.
        await asyncio.to_thread(time.sleep, 0.01)
        first_s = loop.time() - begin + 0.01
        loop.call_later(0.005, note, "cancelled", 0.0).cancel()
        loop.call_at(begin + first_s, note, "first", first_s)
        async with asyncio.timeout(5.0):
            await done.wait()
        return fired

    assert clock.run(main()) == ["first", "last"]


def test_an_idle_loop_sleeps_after_its_last_timer() -> None:
    async def main() -> int:
        turns = 0
        loop = asyncio.get_running_loop()
        reader, writer = os.pipe()
        select = clock.PreciseSelector.select

        def counted(
            self: clock.PreciseSelector, timeout: float | None = None
        ) -> list[tuple[selectors.SelectorKey, int]]:
            nonlocal turns
            turns += 1
            return select(self, timeout)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(clock.PreciseSelector, "select", counted)
            await asyncio.sleep(0.001)
            threading.Timer(0.05, os.write, (writer, b"x")).start()
            done = asyncio.Event()
            loop.add_reader(reader, done.set)
            await done.wait()
            loop.remove_reader(reader)
        os.close(reader)
        os.close(writer)
        return turns

    assert clock.run(main()) < 20


def test_urgency_ends_with_its_block_whether_or_not_it_was_granted() -> None:
    before = os.sched_getscheduler(0)
    with clock.urgent() as granted:
        assert (os.sched_getscheduler(0) == os.SCHED_RR) == granted
    assert os.sched_getscheduler(0) == before
