"""The capability map against forward and inverse kinematics, and the mirror at +-90 degrees."""

from __future__ import annotations

import numpy as np
import pytest

from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.geometry import from_parts, pose_matrix
from sphmctl.robots.sphm.bodies import PAIRS, Plane, clearances
from sphmctl.robots.sphm.workspace import Robot
from sphmctl.robots.sphm.workspace_capability import (
    DOWN,
    HEADINGS,
    _poses,
    _wrist_states,
    capability,
    lean,
    share,
)
from sphmctl.robots.sphm.workspace_slices import Grid, grid_for
from sphmctl.robots.sphm.wrist_grid import heave_range, steepest_tilt

FACE = Robot(tool=pose_matrix([0.0, 0.0, 0.0075], [0.0, 0.0, 0.0]))
COARSE = grid_for(1.08, 0.150)


def test_the_arms_map_is_where_its_closed_form_inverse_has_answers() -> None:
    reached = capability(FACE, "a1_0", COARSE).arm
    heading = 2.0 * np.pi * np.arange(HEADINGS) / HEADINGS
    x, z, heading = np.meshgrid(COARSE.horizontal_m, COARSE.z_m, heading, indexing="ij")
    c, s, zero, one = np.cos(heading), np.sin(heading), np.zeros_like(x), np.ones_like(x)
    columns = [np.stack(v, -1) for v in ((s, zero, -c), (zero, one, zero), (c, zero, s))]
    flange = from_parts(np.stack(columns, axis=-1), np.stack([x, zero, z], axis=-1))
    q = kr6.inverse_in_range(flange)
    whole = np.concatenate([np.nan_to_num(q), np.zeros((*q.shape[:-1], 3))], axis=-1)
    ours = [
        k for k, pair in enumerate(PAIRS) if not {"servos", "legs", "platform", "tool"} & {*pair}
    ]
    free = (clearances(whole.reshape(-1, 9))[:, ours] >= 0.0).all(axis=1).reshape(q.shape[:-1])
    expected = ((np.abs(q[..., 0]) < 1e-9) & free).any(axis=-1)
    # Where the wrist centre is on axis 1, the inverse leaves A1 open and takes 0.
    assert (reached != expected).mean() < 1e-3
    assert 0.1 < reached.mean() < 0.9


@pytest.mark.parametrize("direction", [0.0, np.pi])
@pytest.mark.parametrize("a6", [0.0, np.pi])
@pytest.mark.parametrize("mount_yaw", [0.0, 1.5])
def test_what_forward_kinematics_points_at_is_on_the_hybrids_map(
    direction: float, a6: float, mount_yaw: float
) -> None:
    tilt = float(steepest_tilt(direction))
    cranks = rrs.inverse(direction, tilt, heave_range(direction, tilt)[0])
    q = np.concatenate([np.radians([0.0, -60.0, 70.0, 0.0, 1.0]), [a6 + mount_yaw], cranks])
    # A2 turned so that the platform's normal has one of the map's headings.
    normal = sphm.forward(q, FACE.tool, mount_yaw)[:3, 2]
    step = 2.0 * np.pi / HEADINGS
    number = round(np.arctan2(normal[2], normal[0]) / step)
    q[1] += np.arctan2(normal[2], normal[0]) - number * step
    T = sphm.forward(q, FACE.tool, mount_yaw)
    np.testing.assert_allclose([T[1, 3], T[1, 2]], 0.0, atol=1e-9)
    # The arm is held within 0.1 degrees: only the wrist's own pose can bring the tool there.
    ranges = sphm.RANGES9.copy()
    ranges[[1, 2, 4]] = q[[1, 2, 4], None] + np.radians([-0.1, 0.1])
    robot = Robot(ranges, FACE.tool, mount_yaw)
    here = Grid(np.array([T[0, 3]]), np.array([T[2, 3]]), 0.05)
    found = capability(robot, "a1_0", here).hybrid[0, 0]
    assert np.flatnonzero(found).tolist() == [number % HEADINGS]


def test_at_90_degrees_the_map_is_its_own_mirror_image() -> None:
    found = capability(FACE, "a1_90", COARSE)
    mirrored = (HEADINGS // 2 - np.arange(HEADINGS)) % HEADINGS
    for reached in (found.arm, found.hybrid):
        assert np.array_equal(reached, reached[::-1][:, :, mirrored])
    assert found.hybrid.sum() > capability(FACE, "a1_0", COARSE).hybrid.sum()


def wall(axis: int) -> Plane:
    """One 500 mm from the base, across x (0) or y (1)."""
    return Plane("wall", 0.5 * np.eye(3)[axis], -np.eye(3)[axis])


def test_nothing_is_pointed_at_behind_a_wall_and_before_it_less_than_without() -> None:
    walled = Robot(tool=FACE.tool, obstacles=(wall(1),))
    found, whole = capability(walled, "a1_90", COARSE), capability(FACE, "a1_90", COARSE)
    behind = COARSE.horizontal_m > 0.5
    for ours, free in ((found.arm, whole.arm), (found.hybrid, whole.hybrid)):
        assert not ours[behind].any()
        assert free[behind].any()
        assert not (ours & ~free).any()
        far = COARSE.horizontal_m < -0.7
        assert np.array_equal(ours[far], free[far])


def test_along_a_wall_that_is_nearer_than_the_hand_is_wide_nothing_is_pointed() -> None:
    walled, upwards = Robot(tool=FACE.tool, obstacles=(wall(0),)), HEADINGS // 4
    near = Grid(np.array([0.475]), np.linspace(0.2, 0.9, 8), 0.05)
    found, whole = capability(walled, "a1_0", near), capability(FACE, "a1_0", near)
    for ours, free in ((found.arm, whole.arm), (found.hybrid, whole.hybrid)):
        assert free[0, :, upwards].any()
        assert not ours[0, :, upwards].any()
        assert ours[0, :, 0].any()


@pytest.mark.parametrize("mount_yaw", [0.0, 1.5])
def test_the_poses_tried_bring_the_tool_where_the_map_has_it(mount_yaw: float) -> None:
    robot = Robot(tool=FACE.tool, mount_yaw=mount_yaw)
    rng = np.random.default_rng(8)
    seen = set()
    for state in _wrist_states(robot):
        forward, up = rng.uniform(-0.8, 0.8, (2, 200))
        flange = rng.uniform(-np.pi, np.pi, 200)
        for rows, q in _poses(robot, np.pi / 2.0, state, forward, up, flange):
            assert (sphm.margin_of(q) >= -1e-12).all()
            T = sphm.forward(q, robot.tool, mount_yaw)
            lean = flange[rows] + state.lean  # at A1 = 90 degrees forward is -y
            normal = np.stack([0.0 * lean, -np.cos(lean), np.sin(lean)], axis=1)
            np.testing.assert_allclose(T[:, :3, 2], normal, atol=1e-9)
            c, s = np.cos(flange[rows]), np.sin(flange[rows])
            ahead = 0.025 + forward[rows] + state.along_m * c - state.across_m * s
            above = 0.400 + up[rows] + state.along_m * s + state.across_m * c
            place = np.stack([0.0 * ahead, -ahead, above], axis=1)
            np.testing.assert_allclose(T[:, :3, 3], place, atol=1e-9)
            seen |= {*q[:, 3].tolist()}
    assert seen == {0.0, np.pi}


def test_share_and_lean_of_headings_counted_by_hand() -> None:
    reached = np.zeros((4, HEADINGS), dtype=bool)
    reached[1, DOWN - 2 : DOWN + 5] = True  # 15 degrees one way, 30 the other
    reached[2, [DOWN - 1, DOWN + 1]] = True  # not straight down itself
    reached[3] = True
    np.testing.assert_allclose(share(reached), [0.0, 7 / 48, 2 / 48, 1.0])
    np.testing.assert_allclose(np.degrees(lean(reached)), [np.nan, 15.0, np.nan, 180.0])
