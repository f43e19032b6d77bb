"""The board between host and servos: device 200 on the same bus, in transactions of its own.

It carries the lines to the controller, and falls into a safe state of its own when the host is
silent. Process control, not a safety function. Knows no servo and no plan.
"""

from __future__ import annotations

import asyncio
import struct
from dataclasses import dataclass

from sphmctl.drivers.device_clock import DeviceClock
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.servo_bus import ATTEMPTS, STATUS_OVERHEAD_BYTES, ServoBus
from sphmctl.errors import DeviceError
from sphmctl.wire import board_table as table
from sphmctl.wire import dxl_instructions

WATCHDOG_UNITS = 25
"""Bus Watchdog, in 20 ms: 500 ms as the servos' own, so that a stall of a busy host, 0.3 s seen,
trips neither. The arm does not wait for it: the KRL program holds after 120 ms without a beat."""

RESONATOR_DRIFT = 5e-3
"""An Arduino Mega's ATmega2560 runs on a ceramic resonator of 0.5 % (Arduino, Mega 2560 rev 3
schematic: CSTCE16M0V53)."""

CLOCK_SPAN_US = 1 << 32
EDGE_SPAN = 1 << 16
"""The board counts edges in 16 bits."""

STAMPS = 4
"""The board keeps the times of so many edges of "knot"."""

HINDRANCE_TEXTS = {
    table.HINDRANCES_NOT_ARMED: "not armed",
    table.HINDRANCES_NOT_ASKED: "not asked for",
    table.HINDRANCES_NO_WATCHDOG: "no watchdog",
    table.HINDRANCES_SAFE_STATE: "safe state",
    table.HINDRANCES_STOP: "emergency stop",
    table.HINDRANCES_SERVO: "servo",
}

STATE_ITEMS = tuple(item for item in table.ITEMS if item.address >= table.OUTPUTS.address)
STATE_BYTES = table.TABLE_SIZE - table.OUTPUTS.address
"""Outputs, inputs, times and counters stand at the table's end without a gap: one read."""

COUNTERS = tuple(item for item in STATE_ITEMS if item.address >= table.HOST_CRC_ERRORS.address)
LONGEST = next(item for item in COUNTERS if item.access == "RW")
"""How long the board's loop took at most: the only counter that can be set back, at arming."""

UNITS = {"us": "_us", "s": "_s", "bytes": "_bytes"}
ERROR_COUNTERS = (
    table.HOST_CRC_ERRORS,
    table.HOST_TORN_FRAMES,
    table.HOST_OVERRUNS,
    table.BUS_CRC_ERRORS,
    table.BUS_TORN_FRAMES,
    table.BUS_OVERRUNS,
    table.BUS_TIMEOUTS,
)


@dataclass(frozen=True)
class Identity:
    """What the board says it is."""

    model: int
    firmware: int
    build_hash: int
    protocol: int


@dataclass(frozen=True)
class BoardState:
    """One read of the board.

    Attributes:
        hindrances: HINDRANCES_ bits: why "wrist ok" is off; 0 while it is on.
        alert_id: the servo that reported an error; 255 for none.
        inputs: debounced INPUTS_ bits.
        knot_edges: edges of "knot" since the board's reset, modulo `EDGE_SPAN`.
        knot_stamps_us: the board's times of the newest ones, by number modulo `STAMPS`.
        counters: by name, as since the board's reset.
    """

    hindrances: int
    alert_id: int
    inputs: int
    knot_edges: int
    knot_stamps_us: tuple[int, ...]
    counters: dict[str, int]

    @property
    def stop_pressed(self) -> bool:
        """Whether the emergency stop's contact is open now."""
        return bool(self.inputs & table.INPUTS_STOP)

    @property
    def errors(self) -> dict[str, int]:
        """The counters that should all be 0."""
        return {name: self.counters[name] for name in map(counter_name, ERROR_COUNTERS)}

    def edges_since(self, before: BoardState) -> int | None:
        """How many edges of "knot" came since an earlier read; None: the board was reset."""
        now, then = self.counters, before.counters
        resets, uptime = counter_name(table.RESETS), counter_name(table.UPTIME)
        if now[resets] != then[resets] or now[uptime] < then[uptime]:
            return None
        return (self.knot_edges - before.knot_edges) % EDGE_SPAN

    def trouble(self) -> str | None:
        """Why an armed board has taken "wrist ok" away, the most telling first."""
        why = self.hindrances
        if why & table.HINDRANCES_STOP:
            return "the emergency stop at the board was pressed"
        if why & table.HINDRANCES_NOT_ARMED:
            return "the board is no longer armed: it was reset, or another client disarmed it"
        if why & table.HINDRANCES_SAFE_STATE:
            limit_ms = 20 * WATCHDOG_UNITS
            return f"the board heard nothing for {limit_ms} ms and went into its safe state"
        if why & table.HINDRANCES_SERVO:
            return f"the board saw servo {self.alert_id} report a hardware error"
        return f"the board took wrist ok away: {hindrance_text(why)}" if why else None


class Board:
    """Device 200 behind a bus.

    Args:
        bus: shared with the servos.
        board_id: its id.
        port: the serial port's name, for the command that mends a wrong firmware.
        where: how messages name the board.
    """

    def __init__(self, bus: ServoBus, board_id: int, port: str, where: str) -> None:
        self._bus = bus
        self._id = board_id
        self._where = where
        self._mend = f"sphmctl firmware flash --port {port or 'PORT'}"
        self._clock = DeviceClock(0.0, RESONATOR_DRIFT)
        self._clock_us = 0

    async def examine(self) -> list[Finding]:
        """Look at identity, firmware and emergency stop. Changes nothing.

        Raises:
            DeviceError: the port is lost.
        """
        name = f"board {self._id}"
        status = await self._bus.ping(self._id)
        if status is None:
            remedy = f"check port, power and baud rate; if it is the board's port, {self._mend}"
            return [Finding(name, False, "does not answer", remedy)]
        model = int.from_bytes(status.data[:2], "little")
        if model != table.BOARD_MODEL:
            remedy = f"the board's is {table.BOARD_MODEL}; is this the board's port?"
            return [Finding(f"{name}, model number", False, str(model), remedy)]
        return await self._examine_firmware(name)

    async def identity(self) -> Identity:
        """What it is, of whatever version: addresses 0 to 15 never move (table.toml).

        Two reads, because a read across the hole between the two is refused.

        Raises:
            DeviceError: nothing answers, or something that is no board at all.
        """
        first, last = table.MODEL_NUMBER.address, table.FIRMWARE_VERSION.address + 1
        model, build_hash, firmware = struct.unpack(
            "<HIB", await self._bus.read(self._id, first, last - first)
        )
        return Identity(model, firmware, build_hash, await self._number(table.PROTOCOL_VERSION))

    async def state(self) -> BoardState:
        """Read it at rest, asking again when the answer is lost.

        Raises:
            DeviceError: it is silent, or the port is lost.
        """
        for _ in range(ATTEMPTS):
            state = await self.look()
            if state is not None:
                return state
        raise DeviceError("the board did not answer", self._where)

    async def look(self) -> BoardState | None:
        """Read it once, for a cycle that has no time to ask again; None when it was silent.

        Raises:
            DeviceError: the port is lost.
        """
        loop = asyncio.get_running_loop()
        frame = dxl_instructions.read(self._id, table.OUTPUTS.address, STATE_BYTES)
        sent_s = loop.time()
        status = (await self._bus.transact(frame, (self._id,), STATE_BYTES)).get(self._id)
        received_s = loop.time()
        if status is None or status.error or len(status.data) != STATE_BYTES:
            return None
        # The board looks at its clock when the whole frame is there, and before it answers.
        begin_s = sent_s + len(frame) * self._bus.byte_s
        end_s = received_s - (STATUS_OVERHEAD_BYTES + STATE_BYTES) * self._bus.byte_s
        return self._state_of(_values(status.data), begin_s, end_s)

    async def arm(self) -> None:
        """Leave the safe state, forget latched faults, and watch the host from here on.

        Raises:
            DeviceError: the emergency stop is pressed, or the board is silent.
        """
        if (await self.state()).stop_pressed:
            raise DeviceError("the emergency stop at the board is pressed; release it", self._where)
        await self._write(table.ARM, 0)
        await self._write(table.BUS_WATCHDOG, 0)
        await self._write(table.FAULTS, 0)
        await self._write(LONGEST, 0)
        await self._write(table.ARM, 1)
        await self._write(table.BUS_WATCHDOG, WATCHDOG_UNITS)

    async def permit(self) -> None:
        """Put the line "wrist ok" on: the servos are healthy and follow.

        Raises:
            DeviceError: the board refuses, and why.
        """
        try:
            await self._write(table.OUTPUTS, table.OUTPUTS_WRIST_OK)
        except DeviceError as error:
            why = hindrance_text((await self.state()).hindrances)
            raise DeviceError(f"wrist ok was refused: {why}", self._where) from error

    async def disarm(self) -> None:
        """Take "wrist ok" away and stop watching the host.

        Raises:
            DeviceError: the board is silent: it falls into its safe state by itself.
        """
        await self._write(table.ARM, 0)

    def host_s(self, stamp_us: int) -> float:
        """The host's instant of a stamp of the board, at most 71 minutes old; needs a read."""
        age_us = (self._clock_us - stamp_us) % CLOCK_SPAN_US
        return self._clock.host_s((self._clock_us - age_us) / 1e6)

    def knots_s(self, state: BoardState, count: int) -> list[float]:
        """Host times of the newest `count` edges of "knot", oldest first; at most `STAMPS`.

        Args:
            state: the newest read.
            count: how many of them are asked for.
        """
        # The numbers' span is a multiple of STAMPS, so their wrap does not shift the places.
        numbers = range(state.knot_edges - min(count, STAMPS) + 1, state.knot_edges + 1)
        return [self.host_s(state.knot_stamps_us[number % STAMPS]) for number in numbers]

    @property
    def clock_window_s(self) -> float:
        """How exactly both clocks are known to belong together, s."""
        return self._clock.window_s

    def _state_of(self, values: dict[str, int], sent_s: float, received_s: float) -> BoardState:
        clock_us = values[table.BOARD_CLOCK.name]
        # Unwrapped; after a reset it seems to have gone far ahead, and the offset begins anew.
        self._clock_us += (clock_us - self._clock_us) % CLOCK_SPAN_US
        self._clock.update(self._clock_us / 1e6, sent_s, received_s)
        return BoardState(
            hindrances=values[table.HINDRANCES.name],
            alert_id=values[table.ALERT_ID.name],
            inputs=values[table.INPUTS.name],
            knot_edges=values[table.KNOT_EDGES.name],
            knot_stamps_us=tuple(values[f"KNOT_STAMP_{place}"] for place in range(STAMPS)),
            counters={counter_name(item): values[item.name] for item in COUNTERS},
        )

    async def _examine_firmware(self, name: str) -> list[Finding]:
        identity = await self.identity()
        fits = identity.protocol == table.BOARD_PROTOCOL
        wanted = f"this version speaks 0x{table.BOARD_PROTOCOL:04x}: {self._mend}"
        detail = (
            f"protocol version 0x{identity.protocol:04x}, firmware {identity.firmware}, "
            f"build {identity.build_hash:08x}"
        )
        findings = [Finding(f"{name}, firmware", fits, detail, "" if fits else wanted)]
        if fits:
            state = await self.state()
            pressed = state.stop_pressed
            findings += [
                Finding(
                    f"{name}, emergency stop",
                    not pressed,
                    "pressed, or its wire is broken" if pressed else "released",
                    "release it" if pressed else "",
                ),
                Finding(f"{name}, errors counted", True, _error_text(state.errors)),
            ]
        return findings

    async def _number(self, item: table.Item) -> int:
        data = await self._bus.read(self._id, item.address, item.size)
        return int.from_bytes(data, "little")

    async def _write(self, item: table.Item, value: int) -> None:
        await self._bus.write(self._id, item.address, value.to_bytes(item.size, "little"))


def counter_name(item: table.Item) -> str:
    """A counter's name with its unit."""
    return item.name.lower() + UNITS.get(item.unit, "")


def hindrance_text(bits: int) -> str:
    """HINDRANCES_ bits in words."""
    return ", ".join(text for bit, text in HINDRANCE_TEXTS.items() if bits & bit) or "none"


def _error_text(errors: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in errors.items() if count) or "none"


def _values(data: bytes) -> dict[str, int]:
    """The items from OUTPUTS to the table's end, by name."""
    first = table.OUTPUTS.address
    return {
        item.name: int.from_bytes(data[item.address - first :][: item.size], "little")
        for item in STATE_ITEMS
    }
