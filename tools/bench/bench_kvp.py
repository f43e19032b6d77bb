"""Times a KUKAVARPROXY read: our client, a bare asyncio protocol, and py-openshowvar unchanged.

Run `python tools/bench/bench_kvp.py`; the emulated controller, without service times, is another
process on loopback TCP. The clients take turns, so that a busy machine slows all alike. Ours and
the bare protocol run on the product's loop with its precise timers, a second bare one on a stock
loop. py-openshowvar blocks: it is what a client without an event loop costs. Not a test.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import statistics
import struct
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from py_openshowvar import openshowvar

from sphmctl import clock
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.drivers.link import Link, open_tcp
from tools.bench.harness import SPHMCTL, Row, markdown, percentile, served

COMMAND = "python tools/bench/bench_kvp.py"
VARIABLE = "$OV_PRO"
ROUNDS, READS = 30, 400  # some seconds; a round of 400 outlasts what a host's stall spoils
WARM_UP_READS = 100
CONNECT_LIMIT_S = 5.0
AIM = 1.3
"""Time-out, lock, id, form and refusal are checked for less than a third of the bare exchange."""


@dataclass
class Times:
    """What one client took: each read, us, and its own processor time a read in each round, us."""

    name: str
    read_us: list[float] = field(default_factory=list)
    cpu_us: list[float] = field(default_factory=list)

    def add(self, reads_ns: list[int], cpu_ns: int) -> None:
        """Keep one round."""
        self.read_us += [read / 1e3 for read in reads_ns]
        self.cpu_us.append(cpu_ns / len(reads_ns) / 1e3)


class Bare(asyncio.Protocol):
    """The least that a client can do: send the bytes, and wait for some."""

    def __init__(self) -> None:
        self.transport: asyncio.WriteTransport | None = None
        self._loop = asyncio.get_running_loop()
        self._waiter: asyncio.Future[bytes] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.WriteTransport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        if self._waiter is not None:
            self._waiter.set_result(data)

    async def exchange(self, frame: bytes) -> bytes:
        """Send a frame; whatever comes next is the answer."""
        assert self.transport is not None
        self._waiter = self._loop.create_future()
        self.transport.write(frame)
        return await self._waiter


def read_frame(request_id: int, name: str) -> bytes:
    """A read request (ulsu-tech/c3bridge-server, include/c3bi.h)."""
    return struct.pack(">HHBH", request_id, len(name) + 3, 0, len(name)) + name.encode()


async def reads(once: Callable[[], Awaitable[object]], count: int) -> tuple[list[int], int]:
    """The time of each of `count` reads, and the processor time of all, ns."""
    spent: list[int] = []
    cpu_ns = time.process_time_ns()
    for _ in range(count):
        started = time.perf_counter_ns()
        await once()
        spent.append(time.perf_counter_ns() - started)
    return spent, time.process_time_ns() - cpu_ns


def blocking_reads(client: openshowvar, count: int) -> tuple[list[int], int]:
    """As `reads`, of a client that blocks."""
    spent: list[int] = []
    cpu_ns = time.process_time_ns()
    for _ in range(count):
        started = time.perf_counter_ns()
        value = client.read(VARIABLE, debug=False)
        spent.append(time.perf_counter_ns() - started)
        if not value:
            raise RuntimeError(f"py-openshowvar read {value!r}")
    return spent, time.process_time_ns() - cpu_ns


async def open_ours(port: int) -> KvpClient:
    """Our client, connected."""

    async def opener() -> Link:
        return await open_tcp("127.0.0.1", port, CONNECT_LIMIT_S)

    client = KvpClient(opener, "controller")
    await client.connect()
    return client


async def open_bare(port: int) -> Bare:
    """The bare protocol, connected."""
    loop = asyncio.get_running_loop()
    _, protocol = await loop.create_connection(Bare, "127.0.0.1", port)
    return protocol


async def close_bare(bare: Bare) -> None:
    """Hang up."""
    if bare.transport is not None:
        bare.transport.abort()
    await asyncio.sleep(0)


def contest(port: int, rounds: int, count: int) -> list[Times]:
    """Let them read in turns, each on a connection and a loop of its own; ours comes first."""
    blocking = openshowvar("127.0.0.1", port)
    with (
        asyncio.Runner(loop_factory=clock.precise_loop) as own_loop,
        asyncio.Runner(loop_factory=clock.precise_loop) as bare_loop,
        asyncio.Runner() as stock_loop,
    ):
        client = own_loop.run(open_ours(port))
        bare, stock = bare_loop.run(open_bare(port)), stock_loop.run(open_bare(port))
        frame = read_frame(1, VARIABLE)
        turns: list[tuple[Times, Callable[[int], tuple[list[int], int]]]] = [
            (Times("sphmctl"), lambda n: own_loop.run(reads(lambda: client.read(VARIABLE), n))),
            (
                Times("bare asyncio"),
                lambda n: bare_loop.run(reads(lambda: bare.exchange(frame), n)),
            ),
            (
                Times("bare asyncio, stock loop"),
                lambda n: stock_loop.run(reads(lambda: stock.exchange(frame), n)),
            ),
            (Times("py-openshowvar"), lambda n: blocking_reads(blocking, n)),
        ]
        for _, turn in turns:
            turn(WARM_UP_READS)
        rng = random.Random(1)
        for _ in range(rounds):
            for times, turn in rng.sample(turns, len(turns)):
                times.add(*turn(count))
        own_loop.run(client.close())
        bare_loop.run(close_bare(bare))
        stock_loop.run(close_bare(stock))
    blocking.close()
    return [times for times, _ in turns]


def measure(rounds: int = ROUNDS, count: int = READS) -> list[Row]:
    """Run the contest; prints each client, returns the table's rows."""
    with served([SPHMCTL, "emulate", "--latency", "none", "--json"]) as ready:
        ours, *others = contest(int(ready["kvp_port"]), rounds, count)
    print(f"{rounds} rounds of {count} reads of {VARIABLE}, us: median, 99 %, processor time")
    for times in (ours, *others):
        cpu = statistics.median(times.cpu_us)
        p50, p99 = statistics.median(times.read_us), percentile(times.read_us, 99.0)
        print(f"{times.name:25} {p50:8.1f} {p99:8.1f} {cpu:8.1f}", flush=True)
    own_us = statistics.median(ours.read_us)
    rows = []
    for other, aim in zip(others, (AIM, None, None), strict=True):
        other_us = statistics.median(other.read_us)
        rows.append(
            Row(
                "KUKAVARPROXY read over loopback TCP",
                f"{own_us:.0f} us",
                f"{other_us:.0f} us, {other.name}",
                own_us / other_us,
                aim,
                COMMAND,
            )
        )
    return rows


def main() -> None:
    """Print the figures and the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="turns of each client")
    parser.add_argument("--reads", type=int, default=READS, help="reads a turn")
    options = parser.parse_args()
    print(markdown(measure(options.rounds, options.reads)))


if __name__ == "__main__":
    main()
