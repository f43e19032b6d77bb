"""The wrist policies: each keeps its promise on every row, and `Auto` always finds a way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
import py_opw_kinematics as opw
import pytest
from py_opw_kinematics import _internal as opw_internal

from sphmctl.config import emulated_cell
from sphmctl.motion import Floats
from sphmctl.pathfile import load_path
from sphmctl.planner import plan
from sphmctl.planner.legs import Setup
from sphmctl.planner.policies import Auto, Cranks, Fixed, Level, Motion, Policy, Tilt
from sphmctl.planner.policies.outcome import Outcome, Resolved
from sphmctl.planner.redundancy import resolve
from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.geometry import angle_between, pose_matrix, wrap
from tests.planner.random_paths import HIGH, LOW, PEN, SETUP, Made, forward, length, some

OCTAGON = FilePath(__file__).parents[2] / "configs" / "paths" / "octagon.yaml"
MIDDLE = np.radians([60.0, 60.0, 60.0])


def line(
    begin_mm: tuple[float, ...], end_mm: tuple[float, ...], rows: int = 201
) -> tuple[Floats, Floats]:
    """Tool poses and arc lengths from one x, y, z, A, B, C to another, angles linear."""
    share = np.linspace(0.0, 1.0, rows)[:, None]
    points = np.array(begin_mm) + share * (np.array(end_mm) - np.array(begin_mm))
    target = pose_matrix(points[:, :3] / 1e3, np.radians(points[:, 3:]))
    return target, length(target)


DOWN = line((450.0, -100.0, 250.0, 180.0, 0.0, 180.0), (600.0, 100.0, 250.0, 180.0, 0.0, 180.0))
LEANING = line((480.0, 0.0, 250.0, 180.0, 0.0, 180.0), (520.0, 100.0, 250.0, 180.0, 15.0, 175.0))


def good(outcome: Outcome, target: Floats, setup: Setup = SETUP) -> Floats:
    """The joints, after the promises that hold for every policy."""
    assert isinstance(outcome, Resolved), outcome
    q = outcome.joints
    reached = sphm.forward(q, setup.tool, setup.mount_yaw)
    assert np.abs(reached - target).max() < 1e-9
    assert (q >= setup.ranges[:, 0]).all()
    assert (q <= setup.ranges[:, 1]).all()
    steps = np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0)
    assert (np.delete(steps, outcome.steep) <= 0.2).all()
    return q


@pytest.fixture(scope="module")
def octagon() -> tuple[Floats, Floats, Floats, Setup]:
    """Joints of today's plan, its tool poses, their arc length, the robot."""
    path, cell = load_path(OCTAGON), emulated_cell()
    made = plan(path, cell)
    return made.joints, made.tool, length(made.tool), Setup.of(path, cell)


@pytest.mark.parametrize("given", [True, False])
def test_the_octagon_with_its_cranks_is_resolved_as_it_is_planned(
    octagon: tuple[Floats, Floats, Floats, Setup], given: bool
) -> None:
    joints, target, s_m, setup = octagon
    start, end = (joints[0], joints[-1]) if given else (None, None)
    q = good(resolve(target, s_m, Cranks(joints[:, 6:]), setup, start, end), target, setup)
    np.testing.assert_allclose(q, joints, atol=1e-9)


def test_auto_moves_axes_1_to_3_less_on_the_octagon_and_stays_off_every_limit(
    octagon: tuple[Floats, Floats, Floats, Setup],
) -> None:
    joints, target, s_m, setup = octagon
    q = good(resolve(target, s_m, Auto(), setup), target, setup)
    fixed = good(resolve(target, s_m, Fixed(MIDDLE), setup), target, setup)
    for other in (joints, fixed):
        saved = np.abs(np.diff(q[:, :3], axis=0)).sum(0) / np.abs(
            np.diff(other[:, :3], axis=0)
        ).sum(0)
        assert (saved < 0.99).all()
    assert np.degrees(sphm.margin_of(q, setup.ranges).min()) > 5.0
    assert np.degrees(np.abs(q[:, 4]).min()) > 5.0
    again = resolve(target, s_m, Auto(), setup)
    np.testing.assert_array_equal(good(again, target, setup), q)


def test_auto_is_no_dearer_than_level_and_tilt() -> None:
    target, s_m = LEANING
    costs = []
    for policy in (Auto(), Level(), Tilt()):
        outcome = resolve(target, s_m, policy, SETUP)
        assert isinstance(outcome, Resolved)
        costs.append(outcome.cost)
    assert costs[0] <= min(costs)


@pytest.mark.parametrize("path", some(12))
def test_known_cranks_give_back_the_joints_that_made_the_path(path: Made) -> None:
    outcome = resolve(
        path.target, path.s_m, Cranks(path.joints[:, 6:]), SETUP, path.joints[0], path.joints[-1]
    )
    np.testing.assert_allclose(good(outcome, path.target), path.joints, atol=1e-6)
    free = resolve(path.target, path.s_m, Cranks(path.joints[:, 6:]), SETUP)
    good(free, path.target)


@pytest.mark.parametrize("path", some(4, 200))
def test_auto_finds_a_way_for_every_path_that_has_one(path: Made) -> None:
    good(resolve(path.target, path.s_m, Auto(), SETUP), path.target)


@pytest.mark.parametrize("path", some(3, 40))
def test_auto_is_never_dearer_than_a_way_it_is_told_of(path: Made) -> None:
    cranks, (start, end) = Cranks(path.joints[:, 6:]), path.joints[[0, -1]]
    own = resolve(path.target, path.s_m, cranks, SETUP, start, end)
    best = resolve(path.target, path.s_m, Auto((cranks,)), SETUP, start, end)
    q = good(best, path.target)
    np.testing.assert_allclose(q[[0, -1]], path.joints[[0, -1]], atol=1e-6)
    assert isinstance(own, Resolved)
    assert isinstance(best, Resolved)
    assert best.cost <= own.cost


def test_the_arm_agrees_with_py_opw_kinematics_on_every_row() -> None:
    target, s_m = LEANING
    q = good(resolve(target, s_m, Auto(), SETUP), target)
    model = opw.KinematicModel(
        a1=0.025,
        a2=-0.035,
        b=0.0,
        c1=0.400,
        c2=0.455,
        c3=0.420,
        c4=0.080,
        offsets=(0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0),
        flip_axes=(True, False, False, True, False, True),
    )
    arm = opw_internal.Robot(model, degrees=False)
    flange = sphm.flange_target(target, q[:, 6:], PEN, SETUP.mount_yaw)
    for pose, joints in zip(flange[::20], q[::20, :6], strict=True):
        answers = np.array(arm.inverse(pose))
        assert np.abs(wrap(answers - joints)).max(axis=1).min() < 1e-7


def test_level_keeps_the_platform_parallel_to_the_flange() -> None:
    target, s_m = LEANING
    q = good(resolve(target, s_m, Level(), SETUP), target)
    assert np.ptp(q[:, 6:], axis=1).max() < 1e-12
    heave = np.linspace(0.05, 0.08, len(s_m))
    q = good(resolve(target, s_m, Level(heave), SETUP), target)
    np.testing.assert_allclose(rrs.forward(q[:, 6:])[:, 2, 3], heave, atol=1e-12)
    assert np.degrees(rrs.tilt_of(rrs.forward(q[:, 6:]))[1].max()) < 1e-9


@pytest.mark.parametrize("heave_m", [None, 0.062])
@pytest.mark.parametrize("lean_deg", [None, 8.0])
def test_tilt_keeps_the_flanges_axis_while_the_tool_leans(
    heave_m: float | None, lean_deg: float | None
) -> None:
    target, s_m = LEANING
    platform = target[0, :3, :3] @ PEN[:3, :3].T
    keep = platform
    if lean_deg is not None:
        keep = platform @ pose_matrix([0, 0, 0], np.radians([0.0, lean_deg, 0.0]))[:3, :3]
    heave = None if heave_m is None else np.full(len(s_m), heave_m)
    policy = Tilt(None if lean_deg is None else keep, heave)
    q = good(resolve(target, s_m, policy, SETUP), target)
    normal = kr6.forward(q[:, :6])[:, :3, 2]
    np.testing.assert_allclose(normal, np.broadcast_to(keep[:, 2], normal.shape), atol=1e-9)
    tilted = rrs.tilt_of(rrs.forward(q[:, 6:]))[1]
    assert np.degrees(np.ptp(tilted)) > 5.0
    if heave_m is not None:
        np.testing.assert_allclose(rrs.forward(q[:, 6:])[:, 2, 3], heave_m, atol=1e-9)


def test_tilt_from_a_start_keeps_the_starts_flange() -> None:
    target, s_m = LEANING
    start = good(resolve(target, s_m, Fixed(np.radians([50.0, 60.0, 75.0])), SETUP), target)[0]
    q = good(resolve(target, s_m, Tilt(), SETUP, start), target)
    np.testing.assert_allclose(q[0], start, atol=1e-9)
    normal = kr6.forward(q[:, :6])[:, :3, 2]
    np.testing.assert_allclose(normal - kr6.forward(start[:6])[:3, 2], 0.0, atol=1e-9)


@pytest.mark.parametrize("crank_deg", [None, 40.0, 60.0, 80.0])
def test_a_free_heave_is_never_dearer_than_a_kept_one(crank_deg: float | None) -> None:
    # Close to A5 = 0, where A4 and A6 turn faster than the search can follow.
    target, s_m = line((560, 20, 60, 180, 0, 180), (560, 60, 60, 180, 18, 180), 801)
    setup = replace(SETUP, tool=pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0]), mount_yaw=0.0)
    if crank_deg is None:
        good(resolve(target, s_m, Level(), setup), target, setup)
        return
    kept = resolve(target, s_m, Fixed(np.radians([crank_deg] * 3)), setup)
    start = good(kept, target, setup)[0]
    for policy in (Level(), Tilt()):
        free = resolve(target, s_m, policy, setup, start)
        good(free, target, setup)
        if isinstance(policy, Level):
            assert isinstance(kept, Resolved)
            assert isinstance(free, Resolved)
            assert free.cost <= kept.cost


def test_motion_turns_the_tilt_as_it_is_told() -> None:
    target, s_m = DOWN
    turning = np.linspace(0.0, 4.0 * np.pi, len(s_m))
    policy = Motion(np.full(len(s_m), 0.066), np.full(len(s_m), 0.2), turning)
    q = good(resolve(target, s_m, policy, SETUP), target)
    direction, tilt, heave = rrs.tilt_of(rrs.forward(q[:, 6:]))
    assert np.abs(wrap(direction - turning)).max() < 1e-9
    np.testing.assert_allclose(tilt, 0.2, atol=1e-12)
    np.testing.assert_allclose(heave, 0.066, atol=1e-12)


def test_cranks_may_stand_on_both_ends_of_their_range() -> None:
    target, s_m = DOWN
    ends = np.linspace(0.0, np.radians(120.0), len(s_m))[:, None]
    q = good(resolve(target, s_m, Cranks(np.repeat(ends, 3, axis=1)), SETUP), target)
    assert q[0, 6] == 0.0
    assert q[-1, 6] == HIGH[6]
    heave = np.linspace(0.086, rrs.forward(q[-1, 6:])[2, 3], len(s_m))
    good(resolve(target, s_m, Level(heave), SETUP), target)


def test_a_way_through_a5_zero_from_one_side_to_the_other_is_found() -> None:
    t = np.linspace(-1.0, 1.0, 301)[:, None]
    middle = np.radians([10.0, -60.0, 95.0, 40.0, 0.0, 20.0, 60.0, 60.0, 60.0])
    joints = middle + np.radians([12.0, 3.0, -4.0, 6.0, 12.0, -3.0, 10.0, -10.0, 5.0]) * t
    target = forward(joints)
    outcome = resolve(target, length(target), Auto(), SETUP, joints[0], joints[-1])
    q = good(outcome, target)
    assert np.abs(np.diff(q, axis=0)).max() < 0.05
    np.testing.assert_allclose(q[[0, -1]], joints[[0, -1]], atol=1e-9)


def test_whole_turns_of_a6_are_chosen_so_that_the_path_fits_its_range() -> None:
    target, s_m = line((500, -80, 250, -144, 0, 180), (500, 80, 250, 456, 0, 180), 801)
    q = good(resolve(target, s_m, Fixed(MIDDLE), SETUP), target)
    assert np.degrees(np.ptp(q[:, 5])) > 550.0
    good(resolve(target, s_m, Auto(), SETUP), target)


def test_rows_too_far_apart_are_looked_at_closer_and_told() -> None:
    target, s_m = line((500, -80, 250, 0, 0, 180), (500, 80, 250, 90, 0, 180), 3)
    outcome = resolve(target, s_m, Fixed(MIDDLE), SETUP)
    good(outcome, target)
    assert isinstance(outcome, Resolved)
    assert outcome.steep == (0, 1)


OUT = line((500.0, 0.0, 300.0, 180.0, 0.0, 180.0), (1500.0, 0.0, 300.0, 180.0, 0.0, 180.0), 501)


@pytest.mark.parametrize("policy", [Fixed(MIDDLE), Level(), Tilt(), Auto()])
def test_out_of_reach_is_told_at_its_row(policy: Policy) -> None:
    outcome = resolve(*OUT, policy, SETUP)
    assert not isinstance(outcome, Resolved)
    assert "the arm reaches from" in outcome.problem.message
    assert outcome.problem.value is not None
    assert outcome.problem.limit == pytest.approx(876.456, abs=1e-3)
    assert 876.456 < outcome.problem.value < 884.0
    # One row earlier there is an answer: sought without the planner, one pose at a time.
    row = outcome.row - 1
    level = np.repeat(np.linspace(LOW[6], HIGH[6], 25)[:, None], 3, axis=1)
    grid = {Fixed: MIDDLE[None], Auto: sphm.auto(OUT[0][row], PEN, mount_yaw=0.3)[None, 6:]}
    cranks = grid.get(type(policy), level)
    pose = np.broadcast_to(OUT[0][row], (len(cranks), 4, 4))
    assert not np.isnan(sphm.inverse_best(pose, cranks, PEN, mount_yaw=0.3)).all()


def test_a_range_is_told_with_its_joint_row_and_furthest_value() -> None:
    cranks = np.degrees(np.repeat(MIDDLE[None], len(DOWN[1]), axis=0))
    cranks[:, 2] = np.linspace(60.0, 130.0, len(cranks))
    outcome = resolve(*DOWN, Cranks(np.radians(cranks)), SETUP)
    assert not isinstance(outcome, Resolved)
    assert (outcome.problem.joint, outcome.problem.limit) == ("theta9", 120.0)
    assert outcome.problem.value == pytest.approx(130.0)
    assert outcome.row == int((cranks[:, 2] > 120.0).argmax())
    narrow = SETUP.ranges.copy()
    narrow[0] = np.radians([-5.0, 5.0])
    outcome = resolve(*DOWN, Fixed(MIDDLE), replace(SETUP, ranges=narrow))
    assert not isinstance(outcome, Resolved)
    assert "A1" in {reason.problem.joint for reason in outcome.reasons}


def test_a_line_past_axis_1_is_refused_for_a_range_or_a_branch_change() -> None:
    target, s_m = line((0, -400, 900, 180, 0, 0), (0, 400, 900, 180, 0, 0), 801)
    start = np.radians([90.0, -100.0, 60.0, 0.0, 30.0, 0.0, 60.0, 60.0, 60.0])
    wide = replace(SETUP, ranges=np.array([[-20.0, 20.0]] * 6 + [[0.0, 2.1]] * 3))
    plain = replace(wide, tool=np.eye(4), mount_yaw=0.0)
    answers = sphm.inverse(target[0], None, MIDDLE, start).joints
    outcome = resolve(target, s_m, Fixed(MIDDLE), plain, answers[0])
    assert not isinstance(outcome, Resolved)
    assert outcome.problem.joint == "A1"
    assert "another branch" in outcome.problem.message
    assert outcome.row in (399, 400)


def test_impossible_tilts_and_heaves_are_told_with_what_is_possible() -> None:
    target, s_m = line((500, 0, 300, 180, 0, 180), (500, 100, 300, 180, 60, 180), 601)
    outcome = resolve(target, s_m, Tilt(), SETUP)
    assert not isinstance(outcome, Resolved)
    assert "would have to tilt by" in outcome.problem.message
    assert outcome.problem.value is not None
    assert outcome.problem.limit is not None
    assert outcome.row == pytest.approx(outcome.problem.limit * 10.0, abs=2.0)
    assert 26.0 < outcome.problem.limit < outcome.problem.value < 39.0
    outcome = resolve(*DOWN, Level(np.linspace(0.06, 0.09, len(DOWN[1]))), SETUP)
    assert not isinstance(outcome, Resolved)
    assert outcome.problem.limit == pytest.approx(86.0)
    assert outcome.row == int(np.ceil((0.086 - 0.06) / 0.03 * (len(DOWN[1]) - 1)))


def test_a_start_that_is_none_of_the_policys_is_told() -> None:
    tilted = good(resolve(*DOWN, Fixed(np.radians([60.0, 60.0, 90.0])), SETUP), DOWN[0])[0]
    level = resolve(*DOWN, Level(), SETUP, tilted)
    assert not isinstance(level, Resolved)
    assert "tilted against the flange by 9.9" in level.problem.message
    fixed = resolve(*DOWN, Fixed(MIDDLE), SETUP, tilted)
    assert not isinstance(fixed, Resolved)
    assert fixed.row == 0
    leaning = Tilt(pose_matrix([0, 0, 0], [0.0, 0.1, np.pi])[:3, :3])
    kept = resolve(*DOWN, leaning, SETUP, tilted)
    assert not isinstance(kept, Resolved)
    assert "leans away" in kept.problem.message


def test_one_pose_and_a_standing_tool_are_paths_too() -> None:
    target, s_m = DOWN
    for policy in (Auto(), Level(), Tilt(), Fixed(MIDDLE)):
        good(resolve(target[:1], s_m[:1], policy, SETUP), target[:1])
        still = np.repeat(target[:1], 20, axis=0)
        q = good(resolve(still, np.zeros(20), policy, SETUP), still)
        assert np.ptp(q, axis=0).max() < 1e-9


def test_the_turn_of_the_wrists_pose_is_what_a_3_rrs_can_do() -> None:
    q = np.random.default_rng(3).uniform(LOW[6:], HIGH[6:], (2000, 3))
    R = rrs.forward(q)[:, :3, :3]
    s, t, _ = rrs.tilt_of(rrs.forward(q))
    wanted = np.array(
        [
            pose_matrix([0, 0, 0], [a, b, 0.0])[:3, :3] @ pose_matrix([0, 0, 0], [-a, 0, 0])[:3, :3]
            for a, b in zip(s, t, strict=True)
        ]
    )
    assert angle_between(R, wanted).max() < 1e-9
