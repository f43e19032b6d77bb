"""py-openshowvar, unchanged, drives the shipped robot program and reads it while the arm moves."""

from __future__ import annotations

import asyncio
import random
import time
from typing import Any

import pytest
from py_openshowvar import openshowvar

from sphmctl.emulators.controller import Controller
from sphmctl.emulators.kvp_server import KvpServer
from sphmctl.emulators.world import World

pytestmark = pytest.mark.realtime

HOST = "127.0.0.1"
LIMIT_S = 15.0
RUNNING, ENDED = "2", "5"
TARGET_DEG = 12.0


class Client:
    """A client's variables; it beats with each look at the state, some milliseconds apart."""

    def __init__(self, port: int) -> None:
        self._client = openshowvar(HOST, port)
        self._beat = 0

    def read(self, name: str) -> str:
        return str(self._client.read(name, debug=False).decode())

    def write(self, name: str, text: str) -> None:
        assert self._client.write(name, text, debug=False) == text.encode()

    def field(self, name: str) -> str:
        self._beat += 1
        self.write("SPH_BEAT", str(self._beat))
        # One field, since this client takes 256 bytes of a reply at most.
        return self.read(f"SPH_STATE.{name}")

    def until(self, name: str, value: str) -> None:
        end_s = time.monotonic() + LIMIT_S
        while self.field(name) != value:
            assert time.monotonic() < end_s, (name, value, self.read("SPH_STATE.FAULT"))

    def close(self) -> None:
        self._client.close()


def drive(port: int) -> dict[str, Any]:
    """One knot, as the interface's document says, and what is read on the way."""
    client = Client(port)
    try:
        for name in ("SPH_CMD", "SPH_WR", "SPH_LAST"):
            client.write(name, "0")
        client.write("SPH_SESSION", "77")
        client.until("SESSION", "77")
        axes = f"A1 {TARGET_DEG}, A2 -90.0, A3 90.0, A4 0.0, A5 90.0, A6 0.0"
        knot = f"{{SPH_KNOT_T: SEQ 1, VEL 5.0, ACC 100.0, Q {{E6AXIS: {axes}}}}}"
        client.write("SPH_KNOT[1]", knot)
        client.write("SPH_LAST", "1")
        client.write("SPH_WR", "1")
        client.field("BEAT")
        client.write("SPH_CMD", "1")
        client.until("STATUS", RUNNING)
        on_the_way = []
        while client.field("STATUS") == RUNNING:
            on_the_way.append(float(client.read("$AXIS_ACT.A1")))
        client.until("STATUS", ENDED)
        return {
            "on the way": on_the_way,
            "end": float(client.read("$AXIS_ACT.A1")),
            "passed": client.field("DONE"),
            "slot": client.read("SPH_KNOT[1].SEQ"),
            "program": client.read("$PRO_STATE1"),
        }
    finally:
        client.close()


def test_a_foreign_client_drives_the_program_and_reads_it_while_it_runs() -> None:
    async def main() -> dict[str, Any]:
        loop = asyncio.get_running_loop()
        world = World(loop.time)
        server = KvpServer(Controller(world, random.Random(5)), world, random.Random(6), "none")
        port = await server.serve_tcp(HOST)
        try:
            return await asyncio.wait_for(asyncio.to_thread(drive, port), 2.0 * LIMIT_S)
        finally:
            await server.close()

    said = asyncio.run(main())
    way = said["on the way"]
    assert way == sorted(way)
    assert len({round(angle, 3) for angle in way}) > 5
    assert abs(said["end"] - TARGET_DEG) < 1e-4
    assert (said["passed"], said["slot"], said["program"]) == ("1", "1", "#P_ACTIVE")
