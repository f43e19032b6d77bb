"""The errors of sphmctl: one base, one subclass for each thing the caller can do about it.

The exit codes are the contract of the command line.
"""

from __future__ import annotations

from dataclasses import dataclass


class SphmctlError(Exception):
    """Something went wrong that one sentence can explain.

    Args:
        message: one sentence naming value, limit and unit, and what would be right.
        where: the place: file and line, device, or point of the path; may be empty.
    """

    exit_code = 1

    def __init__(self, message: str, where: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.where = where

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


class UsageError(SphmctlError):
    """The command was called in a way that has no meaning."""

    exit_code = 2


class InvalidError(SphmctlError):
    """A file or a value is not what it should be."""

    exit_code = 3


@dataclass(frozen=True)
class Problem:
    """One reason why a path cannot be driven, with its place.

    Attributes:
        where: the move and the distance along it, in words.
        joint: the joint's name ("A1" to "A6", "theta7" to "theta9"), "tool", or "" for none.
        value: what it would have to be; degrees, mm or their rates, as `message` says.
        limit: what it may be, same unit.
        message: the sentence.
    """

    where: str
    joint: str
    value: float | None
    limit: float | None
    message: str


class InfeasibleError(SphmctlError):
    """The robot cannot do it: reach, range, speed, acceleration or collision."""

    exit_code = 4

    def __init__(self, message: str, where: str = "", problems: tuple[Problem, ...] = ()) -> None:
        super().__init__(message, where)
        self.problems = problems


class DeviceError(SphmctlError):
    """A device is missing, deaf, or refuses."""

    exit_code = 5


class FaultError(SphmctlError):
    """A motion was ended by a fault, or by another client of the device."""

    exit_code = 6
