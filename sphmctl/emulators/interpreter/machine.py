"""One interpreter: calls, cycles, interrupts, faults. The arm is `drive`'s, and may be absent.

Bounded: in a cycle only so many instructions run, and calls go only so deep.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sphmctl.emulators.interpreter.calls import Action, Wish
from sphmctl.emulators.interpreter.code import Code, Fn, Frame, Pause
from sphmctl.emulators.interpreter.drive import Drive
from sphmctl.emulators.interpreter.events import (
    AUTOMATIC,
    Due,
    Interrupt,
    Interrupts,
    Level,
    Waiting,
)
from sphmctl.emulators.interpreter.faults import (
    NOT_ALLOWED,
    WRONG_STRUCTURE,
    KrlFaultError,
    Message,
)
from sphmctl.emulators.interpreter.memory import Memory
from sphmctl.emulators.interpreter.motions import Order
from sphmctl.emulators.interpreter.options import Options
from sphmctl.emulators.interpreter.signals import Terminals
from sphmctl.emulators.interpreter.values import Box, Cell, fresh

TIME_SLACK_S = 1e-6
"""Rounding by which a wait may end early."""


class Machine:
    """Runs one program.

    Args:
        time_s: the emulated time.
        say: takes messages.
        drive: the arm; None in the submit interpreter.
        command: what CWRITE to $CMD does; None in the robot interpreter.

    Attributes:
        state: member of PRO_STATE.
        frame_changes: how often $TOOL or $BASE changed while a motion was planned. Blocks keep
            their frames here; a real controller was seen to plan them anew.
    """

    def __init__(
        self,
        memory: Memory,
        terminals: Terminals,
        options: Options,
        time_s: Callable[[], float],
        say: Callable[[Message], None],
        drive: Drive | None = None,
        command: Callable[[str], bool] | None = None,
    ) -> None:
        self.terminals = terminals
        self.state = "P_FREE"
        self.frame_changes = 0
        self._memory = memory
        self._options = options
        self._time_s = time_s
        self._say = say
        self._drive = drive
        self._command = command
        self._frames: list[Frame] = []
        self._levels = [Level()]
        self._interrupts = Interrupts(options)
        self._waiting = Waiting()
        self._cyclic: dict[int, tuple[Fn, Frame]] = {}
        self._cycle = 0
        self._looked = -1
        self._statements = options.robot_statements if drive else options.submit_statements
        self.looks_early = drive is not None and options.looks_early

    # For whoever owns it.

    def load(self, code: Code) -> None:
        """Put the program's pointer on the first line of a program."""
        self.unload()
        self._frames = [Frame(code, self, [Cell(fresh(kind)) for kind in code.kinds])]
        self.state = "P_RESET"

    def unload(self) -> None:
        """Have no program."""
        self._frames = []
        self._levels = [Level()]
        self._interrupts.clear()
        self._waiting.clear()
        self._cyclic.clear()
        self.state = "P_FREE"

    @property
    def place(self) -> tuple[str, str, int]:
        """Module, file and line of the advance pointer; line 0 without a program."""
        if not self._frames:
            return "", "", 0
        frame = self._frames[-1]
        at = frame.code.places[min(frame.pc, len(frame.code.places) - 1)]
        return frame.code.module, at.file, at.line

    @property
    def interrupted(self) -> bool:
        """Whether an interrupt's or trigger's routine runs."""
        return len(self._levels) > 1

    def cycle(self) -> None:
        """The next interpolation cycle: look at conditions, then run on."""
        self._cycle += 1
        if self.state != "P_ACTIVE":
            return
        if not self.looks_early:
            self.look()
        if self.state == "P_ACTIVE":
            self._run(self._statements)

    def look(self) -> None:
        """Look at cyclic flags and interrupts, and begin what has fired."""
        try:
            self._refresh()
            self._interrupts.look()
            self._begin()
        except KrlFaultError as error:
            self._stop(error)

    def fire(self, action: Action, frame: Frame, priority: int) -> None:
        """A trigger has fired: run what it does, now if nothing more urgent runs."""
        due = Due(AUTOMATIC if priority < 0 else priority, action, frame)
        self._waiting.add(due)
        if self.state != "P_ACTIVE":
            return
        try:
            began = self._begin()
        except KrlFaultError as error:
            self._stop(error)
            return
        if began:
            self._run(self._options.trigger_statements, len(self._levels) - 1)

    def finished(self, tag: int) -> None:
        """The main run has passed a block."""
        for level in self._levels:
            level.tags.discard(tag)

    def _refresh(self) -> None:
        flags = self._memory.get("$CYCFLAG") if self._cyclic else []
        for number, (fn, frame) in self._cyclic.items():
            flags[number - 1] = fn(frame)

    def _begin(self) -> bool:
        """Begin what is pending; whether a routine was begun."""
        while True:
            above = self._levels[-1].priority
            interrupt = self._interrupts.most_urgent(above)
            due = self._waiting.take(above if interrupt is None else interrupt.priority)
            if due is None and interrupt is not None:
                interrupt.pending = False
                due = Due(interrupt.priority, interrupt.action, interrupt.frame, interrupt)
            if due is None:
                return False
            action = due.action
            if action.code is None:
                if action.perform is not None:
                    action.perform(due.frame)
                continue
            if due.interrupt is not None and self._drive is not None:
                self._drive.interrupted()
            boxes = action.arguments(due.frame) if action.arguments else []
            self._levels.append(Level(due.priority, len(self._frames), due.interrupt))
            self.call(action.code, boxes, -1)
            return True

    # The heart.

    def _run(self, statements: int, level: int = 0) -> None:
        """Run instructions until one has to wait, or so many are done, or a level has ended."""
        for _ in range(statements):
            if self.state != "P_ACTIVE" or len(self._levels) <= level:
                return
            tags = self._levels[-1].tags
            if tags and self._drive is not None and len(tags) > self._drive.advance:
                return
            frame = self._frames[-1]
            pc = frame.pc
            frame.pc = pc + 1
            try:
                pause = frame.code.instructions[pc](frame)
            except KrlFaultError as error:
                self._fault(frame, pc, error)
                continue
            if pause is not None:
                if pause is Pause.AGAIN:
                    frame.pc = pc
                return

    def _fault(self, frame: Frame, pc: int, error: KrlFaultError) -> None:
        code = frame.code
        number = code.numbers[pc]
        if frame.guarded == number:
            frame.guarded = -1
            frame.pc = next(
                (i for i in range(pc + 1, len(code.numbers)) if code.numbers[i] != number), pc + 1
            )
            self._note_error(error, code, code.places[pc].line)
            return
        # The start key tries the same line again.
        frame.pc = code.numbers.index(number)
        self._stop(error)

    def _note_error(self, error: KrlFaultError, code: Code, line: int) -> None:
        value = {"NUMBER": error.number, "MODULE": code.module[:24], "LINE_NR": line}
        self._memory.put("$ERR", value | {"INT_PRIO": 0})

    def clear_error(self) -> None:
        """ERR_CLEAR."""
        value = {"NUMBER": 0, "MODULE": "", "LINE_NR": 0, "INT_PRIO": 0}
        self._memory.put("$ERR", value)

    def _stop(self, error: KrlFaultError) -> None:
        """A run-time error: the program stops, the arm on its path."""
        _, file, line = self.place
        self.state = "P_STOP"
        self._say(Message(self._time_s(), str(error), stops=True, file=file, line=line))
        if self._drive is not None:
            self._drive.stop()

    # What instructions ask for.

    @property
    def ahead(self) -> bool:
        """Whether the main run is not yet where the advance run is."""
        return bool(self._levels[-1].tags)

    def note_frame(self) -> None:
        """$TOOL or $BASE has got another value."""
        self.frame_changes += self.ahead

    def call(self, code: Code, boxes: list[Box], temp: int) -> None:
        """Go into a routine."""
        if len(self._frames) >= self._options.call_depth:
            if self.interrupted and len(self._frames) == self._levels[-1].base:
                self._levels.pop()
            depth = self._options.call_depth
            raise KrlFaultError(WRONG_STRUCTURE, f"more than {depth} routines in one another")
        cells = boxes + [Cell(fresh(kind)) for kind in code.kinds[len(boxes) :]]
        self._frames.append(Frame(code, self, cells, temp))

    def leave(self, value: Any) -> Pause | None:
        """RETURN, END and ENDFCT."""
        frame, level = self._frames[-1], self._levels[-1]
        last = len(self._frames) == 1 or (level.moves and level.base == len(self._frames) - 1)
        if level.tags and (last or self._interrupts.has_own(frame)):
            return Pause.AGAIN
        self._frames.pop()
        self._interrupts.forget(frame)
        if self.interrupted and level.base == len(self._frames):
            self._end_level(level)
        elif not self._frames:
            self.state = "P_END"
        elif frame.result >= 0:
            self._frames[-1].temps[frame.result] = value
        return None

    def _end_level(self, level: Level) -> None:
        self._levels.pop()
        self._levels[-1].tags |= level.tags
        if level.moves and self._drive is not None:
            self._drive.return_to_path()
        if level.braked and self._drive is not None:
            self._drive.release()
        self._begin()

    def halt(self) -> Pause:
        """HALT."""
        self.state = "P_STOP"
        return Pause.CYCLE

    def may_look(self) -> bool:
        """Whether a WAIT FOR may look: one passes in a cycle."""
        return self._looked != self._cycle

    def looked(self) -> None:
        """A WAIT FOR has passed."""
        self._looked = self._cycle

    def wait_until(self, frame: Frame, duration_s: Fn) -> Pause | None:
        """WAIT SEC."""
        now = self._time_s()
        if frame.memory is None:
            frame.memory = now + duration_s(frame)
        if frame.memory > now + TIME_SLACK_S:
            return Pause.AGAIN
        frame.memory = None
        return None

    def keep_cyclic(self, number: int, fn: Fn, frame: Frame) -> None:
        """$CYCFLAG[number]=expression."""
        self._memory.get("$CYCFLAG")[number - 1] = fn(frame)
        self._cyclic[number] = (fn, frame)

    def declare_interrupt(
        self, priority: int, condition: Fn, action: Action, is_global: bool, frame: Frame
    ) -> Pause | None:
        """INTERRUPT DECL."""
        if self._interrupts.is_live(priority) and self.ahead:
            return Pause.AGAIN
        self._interrupts.declare(Interrupt(priority, condition, action, is_global, frame))
        return None

    def switch_interrupt(self, mode: str, priority: int | None) -> None:
        """INTERRUPT ON .."""
        self._interrupts.switch(mode, priority)

    def add_trigger(self, wish: Wish, frame: Frame) -> None:
        """TRIGGER, for the next motion."""
        self._arm("TRIGGER").add_trigger(wish, frame)

    def move(self, order: Order) -> None:
        """Plan a motion."""
        drive = self._arm(order.kind)
        level = self._levels[-1]
        holders = (one for one in reversed(self._levels) if one.braked or one.moves)
        holder = next(holders, None)
        if holder is not None and not holder.moves:
            drive.leave_path()
            level.moves = True
        level.tags.add(drive.move(order))

    def brake(self, fast: bool) -> Pause | None:
        """BRAKE: goes on as the arm stands."""
        drive = self._arm("BRAKE")
        if not self.interrupted:
            raise KrlFaultError(NOT_ALLOWED, "BRAKE stands only in an interrupt routine")
        level = self._levels[-1]
        if level.moves:
            # What it brakes then is its own: that ends first (guess).
            return Pause.AGAIN if level.tags else None
        level.braked = True
        return None if drive.brake(fast) else Pause.AGAIN

    def resume(self) -> Pause | None:
        """RESUME: back below the call in the routine that declared the interrupt."""
        drive = self._arm("RESUME")
        level = self._levels[-1]
        if level.interrupt is None:
            raise KrlFaultError(NOT_ALLOWED, "RESUME stands only in an interrupt routine")
        frame = level.interrupt.frame
        index = self._frames.index(frame) if frame in self._frames else -1
        if index < 0 or index + 1 >= level.base:
            message = (
                "impermissible program structure: RESUME, and the advance run is not in a routine "
                "called by the one that declared the interrupt"
            )
            raise KrlFaultError(WRONG_STRUCTURE, message)
        if not drive.brake(fast=False):
            return Pause.AGAIN
        drive.discard()
        for one in self._levels:
            if one.moves and one.base > index:
                drive.drop_path()
        for ended in self._frames[index + 1 :]:
            self._interrupts.forget(ended)
        del self._frames[index + 1 :]
        self._levels = [one for one in self._levels if one.base <= index]
        for one in reversed(self._levels):
            one.tags.clear()
            if one.moves:
                # What this one has set aside is still to come.
                break
        if any(one.braked for one in self._levels):
            drive.brake(fast=False)
        self._begin()
        return None

    def command(self, text: str) -> bool:
        """CWRITE to $CMD; an interpreter cannot stop itself."""
        return self._command is not None and self._command(text)

    def robot_stop(self, stops: bool) -> bool:
        """ROB_STOP and ROB_STOP_RELEASE."""
        return self.command("ROB_STOP" if stops else "ROB_STOP_RELEASE")

    def _arm(self, what: str) -> Drive:
        if self._drive is None:
            raise KrlFaultError(NOT_ALLOWED, f"{what}: the submit interpreter has no arm")
        return self._drive
