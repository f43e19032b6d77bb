"""Each cause that ends a motion: it triggers, and it alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.daemon.watch import (
    CRANK_ERROR_CYCLES,
    MEASURED_TOLERANCE_RAD,
    NO_OK_S,
    OFF_PLAN_RAD,
    STALL_S,
    Watch,
)
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers import xl430
from sphmctl.drivers.board import BoardState
from sphmctl.drivers.kuka import ArmState
from sphmctl.drivers.wrist import ServoState, WristState
from sphmctl.wire import board_table as table

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0])
CRANKS = np.radians([60.0, 60.0, 60.0])

GOOD = ArmState(
    version=krc.VERSION,
    check=krc.CHECK,
    session=5,
    status=krc.Status.RUNNING,
    fault=krc.Fault.NONE,
    wrist=krc.Wrist.NONE,
    taken=3,
    passed=1,
    override_percent=100,
    moving=True,
    stopped=False,
    drives=True,
    safe=True,
    stop_message=False,
    mode="EX",
    joints=HOME,
    at_s=1000.0,
)


def _watch() -> Watch:
    return Watch(emulated_cell().ranges_rad, 5, "EX")


def _servo(crank_deg: float = 60.0, **telemetry: int) -> ServoState:
    block = xl430.Telemetry(1, 0, 10, 0, 1, 5, 0, 2048, 120, 35)
    return ServoState(
        math.radians(crank_deg), 0.0, False, 0, dataclasses.replace(block, **telemetry)
    )


def _wrist(*servos: ServoState | None, after_s: float = 0.0) -> WristState:
    return WristState(servos, 1000.0 + after_s)


def test_an_arm_and_a_wrist_in_order_raise_nothing() -> None:
    watch = _watch()
    for status in (krc.Status.READY, krc.Status.RUNNING, krc.Status.HOLDING, krc.Status.ENDED):
        assert watch.arm(dataclasses.replace(GOOD, status=status), 0.01) is None
    for _ in range(100):
        assert watch.wrist(_wrist(_servo(), _servo(), _servo()), CRANKS) is None


FAULT = {"status": krc.Status.FAULT}
SUBMIT = "the controller's submit interpreter stopped, or is too slow"
CAUSES: list[tuple[dict[str, Any], str]] = [
    ({"session": 6}, "another client has taken the arm's session"),
    ({**FAULT, "fault": krc.Fault.BEAT}, "the controller heard no heartbeat for a second"),
    (
        {**FAULT, "fault": krc.Fault.SEQUENCE},
        "the controller found a knot with a wrong sequence number",
    ),
    ({**FAULT, "fault": krc.Fault.KNOT}, "the controller refused a knot's speed or axes"),
    ({**FAULT, "fault": krc.Fault.SUBMIT}, SUBMIT),
    ({**FAULT, "fault": krc.Fault.NONE}, "the KRL program reports a fault"),
    ({"safe": False}, "the controller reports an emergency stop or an open gate"),
    ({"drives": False}, "the controller's drives are off"),
    ({"stop_message": True}, "the controller shows a stop message"),
    ({"mode": "T1"}, "the operating mode changed from EX to T1"),
    ({"status": krc.Status.STOPPED}, "the arm was stopped by another client"),
]


@pytest.mark.parametrize(("change", "sentence"), CAUSES)
def test_each_state_of_the_controller_that_ends_a_motion_has_its_sentence(
    change: dict[str, Any], sentence: str
) -> None:
    assert _watch().arm(dataclasses.replace(GOOD, **change), 0.0) == sentence


def test_a_stop_by_the_controller_is_told_by_what_caused_it() -> None:
    fault = dataclasses.replace(
        GOOD, status=krc.Status.FAULT, fault=krc.Fault.CONTROLLER, stop_message=True
    )
    for change, words in (
        ({"safe": False}, "emergency stop"),
        ({"mode": "T1"}, "operating mode"),
        ({"drives": False}, "drives are off"),
        ({}, "stop message"),
    ):
        assert words in str(_watch().arm(dataclasses.replace(fault, **change), 0.0))


def test_a_stop_without_a_reason_waits_some_cycles_for_one() -> None:
    watch = _watch()
    stopped = dataclasses.replace(GOOD, status=krc.Status.FAULT, fault=krc.Fault.CONTROLLER)
    cycles = [dataclasses.replace(stopped, at_s=1000.0 + 0.012 * cycle) for cycle in range(6)]
    told = [watch.arm(state, 0.0) for state in cycles]
    assert told == [None] * 3 + ["the controller stopped the program"] * 3


def test_an_arm_off_its_plan_ends_the_motion_just_beyond_the_limit() -> None:
    watch = _watch()
    assert watch.arm(GOOD, OFF_PLAN_RAD * 0.999) is None
    told = watch.arm(GOOD, OFF_PLAN_RAD * 1.01)
    assert told == "the arm is 1.01 degrees off the plan, more than 1"


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("end", [0, 1])
def test_each_axis_beyond_its_range_ends_the_motion(axis: int, end: int) -> None:
    ranges = emulated_cell().ranges_rad
    sign = 2 * end - 1
    for excess, ends in ((0.9, False), (1.1, True)):
        joints = HOME.copy()
        joints[axis] = ranges[axis, end] + sign * excess * MEASURED_TOLERANCE_RAD
        told = _watch().arm(dataclasses.replace(GOOD, joints=joints), 0.0)
        assert (told is not None) is ends
        if told:
            assert told.startswith(f"A{axis + 1} is at ")


@pytest.mark.parametrize("leg", range(3))
def test_a_crank_beyond_its_range_ends_the_motion_by_name(leg: int) -> None:
    servos = [_servo(), _servo(), _servo()]
    servos[leg] = _servo(120.2)
    told = _watch().wrist(_wrist(*servos), np.radians([120.0] * 3))
    assert told == f"theta{leg + 7} is at 120.20 degrees, outside 0 to 120"


@pytest.mark.parametrize("leg", range(3))
def test_a_servo_may_be_silent_for_a_while_but_not_longer(leg: int) -> None:
    watch = _watch()
    servos: list[ServoState | None] = [_servo(), _servo(), _servo()]
    silent = list(servos)
    silent[leg] = None
    assert watch.wrist(_wrist(*servos), CRANKS) is None
    for _ in range(3):
        for after_s in (0.03, 0.06, 0.099):
            assert watch.wrist(_wrist(*silent, after_s=after_s), CRANKS) is None
        assert watch.wrist(_wrist(*servos), CRANKS) is None
    told = [watch.wrist(_wrist(*silent, after_s=t), CRANKS) for t in (0.03, 0.06, 0.101)]
    assert told == [None, None, f"servo of leg {leg + 1} was silent for 100 ms"]


def test_after_a_stall_of_the_host_one_lost_reply_is_no_silence() -> None:
    watch = _watch()
    assert watch.wrist(_wrist(_servo(), _servo(), _servo()), CRANKS) is None
    for after_s in (0.5, 0.53):
        silent = _wrist(_servo(), None, _servo(), after_s=after_s)
        assert watch.wrist(silent, CRANKS) is None
    assert watch.wrist(_wrist(_servo(), _servo(), _servo(), after_s=0.56), CRANKS) is None


def test_a_servo_that_never_answered_is_told_too() -> None:
    watch = _watch()
    silent = (None, _servo(), _servo())
    told = [watch.wrist(_wrist(*silent, after_s=t), CRANKS) for t in (0.0, 0.03, 0.101)]
    assert told == [None, None, "servo of leg 1 was silent for 100 ms"]


def test_of_silent_servos_the_first_on_the_bus_is_named() -> None:
    watch = _watch()
    states = [_wrist(_servo(), None, None, after_s=t) for t in (0.0, 0.03, 0.101)]
    told = [watch.wrist(state, CRANKS) for state in states]
    assert told == [None, None, "servo of leg 2 was silent for 100 ms"]


SERVO_CAUSES: list[tuple[dict[str, int], str]] = [
    ({"hardware_error": 0x20}, "servo of leg 2 reports a hardware error: overload"),
    ({"watchdog": -1}, "servo of leg 2 stopped by its bus watchdog"),
    ({"torque": 0}, "servo of leg 2 has lost its torque (power cut, or another client)"),
]


@pytest.mark.parametrize(("change", "sentence"), SERVO_CAUSES)
def test_each_state_of_a_servo_that_ends_a_motion_has_its_sentence(
    change: dict[str, int], sentence: str
) -> None:
    told = _watch().wrist(_wrist(_servo(), _servo(**change), _servo()), CRANKS)
    assert told == sentence


def test_a_crank_away_from_its_place_must_be_so_for_a_while() -> None:
    watch = _watch()
    away = _wrist(_servo(), _servo(), _servo(66.0))
    home = _wrist(_servo(), _servo(), _servo(64.0))
    for _ in range(CRANK_ERROR_CYCLES - 1):
        assert watch.wrist(away, CRANKS) is None
    assert watch.wrist(home, CRANKS) is None
    told = [watch.wrist(away, CRANKS) for _ in range(CRANK_ERROR_CYCLES)]
    assert told[:-1] == [None] * (CRANK_ERROR_CYCLES - 1)
    assert told[-1] == "servo of leg 3 is 6.0 degrees from where the arm needs it"


def test_no_progress_ends_the_motion_only_where_progress_is_due() -> None:
    watch = _watch()
    assert watch.progress(1.0, 1000.0, True) is None
    assert watch.progress(1.0, 1000.0 + STALL_S, True) is None
    told = watch.progress(1.0, 1000.1 + STALL_S, True)
    assert told == "the arm has made no progress for 3 s"
    # Override zero: no progress is due, and the time counts from its end.
    assert watch.progress(1.0, 1010.0, False) is None
    assert watch.progress(1.0, 1012.9, True) is None
    assert watch.progress(1.0, 1013.1, True) is not None


def test_slow_progress_is_progress() -> None:
    watch = _watch()
    for step in range(100):
        assert watch.progress(1.0 + 0.001 * step, 1000.0 + 2.0 * step, True) is None


def test_going_backwards_is_no_progress() -> None:
    watch = _watch()
    told: list[str | None] = []
    note: Callable[[str | None], None] = told.append
    for step in range(50):
        note(watch.progress(1.0 + 0.01 * (step % 2), 1000.0 + 0.1 * step, True))
    assert told[10] is None
    assert told[-1] is not None


def _board(hindrances: int = 0, alert_id: int = 255) -> BoardState:
    return BoardState(hindrances, alert_id, 0, 0, (), {})


@pytest.mark.parametrize(
    ("hindrances", "words"),
    [
        (table.HINDRANCES_STOP | table.HINDRANCES_NOT_ARMED, "emergency stop at the board was"),
        (table.HINDRANCES_NOT_ARMED | table.HINDRANCES_SAFE_STATE, "no longer armed: it was reset"),
        (table.HINDRANCES_SAFE_STATE | table.HINDRANCES_NOT_ASKED, "heard nothing for 500 ms"),
        (table.HINDRANCES_SERVO | table.HINDRANCES_NOT_ASKED, "servo 2 report a hardware error"),
        (table.HINDRANCES_NO_WATCHDOG, "took wrist ok away: no watchdog"),
    ],
)
def test_a_board_that_took_wrist_ok_away_is_the_cause(hindrances: int, words: str) -> None:
    state = dataclasses.replace(_wrist(_servo(), _servo(), _servo()), board=_board(hindrances, 2))
    cause = _watch().wrist(state, CRANKS)
    assert cause is not None
    assert words in cause


def test_a_board_that_gives_wrist_ok_is_no_cause() -> None:
    state = dataclasses.replace(_wrist(_servo(), _servo(), _servo()), board=_board())
    assert _watch().wrist(state, CRANKS) is None


def test_a_board_silent_twice_is_named_before_its_servos() -> None:
    watch = _watch()
    for misses, cause in ((0, None), (1, None), (2, "the board was silent twice in a row")):
        state = dataclasses.replace(_wrist(None, None, None), board_misses=misses)
        assert watch.wrist(state, CRANKS) == cause


@pytest.mark.parametrize(
    "seen",
    [
        dataclasses.replace(GOOD, wrist=krc.Wrist.OFF),
        dataclasses.replace(GOOD, status=krc.Status.FAULT, fault=krc.Fault.WRIST),
    ],
)
def test_a_line_without_wrist_ok_is_the_cause_only_when_the_board_had_time_to_tell(
    seen: ArmState,
) -> None:
    watch = _watch()
    for late_s, words in ((0.0, None), (NO_OK_S, None), (NO_OK_S + 0.012, "no wrist ok")):
        state = dataclasses.replace(seen, at_s=GOOD.at_s + late_s)
        cause = watch.arm(state, 0.0)
        assert (cause is None) if words is None else (words in str(cause))
