"""What the robot program does where something changes between two looks, or nobody looks at all."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from sphmctl.emulators.controller import Options
from sphmctl.emulators.interpreter import Options as KrlOptions
from sphmctl.emulators.interpreter import submit_program
from tests.emulators.interpreter.rig import FIRMWARE, shipped
from tests.emulators.interpreter.rig import Rig as Small
from tests.emulators.krc4_rig import (
    FAULT,
    HOLD,
    HOLDING,
    HOME,
    READY,
    RUN,
    RUNNING,
    STOP,
    STOPPED,
    Rig,
    away,
)

CONTROLLER, SUBMIT = 4, 6
CYCLE_MS = 12
EARLY = Options(interpreter=KrlOptions(looks_early=True))


def several(rig: Rig, count: int = 20) -> None:
    """A session with knots to and fro, told to run."""
    rig.session()
    for number in range(1, count + 1):
        rig.knot(number, away(60.0 if number % 2 else 0.0), 20.0)
    rig.write("SPH_LAST", str(count))


def test_without_the_submit_interpreter_a_run_command_moves_nothing() -> None:
    rig = Rig()
    several(rig)
    # Until the last pass has seen a heartbeat and found nothing in the way.
    rig.wait_for_value("SPH_BRAKE", "FALSE")
    rig.controller.krc.stop_submit()
    rig.beating = False
    rig.command(RUN)
    rig.wait_ms(3000)
    assert rig.controller.true_joints_deg() == HOME
    assert rig.read("SPH_STATUS") == str(READY)


@pytest.mark.parametrize("wait_s", [0.15, 0.5, 2.0])
def test_a_submit_loop_that_gets_slow_ends_the_motion_though_the_heart_beats(wait_s: float) -> None:
    lines = ["SPH_SPS()", "IF $FLAG[9] THEN", f"WAIT SEC {wait_s}", "ENDIF"]
    rig = Small(*shipped(), submit_program(["SPH_SPS_INIT()"], lines))
    memory = rig.memory

    def go(seconds: float) -> None:
        for beat in range(round(seconds / 0.024)):
            assert memory.write_text("SPH_BEAT", str(rig.steps + beat))
            rig.go(0.024)

    rig.go(0.1)
    rig.krc.select("SPH_RUN")
    assert rig.krc.start()
    go(0.5)
    axes = "A1 60.0,A2 -90.0,A3 90.0,A4 0.0,A5 90.0,A6 0.0"
    assert memory.write_text("SPH_SESSION", "1")
    go(0.1)
    assert memory.write_text("SPH_KNOT[1]", f"{{SEQ 1,VEL 20.0,ACC 50.0,Q {{{axes}}}}}")
    for name, number in (("SPH_LAST", 1), ("SPH_WR", 1), ("SPH_CMD", RUN)):
        assert memory.write_text(name, str(number))
    go(0.4)
    assert rig.mover.moving
    memory.put("$FLAG", [number == 9 for number in range(1, 1025)])
    go(0.36)
    assert not rig.mover.moving
    assert memory.get("SPH_FAULT") == SUBMIT
    stood = rig.mover.joints_deg
    assert 0.0 < stood[0] < 50.0
    memory.put("$FLAG", [False] * 1024)
    go(wait_s + 1.0)
    assert rig.mover.joints_deg == stood
    assert memory.get("SPH_STATE")["STATUS"] == FAULT


@pytest.mark.parametrize("what", ["wrist ok", "submit"])
def test_an_interrupt_between_the_streams_early_end_and_its_switching_off_is_legal(
    what: str,
) -> None:
    """One statement of the program for each look at the interrupts."""
    rig = Rig(Options(lines=True, interpreter=KrlOptions(robot_statements=1)))
    krc, lines = rig.controller.krc, rig.controller.lines
    assert lines is not None
    lines.wrist_ok = True
    rig.wait_ms(2000)
    rig.write("SPH_SESSION", "1")
    rig.wait_for(READY, 8000)
    rig.knot(1, away(5.0))
    rig.wait_for_value("SPH_BRAKE", "FALSE")
    rig.command(RUN)
    text = (FIRMWARE / "sph_run.src").read_text().splitlines()
    reached = []
    for _ in range(60):
        line = text[krc.place[2] - 1].strip()
        reached.append(line)
        if line == "SPH_BRAKED=FALSE" and "SPH_STREAM()" in reached:
            rig.command(HOLD)
        if line == "INTERRUPT OFF 19" and "RETURN" in reached:
            if what == "submit":
                krc.stop_submit()
            else:
                lines.wrist_ok = False
        rig.wait_ms(CYCLE_MS)
    assert "RETURN" in reached
    assert rig.read("$PRO_STATE1") == "#P_ACTIVE"
    assert not [message.text for message in krc.messages if message.stops]


def test_a_stop_that_follows_a_run_between_two_looks_is_not_lost() -> None:
    rig = Rig(EARLY)
    several(rig)
    rig.command(RUN)
    rig.wait_for(RUNNING)
    rig.command(HOLD)
    rig.wait_for(HOLDING)
    rig.wait_ms(CYCLE_MS - rig.world.index % CYCLE_MS + 5)
    # The interrupts were looked at 1 ms ago; the program's turn comes in 7 ms.
    rig.command(RUN)
    rig.wait_ms(8)
    rig.command(STOP)
    rig.wait_for(STOPPED, 200)
    rig.wait_ms(150)
    stood = rig.controller.true_joints_deg()
    rig.wait_ms(1000)
    assert rig.controller.true_joints_deg() == stood


def test_the_stop_key_ends_the_motion_and_start_moves_nothing() -> None:
    rig = Rig()
    several(rig)
    rig.command(RUN)
    rig.wait_for(RUNNING)
    rig.wait_ms(200)
    rig.controller.panel.program_state = "P_STOP"
    rig.wait_ms(500)
    assert (rig.state("STATUS"), rig.state("FAULT")) == (FAULT, CONTROLLER)
    stood = rig.controller.true_joints_deg()
    rig.controller.release()
    rig.wait_ms(1000)
    assert rig.controller.true_joints_deg() == stood


def test_what_an_earlier_run_left_is_cleared_when_the_program_starts() -> None:
    rig = Rig()
    several(rig)
    rig.controller.panel.program_state = "P_STOP"
    rig.controller.krc.stop_submit()
    rig.controller.panel.program_state = "P_RESET"
    rig.command(RUN)
    rig.controller.panel.program_state = "P_ACTIVE"
    rig.wait_ms(100)
    assert [rig.read(name) for name in ("SPH_CMD", "SPH_BRAKE", "SPH_STATUS")] == ["0", "TRUE", "0"]


def test_a_timer_that_begins_anew_does_not_hide_a_lost_heartbeat() -> None:
    rig = Rig(Options(timer_ms=2**31 - 1000))
    several(rig, 4)
    rig.command(RUN)
    rig.wait_for(RUNNING)
    before = int(str(rig.state("TIME")))
    while int(str(rig.state("TIME"))) < 2**31 - 50:
        rig.wait_ms(CYCLE_MS)
        assert rig.state("STATUS") == RUNNING
    rig.beating = False
    rig.wait_for(HOLDING, 400)
    assert int(str(rig.state("TIME"))) < before
    rig.wait_for(FAULT, 1100)


@pytest.mark.parametrize(
    ("options", "twitch_deg"),
    [
        (KrlOptions(), 0.05),
        (KrlOptions(looks_early=True), 0.6),
        (KrlOptions(looks_early=True, robot_statements=40), 0.6),
        (KrlOptions(fires_when_already_true=True), 0.05),
    ],
    ids=["plain", "early", "early and slow", "already true"],
)
@pytest.mark.parametrize("seed", range(3))
def test_whatever_comes_in_whatever_order_nothing_moves_that_should_stand(
    options: KrlOptions, twitch_deg: float, seed: int
) -> None:
    """A start after the controller's own stop drives on until interrupt 20 is looked at."""
    rng = random.Random(seed)
    rig = Rig(Options(lines=True, interpreter=options))
    lines = rig.controller.lines
    krc, panel = rig.controller.krc, rig.controller.panel
    assert lines is not None
    lines.wrist_ok = True

    def begin(session: int) -> None:
        """What the daemon does, without looking whether it works."""
        for name in ("SPH_CMD", "SPH_WR", "SPH_LAST"):
            rig.write(name, "0")
        rig.write("SPH_SESSION", str(session))
        rig.wait_ms(60)
        for number in range(1, 9):
            rig.knot(number, away(30.0 if number % 2 else 0.0), 30.0)
        rig.write("SPH_LAST", "8")

    disturbances: tuple[Callable[[], object], ...] = (
        lambda: setattr(lines, "wrist_ok", False),
        lambda: setattr(lines, "wrist_ok", True),
        rig.controller.emergency_stop,
        lambda: setattr(panel, "drives", False),
        krc.stop_submit,
        lambda: krc.press_submit("start"),
        lambda: setattr(rig, "beating", False),
        lambda: setattr(rig, "beating", True),
        rig.controller.release,
        lambda: setattr(panel, "program_state", "P_STOP"),
        *(partial(rig.command, number) for number in (0, RUN, RUN, HOLD, STOP)),
    )
    for session in range(1, 9):
        krc.press_submit("start")
        lines.wrist_ok = rig.beating = True
        rig.controller.release()
        begin(session)
        rig.command(RUN)
        for _ in range(rng.randrange(1, 12)):
            rig.wait_ms(rng.choice((1, 3, 5, 12, 30, 150)))
            rng.choice(disturbances)()
        rig.wait_ms(1)
        # Whatever was before: after this nothing may move.
        rig.command(STOP)
        rig.wait_ms(500)
        stood = rig.controller.true_joints_deg()
        lines.wrist_ok = rig.beating = True
        krc.press_submit("start")
        rig.controller.release()
        rig.wait_ms(rng.choice((100, 1200)))
        rig.command(RUN)
        rig.wait_ms(1000)
        assert np.abs(np.subtract(rig.controller.true_joints_deg(), stood)).max() < twitch_deg
        assert not [m.text for m in krc.messages if "impermissible" in m.text]
        passed, taken = rig.read("SPH_DONE"), rig.read("SPH_RD")
        assert int(str(passed)) <= int(str(taken)) <= 8
