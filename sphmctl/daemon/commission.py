"""Sets up servos, from the factory's state or any other, one at a time and with consent for each.

Looks first, refuses what it does not know, explains each change, reads everything back. A run
that was cut off is simply started again: the scan finds the servo wherever it was left.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from sphmctl.config import Cell, Wrist
from sphmctl.daemon.servo_scan import BAUD_CODES, Found, OpenAt, Scan, open_settled, scan
from sphmctl.daemon.servo_setup import Setting, limits_ticks, settings
from sphmctl.drivers import xl430
from sphmctl.drivers.link import Link
from sphmctl.drivers.servo_bus import ServoBus
from sphmctl.errors import DeviceError, InvalidError, UsageError
from sphmctl.wire import dxl_instructions
from sphmctl.wire.board_table import BOARD_ID, BOARD_MODEL

ID, BAUD_RATE = 7, 8
"""Addresses (e-manual, "Control Table of EEPROM Area")."""

LIVELY_ADDRESS, LIVELY_BYTES = 120, 28
"""Realtime tick to backup ready: what two servos hardly ever have alike."""

LIVELY_READS = 6
"""Two servos under one id garble nearly each of these reads; noise does not garble half."""

Tell = Callable[[str], None]
Consent = Callable[[str], Awaitable[bool]]


@dataclass(frozen=True)
class Change:
    """One item to write, or written."""

    name: str
    address: int
    before: int
    after: int
    why: str


@dataclass(frozen=True)
class Task:
    """What has to be done to one servo.

    Attributes:
        leg: 0..2.
        torque: whether it holds now.
        changes: empty for a servo that is as it should be.
    """

    found: Found
    new_id: int
    leg: int
    torque: bool
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class Outcome:
    """What commissioning left behind.

    Attributes:
        tasks: one for each servo, done and read back.
        missing: ids of the cell that no servo has yet.
        skipped: rates that the port cannot have.
    """

    tasks: tuple[Task, ...]
    missing: tuple[int, ...]
    skipped: tuple[int, ...]


@dataclass(frozen=True)
class Job:
    """What commissioning is told.

    Attributes:
        open_at: opens the port at a rate.
        where: how messages name the port.
        cell: ids, mounting and rate.
        wanted_id: the id for the one servo on the bus; None: see `assign`.
        bauds: where to look.
    """

    open_at: OpenAt
    where: str
    cell: Cell
    wanted_id: int | None = None
    bauds: tuple[int, ...] = tuple(BAUD_CODES)


async def commission(job: Job, tell: Tell, consent: Consent) -> Outcome:
    """Find the servos and set up those that are not as the cell needs them.

    Args:
        job: what to do.
        tell: takes each step in words.
        consent: asked before the first change of each servo.

    Raises:
        DeviceError: no servo, an unknown device, several servos under one id, or a refusal.
        InvalidError: the wanted id is none of the cell's.
        UsageError: no consent.
    """
    if job.wanted_id is not None and job.wanted_id not in job.cell.wrist.ids:
        ids = ", ".join(map(str, job.cell.wrist.ids))
        raise InvalidError(f"id {job.wanted_id} is none of the cell's: {ids}", "--id")
    seen = await scan(job.open_at, job.bauds, tell)
    servos = known(seen, job.where)
    targets = assign(servos, job.cell.wrist, job.wanted_id, job.where)
    tasks = []
    # All are looked at before the first one is changed.
    for found, new_id in targets:
        tasks.append(await _examine(job, found, new_id))
    for task in tasks:
        await _do(job, task, tell, consent)
    present = {task.new_id for task in tasks}
    missing = tuple(i for i in job.cell.wrist.ids if i not in present)
    return Outcome(tuple(tasks), missing, seen.skipped)


def known(seen: Scan, where: str) -> tuple[Found, ...]:
    """The servos of a scan, when there is nothing else.

    Raises:
        DeviceError: naming what is there and what to do about it.
    """
    servos = tuple(f for f in seen.found if (f.servo_id, f.model) != (BOARD_ID, BOARD_MODEL))
    twice = [f for f, count in Counter((f.baud, f.servo_id) for f in servos).items() if count > 1]
    if twice or seen.garbled:
        baud = twice[0][0] if twice else seen.garbled[0]
        under = f"under id {twice[0][1]} " if twice else ""
        raise DeviceError(
            f"several servos answer at once {under}at {baud} baud; connect one at a time", where
        )
    for found in servos:
        if found.model != xl430.MODEL:
            raise DeviceError(
                f"{found.place} is of model {found.model}; an XL430-W250 is {xl430.MODEL}: "
                "take it off the bus",
                where,
            )
        if found.firmware < xl430.MIN_FIRMWARE:
            raise DeviceError(
                f"{found.place} has firmware {found.firmware}; update it to "
                f"{xl430.MIN_FIRMWARE} or later with DYNAMIXEL Wizard",
                where,
            )
    if not servos:
        raise DeviceError(_silence(seen.looked), where)
    return servos


def _silence(looked: tuple[int, ...]) -> str:
    if len(looked) == 1:
        return (
            f"no servo answers at {looked[0]} baud; check its power and its cable, or look at all "
            "rates: leave --baud away"
        )
    return (
        f"no servo answers at any of {len(looked)} rates; check its power and its cable, and that "
        "it hangs on a USB adapter: through the board, which resets at each rate, this search does "
        "not reach it"
    )


def assign(
    servos: tuple[Found, ...], wrist: Wrist, wanted_id: int | None, where: str
) -> list[tuple[Found, int]]:
    """Which id each servo gets.

    One whose id is the cell's keeps it, one at the cell's rate before another with the same id; the
    others get the lowest ids left. Thus servos may be hung on the bus one after the other, each new
    one in the factory's state.

    Raises:
        DeviceError: more servos than ids, or `wanted_id` with several servos.
    """
    if len(servos) > len(wrist.ids):
        raise DeviceError(f"{len(servos)} servos for {len(wrist.ids)} legs: take some off", where)
    if wanted_id is not None:
        if len(servos) > 1:
            raise DeviceError(
                f"{len(servos)} servos answer, but --id is for one: connect only that one", where
            )
        return [(servos[0], wanted_id)]
    order = sorted(servos, key=lambda f: (f.baud != wrist.baud, f.baud, f.servo_id))
    keepers: dict[int, Found] = {}
    for found in order:
        if found.servo_id in wrist.ids:
            keepers.setdefault(found.servo_id, found)
    free = iter(i for i in sorted(wrist.ids) if i not in keepers)
    return [
        (found, found.servo_id if keepers.get(found.servo_id) is found else next(free))
        for found in order
    ]


async def _examine(job: Job, found: Found, new_id: int) -> Task:
    """Read what the servo has; find two that answer as one."""
    bus = _bus(job, found.baud)
    try:
        await bus.connect()
        await _expect_one(bus, found, job.where)
        errors = (await bus.read(found.servo_id, xl430.HARDWARE_ERROR, 1))[0]
        if errors:
            raise DeviceError(
                f"{found.place} reports {xl430.hardware_error_text(errors)}; "
                "remove the cause, power it off and on",
                job.where,
            )
        leg = job.cell.wrist.ids.index(new_id)
        changes = await _differences(bus, found, _settings(job, found, leg))
        torque = await bus.read(found.servo_id, xl430.TORQUE_ENABLE, 1)
    finally:
        await bus.close()
    if found.servo_id != new_id:
        changes.append(Change("ID", ID, found.servo_id, new_id, f"leg {leg + 1} of the wrist"))
    code, target = BAUD_CODES[found.baud], BAUD_CODES[job.cell.wrist.baud]
    if code != target:
        why = f"{job.cell.wrist.baud} baud, the cell's rate"
        changes.append(Change("Baud Rate", BAUD_RATE, code, target, why))
    return Task(found, new_id, leg, torque != b"\0", tuple(changes))


async def _expect_one(bus: ServoBus, found: Found, where: str) -> None:
    frame = dxl_instructions.read(found.servo_id, LIVELY_ADDRESS, LIVELY_BYTES)
    good = 0
    for _ in range(LIVELY_READS):
        good += bool(await bus.transact(frame, (found.servo_id,), LIVELY_BYTES))
    if good <= LIVELY_READS // 2:
        raise DeviceError(
            f"{found.place}: {LIVELY_READS - good} of {LIVELY_READS} answers were garbled; several "
            "servos have this id, as all new ones do: connect one at a time",
            where,
        )


async def _differences(
    bus: ServoBus, found: Found, wanted: tuple[Setting, ...], servo_id: int | None = None
) -> list[Change]:
    changes = []
    for item in wanted:
        number = found.servo_id if servo_id is None else servo_id
        data = await bus.read(number, item.address, item.size)
        if data != item.data:
            before = int.from_bytes(data, "little", signed=item.name == "Homing Offset")
            changes.append(Change(item.name, item.address, before, item.value, item.why))
    return changes


async def _do(job: Job, task: Task, tell: Tell, consent: Consent) -> None:
    """Explain, ask, change, read back."""
    name = f"servo {task.found.place}"
    if not task.changes:
        tell(f"{name}: is as it should be")
        return
    tell(
        f"{name} becomes servo {task.new_id}, leg {task.leg + 1}; item (address): now -> then, why"
    )
    if task.torque:
        tell("  its torque goes off: hold what it carries")
    for change in task.changes:
        tell(f"  {change.name} ({change.address}): {change.before} -> {change.after}, {change.why}")
    if not await consent(f"Change these {len(task.changes)} items of {name}?"):
        raise UsageError(f"no consent: nothing was changed on {name}")
    await _change(job, task)
    await _read_back(job, task)
    tell(
        f"servo {task.new_id}: done, read back at {job.cell.wrist.baud} baud; mark it "
        f"{task.new_id}, for leg {task.leg + 1}"
    )


async def _change(job: Job, task: Task) -> None:
    bus = _bus(job, task.found.baud)
    servo_id = task.found.servo_id
    sizes = {item.address: item for item in _settings(job, task.found, task.leg)}
    try:
        await bus.connect()
        # EEPROM is locked while torque is on.
        await bus.write(servo_id, xl430.TORQUE_ENABLE, b"\0")
        for change in task.changes:
            if change.address in sizes:
                await bus.write(servo_id, change.address, sizes[change.address].data)
        for change in task.changes:
            if change.address in (ID, BAUD_RATE):
                # Whether it answers as before or as told is not documented: it is asked later.
                frame = dxl_instructions.write(servo_id, change.address, bytes((change.after,)))
                await bus.transact(frame, (servo_id,), 0)
                servo_id = task.new_id
    finally:
        await bus.close()


async def _read_back(job: Job, task: Task) -> None:
    bus = _bus(job, job.cell.wrist.baud)
    again = "run commission again, it goes on from where the servo is"
    try:
        await bus.connect()
        status = await bus.ping(task.new_id)
        if status is None or struct.unpack_from("<H", status.data)[0] != xl430.MODEL:
            raise DeviceError(
                f"servo {task.new_id} does not answer at {job.cell.wrist.baud} baud after its "
                f"change; {again}",
                job.where,
            )
        wanted = _settings(job, task.found, task.leg)
        wrong = await _differences(bus, task.found, wanted, task.new_id)
        if wrong:
            items = ", ".join(f"{c.name} is {c.before}, not {c.after}" for c in wrong)
            raise DeviceError(f"servo {task.new_id} did not take it: {items}; {again}", job.where)
    finally:
        await bus.close()


def _settings(job: Job, found: Found, leg: int) -> tuple[Setting, ...]:
    return tuple(
        item for item in settings(limits_ticks(job.cell, leg)) if item.since <= found.firmware
    )


def _bus(job: Job, baud: int) -> ServoBus:
    async def connect() -> Link:
        return await open_settled(job.open_at, baud)

    return ServoBus(connect, job.where, baud)
