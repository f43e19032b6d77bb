"""The client at a C3 Bridge: found by reading, several variables at once, and its disconnects."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable

import pytest

from sphmctl import clock
from sphmctl.drivers.kvp_client import BATCH, KEEP_ALIVE_S, REQUEST_TIMEOUT_S, Flavour, KvpClient
from sphmctl.drivers.link import Link, memory_pair
from sphmctl.emulators.cell import EmulatedCell
from sphmctl.emulators.kvp_c3 import C3
from sphmctl.errors import DeviceError
from sphmctl.wire.kvp import KvpProtocolError, VariableEmptyError, VariableRefusedError
from tests.drivers.far_end import FarEnd, kvp_name, kvp_reply

NAMES = ["$OV_PRO", "$MODE_OP", "$PRO_NAME1[]", "$KR_SERIALNO"]


class Heard:
    """An emulated cell's server, with what the client sent to it."""

    def __init__(self, flavour: Flavour) -> None:
        self.cell = EmulatedCell(1, flavour="c3" if flavour == "c3" else "kvp")
        self.frames: list[bytes] = []
        self.ends: list[Link] = []

    async def open(self) -> Link:
        here, there = memory_pair()
        self.cell.kvp.attach(there)
        take = there.on_bytes

        def heard(data: bytes) -> None:
            self.frames.append(data)
            take(data)

        there.on_bytes = heard
        self.ends.append(there)
        return here

    @property
    def functions(self) -> list[int]:
        return [frame[4] for frame in self.frames]


def _with_server(
    test: Callable[[KvpClient, Heard], Awaitable[None]],
    server: Flavour = "c3",
    flavour: Flavour = "auto",
) -> None:
    async def main() -> None:
        heard = Heard(server)
        client = KvpClient(heard.open, "controller", flavour=flavour)
        try:
            await client.connect()
            await test(client, heard)
        finally:
            await client.close()
            await heard.cell.close()

    clock.run(main(), virtual=True)


@pytest.mark.parametrize(
    ("server", "flavour", "found", "functions"),
    [
        ("c3", "auto", "c3", [0, 0, 0]),
        ("c3", "c3", "c3", [0, 0, 0]),
        ("c3", "kvp", "kvp", [0]),
        ("kvp", "auto", "kvp", [0, 0]),
        ("kvp", "kvp", "kvp", [0]),
    ],
)
def test_the_server_is_found_with_plain_reads(
    server: Flavour, flavour: Flavour, found: str, functions: list[int]
) -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        assert client.flavour == found
        assert heard.functions == functions
        values = await client.read_many(NAMES)
        assert values[:3] == ["100", "#EX", '"SPH_RUN"']
        assert heard.functions[len(functions) :] == ([6] if found == "c3" else [0] * 4)

    _with_server(test, server, flavour)


def test_a_cell_file_that_insists_on_c3_is_told_what_the_server_is() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        raise AssertionError("it must not connect")

    with pytest.raises(
        DeviceError, match=r"flavour is c3, but the server says it is ''; C3 Bridge"
    ):
        _with_server(test, "kvp", "c3")


def _said(words: dict[str, str]) -> Callable[[FarEnd, bytes], None]:
    def answer(far: FarEnd, request: bytes) -> None:
        far.send(kvp_reply(request, words.get(kvp_name(request), "")), 0.002)

    return answer


@pytest.mark.parametrize(
    ("kind", "version"),
    [("C3 BRIDGE INTERFACE", "1.2 (OPEN SOURCE)"), ("C3 BRIDGE INTERFACE", ""), ("OTHER", "2.0")],
)
def test_a_server_whose_functions_are_not_right_is_used_as_a_plain_one(
    kind: str, version: str
) -> None:
    words = {"PING": "PONG", "@PROXY_TYPE": kind, "@PROXY_VERSION": version, "A": "1"}

    async def main() -> None:
        client = KvpClient(FarEnd(_said(words)).open, "controller", flavour="auto")
        await client.connect()
        assert client.flavour == "kvp"
        assert await client.read("A") == "1"
        await client.close()
        strict = KvpClient(FarEnd(_said(words)).open, "controller", flavour="c3")
        with pytest.raises(DeviceError, match=f"says it is '{kind}.*from version 1.3 on"):
            await strict.connect()
        assert not strict.connected
        await strict.close()

    clock.run(main(), virtual=True)


def test_reads_and_writes_use_the_functions_with_error_codes() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        del heard.frames[:]
        await client.write("$OV_PRO", "55")
        assert await client.read("$OV_PRO") == "55"
        await client.write_many([("$OV_PRO", "44"), ("$OV_JOG", "6")])
        assert await client.read_many(["$OV_PRO", "$OV_JOG"]) == ["44", "6"]
        assert heard.functions == [5, 4, 7, 6]

    _with_server(test)


def test_the_variable_to_blame_is_named_and_the_connection_is_kept() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        with pytest.raises(VariableRefusedError, match=r"NOSUCH: .*refused to read it"):
            await client.read_many(["$OV_PRO", "NOSUCH", "$MODE_OP"])
        with pytest.raises(VariableRefusedError, match=r"\$MODE_OP: .*refused to write it"):
            await client.write_many([("$OV_PRO", "40"), ("$MODE_OP", "#T1")])
        assert client.connected
        assert await client.read("$OV_PRO") == "40"

    _with_server(test)


def test_a_list_longer_than_a_batch_is_read_in_several_requests() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        del heard.frames[:]
        count = 2 * BATCH + 1
        names = [f"$FLAG[{n}]" for n in range(1, count + 1)]
        await client.write_many([(name, "TRUE") for name in names])
        assert await client.read_many(names) == ["TRUE"] * count
        assert heard.functions == [7, 7, 7, 6, 6, 6]

    _with_server(test)


def test_a_hang_up_of_the_server_is_noticed_and_mended_by_a_new_connection() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        request = asyncio.create_task(client.read("$OV_PRO"))
        await asyncio.sleep(0.0005)
        heard.ends[-1].on_bytes(bytes.fromhex("00 01 00 00 00"))
        assert await request == "100", "what was asked before is answered"
        await asyncio.sleep(0.001)
        with pytest.raises(DeviceError, match="the connection is lost"):
            await client.read("$OV_PRO")
        assert not client.connected
        await client.connect()
        assert client.flavour == "c3"
        assert await client.read("$OV_PRO") == "100"

    _with_server(test)


def test_the_server_is_not_asked_again_what_it_is_on_the_next_connection() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        heard.ends[-1].close()
        await asyncio.sleep(0.001)
        del heard.frames[:]
        await client.connect()
        assert heard.functions == [4]

    _with_server(test)


def test_a_keep_alive_satisfies_a_server_with_an_idle_limit() -> None:
    async def test(client: KvpClient, heard: Heard) -> None:
        heard.cell.kvp._flavour = C3(
            heard.cell.controller, random.Random(1), idle_limit_s=KEEP_ALIVE_S + 2.0
        )
        await asyncio.sleep(120.0)
        assert client.connected

    _with_server(test)


def _answer(*items: tuple[int, str], number: int = 0) -> Callable[[FarEnd, bytes], None]:
    """A reply to function 6, put down from the specification's section 3.5.7."""

    def answer(far: FarEnd, request: bytes) -> None:
        if request[4] == 0:
            _said({"PING": "PONG", "@PROXY_TYPE": "C3 BRIDGE INTERFACE", "@PROXY_VERSION": "1.4"})(
                far, request
            )
            return
        good = all(code == 1 for code, _ in items)
        body = bytes((6, len(items)))
        for code, value in items:
            body += bytes((code,)) + len(value).to_bytes(2, "big") + value.encode("utf-16-le")
        body += bytes((0, good, good))
        head = (int.from_bytes(request[:2], "big") + number).to_bytes(2, "big")
        far.send(head + len(body).to_bytes(2, "big") + body)

    return answer


def _asked(answer: Callable[[FarEnd, bytes], None]) -> tuple[BaseException | None, bool]:
    """How a read of A and B ends, and whether the connection is kept."""

    async def main() -> tuple[BaseException | None, bool]:
        client = KvpClient(FarEnd(answer).open, "controller", flavour="auto")
        await client.connect()
        (result,) = await asyncio.gather(client.read_many(["A", "B"]), return_exceptions=True)
        kept = client.connected
        await client.close()
        return (result if isinstance(result, BaseException) else None), kept

    return clock.run(main(), virtual=True)


def test_a_wrong_reply_ends_the_connection_and_a_failed_one_does_not() -> None:
    assert _asked(_answer((1, "1"), (1, "2"))) == (None, True)
    for answer in (_answer((1, "1")), _answer((1, "1"), (1, "2"), number=1), _answer()):
        error, kept = _asked(answer)
        assert isinstance(error, KvpProtocolError)
        assert not kept
    error, kept = _asked(_answer((1, "1"), (1, "")))
    assert isinstance(error, VariableEmptyError)
    assert kept
    error, kept = _asked(_answer((1, "1"), (0, "")))
    assert isinstance(error, VariableRefusedError)
    assert kept


def test_silence_ends_the_connection_after_the_time_limit_and_names_the_variables() -> None:
    async def main() -> None:
        far = FarEnd(_answer((1, "1")))
        client = KvpClient(far.open, "controller", flavour="auto")
        await client.connect()
        far.answer = None
        begin_s = asyncio.get_running_loop().time()
        with pytest.raises(DeviceError, match=r"no answer to a request for A, B within 0\.8 s"):
            await client.read_many(["A", "B"])
        assert asyncio.get_running_loop().time() - begin_s == pytest.approx(REQUEST_TIMEOUT_S)
        assert not client.connected
        await client.close()

    clock.run(main(), virtual=True)
