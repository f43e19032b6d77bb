"""`run` killed, and its TCP link cut, in real processes: when the arm stands, and the words.

Judged from truth.csv. The emulated cell is a process of its own, as a real one is; a forwarder
stands for the network.
"""

from __future__ import annotations

import contextlib
import json
import select
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sphmctl.motion import Floats
from tests.system.rig import STILL_DEG
from tests.system.stop_rig import LATE_S, LOOK, SEE_TO, STAND_S, stands_s
from tests.system.test_command_run import OCTAGON, WAIT_S, cell_file, finish, line_of, start

pytestmark = pytest.mark.realtime

WATCHED_S = 2.5
"""How long the arm is watched, more than twice the second after which its program gives up."""

ON_THE_WAY_BYTES = 20_000
"""Size of feedback.csv at about one second of the octagon, 10 ms a row."""

SLOW_HOST_S = 0.1
"""What a busy machine may add: what was sent before the event is read late."""

EXIT_DEVICE, EXIT_FAULT, EXIT_CTRL_C = 5, 6, 130


def pass_time(seconds: float) -> None:
    """Let real time pass."""
    select.select([], [], [], seconds)


class Forwarder:
    """The network between `run` and the controller, at a loopback port of its own."""

    def __init__(self, target_port: int) -> None:
        self._target_port = target_port
        self._ends: list[socket.socket] = []
        self.port = 0
        self.connect()

    def connect(self) -> None:
        """Take connections, at the same port as before."""
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()

    def cut(self) -> None:
        """Close every connection and take no new one."""
        # A thread that waits in accept() keeps the port open unless it is woken.
        for end in (self._listener, *self._ends):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._ends.clear()

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                here, _ = listener.accept()
                there = socket.create_connection(("127.0.0.1", self._target_port))
                for end in (here, there):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._ends += [here, there]
                for pair in ((here, there), (there, here)):
                    threading.Thread(target=_pump, args=pair, daemon=True).start()


def _pump(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
        sink.shutdown(socket.SHUT_RDWR)


@dataclass
class Place:
    """A served cell and where its runs are left."""

    folder: Path
    ready: dict[str, Any]
    network: Forwarder
    cell: str

    def start_run(self, name: str) -> subprocess.Popen[str]:
        """Start `run` on the octagon."""
        return start(
            *("run", OCTAGON, "--cell", self.cell, "--yes", "--json"),
            *("--runs-dir", str(self.folder / name)),
        )

    def wait_for_motion(self, process: subprocess.Popen[str], name: str) -> None:
        """Wait until a run is on the octagon."""
        end_s = time.monotonic() + WAIT_S
        while time.monotonic() < end_s and process.poll() is None:
            rows = list((self.folder / name).glob("*/feedback.csv"))
            if rows and rows[0].stat().st_size > ON_THE_WAY_BYTES:
                return
            pass_time(0.02)
        raise AssertionError(process.communicate(timeout=WAIT_S))

    def rows(self, event_s: float, end_s: float) -> Floats:
        """truth.csv between two monotonic instants: time since the first, six axes."""
        text = (self.folder / "truth.csv").read_text().splitlines()[1:-1]
        rows = np.array([[float(field) for field in line.split(",")[:7]] for line in text])
        rows[:, 0] += self.ready["start_monotonic_s"] - event_s
        part: Floats = rows[(rows[:, 0] >= -0.5) & (rows[:, 0] <= end_s - event_s)]
        return part

    def can_run(self, name: str) -> None:
        """The next run reaches the octagon, and Ctrl-C ends it."""
        process = self.start_run(name)
        self.wait_for_motion(process, name)
        process.send_signal(signal.SIGINT)
        code, out, _ = finish(process)
        assert (code, json.loads(out)["outcome"]) == (EXIT_CTRL_C, "stopped")


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Place]:
    process = start("emulate", "--truth", str(tmp_path / "truth.csv"))
    ready = json.loads(line_of(process))
    network = Forwarder(ready["kvp_port"])
    yield Place(tmp_path, ready, network, cell_file(tmp_path, network.port, ready["wrist_port"]))
    network.cut()
    process.send_signal(signal.SIGTERM)
    assert finish(process)[0] == 0


def stood_in_time(name: str, rows: Floats) -> None:
    """The arm was in motion before the event, stood in time, and stands to the last row."""
    before = rows[rows[:, 0] <= 0.0, 1:]
    assert np.ptp(before, axis=0).max() > 1.0
    print(f"{name}: stands after {1000.0 * stands_s(rows):.0f} ms, watched {rows[-1, 0]:.1f} s")
    assert stands_s(rows) <= STAND_S + LATE_S + SLOW_HOST_S
    assert rows[-1, 0] > 0.9 * WATCHED_S
    assert np.abs(np.diff(rows[rows[:, 0] > 1.0, 1:], axis=0)).max() < STILL_DEG


@pytest.mark.many
def test_after_kill_9_the_arm_stands_and_the_next_run_can_begin(place: Place) -> None:
    process = place.start_run("first")
    place.wait_for_motion(process, "first")
    event_s = time.monotonic()
    process.kill()
    process.communicate(timeout=WAIT_S)
    pass_time(WATCHED_S)
    stood_in_time("run killed", place.rows(event_s, time.monotonic()))
    place.can_run("second")


@pytest.mark.many
def test_a_cut_that_lasts_is_told_and_the_next_runs_say_so_until_it_is_mended(
    place: Place,
) -> None:
    process = place.start_run("first")
    place.wait_for_motion(process, "first")
    event_s = time.monotonic()
    place.network.cut()
    code, out, err = finish(process)
    summary = json.loads(out)
    assert (code, summary["outcome"]) == (EXIT_FAULT, "faulted")
    assert summary["cause"].endswith(": the connection was closed by the other side")
    assert "the arm could not be seen to stand" in summary["unconfirmed"][0]
    assert summary["remedy"] == LOOK
    assert err.splitlines()[-1] == f"to go on: {LOOK}"
    code, out, _ = finish(place.start_run("refused"))
    assert code == EXIT_DEVICE
    assert "nothing listens there" in json.loads(out)["error"]["message"]
    place.network.connect()
    pass_time(WATCHED_S)
    stood_in_time("TCP link cut", place.rows(event_s, time.monotonic()))
    place.can_run("second")


@pytest.mark.many
def test_a_cut_that_is_mended_at_once_ends_the_run_with_both_seen_to_stand(place: Place) -> None:
    process = place.start_run("first")
    place.wait_for_motion(process, "first")
    event_s = time.monotonic()
    place.network.cut()
    pass_time(0.3)
    place.network.connect()
    code, out, err = finish(process)
    summary = json.loads(out)
    assert (code, summary["outcome"]) == (EXIT_FAULT, "faulted")
    assert summary["cause"].endswith(": the connection was closed by the other side")
    assert summary["unconfirmed"] == []
    assert err.splitlines()[-2:] == ["both devices stand", f"to go on: {SEE_TO}, then run again"]
    pass_time(WATCHED_S)
    stood_in_time("TCP link cut for 0.3 s", place.rows(event_s, time.monotonic()))
    place.can_run("second")
