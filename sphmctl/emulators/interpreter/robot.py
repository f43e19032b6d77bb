"""Both interpreters of the emulated KRC4 with the operator's keys for them.

Whoever owns this advances the mover by 4 ms, hands over what it told by `react`, and calls
`cycle` every 12 ms. Between two cycles the variable server may read and write `memory`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from sphmctl.emulators.interpreter.code import Code
from sphmctl.emulators.interpreter.data_lists import (
    load_lists,
    load_predefined,
    load_programs,
)
from sphmctl.emulators.interpreter.drive import Drive
from sphmctl.emulators.interpreter.faults import Message
from sphmctl.emulators.interpreter.machine import Machine
from sphmctl.emulators.interpreter.memory import Memory
from sphmctl.emulators.interpreter.options import Options
from sphmctl.emulators.interpreter.panel import Panel
from sphmctl.emulators.interpreter.signals import Terminals
from sphmctl.emulators.interpreter.system import Mover, System
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.motion.blocks import Event, Kind

SUBMIT = "SPS"

MESSAGES_LIMIT = 1000
"""Messages that are kept; the older ones are forgotten."""

CONFIRMABLE = "the emergency stop or the gate is open, the message cannot be confirmed"


class Interpreters:
    """Robot and submit interpreter.

    Args:
        modules: programs and data lists; a program SPS is the submit interpreter's.
        time_s: the emulated time.
        timer_ms: $ROB_TIMER.

    Attributes:
        memory: all variables, also for the variable server.
        terminals: inputs and outputs.
        messages: the message window.
        exact_stops: blends that became exact stops.

    Raises:
        KrlError: a module cannot be run; with file and line.
    """

    def __init__(
        self,
        modules: Sequence[n.Module],
        mover: Mover,
        panel: Panel,
        time_s: Callable[[], float],
        timer_ms: Callable[[], int],
        options: Options | None = None,
    ) -> None:
        options = Options() if options is None else options
        self.memory = Memory()
        self.terminals = Terminals(time_s)
        self.panel = panel
        self.messages: list[Message] = []
        self.exact_stops = 0
        self.name = ""
        self._steps = 0
        self._mover = mover
        self._time_s = time_s
        load_predefined(self.memory)
        self._system = System(self.memory, mover, panel, self.terminals, timer_ms)
        self._drive = Drive(mover, self.memory, options.trigger_value)
        self._robot = Machine(
            self.memory, self.terminals, options, time_s, self.say, drive=self._drive
        )
        self._submit = Submit(
            Machine(self.memory, self.terminals, options, time_s, self.say, command=self._command)
        )
        self._system.bind_programs(self, self._submit, self.stop)
        lists = [module for module in modules if isinstance(module, n.DataList)]
        programs = [module for module in modules if isinstance(module, n.Program)]
        load_lists(self.memory, self.terminals, lists)
        load_programs(self.memory, self.terminals, programs, options)
        self.start_submit()

    # Time.

    def react(self, events: Iterable[Event]) -> None:
        """What the mover told; every 4 ms, and before `cycle` where that is due, too."""
        self._steps += 1
        if self._robot.looks_early and self._steps == 1 and self.state == "P_ACTIVE":
            self._robot.look()
        for event in events:
            if event.kind is Kind.FINISHED:
                self._robot.finished(event.tag)
            elif event.kind is Kind.TRIGGER:
                armed = self._drive.fired(event.tag)
                if armed is not None:
                    self._robot.fire(*armed)
            elif event.kind is Kind.BCO_REACHED:
                self._bco_reached()
            elif event.kind is Kind.AXIS_LIMIT and self.state == "P_ACTIVE":
                self._halt(f"software limit: {event.detail}")
            elif event.kind is Kind.EXACT_STOP:
                self._exact_stop(event)

    def cycle(self) -> None:
        """The next 12 ms: lines, submit interpreter, robot interpreter."""
        self._steps = 0
        self.terminals.cycle()
        self._submit.machine.cycle()
        self._robot.cycle()

    def _bco_reached(self) -> None:
        self.say(Message(self._time_s(), "programmed path reached (BCO)"))
        if self._mover.held and self.state == "P_ACTIVE":
            self._robot.state = "P_STOP"

    def _exact_stop(self, event: Event) -> None:
        self.exact_stops += 1
        text = f"approximate positioning not possible: {event.detail}"
        if self.memory.get("$STOPNOAPROX") is True:
            self._halt(text)
        elif self._mover.mode in ("T1", "T2"):
            self.say(Message(self._time_s(), text))

    def _halt(self, text: str) -> None:
        self._robot.state = "P_STOP"
        self._mover.stop(2)
        self.say(Message(self._time_s(), text, stops=True))

    # What it says.

    @property
    def state(self) -> str:
        """$PRO_STATE1."""
        return self._robot.state

    @property
    def place(self) -> tuple[str, str, int]:
        """Module, file and line of the advance pointer."""
        return self._robot.place

    @property
    def frame_changes(self) -> int:
        """How often $TOOL or $BASE changed while a motion was planned."""
        return self._robot.frame_changes

    @property
    def submit_state(self) -> str:
        """$PRO_STATE0."""
        return self._submit.state

    def say(self, message: Message) -> None:
        """Put a message into the window."""
        self.messages.append(message)
        del self.messages[:-MESSAGES_LIMIT]
        if message.stops:
            self.panel.stop_message = True

    # Keys.

    def selectable(self, name: str) -> bool:
        """Whether there is a program of that name: no function, and without parameters."""
        return self._program(name) is not None

    def _program(self, name: str) -> Code | None:
        code = self.memory.globals.routines.get(name.upper())
        if code is None or code.result is not None or code.parameters:
            return None
        if code.name != code.module:
            return None
        return code

    def select(self, name: str) -> None:
        """Select a program; its first motion is a BCO run.

        Raises:
            KeyError: it is not selectable.
        """
        code = self._program(name)
        if code is None:
            raise KeyError(f"there is no program {name}")
        self._mover.select()
        self._drive.forget()
        self._robot.load(code)
        self.name = code.name

    def reset(self) -> None:
        """Back to the first line; nothing without a program."""
        if self.name:
            self.select(self.name)

    def cancel(self) -> None:
        """Deselect."""
        self._mover.select()
        self._drive.forget()
        self._robot.unload()
        self.name = ""

    def start(self) -> bool:
        """The start key, or the start signal; False where it does nothing.

        Interrupts are looked at before the arm moves.
        """
        if self.state not in ("P_RESET", "P_STOP") or not self._system.could_start():
            return False
        if self.state == "P_RESET" and self._mover.moving:
            # The program before has left it in motion; it can be planned from where it stands.
            return False
        self._robot.state = "P_ACTIVE"
        self._robot.cycle()
        if self.state != "P_ACTIVE":
            return True
        return self._mover.start()

    def stop(self, category: int = 2, text: str = "") -> None:
        """The stop key; with a text a stop of the safety or of the operation mode."""
        if self.state == "P_ACTIVE":
            self._robot.state = "P_STOP"
        self._mover.stop(category)
        if text:
            self.say(Message(self._time_s(), text, stops=True))

    def confirm(self) -> bool:
        """Confirm all messages; False while their cause is there."""
        if not self.panel.safe:
            self.say(Message(self._time_s(), CONFIRMABLE))
            return False
        self.panel.stop_message = False
        return True

    def start_submit(self) -> None:
        """Select and start SPS, where there is one."""
        code = self.memory.globals.routines.get(SUBMIT)
        if code is not None:
            self._submit.machine.load(code)
            self._submit.machine.state = "P_ACTIVE"
            self._submit.name = SUBMIT

    def stop_submit(self) -> None:
        """Stop the submit interpreter."""
        if self.submit_state == "P_ACTIVE":
            self._submit.machine.state = "P_STOP"

    def press_submit(self, command: str) -> bool:
        """Keys "start", "stop", "reset" and "cancel" of the submit interpreter; False: refused."""
        machine = self._submit.machine
        if machine.state == "P_FREE":
            return False
        if command == "start":
            machine.state = "P_ACTIVE"
        elif command == "stop":
            self.stop_submit()
        elif command == "cancel":
            machine.unload()
            self._submit.name = ""
        else:
            self.start_submit()
            machine.state = "P_RESET"
        return True

    def _command(self, text: str) -> bool:
        """CWRITE to $CMD by the submit interpreter."""
        words = text.upper().split()
        verb = words[0] if words else ""
        if verb == "RUN" and len(words) > 1:
            return self._run(words[1])
        if verb in ("STOP", "RESET", "CANCEL") and words[1:] == ["1"]:
            {"STOP": self.stop, "RESET": self.reset, "CANCEL": self.cancel}[verb]()
            return True
        if verb in ("ROB_STOP", "ROB_STOP_RELEASE"):
            self.panel.path_stop = verb == "ROB_STOP"
            if self.panel.path_stop:
                self.stop()
            return True
        return False

    def _run(self, path: str) -> bool:
        """`RUN /R1/NAME()` selects, and in #EX also starts (guess)."""
        name = path.rsplit("/", 1)[-1].split("(")[0]
        if self.state not in ("P_FREE", "P_END") or name not in self.memory.globals.routines:
            return False
        self.select(name)
        return self._mover.mode != "EX" or self.start()


class Submit:
    """The submit interpreter as the system variables see it."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.name = ""

    @property
    def state(self) -> str:
        """$PRO_STATE0."""
        return self.machine.state

    @property
    def place(self) -> tuple[str, str, int]:
        """Module, file and line."""
        return self.machine.place
