"""What `doctor` and `status` tell of a cell at rest. Reads only; nothing is armed or moved."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import numpy as np

from sphmctl.config import Cell
from sphmctl.daemon.board_report import board_document
from sphmctl.daemon.record import Events
from sphmctl.daemon.session import Session
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.kuka import KukaArm
from sphmctl.drivers.wrist import Wrist
from sphmctl.errors import DeviceError, SphmctlError

TIMER_TURNS = 100
TIMER_PERIOD_S = 0.010
TIMER_LATE_MS = 2.0
"""Median lateness beyond which the loop cannot pace 10 ms cycles: a healthy one has 0.2 ms. Single
late turns are shown but do not count: each run reports its own."""

ROUND_TRIPS = 100
ROUND_TRIP_MS = 10.0
"""Median of the controller's replies: beyond it progress is learnt too late to follow, and the
heartbeat comes late. Published: 2 ms on one connection, 12 ms with five clients
(ivareri/KUKAVARPROXY_tests)."""

LATENCY_TIMER_MS = 1
"""What an FTDI adapter's latency_timer should be; its factory setting of 16 ms is a cycle and a
half of waiting."""


async def examine(cell: Cell, arm: KukaArm, wrist: Wrist) -> list[Finding]:
    """Every check, also those after a failed one."""
    session = Session(cell, arm, wrist, Events(None, asyncio.get_running_loop().time))
    findings = [await _timers()]
    findings += _adapter(cell.wrist.port)
    try:
        findings += await _device("controller", arm.connect, session.examine_arm)
        if findings[-1].ok and arm.connected:
            findings.append(await _round_trip(arm))
        arm_ok = all(f.ok for f in findings) and arm.connected
        findings += await _device("wrist", wrist.connect, session.examine_wrist)
        if arm_ok and all(f.ok for f in findings):
            findings += await session.examine_level()
    finally:
        await session.close()
    return findings


async def _device(name: str, connect: Any, look: Any) -> list[Finding]:
    try:
        await connect()
        return [Finding(f"{name} connected", True, "yes"), *await look()]
    except SphmctlError as error:
        return [Finding(name, False, str(error), "mend this, then run doctor again")]


async def _timers() -> Finding:
    loop = asyncio.get_running_loop()
    late_ms = []
    due_s = loop.time()
    for _ in range(TIMER_TURNS):
        due_s = max(due_s + TIMER_PERIOD_S, loop.time())
        await asyncio.sleep(due_s - loop.time())
        late_ms.append(1000.0 * (loop.time() - due_s))
    median, worst = np.percentile(late_ms, [50.0, 99.0])
    return Finding(
        "timers of this machine",
        bool(median <= TIMER_LATE_MS),
        f"late by {median:.2f} ms (median), {worst:.2f} ms (99 %)",
        ""
        if median <= TIMER_LATE_MS
        else "end other programs, or give this one a real-time priority",
    )


async def _round_trip(arm: KukaArm) -> Finding:
    loop = asyncio.get_running_loop()
    times_ms = []
    for _ in range(ROUND_TRIPS):
        begin_s = loop.time()
        await arm.read_state()
        times_ms.append(1000.0 * (loop.time() - begin_s))
    median, worst = np.percentile(times_ms, [50.0, 99.0])
    return Finding(
        "controller's replies",
        bool(median <= ROUND_TRIP_MS),
        f"{median:.1f} ms (median), {worst:.1f} ms (99 %)",
        "" if median <= ROUND_TRIP_MS else "close other clients of KUKAVARPROXY",
    )


def _adapter(port: str | None) -> list[Finding]:
    """The latency timer of an FTDI adapter, where the port is one."""
    if port is None:
        return []
    device = Path(port).resolve().name
    timer = Path("/sys/bus/usb-serial/devices") / device / "latency_timer"
    try:
        value = int(timer.read_text())
    except (OSError, ValueError):
        return []
    ok = value <= LATENCY_TIMER_MS
    remedy = "" if ok else f"echo {LATENCY_TIMER_MS} | sudo tee {timer}"
    return [Finding("USB adapter's latency timer", ok, f"{value} ms", remedy)]


async def state_of(cell: Cell, arm: KukaArm, wrist: Wrist) -> dict[str, Any]:
    """The document of `status`.

    Raises:
        DeviceError: a device cannot be reached.
    """
    session = Session(cell, arm, wrist, Events(None, asyncio.get_running_loop().time))
    try:
        await session.open()
        findings = await session.examine_arm()
        axes = await arm.read_axes()
        servos = await session.examine_wrist()
        cranks = await _cranks(wrist)
        wrong = [f for f in [*findings, *servos] if not f.ok]
        moving = any(f.name == "arm" and not f.ok for f in findings)
        first = wrong[0] if wrong else None
        return {
            "state": "moving" if moving else "ready" if first is None else "not ready",
            "cause": f"{first.name}: {first.detail}; {first.remedy}" if first else "",
            "arm": _by_name(findings) | {"joints_deg": [round(math.degrees(a), 4) for a in axes]},
            "wrist": {
                "servos": _servo_states(cell.wrist.ids, servos),
                "cranks_deg": cranks,
            },
            "board": await _board(wrist),
            "run": None,
        }
    finally:
        await session.close()


def _by_name(findings: list[Finding]) -> dict[str, Any]:
    return {f.name.replace(" ", "_"): f.detail for f in findings}


def _servo_states(ids: tuple[int, ...], findings: list[Finding]) -> list[dict[str, Any]]:
    """One entry a servo; `problems` is empty for one that is ready."""
    states = []
    for servo_id in ids:
        own = [f for f in findings if f.name.startswith(f"servo {servo_id} ")]
        problems = [f"{f.name}: {f.detail}; {f.remedy}" for f in own if not f.ok]
        states.append({"id": servo_id, "ready": not problems, "problems": problems})
    return states


async def _board(wrist: Wrist) -> dict[str, Any] | None:
    """None too for a board that is silent, which is the cause then."""
    try:
        return await board_document(wrist.board)
    except DeviceError:
        return None


async def _cranks(wrist: Wrist) -> list[float] | None:
    try:
        return [round(math.degrees(c), 3) for c in await wrist.read_cranks()]
    except DeviceError:
        return None
