"""Times a servo cycle: our wrist and dynamixel-sdk unchanged, goals out and state back.

Run `python tools/bench/bench_servo.py`. Three emulated servos without wire time answer on a
pseudo-terminal each, served by another process. A cycle is a sync write of three goals and a sync
read of one block of 18 bytes from each servo, taken apart into its ten items. What counts is the
processor time of the client's process, user and system: the SDK waits for bytes by asking again
and again. The two take turns. Not a test.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import signal
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from dynamixel_sdk import GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

from sphmctl import clock
from sphmctl.drivers import xl430
from sphmctl.drivers.link import Link, open_serial
from sphmctl.drivers.servo_bus import ServoBus
from sphmctl.drivers.wrist import CrankScale, Wrist
from sphmctl.emulators.servo_bus import ServoBus as EmulatedBus
from sphmctl.emulators.world import World
from sphmctl.emulators.xl430 import Servo
from sphmctl.motion import Floats
from tools.bench.harness import Row, markdown, percentile, served

COMMAND = "python tools/bench/bench_servo.py"
BAUD = 1_000_000
IDS = (1, 2, 3)
ZERO_TICKS = (1365, 1365, 1365)
START_TICKS = 2048.0
ROUNDS, CYCLES = 30, 150  # some seconds; 150 cycles are hundreds of the processor clock's steps
WARM_UP_CYCLES = 50
OPEN_LIMIT_S = 5.0
MAX_CYCLES = 1_000_000
AIM = 0.6
"""Sleeping until the answer is there must pay for the event loop, and more."""


@dataclass
class Times:
    """What one client took: processor time a cycle in each round, and each cycle's duration, us."""

    name: str
    cpu_us: list[float] = field(default_factory=list)
    cycle_us: list[float] = field(default_factory=list)

    def add(self, cycles_ns: list[int], cpu_ns: int) -> None:
        """Keep one round."""
        self.cycle_us += [cycle / 1e3 for cycle in cycles_ns]
        self.cpu_us.append(cpu_ns / len(cycles_ns) / 1e3)


async def serve() -> None:
    """Serve two sets of three servos, each on a pseudo-terminal, until told to stop."""
    loop = asyncio.get_running_loop()
    done = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, done.set)
    rng = random.Random(1)
    buses = []
    for _ in range(2):
        servos = [Servo(rng, servo_id, START_TICKS) for servo_id in IDS]
        buses.append(EmulatedBus(World(loop.time), servos, rng, usb="none", pacing=False))
    print(json.dumps({"ports": [bus.open_pty() for bus in buses]}), flush=True)
    await done.wait()
    for bus in buses:
        await bus.close()


def goals_of(cycle: int) -> Floats:
    """Crank angles that a wrist could follow: 60 degrees, and a little."""
    return np.full(3, 1.0 + 0.01 * np.sin(0.1 * cycle))


def open_ours(port: str) -> Wrist:
    """Our wrist on a port that is not open yet."""

    async def opener() -> Link:
        return await open_serial(port, BAUD, OPEN_LIMIT_S)

    scale = CrankScale(ZERO_TICKS, (1, 1, 1))
    return Wrist(ServoBus(opener, "wrist", BAUD), IDS, scale, (0.0, 2.0), "wrist")


async def our_cycles(wrist: Wrist, count: int) -> tuple[list[int], int]:
    """The time of each of `count` cycles, and the processor time of all, ns."""
    await wrist.arm(1.0)  # the Bus Watchdog has tripped while the other client had its turn
    goals = [goals_of(cycle) for cycle in range(count)]
    spent: list[int] = []
    cpu_ns = time.process_time_ns()
    for goal in goals:
        started = time.perf_counter_ns()
        state = await wrist.exchange(goal)
        spent.append(time.perf_counter_ns() - started)
        if None in state.servos:
            raise RuntimeError("sphmctl: a servo was silent")
    cpu_ns = time.process_time_ns() - cpu_ns
    await wrist.disarm()
    return spent, cpu_ns


class Sdk:
    """dynamixel-sdk as its examples use it, on the block that the indirect addresses gather."""

    def __init__(self, port: str) -> None:
        self._port = PortHandler(port)
        if not (self._port.openPort() and self._port.setBaudRate(BAUD)):
            raise RuntimeError(f"dynamixel-sdk: cannot open {port}")
        self._packet = PacketHandler(2.0)
        self._writer = GroupSyncWrite(self._port, self._packet, xl430.GOAL_POSITION, 4)
        size = xl430.TELEMETRY_FORMAT.size
        self._reader = GroupSyncRead(self._port, self._packet, xl430.INDIRECT_DATA_1, size)
        addresses = xl430.telemetry_map()
        for servo_id in IDS:
            for at in range(0, len(addresses), 2):
                word = int.from_bytes(addresses[at : at + 2], "little")
                self._must(
                    self._packet.write2ByteTxRx(
                        self._port, servo_id, xl430.INDIRECT_ADDRESS_1 + at, word
                    )
                )
            self._must(self._packet.write1ByteTxRx(self._port, servo_id, xl430.TORQUE_ENABLE, 1))
            self._reader.addParam(servo_id)
            self._writer.addParam(servo_id, bytes(4))

    def cycle(self, ticks: list[int]) -> list[list[int]]:
        """Goals out, and the items of each servo back."""
        for servo_id, goal in zip(IDS, ticks, strict=True):
            self._writer.changeParam(servo_id, goal.to_bytes(4, "little"))
        if self._writer.txPacket() or self._reader.txRxPacket():
            raise RuntimeError("dynamixel-sdk: a cycle failed")
        servos = []
        for servo_id in IDS:
            at = xl430.INDIRECT_DATA_1
            items = []
            for _, size in xl430.TELEMETRY:
                items.append(self._reader.getData(servo_id, at, size))
                at += size
            servos.append(items)
        return servos

    def cycles(self, count: int) -> tuple[list[int], int]:
        """As `our_cycles`."""
        scale = CrankScale(ZERO_TICKS, (1, 1, 1))
        goals = [scale.ticks(goals_of(cycle)) for cycle in range(count)]
        spent: list[int] = []
        cpu_ns = time.process_time_ns()
        for goal in goals:
            started = time.perf_counter_ns()
            self.cycle(goal)
            spent.append(time.perf_counter_ns() - started)
        return spent, time.process_time_ns() - cpu_ns

    def close(self) -> None:
        """Close the port."""
        self._port.closePort()

    def _must(self, answer: tuple[int, int]) -> None:
        if any(answer):
            raise RuntimeError(f"dynamixel-sdk: a write failed with {answer}")


def contest(ports: list[str], rounds: int, count: int) -> list[Times]:
    """Let both run cycles in turns; ours comes first."""
    sdk = Sdk(ports[1])
    with asyncio.Runner(loop_factory=clock.precise_loop) as loop:
        wrist = open_ours(ports[0])
        loop.run(wrist.connect())
        turns: list[tuple[Times, Callable[[int], tuple[list[int], int]]]] = [
            (Times("sphmctl"), lambda n: loop.run(our_cycles(wrist, n))),
            (Times("dynamixel-sdk"), sdk.cycles),
        ]
        for _, turn in turns:
            turn(WARM_UP_CYCLES)
        rng = random.Random(1)
        for _ in range(rounds):
            for times, turn in rng.sample(turns, len(turns)):
                times.add(*turn(count))
        loop.run(wrist.close())
    sdk.close()
    return [times for times, _ in turns]


def measure(rounds: int = ROUNDS, count: int = CYCLES) -> list[Row]:
    """Run the contest; prints both clients, returns the table's row."""
    with served([sys.executable, __file__, "--serve"]) as ready:
        ours, theirs = contest(ready["ports"], rounds, count)
    print(f"{rounds} rounds of {count} cycles, us: processor time; duration: median, 99 %")
    for times in (ours, theirs):
        cpu = statistics.median(times.cpu_us)
        p50, p99 = statistics.median(times.cycle_us), percentile(times.cycle_us, 99.0)
        print(f"{times.name:15} {cpu:8.1f} {p50:8.1f} {p99:8.1f}", flush=True)
    own_us, other_us = statistics.median(ours.cpu_us), statistics.median(theirs.cpu_us)
    return [
        Row(
            "servo cycle on an unpaced pseudo-terminal, processor time",
            f"{own_us:.0f} us",
            f"{other_us:.0f} us, {theirs.name}",
            own_us / other_us,
            AIM,
            COMMAND,
        )
    ]


def main() -> None:
    """Print the figures and the row, or serve."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="turns of each client")
    parser.add_argument("--cycles", type=int, default=CYCLES, help="cycles a turn")
    parser.add_argument("--serve", action="store_true", help="be the other process")
    options = parser.parse_args()
    if options.serve:
        asyncio.run(serve())
    else:
        print(markdown(measure(options.rounds, options.cycles)))


if __name__ == "__main__":
    main()
