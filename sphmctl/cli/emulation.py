"""Emulated devices behind a cell's drivers: real endpoints in real time, memory on virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from sphmctl.cli.common import say
from sphmctl.clock import VirtualLoop
from sphmctl.config import Cell
from sphmctl.drivers.connect import make_arm, make_wrist
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.link import Link, LinkOpener, MemoryLink, memory_pair
from sphmctl.drivers.wrist import Wrist
from sphmctl.emulators.board import Board, Mode
from sphmctl.emulators.board import Options as BoardOptions
from sphmctl.emulators.board_process import BoardError
from sphmctl.emulators.cell import EmulatedCell, Setup, TruthSink
from sphmctl.emulators.krc_files import Numbers
from sphmctl.emulators.kvp_server import FlavourName
from sphmctl.errors import DeviceError, UsageError
from sphmctl.wire.board_table import BOARD_ID

Latency = Literal["measured", "none"]
BoardKind = Literal["none", "simulated"]


@dataclass
class Devices:
    """The drivers of a cell, and what stands behind them where that is emulated.

    Attributes:
        losses: why a simulated board died; empty while it lives.
    """

    arm: KukaArm
    wrist: Wrist
    emulated: EmulatedCell | None = None
    truth: EmulatedCell | None = None
    losses: list[DeviceError] = field(default_factory=list)

    async def close(self) -> None:
        """End the emulation; the drivers are closed by whoever connected them."""
        if self.emulated is not None:
            await self.emulated.close()


def announce(cell: Cell) -> None:
    """Say first of all what is emulated."""
    devices = cell.emulated_devices
    if len(devices) == 2:
        say("EMULATED: no robot will move")
    elif devices:
        real = "wrist" if devices == ("arm",) else "arm"
        say(f"EMULATED: the {devices[0]} is emulated, the {real} is real and will move")


def flavour_of(cell: Cell) -> FlavourName:
    """The variable server to emulate for a cell: C3 Bridge only where its file asks for that."""
    return "c3" if cell.arm.flavour == "c3" else "kvp"


def setup_of(cell: Cell) -> Setup:
    """An emulated cell that is mounted and wired as the cell file says."""
    wrist, lines = cell.wrist, cell.arm.lines
    setup = Setup(zero_ticks=wrist.zero_ticks, direction=wrist.direction, ids=wrist.ids)
    if lines is None:
        return setup
    return replace(setup, lines=Numbers(lines.wrist_ok, lines.knot, lines.arm_moving))


def board_kind(value: str) -> BoardKind:
    """The option `--board`."""
    if value == "none":
        return "none"
    if value == "simulated":
        return "simulated"
    raise UsageError(f"{value!r}: give none or simulated", "--board")


def with_board(cell: Cell, board: BoardKind) -> Cell:
    """The cell whose emulated wrist has a simulated board, or none.

    Raises:
        UsageError: a simulated board for a real wrist.
    """
    if cell.wrist.driver != "emulated":
        if board == "simulated":
            raise UsageError("a simulated board is for an emulated wrist: add --dry-run", "--board")
        return cell
    board_id = BOARD_ID if board == "simulated" else None
    wrist = cell.wrist.model_copy(update={"board_id": board_id})
    return cell.model_copy(update={"wrist": wrist})


def simulated_board(
    mode: Mode,
    host_link: Path | None = None,
    on_lost: Callable[[DeviceError], None] | None = None,
) -> Board:
    """A simulated board that runs the shipped firmware.

    Args:
        mode: "held" or "paced".
        host_link: symbolic link to its pseudo-terminal (paced).
        on_lost: told when the simulator dies; else that is raised where it is noticed.

    Raises:
        DeviceError: the simulator, or what compiles it, is missing.
    """
    from sphmctl.board import image

    options = BoardOptions(image.load().hex, host_link=host_link)
    try:
        board = Board(options, mode)
    except BoardError as error:
        raise _device_error(error) from error
    if on_lost is not None:
        board.on.lost = lambda error: on_lost(_device_error(error))
    loop = asyncio.get_running_loop()
    if isinstance(loop, VirtualLoop):
        loop.accompany(board.ahead)
    return board


def _device_error(error: BoardError) -> DeviceError:
    return DeviceError(str(error), "simulated board")


async def open_devices(
    cell: Cell,
    *,
    board: BoardKind = "none",
    seed: int = 0,
    latency: Latency = "measured",
    virtual: bool = False,
    sink: TruthSink | None = None,
) -> Devices:
    """Make the drivers of a cell, starting emulators for what the cell says is emulated."""
    devices = cell.emulated_devices
    if not devices:
        return Devices(make_arm(cell), make_wrist(cell))
    cell = with_board(cell, board)
    losses: list[DeviceError] = []
    mode: Mode = "held" if virtual else "paced"
    hardware = simulated_board(mode, on_lost=losses.append) if board == "simulated" else None
    emulated = EmulatedCell(
        seed,
        setup_of(cell),
        latency=latency,
        flavour=flavour_of(cell),
        truth=sink,
        board=hardware,
    )
    if virtual:
        arm = make_arm(cell, _memory(emulated.kvp.attach))
        wrist = make_wrist(cell, _memory(lambda end: emulated.attach_wrist(end, cell.wrist.baud)))
    else:
        port, device = await emulated.serve()
        served = with_endpoints(cell, port, device)
        arm, wrist = make_arm(served), make_wrist(served)
    truth = emulated if len(devices) == 2 else None
    return Devices(arm, wrist, emulated, truth, losses)


def with_endpoints(cell: Cell, kvp_port: int, wrist_port: str | Path) -> Cell:
    """The cell with emulated devices replaced by the endpoints at which they are served."""
    arm, wrist = cell.arm, cell.wrist
    if arm.driver == "emulated":
        endpoint = {"driver": "kvp", "host": "127.0.0.1", "port": kvp_port}
        arm = arm.model_copy(update=endpoint)
    if wrist.driver == "emulated":
        wrist = wrist.model_copy(update={"driver": "dynamixel", "port": str(wrist_port)})
    return cell.model_copy(update={"arm": arm, "wrist": wrist})


def _memory(attach: Callable[[MemoryLink], None]) -> LinkOpener:
    """Opens a new pipe each time, whose other end `attach` serves."""

    async def connect() -> Link:
        here, there = memory_pair()
        attach(there)
        return here

    return connect
