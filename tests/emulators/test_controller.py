"""How the emulated controller begins, and what its operator's hands do to it."""

from __future__ import annotations

import pytest

from sphmctl.emulators.controller import Options
from tests.emulators.krc4_rig import HOME, RUN, RUNNING, Rig, away


@pytest.mark.parametrize("state", ["P_FREE", "P_RESET", "P_ACTIVE", "P_STOP"])
def test_it_begins_in_the_program_state_asked_for_and_stays_so(state: str) -> None:
    rig = Rig(Options(program_state=state))
    rig.wait_ms(100)
    assert rig.read("$PRO_STATE1") == f"#{state}"
    assert rig.read("$PRO_STATE0") == "#P_ACTIVE"
    assert rig.controller.true_joints_deg() == HOME


def test_a_state_that_no_controller_begins_in_is_refused() -> None:
    with pytest.raises(ValueError, match="'P_END' is not one of P_FREE, P_RESET, P_ACTIVE, P_STOP"):
        Options(program_state="P_END")


def test_another_program_is_selected_and_never_moves() -> None:
    rig = Rig(Options(program="other"))
    rig.write("SPH_SESSION", "1")
    rig.wait_ms(100)
    assert rig.read("$PRO_NAME1[]") == '"OTHER"'
    assert rig.state("SESSION") == 0


def test_the_program_has_driven_its_bco_run_before_the_world_begins() -> None:
    rig = Rig()
    assert rig.controller.krc.messages[-1].text == "programmed path reached (BCO)"
    assert (rig.read("$MOVE_BCO"), rig.read("$ROB_TIMER")) == ("FALSE", "3600000")


def test_drives_that_are_switched_off_in_motion_stop_the_arm_on_its_path() -> None:
    rig = Rig()
    rig.session()
    rig.knot(1, away(90.0))
    rig.command(RUN)
    rig.wait_for(RUNNING)
    rig.wait_ms(300)
    rig.controller.panel.drives = False
    rig.wait_ms(200)
    assert rig.read("$PERI_RDY") == "FALSE"
    stood = rig.controller.true_joints_deg()
    assert 0.0 < stood[0] < 90.0
    assert stood[1:] == HOME[1:]
    rig.wait_ms(300)
    assert rig.controller.true_joints_deg() == stood


def test_a_client_that_takes_the_drives_away_stops_the_program() -> None:
    rig = Rig()
    rig.write("$DRIVES_ENABLE", "FALSE")
    rig.wait_ms(13)
    assert (rig.read("$PRO_STATE1"), rig.read("$PERI_RDY")) == ("#P_STOP", "FALSE")
