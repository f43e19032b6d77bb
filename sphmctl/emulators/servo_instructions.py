"""What servos on one bus answer to an instruction: who, in which order, after which delay; no time.

ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0", chapter "Instruction Details".
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from sphmctl.emulators.control_table import DATA_LENGTH, INSTRUCTION_ERROR
from sphmctl.emulators.dxl_frame import (
    BROADCAST,
    HEADER,
    MAX_LENGTH,
    STATUS,
    Instruction,
    crc16,
    status_frame,
)
from sphmctl.emulators.xl430 import Servo

PING, READ, WRITE, REG_WRITE, ACTION = 0x01, 0x02, 0x03, 0x04, 0x05
FACTORY_RESET, REBOOT, CLEAR, BACKUP = 0x06, 0x08, 0x10, 0x20
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x82, 0x83, 0x8A
BULK_READ, BULK_WRITE, FAST_BULK_READ = 0x92, 0x93, 0x9A

FAST_FIRMWARE = 45
"""First firmware of the XL430 with fast reads and control table backup."""

LAST_ID = 252
"""Highest ID of a device; as Secondary ID(12) anything above means none."""

TURNAROUND_S = 50e-6
"""From an instruction's last bit to the answer's first, s; as users measured on MX-64s."""


@dataclass(frozen=True)
class Reply:
    """Bytes that come `delay_s` after what is on the wire before them."""

    delay_s: float
    data: bytes


@dataclass(frozen=True)
class _Want:
    """One device's share of a group read."""

    servo_id: int
    address: int
    size: int


def answer(packet: Instruction, servos: Sequence[Servo]) -> list[Reply]:
    """Let `servos` (those that hear) obey; their replies in the order of the wire."""
    for servo in servos:
        servo.hear()
    group = _GROUP.get(packet.code)
    if group is not None:
        return group(packet.params, servos) if packet.servo_id == BROADCAST else []
    if packet.servo_id == BROADCAST:
        return _broadcast(packet, servos)
    addressed = [servo for servo in servos if servo.id == packet.servo_id]
    for servo in servos:
        if servo.id != packet.servo_id == servo.secondary_id <= LAST_ID:
            _obey(servo, packet, as_group=True)
    return _merged([reply for servo in addressed for reply in _single(servo, packet)])


def _broadcast(packet: Instruction, servos: Sequence[Servo]) -> list[Reply]:
    if packet.code == PING:
        ids = sorted({servo.id for servo in servos})
        return [r for i in ids for r in _merged([_ping(s) for s in servos if s.id == i])]
    if packet.code != READ:
        for servo in servos:
            _obey(servo, packet)
    return []


def _single(servo: Servo, packet: Instruction) -> list[Reply]:
    """The addressed servo's answer, as its Status Return Level(68) allows."""
    if packet.code == PING:
        return [_ping(servo)]
    level, delay_s, alert = servo.return_level, servo.return_delay_s, servo.alert
    if packet.code == READ:
        if level == 0:
            return []
        error, data = DATA_LENGTH, b""
        if len(packet.params) == 4:
            error, data = servo.read(_word(packet.params, 0), _word(packet.params, 2))
        return [_reply(delay_s, packet.servo_id, error | alert, data)]
    error = _obey(servo, packet)
    return [_reply(delay_s, packet.servo_id, error | alert)] if level == 2 else []


def _obey(servo: Servo, packet: Instruction, *, as_group: bool = False) -> int:
    """Do what changes the servo; error number."""
    code, params = packet.code, packet.params
    if code in (WRITE, REG_WRITE):
        if len(params) < 3:
            return DATA_LENGTH
        store = servo.write if code == WRITE else servo.register
        return store(_word(params, 0), params[2:], as_group=as_group)
    if code == ACTION:
        return servo.action()
    if code == REBOOT:
        return servo.reboot()
    if code == FACTORY_RESET:
        return servo.factory_reset(params, broadcast=packet.servo_id == BROADCAST)
    if code == CLEAR:
        return servo.clear(params)
    if code == BACKUP and servo.firmware >= FAST_FIRMWARE:
        return servo.back_up(params)
    return INSTRUCTION_ERROR


def _ping(servo: Servo) -> Reply:
    identity = bytes(servo.table.memory[0:2]) + bytes((servo.firmware,))
    return _reply(servo.return_delay_s, servo.id, servo.alert, identity)


def _reply(delay_s: float, servo_id: int, error: int, data: bytes = b"") -> Reply:
    return Reply(delay_s + TURNAROUND_S, status_frame(servo_id, error, data))


def _merged(replies: list[Reply]) -> list[Reply]:
    """One reply of several servos with the same ID: the low bits win on an open bus line."""
    if len(replies) < 2:
        return replies
    size = max(len(reply.data) for reply in replies)
    mixed = bytearray(b"\xff" * size)
    for reply in replies:
        for i, byte in enumerate(reply.data):
            mixed[i] &= byte
    return [Reply(min(reply.delay_s for reply in replies), bytes(mixed))]


def _word(params: bytes, at: int) -> int:
    return params[at] | params[at + 1] << 8


def _same_block(params: bytes) -> list[_Want]:
    """Sync read: addr(2) len(2) id..."""
    if len(params) < 5:
        return []
    address, size = _word(params, 0), _word(params, 2)
    return [_Want(servo_id, address, size) for servo_id in params[4:]]


def _own_blocks(params: bytes) -> list[_Want]:
    """Bulk read: {id addr(2) len(2)}..., each ID once."""
    if not params or len(params) % 5:
        return []
    starts = range(0, len(params), 5)
    wants = [_Want(params[i], _word(params, i + 1), _word(params, i + 3)) for i in starts]
    return wants if len({want.servo_id for want in wants}) == len(wants) else []


def _chain(wants: list[_Want], servos: Sequence[Servo]) -> Iterable[tuple[_Want, list[Servo]]]:
    """Each listed device after the one before it: a silent one silences all behind it.

    DynamixelSDK issue 364, ROBOTIS: every device waits for the status of the one before.
    """
    for want in wants:
        devices = [s for s in servos if s.id == want.servo_id and s.return_level > 0]
        if not devices:
            return
        yield want, devices


def _read_each(wants: list[_Want], servos: Sequence[Servo]) -> list[Reply]:
    replies: list[Reply] = []
    for want, devices in _chain(wants, servos):
        same_slot = []
        for servo in devices:
            error, data = servo.read(want.address, want.size)
            error |= servo.alert
            same_slot.append(_reply(servo.return_delay_s, want.servo_id, error, data))
        replies += _merged(same_slot)
    return replies


def _read_fast(wants: list[_Want], servos: Sequence[Servo]) -> list[Reply]:
    """One shared status, never stuffed, cut off at the first silent device.

    FF FF FD 00 FE LEN 55 | ERR ID DATA CRC | ERR ID DATA CRC ..., each CRC over all bytes so far
    (e-manual, "Fast Sync Read").
    """
    able = [servo for servo in servos if servo.firmware >= FAST_FIRMWARE]
    length = 1 + sum(want.size + 4 for want in wants)
    if length > MAX_LENGTH:
        return []
    frame = HEADER + bytes((BROADCAST,)) + length.to_bytes(2, "little") + bytes((STATUS,))
    delay_s: float | None = None
    crc = crc16(frame)
    for want, devices in _chain(wants, able):
        servo = devices[0]
        error, data = servo.read(want.address, want.size)
        part = bytes((error | servo.alert, want.servo_id)) + data.ljust(want.size, b"\0")
        crc = crc16(part, crc)
        sealed = crc.to_bytes(2, "little")
        crc = crc16(sealed, crc)
        frame += part + sealed
        delay_s = servo.return_delay_s + TURNAROUND_S if delay_s is None else delay_s
    return [] if delay_s is None else [Reply(delay_s, frame)]


def _sync_write(params: bytes, servos: Sequence[Servo]) -> list[Reply]:
    """addr(2) len(2) {id data}...: nobody answers, ever."""
    size = _word(params, 2) if len(params) >= 4 else 0
    if size and (len(params) - 4) % (size + 1) == 0:
        address = params[:2]
        for i in range(4, len(params), size + 1):
            _write_one(params[i], address + params[i + 1 : i + 1 + size], servos)
    return []


def _bulk_write(params: bytes, servos: Sequence[Servo]) -> list[Reply]:
    """{id addr(2) len(2) data}...: nobody answers, and a list that does not add up does nothing."""
    writes: list[tuple[int, bytes]] = []
    i = 0
    while i + 5 <= len(params):
        end = i + 5 + _word(params, i + 3)
        writes.append((params[i], params[i + 1 : i + 3] + params[i + 5 : end]))
        i = end
    if i == len(params) and len({servo_id for servo_id, _ in writes}) == len(writes):
        for servo_id, rest in writes:
            _write_one(servo_id, rest, servos)
    return []


def _write_one(servo_id: int, params: bytes, servos: Sequence[Servo]) -> None:
    for servo in servos:
        if servo.id == servo_id:
            servo.write(_word(params, 0), params[2:])


_GROUP: dict[int, Callable[[bytes, Sequence[Servo]], list[Reply]]] = {
    SYNC_READ: lambda params, servos: _read_each(_same_block(params), servos),
    BULK_READ: lambda params, servos: _read_each(_own_blocks(params), servos),
    FAST_SYNC_READ: lambda params, servos: _read_fast(_same_block(params), servos),
    FAST_BULK_READ: lambda params, servos: _read_fast(_own_blocks(params), servos),
    SYNC_WRITE: _sync_write,
    BULK_WRITE: _bulk_write,
}
