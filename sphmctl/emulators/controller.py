"""An emulated KRC4 that runs the shipped KRL files; no network side, but the operator's hands.

Begins where the operator's part ends: mode #EX, drives on, SPH_RUN selected, driven to its BCO
point and active. Not modelled: drives that warm up, tracking error.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from pathlib import Path

from sphmctl.emulators.interpreter import Interpreters
from sphmctl.emulators.interpreter import Options as KrlOptions
from sphmctl.emulators.interpreter import Panel as Safety
from sphmctl.emulators.interpreter.functions import axes_value
from sphmctl.emulators.interpreter.values import Live
from sphmctl.emulators.krc_files import Numbers, controller_files, with_files
from sphmctl.emulators.krc_hands import Panel
from sphmctl.emulators.krc_keys import Keys
from sphmctl.emulators.krc_lines import NUMBERS, TerminalLines
from sphmctl.emulators.motion import Event, Mover
from sphmctl.emulators.motion import Options as MotionOptions
from sphmctl.emulators.motion.figures import CYCLE_S, MODES, STEP_S, beyond
from sphmctl.emulators.world import STEP_US, World

ARM_STEPS = round(STEP_S * 1e6 / STEP_US)
"""World steps between two steps of the arm."""

TICK_STEPS = round(CYCLE_S * 1e6 / STEP_US)
"""World steps between two turns of the interpreters."""

TIMER_START_MS = 3_600_000
"""`$ROB_TIMER` at the start: the controller has been on for an hour, and nobody may expect 0."""

TIMER_SPAN_MS = 2**31
"""An INT that counts up begins anew at 0, after 24 days (guess)."""

START_UP_MS = 600
"""What the operator's part takes: submit interpreter, selection, and a BCO run to where the arm
stands; the program waits for a session long before the end of it."""

ACCELERATION_DEG_S2 = tuple(
    math.degrees(limit_rad_s2) for limit_rad_s2 in (21.7, 6.9, 31.4, 133.0, 136.0, 268.0)
)
"""kuka_agilus_support/config/kr6_r900_sixx_joint_limits.yaml of kroshu/kuka_robot_descriptions:
lower in the axes that carry the arm than the mover's own guess, and what planners know."""

MEASURING_ERROR_DEG = 2e-5
"""Standard deviation of `$AXIS_ACT_MEAS` from `$AXIS_ACT`: they differ in the seventh digit in a
public capture of a KRC4."""

T2_OVERRIDE_PERCENT = 10
"""`$T2_OV_REDUCE` of the robot's machine data: the override falls to this when T2 is chosen."""

STATES = ("P_FREE", "P_RESET", "P_ACTIVE", "P_STOP")

Joints = tuple[float, ...]


@dataclass(frozen=True)
class Options:
    """How this controller is.

    Attributes:
        start_deg: the arm's joints at the start.
        model_name: `$MODEL_NAME[]`; the default is the robot's own machine data's.
        program: the selected program, `$PRO_NAME1[]`; another name than SPH_RUN idles.
        program_state: `$PRO_STATE1`; P_FREE for nothing selected.
        program_version: what our program says of itself; None for what the files say.
        installed: whether our program and its variables are on the controller at all.
        lines: whether its lines to a board are connected.
        line_numbers: where, if they are.
        timer_ms: `$ROB_TIMER` at the start: the controller has been on for an hour.
        modules: more KRL files on the controller; they take the place of others of their name.
        motion: how the arm moves.
        interpreter: how KRL is run.
    """

    start_deg: Joints = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
    model_name: str = "#KR6R900 C4SR FLR 230"
    robot_name: str = "KR6R900 sixx"
    program: str = "SPH_RUN"
    program_state: str = "P_ACTIVE"
    program_version: int | None = None
    installed: bool = True
    lines: bool = False
    line_numbers: Numbers = NUMBERS
    timer_ms: int = TIMER_START_MS
    modules: tuple[Path, ...] = ()
    motion: MotionOptions = field(
        default_factory=lambda: MotionOptions(acceleration_deg_s2=ACCELERATION_DEG_S2)
    )
    interpreter: KrlOptions = field(default_factory=KrlOptions)

    def __post_init__(self) -> None:
        """Refuse what no controller is."""
        if len(self.start_deg) != 6 or beyond(self.start_deg) is not None:
            raise ValueError(f"start_deg {self.start_deg} is not six joints inside their ranges")
        if self.program_state not in STATES:
            raise ValueError(
                f"program_state {self.program_state!r} is not one of {', '.join(STATES)}"
            )


class Controller:
    """The controller; a part of the world, which it joins by itself.

    Args:
        world: whose time drives it.
        rng: draws what differs from robot to robot, once.
        options: what the test or the user wants to be different.

    Attributes:
        store: all variables, as the variable server sees them.
        arm: the arm.
        krc: both interpreters.
        panel: safety, drives, mode and program state, to be looked at and set.
        keys: both interpreters' keys, for a server.
        lines: the lines to a board; None where they are not connected.
    """

    def __init__(self, world: World, rng: random.Random, options: Options | None = None) -> None:
        self.options = Options() if options is None else options
        self._world = world
        self._begin = world.index
        self._now_ms = 0
        self._told: list[Event] = []
        start_deg = tuple(float(q) for q in self.options.start_deg)
        self.arm = Mover(start_deg, self._told.append, self.options.motion)
        safety = Safety(
            self.options.model_name, self.options.robot_name, rng.randrange(100_000, 1_000_000)
        )
        name = self.options.program.upper()
        files = controller_files(
            name,
            self.options.program_version,
            self.options.installed,
            self.options.line_numbers if self.options.lines else None,
        )
        every = with_files(files, self.options.modules)
        self.krc = Interpreters(
            every, self.arm, safety, self._time_s, self.timer_ms, self.options.interpreter
        )
        self.store = self.krc.memory
        self.panel = Panel(self.krc, self.arm, safety)
        self.keys = Keys(self.krc, self.arm)
        self._errors_deg = tuple(rng.gauss(0.0, MEASURING_ERROR_DEG) for _ in range(6))
        self.store.bind("$AXIS_ACT_MEAS", Live(self._measured))
        self.lines: TerminalLines | None = None
        if self.options.lines:
            self.lines = TerminalLines(self.krc.terminals, self.options.line_numbers)
        self._start_up(name)
        world.add(self)

    def _start_up(self, name: str) -> None:
        """What the operator has done before."""
        state = self.options.program_state
        if state != "P_FREE":
            self.krc.select(name)
        if state in ("P_ACTIVE", "P_STOP"):
            self.krc.start()
        for now_ms in range(1, START_UP_MS + 1):
            self._pass(now_ms, now_ms)
        if state == "P_STOP":
            self.krc.stop()

    def _time_s(self) -> float:
        return self._now_ms / 1000.0

    def _measured(self) -> object:
        pairs = zip(self.arm.joints_deg, self._errors_deg, strict=True)
        return axes_value(tuple(q + error for q, error in pairs))

    def timer_ms(self) -> int:
        """`$ROB_TIMER` of the present world step."""
        return (self.options.timer_ms - START_UP_MS + self._now_ms) % TIMER_SPAN_MS

    @property
    def world_s(self) -> float:
        """Time since the start."""
        return (self._world.index - self._begin) * STEP_US / 1e6

    def true_joints_deg(self) -> Joints:
        """The six joints as they are at the world's last step."""
        return self.arm.joints_deg

    def step(self, index: int) -> None:
        """The world's next millisecond: the arm moves every 4th, the programs every 12th."""
        self._pass(index, START_UP_MS + (index - self._begin) * STEP_US // 1000)

    def _pass(self, index: int, now_ms: int) -> None:
        self._now_ms = now_ms
        if index % ARM_STEPS:
            return
        self.arm.advance(STEP_S)
        events = list(self._told)
        self._told.clear()
        self.krc.react(events)
        if index % TICK_STEPS == 0:
            self.krc.cycle()

    def emergency_stop(self) -> None:
        """Press the emergency stop: STOP 1, so on the path, then drives off."""
        self._world.advance()
        self.panel.alarm_stop = False
        self.krc.stop(1, "emergency stop")

    def open_gate(self) -> None:
        """Open the guard in automatic mode."""
        self._world.advance()
        self.panel.user_saf = False
        self.krc.stop(1, "operator safety/gate open")

    def set_mode(self, mode: str) -> None:
        """Turn the mode switch: "T1", "T2", "AUT" or "EX"; stops a program that is active."""
        if mode not in MODES:
            raise ValueError(f"mode {mode!r} is not one of {', '.join(MODES)}")
        self._world.advance()
        if mode == self.panel.mode:
            return
        self.panel.mode = mode
        if mode == "T2":
            self.store.put("$OV_PRO", T2_OVERRIDE_PERCENT)
        if self.krc.state == "P_ACTIVE":
            self.krc.stop(1, f"operating mode changed to {mode}")

    def release(self) -> None:
        """Undo every stop: button, gate, acknowledgement, drives, start key."""
        self._world.advance()
        self.panel.alarm_stop = self.panel.user_saf = True
        self.krc.confirm()
        self.arm.drives_on()
        self.krc.start()
