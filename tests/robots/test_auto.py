"""`auto`: solves what can be reached, as well as a slow and simple search, and repeatably."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.optimize import linprog

from sphmctl.motion import Floats
from sphmctl.robots import kr6, sphm
from sphmctl.robots.sphm.minimax import best_steps
from sphmctl.robots.sphm.slopes import joint_slopes

LOW, HIGH = sphm.RANGES9.T


def random_joints(count: int, seed: int) -> Floats:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 9))


def worth(q: Floats, near: Floats | None) -> Floats:
    """What `auto` says it seeks: the margin less the distance to `near`."""
    margin = np.minimum(q - LOW, HIGH - q).min(axis=-1)
    if near is None:
        return np.asarray(margin)
    return np.asarray(margin - np.sqrt(((q - near) ** 2).mean(axis=-1)))


def slow_search(T: Floats, near: Floats | None) -> float:
    """The worth that a grid of 7 x 7 x 7 finds, its 3 best refined by steps to all neighbours."""
    top = HIGH[6:]
    share = np.linspace(0.0, 1.0, 7)
    grid = np.stack(np.meshgrid(share, share, share, indexing="ij"), -1).reshape(-1, 3) * top
    sides = np.stack(np.meshgrid(*[[0.0, -1.0, 1.0]] * 3, indexing="ij"), -1).reshape(-1, 3)
    if near is not None:
        grid = np.vstack([near[6:], grid])

    def best(cranks: Floats) -> Floats:
        poses = np.broadcast_to(T, (len(cranks), 4, 4))
        answers = sphm.inverse(poses, None, cranks, near).joints
        return np.asarray(np.nan_to_num(worth(answers, near), nan=-np.inf).max(axis=1))

    values = best(grid)
    starts = np.argsort(-values, kind="stable")[:3]
    centre, value, step = grid[starts], values[starts], np.full(3, np.radians(10.0))
    while (step > np.radians(0.01)).any():
        around = np.clip(centre[:, None] + sides * step[:, None, None], 0.0, top)
        found = best(around.reshape(-1, 3)).reshape(3, -1)
        pick = found.argmax(axis=1)
        centre, value = around[range(3), pick], found[range(3), pick]
        step = np.where(pick == 0, step / 2.0, step)
    return float(value.max())


def check_solved(count: int, seed: int) -> None:
    T = sphm.forward(random_joints(count, seed))
    found = sphm.auto(T)
    solved = ~np.isnan(found[:, 0])
    assert solved.mean() >= 0.999
    assert np.abs(sphm.forward(found[solved]) - T[solved]).max() < 2e-9
    assert ((found[solved] >= LOW) & (found[solved] <= HIGH)).all()


def test_two_thousand_poses_made_by_the_forward_kinematics_are_solved() -> None:
    check_solved(2_000, 1)


@pytest.mark.many
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("seed", range(20))
def test_a_hundred_thousand_poses_are_solved(seed: int) -> None:
    check_solved(5_000, 100 + seed)


def check_worth(count: int, seed: int, beside: float | None) -> None:
    """`beside`: how far from the joints `near` is, rad; None without it."""
    q = random_joints(count, seed)
    T, near = sphm.forward(q), None
    if beside is not None:
        rng = np.random.default_rng(seed + 1)
        near = np.clip(q + rng.normal(0.0, beside, q.shape), LOW, HIGH)
    found = worth(sphm.auto(T, near=near), near)
    hints = [None] * count if near is None else list(near)
    slow = [slow_search(pose, hint) for pose, hint in zip(T, hints, strict=True)]
    less = slow - found
    if near is None:
        assert less.max() < 1e-3
    else:  # with its whole turns it has more hills, and now and then a lower one is taken
        assert (less < 1e-3).mean() >= 0.99
        assert less.max() < 0.05


@pytest.mark.parametrize("beside", [None, 0.1])
def test_auto_is_no_worse_than_a_slow_search(beside: float | None) -> None:
    check_worth(12, 5, beside)


@pytest.mark.many
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("beside", [None, 0.1])
def test_auto_is_no_worse_than_a_slow_search_on_300_poses(beside: float | None) -> None:
    check_worth(300, 5, beside)


def test_a_pose_gets_the_same_answer_alone_and_among_others() -> None:
    T = sphm.forward(random_joints(40, 7))
    together = sphm.auto(T)
    np.testing.assert_array_equal(together, sphm.auto(T))
    for pose, joints in zip(T[:4], together[:4], strict=True):
        np.testing.assert_allclose(sphm.auto(pose), joints, atol=1e-6)


def test_a_pose_out_of_reach_has_no_answer_and_spoils_no_other() -> None:
    T = sphm.forward(random_joints(3, 8))
    T[1, :3, 3] *= 5.0
    assert np.isnan(sphm.auto(T)).any(axis=1).tolist() == [False, True, False]
    assert sphm.auto(T[:0]).shape == (0, 9)


def test_a_pose_that_only_the_stretched_arm_reaches_is_solved() -> None:
    q = np.radians(
        [10.0, -40.0, np.degrees(np.arctan2(0.035, 0.420)), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    )
    found = sphm.auto(sphm.forward(q))
    np.testing.assert_allclose(sphm.forward(found), sphm.forward(q), atol=2e-9)


def test_narrow_limits_a_tool_and_a_turned_mount_are_kept() -> None:
    limits = np.radians(
        [[-60, 60], [-120, 0], [0, 150], [-90, 90], [5, 110], [-90, 90]] + [[30, 80]] * 3
    )
    q = np.random.default_rng(4).uniform(limits[:, 0], limits[:, 1], (100, 9))
    tool = np.array([[0, 0, 1, 0.02], [0, 1, 0, 0.01], [-1, 0, 0, 0.05], [0, 0, 0, 1.0]])
    T = sphm.forward(q, tool, 0.4)
    found = sphm.auto(T, tool, limits=limits, mount_yaw=0.4)
    np.testing.assert_allclose(sphm.forward(found, tool, 0.4), T, atol=2e-9)
    assert ((found >= limits[:, 0]) & (found <= limits[:, 1])).all()


def test_slopes_are_what_small_motions_of_the_cranks_show() -> None:
    q = random_joints(300, 3)
    q = q[(np.abs(q[:, 4]) > 0.2) & (q[:, 6:] > 0.1).all(axis=1)]
    T, yaw, step = sphm.forward(q, None, 0.4), 0.4, 1e-6
    slopes, _ = joint_slopes(np.ascontiguousarray(q.T), yaw)
    for leg in range(3):
        cranks = q[:, 6:] + step * np.eye(3)[leg]
        moved = kr6.inverse(sphm.flange_target(T, cranks, None, yaw))
        way = np.angle(np.exp(1j * (moved - q[:, None, :6])))
        nearest = np.nan_to_num(np.abs(way).max(axis=-1), nan=np.inf).argmin(axis=1)
        seen = way[range(len(q)), nearest] / step
        calm = np.abs(seen).max(axis=1) < 20.0
        assert calm.mean() > 0.9
        np.testing.assert_allclose(slopes[:, leg, calm].T, seen[calm], rtol=1e-2, atol=1e-3)


def test_the_best_steps_are_those_of_a_linear_programme() -> None:
    rng = np.random.default_rng(6)
    values, slopes = rng.uniform(0.0, 1.0, (19, 200)), rng.normal(0.0, 2.0, (19, 3, 200))
    low, high = -rng.uniform(0.0, 0.4, (3, 200)), rng.uniform(0.0, 0.4, (3, 200))
    tilt = rng.normal(0.0, 0.5, (3, 200))
    d = best_steps(values, slopes, low, high, tilt)
    assert ((d >= low - 1e-12) & (d <= high + 1e-12)).all()
    for i in range(200):
        rows = np.hstack([-slopes[:, :, i], np.ones((19, 1))])
        bounds = [*zip(low[:, i], high[:, i], strict=True), (None, None)]
        exact = linprog([*-tilt[:, i], -1.0], A_ub=rows, b_ub=values[:, i], bounds=bounds)
        reached = (values[:, i] + slopes[:, :, i] @ d[:, i]).min() + tilt[:, i] @ d[:, i]
        assert reached == pytest.approx(-exact.fun, abs=1e-9)


def test_a_batch_takes_a_fraction_of_the_slow_search() -> None:
    T = sphm.forward(random_joints(300, 9))
    begin = time.process_time()
    sphm.auto(T)
    fast_s = (time.process_time() - begin) / 300
    begin = time.process_time()
    for pose in T[:3]:
        slow_search(pose, None)
    assert fast_s < 0.2 * (time.process_time() - begin) / 3
