"""Rotations and poses against elementary rotations multiplied out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.motion import Floats
from sphmctl.robots import geometry

ANGLE = st.floats(-7.0, 7.0)


def about(axis: int, angle: float) -> Floats:
    """An elementary rotation about x (0), y (1) or z (2)."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j] = R[k, k] = np.cos(angle)
    R[k, j], R[j, k] = np.sin(angle), -np.sin(angle)
    return R


@given(ANGLE, ANGLE, ANGLE)
def test_abc_turns_about_z_then_y_then_x(a: float, b: float, c: float) -> None:
    expected = about(2, a) @ about(1, b) @ about(0, c)
    np.testing.assert_allclose(geometry.abc_to_matrix([a, b, c]), expected, atol=1e-14)


@given(ANGLE, st.one_of(ANGLE, st.sampled_from([np.pi / 2, -np.pi / 2])), ANGLE, ANGLE)
def test_a_matrix_read_as_abc_is_the_same_rotation(a: float, b: float, c: float, e: float) -> None:
    for pitch in (b, np.pi / 2 + e * 1e-9):
        R = geometry.abc_to_matrix([a, pitch, c])
        again = geometry.abc_to_matrix(geometry.matrix_to_abc(R))
        np.testing.assert_allclose(again, R, atol=1e-9 if abs(np.cos(pitch)) < 1e-9 else 1e-13)


@pytest.mark.parametrize("b", [90.0, -90.0])
def test_at_the_gimbal_c_is_zero_and_a_takes_the_turn(b: float) -> None:
    R = about(2, 0.3) @ about(1, np.radians(b)) @ about(0, 0.4)
    abc = geometry.matrix_to_abc(R)
    assert abc[2] == 0.0
    np.testing.assert_allclose(abc[:2], [0.3 - np.sign(b) * 0.4, np.radians(b)], atol=1e-8)


def test_poses_of_any_leading_shape_invert() -> None:
    rng = np.random.default_rng(1)
    T = geometry.pose_matrix(rng.normal(size=(3, 4, 3)), rng.normal(size=(3, 4, 3)))
    np.testing.assert_allclose(
        geometry.invert(T) @ T, np.broadcast_to(np.eye(4), T.shape), atol=1e-14
    )


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_the_angle_between_rotations_is_exact_when_tiny_and_when_straight(angle: float) -> None:
    R = about(2, 0.7) @ about(0, -1.1)
    assert geometry.angle_between(R, R @ about(1, angle)) == pytest.approx(
        angle, abs=1e-15, rel=1e-6
    )


@given(st.floats(-100.0, 100.0))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = float(geometry.wrap(angle))
    assert -np.pi < wrapped <= np.pi
    assert abs(np.exp(1j * wrapped) - np.exp(1j * angle)) < 1e-12


def test_half_a_turn_wraps_to_the_positive_side() -> None:
    np.testing.assert_array_equal(geometry.wrap([np.pi, -np.pi]), [np.pi, np.pi])
