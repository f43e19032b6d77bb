"""Looks whether the arm is the cell's and ready to move. Reads only."""

from __future__ import annotations

from collections.abc import Mapping

from sphmctl.config import Cell
from sphmctl.drivers import krc_interface as krc
from sphmctl.drivers.board import BoardState
from sphmctl.drivers.finding import Finding
from sphmctl.drivers.krc_program import LineNumbers, line_numbers
from sphmctl.drivers.kuka import INSTALL, PROGRAM, ArmState, KukaArm, LineLevels

MOVING_MODES = ("EX", "EXT", "AUT", "T1")
"""Operating modes in which a plan may be driven; T2 is manual at full speed."""

LINES_OFF = "off: a wrist that fails stops the arm through this computer only"
"""What it means that a cell has no board."""


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
    ]
    if all(f.ok for f in findings):
        state = await arm.read_state()
        findings += _examine_state(state)
        # A program of another version may not have what is read next.
        if state.check == krc.CHECK and len(cell.emulated_devices) != 1:
            findings += _examine_lines(cell, state, await arm.read_lines())
    # Last, since nothing can be started before the rest is well.
    started = identity.program_state == "#P_ACTIVE"
    remedy = f"start {PROGRAM} and let it reach its first point (BCO)"
    return [*findings, _finding("program state", identity.program_state, started, remedy)]


def _examine_lines(cell: Cell, state: ArmState, lines: LineLevels) -> list[Finding]:
    """Whether the controller listens to the board, where there is one and both are here."""
    board = cell.wrist.board_id is not None
    line = lines.numbers[krc.INPUT_OK] != 0
    remedy = f"if there is a board, give its wrist.board_id in the cell file; else {INSTALL}"
    if board:
        remedy = f"give the cell file arm.lines; {INSTALL}"
    detail = "connected" if line else LINES_OFF
    findings = [
        _finding("line wrist ok", detail, line == board, remedy),
        _finding(
            "signal wrist ok",
            f"SPH_OK {_level(lines.signal)}, its input {_level(lines.wire)}",
            lines.signal == lines.wire and (line or lines.signal),
            f"SPH_OK and SPH_IN_OK name different inputs; {INSTALL}",
        ),
    ]
    wanted = line_numbers(lines_of(cell))
    if board and cell.arm.lines is not None:
        findings.append(
            _finding(
                "lines' numbers",
                _numbers(lines.numbers),
                lines.numbers == wanted,
                f"the cell file says {_numbers(wanted)}; {INSTALL}",
            )
        )
    return findings


def examine_level(state: ArmState, board: BoardState) -> Finding:
    """Whether the controller sees of "wrist ok" what the board puts out, both read at rest."""
    seen, put = state.wrist is krc.Wrist.ON, board.hindrances == 0
    return _finding(
        "level of wrist ok",
        f"{_level(put)} at the board, {_level(seen)} at the controller",
        seen == put,
        "check the wire and its optocoupler, and look whether the input is bridged",
    )


def lines_of(cell: Cell) -> LineNumbers | None:
    """Where a cell's lines are; None without a board."""
    if cell.wrist.board_id is None or cell.arm.lines is None:
        return None
    lines = cell.arm.lines
    return LineNumbers(lines.wrist_ok, lines.knot, lines.arm_moving)


def _numbers(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{name}={number}" for name, number in numbers.items())


def _level(on: bool) -> str:
    return "on" if on else "off"


def _examine_state(state: ArmState) -> list[Finding]:
    return [
        _finding(
            "program version",
            str(state.version),
            state.version == krc.VERSION,
            f"this sphmctl needs {krc.VERSION}; {INSTALL}",
        ),
        _finding(
            "program checksum",
            str(state.check),
            state.check == krc.CHECK,
            f"this sphmctl needs {krc.CHECK}; {INSTALL}",
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


def remedies(findings: list[Finding]) -> str:
    """What to do about all that is not right, in order."""
    return ", then ".join(f.remedy for f in findings if not f.ok)
