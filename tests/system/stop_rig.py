"""What stops the arm on the octagon: events and their removal, the words, and how it is judged.

No tests: `test_stop_cases` and `test_stop_processes` hold them. A side is driven as the octagon
drives it, from the side's first corner on.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import yaml

from sphmctl.cli.emulation import BoardKind
from sphmctl.emulators.cell import EmulatedCell, Setup
from sphmctl.emulators.controller import Options
from sphmctl.emulators.motion import Options as MotionOptions
from sphmctl.errors import SphmctlError
from sphmctl.motion import Floats, Plan
from tests.system.rig import STILL_DEG, Rig, Wire, plan_of
from tests.system.test_octagon import OCTAGON

STAND_S = 0.200
"""How soon the arm must stand after the event."""

LATE_S = 0.120
"""More where only the missing heartbeat tells the controller: LATE_MS of INTERFACE.md."""

ROW_S = 0.004
"""Resolution of the record of true joints."""

WATCHED_S = 2.0
"""How long the arm is watched before the cause is removed, and again afterwards."""

SOON_S = 0.4
"""When a hasty operator has removed the cause, while the run is still ending."""


@dataclass(frozen=True)
class Instant:
    """A place on the octagon.

    Attributes:
        side: its corners.
        tau_s: plan time since the first of them.
        soon: whether the cause is removed while the run is still ending.
    """

    side: str
    tau_s: float
    soon: bool

    def __str__(self) -> str:
        return f"{self.side} {self.tau_s:.2f} s"


INSTANTS = (
    Instant("BC", 0.25, False),
    Instant("DE", 1.58, True),
    Instant("DE", 2.04, False),
    Instant("EF", 0.20, True),
    Instant("EF", 0.56, False),
    Instant("GH", 1.80, True),
)
"""In the middle of blocks, where they are fastest; EF 0.56 s is in a block's ramp up."""


@cache
def plan_from(corner: str) -> Plan:
    """The octagon's plan from one of its corners on."""
    file = yaml.safe_load(OCTAGON.read_text())
    ring = "ABCDEFGHA"
    others = ring[ring.index(corner) + 1 :]
    file["moves"] = [{"ptp": corner}, *({"lin": other} for other in others)]
    return plan_of(yaml.safe_dump(file))


Act = Callable[[Rig], object]


@dataclass(frozen=True)
class Case:
    """What stops the arm, and what the run says of it.

    Attributes:
        act: does it.
        mend: removes the cause and starts the program, as an operator would.
        cause, remedy: the run's words; the remedy while the cause is there.
        refusal: how the next run ends while the cause is there; empty: it can begin.
        limit_s: how soon the arm must stand.
        board: what stands before the servos.
    """

    act: Act
    mend: Act
    cause: str
    remedy: str
    refusal: str
    limit_s: float = STAND_S
    board: BoardKind = "none"


def kill(rig: Rig) -> None:
    """No byte leaves the process any more, and its kernel closes what it had open."""
    for wire in (rig.kvp, rig.bus):
        wire.refused = wire.deaf = True
        wire.cut()


def fresh_links(rig: Rig) -> None:
    """What the next process opens; the dead one's links stay dead."""
    rig.kvp = Wire(rig.emulated.kvp.attach)
    rig.bus = Wire(lambda end: rig.emulated.attach_wrist(end, 1_000_000))


def cut_tcp(rig: Rig) -> None:
    """The connection is closed, and none can be opened."""
    rig.kvp.refused = True
    rig.kvp.cut()


def pull_cable(rig: Rig) -> None:
    """Nothing arrives any more, and nobody is told."""
    rig.kvp.deaf = True


def give_tcp(rig: Rig) -> None:
    """The network is back."""
    rig.kvp.refused = rig.kvp.deaf = False


Hand = Callable[[EmulatedCell], object]

HANDS: dict[Act, Hand] = {}
"""What is done at the cell itself, by what does it to a rig."""


def by(hand: Hand) -> Act:
    """What is done at the cell itself, as an act on a rig."""

    def act(rig: Rig) -> None:
        hand(rig.emulated)

    HANDS[act] = hand
    return act


def key(state: str) -> Hand:
    """The key that leads to a program state."""

    def press(cell: EmulatedCell) -> None:
        cell.world.advance()
        cell.controller.panel.program_state = state

    return press


def deselect(cell: EmulatedCell) -> None:
    """Stop, and deselect."""
    key("P_STOP")(cell)
    key("P_FREE")(cell)


def select(cell: EmulatedCell) -> None:
    """Select the program again and start it."""
    cell.world.advance()
    cell.controller.krc.select("SPH_RUN")
    release(cell)


def switch_drives_off(cell: EmulatedCell) -> None:
    """The drives, and only they."""
    cell.world.advance()
    cell.controller.panel.drives = False


def emergency_stop(cell: EmulatedCell) -> None:
    """The button on the pendant."""
    cell.controller.emergency_stop()


def release(cell: EmulatedCell) -> None:
    """Release, acknowledge, drives on, start."""
    cell.controller.release()


def pull_wrist_ok(cell: EmulatedCell) -> None:
    """The wire breaks."""
    assert cell.wiring is not None
    cell.wiring.cut_wrist_ok()


def give_wrist_ok(cell: EmulatedCell) -> None:
    """The wire is bridged for a second; then it is whole again, which is off as the board is."""
    wiring, lines = cell.wiring, cell.controller.lines
    assert wiring is not None
    assert lines is not None
    cell.world.advance()
    wiring.cut, lines.wrist_ok = False, True
    asyncio.get_running_loop().call_later(1.0, setattr, lines, "wrist_ok", False)


CLOSED = "controller: the connection was closed by the other side"
DEAF = r"controller: no answer to a request for SPH_\w+ within 0.8 s"
LOOK = "look at the robot, mend the connection, see what `sphmctl doctor` says, run again"
START = "start SPH_RUN and let it reach its first point (BCO)"
RELEASE = (
    "release the emergency stop and close the gate, then switch the drives on, then acknowledge "
    f"the messages on the pendant, then {START}"
)
NO_WRIST = "the controller has no wrist ok, though the board gives it: look at the line"
SEE_TO = "see to what the fault names"

CASES = {
    "run killed": Case(kill, fresh_links, "", "", "", STAND_S + LATE_S),
    "TCP link cut": Case(
        cut_tcp, give_tcp, CLOSED, LOOK, "nothing listens there", STAND_S + LATE_S
    ),
    "TCP link silent": Case(
        pull_cable, give_tcp, DEAF, LOOK, "controller: no answer to a request", STAND_S + LATE_S
    ),
    "program deselected": Case(
        by(deselect),
        by(select),
        "the controller stopped the program",
        f"select SPH_RUN on the controller, then {START}, then run again",
        f"controller: program: none selected; select SPH_RUN on the controller, then {START}",
    ),
    "stop key": Case(
        by(key("P_STOP")),
        by(release),
        "the controller stopped the program",
        f"{START}, then run again",
        f"controller: program state: #P_STOP; {START}",
    ),
    "drives off": Case(
        by(switch_drives_off),
        by(release),
        "the controller's drives are off",
        f"switch the drives on, then {START}, then run again",
        f"controller: drives: off; switch the drives on, then {START}",
    ),
    "wrist ok pulled": Case(
        by(pull_wrist_ok),
        by(give_wrist_ok),
        NO_WRIST,
        f"{SEE_TO}, then run again",
        NO_WRIST,
        board="simulated",
    ),
    "emergency stop": Case(
        by(emergency_stop),
        by(release),
        "the controller reports an emergency stop or an open gate",
        f"{RELEASE}, then run again",
        f"controller: safety chain: open; {RELEASE}",
    ),
}


@dataclass
class Stopped:
    """What happened.

    Attributes:
        rows: time since the event (s) and the six true axes (deg), until the next run.
        mended_s: when the cause was removed, since the event.
        told: cause and remedy of the run; empty for a killed one.
        refused: how the next run ended before the cause was removed; None if not tried.
        again: how the next run ended after it.
    """

    rows: Floats
    mended_s: float
    told: tuple[str, str]
    refused: str | None
    again: str

    @property
    def stands_s(self) -> float:
        """When the last motion before the mending is over, however late it comes."""
        return stands_s(self.rows[self.rows[:, 0] <= self.mended_s])

    @property
    def moved_late_deg(self) -> float:
        """How far an axis went since the cause was removed."""
        late = self.rows[self.rows[:, 0] >= self.mended_s - ROW_S, 1:]
        return float(np.abs(late - late[0]).max())


def stands_s(rows: Floats) -> float:
    """When the last step is over."""
    moved = np.abs(np.diff(rows[:, 1:], axis=0)).max(axis=1) >= STILL_DEG
    return float(rows[np.flatnonzero(moved)[-1] + 1, 0])


def true_rows(rig: Rig, event_s: float) -> Floats:
    """The truth from just before the event until now."""
    rows = np.array(rig.emulated.truth(event_s - 3.0 * ROW_S, rig.loop.time()))[:, :7]
    rows[:, 0] += rig.emulated.world.start_s - event_s
    return rows


def on_the_side(
    instant: Instant, board: BoardKind = "none", motion: MotionOptions | None = None
) -> Rig:
    """A cell that stands at the first corner of a side."""
    start = np.degrees(plan_from(instant.side[0]).joints[0]).tolist()
    setup = Setup(arm_deg=tuple(start[:6]), cranks_deg=tuple(start[6:]))
    options = None if motion is None else Options(start_deg=setup.arm_deg, motion=motion)
    return Rig(1, setup, options, board)


async def next_run(rig: Rig, plan: Plan) -> str:
    """Run again until it is on its way to the start; empty, or how it ended otherwise."""
    rig.anew()

    async def stop_on_the_way() -> None:
        await rig.until_event("approach")
        begin = rig.emulated.true_joints_deg()
        await rig.until(lambda: abs(rig.emulated.true_joints_deg()[0] - begin[0]) > 0.05)
        rig.stop.set()

    stopping = asyncio.ensure_future(stop_on_the_way())
    try:
        outcome = await rig.play(plan)
    except SphmctlError as error:
        return str(error)
    finally:
        stopping.cancel()
        await rig.session.close()
    return "" if outcome.outcome == "stopped" else outcome.cause


async def stop_case(case: Case, instant: Instant, motion: MotionOptions | None = None) -> Stopped:
    """Drive, let it happen, watch, remove the cause, watch, and run again."""
    plan, rig = plan_from(instant.side[0]), on_the_side(instant, case.board, motion)
    try:
        task = asyncio.create_task(rig.play(plan))
        await rig.until_tau(instant.tau_s)
        event_s = rig.loop.time()
        case.act(rig)
        if case.act is kill:
            task.cancel()
        refused = None
        if instant.soon:
            await asyncio.sleep(SOON_S)
        else:
            await asyncio.wait([task])
            await asyncio.sleep(WATCHED_S)
            if case.refusal:
                await rig.session.close()
                refused = await next_run(rig, plan)
        mended_s = rig.loop.time() - event_s
        case.mend(rig)
        await asyncio.wait([task])
        await asyncio.sleep(WATCHED_S)
        rows = true_rows(rig, event_s)
        told = ("", "")
        if not task.cancelled():
            told = task.result().cause, task.result().remedy
            await rig.session.close()
        return Stopped(rows, mended_s, told, refused, await next_run(rig, plan))
    finally:
        await rig.close()


def off_path_deg(rows: Floats, plan: Plan) -> float:
    """How far an axis is from the nearest sample of the plan, at most."""
    path = np.degrees(plan.joints[:, :6])
    return max(float(np.abs(path - row).max(axis=1).min()) for row in rows[::5, 1:])
