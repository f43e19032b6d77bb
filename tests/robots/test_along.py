"""Continuous joints along paths: the octagon, singular poses, limits and gaps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sphmctl.motion import Floats
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix
from tests.robots.test_sphm import PEN, table_5


def octagon(per_side: int) -> tuple[Floats, Floats]:
    """Tool poses and cranks along the eight printed points, tool straight down, closed."""
    joints, printed_mm, _ = table_5()
    corners = np.vstack([printed_mm, printed_mm[:1]])[:, :2] / 1e3
    cranks = np.vstack([joints, joints[:1]])[:, 6:]
    share = np.linspace(0.0, 1.0, per_side, endpoint=False)[:, None]
    xy = np.vstack([a + (b - a) * share for a, b in pairwise(corners)])
    wrist = np.vstack([a + (b - a) * share for a, b in pairwise(cranks)])
    zero = np.zeros(len(xy))
    a = np.arctan2(xy[:, 1], xy[:, 0]) + np.pi
    xyz, abc = np.stack([*xy.T, zero], 1), np.stack([a, zero, zero + np.pi], 1)
    return pose_matrix(xyz, abc), wrist


def test_the_octagon_is_continuous_and_passes_a5_zero_twice() -> None:
    T, wrist = octagon(150)
    q = sphm.inverse_along(T, wrist, tool=PEN)
    np.testing.assert_allclose(sphm.forward(q, PEN), T, atol=1e-12)
    assert np.degrees(np.abs(np.diff(q, axis=0)).max()) < 0.3
    assert np.degrees(np.abs(q[:, [3, 5]]).max()) < 1e-6
    assert (np.diff(np.sign(q[:, 4])) != 0).sum() == 2
    printed = np.degrees(table_5()[0])
    # The printed poses lean by up to 2.92 degrees, these stand straight: the same branch, no more.
    assert np.abs(np.degrees(q[::150]) - printed)[:, [0, 1, 2]].max() < 2.0


def crossing(a4_deg: float, a6_deg: float) -> Floats:
    """Joints that pass A5 = 0 exactly, with A4 and A6 somewhere else."""
    t = np.linspace(-1.0, 1.0, 201)[:, None]
    middle = np.radians([10.0, -60.0, 95.0, a4_deg, 0.0, a6_deg, 60.0, 60.0, 60.0])
    rates = np.radians([5.0, 3.0, -4.0, 6.0, 20.0, -3.0, 10.0, -10.0, 5.0])
    q = middle + rates * t
    q[100, 4] = 0.0
    return q


@pytest.mark.parametrize(("a4_deg", "a6_deg"), [(0.0, 0.0), (-40.0, 100.0), (178.0, 200.0)])
def test_joints_through_a5_zero_are_followed_from_their_start(a4_deg: float, a6_deg: float) -> None:
    q = crossing(a4_deg, a6_deg)
    T = sphm.forward(q, PEN, 0.2)
    followed = sphm.inverse_along(T, q[:, 6:], start=q[0], tool=PEN, mount_yaw=0.2)
    np.testing.assert_allclose(followed[:100], q[:100], atol=1e-9)
    np.testing.assert_allclose(followed[101:], q[101:], atol=1e-9)
    # At the singular pose itself A4 stays where it was, and A6 makes up for it.
    assert followed[100, 3] == followed[99, 3]
    np.testing.assert_allclose(sphm.forward(followed, PEN, 0.2), T, atol=1e-12)
    assert np.abs(np.diff(followed, axis=0)).max() < 0.01


def test_a_path_that_begins_in_the_singular_pose_takes_its_a4_from_what_follows() -> None:
    q = crossing(-40.0, 100.0)[100:]
    one_branch = sphm.RANGES9.copy()
    one_branch[1] = np.radians([-70.0, -50.0])
    one_branch[3] = np.radians([-90.0, 90.0])
    followed = sphm.inverse_along(sphm.forward(q), q[:, 6:], limits=one_branch)
    np.testing.assert_allclose(followed[1:], q[1:], atol=1e-9)
    assert followed[0, 3] == followed[1, 3]
    backwards = sphm.inverse_along(sphm.forward(q[::-1]), q[::-1, 6:], limits=one_branch)
    np.testing.assert_allclose(backwards[:-1], q[:0:-1], atol=1e-9)
    assert backwards[-1, 3] == backwards[-2, 3]


def test_a_path_all_in_the_singular_pose_stands_still() -> None:
    q = np.repeat(crossing(30.0, 0.0)[100:101], 5, axis=0)
    followed = sphm.inverse_along(sphm.forward(q), q[:, 6:])
    assert np.abs(np.diff(followed, axis=0)).max() == 0.0
    kept = sphm.inverse_along(sphm.forward(q), q[:, 6:], start=q[0])
    np.testing.assert_allclose(kept, q, atol=1e-12)


def test_without_a_start_the_turn_of_a6_is_chosen_for_the_whole_path() -> None:
    t = np.linspace(0.0, 1.0, 120)[:, None]
    first = np.radians([10.0, -60.0, 95.0, 5.0, 40.0, -340.0, 60.0, 60.0, 60.0])
    last = np.radians([12.0, -62.0, 96.0, 5.0, 40.0, 200.0, 60.0, 60.0, 60.0])
    q = first + (last - first) * t
    followed = sphm.inverse_along(sphm.forward(q), q[:, 6:])
    assert np.abs(np.diff(followed, axis=0)).max() < 0.1
    from_above = q[0].copy()
    from_above[5] += 2.0 * np.pi  # from here A6 would run past its limit: a jump is due
    jumped = sphm.inverse_along(sphm.forward(q), q[:, 6:], start=from_above)
    assert np.degrees(jumped[:, 5].max()) <= 350.0
    assert np.abs(np.diff(jumped[:, 5])).max() > 3.0
    np.testing.assert_allclose(sphm.forward(jumped), sphm.forward(q), atol=1e-12)


def test_unreachable_rows_are_empty_and_the_rest_goes_on() -> None:
    q = crossing(-40.0, 100.0)
    T = sphm.forward(q)
    T[50:60, :3, 3] *= 3.0
    followed = sphm.inverse_along(T, q[:, 6:], start=q[0])
    assert np.isnan(followed[50:60]).all()
    np.testing.assert_allclose(followed[60:100], q[60:100], atol=1e-9)
    assert np.isnan(sphm.inverse_along(T[50:60], q[50:60, 6:])).all()


def test_a_crank_beyond_its_limit_empties_its_rows() -> None:
    q = crossing(-40.0, 100.0)[:10]
    wrist = q[:, 6:].copy()
    wrist[3, 1] = np.radians(120.1)
    followed = sphm.inverse_along(sphm.forward(q), wrist, start=q[0])
    assert np.isnan(followed[:, 0]).nonzero()[0].tolist() == [3]


def test_an_empty_path_has_no_joints() -> None:
    assert sphm.inverse_along(np.empty((0, 4, 4)), np.empty((0, 3))).shape == (0, 9)
