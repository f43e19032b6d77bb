"""What an operator sees of the emulated controller, and sets by hand, as attributes."""

from __future__ import annotations

from collections.abc import Callable

from sphmctl.emulators.interpreter import Interpreters
from sphmctl.emulators.interpreter import Panel as Safety
from sphmctl.emulators.motion import Mover


class Panel:
    """Safety, drives, mode and program state; names as the system variables."""

    def __init__(self, krc: Interpreters, arm: Mover, safety: Safety) -> None:
        self._krc = krc
        self._arm = arm
        self._safety = safety

    @property
    def alarm_stop(self) -> bool:
        """`$ALARM_STOP`: TRUE when the emergency stop is released."""
        return self._safety.alarm_stop

    @alarm_stop.setter
    def alarm_stop(self, well: bool) -> None:
        self._safety.alarm_stop = well

    @property
    def user_saf(self) -> bool:
        """`$USER_SAF`: TRUE when the gate is closed."""
        return self._safety.user_saf

    @user_saf.setter
    def user_saf(self, well: bool) -> None:
        self._safety.user_saf = well

    @property
    def stop_message(self) -> bool:
        """`$STOPMESS`."""
        return self._safety.stop_message

    @stop_message.setter
    def stop_message(self, there: bool) -> None:
        self._safety.stop_message = there

    @property
    def drives(self) -> bool:
        """`$PERI_RDY`."""
        return self._arm.drives

    @drives.setter
    def drives(self, on: bool) -> None:
        if on:
            self._arm.drives_on()
        else:
            self._arm.drives_off()
            # A program does not stay active without drives.
            self._krc.stop()

    @property
    def mode(self) -> str:
        """`$MODE_OP`; to set it here turns the switch and stops nothing."""
        return self._arm.mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self._arm.mode = mode

    @property
    def program(self) -> str:
        """`$PRO_NAME1[]`."""
        return self._krc.name

    @property
    def program_state(self) -> str:
        """`$PRO_STATE1`; to set it presses stop, start, reset or deselect."""
        return self._krc.state

    @program_state.setter
    def program_state(self, state: str) -> None:
        keys: dict[str, Callable[[], object]] = {
            "P_STOP": self._krc.stop,
            "P_ACTIVE": self._krc.start,
            "P_RESET": self._krc.reset,
            "P_FREE": self._krc.cancel,
        }
        if state not in keys:
            raise ValueError(f"no key leads to {state!r}; one of {', '.join(keys)}")
        keys[state]()
