"""System variables that are more than memory: what arm, panel, lines and programs say at a look.

Types stand in `krl/predefined.dat`. Machine data: KSS 8.3 archive of a KR 6 R900 (see
`motion.figures`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from typing import Any, Protocol

from sphmctl.emulators.interpreter.drive import Arm
from sphmctl.emulators.interpreter.functions import axes_value, joints_of, point_value
from sphmctl.emulators.interpreter.memory import Memory
from sphmctl.emulators.interpreter.operators import PLACE_PARTS, place_of
from sphmctl.emulators.interpreter.panel import Panel
from sphmctl.emulators.interpreter.signals import Terminals
from sphmctl.emulators.interpreter.values import Box, Live, is_set
from sphmctl.emulators.motion import figures
from sphmctl.emulators.motion.frames import NULL_FRAME
from sphmctl.emulators.motion.kinematics import tool_centre

AXES = 12
"""KSS counts six robot axes and six external ones."""

EXTERNAL_SPEED_STEP_S = 1e-3
"""Over this time the tool point's speed is taken; any value far below a block's duration does."""

MOTOR_TEMPERATURE_K = 310
"""A motor of an arm that has been on for a while; load and warming are not modelled."""

SWITCHED_ON = datetime(2026, 1, 1)
"""$DATE where $ROB_TIMER is 0; any will do, and the host's own would make no two runs alike."""

VELOCITIES = ("vel_cp_m_s", "vel_ori1_deg_s", "vel_ori2_deg_s")
ACCELERATIONS = ("acc_cp_m_s2", "acc_ori1_deg_s2", "acc_ori2_deg_s2")
"""Fields of `motion.PathSpeed`, in the order of KRL's CP."""

Joints = tuple[float, ...]


class Mover(Arm, Protocol):
    """What the variables say of the arm, beyond what the interpreter needs."""

    joints_deg: Joints
    speed_deg_s: Joints
    override_percent: float

    @property
    def mode(self) -> str:
        """$MODE_OP."""

    @property
    def drives(self) -> bool:
        """$PERI_RDY."""

    @property
    def held(self) -> bool:
        """Whether something keeps it from moving."""

    @property
    def running(self) -> Any:
        """What the main run pointer is on."""

    def select(self) -> None:
        """Another program."""

    def start(self) -> bool:
        """The start key."""

    def drives_on(self) -> None:
        """Switch the drives on."""

    def drives_off(self) -> None:
        """Switch the drives off."""


class Program(Protocol):
    """What the variables say of a program."""

    @property
    def state(self) -> str:
        """Member of PRO_STATE."""

    @property
    def name(self) -> str:
        """The selected module."""

    @property
    def place(self) -> tuple[str, str, int]:
        """Module, file and line."""


class System:
    """Binds the variables.

    Args:
        timer_ms: $ROB_TIMER.
    """

    def __init__(
        self,
        memory: Memory,
        mover: Mover,
        panel: Panel,
        terminals: Terminals,
        timer_ms: Callable[[], int],
    ) -> None:
        self._memory = memory
        self._mover = mover
        self._panel = panel
        self._look("$ROB_TIMER", timer_ms)
        self._look("$DATE", lambda: _date(timer_ms()))
        self._bind_terminals(terminals)
        self._bind_motion()
        self._bind_state()
        self._set_machine_data()

    def _look(self, name: str, get: Callable[[], Any]) -> None:
        self._memory.bind(name, Live(get))

    def _bind_terminals(self, terminals: Terminals) -> None:
        for name, lines in (
            ("$IN", terminals.inputs),
            ("$OUT", terminals.outputs),
            ("$OUT_C", terminals.outputs),
            ("$ANIN", terminals.analog_inputs),
            ("$ANOUT", terminals.analog_outputs),
            ("$TIMER", terminals.timers),
            ("$TIMER_STOP", terminals.timer_stop),
        ):
            self._memory.box(name).value = lines
        self._look("$TIMER_FLAG", lambda: [time_ms >= 0 for time_ms in terminals.timers])
        for name in ("$FLAG", "$CYCFLAG"):
            values = self._memory.get(name)
            values[:] = [False] * len(values)

    def _bind_motion(self) -> None:
        mover = self._mover

        def override(percent: int) -> None:
            mover.override_percent = float(percent)

        self._memory.bind("$OV_PRO", Live(lambda: round(mover.override_percent), override))
        for name in ("$AXIS_ACT", "$AXIS_ACT_MEAS"):
            self._look(name, lambda: axes_value(mover.joints_deg))
        self._look("$AXIS_FOR", lambda: self._end("end_deg"))
        self._look("$AXIS_BACK", lambda: self._end("start_deg"))
        for which in ("INT", "RET"):
            axes = self._memory.box(f"$AXIS_{which}")
            self._look(f"$POS_{which}", partial(self._point_of, axes))
        for name in ("$POS_ACT", "$POS_ACT_MES"):
            self._look(name, lambda: self._point(axes_value(mover.joints_deg)))
        self._look("$POS_FOR", lambda: self._point(self._end("end_deg")))
        self._look("$POS_BACK", lambda: self._point(self._end("start_deg")))
        self._look("$VEL_AXIS_ACT", self._axis_speeds)
        self._look("$VEL_ACT", self._tool_speed_m_s)
        self._look("$MOVE_BCO", lambda: mover.needs_bco)
        self._look("$TOOL_C", lambda: self._frame_of_block("tool"))
        self._look("$BASE_C", lambda: self._frame_of_block("base"))
        self._look("$VEL_C", lambda: self._speed_of_block(VELOCITIES))
        self._look("$ACC_C", lambda: self._speed_of_block(ACCELERATIONS))
        self._look("$APO_C", self._apo_of_block)

    # The main run's copies of what was valid as its block was planned.

    def _block(self) -> Any:
        running = self._mover.running
        return None if running is None else running.block

    def _frame_of_block(self, which: str) -> Any:
        frame = getattr(getattr(self._block(), "motion", None), which, None)
        return None if frame is None else dict(zip(PLACE_PARTS, frame, strict=True))

    def _speed_of_block(self, names: tuple[str, ...]) -> Any:
        speed = getattr(getattr(self._block(), "motion", None), "speed", None)
        if speed is None:
            return None
        values = (getattr(speed, name) for name in names)
        return dict(zip(("CP", "ORI1", "ORI2"), values, strict=True))

    def _apo_of_block(self) -> Any:
        block = self._block()
        if block is None:
            return None
        apo = block.apo
        values = (apo.cptp_percent, apo.cdis_mm, apo.cori_deg, apo.cvel_percent)
        return dict(zip(("CPTP", "CDIS", "CORI", "CVEL"), values, strict=True))

    def _end(self, which: str) -> Any:
        running = self._mover.running
        return None if running is None else axes_value(getattr(running.contour, which))

    def _point(self, axes: Any) -> Any:
        """The tool on the base; None while these are not set."""
        tool, base = self._memory.get("$TOOL"), self._memory.get("$BASE")
        if axes is None or not is_set(tool) or not is_set(base):
            return None
        return point_value(joints_of(axes, "axes"), place_of(tool, ""), place_of(base, ""))

    def _point_of(self, axes: Box) -> Any:
        return self._point(axes.value if is_set(axes.value) else None)

    def _axis_speeds(self) -> list[float]:
        pairs = zip(self._mover.speed_deg_s, figures.SPEED_DEG_S, strict=True)
        return [*(100.0 * speed / limit for speed, limit in pairs), *[0.0] * (AXES - 6)]

    def _tool_speed_m_s(self) -> float:
        mover, step_s = self._mover, EXTERNAL_SPEED_STEP_S
        if not any(mover.speed_deg_s):
            return 0.0
        tool = self._memory.get("$TOOL")
        frame = place_of(tool, "") if is_set(tool) else NULL_FRAME
        pairs = zip(mover.joints_deg, mover.speed_deg_s, strict=True)
        ahead = tuple(q + speed * step_s for q, speed in pairs)
        places = (tool_centre(mover.joints_deg, frame)[0], tool_centre(ahead, frame)[0])
        return math.dist(*places) / 1000.0 / step_s

    def _bind_state(self) -> None:
        mover, panel = self._mover, self._panel
        for name, mode in (("$T1", "T1"), ("$T2", "T2"), ("$AUT", "AUT"), ("$EXT", "EX")):
            self._look(name, partial(self._is_mode, mode))
        self._look("$MODE_OP", lambda: mover.mode)
        self._look("$PRO_MOVE", lambda: mover.moving)
        self._look("$ROB_STOPPED", lambda: not mover.moving)
        self._look("$STOPMESS", lambda: panel.stop_message)
        self._look("$USER_SAF", lambda: panel.user_saf)
        self._look("$ALARM_STOP", lambda: panel.alarm_stop)
        self._look("$ALARM_STOP_INTERN", lambda: panel.alarm_stop)
        self._look("$PERI_RDY", lambda: mover.drives)
        self._look("$BRAKE_SIG", lambda: (1 << 6) - 1 if mover.drives else 0)
        self._look("$COULD_START_MOTION", self.could_start)
        self._memory.bind("$DRIVES_ENABLE", Live(lambda: mover.drives, self._enable_drives))

    def _is_mode(self, mode: str) -> bool:
        return self._mover.mode == mode

    def could_start(self) -> bool:
        """Whether the start key would do anything."""
        panel = self._panel
        return self._mover.drives and panel.safe and not panel.stop_message and not panel.path_stop

    def _enable_drives(self, on: bool) -> None:
        if not on:
            self._mover.drives_off()
            # A program does not stay active without drives.
            self._stop_program()
        elif self._panel.safe:
            self._mover.drives_on()

    def bind_programs(
        self, robot: Program, submit: Program, stop_robot: Callable[[], None]
    ) -> None:
        """What interpreters say of themselves; and the robot program's stop key."""
        self._stop_program = stop_robot
        self._look("$PRO_STATE0", lambda: submit.state)
        for name in ("$PRO_STATE", "$PRO_STATE1"):
            self._look(name, lambda: robot.state)
        mover = self._mover
        self._look("$PRO_ACT", lambda: robot.state == "P_ACTIVE" or mover.moving)
        self._look("$PRO_NAME0", lambda: submit.name)
        for name in ("$PRO_NAME", "$PRO_NAME1"):
            self._look(name, lambda: robot.name)
        for name, program in (("$PRO_IP", robot), ("$PRO_IP1", robot), ("$PRO_IP0", submit)):
            self._look(name, partial(_pointer, program))

    def _set_machine_data(self) -> None:
        put, panel = self._memory.put, self._panel
        zero = [0.0] * (AXES - 6)
        low, high = zip(*figures.RANGE_DEG, strict=True)
        put("$SOFTN_END", [*low, *zero])
        put("$SOFTP_END", [*high, *zero])
        put("$APO_DIS_PTP", [figures.APO_DIS_PTP_DEG] * 6 + zero)
        put("$RED_VEL_AXC", [*figures.RED_VEL_AXC_PERCENT, *zero])
        put("$RED_ACC_AXC", [*figures.RED_ACC_AXC_PERCENT, *zero])
        turn, turning = figures.TURN_SPEED_DEG_S, figures.TURN_ACCELERATION_DEG_S2
        put("$VEL_MA", {"CP": figures.PATH_SPEED_MM_S / 1e3, "ORI1": turn, "ORI2": turn})
        path = figures.PATH_ACCELERATION_MM_S2 / 1e3
        put("$ACC_MA", {"CP": path, "ORI1": turning, "ORI2": turning})
        put("$NULLFRAME", dict.fromkeys("XYZABC", 0.0))
        for name in ("$WORLD", "$ROBROOT"):
            put(name, dict.fromkeys("XYZABC", 0.0))
        put("$MODEL_NAME", panel.model_name)
        put("$ROBNAME", panel.robot_name)
        numbers = {
            "$NUM_AX": 6,
            "$ADVANCE": 3,
            "$ACT_TOOL": 0,
            "$ACT_BASE": 0,
            "$RED_T1": 7,
            "$OV_JOG": 10,
        }
        for name, number in (numbers | {"$KR_SERIALNO": panel.serial_number}).items():
            put(name, number)
        put("$MOT_TEMP", [MOTOR_TEMPERATURE_K] * AXES)
        self._set_states()

    def _set_states(self) -> None:
        put = self._memory.put
        for name in ("$CURR_ACT", "$TORQUE_AXIS_ACT", "$TORQ_DIFF"):
            put(name, [0.0] * AXES)
        for name in ("$PRO_MODE", "$PRO_MODE0", "$PRO_MODE1"):
            put(name, "GO")
        put("$SAFETY_SW", "RELEASED")
        put("$ERR", {"NUMBER": 0, "MODULE": "", "LINE_NR": 0, "INT_PRIO": 0})
        # Of the external automatic inputs the levels are held, the pulses low.
        for name in ("$MOVE_ENABLE", "$DRIVES_OFF", "$I_O_ACT", "$ON_PATH", "$ROB_CAL"):
            put(name, True)
        lows = "$POWER_FAIL $IN_HOME $DRIVES_ON $EXT_START $CONF_MESS $STOPNOAPROX"
        for name in lows.split():
            put(name, False)


def _date(timer_ms: int) -> dict[str, int]:
    now = SWITCHED_ON + timedelta(milliseconds=timer_ms)
    values = (now.microsecond // 10_000, now.second, now.minute, now.hour)
    parts = ("CSEC", "SEC", "MIN", "HOUR", "DAY", "MONTH", "YEAR")
    return dict(zip(parts, (*values, now.day, now.month, now.year), strict=True))


def _pointer(program: Program) -> dict[str, Any]:
    module, _, line = program.place
    empty = dict.fromkeys(("I_EXECUTED", "P_ARRIVED", "P_NAME", "SI01"))
    return {"NAME": module, "SNR": line, "NAME_C": module, "SNR_C": line} | empty
