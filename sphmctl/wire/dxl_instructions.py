"""DYNAMIXEL Protocol 2.0, sending side: one function for each instruction, returning its frame.

dynamixel-sdk builds the frames on a port that only keeps what is written; `dxl` reads the answers.
The SDK is imported with the first frame: it brings pyserial with it, 22 ms on a PC.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Any, Final

from sphmctl.errors import InvalidError
from sphmctl.wire.dxl import BROADCAST_ID, MAX_ID, crc16

# Addresses and lengths are 16-bit numbers (e-manual, Protocol 2.0, "Read").
MAX_WORD: Final = 0xFFFF

# Keeps the frame below the SDK's 1024 bytes however much stuffing comes in: it grows by a third.
MAX_PARAMETER_BYTES: Final = 700

# What Factory Reset spares (e-manual, "Factory Reset").
RESET_ALL: Final = 0xFF
RESET_ALL_BUT_ID: Final = 0x01
RESET_ALL_BUT_ID_AND_BAUD: Final = 0x02

# Control Table Backup has no call in the SDK: 01 stores, 02 restores, then "CTRL" (e-manual).
_BACKUP_INSTRUCTION: Final = 0x20
_STORE: Final = b"\x01CTRL"
_RESTORE: Final = b"\x02CTRL"

# The reads of a control loop are the same few frames in each cycle.
CACHED_FRAMES: Final = 64


def ping(device_id: int = BROADCAST_ID) -> bytes:
    """Asks for model and firmware; a broadcast asks every device."""
    _check_id(device_id, broadcast=True)
    if device_id == BROADCAST_ID:
        return _capture(lambda sdk, port: sdk.broadcastPing(port))
    return _capture(lambda sdk, port: sdk.ping(port, device_id))


@lru_cache(maxsize=CACHED_FRAMES)
def read(device_id: int, address: int, length: int) -> bytes:
    """Reads `length` bytes from `address`."""
    _check_id(device_id)
    _check_words(address, length)
    return _capture(lambda sdk, port: sdk.readTx(port, device_id, address, length))


def write(device_id: int, address: int, data: bytes) -> bytes:
    """Writes to one device, or to all without an answer."""
    _check_id(device_id, broadcast=True)
    _check_data(address, data)
    return _capture(
        lambda sdk, port: sdk.writeTxOnly(port, device_id, address, len(data), list(data))
    )


def reg_write(device_id: int, address: int, data: bytes) -> bytes:
    """A write that waits in the device for `action`."""
    _check_id(device_id, broadcast=True)
    _check_data(address, data)
    return _capture(
        lambda sdk, port: sdk.regWriteTxOnly(port, device_id, address, len(data), list(data))
    )


def action(device_id: int = BROADCAST_ID) -> bytes:
    """Carries out what `reg_write` has left."""
    _check_id(device_id, broadcast=True)
    return _capture(lambda sdk, port: sdk.action(port, device_id))


def factory_reset(device_id: int, option: int) -> bytes:
    """Resets the control table but for what `option` (RESET_...) spares; the device reboots."""
    _check_id(device_id)
    if option not in (RESET_ALL, RESET_ALL_BUT_ID, RESET_ALL_BUT_ID_AND_BAUD):
        raise InvalidError(f"reset option {option}; 255, 1 or 2 would be right")
    return _capture(lambda sdk, port: sdk.factoryReset(port, device_id, option))


def reboot(device_id: int) -> bytes:
    """Restarts the device: RAM back to defaults, hardware errors cleared."""
    _check_id(device_id, broadcast=True)
    return _capture(lambda sdk, port: sdk.reboot(port, device_id))


def clear_multi_turn(device_id: int) -> bytes:
    """Folds the present position to one turn."""
    _check_id(device_id)
    return _capture(lambda sdk, port: sdk.clearMultiTurn(port, device_id))


def backup(device_id: int) -> bytes:
    """Stores the control table inside the device; torque must be off."""
    return _backup(device_id, _STORE)


def restore(device_id: int) -> bytes:
    """Brings the stored control table back; the device reboots."""
    return _backup(device_id, _RESTORE)


@lru_cache(maxsize=CACHED_FRAMES)
def sync_read(address: int, length: int, device_ids: tuple[int, ...]) -> bytes:
    """The same bytes of several devices, which answer one after the other in this order."""
    return _sync_read(address, length, device_ids, fast=False)


@lru_cache(maxsize=CACHED_FRAMES)
def fast_sync_read(address: int, length: int, device_ids: tuple[int, ...]) -> bytes:
    """As `sync_read`, answered in one frame (X430 from firmware 45)."""
    return _sync_read(address, length, device_ids, fast=True)


def sync_write(address: int, data_of: Mapping[int, bytes]) -> bytes:
    """The same item of several devices, taken at the end of this frame; there is no answer."""
    _check_ids(data_of)
    parameters: list[int] = []
    length = len(next(iter(data_of.values())))
    for device_id, data in data_of.items():
        if len(data) != length:
            raise InvalidError(
                f"{len(data)} bytes for servo {device_id}; {length}, as for the first one, "
                "would be right"
            )
        parameters.append(device_id)
        parameters += data
    _check_words(address, length)
    _check_size(parameters)
    return _capture(
        lambda sdk, port: sdk.syncWriteTxOnly(port, address, length, parameters, len(parameters))
    )


def bulk_read(blocks: Mapping[int, tuple[int, int]]) -> bytes:
    """A block (address, length) of each device, which answer one after the other."""
    return _bulk_read(blocks, fast=False)


def fast_bulk_read(blocks: Mapping[int, tuple[int, int]]) -> bytes:
    """As `bulk_read`, answered in one frame (X430 from firmware 45)."""
    return _bulk_read(blocks, fast=True)


def bulk_write(blocks: Mapping[int, tuple[int, bytes]]) -> bytes:
    """An item (address, data) of each device; there is no answer."""
    _check_ids(blocks)
    parameters: list[int] = []
    for device_id, (address, data) in blocks.items():
        _check_data(address, data)
        parameters += [device_id, *_words(address, len(data)), *data]
    _check_size(parameters)
    return _capture(lambda sdk, port: sdk.bulkWriteTxOnly(port, parameters, len(parameters)))


def _sync_read(address: int, length: int, device_ids: tuple[int, ...], fast: bool) -> bytes:
    _check_ids(dict.fromkeys(device_ids))
    if len(set(device_ids)) != len(device_ids):
        raise InvalidError(f"servo ids {list(device_ids)}; each id once would be right")
    _check_words(address, length)
    ids = list(device_ids)
    return _capture(lambda sdk, port: sdk.syncReadTx(port, address, length, ids, len(ids), fast))


def _bulk_read(blocks: Mapping[int, tuple[int, int]], fast: bool) -> bytes:
    _check_ids(blocks)
    parameters: list[int] = []
    for device_id, (address, length) in blocks.items():
        _check_words(address, length)
        parameters += [device_id, *_words(address, length)]
    _check_size(parameters)
    return _capture(lambda sdk, port: sdk.bulkReadTx(port, parameters, len(parameters), fast))


def _backup(device_id: int, parameters: bytes) -> bytes:
    _check_id(device_id)
    length = len(parameters) + 3
    # The SDK fills in header and CRC (e-manual, "Instruction Packet").
    packet = [0, 0, 0, 0, device_id, length, 0, _BACKUP_INSTRUCTION, *parameters, 0, 0]
    return _capture(lambda sdk, port: sdk.txPacket(port, packet))


@cache
def _sdk() -> tuple[Any, Any, list[bytes]]:
    """The SDK's packet handler, a port that keeps what is written to it, and where it keeps it.

    dynamixel-sdk 4.1.0 stuffs into a new list and sends the old one: the first replacement copies
    it back. The SDK also walks each packet twice in Python: not stuffing where there is nothing to
    stuff, and our CRC, save half the time of a sync write.
    """
    from dynamixel_sdk.protocol2_packet_handler import Protocol2PacketHandler

    handler = Protocol2PacketHandler()
    add_stuffing = handler.addStuffing

    def stuff_in_place(packet: list[int]) -> None:
        if b"\xff\xff\xfd" in bytes(packet):
            packet[:] = add_stuffing(packet)

    def update_crc(start: int, packet: list[int], size: int) -> int:
        return crc16(bytes(packet[:size]), start)

    handler.addStuffing = stuff_in_place
    handler.updateCRC = update_crc
    kept: list[bytes] = []

    def keep(packet: list[int]) -> int:
        kept.append(bytes(packet))
        return len(packet)

    port = SimpleNamespace(
        is_using=False,
        writePort=keep,
        # Some of the SDK's calls wait for an answer: none comes, and the time is always up.
        readPort=lambda length: [],
        isPacketTimeout=lambda: True,
        clearPort=lambda: None,
        setPacketTimeout=lambda packet_length: None,
        setPacketTimeoutMillis=lambda msec: None,
        getBaudRate=lambda: 1_000_000,
    )
    return handler, port, kept


def _capture(build: Callable[[Any, Any], object]) -> bytes:
    handler, port, kept = _sdk()
    port.is_using = False
    build(handler, port)
    return kept.pop()


def _words(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(2, "little") for number in numbers)


def _check_id(device_id: int, broadcast: bool = False) -> None:
    if 0 <= device_id <= MAX_ID or (broadcast and device_id == BROADCAST_ID):
        return
    also = f" or {BROADCAST_ID} (all)" if broadcast else ""
    raise InvalidError(f"servo id {device_id}; 0 to {MAX_ID}{also} would be right")


def _check_ids(device_ids: Mapping[int, object]) -> None:
    if not device_ids:
        raise InvalidError("no servo ids; at least one would be right")
    for device_id in device_ids:
        _check_id(device_id)


def _check_words(address: int, length: int) -> None:
    if not 0 <= address <= MAX_WORD:
        raise InvalidError(f"address {address}; 0 to {MAX_WORD} would be right")
    if not 1 <= length <= MAX_WORD:
        raise InvalidError(f"length {length} bytes; 1 to {MAX_WORD} would be right")


def _check_data(address: int, data: bytes) -> None:
    _check_words(address, len(data))
    _check_size(data)


def _check_size(parameters: bytes | list[int]) -> None:
    if len(parameters) > MAX_PARAMETER_BYTES:
        raise InvalidError(
            f"{len(parameters)} parameter bytes; at most {MAX_PARAMETER_BYTES} would be right"
        )
