"""The client of KUKAVARPROXY: one request in flight, and no reply ever taken for another's."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from sphmctl import clock
from sphmctl.drivers.kvp_client import KEEP_ALIVE_S, REQUEST_TIMEOUT_S, KvpClient
from sphmctl.drivers.link import Link, memory_pair
from sphmctl.emulators.cell import EmulatedCell
from sphmctl.errors import DeviceError
from sphmctl.wire.kvp import KvpProtocolError, VariableEmptyError, VariableRefusedError
from tests.drivers.far_end import FarEnd, kvp_name, kvp_reply

Test = Callable[[KvpClient, FarEnd], Awaitable[None]]


def _pong(far: FarEnd, request: bytes) -> None:
    if kvp_name(request) == "PING":
        far.send(kvp_reply(request, "PONG"), 0.0003)


def _with_client(test: Test) -> None:
    """Run `test` on a connected client whose far end answers PING alone."""

    async def main() -> None:
        far = FarEnd(_pong)
        client = KvpClient(far.open, "controller")
        await client.connect()
        try:
            await test(client, far)
        finally:
            await client.close()
        assert len(asyncio.all_tasks()) == 1

    clock.run(main(), virtual=True)


def _answers(value: str) -> Callable[[FarEnd, bytes], None]:
    def answer(far: FarEnd, request: bytes) -> None:
        far.send(kvp_reply(request, value if kvp_name(request) != "PING" else "PONG"), 0.002)

    return answer


def test_a_read_returns_the_value_without_the_blanks_around_it() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = _answers(" 100 ")
        assert await client.read("$OV_PRO") == "100"
        # C3 Bridge's documentation and kvp.md: id, length, function 0, name length, name.
        sent = far.pieces[-1][1]
        assert sent[2:] == b"\x00\x0a\x00\x00\x07$OV_PRO"

    _with_client(test)


def test_callers_at_the_same_time_queue_and_one_request_is_in_flight() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        waiting: list[bytes] = []

        def answer(far: FarEnd, request: bytes) -> None:
            waiting.append(request)
            assert len(waiting) == 1

            def reply() -> None:
                waiting.remove(request)
                far.send(kvp_reply(request, f"value of {kvp_name(request)}"))

            asyncio.get_running_loop().call_later(0.003, reply)

        far.answer = answer
        names = [f"V{n}" for n in range(20)]
        values = await asyncio.gather(*(client.read(name) for name in names))
        assert values == [f"value of {name}" for name in names]

    _with_client(test)


def test_a_request_is_sent_in_one_piece() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = _answers("1")
        before = len(far.pieces)
        await client.write("SPH_CMD", "1")
        assert len(far.pieces) == before + 1

    _with_client(test)


BAD_REPLIES: dict[str, Callable[[bytes], bytes]] = {
    "another id": lambda request: kvp_reply(request, "1", identity=request[1] + 1),
    "another function": lambda request: (
        kvp_reply(request, "1")[:4] + bytes((1 - request[4],)) + kvp_reply(request, "1")[5:]
    ),
    "a function that does not exist": lambda request: (
        kvp_reply(request, "1")[:4] + b"\x07" + kvp_reply(request, "1")[5:]
    ),
    "a wrong inner length": lambda request: (
        kvp_reply(request, "12345")[:6] + b"\x04" + kvp_reply(request, "12345")[7:]
    ),
    "a length that is too short": lambda request: request[:2] + b"\x00\x02\x00\x00\x00\x00",
    "noise": lambda request: bytes(range(200, 240)),
}


@pytest.mark.parametrize("what", BAD_REPLIES)
def test_a_reply_that_does_not_fit_ends_the_connection_with_an_error(what: str) -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = lambda far, request: far.send(BAD_REPLIES[what](request))
        with pytest.raises(DeviceError):
            await client.read("$OV_PRO")
        assert not client.connected
        await asyncio.sleep(0)
        assert far.lost
        with pytest.raises(DeviceError, match="the connection is lost"):
            await client.read("$OV_PRO")

    _with_client(test)


def test_silence_ends_the_connection_after_the_time_limit() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        loop = asyncio.get_running_loop()
        begin_s = loop.time()
        with pytest.raises(DeviceError, match=r"no answer to a request for \$OV_PRO within 0.8 s"):
            await client.read("$OV_PRO")
        assert loop.time() - begin_s == pytest.approx(REQUEST_TIMEOUT_S, abs=1e-6)
        assert not client.connected
        await asyncio.sleep(0)
        assert far.lost

    _with_client(test)


def test_a_late_reply_is_never_taken_for_the_next_request() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        # Just too late, and with the id that the first request on the next connection will have.
        far.answer = lambda far, request: far.send(
            kvp_reply(request, "stale", identity=request[1] + 1), REQUEST_TIMEOUT_S + 0.0001
        )
        with pytest.raises(DeviceError):
            await client.read("OLD")
        far.answer = _answers("fresh")
        await client.connect()
        assert await client.read("NEW") == "fresh"

    _with_client(test)


def test_a_second_reply_on_the_same_request_does_not_answer_the_next() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        def twice(far: FarEnd, request: bytes) -> None:
            far.send(kvp_reply(request, "1") + kvp_reply(request, "2"))

        far.answer = twice
        assert await client.read("A") == "1"
        with pytest.raises(KvpProtocolError, match="reply with id"):
            await client.read("B")
        assert not client.connected

    _with_client(test)


def test_a_request_that_is_given_up_ends_the_connection() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await client.read("A")
        assert not client.connected
        far.answer = _answers("fresh")
        await client.connect()
        assert await client.read("B") == "fresh"

    _with_client(test)


def test_a_caller_that_gives_up_while_it_queues_leaves_the_connection_alone() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = lambda far, request: far.send(kvp_reply(request, "1"), 0.2)
        first = asyncio.create_task(client.read("A"))
        await asyncio.sleep(0.01)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await client.read("B")
        assert await first == "1"
        assert client.connected

    _with_client(test)


def test_the_loss_of_the_connection_fails_the_request_at_once() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        begin_s = asyncio.get_running_loop().time()
        far.answer = lambda far, request: far.end.close()
        with pytest.raises(DeviceError, match="closed by the other side"):
            await client.read("A")
        assert asyncio.get_running_loop().time() == begin_s

    _with_client(test)


def test_done_but_empty_is_an_error_that_keeps_the_connection() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = _answers("")
        with pytest.raises(VariableEmptyError):
            await client.read("UNKNOWN")
        assert client.connected

    _with_client(test)


def test_a_refused_write_is_an_error_that_keeps_the_connection() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = lambda far, request: far.send(kvp_reply(request, "1", ok=False))
        with pytest.raises(VariableRefusedError, match="refused to write"):
            await client.write("$ROB_TIMER", "1")
        assert client.connected

    _with_client(test)


@pytest.mark.parametrize("answer", ["", "PING", "pong"])
def test_a_server_that_does_not_answer_pong_is_no_connection(answer: str) -> None:
    async def main() -> None:
        far = FarEnd(lambda far, request: far.send(kvp_reply(request, answer)))
        client = KvpClient(far.open, "controller")
        for _ in range(2):
            with pytest.raises(DeviceError):
                await client.connect()
            assert not client.connected
        assert far.opened == 2
        await client.close()

    clock.run(main(), virtual=True)


def test_a_silent_server_fails_the_connection_on_its_ping() -> None:
    async def main() -> None:
        far = FarEnd()
        client = KvpClient(far.open, "controller 127.0.0.1:7000")
        with pytest.raises(DeviceError, match=r"7000: no answer to a request for PING within 0\.8"):
            await client.connect()
        assert not client.connected

    clock.run(main(), virtual=True)


def _pings(far: FarEnd) -> list[float]:
    return [t for t, request in far.pieces if kvp_name(request) == "PING"]


def test_a_ping_keeps_a_quiet_connection_alive() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        await asyncio.sleep(35.0)
        pauses = [b - a for a, b in zip(_pings(far), _pings(far)[1:], strict=False)]
        assert pauses == pytest.approx([KEEP_ALIVE_S] * 3, abs=0.01)

    _with_client(test)


def test_a_busy_connection_needs_no_ping() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = _answers("1")
        for _ in range(10):
            await asyncio.sleep(3.0)
            await client.read("A")
        assert len(_pings(far)) == 1

    _with_client(test)


def test_the_emulated_server_keeps_a_quiet_client_for_minutes() -> None:
    async def main() -> None:
        emulated = EmulatedCell(1)

        async def connect() -> Link:
            here, there = memory_pair()
            emulated.kvp.attach(there)
            return here

        client = KvpClient(connect, "controller")
        await client.connect()
        await asyncio.sleep(120.0)
        assert client.connected
        assert await client.read("$OV_PRO") == "100"
        await client.close()
        await emulated.close()

    clock.run(main(), virtual=True)


def test_a_connection_that_was_opened_again_is_kept_alive_too() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.end.close()
        # Long enough for the first keep-alive to find no connection and end.
        await asyncio.sleep(2.5 * KEEP_ALIVE_S)
        assert not client.connected
        await client.connect()
        before = len(_pings(far))
        await asyncio.sleep(2.5 * KEEP_ALIVE_S)
        assert len(_pings(far)) == before + 2

    _with_client(test)


def test_the_loss_of_an_old_link_does_not_end_the_new_one() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        old = far.end
        with pytest.raises(DeviceError):
            await client.read("A")
        await client.connect()
        old.close()
        await asyncio.sleep(0.1)
        assert client.connected

    _with_client(test)


def test_closing_twice_and_closing_a_busy_client_is_harmless() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        request = asyncio.create_task(client.read("A"))
        await asyncio.sleep(0.01)
        await client.close()
        await client.close()
        with pytest.raises(DeviceError, match="the connection was closed"):
            await request

    _with_client(test)


def test_the_request_number_starts_again_after_65535() -> None:
    async def test(client: KvpClient, far: FarEnd) -> None:
        far.answer = lambda far, request: far.send(kvp_reply(request, "1"))
        numbers = []
        for _ in range(65_540):
            await client.read("A")
            numbers.append(int.from_bytes(far.pieces[-1][1][:2], "big"))
        assert min(numbers) == 1
        assert max(numbers) == 65_535
        assert numbers[-1] < 100

    _with_client(test)
