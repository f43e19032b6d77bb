"""The keys of both interpreters as a server on the controller presses them for its clients.

Not the operator's hands (`krc_hands`): a key here may be refused, and says so.
"""

from __future__ import annotations

from sphmctl.emulators.interpreter import Interpreters
from sphmctl.emulators.motion import Mover

SUBMIT, ROBOT = 0, 1
"""Numbers of the interpreters, as `$CMD` counts them."""


class Keys:
    """Program control of one controller."""

    def __init__(self, krc: Interpreters, arm: Mover) -> None:
        self._krc = krc
        self._arm = arm

    def press(self, command: str, interpreter: int) -> bool:
        """Press a key; False when it does nothing.

        Args:
            command: "reset", "start", "stop" or "cancel". A running program refuses "reset" and
                "cancel", and the robot's "start" needs drives and no stop message.
            interpreter: `SUBMIT` or `ROBOT`.
        """
        if interpreter == SUBMIT:
            return self._krc.press_submit(command)
        if interpreter != ROBOT:
            return False
        state = self._krc.state
        if command == "start":
            return self._krc.start()
        if command == "stop":
            self._krc.stop()
            return state == "P_ACTIVE"
        if state in ("P_FREE", "P_ACTIVE") or self._arm.moving:
            return False
        if command == "reset":
            self._krc.reset()
        else:
            self._krc.cancel()
        return True

    def select(self, path: str, *, force: bool = False) -> bool:
        """Select a program by its file; `force` cancels a selected one that stands."""
        name = path.replace("\\", "/").rpartition("/")[2].upper().removesuffix(".SRC")
        if not self._krc.selectable(name):
            return False
        if self._krc.state != "P_FREE" and not (force and self.press("cancel", ROBOT)):
            return False
        self._krc.select(name)
        return True

    def confirm_messages(self) -> bool:
        """Acknowledge every message; what still has its cause stays."""
        self._krc.confirm()
        return True
