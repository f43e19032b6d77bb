"""The controller's state outside of programs: what operator and safety have set."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Panel:
    """Names as the system variables.

    Attributes:
        alarm_stop: `$ALARM_STOP`: TRUE when all is well (kroshu/kuka-external-control-sdk,
            status.src); `user_saf` likewise: the gate is closed.
        stop_message: `$STOPMESS`.
        path_stop: ROB_STOP of the submit interpreter keeps the arm from moving.
    """

    model_name: str = "#KR6R900 C4SR FLR 230"
    robot_name: str = "KR6R900 sixx"
    serial_number: int = 0
    alarm_stop: bool = True
    user_saf: bool = True
    stop_message: bool = False
    path_stop: bool = False

    @property
    def safe(self) -> bool:
        """Whether neither emergency stop nor gate holds the arm."""
        return self.alarm_stop and self.user_saf
