"""The robot program and its part in the submit interpreter, written by hand.

This module will be deleted when the emulator executes the shipped KRL program itself. It does what
firmware/krc/INTERFACE.md says, one turn in each 12 ms cycle, and nothing else: drives, safety and
the arm's motion belong to others.

Where that page leaves a choice: a fault shows in the state at once and the arm brakes after that;
HOLDING and STOPPED show when the arm stands. Any command but CMD_RUN and CMD_STOP holds.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from sphmctl.emulators.arm import Arm, in_range
from sphmctl.emulators.krl_text import Array, Bool, Int, Real, Struct, Value
from sphmctl.emulators.lines import Lines
from sphmctl.emulators.system_variables import E6AXIS, MODE_OP, Panel, axis_value
from sphmctl.emulators.variables import Store

VERSION = 2
RING = 64
LATE_MS = 120
LOST_MS = 1000

CMD_IDLE = 0
CMD_RUN = 1
CMD_STOP = 3

STATUS_IDLE = 0
STATUS_READY = 1
STATUS_RUNNING = 2
STATUS_HOLDING = 3
STATUS_STOPPED = 4
STATUS_ENDED = 5
STATUS_FAULT = 6

FAULT_NONE = 0
FAULT_BEAT = 1
FAULT_SEQUENCE = 2
FAULT_KNOT = 3
FAULT_CONTROLLER = 4
FAULT_WRIST = 5

WRIST_NONE = 0
WRIST_OFF = 1
WRIST_ON = 2

ADVANCE = 3
"""Planned blocks that wait behind the running one: `$ADVANCE` of the standard INI."""

SPH_KNOT_T = Struct("SPH_KNOT_T", (("SEQ", Int()), ("VEL", Real()), ("ACC", Real()), ("Q", E6AXIS)))
SPH_STATE_T = Struct(
    "SPH_STATE_T",
    (
        ("VERSION", Int()),
        ("SESSION", Int()),
        ("STATUS", Int()),
        ("FAULT", Int()),
        ("WRIST", Int()),
        ("RD", Int()),
        ("DONE", Int()),
        ("BEAT", Int()),
        ("TIME", Int()),
        ("OV", Int()),
        ("MOVING", Bool()),
        ("STOPPED", Bool()),
        ("DRIVES", Bool()),
        ("SAFE", Bool()),
        ("STOPMESS", Bool()),
        ("MODE", MODE_OP),
        ("Q", E6AXIS),
    ),
)


@dataclass(frozen=True)
class _Planned:
    """A block that the advance run has taken."""

    target_deg: tuple[float, ...]
    velocity_percent: float
    acceleration_percent: float


class Program:
    """SPH_RUN and its submit part.

    Args:
        store: where its global variables are declared.
        arm: what it moves.
        panel: what the controller says about modes, drives and stops.
        version: what the state structure says; another one than VERSION plays an old program.
        lines: its lines to a board; None where none are connected.
    """

    def __init__(
        self,
        store: Store,
        arm: Arm,
        panel: Panel,
        version: int = VERSION,
        lines: Lines | None = None,
    ) -> None:
        self._store = store
        self._arm = arm
        self._panel = panel
        self._version = version
        self._lines = lines
        self._status = STATUS_IDLE
        self._fault = FAULT_NONE
        self._session = self._rd = self._done = self._beat = 0
        self._beat_ms: int | None = None
        self._finished = arm.finished
        self._mode = panel.mode
        self._stopping = False
        self._waiting: deque[_Planned] = deque()
        for name in ("SPH_WR", "SPH_LAST", "SPH_CMD", "SPH_SESSION", "SPH_BEAT"):
            store.declare(name, Int(), 0, writable=True)
        store.declare("SPH_KNOT", Array(SPH_KNOT_T, RING), writable=True)
        store.declare("SPH_STATE", SPH_STATE_T, writable=True)
        self._publish(0)

    def tick(self, time_ms: int) -> None:
        """One turn of both interpreters, at `$ROB_TIMER` = `time_ms`."""
        beat = self._int("SPH_BEAT")
        if beat != self._beat or self._beat_ms is None:
            # Before the first change the heartbeat counts from the program's start.
            self._beat, self._beat_ms = beat, time_ms
        passed = self._arm.finished - self._finished
        self._finished += passed
        self._put_lines(passed)
        if self._status in (STATUS_RUNNING, STATUS_HOLDING):
            self._done += passed
            self._drive(self._int("SPH_CMD"), time_ms - self._beat_ms)
        elif self._session_taken():
            self._status, self._fault = STATUS_READY, FAULT_NONE
        elif self._may_begin():
            self._status, self._mode = STATUS_RUNNING, self._panel.mode
            self._drive(CMD_RUN, time_ms - self._beat_ms)
        self._publish(time_ms)

    def restart(self) -> None:
        """Begin at the program's first line: no session, no knots."""
        self._waiting.clear()
        self._status, self._fault, self._stopping = STATUS_IDLE, FAULT_NONE, False

    def _may_begin(self) -> bool:
        commanded = self._status == STATUS_READY and self._int("SPH_CMD") == CMD_RUN
        return commanded and self._wrist() != WRIST_OFF

    def _wrist(self) -> int:
        if self._lines is None:
            return WRIST_NONE
        return WRIST_ON if self._lines.wrist_ok else WRIST_OFF

    def _put_lines(self, passed: int) -> None:
        if self._lines is None:
            return
        for _ in range(passed):
            self._lines.toggle_knot()
        self._lines.put_moving(self._arm.moving)

    def _session_taken(self) -> bool:
        """Take a new session, at standstill, on CMD_IDLE, and while the robot interpreter runs."""
        session = self._int("SPH_SESSION")
        if session <= 0 or session == self._session or self._int("SPH_CMD") != CMD_IDLE:
            return False
        if self._arm.busy or self._panel.program_state != "P_ACTIVE":
            return False
        self._session, self._rd, self._done = session, 0, 0
        return True

    def _drive(self, command: int, silence_ms: int) -> None:
        last = self._int("SPH_LAST")
        panel = self._panel
        if self._done == last != 0:
            self._waiting.clear()
            self._status = STATUS_ENDED
        elif panel.stop_message or not panel.drives or panel.mode != self._mode:
            self._end_by_fault(FAULT_CONTROLLER)
        elif self._wrist() == WRIST_OFF:
            self._end_by_fault(FAULT_WRIST)
        elif self._stopping or command == CMD_STOP:
            self._stop()
        elif silence_ms > LOST_MS:
            self._end_by_fault(FAULT_BEAT)
        elif silence_ms > LATE_MS or command != CMD_RUN:
            self._arm.hold()
            if not self._arm.moving:
                self._status = STATUS_HOLDING
        else:
            self._arm.resume()
            self._status = STATUS_RUNNING
            self._advance()

    def _stop(self) -> None:
        self._stopping = True
        self._arm.drop()
        self._waiting.clear()
        if not self._arm.busy:
            self._stopping = False
            self._status = STATUS_STOPPED

    def _end_by_fault(self, fault: int) -> None:
        self._arm.drop()
        self._waiting.clear()
        self._stopping = False
        self._status, self._fault = STATUS_FAULT, fault

    def _advance(self) -> None:
        """The advance run: start what waits, take what there is."""
        while True:
            if self._waiting and not self._arm.busy:
                block = self._waiting.popleft()
                self._arm.begin(
                    block.target_deg, block.velocity_percent, block.acceleration_percent
                )
            elif self._rd < self._int("SPH_WR") and len(self._waiting) < ADVANCE:
                fault = self._take()
                if fault != FAULT_NONE:
                    self._end_by_fault(fault)
                    return
            else:
                return

    def _take(self) -> int:
        """Copy the next knot out of its slot; returns what is wrong with it."""
        knots = self._store.get("SPH_KNOT")
        knot = knots[self._rd % RING] if isinstance(knots, list) else None
        if not isinstance(knot, dict) or knot["SEQ"] != self._rd + 1:
            return FAULT_SEQUENCE
        target_deg = _axes(knot["Q"])
        velocity_percent, acceleration_percent = _number(knot["VEL"]), _number(knot["ACC"])
        if target_deg is None or velocity_percent is None or acceleration_percent is None:
            # KRL stops with a run-time error at a component that was never set.
            return FAULT_KNOT
        percents_right = 0.0 < velocity_percent <= 100.0 and 0.0 < acceleration_percent <= 100.0
        if not percents_right or not in_range(target_deg):
            return FAULT_KNOT
        self._waiting.append(_Planned(target_deg, velocity_percent, acceleration_percent))
        self._rd += 1
        return FAULT_NONE

    def _int(self, name: str) -> int:
        value = self._store.get(name)
        return value if isinstance(value, int) else 0

    def _publish(self, time_ms: int) -> None:
        panel, moving = self._panel, self._arm.moving
        if panel.submit_state != "P_ACTIVE":
            return
        self._store.put(
            "SPH_STATE",
            {
                "VERSION": self._version,
                "SESSION": self._session,
                "STATUS": self._status,
                "FAULT": self._fault,
                "WRIST": self._wrist(),
                "RD": self._rd,
                "DONE": self._done,
                "BEAT": self._beat,
                "TIME": time_ms,
                "OV": self._int("$OV_PRO"),
                "MOVING": moving,
                "STOPPED": not moving,
                "DRIVES": panel.drives,
                "SAFE": panel.alarm_stop and panel.user_saf,
                "STOPMESS": panel.stop_message,
                "MODE": panel.mode,
                "Q": axis_value(self._arm.joints_deg),
            },
        )


def _number(value: Value) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _axes(value: Value) -> tuple[float, ...] | None:
    if not isinstance(value, dict):
        return None
    axes = [_number(value[f"A{axis}"]) for axis in range(1, 7)]
    known = tuple(axis for axis in axes if axis is not None)
    return known if len(known) == len(axes) else None
