"""Whole runs on the virtual clock: an emulated cell whose links can be heard, cut and stalled."""

from __future__ import annotations

import asyncio
import errno
import os
import struct
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sphmctl import clock, planner
from sphmctl.cli.emulation import BoardKind, simulated_board, with_board
from sphmctl.config import Cell, emulated_cell
from sphmctl.daemon.record import Events
from sphmctl.daemon.session import Outcome, Session
from sphmctl.drivers.connect import make_arm, make_wrist
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.link import Link, MemoryLink
from sphmctl.drivers.wrist import Wrist
from sphmctl.emulators.cell import EmulatedCell, Setup
from sphmctl.emulators.controller import Options
from sphmctl.emulators.kvp_server import FlavourName
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats, Plan
from sphmctl.pathfile import load_path

HOME = "[0, -90, 90, 0, 90, 0, 60, 60, 60]"
AWAY = "[20, -80, 95, 10, 80, 15, 90, 70, 40]"

SIDES = f"""
version: 1
name: two sides
points:
  S: {{joints_deg: {HOME}}}
  P: {{joints_deg: {AWAY}}}
moves: [{{ptp: S}}, {{ptp: P}}, {{ptp: S}}]
"""
"""Two sides of 0.7 s each, away and back, from where the emulated cell begins."""

STEPS = f"""
version: 1
name: steps
points:
  S: {{joints_deg: {HOME}}}
  P: {{joints_deg: {AWAY}}}
moves: [{{ptp: S}}, {", ".join(["{ptp: P}, {ptp: S}"] * 7)}]
"""
"""Fourteen sides: more knots than are given to the controller ahead."""

STILL_DEG = 1e-6
"""Nothing may move any more: the emulated world is exact."""

LINGER_S = 1.5
"""After a run: how long the machine is watched for motion that should not be."""


@cache
def plan_of(text: str) -> Plan:
    """The plan of a path file's text on the emulated cell."""
    file = Path("/tmp") / f"sphmctl-rig-{abs(hash(text))}.yaml"
    file.write_text(text)
    try:
        return planner.plan(load_path(file), emulated_cell())
    finally:
        file.unlink()


@dataclass
class Wire:
    """One link of the cell, seen from the host."""

    attach: Callable[[MemoryLink], None]
    frames: list[tuple[float, bytes]] = field(default_factory=list)
    deaf: bool = False
    broken: bool = False
    until_s: float = 0.0
    refused: bool = False
    opened: int = 0
    end: MemoryLink | None = None

    async def open(self) -> Link:
        """A fresh pipe to the emulator."""
        if self.refused:
            raise DeviceError("nothing listens there")
        here, there = _HeardLink(self), MemoryLink()
        here.join(there)
        there.join(here)
        self.attach(there)
        self.end = there
        self.opened += 1
        return here

    def pause(self, seconds: float) -> None:
        """Deliver nothing for a while, then everything: a busy machine at the other side."""
        self.until_s = asyncio.get_running_loop().time() + seconds

    def cut(self) -> None:
        """The other side goes away."""
        if self.end is not None:
            self.end.close()

    def sent(self, since_s: float) -> list[tuple[float, bytes]]:
        """What the host sent after an instant."""
        return [(t, data) for t, data in self.frames if t > since_s]


class _HeardLink(MemoryLink):
    """The host's end: what it writes is noted, lost while the wire is deaf, late in a pause."""

    def __init__(self, wire: Wire) -> None:
        super().__init__()
        self._wire = wire

    def write(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        if self._wire.broken:
            raise RuntimeError("a mistake in our own code")
        self._wire.frames.append((loop.time(), data))
        if self._wire.deaf:
            return
        if self._wire.until_s > loop.time():
            loop.call_at(self._wire.until_s, super().write, data)
        else:
            super().write(data)


class Rig:
    """An emulated cell, its drivers and a session; made inside the running loop."""

    def __init__(
        self,
        seed: int = 1,
        setup: Setup | None = None,
        options: Options | None = None,
        board: BoardKind = "none",
        flavour: FlavourName = "kvp",
    ) -> None:
        self.loop = asyncio.get_running_loop()
        hardware = simulated_board("held") if board == "simulated" else None
        self.emulated = EmulatedCell(seed, setup, options=options, board=hardware, flavour=flavour)
        self.kvp = Wire(self.emulated.kvp.attach)
        self.bus = Wire(lambda end: self.emulated.attach_wrist(end, 1_000_000))
        self.cell: Cell = with_board(emulated_cell(), board)
        self.arm: KukaArm = make_arm(self.cell, self.kvp.open)
        self.wrist: Wrist = make_wrist(self.cell, self.bus.open)
        self.events = Events(None, self.loop.time)
        self.session = Session(self.cell, self.arm, self.wrist, self.events)
        self.stop = asyncio.Event()
        self.rows: list[tuple[float, Floats, float]] = []
        self.tau = 0.0
        self.acted_s = float("nan")
        self.full_disk = False

    def anew(self) -> None:
        """Drivers and session as the next `run` makes them, on the same cell."""
        self.arm = make_arm(self.cell, self.kvp.open)
        self.wrist = make_wrist(self.cell, self.bus.open)
        self.events = Events(None, self.loop.time)
        self.session = Session(self.cell, self.arm, self.wrist, self.events)
        self.stop = asyncio.Event()
        self.tau = 0.0

    def write(self, name: str, text: str) -> None:
        """What another client of the controller writes."""
        self.emulated.world.advance()
        assert self.emulated.controller.store.write_text(name, text)

    def act(self) -> None:
        """Note that now something happens to the run."""
        self.acted_s = self.loop.time()

    async def until(self, met: Callable[[], bool], limit_s: float = 30.0) -> None:
        """Wait for a condition, looked at each millisecond."""
        end_s = self.loop.time() + limit_s
        while not met():
            assert self.loop.time() < end_s, "what the test waits for did not happen"
            await asyncio.sleep(0.001)

    async def until_event(self, name: str) -> None:
        """Wait until an event is reported."""
        await self.until(lambda: any(event == name for _, event, _ in self.events.history))

    async def until_tau(self, tau_s: float) -> None:
        """Wait until the plan is driven so far."""
        await self.until(lambda: self.tau >= tau_s)

    async def until_driven(self) -> None:
        """Wait until the arm's program has ended the motion."""
        variables = self.emulated.controller.store
        await self.until(lambda: variables.get("SPH_STATUS") == variables.get("SPH_STATUS_ENDED"))

    def torques(self) -> list[int]:
        """Torque Enable of the three servos, as it is."""
        return [servo.table["torque_enable"] for servo in self.emulated.servos]

    def _row(self, t_s: float, joints: Floats, tau_s: float) -> None:
        if self.full_disk:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.rows.append((t_s, joints, tau_s))

    def progress(self, tau_s: float) -> None:
        """Take the plan time reached."""
        self.tau = tau_s

    async def play(self, plan: Plan) -> Outcome:
        """Connect, verify, consent and drive."""
        await self.session.open()
        await self.session.verify()
        approach = await self.session.prepare(plan, 1.0, agree)
        return await self.session.play(plan, approach, self.stop, self._row, self.progress)

    async def close(self) -> None:
        """End it all."""
        await self.session.close()
        await self.emulated.close()


async def agree(question: str) -> bool:
    """Consent."""
    return True


Script = Callable[[Rig], Awaitable[None]]


@dataclass
class Ended:
    """A run that is over, and what the machine really did.

    Attributes:
        truth: time on the loop's clock and nine true joints (deg), from the begin of the session
            to `LINGER_S` after its end.
        end_s: when `play` returned.
        left_over: tasks that the run left behind.
    """

    rig: Rig
    outcome: Outcome
    truth: Floats
    end_s: float
    torques: list[int]
    left_over: list[str]

    @property
    def decided_s(self) -> float:
        """When the run learnt that it must end: the first fault, or the test's own act."""
        start_s = self.rig.emulated.world.start_s
        faults = [t for t, name, _ in self.rig.events.history if name in ("fault", "wrist lost")]
        return start_s + faults[0] if faults else self.rig.acted_s

    def event(self, name: str) -> dict[str, Any]:
        """The fields of the first event of that name."""
        return next(fields for _, event, fields in self.rig.events.history if event == name)

    def moved_deg(self, from_s: float, to_s: float = float("inf")) -> Floats:
        """How far each true joint went between two instants, at most."""
        t, joints = self.truth[:, 0], self.truth[:, 1:]
        part = joints[(t >= from_s) & (t <= to_s)]
        result: Floats = np.abs(part - part[0]).max(axis=0) if len(part) else np.zeros(9)
        return result

    def orders_after(self, since_s: float) -> list[str]:
        """What could set the arm in motion and was sent after an instant."""
        found = []
        for t_s, frame in self.rig.kvp.sent(since_s):
            name, value = _written(frame)
            moves = name.startswith(("SPH_KNOT", "SPH_WR", "SPH_LAST", "SPH_SESSION"))
            if moves or (name == "SPH_CMD" and value == "1"):
                found.append(f"{t_s - since_s:+.4f} s {name} = {value}")
        return found

    def goals_after(self, since_s: float) -> list[tuple[int, ...]]:
        """Crank goals (ticks) that were sent after an instant."""
        return [goal for _, frame in self.rig.bus.sent(since_s) for goal in goals_in(frame)]


def goals_in(data: bytes) -> list[tuple[int, ...]]:
    """Goals in the sync writes to Goal Position(116): 29 bytes for three servos."""
    head = bytes.fromhex("FF FF FD 00 FE 16 00 83 74 00 04 00")
    at = data.find(head)
    if at < 0:
        return []
    return [struct.unpack("<xixixi", data[at + len(head) : at + len(head) + 15])]


def _written(frame: bytes) -> tuple[str, str]:
    """Name and value of a KUKAVARPROXY write request; empty for a read."""
    function, name_bytes = struct.unpack_from(">BH", frame, 4)
    if function != 1:
        return "", ""
    return frame[7 : 7 + name_bytes].decode(), frame[9 + name_bytes :].decode()


def run(
    script: Script | None = None,
    *,
    path: str = SIDES,
    seed: int = 1,
    setup: Setup | None = None,
    options: Options | None = None,
    board: BoardKind = "none",
    flavour: FlavourName = "kvp",
) -> Ended:
    """Drive a path while `script` does something to the cell."""

    async def main() -> Ended:
        before = asyncio.all_tasks()
        rig = Rig(seed, setup, options, board, flavour)
        task = None if script is None else asyncio.ensure_future(script(rig))
        try:
            outcome = await rig.play(plan_of(path))
            end_s = rig.loop.time()
            torques = rig.torques()
            if task is not None:
                await task
            await asyncio.sleep(LINGER_S)
            rows = np.array(rig.emulated.truth(0.0, rig.loop.time()))
            rows[:, 0] += rig.emulated.world.start_s
        finally:
            if task is not None:
                task.cancel()
            await rig.close()
        await asyncio.sleep(0)
        left_over = [t.get_name() for t in asyncio.all_tasks() - before]
        return Ended(rig, outcome, rows, end_s, torques, left_over)

    return clock.run(main(), virtual=True)


def at(tau_s: float, act: Callable[[Rig], object]) -> Script:
    async def script(rig: Rig) -> None:
        await rig.until_tau(tau_s)
        rig.act()
        act(rig)

    return script


def ends_in_peace(ended: Ended) -> None:
    """No motion, no order and no task after the end; both halves stand."""
    assert ended.moved_deg(ended.end_s).max() <= STILL_DEG
    assert ended.orders_after(ended.decided_s) == []
    assert ended.left_over == []


def crank_errors_deg(ended: Ended, text: str) -> Floats:
    """Crank errors (deg) at the end against where the arm stands on the plan."""
    plan = plan_of(text)
    last = ended.truth[-1, 1:]
    nearest = np.abs(np.degrees(plan.joints[:, :6]) - last[:6]).max(axis=1).argmin()
    result: Floats = np.abs(np.degrees(plan.joints[nearest, 6:]) - last[6:])
    return result
