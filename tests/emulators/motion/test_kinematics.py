"""Flange and axes against py-opw-kinematics."""

from __future__ import annotations

import numpy as np
import py_opw_kinematics as opw
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_opw_kinematics import _internal as opw_internal

from sphmctl.emulators.motion.figures import RANGE_DEG
from sphmctl.emulators.motion.frames import NULL_FRAME, chained, frame_of, inverted, pose_of, turned
from sphmctl.emulators.motion.kinematics import axes_of, forward, inverse, status_and_turn

AXES = st.tuples(*[st.floats(low, high) for low, high in RANGE_DEG])


def oracle() -> opw_internal.Robot:
    """The same arm in py-opw-kinematics, lengths in mm."""
    model = opw.KinematicModel(
        a1=25.0,
        a2=-35.0,
        b=0.0,
        c1=400.0,
        c2=455.0,
        c3=420.0,
        c4=80.0,
        offsets=(0.0, -90.0, 0.0, 0.0, 0.0, 0.0),
        flip_axes=(True, False, False, True, False, True),
    )
    return opw_internal.Robot(model, degrees=True)


# Computed from the URDF's chain; A, B, C are KUKA's.
@pytest.mark.parametrize(
    ("joints_deg", "place_mm"),
    [
        ((0, 0, 0, 0, 0, 0), (980, 0, 435)),
        ((0, -90, 90, 0, 90, 0), (445, 0, 810)),
        ((30, -60, 80, 10, 45, 20), (595.456, -355.129, 611.585)),
    ],
)
def test_the_flange_stands_where_the_urdf_puts_it(
    joints_deg: tuple[float, ...], place_mm: tuple[float, ...]
) -> None:
    assert forward(joints_deg)[0] == pytest.approx(place_mm, abs=6e-4)


def test_the_axes_of_a_flange_are_among_the_oracles_answers() -> None:
    rng = np.random.default_rng(4)
    low, high = np.array(RANGE_DEG).T
    for row in rng.uniform(low, high, (200, 6)):
        joints_deg = tuple(float(q) for q in row)
        pose = forward(joints_deg)
        matrix = np.eye(4)
        matrix[:3, 3] = pose[0]
        matrix[:3, :3] = np.array([turned(pose[1], e) for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]).T
        answers = np.array([list(a) for a in oracle().inverse(matrix)])
        status = status_and_turn(joints_deg)[0]
        ours = inverse(pose, status, joints_deg)
        assert ours is not None
        for found in (ours, joints_deg):
            apart = np.abs((answers - np.array(found) + 180.0) % 360.0 - 180.0).max(axis=1)
            assert apart.min() < 1e-5


@given(AXES, st.floats(-1.0, 1.0))
def test_status_and_the_neighbourhood_choose_the_axes_again(
    joints_deg: tuple[float, ...], off_deg: float
) -> None:
    status = status_and_turn(joints_deg)[0]
    near = tuple(q + off_deg for q in joints_deg)
    again = inverse(forward(joints_deg), status, near)
    assert again is not None
    back, pose = forward(again), forward(joints_deg)
    assert back[0] == pytest.approx(pose[0], abs=1e-4)
    if abs(joints_deg[4]) > 0.1 and abs(joints_deg[2] - 4.76) > 0.1:
        assert again[3:] == pytest.approx(joints_deg[3:], abs=1e-3)


@settings(max_examples=50)
@given(AXES)
def test_a_pos_with_status_and_turn_is_its_axes(joints_deg: tuple[float, ...]) -> None:
    status, turn = status_and_turn(joints_deg)
    tool, base = (10.0, 20.0, 150.0, 30.0, 40.0, 50.0), (100.0, -50.0, 30.0, 15.0, 0.0, 5.0)
    target = chained(inverted(pose_of(base)), chained(forward(joints_deg), pose_of(tool)))
    got = axes_of(frame_of(target), tool, base, (0.0, -90.0, 90.0, 0.0, 90.0, 0.0), status, turn)
    assert got is not None
    away_from_singular = abs(joints_deg[4]) > 1.0 and abs(joints_deg[2] - 4.76) > 1.0
    clear_turns = all(0.01 < abs(joints_deg[axis]) < 180.0 for axis in (3, 5))
    if away_from_singular and clear_turns:
        assert got[:5] == pytest.approx(joints_deg[:5], abs=1e-3)
        assert (got[5] - joints_deg[5]) % 360.0 == pytest.approx(0.0, abs=1e-3) or (
            got[5] - joints_deg[5]
        ) % 360.0 == pytest.approx(360.0, abs=1e-3)


def test_turn_chooses_between_full_turns_of_a6() -> None:
    joints_deg = (10.0, -80.0, 90.0, 0.0, 60.0, 170.0)
    frame, status = frame_of(forward(joints_deg)), status_and_turn(joints_deg)[0]
    for turn, a6 in ((0b000010, 170.0), (0b100010, -190.0)):
        got = axes_of(frame, NULL_FRAME, NULL_FRAME, joints_deg, status, turn)
        assert got is not None
        assert got[5] == pytest.approx(a6)


def test_a_flange_out_of_reach_has_no_axes() -> None:
    far = ((2000.0, 0.0, 500.0), (1.0, 0.0, 0.0, 0.0))
    assert inverse(far, 0, (0.0,) * 6) is None
