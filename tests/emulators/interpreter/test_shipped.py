"""The files of firmware/krc as they are shipped, on a real mover, driven by their variables."""

from __future__ import annotations

import pytest

from sphmctl.emulators.interpreter import submit_program
from tests.emulators.interpreter.rig import Rig, shipped

IDLE, RUN, HOLD, STOP = 0, 1, 2, 3
READY, RUNNING, HOLDING, STOPPED, ENDED, FAULT = 1, 2, 3, 4, 5, 6


class Daemon:
    """Writes what sphmctl writes, and beats."""

    def __init__(self) -> None:
        self.rig = Rig(*shipped(), submit_program(["SPH_SPS_INIT()"], ["SPH_SPS()"]))
        self.beat = 0
        self.rig.go(0.1)
        self.rig.krc.select("SPH_RUN")
        assert self.rig.krc.start()
        self.rig.go(0.5)

    def put(self, name: str, text: object) -> None:
        assert self.rig.memory.write_text(name, str(text)), name

    def field(self, name: str) -> int:
        return int(self.rig.get("SPH_STATE")[name])

    def go(self, seconds: float, beats: bool = True) -> None:
        for _ in range(round(seconds / 0.024)):
            if beats:
                self.beat += 1
                self.put("SPH_BEAT", self.beat)
            self.rig.go(0.024)

    def until(self, status: int, limit_s: float = 20.0) -> None:
        begin = self.rig.time_s
        while self.field("STATUS") != status:
            assert self.rig.time_s - begin < limit_s, (self.rig.get("SPH_STATE"), status)
            self.go(0.024)

    def session(self, number: int) -> None:
        for name in ("SPH_CMD", "SPH_WR", "SPH_LAST"):
            self.put(name, 0)
        self.put("SPH_SESSION", number)
        self.until(READY)
        assert self.field("SESSION") == number

    def knots(self, *a1: float, last: bool = True, velocity: float = 30.0) -> None:
        for number, angle in enumerate(a1, start=1):
            axes = f"A1 {angle},A2 -90.0,A3 90.0,A4 0.0,A5 90.0,A6 0.0"
            text = f"{{SEQ {number},VEL {velocity},ACC 50.0,Q {{{axes}}}}}"
            self.put(f"SPH_KNOT[{number}]", text)
        if last:
            self.put("SPH_LAST", len(a1))
        self.put("SPH_WR", len(a1))


@pytest.fixture
def daemon() -> Daemon:
    return Daemon()


def test_it_reaches_ready_and_takes_knots_from_the_ring(daemon: Daemon) -> None:
    daemon.session(7)
    daemon.knots(*(2.0 * k for k in range(1, 11)))
    daemon.go(0.1)
    daemon.put("SPH_CMD", RUN)
    daemon.until(ENDED)
    assert (daemon.field("RD"), daemon.field("DONE")) == (10, 10)
    assert daemon.rig.mover.joints_deg[0] == 20.0
    assert daemon.rig.krc.state == "P_ACTIVE"


def test_a_second_session_follows(daemon: Daemon) -> None:
    for number, angle in ((1, 5.0), (2, 0.0)):
        daemon.session(number)
        daemon.knots(angle)
        daemon.put("SPH_CMD", RUN)
        daemon.until(ENDED)
        assert daemon.rig.mover.joints_deg[0] == angle


def test_hold_keeps_what_is_planned_and_run_goes_on(daemon: Daemon) -> None:
    daemon.session(1)
    daemon.knots(20.0, 40.0)
    daemon.put("SPH_CMD", RUN)
    daemon.go(0.3)
    daemon.put("SPH_CMD", HOLD)
    daemon.until(HOLDING)
    stood = daemon.rig.mover.joints_deg
    daemon.go(0.5)
    assert daemon.rig.mover.joints_deg == stood
    daemon.put("SPH_CMD", RUN)
    daemon.until(ENDED)
    assert daemon.rig.mover.joints_deg[0] == 40.0


def test_stop_forgets_and_nothing_moves_later(daemon: Daemon) -> None:
    daemon.session(1)
    daemon.knots(20.0, 40.0)
    daemon.put("SPH_CMD", RUN)
    daemon.go(0.3)
    daemon.put("SPH_CMD", STOP)
    daemon.until(STOPPED)
    stood = daemon.rig.mover.joints_deg
    daemon.put("SPH_CMD", RUN)
    daemon.go(1.0)
    assert daemon.rig.mover.joints_deg == stood
    daemon.session(2)
    daemon.knots(0.0)
    daemon.put("SPH_CMD", RUN)
    daemon.until(ENDED)
    assert daemon.rig.mover.joints_deg[0] == 0.0


def test_a_late_heartbeat_holds_and_a_lost_one_ends_the_motion(daemon: Daemon) -> None:
    daemon.session(1)
    daemon.knots(60.0, velocity=10.0)
    daemon.put("SPH_CMD", RUN)
    daemon.go(0.3)
    daemon.go(0.4, beats=False)
    assert daemon.field("STATUS") == HOLDING
    daemon.go(0.2)
    assert daemon.field("STATUS") == RUNNING
    daemon.go(1.3, beats=False)
    assert (daemon.field("STATUS"), daemon.field("FAULT")) == (FAULT, 1)
    stood = daemon.rig.mover.joints_deg
    daemon.go(1.0)
    assert daemon.rig.mover.joints_deg == stood


def test_a_wrong_sequence_number_ends_the_motion(daemon: Daemon) -> None:
    daemon.session(1)
    daemon.knots(5.0, last=False)
    daemon.put("SPH_WR", 2)
    daemon.put("SPH_CMD", RUN)
    daemon.until(FAULT)
    assert daemon.field("FAULT") == 2


def test_the_line_knot_toggles_at_each_knot(daemon: Daemon) -> None:
    heard: list[bool] = []
    daemon.rig.memory.put("SPH_OUT_KNOT", 9)
    daemon.rig.krc.terminals.outputs.changed = lambda _, level: heard.append(level)
    daemon.session(1)
    daemon.knots(5.0, 10.0, 15.0)
    daemon.put("SPH_CMD", RUN)
    daemon.until(ENDED)
    assert heard == [True, False, True]


def test_a_submit_interpreter_that_stops_ends_the_motion(daemon: Daemon) -> None:
    daemon.session(1)
    daemon.knots(60.0)
    daemon.put("SPH_CMD", RUN)
    daemon.go(0.3)
    daemon.rig.krc.stop_submit()
    daemon.rig.until(lambda: not daemon.rig.mover.moving)
    daemon.rig.until(lambda: daemon.rig.get("SPH_STATUS") == FAULT)
    assert daemon.rig.mover.joints_deg[0] < 50.0


def test_after_an_emergency_stop_nothing_moves_but_by_a_new_session(daemon: Daemon) -> None:
    rig = daemon.rig
    daemon.session(1)
    daemon.knots(60.0)
    daemon.put("SPH_CMD", RUN)
    daemon.go(0.3)
    rig.panel.alarm_stop = False
    rig.krc.stop(1, "emergency stop")
    daemon.go(0.5)
    assert (daemon.field("STATUS"), daemon.field("FAULT")) == (FAULT, 4)
    stood = rig.mover.joints_deg
    rig.panel.alarm_stop = True
    rig.krc.confirm()
    rig.mover.drives_on()
    assert rig.krc.start()
    daemon.go(1.0)
    assert rig.mover.joints_deg == stood
    daemon.session(2)
    daemon.knots(0.0)
    daemon.put("SPH_CMD", RUN)
    daemon.until(ENDED)
