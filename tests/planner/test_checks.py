"""Checks before motion: what they refuse, with row, value and limit, and what they let pass."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.motion import Floats
from sphmctl.pathfile import load_path
from sphmctl.planner import plan
from sphmctl.planner.checks import Findings, Surroundings, examine
from sphmctl.robots.geometry import pose_matrix
from sphmctl.robots.sphm.bodies import Box, Plane
from sphmctl.robots.sphm.load import Payload

PATHS = Path(__file__).parents[2] / "configs" / "paths"
CELL = emulated_cell()
AROUND = Surroundings.of(CELL, CELL.tool_matrix("octagon_pen"))
EASY_DEG = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0, 60.0, 60.0, 60.0]


def rows(*poses_deg: list[float]) -> Floats:
    return np.asarray(np.radians(np.array(poses_deg)))


def margin(found: Findings, words: str) -> tuple[float, int]:
    """The margin whose name begins so, and its row."""
    (it,) = [one for one in found.margins if one.name.startswith(words)]
    return it.value, it.row


@pytest.mark.parametrize("name", ["octagon", "octagon_joints"])
def test_the_octagon_passes_with_its_straight_leg_and_its_a5_at_0(name: str) -> None:
    made = plan(load_path(PATHS / f"{name}.yaml"), CELL)
    found = examine(made.joints, AROUND)
    assert found.problems == ()
    serial, row = margin(found, "wrist from a serial")
    assert serial < 1e-3
    assert made.joints[row, 6:].min() < 1e-5
    assert margin(found, "wrist from a parallel")[0] > 0.9
    assert margin(found, "A5")[0] < 0.1
    assert margin(found, "gap to the robot itself")[0] == 20.0
    assert 0.01 < margin(found, "static load")[0] < 0.1


def test_a_hand_on_its_forearm_is_refused_with_the_row_and_the_overlap() -> None:
    folded = [0.0, -90.0, 90.0, 0.0, 119.0, 0.0, 90.0, 90.0, 90.0]
    found = examine(rows(EASY_DEG, EASY_DEG, folded, EASY_DEG), AROUND)
    assert {one.row for one in found.problems} == {2}
    messages = [one.problem.message for one in found.problems]
    assert any("legs reach" in text and "into the forearm" in text for text in messages)
    for one in found.problems:
        assert one.problem.value is not None
        assert one.problem.value < 0.0
        assert one.problem.limit == 0.0
        assert f"{-one.problem.value:.1f} mm" in one.problem.message


def test_an_arm_that_reaches_into_a_box_or_through_a_wall_is_refused_by_name() -> None:
    post = Box("post", pose_matrix([0.55, 0.0, 0.5], [0.0, 0.0, 0.0]), np.array([0.1, 0.1, 0.5]))
    wall = Plane("wall", np.array([0.0, -0.2, 0.0]), np.array([0.0, 1.0, 0.0]))
    around = replace(AROUND, obstacles=(post, wall))
    aside, through = [-60.0, *EASY_DEG[1:]], [60.0, *EASY_DEG[1:]]
    clear = examine(rows(aside), around)
    assert clear.problems == ()
    assert margin(clear, "gap to obstacles")[0] > 0.0
    found = examine(rows(aside, EASY_DEG, through), around)
    told = {(one.row, one.problem.message.split(" into the ")[1]) for one in found.problems}
    assert (1, "post; to touch is the most") in told
    assert (2, "wall; to touch is the most") in told
    assert margin(found, "gap to obstacles")[0] < 0.0


def test_too_heavy_a_payload_is_refused_for_each_servo_that_it_stalls() -> None:
    arm = [0.0, -90.0, 90.0, 0.0, 90.0, 0.0]
    level, leaning = [*arm, 60.0, 60.0, 60.0], [*arm, 90.0, 60.0, 60.0]
    around = replace(AROUND, payload=Payload(4.0, (0.0, 0.0, 0.0)))
    found = examine(rows(level, leaning), around)
    assert [one.problem.joint for one in found.problems] == ["theta7", "theta8", "theta9"]
    for one in found.problems:
        assert one.problem.limit == pytest.approx(0.28)
        assert "20% of its servo's stall torque" in one.problem.message
    assert (
        examine(rows(level, leaning), replace(AROUND, payload=Payload(0.5, (0, 0, 0)))).problems
        == ()
    )


def test_lost_control_of_the_platform_is_refused() -> None:
    # From mid-range to cranks beyond their range, where a second assembly comes near.
    cranks = 60.0 + np.linspace(0.0, 0.97, 30)[:, None] * np.array([-54.0, -54.0, 80.0])
    found = examine(rows(*[[*EASY_DEG[:6], *triple] for triple in cranks]), AROUND)
    (lost,) = [one for one in found.problems if "lose control" in one.problem.message]
    assert lost.row == 29
    assert lost.problem.value is not None
    assert 0.0 < lost.problem.value < 0.05 == lost.problem.limit
    assert margin(found, "wrist from a parallel") == (lost.problem.value, 29)
    assert not examine(rows(*[[*EASY_DEG[:6], *triple] for triple in cranks[:20]]), AROUND).problems


def test_rows_without_numbers_are_passed_over() -> None:
    broken = [*EASY_DEG[:6], 6.0, 6.0, 140.0]
    floor = Plane("floor", np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    post = Box("post", pose_matrix([2.0, 0.0, 0.0], [0.0, 0.0, 0.0]), np.array([0.1, 0.1, 0.5]))
    found = examine(rows(EASY_DEG, broken), replace(AROUND, obstacles=(floor, post)))
    assert found.problems == ()
    assert all(np.isfinite(one.value) and one.row == 0 for one in found.margins)
