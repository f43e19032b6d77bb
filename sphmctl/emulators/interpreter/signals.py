"""Inputs, outputs, flags and timers, and SIGNAL names on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from sphmctl.emulators.interpreter.memory import Names, Variable
from sphmctl.emulators.interpreter.values import Cell
from sphmctl.emulators.krl import nodes as n
from sphmctl.emulators.krl.build import fail
from sphmctl.emulators.krl_text import Bool, Int, Real, Type

TIMERS = 64

MOST_BITS = 32
"""Of one SIGNAL, since it is read as an INT (SI, "SIGNAL")."""

ALWAYS_TRUE = 1025
"""Number of the input that no wire changes ($machine.dat: the signals that are not wired are on it;
$IN[1026] is always FALSE)."""

ANALOG_LIMIT = 1.0
"""$ANOUT goes from -1 to 1; what is beyond is clamped (KUKA, "System Variables", $ANOUT)."""


class Lines(list[Any]):
    """A list that tells of changes; `limit` clamps numbers."""

    def __init__(self, size: int, value: Any, limit: float | None = None) -> None:
        super().__init__([value] * size)
        self.changed: Callable[[int, Any], None] = lambda _number, _value: None
        self._limit = limit

    def __setitem__(self, index: Any, value: Any) -> None:
        if self._limit is not None:
            value = max(-self._limit, min(self._limit, value))
        before = self[index]
        super().__setitem__(index, value)
        if before != value:
            self.changed(index + 1, value)


class Timers(list[Any]):
    """$TIMER: milliseconds that run while $TIMER_STOP is FALSE."""

    def __init__(self, time_s: Callable[[], float]) -> None:
        super().__init__([0] * TIMERS)
        self._time_s = time_s
        self._since: list[float | None] = [None] * TIMERS

    def __getitem__(self, index: Any) -> Any:
        since = self._since[index]
        start = super().__getitem__(index)
        return start if since is None else start + int((self._time_s() - since) * 1000.0 + 1e-6)

    def __setitem__(self, index: Any, value: Any) -> None:
        super().__setitem__(index, value)
        if self._since[index] is not None:
            self._since[index] = self._time_s()

    def __iter__(self) -> Iterator[Any]:
        return (self[index] for index in range(TIMERS))

    def run(self, number: int, stopped: bool) -> None:
        """$TIMER_STOP[number] was written."""
        index = number - 1
        now = self[index]
        super().__setitem__(index, now)
        self._since[index] = None if stopped else self._time_s()


class Signal:
    """One or several bits of inputs or outputs, or an analog one."""

    def __init__(self, lines: list[Any], first: int, last: int) -> None:
        self._lines = lines
        self._first = first
        self._last = last

    @property
    def value(self) -> Any:
        """The level, or the number that several bits make, the first one the lowest."""
        if self._first == self._last:
            return self._lines[self._first]
        bits = self._lines[self._first : self._last + 1]
        number = sum(bool(bit) << place for place, bit in enumerate(bits))
        return number - (1 << MOST_BITS) if number >> (MOST_BITS - 1) else number

    @value.setter
    def value(self, value: Any) -> None:
        if self._first == self._last:
            self._lines[self._first] = value
            return
        for place in range(self._last - self._first + 1):
            self._lines[self._first + place] = bool(value >> place & 1)


class Terminals:
    """What the controller is wired to.

    Attributes:
        inputs, outputs: $IN and $OUT; a controller sets the inputs and hears `outputs.changed`.
    """

    def __init__(self, time_s: Callable[[], float]) -> None:
        self.inputs = Lines(4096, False)
        self.inputs[ALWAYS_TRUE - 1] = True
        self.outputs = Lines(4096, False)
        self.analog_inputs = Lines(32, 0.0)
        self.analog_outputs = Lines(32, 0.0, ANALOG_LIMIT)
        self.timers = Timers(time_s)
        self.timer_stop = Lines(TIMERS, True)
        self.timer_stop.changed = self.timers.run
        self._pulses: list[tuple[float, Any, bool]] = []
        self._time_s = time_s

    def declare(self, names: Names, entry: n.Signal) -> None:
        """Make a SIGNAL known."""
        if entry.first is None:
            names.variables[entry.name] = Variable(
                entry.name, Bool(), Cell(False), names.level, writable=False
            )
            return
        base = entry.first.base.name if isinstance(entry.first.base, n.Name) else ""
        first = _number(entry.first)
        last = first if entry.last is None else _number(entry.last)
        if base not in self._lists or not 0 <= first <= last < first + MOST_BITS:
            raise fail(entry.at, "signal", f"SIGNAL {entry.name} names inputs or outputs")
        kind: Type = Real() if base.startswith("$AN") else Bool()
        box = Signal(self._lists[base], first, last)
        writable = base in ("$OUT", "$ANOUT")
        kind = kind if entry.last is None else Int()
        names.variables[entry.name] = Variable(entry.name, kind, box, names.level, writable)

    @property
    def _lists(self) -> dict[str, list[Any]]:
        return {
            "$IN": self.inputs,
            "$OUT": self.outputs,
            "$ANIN": self.analog_inputs,
            "$ANOUT": self.analog_outputs,
        }

    def pulse(self, box: Any, level: bool, duration_s: float) -> None:
        """PULSE: set an output for a while."""
        box.value = level
        self._pulses = [entry for entry in self._pulses if entry[1] is not box]
        self._pulses.append((self._time_s() + duration_s, box, not level))

    def cycle(self) -> None:
        """End the pulses that are over."""
        if not self._pulses:
            return
        now = self._time_s() + 1e-9
        for _, box, level in [entry for entry in self._pulses if entry[0] <= now]:
            box.value = level
        self._pulses = [entry for entry in self._pulses if entry[0] > now]


def _number(index: n.Index) -> int:
    node = index.indices[0]
    if not isinstance(node, n.IntLiteral):
        raise fail(index.at, "signal", "a SIGNAL names its inputs or outputs by numbers")
    return node.value - 1
