"""The arm against published poses, the paper's D-H table and py-opw-kinematics."""

from __future__ import annotations

import numpy as np
import py_opw_kinematics as opw
import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_opw_kinematics import _internal as opw_internal

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import kr6
from sphmctl.robots.geometry import abc_to_matrix, angle_between, from_parts, wrap

LOW, HIGH = kr6.RANGES.T
SHARES = st.tuples(*[st.floats(0.0, 1.0)] * 6)


def oracle() -> opw_internal.Robot:
    """The same arm in py-opw-kinematics (its KR6 R700 model with the lengths of the R900)."""
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
    return opw_internal.Robot(model, degrees=False)


def random_joints(count: int, seed: int = 1) -> Floats:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))


def nearest(answers: Floats, q: Floats) -> Floats:
    """The largest joint difference of the answer nearest to each q, rad."""
    return np.asarray(np.fmin.reduce(np.abs(answers - q[..., None, :]).max(axis=-1), axis=-1))


# Computed from the URDF's chain; A, B, C are KUKA's.
@pytest.mark.parametrize(
    ("joints_deg", "xyz_mm", "abc_deg"),
    [
        ((0, 0, 0, 0, 0, 0), (980, 0, 435), (0, 90, 0)),
        ((0, -90, 90, 0, 0, 0), (525, 0, 890), (0, 90, 0)),
        ((0, -90, 90, 0, 90, 0), (445, 0, 810), (180, 0, 180)),
        ((30, -60, 80, 10, 45, 20), (595.456, -355.129, 611.585), (178.644, 19.380, -161.813)),
    ],
)
def test_the_flange_stands_where_the_urdf_puts_it(
    joints_deg: tuple[float, ...], xyz_mm: tuple[float, ...], abc_deg: tuple[float, ...]
) -> None:
    T = kr6.forward(np.radians(joints_deg))
    np.testing.assert_allclose(T[:3, 3] * 1e3, xyz_mm, atol=6e-4)
    assert angle_between(T[:3, :3], abc_to_matrix(np.radians(abc_deg))) < np.radians(1e-3)


def test_forward_agrees_with_the_papers_dh_table() -> None:
    def link(theta: float, d: float, a: float, alpha: float) -> Floats:
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        return np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )

    lengths_mm = [(400, -25), (0, -455), (0, -35), (-420, 0), (0, 0), (-80, 0)]
    alphas = np.radians([90, 0, -90, 90, -90, 180])
    half = np.pi / 2
    for q in random_joints(20):
        theta = [np.pi - q[0], q[1], q[2] - half, q[3], q[4], q[5]]
        expected = np.eye(4)
        for angle, (d, a), alpha in zip(theta, lengths_mm, alphas, strict=True):
            expected = expected @ link(angle, d / 1e3, a / 1e3, alpha)
        np.testing.assert_allclose(kr6.forward(q)[:3, 3], expected[:3, 3], atol=1e-14)
        np.testing.assert_allclose(kr6.forward(q)[:3, 2], expected[:3, 2], atol=1e-14)


def test_forward_agrees_with_py_opw_kinematics() -> None:
    q = random_joints(1000)
    expected = oracle().batch_forward(q).reshape(-1, 4, 4)
    np.testing.assert_allclose(kr6.forward(q), expected, atol=1e-13)


def test_inverse_gives_the_branches_of_py_opw_kinematics() -> None:
    T = kr6.forward(random_joints(1000))
    theirs = oracle().reach(T.reshape(-1, 16))[0]
    ours = kr6.inverse(T)
    assert (np.isnan(ours).any(-1).sum(1) == np.isnan(theirs).any(-1).sum(1)).all()
    gap = np.abs(wrap(ours[:, :, None] - theirs[:, None])).max(axis=-1)
    assert np.nanmax(np.fmin.reduce(gap, axis=1)) < 1e-8  # each of theirs is one of ours
    assert np.nanmax(np.fmin.reduce(gap, axis=2)) < 1e-8  # and each of ours one of theirs


def test_every_branch_reproduces_the_pose_and_one_is_where_it_came_from() -> None:
    q = random_joints(10_000)
    T = kr6.forward(q)
    answers = kr6.inverse_in_range(T)
    assert nearest(answers, q).max() < 1e-8
    again = kr6.forward(answers)
    assert np.nanmax(np.abs(again - T[:, None])) < 1e-12
    assert np.nanmin(answers - LOW) >= 0.0
    assert np.nanmin(HIGH - answers) >= 0.0


def test_turns_of_a4_and_a6_count_as_answers_of_their_own() -> None:
    q = np.radians([10.0, -60.0, 80.0, 178.0, 40.0, 300.0])
    answers = np.degrees(kr6.inverse_in_range(kr6.forward(q)))
    turns = {
        (round(float(row[3])), round(float(row[5])))
        for row in answers
        if abs(row[4] - 40.0) < 1e-6 and abs(row[0] - 10.0) < 1e-6 and abs(row[2] - 80.0) < 1e-6
    }
    assert turns == {(178, 300), (178, -60), (-182, 300), (-182, -60)}


def test_narrower_ranges_leave_fewer_answers() -> None:
    q = np.radians([10.0, -60.0, 80.0, 20.0, 40.0, 30.0])
    ranges = kr6.RANGES.copy()
    ranges[3:] = np.radians([[0.0, 90.0], [0.0, 90.0], [0.0, 90.0]])
    answers = kr6.inverse_in_range(kr6.forward(q), ranges)
    assert (answers[:, 3] >= 0.0).all()
    assert nearest(answers, q) < 1e-12
    ranges[0] = np.radians([50.0, 60.0])
    assert np.isnan(kr6.inverse_in_range(kr6.forward(q), ranges)).all()


@given(SHARES)
def test_one_pose_and_an_array_of_poses_get_the_same_answers(shares: tuple[float, ...]) -> None:
    near = LOW + (HIGH - LOW) * np.array(shares)
    T = kr6.forward(near)
    one, many = kr6.inverse(T, near), kr6.inverse(T[None], near)[0]
    assert (np.isnan(one) == np.isnan(many)).all()
    again = kr6.forward(one) - kr6.forward(many)
    assert np.nan_to_num(np.abs(again)).max() < 1e-9
    if np.abs(np.sin(near[4])) > 1e-3 and np.hypot(*kr6.wrist_centre(T)[:2]) > 1e-3:
        assert np.nan_to_num(np.abs(wrap(one - many))).max() < 1e-7


def test_a4_and_a6_lie_within_half_a_turn() -> None:
    q = random_joints(2000)
    q[:500, 3] = np.pi
    q[500:1000, 3] = 0.0
    q[1000:1500, 5] = np.pi
    T = kr6.forward(q)
    for answers in (kr6.inverse(T), np.stack([kr6.inverse(pose) for pose in T])):
        wrist = answers[..., 3::2]
        assert np.nanmax(wrist) <= np.pi
        assert np.nanmin(wrist) > -np.pi


@pytest.mark.parametrize("a4_deg", [0.0, 33.0, -120.0])
def test_with_a5_at_zero_a4_stays_where_it_was_and_a6_takes_the_rest(a4_deg: float) -> None:
    q = np.radians([20.0, -70.0, 100.0, a4_deg, 0.0, 50.0])
    T = kr6.forward(q)
    for answers in (kr6.inverse(T, near=q), kr6.inverse(T[None], near=q)[0]):
        assert nearest(answers, q) < 1e-12
    answers = kr6.inverse(T)
    rows = answers[np.abs(answers[:, 0] - q[0]) < 1e-9]
    assert np.min(np.abs(rows[:, 3])) == 0.0
    assert np.nanmax(np.abs(kr6.forward(answers) - T)) < 1e-12


@pytest.mark.parametrize("a5", [1e-15, 3e-10, -3e-10, 2e-9, -1e-8])
def test_close_to_a5_zero_every_answer_still_reproduces_the_pose(a5: float) -> None:
    q = np.radians([20.0, -70.0, 100.0, 10.0, 0.0, 50.0])
    q[4] = a5
    T = kr6.forward(q)
    for near in (q, np.zeros(6), np.full(6, 2.0)):
        for answers in (kr6.inverse(T, near), kr6.inverse(T[None], near)[0]):
            assert np.nanmax(np.abs(kr6.forward(answers) - T)) < 3e-9
            assert np.nanmax(np.abs(kr6.forward(answers) - T)[:, :3, 3]) < 1e-9


def test_with_the_wrist_centre_on_axis_1_a1_stays_where_it_was() -> None:
    a2 = np.radians(-150.0)  # the upper arm leans back; the forearm brings the centre over axis 1
    T = kr6.forward([0.0, a2, 0.0, 0.3, 0.5, 0.7])
    T[:2, 3] -= kr6.wrist_centre(T)[:2]
    near = np.array([0.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    for answers in (kr6.inverse(T, near), kr6.inverse(T[None], near)[0]):
        assert np.nanmin(np.abs(answers[:, 0] - 0.9)) == 0.0
        assert np.nanmax(np.abs(kr6.forward(answers) - T)) < 1e-9


@pytest.mark.parametrize("overshoot_m", [-1e-12, 0.0, 1e-16, 1e-13, 0.9e-9])
def test_the_stretched_arm_is_within_reach_despite_rounding(overshoot_m: float) -> None:
    stretched = np.arctan2(0.035, 0.420)
    q = np.array([0.4, -0.6, stretched, 0.2, 0.5, 0.1])
    T = kr6.forward(q)
    out_along_the_arm = kr6.wrist_centre(T) - [0.025 * np.cos(0.4), -0.025 * np.sin(0.4), 0.400]
    T[:3, 3] += out_along_the_arm / np.linalg.norm(out_along_the_arm) * overshoot_m
    for answers in (kr6.inverse(T), kr6.inverse(T[None])[0]):
        assert nearest(answers, q) < 1e-4
        assert np.nanmax(np.abs(kr6.forward(answers) - T)) < 1e-9


def test_a_point_out_of_reach_has_no_answer() -> None:
    T = from_parts(np.eye(3), np.array([0.5, 0.9, 0.9]))
    assert np.isnan(kr6.inverse(T)).all()
    assert np.isnan(kr6.inverse(T[None])).all()
    answers = kr6.inverse_in_range(T)
    assert answers.shape == (1, 6)
    assert np.isnan(answers).all()


def test_joints_on_their_limits_are_found_despite_rounding() -> None:
    corners = np.random.default_rng(2).integers(0, 2, (500, 6))
    q = np.where(corners, HIGH, LOW)
    assert nearest(kr6.inverse_in_range(kr6.forward(q)), q).max() < 1e-9


def test_arrays_of_poses_keep_their_leading_dimensions() -> None:
    q = random_joints(24).reshape(2, 3, 4, 6)
    T = kr6.forward(q)
    assert T.shape == (2, 3, 4, 4, 4)
    assert kr6.inverse(T).shape == (2, 3, 4, 8, 6)
    assert kr6.inverse_in_range(T).shape[:3] == (2, 3, 4)
    assert kr6.wrist_centre(T).shape == (2, 3, 4, 3)
    assert kr6.inverse(T[:0]).shape == (0, 3, 4, 8, 6)


def test_a_wrong_number_of_joints_is_named() -> None:
    with pytest.raises(InvalidError, match="last dimension must be 6"):
        kr6.forward(np.zeros(9))
    with pytest.raises(InvalidError, match="4 x 4"):
        kr6.inverse(np.eye(3))
