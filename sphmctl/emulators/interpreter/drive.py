"""The robot interpreter's side of the arm: blocks with their triggers, brakes, what is ahead."""

from __future__ import annotations

from typing import Protocol

from sphmctl.emulators.interpreter.calls import Action, Wish
from sphmctl.emulators.interpreter.code import Frame
from sphmctl.emulators.interpreter.faults import (
    MOTION_REFUSED,
    OUT_OF_RANGE,
    KrlFaultError,
    invalid,
)
from sphmctl.emulators.interpreter.functions import axes_value
from sphmctl.emulators.interpreter.memory import Memory
from sphmctl.emulators.interpreter.motions import Order, Planner
from sphmctl.emulators.motion.blocks import Block, MotionError, Trigger

Joints = tuple[float, ...]

STEP_MODES = ("MSTEP", "ISTEP")
"""Program run modes without an advance run. That they stop after each block is not modelled."""

STOP_ON_PATH = 2
"""Category of the stop that a run-time error makes: on the path, drives on."""


class Arm(Protocol):
    """What the interpreter needs of a mover."""

    joints_deg: Joints

    @property
    def moving(self) -> bool:
        """Whether it moves."""

    @property
    def needs_bco(self) -> bool:
        """Whether the next block is the block coincidence run."""

    @property
    def planned_end_deg(self) -> Joints:
        """Where everything planned ends."""

    def feed(self, block: Block) -> None:
        """Plan a block."""

    def brake(self, fast: bool = False) -> None:
        """Come to rest on the path."""

    def release(self) -> None:
        """Go on."""

    def set_aside(self) -> None:
        """Keep what is planned for later."""

    def take_up(self) -> None:
        """Plan again what was set aside last."""

    def drop_aside(self) -> None:
        """Forget what was set aside last."""

    def discard(self) -> None:
        """Forget what is planned."""

    def stop(self, category: int) -> None:
        """A stop of category 0, 1 or 2."""


class Drive:
    """Feeds the mover."""

    def __init__(self, arm: Arm, memory: Memory, trigger_value: str) -> None:
        self._arm = arm
        self._memory = memory
        self._prepare = trigger_value == "planning"
        self._planner = Planner(memory.get, lambda: arm.planned_end_deg)
        self._advance = memory.box("$ADVANCE")
        self._mode = memory.box("$PRO_MODE1")
        self._tag = 0
        self._wishes: list[tuple[Wish, Frame]] = []
        self._armed: dict[int, tuple[Action, Frame, int]] = {}

    @property
    def advance(self) -> int:
        """$ADVANCE; 0 in the step modes (krl-extension, "$PRO_MODE")."""
        if self._mode.value in STEP_MODES:
            return 0
        value = self._advance.value
        return value if isinstance(value, int) else 0

    def add_trigger(self, wish: Wish, frame: Frame) -> None:
        """Keep a trigger for the next motion."""
        if wish.kind == "DISTANCE" and wish.value not in (0.0, 1.0):
            raise KrlFaultError(OUT_OF_RANGE, f"DISTANCE of a trigger is 0 or 1, not {wish.value}")
        self._wishes.append((wish, frame))

    def move(self, order: Order) -> int:
        """Plan a motion; returns its tag.

        Raises:
            KrlFaultError: the controller refuses it.
        """
        if self._advance.value is None:
            raise invalid("$ADVANCE")
        motion = self._planner.plan(order, self._arm.needs_bco)
        blends = order.blends
        wishes, self._wishes = self._wishes, []
        triggers = tuple(self._trigger(wish, frame) for wish, frame in wishes)
        self._tag += 1
        try:
            block = Block(self._tag, motion, blends, self._planner.apo(blends), triggers)
            self._arm.feed(block)
        except MotionError as error:
            raise KrlFaultError(MOTION_REFUSED, str(error)) from None
        return self._tag

    def _trigger(self, wish: Wish, frame: Frame) -> Trigger:
        self._tag += 1
        action = wish.action
        if self._prepare and action.prepare is not None:
            action = Action(perform=action.prepare(frame))
        self._armed[self._tag] = (action, frame, wish.priority)
        delay_s = wish.delay_ms / 1000.0
        if wish.kind == "DISTANCE":
            return Trigger(self._tag, distance=int(wish.value), delay_s=delay_s)
        return Trigger(self._tag, path_mm=float(wish.value), onstart=wish.on_start, delay_s=delay_s)

    def fired(self, tag: int) -> tuple[Action, Frame, int] | None:
        """What a trigger of the mover's means."""
        return self._armed.pop(tag, None)

    def brake(self, fast: bool) -> bool:
        """BRAKE; whether the arm stands."""
        self._arm.brake(fast)
        return not self._arm.moving

    def release(self) -> None:
        """The routine that braked has ended."""
        self._arm.release()

    def interrupted(self) -> None:
        """An interrupt's routine begins: $AXIS_INT."""
        self._memory.put("$AXIS_INT", axes_value(self._arm.joints_deg))

    def leave_path(self) -> None:
        """The routine that braked will move: $AXIS_RET is where it begins."""
        self._memory.put("$AXIS_RET", axes_value(self._arm.joints_deg))
        self._arm.set_aside()

    def return_to_path(self) -> None:
        """It has moved."""
        self._arm.take_up()

    def drop_path(self) -> None:
        """It has ended by RESUME."""
        self._arm.drop_aside()

    def discard(self) -> None:
        """RESUME: what is planned is forgotten."""
        self._wishes.clear()
        self._arm.discard()

    def forget(self) -> None:
        """Another program."""
        self._wishes.clear()
        self._armed.clear()

    def stop(self) -> None:
        """A run-time error."""
        self._arm.stop(STOP_ON_PATH)
