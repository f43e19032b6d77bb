"""Executes KRL: what a KRC4's robot and submit interpreter do with parsed modules.

Not responsible for parsing (`emulators.krl`), motion (`emulators.motion`) or the variable server.
`Interpreters` is the whole of it. The order: `data_lists` fills `memory`, `compiler` (with
`expressions`, `calls`, `functions`, `motions`) makes closures, `machine` runs them, `events` holds
interrupts, `drive` feeds the mover, `system` binds the system variables.
"""

from sphmctl.emulators.interpreter.data_lists import submit_program
from sphmctl.emulators.interpreter.faults import Message
from sphmctl.emulators.interpreter.memory import Memory
from sphmctl.emulators.interpreter.options import CYCLE_S, Options
from sphmctl.emulators.interpreter.panel import Panel
from sphmctl.emulators.interpreter.robot import Interpreters

__all__ = ["CYCLE_S", "Interpreters", "Memory", "Message", "Options", "Panel", "submit_program"]
