"""The controller's system variables, and the panel: what safety, drives and operator have set.

Not responsible for how any of it changes. Names and types: OpenKuka/Website
docs/krl/reference/yaml/System.Variables.yml; signal meanings: status.src of
kroshu/kuka-external-control-sdk (`$ALARM_STOP` and `$USER_SAF` are TRUE when all is well).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from sphmctl.emulators.arm import MAX_SPEED_DEG_S, Arm, Joints
from sphmctl.emulators.flange import flange_pose, status_and_turn
from sphmctl.emulators.krl_text import Array, Bool, Enum, Int, Real, Struct, Text, Type, Value
from sphmctl.emulators.variables import Store

AXES = 12
"""KSS counts six robot axes and six external ones."""

EXTERNAL = ("E1", "E2", "E3", "E4", "E5", "E6")

VELOCITY_STEP_S = 1e-3
"""Over this time the tool point's speed is taken; any value far below a block's duration does."""

MOTOR_TEMPERATURE_K = 310
"""A motor of an arm that has been on for a while; load and warming are not modelled."""


def _reals(*names: str) -> tuple[tuple[str, Type], ...]:
    return tuple((name, Real()) for name in names)


E6AXIS = Struct("E6AXIS", _reals("A1", "A2", "A3", "A4", "A5", "A6", *EXTERNAL))
E6POS = Struct(
    "E6POS", (*_reals("X", "Y", "Z", "A", "B", "C"), ("S", Int()), ("T", Int()), *_reals(*EXTERNAL))
)
FRAME = Struct("FRAME", _reals("X", "Y", "Z", "A", "B", "C"))
MODE_OP = Enum("MODE_OP", ("T1", "T2", "AUT", "EX", "INVALID"))
PRO_STATE = Enum("PRO_STATE", ("P_FREE", "P_RESET", "P_ACTIVE", "P_STOP", "P_END"))
PRO_MODE = Enum("PRO_MODE", ("ISTEP", "PSTEP", "MSTEP", "CSTEP", "GO", "BSTEP"))
SWITCH = Enum("SWITCH_STATE", ("RELEASED", "PRESSED"))


@dataclass
class Panel:
    """The controller's state outside the program, names as the system variables.

    Attributes:
        mode: member of MODE_OP.
        program_state: member of PRO_STATE, of the robot interpreter.
        submit_state: the same of the submit interpreter.
        drives: `$PERI_RDY`.
    """

    model_name: str
    robot_name: str
    serial_number: int
    program: str
    program_state: str = "P_ACTIVE"
    submit_state: str = "P_ACTIVE"
    mode: str = "EX"
    alarm_stop: bool = True
    user_saf: bool = True
    stop_message: bool = False
    drives: bool = True


def axis_value(joints_deg: Joints) -> dict[str, Value]:
    """An E6AXIS of the six axes."""
    value: dict[str, Value] = {f"A{axis}": angle for axis, angle in enumerate(joints_deg, start=1)}
    value.update(dict.fromkeys(EXTERNAL, 0.0))
    return value


def declare_system_variables(
    store: Store,
    panel: Panel,
    arm: Arm,
    timer_ms: Callable[[], int],
    measuring_error_deg: Joints,
) -> None:
    """Declare everything that a controller without our program has."""
    _declare_motion(store, arm, measuring_error_deg)
    _declare_states(store, panel, arm)
    _declare_settings(store, panel)
    store.declare("$ROB_TIMER", Int(), source=timer_ms)


def _declare_motion(store: Store, arm: Arm, measuring_error_deg: Joints) -> None:
    def axis_or_nothing(joints_deg: Joints | None) -> Value:
        return None if joints_deg is None else axis_value(joints_deg)

    def measured() -> Value:
        pairs = zip(arm.joints_deg, measuring_error_deg, strict=True)
        return axis_value(tuple(q + error for q, error in pairs))

    def axis_speeds() -> Value:
        pairs = zip(arm.speed_deg_s, MAX_SPEED_DEG_S, strict=True)
        return [*(100.0 * speed / limit for speed, limit in pairs), *[0.0] * 6]

    live: tuple[tuple[str, Type, Callable[[], Value]], ...] = (
        ("$AXIS_ACT", E6AXIS, lambda: axis_value(arm.joints_deg)),
        ("$AXIS_ACT_MEAS", E6AXIS, measured),
        ("$AXIS_FOR", E6AXIS, lambda: axis_or_nothing(arm.target_deg)),
        ("$AXIS_BACK", E6AXIS, lambda: axis_or_nothing(arm.back_deg)),
        ("$POS_ACT", E6POS, lambda: _pose_value(arm.joints_deg)),
        ("$VEL_AXIS_ACT", Array(Real(), AXES), axis_speeds),
        ("$VEL_ACT", Real(), lambda: _tool_speed_m_s(arm)),
    )
    for name, kind, source in live:
        store.declare(name, kind, source=source)


def _declare_states(store: Store, panel: Panel, arm: Arm) -> None:
    def active() -> bool:
        return panel.program_state == "P_ACTIVE" or arm.moving

    def ready() -> bool:
        return panel.drives and panel.alarm_stop and panel.user_saf and not panel.stop_message

    signals: dict[str, Callable[[], Value]] = {
        "$T1": lambda: panel.mode == "T1",
        "$T2": lambda: panel.mode == "T2",
        "$AUT": lambda: panel.mode == "AUT",
        "$EXT": lambda: panel.mode == "EX",
        "$PRO_ACT": active,
        "$PRO_MOVE": lambda: arm.moving,
        "$ROB_STOPPED": lambda: not arm.moving,
        "$STOPMESS": lambda: panel.stop_message,
        "$USER_SAF": lambda: panel.user_saf,
        "$PERI_RDY": lambda: panel.drives,
        "$ALARM_STOP": lambda: panel.alarm_stop,
        "$ALARM_STOP_INTERN": lambda: panel.alarm_stop,
        "$COULD_START_MOTION": ready,
    }
    for name, source in signals.items():
        store.declare(name, Bool(), source=source)
    store.declare("$MODE_OP", MODE_OP, source=lambda: panel.mode)
    store.declare("$PRO_STATE1", PRO_STATE, source=lambda: panel.program_state)
    store.declare("$PRO_STATE0", PRO_STATE, source=lambda: panel.submit_state)
    store.declare("$PRO_STATE", PRO_STATE, source=lambda: panel.program_state)
    store.declare("$PRO_NAME1", Text(24), source=lambda: panel.program)
    brakes_open = (1 << 6) - 1
    store.declare("$BRAKE_SIG", Int(), source=lambda: brakes_open if panel.drives else 0)
    externals_on = {"$ON_PATH": True, "$POWER_FAIL": False, "$IN_HOME": False}
    for name, value in externals_on.items():
        store.declare(name, Bool(), value)
    # Of the external automatic inputs the levels are held, the pulses low.
    levels = {"$MOVE_ENABLE": True, "$DRIVES_OFF": True, "$I_O_ACT": True}
    pulses = {"$DRIVES_ON": False, "$EXT_START": False, "$CONF_MESS": False}
    for name, value in (levels | pulses).items():
        store.declare(name, Bool(), value)


def _declare_settings(store: Store, panel: Panel) -> None:
    percent = Int(0, 100)
    store.declare("$OV_PRO", percent, 100, writable=True)
    store.declare("$OV_JOG", percent, 10, writable=True)
    store.declare("$PRO_MODE1", PRO_MODE, "GO")
    store.declare("$SAFETY_SW", SWITCH, "RELEASED")
    store.declare("$ADVANCE", Int(0, 5), 3)
    store.declare("$KR_SERIALNO", Int(), panel.serial_number)
    store.declare("$MODEL_NAME", Text(32), panel.model_name)
    store.declare("$ROBNAME", Text(24), panel.robot_name)
    store.declare("$ACT_TOOL", Int(), 0)
    store.declare("$ACT_BASE", Int(), 0)
    for name in ("$TOOL", "$BASE"):
        store.declare(name, FRAME, dict.fromkeys(("X", "Y", "Z", "A", "B", "C"), 0.0))
    store.declare("$MOT_TEMP", Array(Int(), AXES), [MOTOR_TEMPERATURE_K] * AXES)
    for name in ("$CURR_ACT", "$TORQUE_AXIS_ACT"):
        store.declare(name, Array(Real(), AXES), [0.0] * AXES)
    for name, size, writable in (("$IN", 4096, False), ("$OUT", 4096, True), ("$FLAG", 1024, True)):
        store.declare(name, Array(Bool(), size), [False] * size, writable=writable)


def _pose_value(joints_deg: Joints) -> Value:
    status, turn = status_and_turn(joints_deg)
    value: dict[str, Value] = dict(zip("XYZABC", flange_pose(joints_deg), strict=True))
    return value | {"S": status, "T": turn} | dict.fromkeys(EXTERNAL, 0.0)


def _tool_speed_m_s(arm: Arm) -> float:
    if not any(arm.speed_deg_s):
        return 0.0
    ahead = tuple(
        q + speed * VELOCITY_STEP_S
        for q, speed in zip(arm.joints_deg, arm.speed_deg_s, strict=True)
    )
    moved_mm = math.dist(flange_pose(arm.joints_deg)[:3], flange_pose(ahead)[:3])
    return moved_mm / 1000.0 / VELOCITY_STEP_S
