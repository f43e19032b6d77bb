"""Looks whether the arm is the cell's and ready to move. Reads only."""

from __future__ import annotations

from sphmctl.config import Cell
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.kuka import PROGRAM, ArmState, KukaArm

MOVING_MODES = ("EX", "EXT", "AUT", "T1")
"""Operating modes in which a plan may be driven; T2 is manual at full speed."""


async def examine_arm(cell: Cell, arm: KukaArm) -> list[Finding]:
    """Look whether this is the right robot with the right program, ready to move."""
    identity = await arm.identity()
    wanted = cell.arm.model
    findings = [
        _finding(
            "robot",
            identity.model,
            wanted.upper() in identity.model.upper().replace(" ", ""),
            f"the cell file says {wanted}; connect the right controller or change arm.model",
        ),
        _finding(
            "program",
            identity.program or "none selected",
            identity.program.upper() == PROGRAM,
            f"select {PROGRAM} on the controller",
        ),
        _finding(
            "program state",
            identity.program_state,
            identity.program_state == "#P_ACTIVE",
            f"start {PROGRAM} and let it reach its first point (BCO)",
        ),
    ]
    if all(f.ok for f in findings):
        state = await arm.read_state()
        findings += [*_examine_state(state), *_examine_line(cell, state)]
    return findings


def _examine_line(cell: Cell, state: ArmState) -> list[Finding]:
    """Whether the controller listens to the board, where there is one and both are here."""
    if len(cell.emulated_devices) == 1:
        return []
    board = cell.wrist.board_id is not None
    line = state.wrist is not krc.Wrist.NONE
    remedy = "set SPH_IN_OK in sph_run.dat to 0, or board_id in the cell file to 200"
    if board:
        remedy = "wire wrist ok, and set SPH_IN_OK in sph_run.dat to its input"
    detail = "connected" if line else "not connected"
    return [_finding("line wrist ok", detail, line == board, remedy)]


def _examine_state(state: ArmState) -> list[Finding]:
    return [
        _finding(
            "program version",
            str(state.version),
            state.version == krc.VERSION,
            f"install the program of interface version {krc.VERSION}",
        ),
        _finding(
            "mode",
            state.mode,
            state.mode in MOVING_MODES,
            f"choose one of {', '.join(MOVING_MODES)}",
        ),
        _finding(
            "safety chain",
            "closed" if state.safe else "open",
            state.safe,
            "release the emergency stop and close the gate",
        ),
        _finding("drives", "on" if state.drives else "off", state.drives, "switch the drives on"),
        _finding(
            "messages",
            "stop message" if state.stop_message else "none",
            not state.stop_message,
            "acknowledge the messages on the pendant",
        ),
        _finding(
            "arm",
            "moving" if state.moving else "at rest",
            not state.moving,
            "wait until no other program moves it",
        ),
    ]


def _finding(name: str, detail: str, ok: bool, remedy: str) -> Finding:
    return Finding(name, ok, detail, "" if ok else remedy)
