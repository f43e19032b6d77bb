"""The nine-joint chain against the paper's Table 5, and its inverse in every form."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.geometry import abc_to_matrix, angle_between, pose_matrix

TABLE_5 = Path(__file__).parent.parent / "vectors" / "octagon_table5.csv"
PEN = pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0])
BENT = pose_matrix([0.01, -0.02, 0.08], [0.3, -0.2, 0.1])
LOW, HIGH = sphm.RANGES9.T


def table_5() -> tuple[Floats, Floats, Floats]:
    """Joints (8, 9), rad, positions (8, 3), mm, and rotations (8, 3, 3) as printed."""
    with TABLE_5.open() as file:
        rows = np.array([[float(v) for v in row[1:]] for row in list(csv.reader(file))[1:]])
    return np.radians(rows[:, :9]), rows[:, 9:12], abc_to_matrix(np.radians(rows[:, 12:]))


def random_joints(count: int, seed: int = 1) -> Floats:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 9))


def test_table_5_is_reproduced_within_the_papers_claim() -> None:
    joints, printed_mm, printed = table_5()
    T = sphm.forward(joints, PEN)
    assert np.abs(T[:, :3, 3] * 1e3 - printed_mm).max() < 4.6
    error_deg = np.degrees(angle_between(T[:, :3, :3], printed))
    assert error_deg[:4].max() < 0.05  # A to D
    assert error_deg[4:7].max() < 0.6  # E to G
    # Row H is a misprint: its joints mirror row B, whose orientation mirrored is 169.74, -1.17.
    mirrored = abc_to_matrix(np.radians([169.74, -1.17, -180.0]))
    assert np.degrees(angle_between(T[7, :3, :3], mirrored)) < 0.05


def test_the_wrist_sits_99_mm_beyond_the_arms_wrist_centre() -> None:
    q = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0, 60.0, 60.0, 60.0])
    heave_m = 0.025 * 0.5 + np.sqrt(0.061**2 - 0.025**2 * 0.75)
    expected = [0.025 + 0.420 + 0.099 + heave_m, 0.0, 0.400 + 0.455 + 0.035]
    np.testing.assert_allclose(sphm.forward(q)[:3, 3], expected, atol=1e-15)


def test_the_mount_yaw_turns_leg_1_about_the_flange_axis() -> None:
    q = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0, 20.0, 60.0, 90.0])
    turned = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0, 90.0, 20.0, 60.0])
    T = sphm.forward(q, mount_yaw=np.radians(120.0))
    np.testing.assert_allclose(T[:3, 2:], sphm.forward(turned)[:3, 2:], atol=1e-14)
    flange = kr6.forward(q[:6])
    np.testing.assert_allclose(flange @ sphm.platform_in_flange(q[6:]), sphm.forward(q), atol=1e-15)


def test_ten_thousand_poses_are_found_again() -> None:
    q = random_joints(10_000)
    T = sphm.forward(q, BENT, 0.4)
    answers = sphm.inverse(T, BENT, q[:, 6:], mount_yaw=0.4)
    again = sphm.forward(answers.joints, BENT, 0.4)
    assert np.nanmax(np.linalg.norm(again[..., :3, 3] - T[:, None, :3, 3], axis=-1)) * 1e3 < 1e-6
    assert np.nanmax(angle_between(again[..., :3, :3], T[:, None, :3, :3])) < 1e-9
    gap = np.fmin.reduce(np.abs(answers.joints - q[:, None]).max(axis=-1), axis=-1)
    assert gap.max() < 1e-8
    assert np.nanmin(answers.joints - LOW) >= 0.0
    assert np.nanmin(HIGH - answers.joints) >= 0.0


def test_answers_come_by_falling_margin_or_nearest_first() -> None:
    q = random_joints(200)
    T = sphm.forward(q)
    answers = sphm.inverse(T, wrist=q[:, 6:])
    np.testing.assert_array_equal(answers.margins, sphm.margin_of(answers.joints))
    falling = np.diff(answers.margins, axis=1)
    assert np.nanmax(falling) <= 0.0
    nearest = sphm.inverse(T, wrist=q[:, 6:], near=q)
    assert np.abs(nearest.joints[:, 0] - q).max() < 1e-8


def test_the_best_answer_alone_is_the_first_of_all() -> None:
    q = random_joints(300)
    T = sphm.forward(q, PEN)
    all_answers = sphm.inverse(T, PEN, q[:, 6:])
    best = sphm.inverse_best(T, q[:, 6:], PEN)
    np.testing.assert_allclose(sphm.margin_of(best), all_answers.margins[:, 0], atol=1e-12)
    near = random_joints(300, seed=2)
    by_distance = sphm.inverse(T, PEN, q[:, 6:], near=near).joints[:, 0]
    np.testing.assert_allclose(
        sphm.inverse_best(T, q[:, 6:], PEN, near=near), by_distance, atol=1e-12
    )


def test_one_pose_gets_only_real_answers_and_none_is_an_empty_list() -> None:
    q = np.radians([10.0, -60.0, 80.0, 20.0, 40.0, 30.0, 60.0, 70.0, 80.0])
    T = sphm.forward(q)
    answers = sphm.inverse(T, wrist=q[6:])
    assert answers.joints.shape[1:] == (9,)
    assert not np.isnan(answers.joints).any()
    T[:3, 3] += 1.0
    assert sphm.inverse(T, wrist=q[6:]).joints.shape == (0, 9)
    assert sphm.inverse(T, wrist=q[6:]).margins.shape == (0,)
    assert sphm.inverse(T).joints.shape == (0, 9)
    assert np.isnan(sphm.auto(T)).all()
    assert np.isnan(sphm.inverse_best(T, q[6:])).all()


def test_joints_exactly_on_their_limits_are_within_them() -> None:
    corners = np.random.default_rng(2).integers(0, 2, (200, 9))
    q = np.where(corners, HIGH, LOW)
    best = sphm.inverse_best(sphm.forward(q), q[:, 6:], near=q)
    assert np.abs(best - q).max() < 1e-8
    np.testing.assert_array_equal(sphm.margin_of(best), 0.0)


def test_a_wrist_beyond_its_limits_has_no_answer() -> None:
    q = np.radians([10.0, -60.0, 80.0, 20.0, 40.0, 30.0, 60.0, 70.0, 121.0])
    assert len(sphm.inverse(sphm.forward(q), wrist=q[6:]).joints) == 0


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_auto_finds_the_widest_margin_that_a_fine_grid_finds(seed: int) -> None:
    q = random_joints(1, seed)[0]
    T = sphm.forward(q, PEN)
    found = sphm.auto(T, PEN)
    np.testing.assert_allclose(sphm.forward(found, PEN), T, atol=1e-12)
    line = np.linspace(0.0, np.radians(120.0), 25)
    grid = np.stack(np.meshgrid(line, line, line), -1).reshape(-1, 3)
    poses = np.broadcast_to(T, (len(grid), 4, 4))
    widest = np.nanmax(sphm.margin_of(sphm.inverse_best(poses, grid, PEN)))
    assert sphm.margin_of(found) > widest - np.radians(0.5)


def test_auto_weighs_nearness_against_margin_as_it_says() -> None:
    q = random_joints(1, 9)[0]
    T, near = sphm.forward(q, PEN), np.radians([0, -90, 90, 0, 0, 0, 100, 30, 60.0])

    def cost(joints: Floats) -> Floats:
        rms: Floats = np.sqrt(((joints - near) ** 2).mean(axis=-1))
        return rms - sphm.margin_of(joints)

    found = sphm.auto(T, PEN, near=near)
    np.testing.assert_array_equal(found, sphm.auto(T[None], PEN, near=near)[0])
    np.testing.assert_allclose(sphm.forward(found, PEN), T, atol=1e-12)
    line = np.linspace(0.0, np.radians(120.0), 17)
    grid = np.stack(np.meshgrid(line, line, line), -1).reshape(-1, 3)
    poses = np.broadcast_to(T, (len(grid), 4, 4))
    cheapest = np.nanmin(cost(sphm.inverse(poses, PEN, grid, near=near).joints))
    assert cost(found) < cheapest + np.radians(0.5)
    assert cost(found) < cost(sphm.auto(T, PEN))


def test_auto_keeps_to_the_branch_of_near() -> None:
    q = np.radians([10.0, -60.0, 80.0, 20.0, 40.0, 30.0, 60.0, 60.0, 60.0])
    flipped = q + np.radians([0.0, 0.0, 0.0, -180.0, -80.0, 180.0, 0.0, 0.0, 0.0])
    T = sphm.forward(q)
    for near in (q, flipped):
        answers = sphm.inverse(T, near=near)
        assert np.abs(answers.joints[0] - near).max() < np.radians(30.0)


def test_why_not_names_the_joint_the_value_and_the_limit() -> None:
    q = np.radians([10.0, -60.0, 80.0, 20.0, 40.0, 30.0, 60.0, 70.0, 80.0])
    T = sphm.forward(q)
    assert sphm.why_not(T, q[6:]) is None
    beyond = sphm.why_not(T, np.radians([60.0, 70.0, 125.0]), where="point 3")
    assert beyond is not None
    assert (beyond.joint, beyond.where) == ("theta9", "point 3")
    assert (beyond.value, beyond.limit) == pytest.approx((125.0, 120.0))
    narrow = sphm.RANGES9.copy()
    narrow[0] = np.radians([-50.0, 5.0])
    blocked = sphm.why_not(T, q[6:], limits=narrow)
    assert blocked is not None
    assert blocked.joint == "A1"
    assert (blocked.value, blocked.limit) == pytest.approx((10.0, 5.0))
    assert blocked.message == "A1 would have to be 10.000 degrees; its range is -50 to 5"
    assert len(sphm.inverse(T, wrist=q[6:], limits=narrow).joints) == 0
    T[:3, 3] *= 3.0
    far = sphm.why_not(T, q[6:])
    assert far is not None
    assert far.joint == ""
    assert far.value is not None
    assert far.value > 876.0
    assert "from 33.544 to 876.456 mm" in far.message


def test_limits_are_those_of_arm_and_wrist() -> None:
    assert sphm.RANGES9.shape == (9, 2)
    np.testing.assert_allclose(np.degrees(sphm.RANGES9[6:]), [[0.0, 120.0]] * 3)
    np.testing.assert_allclose(np.degrees(sphm.MAX_SPEED9[6:]), 366.0)
    assert sphm.MAX_ACCELERATION9.shape == (9,)
    np.testing.assert_array_equal(sphm.MAX_SPEED9[:6], kr6.MAX_SPEED)
    np.testing.assert_array_equal(sphm.RANGES9[6:], rrs.RANGES)


def test_arrays_keep_their_leading_dimensions_and_wrong_ones_are_named() -> None:
    q = random_joints(12).reshape(3, 4, 9)
    T = sphm.forward(q, PEN)
    assert T.shape == (3, 4, 4, 4)
    assert sphm.inverse(T, PEN, q[..., 6:]).joints.shape[:2] == (3, 4)
    assert sphm.inverse_best(T, q[..., 6:], PEN, near=q).shape == (3, 4, 9)
    assert sphm.auto(T[:1, :2], PEN).shape == (1, 2, 9)
    with pytest.raises(InvalidError, match="last dimension must be 9"):
        sphm.forward(np.zeros(6))
