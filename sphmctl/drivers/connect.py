"""Makes the drivers of a cell, over its own links or over links that somebody hands in."""

from __future__ import annotations

from sphmctl.config import Cell
from sphmctl.drivers.board import Board
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.kvp_client import KvpClient
from sphmctl.drivers.link import Link, LinkOpener, open_serial, open_tcp
from sphmctl.drivers.servo_bus import ServoBus
from sphmctl.drivers.wrist import CrankScale, Wrist

CONNECT_TIMEOUT_S = 5.0
"""To open a link: a controller on the same wire answers in milliseconds, an ARP in a second."""


def make_arm(cell: Cell, opener: LinkOpener | None = None) -> KukaArm:
    """The arm of a cell; `opener` replaces the TCP connection to its host."""
    host, port = cell.arm.host or "127.0.0.1", cell.arm.tcp_port

    async def connect() -> Link:
        return await open_tcp(host, port, CONNECT_TIMEOUT_S)

    where = f"controller {host}:{port}" if opener is None else "controller"
    client = KvpClient(opener or connect, where, flavour=cell.arm.flavour)
    return KukaArm(client, where)


def make_wrist(cell: Cell, opener: LinkOpener | None = None) -> Wrist:
    """The wrist of a cell, behind its board if it has one; `opener` replaces its serial port."""
    wrist = cell.wrist
    port = wrist.port or ""

    async def connect() -> Link:
        return await open_serial(port, wrist.baud, CONNECT_TIMEOUT_S)

    where = f"wrist {port}" if opener is None else "wrist"
    ranges = cell.ranges_rad[6:]
    bus = ServoBus(opener or connect, where, wrist.baud, board_id=wrist.board_id)
    board = None if wrist.board_id is None else Board(bus, wrist.board_id, port, where)
    return Wrist(
        bus,
        wrist.ids,
        CrankScale(wrist.zero_ticks, wrist.direction),
        (float(ranges[:, 0].min()), float(ranges[:, 1].max())),
        where,
        board,
    )
