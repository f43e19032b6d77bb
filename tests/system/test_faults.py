"""What happens to whole runs when something fails: outcome, cause, standstill, torque, silence.

Distances are of the true joints, between the instant at which the run learnt of it and standstill.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from tests.system.rig import (
    SIDES,
    STILL_DEG,
    Rig,
    at,
    crank_errors_deg,
    ends_in_peace,
    run,
)

ON_SIDE_S = 0.4
"""Plan time at which most faults happen: the first side, at its full 29 degrees a second of A1."""


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong in the middle of a side, and how the run must end.

    Attributes:
        cause: what the outcome's cause must match.
        arm_deg: how far an axis may still go once the run has learnt of it.
        reaction_s: how long the run may take to learn of it.
        unconfirmed: what each sentence of doubt must match, in order.
        torques: Torque Enable of the servos at the end.
    """

    act: Callable[[Rig], object]
    cause: str
    arm_deg: float = 2.5
    reaction_s: float = 0.03
    unconfirmed: tuple[str, ...] = ()
    torques: tuple[int, int, int] = (0, 0, 0)


def _vanish(rig: Rig) -> None:
    rig.kvp.refused = True
    rig.kvp.cut()


def _power_cycle(rig: Rig) -> None:
    for servo in rig.emulated.servos:
        servo.unplug()
        servo.plug()


def _everything(rig: Rig) -> None:
    _vanish(rig)
    rig.bus.cut()


NO_STANDSTILL = "could not be seen to stand; its program brakes by itself"
NOT_IDLE = "was not told to be idle"
WRIST_UNSEEN = "the wrist could not be seen to stand"
OFF_UNSEEN = tuple(f"servo {leg}: torque off was not confirmed" for leg in (1, 2, 3))

FAULTS: dict[str, Fault] = {
    "emergency stop": Fault(
        lambda rig: rig.emulated.controller.emergency_stop(), "emergency stop or an open gate"
    ),
    "gate": Fault(
        lambda rig: rig.emulated.controller.open_gate(), "emergency stop or an open gate"
    ),
    "mode": Fault(lambda rig: rig.emulated.controller.set_mode("T1"), "mode changed from EX to T1"),
    "drives": Fault(
        lambda rig: setattr(rig.emulated.controller.panel, "drives", False),
        "drives are off",
        reaction_s=0.06,
    ),
    "first servo unplugged": Fault(
        lambda rig: rig.emulated.servos[0].unplug(),
        "servo of leg 1 was silent for 100 ms",
        reaction_s=0.16,
        unconfirmed=(WRIST_UNSEEN, OFF_UNSEEN[0]),
    ),
    "last servo unplugged": Fault(
        lambda rig: rig.emulated.servos[2].unplug(),
        "servo of leg 3 was silent for 100 ms",
        reaction_s=0.16,
        unconfirmed=(WRIST_UNSEEN, OFF_UNSEEN[2]),
    ),
    "hardware error": Fault(
        lambda rig: rig.emulated.servos[1].raise_error(5),
        "leg 2 reports a hardware error: overload",
    ),
    "low voltage": Fault(
        lambda rig: rig.emulated.servos[1].set_voltage(5.0),
        "leg 2 reports a hardware error: input voltage",
        reaction_s=0.13,
    ),
    "pushed away": Fault(
        lambda rig: rig.emulated.servos[1].push(0.9),
        r"leg 2 is \d+\.\d degrees from where the arm needs it",
        reaction_s=0.2,
    ),
    "power cut and back": Fault(
        _power_cycle, "servo of leg 1 was silent for 100 ms", reaction_s=0.16
    ),
    "torque off by another client": Fault(
        lambda rig: rig.emulated.servos[1].write(64, b"\0"), "leg 2 has lost its torque"
    ),
    "connection lost": Fault(lambda rig: rig.kvp.cut(), "closed by the other side"),
    "controller gone": Fault(
        _vanish,
        "closed by the other side",
        arm_deg=6.0,
        unconfirmed=(NO_STANDSTILL, NOT_IDLE),
    ),
    "controller deaf": Fault(
        lambda rig: setattr(rig.kvp, "deaf", True),
        r"no answer to a request for SPH_\w+ within 0.8 s",
        arm_deg=STILL_DEG,
        reaction_s=0.85,
        unconfirmed=(NO_STANDSTILL, NOT_IDLE),
    ),
    "serial port lost": Fault(
        lambda rig: rig.bus.cut(),
        "the port (is|was) lost",
        unconfirmed=(WRIST_UNSEEN, *OFF_UNSEEN),
        torques=(1, 1, 1),
    ),
    "servos deaf": Fault(
        lambda rig: setattr(rig.bus, "deaf", True),
        "servo of leg 1 was silent for 100 ms",
        reaction_s=0.16,
        unconfirmed=(WRIST_UNSEEN, *OFF_UNSEEN),
        torques=(1, 1, 1),
    ),
    "everything gone": Fault(
        _everything,
        "closed by the other side|the port (is|was) lost",
        arm_deg=6.0,
        unconfirmed=(NO_STANDSTILL, *OFF_UNSEEN, NOT_IDLE),
        torques=(1, 1, 1),
    ),
    "stopped by another client": Fault(
        lambda rig: rig.write("SPH_CMD", "3"), "stopped by another client", reaction_s=0.2
    ),
    "held by another client": Fault(
        lambda rig: rig.write("SPH_CMD", "2"), "no progress for 3 s", reaction_s=3.2
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_on_a_side_ends_the_run_with_its_cause_and_both_halves_standing(name: str) -> None:
    fault = FAULTS[name]
    ended = run(at(ON_SIDE_S, fault.act))
    outcome = ended.outcome
    assert outcome.outcome == "faulted"
    assert re.search(fault.cause, outcome.cause), outcome.cause
    assert len(outcome.unconfirmed) == len(fault.unconfirmed), outcome.unconfirmed
    for told, wanted in zip(outcome.unconfirmed, fault.unconfirmed, strict=True):
        assert re.search(wanted, told), told
    assert ended.decided_s - ended.rig.acted_s <= fault.reaction_s
    assert ended.moved_deg(ended.decided_s)[:6].max() <= fault.arm_deg
    assert tuple(ended.torques) == fault.torques
    ends_in_peace(ended)


def test_the_cranks_follow_a_braking_arm_to_where_it_stands() -> None:
    for name in ("emergency stop", "drives", "connection lost"):
        ended = run(at(ON_SIDE_S, FAULTS[name].act))
        assert crank_errors_deg(ended, SIDES).max() < 0.5, name
    # Nobody hears where the arm goes: the cranks are told no more than what is known.
    ended = run(at(ON_SIDE_S, _vanish))
    assert crank_errors_deg(ended, SIDES).max() < 5.0


def test_goals_stay_the_same_from_standstill_on() -> None:
    ended = run(at(ON_SIDE_S, FAULTS["emergency stop"].act))
    start_s = ended.rig.emulated.world.start_s
    standing_s = start_s + next(t for t, e, _ in ended.rig.events.history if e == "standing")
    assert len(set(ended.goals_after(standing_s - 0.05))) == 1


def test_a_controller_that_is_busy_for_a_moment_holds_the_arm_and_the_run_completes() -> None:
    ended = run(at(ON_SIDE_S, lambda rig: rig.kvp.pause(0.4)))
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("completed", [])
    assert crank_errors_deg(ended, SIDES).max() < 0.2


def test_two_lost_wrist_cycles_are_forgiven() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.bus.deaf = True
        await asyncio.sleep(0.015)
        rig.bus.deaf = False

    assert run(script).outcome.outcome == "completed"


def test_another_client_takes_no_session_while_the_arm_is_driven() -> None:
    def take(rig: Rig) -> None:
        rig.write("SPH_SESSION", "77")

    ended = run(at(ON_SIDE_S, take))
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("completed", [])


def test_another_client_that_takes_the_session_at_the_end_ends_the_run() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(1.3)
        rig.write("SPH_SESSION", "77")
        await rig.until_driven()
        rig.write("SPH_CMD", "0")

    ended = run(script)
    assert ended.outcome.outcome == "faulted"
    assert ended.outcome.cause == "another client has taken the arm's session"
    assert ended.torques == [0, 0, 0]
    ends_in_peace(ended)


def _full(rig: Rig) -> None:
    rig.full_disk = True


def test_a_full_disk_stops_the_robot_and_is_told() -> None:
    ended = run(at(ON_SIDE_S, _full))
    assert ended.outcome.outcome == "faulted"
    assert "the record cannot be written: No space left on device" in ended.outcome.cause
    assert ended.outcome.unconfirmed == []
    assert ended.torques == [0, 0, 0]
    ends_in_peace(ended)


def test_a_mistake_in_the_wrist_loop_stops_the_arm_and_is_told() -> None:
    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.bus.broken = True
        await rig.until_event("wrist lost")
        rig.bus.broken = False

    ended = run(script)
    assert ended.outcome.outcome == "faulted"
    assert "the wrist's loop failed: RuntimeError" in ended.outcome.cause
    assert ended.moved_deg(ended.decided_s)[:6].max() < 2.5
    assert ended.torques == [0, 0, 0]
    ends_in_peace(ended)


def test_every_axis_of_a_run_stays_within_its_machine_limits() -> None:
    ended = run(at(ON_SIDE_S, FAULTS["emergency stop"].act))
    speed = np.abs(np.diff(ended.truth[:, 1:], axis=0) / np.diff(ended.truth[:, 0])[:, None])
    assert speed[:, :6].max() < 100.0
    assert speed[:, 6:].max() < 61.0 * 6.0
