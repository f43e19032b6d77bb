"""The chain forward for one set of joints, held against the arrays' own way."""

from __future__ import annotations

import numpy as np
import pytest

from sphmctl.motion import Floats
from sphmctl.robots import sphm
from sphmctl.robots.geometry import pose_matrix

TOOL: Floats = pose_matrix([0.01, -0.02, 0.0589], [0.3, -0.2, 0.1])
MOUNT_YAW = 0.4


def both(q: Floats, tool: Floats | None = TOOL) -> tuple[Floats, Floats]:
    """Poses one by one, and in one array."""
    single = np.array([sphm.forward(row, tool, MOUNT_YAW) for row in q])
    return single, sphm.forward(q, tool, MOUNT_YAW)


def test_one_pose_is_that_of_the_array_over_the_whole_range() -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (2000, 9))
    # The edges too: all cranks at 0 stretch every leg.
    q[:2, 6:] = sphm.RANGES9[6:, 0], sphm.RANGES9[6:, 1]
    single, array = both(q)
    np.testing.assert_allclose(single, array, rtol=0.0, atol=1e-14)


def test_one_pose_is_that_of_the_array_far_beyond_the_range() -> None:
    q = np.random.default_rng(2).uniform(-7.0, 7.0, (2000, 9))
    single, array = both(q, None)
    np.testing.assert_allclose(single, array, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("joint", range(9))
def test_an_unknown_joint_makes_one_pose_unknown_as_in_the_array(joint: int) -> None:
    q = np.full((1, 9), 0.5)
    q[0, joint] = np.nan
    single, array = both(q, None)
    np.testing.assert_array_equal(np.isnan(single), np.isnan(array))
    assert np.isnan(single[0, :3, 3]).any()


@pytest.mark.parametrize("joint", [1, 7])
def test_an_infinite_joint_gives_no_pose_and_no_error(joint: int) -> None:
    q = np.full(9, 0.5)
    q[joint] = np.inf
    assert np.isnan(sphm.forward(q)).all()
