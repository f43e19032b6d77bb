"""Looks at every feedback of both devices and says, in one sentence, why a motion must end.

Process supervision, not a safety function. Limits stand at the top, each with its reason.
"""

from __future__ import annotations

import math

import numpy as np

from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers import xl430
from sphmctl.drivers.kuka import ArmState
from sphmctl.drivers.wrist import WristState
from sphmctl.motion import JOINT_NAMES, Floats

MEASURED_TOLERANCE_RAD = math.radians(0.15)
"""Beyond a range by what rounding and a servo step may add; the octagon ends on two limits."""

OFF_PLAN_RAD = math.radians(1.0)
"""Arm away from the planned blocks: ten times its in-position window; somebody else moves it."""

CRANK_ERROR_RAD = math.radians(5.0)
"""Crank away from where the arm wants it: ten times what is allowed, so something is stuck."""

CRANK_ERROR_CYCLES = 10
"""So many cycles in a row: 100 ms, longer than any servo's lag."""

SILENT_S, SILENT_CYCLES = 0.1, 3
"""A servo silent for longer, and asked so often meanwhile, is a fault. Single replies get lost, and
a busy host does not ask; meanwhile a crank falls behind by 2.5 degrees at the octagon's speed."""

BOARD_MISSES = 2
"""So many questions in a row without an answer are a fault. Each waits for 32 ms, and a silent
board is asked again in the next cycle: 130 ms where the servos behind it are silent too."""

NO_OK_S = 0.150
"""The controller may be without "wrist ok" for so long, braking, before that is the cause: the
board is asked every 50 ms, and knows why."""

NO_REASON_S = 0.030
"""The controller stops its program up to some cycles before it says why: drives fall when it has
braked."""

STALL_S = 3.0
"""The arm makes no progress for so long although it may: it starves or is blocked."""

FAULT_TEXTS = {
    krc.Fault.BEAT: "the controller heard no heartbeat for a second",
    krc.Fault.SEQUENCE: "the controller found a knot with a wrong sequence number",
    krc.Fault.KNOT: "the controller refused a knot's speed or axes",
    krc.Fault.CONTROLLER: "the controller stopped the program",
    krc.Fault.SUBMIT: "the controller's submit interpreter stopped, or is too slow",
    krc.Fault.WRIST: "the controller has no wrist ok, though the board gives it: look at the line",
}


class Watch:
    """Supervision of one motion.

    Args:
        ranges: allowed joint ranges, rad, shape (9, 2).
        session: the session that drives the arm.
        mode: the operating mode in which it was armed.
    """

    def __init__(self, ranges: Floats, session: int, mode: str) -> None:
        self._ranges = ranges
        self._session = session
        self._mode = mode
        self._heard_s = [math.inf, math.inf, math.inf]
        self._misses = [0, 0, 0]
        self._away = [0, 0, 0]
        self._progress_tau = -math.inf
        self._progress_s = 0.0
        self._no_ok_s = math.inf
        self._no_reason_s = math.inf

    def arm(self, state: ArmState, off_plan_rad: float) -> str | None:
        """Why the arm's state ends the motion, or None."""
        if state.session != self._session:
            return "another client has taken the arm's session"
        return self._controller(state) or self._course(state, off_plan_rad)

    def _controller(self, state: ArmState) -> str | None:
        """What the controller itself reports, the most telling first."""
        fault = state.status is krc.Status.FAULT
        if fault and state.fault not in (krc.Fault.CONTROLLER, krc.Fault.WRIST):
            return FAULT_TEXTS.get(state.fault, "the KRL program reports a fault")
        if not state.safe:
            return "the controller reports an emergency stop or an open gate"
        if state.mode != self._mode:
            return f"the operating mode changed from {self._mode} to {state.mode}"
        if not state.drives:
            return "the controller's drives are off"
        if state.stop_message:
            return "the controller shows a stop message"
        if fault and state.fault is krc.Fault.CONTROLLER:
            self._no_reason_s = min(self._no_reason_s, state.at_s)
            if state.at_s - self._no_reason_s >= NO_REASON_S:
                return FAULT_TEXTS[krc.Fault.CONTROLLER]
        return self._line(state)

    def _line(self, state: ArmState) -> str | None:
        """The line "wrist ok", as the controller sees it."""
        if state.wrist is not krc.Wrist.OFF and state.fault is not krc.Fault.WRIST:
            self._no_ok_s = math.inf
            return None
        self._no_ok_s = min(self._no_ok_s, state.at_s)
        return FAULT_TEXTS[krc.Fault.WRIST] if state.at_s - self._no_ok_s > NO_OK_S else None

    def _course(self, state: ArmState, off_plan_rad: float) -> str | None:
        if state.status is krc.Status.STOPPED:
            return "the arm was stopped by another client"
        if off_plan_rad > OFF_PLAN_RAD:
            return (
                f"the arm is {math.degrees(off_plan_rad):.2f} degrees off the plan, "
                f"more than {math.degrees(OFF_PLAN_RAD):g}"
            )
        return self._beyond(state.joints, 0)

    def progress(self, tau: float, host_s: float, expected: bool) -> str | None:
        """Why the lack of progress ends the motion; `expected`: the arm could move."""
        if tau > self._progress_tau + 1e-4 or not expected:
            self._progress_tau, self._progress_s = max(tau, self._progress_tau), host_s
        elif host_s - self._progress_s > STALL_S:
            return f"the arm has made no progress for {STALL_S:g} s"
        return None

    def wrist(self, state: WristState, required: Floats) -> str | None:
        """Why the state of the board or of the servos ends the motion, or None."""
        if state.board_misses >= BOARD_MISSES:
            return "the board was silent twice in a row"
        if state.board is not None and (trouble := state.board.trouble()) is not None:
            return trouble
        silent = [leg for leg in range(3) if self._is_silent(leg, state)]
        if silent:
            # Servos behind a silent one are silent too: the first is the one to look at.
            return f"servo of leg {silent[0] + 1} was silent for {1000.0 * SILENT_S:g} ms"
        for leg, servo in enumerate(state.servos):
            if servo is None:
                continue
            name = f"servo of leg {leg + 1}"
            telemetry = servo.telemetry
            if telemetry.hardware_error:
                text = xl430.hardware_error_text(telemetry.hardware_error)
                return f"{name} reports a hardware error: {text}"
            if telemetry.watchdog == xl430.WATCHDOG_TRIPPED:
                return f"{name} stopped by its bus watchdog"
            if telemetry.torque != 1:
                return f"{name} has lost its torque (power cut, or another client)"
            error = abs(servo.crank - float(required[leg]))
            self._away[leg] = self._away[leg] + 1 if error > CRANK_ERROR_RAD else 0
            if self._away[leg] >= CRANK_ERROR_CYCLES:
                return f"{name} is {math.degrees(error):.1f} degrees from where the arm needs it"
        known = state.cranks
        return self._beyond(known, 6)

    def _is_silent(self, leg: int, state: WristState) -> bool:
        if state.servos[leg] is not None or math.isinf(self._heard_s[leg]):
            self._heard_s[leg], self._misses[leg] = state.at_s, 0
        if state.servos[leg] is None:
            self._misses[leg] += 1
        silent_s = state.at_s - self._heard_s[leg]
        return silent_s > SILENT_S and self._misses[leg] >= SILENT_CYCLES

    def _beyond(self, joints: Floats, first: int) -> str | None:
        """The first joint measured beyond its range; NaN is not beyond."""
        ranges = self._ranges[first : first + len(joints)]
        excess = np.maximum(ranges[:, 0] - joints, joints - ranges[:, 1])
        worst = np.flatnonzero(excess > MEASURED_TOLERANCE_RAD)
        if not worst.size:
            return None
        i = int(worst[0])
        low, high = np.degrees(ranges[i])
        return (
            f"{JOINT_NAMES[first + i]} is at {math.degrees(joints[i]):.2f} degrees, "
            f"outside {low:g} to {high:g}"
        )
