"""What firmware a board runs, compared with the one that this package ships. Changes nothing."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from typing import Literal

from sphmctl.board import flash
from sphmctl.board.image import Image
from sphmctl.drivers.board import Board, Identity
from sphmctl.drivers.link import Link, LinkOpener, open_serial
from sphmctl.drivers.servo_bus import BOARD_SILENCE_S, ServoBus
from sphmctl.errors import DeviceError
from sphmctl.wire import board_table as table
from sphmctl.wire import dxl

State = Literal["match", "older", "newer", "foreign", "silent"]

HOST_BAUD = 1_000_000
"""Rate of the shipped firmware's host port (firmware/board/build.toml, BOARD_HOST_BAUD)."""

OPEN_TIMEOUT_S = 5.0
"""To open the port: a USB adapter takes milliseconds."""

ASKS = 2
"""With the silence between: a ping that comes too early keeps the board in its bootloader."""

MEND = "sphmctl firmware flash --port {port}"


@dataclass(frozen=True)
class Report:
    """What answered under the board's id.

    Attributes:
        state: the verdict.
        detail: the same in words, with what to do.
        version: FIRMWARE_VERSION; None when nothing answered.
        build_hash: first 4 bytes of the SHA-256 over its sources, in hex.
        protocol_version: in hex.
        model: its model number.
        counters: by name; empty when its table is another one.
        verified: whether its flash holds what is shipped; None when that was not asked.
    """

    state: State
    detail: str
    version: int | None = None
    build_hash: str | None = None
    protocol_version: str | None = None
    model: int | None = None
    counters: dict[str, int] = field(default_factory=dict)
    verified: bool | None = None


def serial_opener(port: str, baud: int = HOST_BAUD) -> LinkOpener:
    """Opens the board's port."""

    async def connect() -> Link:
        return await open_serial(port, baud, OPEN_TIMEOUT_S)

    return connect


async def check(opener: LinkOpener, port: str, shipped: Image, baud: int = HOST_BAUD) -> Report:
    """Ask a board what it runs, once it has had the time to boot.

    Args:
        opener: opens its port.
        port: its name in sentences.
        shipped: what it should run.
        baud: the port's rate.

    Raises:
        DeviceError: the port cannot be opened, or is lost.
    """
    where = f"board {port}"
    bus = ServoBus(opener, where, baud, board_id=table.BOARD_ID)
    try:
        await bus.connect()
        status = await _ping(bus)
        if status is None:
            return Report("silent", _silent(port, baud))
        model = int.from_bytes(status.data[:2], "little")
        if model != table.BOARD_MODEL:
            detail = (
                f"id {table.BOARD_ID} is a device of model {model}, the board is "
                f"{table.BOARD_MODEL}; is this the board's port?"
            )
            return Report("foreign", detail, model=model)
        return await _compare(Board(bus, table.BOARD_ID, port, where), port, shipped)
    finally:
        await bus.close()


async def _ping(bus: ServoBus) -> dxl.Status | None:
    for _ in range(ASKS - 1):
        if (status := await bus.ping(table.BOARD_ID)) is not None:
            return status
        await asyncio.sleep(BOARD_SILENCE_S)
    return await bus.ping(table.BOARD_ID)


async def _compare(board: Board, port: str, shipped: Image) -> Report:
    identity = await board.identity()
    state, words = verdict(identity, shipped)
    # Behind the identity, another protocol version has other items.
    same_table = identity.protocol == table.BOARD_PROTOCOL
    counters = (await board.state()).counters if same_table else {}
    mend = "" if state in ("match", "newer") else f": {MEND.format(port=port)}"
    return Report(
        state,
        words + mend,
        identity.firmware,
        f"{identity.build_hash:08x}",
        f"{identity.protocol:04x}",
        identity.model,
        counters,
    )


def verdict(board: Identity, shipped: Image) -> tuple[State, str]:
    """The state, and why."""
    ours = f"version {shipped.version}, build {shipped.build_hash:08x}"
    theirs = f"version {board.firmware}, build {board.build_hash:08x}"
    if board.firmware < shipped.version:
        return "older", f"the board runs {theirs}, this sphmctl ships {ours}: flash it"
    if board.firmware > shipped.version:
        return "newer", f"the board runs {theirs}, this sphmctl ships {ours}: update sphmctl"
    if (board.build_hash, board.protocol) == (shipped.build_hash, shipped.protocol):
        return "match", f"the board runs what this sphmctl ships: {ours}"
    origin = "the Arduino IDE's build, which tells no hash" if not board.build_hash else theirs
    return "foreign", f"the board runs {origin}, not what this sphmctl ships ({ours}): flash it"


def compare_flash(report: Report, port: str, shipped: Image, bootloader_baud: int) -> Report:
    """The report, knowing too whether the flash holds the shipped image.

    Raises:
        DeviceError: a board that answered has no bootloader that does.
    """
    try:
        same = flash.verify(port, shipped, bootloader_baud)
    except DeviceError as error:
        if report.state != "silent":
            raise
        # The verdict stands: nothing answers, be it asked as firmware or as bootloader.
        return replace(report, detail=f"{report.detail}; {error.message}")
    return with_flash(replace(report, verified=same), same, port)


def with_flash(report: Report, same: bool, port: str) -> Report:
    """The verdict on a board whose flash is known to hold the shipped image, or not to."""
    if report.state == "match" and not same:
        detail = (
            "the board says it runs what this sphmctl ships, but its flash differs: flash it: "
            f"{MEND.format(port=port)}"
        )
        return replace(report, state="foreign", detail=detail)
    if report.state == "silent" and same:
        detail = (
            f"nothing answers under id {table.BOARD_ID}, although the flash holds what this "
            "sphmctl ships: unplug the board, plug it in again and check once more"
        )
        return replace(report, detail=detail)
    return report


def _silent(port: str, baud: int) -> str:
    return (
        f"nothing answers under id {table.BOARD_ID} at {baud} baud; if this is the board's port, "
        f"flash it: {MEND.format(port=port)}"
    )
