"""What stops a KRL program at run time. Numbers are the emulator's own: KUKA's are not public."""

from __future__ import annotations

from dataclasses import dataclass

VALUE_INVALID = 1
OUT_OF_RANGE = 2
WRONG_STRUCTURE = 3
NOT_ALLOWED = 4
MOTION_REFUSED = 5
RAISED = 6


class KrlFaultError(Exception):
    """A run-time error of the program; `number` is what $ERR.NUMBER shows."""

    def __init__(self, number: int, message: str) -> None:
        super().__init__(message)
        self.number = number


def invalid(what: str) -> KrlFaultError:
    """A variable or component without a value was read."""
    return KrlFaultError(VALUE_INVALID, f"value invalid: {what} was never set")


@dataclass(frozen=True)
class Message:
    """A line of the controller's message window.

    Attributes:
        time_s: the emulated time.
        stops: whether the program stopped by it.
        file, line: where; line 0 where it is about no line.
    """

    time_s: float
    text: str
    stops: bool = False
    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}" if self.line else self.text
