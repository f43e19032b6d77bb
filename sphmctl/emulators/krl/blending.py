"""Warnings about approximated motions: what makes them exact stops without saying so.

The advance run plans the next block while the arm is in the present one. What stops it between an
approximated motion and the next makes the arm stand at the point. Which statements and variables
stop it: Expert Programming KSS 5.2, "Advance run", and SI, "Computer advance run".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.functions import STOPS_ADVANCE
from sphmctl.emulators.krl.report import Report
from sphmctl.emulators.krl.statements import bodies, root, walk
from sphmctl.emulators.krl.walking import Calls, Part, at_once
from sphmctl.emulators.krl.words import words

INPUTS_OUTPUTS = frozenset(("$IN", "$OUT", "$ANIN", "$ANOUT"))

STOPPING = INPUTS_OUTPUTS | words(
    """$AXIS_ACT $AXIS_ACT_MEAS $POS_ACT $POS_ACT_MES $AXIS_INT $POS_INT $VEL_ACT $VEL_AXIS_ACT
    $CURR_ACT $TORQ_DIFF $TORQUE_AXIS_ACT $ROB_TIMER $TIMER $MOVE_BCO $POWER_FAIL
    $ALARM_STOP $ALARM_STOP_INTERN $USER_SAF $PERI_RDY $STOPMESS $ON_PATH $NEAR_POSRET $IN_HOME
    $ROB_STOPPED $PRO_ACT $PRO_MOVE $T1 $T2 $AUT $EXT $DRIVES_ON $DRIVES_OFF $MOVE_ENABLE
    $CONF_MESS $EXT_START"""
)
"""Variables at which the advance run waits: inputs, outputs, the outputs behind signals of the
machine data, and actual values."""

STOPPING_WRITES = frozenset(("$ACT_BASE", "$ACT_TOOL", "$ACT_EX_AX"))

FRAMES = frozenset(("$TOOL", "$BASE"))


@dataclass(frozen=True)
class Event:
    """Something on the way from one motion to the next.

    Attributes:
        what: "motion", "stop", "wait" (a stop that is waited for on purpose) or "frame".
        branch: it does not happen each time.
    """

    what: str
    at: n.Place
    text: str = ""
    branch: bool = False
    motion: n.Motion | None = None


def find_blending_traps(calls: Calls, report: Report) -> None:
    """Look at every routine."""
    stopping = _stopping_routines(calls)
    for part in calls.parts.values():
        _Walk(calls, part, stopping, report).run()


def _stopping_routines(calls: Calls) -> set[tuple[str, str]]:
    """Routines that stop the advance run, by themselves or by what they call."""
    own = {
        key
        for key, part in calls.parts.items()
        if any(_stop(part, node) for node in walk(part.routine.body))
    }
    growing = True
    while growing:
        more = {key for key, called in calls.direct.items() if own.intersection(called)} - own
        own |= more
        growing = bool(more)
    return own


def _stop(part: Part, node: n.Statement) -> tuple[str, str] | None:
    """Why a statement stops the advance run: the kind of event, and in words."""
    if isinstance(node, n.WaitFor | n.WaitSec):
        return ("wait", "WAIT")
    if isinstance(node, n.Simple) and node.word == "HALT":
        return ("wait", "HALT")
    if isinstance(node, n.Pulse):
        return ("stop", "PULSE")
    if isinstance(node, n.Assign) and root(node.target).name in STOPPING_WRITES:
        return ("stop", f"assigning {root(node.target).name}")
    # A motion to an actual value is planned where the arm stands: nothing is lost by it.
    if isinstance(node, n.Motion):
        return None
    for inner in at_once(node):
        if isinstance(inner, n.Call) and inner.name in STOPS_ADVANCE:
            return ("stop", inner.name)
        if isinstance(inner, n.Name):
            variable = part.scope.variable(inner.name)
            if inner.name in STOPPING or (variable and variable.io in INPUTS_OUTPUTS):
                return ("stop", inner.name)
    return None


class _Walk:
    """The way through one routine."""

    def __init__(
        self, calls: Calls, part: Part, stopping: set[tuple[str, str]], report: Report
    ) -> None:
        self._calls = calls
        self._part = part
        self._stopping = stopping
        self._report = report

    def run(self) -> None:
        """Look at the routine as a sequence, and at each loop as one that comes again."""
        body = self._part.routine.body
        self._judge(list(self._events(body, branch=False)))
        for node in walk(body):
            if isinstance(node, n.For | n.While | n.Repeat | n.Loop):
                turn = [*self._head(node), *self._events(node.body, branch=False)]
                self._judge([*turn, *turn])

    def _head(self, node: n.For | n.While | n.Repeat | n.Loop) -> Iterator[Event]:
        if (why := _stop(self._part, node)) is not None:
            yield Event(why[0], node.at, why[1])

    def _events(self, body: n.Body, branch: bool) -> Iterator[Event]:
        excused = False
        for node in body:
            if not excused:
                yield from self._event(node, branch)
            elif isinstance(node, n.Motion):
                yield Event("motion", node.at, "", branch, node)
            excused = isinstance(node, n.Simple) and node.word == "CONTINUE"
            inner = branch or isinstance(node, n.If | n.Switch | n.While | n.For)
            for part in bodies(node):
                yield from self._events(part, inner)

    def _event(self, node: n.Statement, branch: bool) -> Iterator[Event]:
        if isinstance(node, n.Motion):
            yield Event("motion", node.at, "", branch, node)
        elif (why := _stop(self._part, node)) is not None:
            yield Event(why[0], node.at, why[1], branch)
        elif isinstance(node, n.Assign) and root(node.target).name in FRAMES:
            yield Event("frame", node.at, root(node.target).name, branch)
        else:
            for inner in at_once(node):
                if isinstance(inner, n.Call):
                    key = self._calls.target(self._part, inner)
                    if key in self._stopping:
                        yield Event("wait", inner.at, inner.name, branch)

    def _judge(self, events: list[Event]) -> None:
        """Look at what stands between each approximated motion and the motion behind it."""
        open_motion: n.Motion | None = None
        between: list[Event] = []
        for event in events:
            if event.motion is None:
                between.append(event)
                continue
            if open_motion is not None and open_motion.blends:
                for other in between:
                    self._tell(open_motion, other)
                self._kinds(open_motion, event.motion)
            open_motion = event.motion
            between = []

    def _tell(self, motion: n.Motion, event: Event) -> None:
        if event.what == "frame":
            message = (
                f"{event.text} changes behind an approximated motion, which is then planned in the "
                "new frame; put WAIT SEC 0 before"
            )
            self._report.warn(event.at, "frame", message)
        elif event.what == "stop" or not event.branch:
            # A WAIT in a branch is there for the case that the arm has to stand anyway.
            message = (
                f"{event.text} stops the advance run, so the approximated motion in line "
                f"{motion.at.line} becomes an exact stop; use TRIGGER, or CONTINUE before it"
            )
            self._report.warn(event.at, "blend", message)

    def _kinds(self, motion: n.Motion, following: n.Motion) -> None:
        joint = motion.kind.startswith("PTP")
        if motion.kind.startswith("S") or following.kind.startswith("S"):
            return
        if joint and not following.kind.startswith("PTP") and motion.blends == ("C_PTP",):
            message = f"before {following.kind} a second word is needed: C_PTP C_DIS"
            self._report.warn(motion.at, "blend", message)
        if not joint and motion.blends == ("C_PTP",):
            message = f"{motion.kind} is approximated by C_DIS, C_VEL or C_ORI"
            self._report.warn(motion.at, "blend", message)
