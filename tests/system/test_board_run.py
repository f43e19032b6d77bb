"""Whole runs with the shipped firmware in the chain: servos, lines, and what it does alone."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sphmctl.cli import emulation, main
from sphmctl.daemon.board_report import KNOT_EDGE
from sphmctl.daemon.follow import stretches
from sphmctl.drivers.board import WATCHDOG_UNITS
from sphmctl.emulators.board import SIMULATOR_ERRORS, Board, Mode
from sphmctl.emulators.controller import Options
from sphmctl.errors import DeviceError
from tests.system.rig import SIDES, STILL_DEG, Ended, Rig, at, ends_in_peace, plan_of, run
from tests.system.test_command_run import (
    SHORT_PATH,
    WAIT_S,
    cell_file,
    finish,
    line_of,
    sphmctl,
    start,
)
from tests.system.test_octagon import LIMITS, OCTAGON, figures

ON_SIDE_S = 0.4
"""Plan time in the middle of the first side."""

WATCHDOG_S = 0.020 * WATCHDOG_UNITS
DIED = "sphmctl: simulated board: the board simulator ended with code -9"
ERRORS = (
    "host_crc_errors",
    "host_torn_frames",
    "host_overruns",
    "bus_crc_errors",
    "bus_torn_frames",
    "bus_overruns",
    "bus_timeouts",
    "watchdog_trips",
    "refused_frames",
)


def hardware(rig: Rig) -> Board:
    """The simulated board of a rig."""
    assert rig.emulated.board is not None
    return rig.emulated.board


def press_stop(rig: Rig) -> None:
    """Press the emergency stop at the board."""
    assert rig.emulated.wiring is not None
    rig.emulated.wiring.press_stop()


def cut_line(rig: Rig) -> None:
    """Break the wire of "wrist ok"."""
    assert rig.emulated.wiring is not None
    rig.emulated.wiring.cut_wrist_ok()


def wait_for(met: Callable[[], bool]) -> None:
    """Look at another process's files until they say what is waited for."""
    end_s = time.monotonic() + WAIT_S
    while not met():
        assert time.monotonic() < end_s, "what the test waits for did not happen"
        time.sleep(0.05)


def stands_after(ended: Ended, seconds: float) -> None:
    """The machine stands so long after the test's act."""
    acted_s = ended.rig.acted_s
    assert ended.moved_deg(acted_s, acted_s + seconds).max() > 0.1
    assert ended.moved_deg(acted_s + seconds).max() <= STILL_DEG


def test_the_octagon_is_followed_in_step_with_the_firmware_in_the_chain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    boards: list[Board] = []
    stats: dict[str, int] = {}
    make = emulation.simulated_board

    def note(mode: Mode, **options: Any) -> Board:
        board = make(mode, **options)
        boards.append(board)
        close = board.close

        def read_and_close() -> None:
            if not stats:
                stats.update(board.stats())
            close()

        monkeypatch.setattr(board, "close", read_and_close)
        return board

    monkeypatch.setattr(emulation, "simulated_board", note)
    code = main.run(
        ["run", str(OCTAGON), "--dry-run", "--virtual", "--board", "simulated", "--json"]
        + ["--runs-dir", str(tmp_path)]
    )
    summary = json.loads(capsys.readouterr().out)
    assert (code, summary["outcome"]) == (0, "completed"), summary
    (board,) = boards
    assert board.faults == []
    assert {name: stats[name] for name in SIMULATOR_ERRORS} == dict.fromkeys(SIMULATOR_ERRORS, 0)
    report = summary["board"]
    assert {name: report["end"][name] for name in ERRORS} == dict.fromkeys(ERRORS, 0)
    assert report["end"]["resets"] == report["begin"]["resets"]
    assert report["end"]["frames_down"] > 2 * summary["duration_s"] / 0.010
    result = figures(Path(summary["run_dir"]))
    print(result, report)
    assert result["p99_ms"] <= LIMITS["p99_ms"]
    assert result["crank_deg"] <= LIMITS["crank_deg"]
    assert result["tool_mm"] <= LIMITS["tool_mm"]


def test_each_knot_that_the_arm_passes_is_an_edge_at_the_board() -> None:
    ended = run(board="simulated")
    assert (ended.outcome.outcome, ended.outcome.unconfirmed) == ("completed", [])
    knots = max(piece.sequence for piece in stretches(plan_of(SIDES)))
    assert ended.outcome.board is not None
    assert ended.outcome.board["knot_edges"] == knots
    assert ended.outcome.board["reset"] is False
    events = ended.rig.events.history
    edges = [(t_s, fields) for t_s, name, fields in events if name == KNOT_EDGE]
    assert [fields["number"] for _, fields in edges] == list(range(1, knots + 1))
    for t_s, fields in edges:
        # The board is read each 50 ms; a reply takes up to 10 ms.
        assert 0.0 < t_s - fields["edge_s"] < 0.065
        assert 0.0 < fields["window_ms"] < 10.0
    assert hardware(ended.rig).faults == []
    ends_in_peace(ended)


def test_a_pressed_stop_brakes_the_arm_and_ends_the_run() -> None:
    ended = run(at(ON_SIDE_S, press_stop), board="simulated")
    assert ended.outcome.outcome == "faulted"
    assert ended.outcome.cause == "the emergency stop at the board was pressed"
    assert ended.outcome.unconfirmed == []
    assert ended.torques == [0, 0, 0]
    # 12 ms until the program looks, and 50 ms until the daemon asks; neither waits for the other.
    assert ended.decided_s - ended.rig.acted_s < 0.07
    stands_after(ended, 0.4)
    ends_in_peace(ended)


def test_a_broken_line_brakes_the_arm_without_a_computer_in_between() -> None:
    ended = run(at(ON_SIDE_S, cut_line), board="simulated")
    assert ended.outcome.outcome == "faulted"
    assert "the controller has no wrist ok" in ended.outcome.cause
    assert ended.outcome.unconfirmed == []
    # The arm stood long before the daemon gave up waiting for the board to explain it.
    assert ended.decided_s - ended.rig.acted_s > 0.1
    assert ended.moved_deg(ended.decided_s)[:6].max() <= STILL_DEG
    stands_after(ended, 0.4)
    ends_in_peace(ended)


def test_a_daemon_that_falls_silent_leaves_both_in_their_safe_state() -> None:
    states: list[tuple[bool, list[int]]] = []

    async def script(rig: Rig) -> None:
        await rig.until_tau(ON_SIDE_S)
        rig.act()
        rig.kvp.deaf = rig.bus.deaf = True
        lines = rig.emulated.controller.lines
        assert lines is not None
        await rig.until(lambda: not lines.wrist_ok, 1.0)
        last_s = rig.loop.time() - rig.acted_s
        assert WATCHDOG_S - 0.015 < last_s < WATCHDOG_S + 0.003
        await asyncio.sleep(0.3)
        rig.emulated.world.advance()
        states.append((lines.wrist_ok, [s.table["bus_watchdog"] for s in rig.emulated.servos]))

    ended = run(script, board="simulated")
    assert ended.outcome.outcome == "faulted"
    # The servos stopped too, by the board's order or their own watchdog.
    assert states == [(False, [-1, -1, -1])]
    stands_after(ended, 0.5)


def test_a_board_that_is_lost_ends_the_run_with_its_name() -> None:
    def lose(rig: Rig) -> None:
        rig.bus.deaf = True

    ended = run(at(ON_SIDE_S, lose), board="simulated")
    assert ended.outcome.outcome == "faulted"
    assert ended.outcome.cause == "the board was silent twice in a row"
    assert ended.decided_s - ended.rig.acted_s < 0.15
    assert ended.outcome.board is not None
    assert ended.outcome.board["end"] is None
    stands_after(ended, 0.5)


def test_a_board_that_is_reset_ends_the_run() -> None:
    ended = run(at(ON_SIDE_S, lambda rig: hardware(rig).reset()), board="simulated")
    assert ended.outcome.outcome == "faulted"
    assert "the board is no longer armed: it was reset" in ended.outcome.cause
    assert ended.torques == [0, 0, 0]
    report = ended.outcome.board
    assert report is not None
    assert (report["knot_edges"], report["reset"]) == (None, True)
    assert report["end"]["resets"] == report["begin"]["resets"] + 1
    ends_in_peace(ended)


def test_a_controller_without_the_line_is_refused_before_motion() -> None:
    with pytest.raises(DeviceError, match=r"line wrist ok: off: .*; give the cell file arm\.lines"):
        run(board="simulated", options=Options(lines=False))


def test_a_controller_that_waits_for_a_board_is_refused_without_one() -> None:
    with pytest.raises(DeviceError, match="line wrist ok: connected; if there is a board"):
        run(options=Options(lines=True))


def test_two_virtual_runs_with_the_firmware_are_alike() -> None:
    first, second = (run(board="simulated") for _ in range(2))
    assert np.array_equal(first.truth, second.truth)
    assert first.rig.events.history == second.rig.events.history


@pytest.mark.realtime
def test_a_dry_run_in_real_time_goes_through_the_boards_pseudo_terminal(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text(SHORT_PATH)
    code, out, err = sphmctl(
        *("run", str(path), "--dry-run", "--board", "simulated", "--json"),
        *("--runs-dir", str(tmp_path)),
    )
    summary = json.loads(out)
    assert (code, summary["outcome"]) == (0, "completed"), (summary, err)
    end = summary["board"]["end"]
    # A busy machine may pause between two reads of the pseudo-terminal, which tears a frame.
    assert {name: end[name] for name in ERRORS if "crc" in name} == {
        "host_crc_errors": 0,
        "bus_crc_errors": 0,
    }


@pytest.mark.realtime
def test_an_emulator_with_a_board_serves_another_process(tmp_path: Path) -> None:
    link = tmp_path / "wrist"
    process = start("emulate", "--board", "simulated", "--wrist-link", str(link))
    try:
        ready = json.loads(line_of(process))
        assert Path(ready["wrist_port"]).exists()
        cell = tmp_path / cell_file(tmp_path, ready["kvp_port"], str(link))
        content = yaml.safe_load(cell.read_text())
        content["wrist"]["board_id"] = 200
        cell.write_text(yaml.safe_dump(content))
        code, out, _ = sphmctl("status", "--cell", str(cell), "--json")
        document = json.loads(out)
        assert (code, document["state"], document["cause"]) == (0, "ready", "")
        assert document["board"]["counters"]["host_crc_errors"] == 0
        assert document["board"]["emergency_stop"] is False
    finally:
        process.send_signal(signal.SIGTERM)
        assert finish(process)[0] == 0
    assert not link.is_symlink()


def kill_simulator_of(process_id: int) -> None:
    """Kill the simulator that a process has started."""
    children = Path(f"/proc/{process_id}/task/{process_id}/children").read_text().split()
    (simulator,) = (
        int(child)
        for child in children
        if Path(f"/proc/{child}/comm").read_text().startswith("avrsim")
    )
    os.kill(simulator, signal.SIGKILL)


@pytest.mark.realtime
def test_an_emulator_whose_simulator_dies_ends_with_a_sentence(tmp_path: Path) -> None:
    process = start("emulate", "--board", "simulated", "--wrist-link", str(tmp_path / "wrist"))
    line_of(process)
    kill_simulator_of(process.pid)
    code, _, err = finish(process)
    assert (code, err.splitlines()[1:]) == (5, [DIED])


@pytest.mark.parametrize(("at_s", "begun"), [(1.0, False), (4.0, True)])
def test_a_virtual_run_whose_simulator_dies_ends_with_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    at_s: float,
    begun: bool,
) -> None:
    make = emulation.simulated_board

    def mortal(mode: Mode, **options: Any) -> Board:
        board = make(mode, **options)
        loop = asyncio.get_running_loop()
        loop.call_later(at_s, kill_simulator_of, os.getpid())
        return board

    monkeypatch.setattr(emulation, "simulated_board", mortal)
    code = main.run(
        ["run", str(OCTAGON), "--dry-run", "--virtual", "--board", "simulated"]
        + ["--runs-dir", str(tmp_path), "--json"]
    )
    out, err = capsys.readouterr()
    told = err.splitlines()[-1]
    assert code == 5
    if begun:
        summary = json.loads(out)
        assert summary["outcome"] == "faulted"
        assert told == f"{DIED}; the record is in {summary['run_dir']}"
    else:
        assert told == DIED


def test_a_simulated_board_is_for_emulated_wrists(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text(SHORT_PATH)
    cell = cell_file(tmp_path, 1, "/dev/null")
    code, _, err = sphmctl("run", str(path), "--cell", cell, "--board", "simulated")
    assert code == 2
    assert "a simulated board is for an emulated wrist: add --dry-run" in err
    code, _, err = sphmctl("run", str(path), "--dry-run", "--board", "real")
    assert code == 2
    assert "--board: 'real': give none or simulated" in err
