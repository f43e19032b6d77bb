"""The arm: the daemon's end of firmware/krc/INTERFACE.md over a KVP client.

Angles are radians here and degrees on the wire. Knows knots, not plans.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

import numpy as np

from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.device_clock import DeviceClock
from sphmctl.drivers.krc_program import ALWAYS_TRUE
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats
from sphmctl.wire import krl

SESSION_TIMEOUT_S = 1.0
"""The program takes a session in its next cycle, 24 ms after the write in the median."""

SESSION_LIMIT = 1_000_000_000
"""Session numbers stay below this; a KRL INT ends at 2,147,483,647."""

PROGRAM = "SPH_RUN"

IDENTITY = ("$MODEL_NAME[]", "$KR_SERIALNO", "$PRO_NAME1[]", "$PRO_STATE1")
"""What tells robot and program, in the order of `ArmIdentity`."""

LINES = (krc.INPUT_OK, krc.OUTPUT_KNOT, krc.OUTPUT_MOVING)

INSTALL = "write its files by `sphmctl krl export DIR` and install them"
"""What mends a program of another version."""

FROZEN_S = 0.12
"""SPH_STATE is refreshed each 12 ms; the same TIME for ten cycles is a picture, not the robot."""

Number = TypeVar("Number", bound=IntEnum)


@dataclass(frozen=True)
class ArmIdentity:
    """Which robot this is, and whether its program could move it."""

    model: str
    serial: str
    program: str
    program_state: str


@dataclass(frozen=True)
class ArmState:
    """One cycle of the controller, as SPH_STATE gives it.

    Attributes:
        joints: A1..A6, rad, shape (6,).
        at_s: host time of the cycle.
    """

    version: int
    check: int
    session: int
    status: krc.Status
    fault: krc.Fault
    wrist: krc.Wrist
    taken: int
    passed: int
    override_percent: int
    moving: bool
    stopped: bool
    drives: bool
    safe: bool
    stop_message: bool
    mode: str
    joints: Floats
    at_s: float


@dataclass(frozen=True)
class LineLevels:
    """The controller's lines to a board.

    Attributes:
        numbers: SPH_IN_OK, SPH_OUT_KNOT, SPH_OUT_MOVING; 0: not connected.
        signal: what the program sees of "wrist ok".
        wire: the level of the input that SPH_IN_OK names, or of the one that is always TRUE.
    """

    numbers: Mapping[str, int]
    signal: bool
    wire: bool


class KukaArm:
    """The arm, as one connection shows it.

    Args:
        client: the connection.
        where: how messages name the controller.
    """

    def __init__(self, client: KvpClient, where: str) -> None:
        self._client = client
        self._where = where
        self._clock = DeviceClock(krc.CYCLE_S)
        self._beat = 0
        self._stamp_s = math.nan
        self._changed_s = -math.inf

    @property
    def connected(self) -> bool:
        """Whether the controller can be asked."""
        return self._client.connected

    async def connect(self) -> None:
        """Connect, or connect again; only ever at rest."""
        await self._client.connect()

    async def close(self) -> None:
        """Close the connection."""
        await self._client.close()

    @property
    def flavour(self) -> str:
        """The variable server in use: "kvp" or "c3"."""
        return self._client.flavour

    async def identity(self) -> ArmIdentity:
        """Which robot and program this is."""
        model, serial, program, state = await self._client.read_many(IDENTITY)
        return ArmIdentity(_plain(model), serial, _plain(program), state)

    async def read_axes(self) -> Floats:
        """$AXIS_ACT, rad, shape (6,): also without our program."""
        value = krl.parse(await self._client.read("$AXIS_ACT"))
        return _axes(value, self._where)

    async def read_state(self) -> ArmState:
        """The state structure, in one read."""
        loop = asyncio.get_running_loop()
        sent_s = loop.time()
        text = await self._client.read(krc.STATE)
        received_s = loop.time()
        fields = self._state_fields(text)
        stamp_s = _integer(fields["TIME"]) / 1000.0
        self._see_life(stamp_s, sent_s, received_s)
        self._clock.update(stamp_s, sent_s, received_s)
        return ArmState(
            version=_integer(fields["VERSION"]),
            check=_integer(fields["CHECK"]),
            session=_integer(fields["SESSION"]),
            status=self._member(krc.Status, fields["STATUS"]),
            fault=self._member(krc.Fault, fields["FAULT"]),
            wrist=self._member(krc.Wrist, fields["WRIST"]),
            taken=_integer(fields["RD"]),
            passed=_integer(fields["DONE"]),
            override_percent=_integer(fields["OV"]),
            moving=fields["MOVING"] is True,
            stopped=fields["STOPPED"] is True,
            drives=fields["DRIVES"] is True,
            safe=fields["SAFE"] is True,
            stop_message=fields["STOPMESS"] is True,
            mode=str(fields["MODE"]).removeprefix("#"),
            joints=_axes(fields["Q"], self._where),
            at_s=self._clock.host_s(stamp_s),
        )

    def _see_life(self, stamp_s: float, sent_s: float, received_s: float) -> None:
        """Refuse a state that nobody refreshes: it would show an arm that moves as standing."""
        if stamp_s != self._stamp_s:
            # A slow reply may show the very cycle that the next one shows, too.
            self._stamp_s, self._changed_s = stamp_s, received_s
        elif sent_s - self._changed_s > FROZEN_S:
            still_ms = 1000.0 * (sent_s - self._changed_s)
            raise DeviceError(
                f"{krc.STATE}.TIME has stood still for {still_ms:.0f} ms: "
                "nobody refreshes the state; is the submit interpreter running?",
                self._where,
            )

    def _member(self, kind: type[Number], value: krl.KrlValue) -> Number:
        try:
            return kind(_integer(value))
        except ValueError as error:
            raise DeviceError(
                f"{krc.STATE} holds {value!r}, which is no {kind.__name__.lower()} of interface "
                f"version {krc.VERSION}",
                self._where,
            ) from error

    def _state_fields(self, text: str) -> Mapping[str, krl.KrlValue]:
        value = krl.parse(text)
        if not isinstance(value, krl.Aggregate):
            raise DeviceError(f"{krc.STATE} is {text!r}, not a structure", self._where)
        missing = [name for name in krc.STATE_FIELDS if name not in value.fields]
        if missing:
            raise DeviceError(
                f"{krc.STATE} lacks {', '.join(missing)}: {PROGRAM} is of another version than "
                f"{krc.VERSION}; {INSTALL}",
                self._where,
            )
        return value.fields

    async def read_lines(self) -> LineLevels:
        """Where the controller has its lines to a board, and what it sees of "wrist ok"."""
        numbers = [_integer(krl.parse(text)) for text in await self._client.read_many(LINES)]
        lines = dict(zip(LINES, numbers, strict=True))
        wired = lines[krc.INPUT_OK] or ALWAYS_TRUE
        levels = await self._client.read_many(("SPH_OK", f"$IN[{wired}]"))
        signal, wire = (krl.parse(text) is True for text in levels)
        return LineLevels(lines, signal, wire)

    async def begin_session(self) -> ArmState:
        """Forget every old knot and be ready for new ones.

        Raises:
            DeviceError: the program does not take the session in time.
        """
        idle = (krc.COMMAND, str(int(krc.Command.IDLE)))
        # Nothing moves before the session is written, so the order is free.
        await self._client.write_many((idle, (krc.WRITTEN, "0"), (krc.LAST, "0")))
        session = (await self.read_state()).session % SESSION_LIMIT + 1
        await self._client.write(krc.SESSION, str(session))
        loop = asyncio.get_running_loop()
        limit_s = loop.time() + SESSION_TIMEOUT_S
        # Between requests, not around them: giving one up would cost the connection.
        while loop.time() < limit_s:
            state = await self.read_state()
            if state.session == session and state.status is krc.Status.READY:
                return state
        raise DeviceError(
            f"{PROGRAM} did not take the session within {SESSION_TIMEOUT_S:g} s; "
            "is it running, and does the submit interpreter run?",
            self._where,
        )

    async def write_knot(
        self, sequence: int, joints: Floats, velocity: float, acceleration: float
    ) -> None:
        """Fill the slot of knot `sequence`; it counts once `publish` has named it.

        Never in one request with `publish`: C3 Bridge goes on after a refused variable, and reads
        each one again, which takes longer than two requests.

        Args:
            sequence: sequence number, from 1.
            joints: A1..A6, rad, shape (6,).
            velocity: share (0, 1] of every axis's maximum.
            acceleration: share (0, 1] of every axis's maximum.
        """
        slot = (sequence - 1) % krc.RING + 1
        axes = krl.axis_aggregate(*np.degrees(joints).tolist())
        await self._client.write(
            f"{krc.KNOT}[{slot}]",
            f"{{{krc.KNOT_TYPE}: SEQ {sequence}, VEL {krl.format_value(100.0 * velocity)}, "
            f"ACC {krl.format_value(100.0 * acceleration)}, Q {axes}}}",
        )

    async def publish(self, sequence: int) -> None:
        """Say that every knot up to `sequence` is written completely."""
        await self._client.write(krc.WRITTEN, str(sequence))

    async def declare_last(self, sequence: int) -> None:
        """Say which knot ends the motion."""
        await self._client.write(krc.LAST, str(sequence))

    async def command(self, command: krc.Command) -> None:
        """Write the command word."""
        await self._client.write(krc.COMMAND, str(int(command)))

    async def beat(self) -> None:
        """Change the heartbeat."""
        self._beat = self._beat % 1000 + 1
        await self._client.write(krc.BEAT, str(self._beat))


def _plain(text: str) -> str:
    return text.strip('"').strip("# ")


def _integer(value: krl.KrlValue) -> int:
    if not isinstance(value, int):
        raise DeviceError(f"a whole number was expected, the controller sent {value!r}")
    return int(value)


def _axes(value: krl.KrlValue, where: str) -> Floats:
    if isinstance(value, krl.Aggregate):
        angles = [value.fields.get(f"A{i}") for i in range(1, 7)]
        if all(isinstance(a, int | float) and math.isfinite(a) for a in angles):
            return np.radians(np.array(angles, dtype=np.float64))
    raise DeviceError(f"axis angles were expected, the controller sent {value!r}", where)
