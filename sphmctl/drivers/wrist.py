"""The wrist: three XL430 as three cranks in radians. Knows no plan and no arm.

One way of streaming is used: position mode with the velocity-based profile, a capped Profile
Velocity, no Profile Acceleration, and a new goal each cycle. The e-manual promises that a new goal
during a move is blended only for velocity-based profiles, not for time-based ones. The cap is what
makes a wrong goal a bounded motion instead of a step at full speed.
"""

from __future__ import annotations

import asyncio
import math
import struct
from dataclasses import dataclass
from functools import partial

import numpy as np

from sphmctl.drivers import xl430
from sphmctl.drivers.board import Board, BoardState
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.servo_bus import ServoBus
from sphmctl.errors import DeviceError
from sphmctl.motion import Floats
from sphmctl.wire import dxl, dxl_instructions

WATCHDOG_UNITS = 25
"""Bus Watchdog, in 20 ms: a servo that hears nothing for half a second refuses goals until it is
armed anew. Without goals it stands at the last one, a cycle's step away, long before; a stall of a
busy host, up to 0.3 s seen, must not trip it."""

MAX_RETURN_DELAY_UNITS = 10
"""Return Delay Time, in 2 us. The factory's 250 (three times 0.5 ms a cycle) is too slow."""

PROFILE_MARGIN = 1.5
"""Profile Velocity over the plan's fastest crank: catching up must be possible, racing not."""

MIN_PROFILE_RAD_S = math.radians(20.0)
"""Profile Velocity for a plan whose cranks hardly move."""

PROFILE_LIMIT_UNITS = 32_767

BOARD_CYCLES = 5
"""Every so many cycles the board is read too: each 50 ms. Behind an ATmega16U2 that takes one more
flush of 4.1 ms, which still fits into 10 ms; the board itself acts at once, and keeps the times of
four knots."""


@dataclass(frozen=True)
class CrankScale:
    """How counts and crank angles belong together (cell file: zero_ticks, direction)."""

    zero_ticks: tuple[int, ...]
    direction: tuple[int, ...]

    def ticks(self, cranks: Floats) -> list[int]:
        """Nearest counts to crank angles in rad, shape (3,)."""
        return [
            round(zero + sign * crank / xl430.RAD_PER_COUNT)
            for zero, sign, crank in zip(
                self.zero_ticks, self.direction, cranks.tolist(), strict=True
            )
        ]

    def crank(self, leg: int, ticks: int) -> float:
        """Crank angle of leg 0..2 in rad."""
        return (ticks - self.zero_ticks[leg]) * self.direction[leg] * xl430.RAD_PER_COUNT


@dataclass(frozen=True)
class ServoState:
    """One servo at one instant, or what is known of a silent one.

    Attributes:
        crank: crank angle, rad.
        alert: the servo says that a hardware error is set.
    """

    crank: float
    velocity: float
    alert: bool
    error: int
    telemetry: xl430.Telemetry


@dataclass(frozen=True)
class WristState:
    """The three servos after one cycle.

    Attributes:
        servos: in leg order; None where a servo was silent or sent nonsense.
        at_s: host time at which the servos took their positions.
        board: the newest state of the board; None without one, or before its first answer.
        board_misses: how often in a row it has been silent.
    """

    servos: tuple[ServoState | None, ...]
    at_s: float
    board: BoardState | None = None
    board_misses: int = 0

    @property
    def cranks(self) -> Floats:
        """Crank angles, rad, shape (3,); NaN for a silent servo."""
        return np.array([math.nan if s is None else s.crank for s in self.servos])


class Wrist:
    """Three servos on one bus.

    Args:
        bus: the bus.
        ids: servo ids in leg order.
        scale: counts and crank angles.
        crank_range: what the servos' position limits must let through, rad.
        where: how messages name the wrist.
        board: the board behind which the servos hang; None: a plain adapter.
    """

    def __init__(
        self,
        bus: ServoBus,
        ids: tuple[int, ...],
        scale: CrankScale,
        crank_range: tuple[float, float],
        where: str,
        board: Board | None = None,
    ) -> None:
        self.board = board
        self._bus = bus
        self._ids = ids
        self._scale = scale
        self._where = where
        self._crank_range = crank_range
        self._cycles = 0
        self._board_state: BoardState | None = None
        self._board_misses = 0
        self.armed = False

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._bus.connected

    async def connect(self) -> None:
        """Open the port."""
        await self._bus.connect()

    async def close(self) -> None:
        """Close the port."""
        await self._bus.close()

    async def examine(self) -> list[Finding]:
        """Look at the board, and at each servo: model, firmware and set-up. Changes nothing.

        Raises:
            DeviceError: the port is lost.
        """
        findings = [] if self.board is None else await self.board.examine()
        if not all(f.ok for f in findings):
            return findings
        for leg, servo_id in enumerate(self._ids):
            findings += await self._examine_servo(leg, servo_id)
        return findings

    async def verify(self) -> None:
        """Refuse a wrist that is not ready to be armed.

        Raises:
            DeviceError: naming each servo, what it has, and what would be right.
        """
        wrong = [f for f in await self.examine() if not f.ok]
        if wrong:
            text = "; ".join(f"{f.name}: {f.detail} ({f.remedy})" for f in wrong)
            raise DeviceError(text, self._where)

    async def read_cranks(self) -> Floats:
        """Present crank angles, rad, shape (3,): at rest, without arming."""
        cranks = []
        for leg, servo_id in enumerate(self._ids):
            data = await self._bus.read(servo_id, xl430.PRESENT_POSITION, 4)
            cranks.append(self._scale.crank(leg, struct.unpack("<i", data)[0]))
        return np.array(cranks)

    async def arm(self, speed_rad_s: float) -> None:
        """Torque on, holding where the cranks are; from here on `exchange` must be called.

        A board is armed first, since it keeps goals from the servos until then, and puts the line
        "wrist ok" on when all servos hold.

        Args:
            speed_rad_s: the fastest that the plan moves a crank.

        Raises:
            DeviceError: a device is silent or refuses; then torque is off again.
        """
        profile = max(speed_rad_s * PROFILE_MARGIN, MIN_PROFILE_RAD_S)
        units = min(math.ceil(profile / xl430.VELOCITY_UNIT_RAD_S), PROFILE_LIMIT_UNITS)
        try:
            if self.board is not None:
                await self.board.arm()
                self._board_state, self._board_misses = None, 0
            for servo_id in self._ids:
                await self._arm_servo(servo_id, units)
            if self.board is not None:
                await self.board.permit()
        except BaseException:
            await self.disarm()
            raise
        self.armed = True

    async def exchange(self, cranks: Floats | None) -> WristState:
        """One cycle: goals out (None: none), every servo's state back.

        Args:
            cranks: goals, rad, shape (3,).

        Returns:
            What the servos said; a missing one is None and does not void the others, but the
            servos after it on the bus are silent too (they answer in a chain).
        """
        size = xl430.TELEMETRY_FORMAT.size
        frames = [dxl_instructions.sync_read(xl430.INDIRECT_DATA_1, size, self._ids)]
        if cranks is not None:
            goals = (struct.pack("<i", within(ticks)) for ticks in self._scale.ticks(cranks))
            data_of = dict(zip(self._ids, goals, strict=True))
            frames.insert(0, dxl_instructions.sync_write(xl430.GOAL_POSITION, data_of))
        sent_s = asyncio.get_running_loop().time()
        statuses = await self._bus.transact(b"".join(frames), self._ids, size)
        servos = tuple(
            self._servo_state(leg, statuses.get(servo_id)) for leg, servo_id in enumerate(self._ids)
        )
        if self.board is not None:
            await self._look_at_board(self.board, None in servos)
        at_s = sent_s + self._bus.wire_s(*frames)
        return WristState(servos, at_s, self._board_state, self._board_misses)

    async def disarm(self) -> list[str]:
        """Wrist ok off, then torque off and watchdog off on every servo that can be reached.

        Returns:
            A sentence for each servo whose torque could not be seen to be off, and for a board
            that did not answer.
        """
        self.armed = False
        problems = []
        if self.board is not None:
            try:
                await self.board.disarm()
            except DeviceError as error:
                problems.append(f"the board was not disarmed ({error.message})")
        for servo_id in self._ids:
            try:
                await self._bus.write(servo_id, xl430.TORQUE_ENABLE, b"\0")
                if await self._bus.read(servo_id, xl430.TORQUE_ENABLE, 1) != b"\0":
                    problems.append(f"servo {servo_id} still has torque on")
                await self._bus.write(servo_id, xl430.BUS_WATCHDOG, b"\0")
            except DeviceError as error:
                problems.append(f"servo {servo_id}: torque off was not confirmed ({error.message})")
        return problems

    async def _look_at_board(self, board: Board, servo_silent: bool) -> None:
        """Read the board when it is due, or when it could tell why a servo is silent."""
        self._cycles += 1
        if self._cycles % BOARD_CYCLES and not servo_silent and not self._board_misses:
            return
        state = await board.look()
        if state is None:
            self._board_misses += 1
        else:
            self._board_state, self._board_misses = state, 0

    async def _arm_servo(self, servo_id: int, profile_units: int) -> None:
        bus = self._bus
        # Torque first: indirect addresses cannot be written with torque on.
        await bus.write(servo_id, xl430.TORQUE_ENABLE, b"\0")
        await bus.write(servo_id, xl430.BUS_WATCHDOG, b"\0")
        await bus.write(servo_id, xl430.INDIRECT_ADDRESS_1, xl430.telemetry_map())
        profile = struct.pack("<II", 0, profile_units)
        await bus.write(servo_id, xl430.PROFILE_ACCELERATION, profile)
        await self._goal_to_present(servo_id)
        await bus.write(servo_id, xl430.TORQUE_ENABLE, b"\1")
        # Torque on folds a multi-turn position into one turn: look again.
        await self._goal_to_present(servo_id)
        await bus.write(servo_id, xl430.BUS_WATCHDOG, bytes([WATCHDOG_UNITS]))

    async def _goal_to_present(self, servo_id: int) -> None:
        data = await self._bus.read(servo_id, xl430.PRESENT_POSITION, 4)
        await self._bus.write(servo_id, xl430.GOAL_POSITION, data)

    async def _examine_servo(self, leg: int, servo_id: int) -> list[Finding]:
        name = f"servo {servo_id} (leg {leg + 1})"
        status = await self._bus.ping(servo_id)
        if status is None or len(status.data) < 3:
            remedy = "check power, cable, id and baud rate"
            return [Finding(name, False, "does not answer", remedy)]
        model, firmware = struct.unpack_from("<HB", status.data)
        findings = [
            _finding(name, "model number", model, model == xl430.MODEL, "an XL430-W250 has 1060"),
            _finding(
                name,
                "firmware",
                firmware,
                firmware >= xl430.MIN_FIRMWARE,
                f"update it to {xl430.MIN_FIRMWARE} or later with DYNAMIXEL Wizard",
            ),
        ]
        if model != xl430.MODEL:
            return findings
        return findings + await self._examine_setup(leg, servo_id, name)

    async def _examine_setup(self, leg: int, servo_id: int, name: str) -> list[Finding]:
        async def number(address: int, layout: str) -> int:
            data = await self._bus.read(servo_id, address, struct.calcsize(layout))
            return int(struct.unpack(layout, data)[0])

        delay = await number(xl430.RETURN_DELAY, "<B")
        drive = await number(xl430.DRIVE_MODE, "<B")
        mode = await number(xl430.OPERATING_MODE, "<B")
        offset = await number(xl430.HOMING_OFFSET, "<i")
        level = await number(xl430.STATUS_RETURN_LEVEL, "<B")
        errors = await number(xl430.HARDWARE_ERROR, "<B")
        check = partial(_finding, name)
        at_once, all_told = delay <= MAX_RETURN_DELAY_UNITS, level == xl430.STATUS_ALL
        by_position = mode == xl430.POSITION_MODE
        most = f"set it to 0, at most {MAX_RETURN_DELAY_UNITS}"
        told = "set it to 2, or power the servo off and on"
        return [
            check("Return Delay Time (9)", delay, at_once, most),
            check("Drive Mode (10)", drive, drive == 0, "set it to 0"),
            check("Operating Mode (11)", mode, by_position, "set it to 3, position control"),
            check("Homing Offset (20)", offset, offset == 0, "set it to 0"),
            await self._examine_limits(leg, servo_id, name),
            check("Status Return Level (68)", level, all_told, told),
            _hardware_finding(name, errors),
        ]

    async def _examine_limits(self, leg: int, servo_id: int, name: str) -> Finding:
        limits = await self._bus.read(servo_id, xl430.MAX_POSITION, 8)
        high, low = struct.unpack("<ii", limits)
        need_low, need_high = self._needed_ticks(leg)
        return _finding(
            name,
            "Position Limits (52, 48)",
            f"{low} to {high}",
            low <= need_low and need_high <= high,
            f"they must include {need_low} to {need_high}",
        )

    def _needed_ticks(self, leg: int) -> tuple[int, int]:
        ends = [self._scale.ticks(np.full(3, crank))[leg] for crank in self._crank_range]
        return min(ends), max(ends)

    def _servo_state(self, leg: int, status: dxl.Status | None) -> ServoState | None:
        if status is None or len(status.data) != xl430.TELEMETRY_FORMAT.size:
            return None
        telemetry = xl430.parse_telemetry(status.data)
        return ServoState(
            crank=self._scale.crank(leg, telemetry.position_ticks),
            velocity=telemetry.velocity_units
            * self._scale.direction[leg]
            * xl430.VELOCITY_UNIT_RAD_S,
            alert=status.alert,
            error=status.error,
            telemetry=telemetry,
        )


def within(ticks: int) -> int:
    """A goal that a servo in position mode takes: rounding may put one a count outside."""
    return max(0, min(xl430.COUNTS_PER_TURN - 1, ticks))


def _hardware_finding(name: str, errors: int) -> Finding:
    detail = xl430.hardware_error_text(errors) if errors else "none"
    remedy = "remove the cause, then reboot the servo"
    return Finding(
        f"{name}, Hardware Error Status (70)", not errors, detail, remedy if errors else ""
    )


def _finding(name: str, item: str, value: int | str, ok: bool, remedy: str) -> Finding:
    return Finding(f"{name}, {item}", ok, str(value), "" if ok else remedy)
