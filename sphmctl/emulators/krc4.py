"""An emulated KRC4 without its network side: variables, arm, program, and the operator's hands.

Begins where the operator's part ends: mode #EX, drives on, SPH_RUN selected, driven to its BCO
point and active. Not modelled: the reduced speed of T1, drives that warm up, tracking error.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from sphmctl.emulators.arm import STEP_S, Arm, in_range
from sphmctl.emulators.lines import Lines
from sphmctl.emulators.standin import VERSION, Program
from sphmctl.emulators.system_variables import MODE_OP, Panel, declare_system_variables
from sphmctl.emulators.variables import Store
from sphmctl.emulators.world import STEP_US, World

ARM_STEPS = round(STEP_S * 1e6 / STEP_US)
"""World steps between two steps of the arm."""

TICK_STEPS = 3 * ARM_STEPS
"""World steps between two turns of the program: KRC4's 12 ms interpolation cycle."""

TIMER_START_MS = 3_600_000
"""`$ROB_TIMER` at the start: the controller has been on for an hour, and nobody may expect 0."""

MEASURING_ERROR_DEG = 2e-5
"""Standard deviation of `$AXIS_ACT_MEAS` from `$AXIS_ACT`: they differ in the seventh digit in a
public capture of a KRC4."""

T2_OVERRIDE_PERCENT = 10
"""`$T2_OV_REDUCE` of the robot's machine data: the override falls to this when T2 is chosen."""


@dataclass(frozen=True)
class Options:
    """How this controller is.

    Attributes:
        start_deg: the arm's joints at the start.
        model_name: `$MODEL_NAME[]`; the default is the robot's own machine data's.
        program: the selected program, `$PRO_NAME1[]`.
        program_state: `$PRO_STATE1`; P_FREE for nothing selected.
        program_version: what our program says of itself.
        installed: whether our program and its variables are on the controller at all.
        lines: whether its lines to a board are connected.
    """

    start_deg: tuple[float, ...] = (0.0, -90.0, 90.0, 0.0, 90.0, 0.0)
    model_name: str = "#KR6R900 C4SR FLR 230"
    robot_name: str = "KR6R900 sixx"
    program: str = "SPH_RUN"
    program_state: str = "P_ACTIVE"
    program_version: int = VERSION
    installed: bool = True
    lines: bool = False


class Controller:
    """The controller; a part of the world, which it joins by itself.

    Args:
        world: whose time drives it.
        rng: draws what differs from robot to robot, once.
        options: what the test or the user wants to be different.
    """

    def __init__(self, world: World, rng: random.Random, options: Options | None = None) -> None:
        self.options = Options() if options is None else options
        if len(self.options.start_deg) != 6 or not in_range(self.options.start_deg):
            raise ValueError(
                f"start_deg {self.options.start_deg} is not six joints inside their ranges"
            )
        self._world = world
        self._begin = world.index
        self._index = world.index
        self._stopped = False
        self.store = Store()
        self.arm = Arm(tuple(float(q) for q in self.options.start_deg))
        self.panel = Panel(
            self.options.model_name,
            self.options.robot_name,
            rng.randrange(100_000, 1_000_000),
            self.options.program if self.options.program_state != "P_FREE" else "",
            self.options.program_state,
        )
        errors_deg = tuple(rng.gauss(0.0, MEASURING_ERROR_DEG) for _ in range(6))
        declare_system_variables(self.store, self.panel, self.arm, self.timer_ms, errors_deg)
        self.lines = Lines() if self.options.lines else None
        self.program: Program | None = None
        if self.options.installed:
            self.program = Program(
                self.store, self.arm, self.panel, self.options.program_version, self.lines
            )
        world.add(self)

    def timer_ms(self) -> int:
        """`$ROB_TIMER` of the present world step."""
        return TIMER_START_MS + (self._index - self._begin) * STEP_US // 1000

    def true_joints_deg(self) -> tuple[float, ...]:
        """The six joints as they are at the world's last step."""
        return self.arm.joints_deg

    def step(self, index: int) -> None:
        """The world's next millisecond: the arm moves every 4th, the program every 12th."""
        self._index = index
        if index % ARM_STEPS:
            return
        self.arm.step()
        if self._stopped and not self.arm.moving:
            self.panel.drives = False
        if index % TICK_STEPS == 0:
            override = self.store.get("$OV_PRO")
            self.arm.override = override / 100.0 if isinstance(override, int) else 0.0
            if self.program is not None:
                self.program.tick(self.timer_ms())
            if self.panel.program_state == "P_STOP":
                # Whatever the program has begun: its interpreter stands.
                self.arm.hold()

    def emergency_stop(self) -> None:
        """Press the emergency stop: STOP 1, so on the path, then drives off."""
        self._world.advance()
        self.panel.alarm_stop = False
        self._stop_by_safety()

    def open_gate(self) -> None:
        """Open the guard in automatic mode."""
        self._world.advance()
        self.panel.user_saf = False
        self._stop_by_safety()

    def set_mode(self, mode: str) -> None:
        """Turn the mode switch: "T1", "T2", "AUT" or "EX"; stops a program that is active."""
        if mode not in MODE_OP.members:
            raise ValueError(f"mode {mode!r} is not one of {', '.join(MODE_OP.members)}")
        self._world.advance()
        if mode == self.panel.mode:
            return
        self.panel.mode = mode
        if mode == "T2":
            self.store.put("$OV_PRO", T2_OVERRIDE_PERCENT)
        if self.panel.program_state == "P_ACTIVE":
            self._stop_by_safety()

    def release(self) -> None:
        """Undo every stop: button, gate, acknowledgement, drives, start key."""
        self._world.advance()
        self._stopped = False
        panel = self.panel
        panel.alarm_stop = panel.user_saf = panel.drives = True
        panel.stop_message = False
        if panel.program_state == "P_STOP":
            panel.program_state = "P_ACTIVE"

    @property
    def world_s(self) -> float:
        """Time since the start."""
        return (self._world.index - self._begin) * STEP_US / 1e6

    def control(self, command: str, interpreter: int) -> bool:
        """Press a key of an interpreter, 0 the submit's, 1 the robot's; False when it refuses.

        Args:
            command: "reset", "start", "stop" or "cancel". A running program refuses "reset" and
                "cancel", and the robot's "start" needs drives and no stop message.
            interpreter: 0 or 1.
        """
        if interpreter not in (0, 1):
            return False
        panel = self.panel
        state = panel.submit_state if interpreter == 0 else panel.program_state
        if state == "P_FREE" or (command in ("reset", "cancel") and interpreter and self._driven):
            return False
        after = {"reset": "P_RESET", "start": "P_ACTIVE", "stop": "P_STOP", "cancel": "P_FREE"}
        if interpreter == 0:
            panel.submit_state = after[command]
            return True
        if command == "start" and (not panel.drives or panel.stop_message):
            return False
        if command == "stop" and state != "P_ACTIVE":
            return False
        panel.program_state = after[command]
        if command in ("reset", "cancel"):
            self.arm.drop()
            if self.program is not None:
                self.program.restart()
        if command == "cancel":
            panel.program = ""
        return True

    def select(self, name: str, *, force: bool = False) -> bool:
        """Select a program by its module's name; `force` cancels a selected one that stands."""
        module = name.replace("\\", "/").rpartition("/")[2].upper().removesuffix(".SRC")
        panel = self.panel
        if not self.options.installed or module != self.options.program.upper():
            return False
        if panel.program_state != "P_FREE" and not (force and self.control("cancel", 1)):
            return False
        panel.program, panel.program_state = self.options.program, "P_RESET"
        return True

    def confirm_messages(self) -> bool:
        """Acknowledge every message; what still has its cause stays."""
        panel = self.panel
        if panel.alarm_stop and panel.user_saf:
            panel.stop_message = False
        return True

    @property
    def _driven(self) -> bool:
        return self.panel.program_state == "P_ACTIVE" or self.arm.moving

    def _stop_by_safety(self) -> None:
        self._stopped = True
        self.panel.stop_message = True
        if self.panel.program_state == "P_ACTIVE":
            self.panel.program_state = "P_STOP"
        self.arm.hold()
