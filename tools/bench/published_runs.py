"""Drives the octagon's knots by a published KRL program, or by ours, on the same emulated cell.

The published program repeats a PTP to one global variable, and its client overwrites that variable
at each point's planned time. Judges nothing; see `published_figures`.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from sphmctl import clock
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.emulators.cell import EmulatedCell, Setup
from sphmctl.emulators.controller import Options
from sphmctl.motion import Floats, Plan
from sphmctl.wire import krl
from tests.system import rig

OCTAGON = Path(__file__).parents[2] / "configs" / "paths" / "octagon.yaml"
KRL = Path(__file__).with_name("krl")

OURS = "SPH_RUN"
TARGET = "PUB_AXES"

REST_S = 3.0
"""How long the arm is watched after the last order: longer than it has ever moved on."""

LIMIT_S = 60.0
"""In which the arm comes to the place of a stop: three times the octagon's duration."""

WINDOW_S = 1.0
"""How far ahead on the plan the arm's place is looked for: two knots."""

BY_SILENCE, BY_PRESENT = "stops writing", "writes the present position"
"""The ways in which a published client stops."""


@dataclass(frozen=True)
class Form:
    """A program and how it is used.

    Attributes:
        program: module in `krl/`, or the shipped one.
        override_percent: `$OV_PRO`, the one thing that sets its speed from outside.
        every_s: time between two points; None for the plan's knots.
        aside: whether one whole run is enough, without stops.
    """

    name: str
    program: str = OURS
    override_percent: int = 100
    every_s: float | None = None
    aside: bool = False


@dataclass(frozen=True)
class Entered:
    """A block with a way that the arm has entered: when, its number, and where it ends (deg)."""

    at_s: float
    tag: int
    target_deg: tuple[float, ...]


@dataclass(frozen=True)
class Drive:
    """What happened.

    Attributes:
        truth: time of the world and six true axes (deg), every 4 ms, shape (n, 7).
        entered: the blocks with a way.
        motions: how many blocks the program has planned from the first of them to the last, those
            without a way included.
        points_deg: what should have been driven, in order, shape (n, 6).
        stop_s: when the stop was asked for; NaN without one.
    """

    truth: Floats
    entered: tuple[Entered, ...]
    motions: int
    points_deg: Floats
    stop_s: float


class Witness:
    """A part of the world that notes what the arm enters and how far it is on the plan."""

    def __init__(self, cell: EmulatedCell, plan: Plan) -> None:
        self._cell = cell
        self._plan_deg = np.degrees(plan.joints[:, :6])
        self._ahead = int(np.searchsorted(plan.t, WINDOW_S))
        self._t = plan.t
        self._here = 0
        self._tag = 0
        self.entered: list[Entered] = []
        cell.world.add(self)

    def step(self, index: int) -> None:
        """The world's next millisecond."""
        run = self._cell.controller.arm.running
        if run is not None and run.tag != self._tag:
            self._tag = run.tag
            at_s = self._cell.world.time_s
            self.entered.append(Entered(at_s, run.tag, tuple(run.contour.end_deg)))

    def tau_s(self) -> float:
        """Plan time at which the arm is, never backwards."""
        self._cell.world.advance()
        true_deg = np.array(self._cell.controller.true_joints_deg())
        ahead = self._plan_deg[self._here : self._here + self._ahead]
        self._here += int(np.abs(ahead - true_deg).max(axis=1).argmin())
        return float(self._t[self._here])


@cache
def octagon() -> Plan:
    """The octagon's plan on the emulated cell."""
    return rig.plan_of(OCTAGON.read_text())


@cache
def at_start() -> Setup:
    """A cell that stands where the octagon begins."""
    start_deg = np.degrees(octagon().joints[0])
    return Setup(arm_deg=tuple(start_deg[:6].tolist()), cranks_deg=tuple(start_deg[6:].tolist()))


def points(form: Form) -> tuple[Floats, Floats]:
    """Times (s) at which blocks begin, and where they end (deg), shapes (n,) and (n, 6)."""
    plan = octagon()
    if form.every_s is None:
        ends = [knot.sample for knot in plan.knots]
    else:
        count = round(plan.duration_s / form.every_s)
        times_s = plan.duration_s * np.arange(1, count + 1) / count
        ends = [int(np.abs(plan.t - t).argmin()) for t in times_s]
    return plan.t[[0, *ends[:-1]]], np.degrees(plan.joints[ends, :6])


def middles_s() -> Floats:
    """Plan times in the middle of each of the plan's blocks, where the arm is fastest."""
    plan = octagon()
    ends_s = plan.t[[0, *(knot.sample for knot in plan.knots)]]
    result: Floats = (ends_s[1:] + ends_s[:-1]) / 2.0
    return result


def drive(form: Form, seed: int, stop_tau_s: float | None = None, way: str = BY_SILENCE) -> Drive:
    """One run; with a stop at a place of the path if wanted.

    Args:
        way: how a published client stops; the daemon has one way.
    """
    if form.program == OURS:
        return _drive_ours(form, seed, stop_tau_s)

    async def main() -> Drive:
        files = (KRL / "pub_target.dat", KRL / f"{form.program.lower()}.src")
        setup = at_start()
        options = Options(setup.arm_deg, program=form.program, installed=False, modules=files)
        cell = rig.Rig(seed, setup, options)
        client = KvpClient(cell.kvp.open, "controller")
        try:
            return await _drive_published(cell, client, form, stop_tau_s, way)
        finally:
            await client.close()
            await cell.close()

    return clock.run(main(), virtual=True)


async def _drive_published(
    cell: rig.Rig, client: KvpClient, form: Form, stop_tau_s: float | None, way: str
) -> Drive:
    await client.connect()
    await client.write("$OV_PRO", str(form.override_percent))
    witness = Witness(cell.emulated, octagon())
    times_s, points_deg = points(form)
    stopping = asyncio.Event()
    feeding = asyncio.create_task(_feed(client, times_s, points_deg, stopping), name="feeding")
    if stop_tau_s is not None:
        await cell.until(lambda: witness.tau_s() >= stop_tau_s, LIMIT_S)
        cell.act()
        stopping.set()
        if way == BY_PRESENT:
            await client.write(TARGET, await client.read("$AXIS_ACT"))
    await feeding
    await asyncio.sleep(REST_S)
    # The published programs have no TRIGGER, so that each number is a block's.
    motions = witness.entered[-1].tag - witness.entered[0].tag + 1
    return _told(cell, witness, motions, points_deg)


async def _feed(
    client: KvpClient, times_s: Floats, points_deg: Floats, stopping: asyncio.Event
) -> None:
    """Overwrite the target at each planned time."""
    loop = asyncio.get_running_loop()
    begin_s = loop.time()
    for at_s, point_deg in zip(times_s, points_deg, strict=True):
        await asyncio.sleep(max(0.0, begin_s + float(at_s) - loop.time()))
        if stopping.is_set():
            return
        await client.write(TARGET, krl.axis_aggregate(*point_deg.tolist()))


def _drive_ours(form: Form, seed: int, stop_tau_s: float | None) -> Drive:
    seen: list[Witness] = []

    async def script(cell: rig.Rig) -> None:
        cell.write("$OV_PRO", str(form.override_percent))
        witness = Witness(cell.emulated, octagon())
        seen.append(witness)
        if stop_tau_s is not None:
            await cell.until(lambda: witness.tau_s() >= stop_tau_s, LIMIT_S)
            cell.act()
            cell.stop.set()

    ended = rig.run(script, path=OCTAGON.read_text(), seed=seed, setup=at_start())
    wanted = "completed" if stop_tau_s is None else "stopped"
    if ended.outcome.outcome != wanted:
        raise RuntimeError(f"the run {ended.outcome.outcome}: {ended.outcome.cause}")
    passed = ended.rig.emulated.controller.store.get("SPH_DONE")
    return _told(ended.rig, seen[0], int(str(passed)), points(form)[1])


def _told(cell: rig.Rig, witness: Witness, motions: int, points_deg: Floats) -> Drive:
    world = cell.emulated.world
    rows = np.array(world.truth(0.0, float("inf")))
    stop_s = cell.acted_s - world.start_s
    return Drive(rows[:, :7], tuple(witness.entered), motions, points_deg, stop_s)
