"""The wrist: printed heaves, the leg constraints, and forward against inverse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.errors import InfeasibleError, InvalidError
from sphmctl.motion import Floats
from sphmctl.robots import rrs, rrs_modes
from sphmctl.robots.geometry import abc_to_matrix, pose_matrix, wrap

CRANK = st.floats(0.0, float(np.radians(120.0)))
NEAR_ZERO_RAD = np.radians(0.1)


def assert_same_cranks(found: Floats, theta: Floats) -> None:
    """Within 1e-9 rad, or 1e-7 rad where the straight leg costs half of the digits."""
    assert not np.isnan(found).any()
    error = np.abs(found - theta)
    assert error[theta >= NEAR_ZERO_RAD].max(initial=0.0) < 1e-9
    assert error[theta < NEAR_ZERO_RAD].max(initial=0.0) < 1e-7


def grid(steps: int) -> Floats:
    """Crank triples over the whole range, its faces, edges and corners included."""
    line = np.radians(np.linspace(0.0, 120.0, steps))
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)


# 25 sin(90 - theta) + sqrt(61^2 - 25^2 cos^2(90 - theta)) mm, for equal crank angles theta.
@pytest.mark.parametrize(
    ("crank_deg", "heave_mm"), [(0, 86.00), (30, 81.36), (60, 69.53), (90, 55.64), (120, 44.53)]
)
def test_equal_cranks_hold_the_platform_level(crank_deg: float, heave_mm: float) -> None:
    T = rrs.forward(np.radians([crank_deg] * 3))
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-14)
    np.testing.assert_allclose(T[:3, 3] * 1e3, [0.0, 0.0, heave_mm], atol=0.005)


def test_the_links_keep_their_lengths() -> None:
    theta = np.random.default_rng(1).uniform(0.0, np.radians(120.0), (500, 3))
    T = rrs.forward(theta)
    for leg, angle in enumerate(np.radians([0.0, 120.0, 240.0])):
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        crank = np.sin(theta[:, leg, None]) * radial
        crank = crank + np.cos(theta[:, leg, None]) * [0.0, 0.0, 1.0]
        knee = 0.056 * radial + 0.025 * crank
        ball = T[:, :3, 3] + 0.056 * (T[:, :3, 0] * np.cos(angle) + T[:, :3, 1] * np.sin(angle))
        np.testing.assert_allclose(np.linalg.norm(ball - knee, axis=1), 0.061, atol=1e-15)
        beside = ball @ np.array([-np.sin(angle), np.cos(angle), 0.0])
        np.testing.assert_allclose(beside, 0.0, atol=1e-16)
        lean = (knee - ball) @ radial  # each coupler leans inwards from its crank
        assert lean.min() > -1e-12


def test_the_platform_keeps_the_papers_constraints() -> None:
    T = rrs.forward(grid(13))
    u, v, p = T[:, :3, 0], T[:, :3, 1], T[:, :3, 3]
    np.testing.assert_allclose(u[:, 1], v[:, 0], atol=1e-15)
    np.testing.assert_allclose(p[:, 0], 0.056 * (u[:, 0] - v[:, 1]) / 2.0, atol=1e-16)
    np.testing.assert_allclose(p[:, 1], -0.056 * u[:, 1], atol=1e-16)
    eye = np.broadcast_to(np.eye(3), (len(T), 3, 3))
    np.testing.assert_allclose(T[:, :3, :3].swapaxes(1, 2) @ T[:, :3, :3], eye, atol=1e-14)


def test_forward_and_inverse_undo_each_other_over_the_whole_range_and_on_its_edges() -> None:
    theta = grid(31)
    T = rrs.forward(theta)
    assert_same_cranks(rrs.inverse_pose(T), theta)
    assert_same_cranks(rrs.inverse(*rrs.tilt_of(T)), theta)
    assert np.abs(rrs.forward(rrs.inverse_pose(T)) - T).max() < 1e-14


@given(CRANK, CRANK, CRANK, st.sampled_from([1.0, 1e-3, 1e-6, 1e-9]))
def test_forward_and_inverse_undo_each_other_close_to_the_straight_leg(
    a: float, b: float, c: float, shrink: float
) -> None:
    theta = np.array([a * shrink, b, c * shrink])
    assert_same_cranks(rrs.inverse_pose(rrs.forward(theta)), theta)
    assert_same_cranks(rrs.inverse(*rrs.tilt_of(rrs.forward(theta))), theta)


def test_forward_is_the_assembly_reached_by_moving_from_the_level_pose() -> None:
    ends = np.concatenate([grid(5), np.random.default_rng(3).uniform(0, np.radians(120), (300, 3))])
    level = np.radians(60.0)
    steps = 60
    theta = np.moveaxis(level + (ends - level) * np.linspace(0, 1, steps)[:, None, None], -1, 1)
    r, z = 0.056 + 0.025 * np.sin(theta), 0.025 * np.cos(theta)
    phi = np.full((3, len(ends)), np.arccos((0.025 * np.sin(level)) / 0.061))
    for i in range(steps):
        moved = rrs.solve_couplers(r[i], z[i], phi)
        assert np.abs(moved - phi).max() < 0.2  # small steps: no change of assembly
        phi = moved
    T = rrs.platform_pose(r[-1] - 0.061 * np.cos(phi), z[-1] + 0.061 * np.sin(phi))
    np.testing.assert_allclose(rrs.forward(ends), T, atol=1e-13)


def test_newton_takes_the_right_derivatives() -> None:
    rng = np.random.default_rng(4)
    r, z, phi = rng.uniform(0.05, 0.08, 3), rng.uniform(-0.01, 0.02, 3), rng.uniform(0.5, 1.5, 3)

    def gaps(angles: Floats) -> Floats:
        legs = np.radians([0.0, 120.0, 240.0])
        radius = r - 0.061 * np.cos(angles)
        B = np.stack([radius * np.cos(legs), radius * np.sin(legs), z + 0.061 * np.sin(angles)])
        apart: Floats = ((B - np.roll(B, -1, axis=1)) ** 2).sum(axis=0) - 3 * 0.056**2
        return apart

    h = 1e-6
    numeric = np.stack([(gaps(phi + h * e) - gaps(phi - h * e)) / (2 * h) for e in np.eye(3)], 1)
    step, residual = rrs.newton_step(r, z, phi)
    np.testing.assert_allclose(residual, gaps(phi), atol=1e-16)
    np.testing.assert_allclose(step, np.linalg.solve(numeric, gaps(phi)), rtol=1e-6)


def test_tilt_direction_and_heave_say_where_the_normal_leans() -> None:
    theta = rrs.inverse(np.radians(40.0), np.radians(12.0), 0.065)
    T = rrs.forward(theta)
    direction, tilt, heave = rrs.tilt_of(T)
    np.testing.assert_allclose(np.degrees([direction, tilt]), [40.0, 12.0], atol=1e-9)
    assert heave == pytest.approx(0.065, abs=1e-15)
    s = np.radians(40.0)
    expected = (
        abc_to_matrix([s, 0, 0])
        @ abc_to_matrix([0, np.radians(12.0), 0])
        @ abc_to_matrix([-s, 0, 0])
    )
    np.testing.assert_allclose(T[:3, :3], expected, atol=1e-13)


def test_a_level_platform_has_no_tilt_direction() -> None:
    direction, tilt, _ = rrs.tilt_of(rrs.forward(np.radians([[0.0] * 3, [37.0] * 3])))
    np.testing.assert_array_equal(direction, 0.0)
    assert np.abs(tilt).max() < 1e-14


@pytest.mark.parametrize("overshoot_m", [0.0, 1e-17, 1e-15, 0.9e-9])
def test_the_straight_leg_is_within_reach_despite_rounding(overshoot_m: float) -> None:
    theta = rrs.inverse(0.0, 0.0, 0.086 + overshoot_m)
    assert np.abs(theta).max() < 1e-7
    assert (
        np.abs(rrs.inverse_pose(pose_matrix([0, 0, 0.086 + overshoot_m], [0, 0, 0]))).max() < 1e-7
    )


def test_a_platform_pulled_out_too_far_is_out_of_reach() -> None:
    assert np.isnan(rrs.inverse(0.0, 0.0, 0.08601)).all()
    assert np.isnan(rrs.inverse(0.3, [0.0, 0.1, 1.5], 0.0859)[1:]).all()


def test_a_twisted_or_shifted_platform_is_none_of_this_wrist() -> None:
    level = rrs.forward(np.radians([60.0] * 3))
    twisted = level @ pose_matrix([0, 0, 0], [1e-3, 0, 0])
    shifted = level @ pose_matrix([1e-5, 0, 0], [0, 0, 0])
    assert np.isnan(rrs.inverse_pose(np.stack([twisted, shifted]))).all()
    assert np.isnan(rrs.inverse_modes(twisted)).all()


def test_cranks_that_do_not_close_are_refused_with_their_values() -> None:
    impossible = np.radians([[10.0, 20.0, 30.0], [0.0, 0.0, 135.0]])
    assert np.isnan(rrs.forward(impossible)[1]).all()
    assert not np.isnan(rrs.forward(impossible)[0]).any()
    with pytest.raises(InfeasibleError, match="0, 0, 135 degrees"):
        rrs.forward_checked(impossible)
    np.testing.assert_array_equal(rrs.forward_checked(impossible[0]), rrs.forward(impossible[0]))


def test_all_working_modes_hold_the_same_platform() -> None:
    theta = np.radians([20.0, 70.0, 110.0])
    T = rrs.forward(theta)
    modes = rrs.inverse_modes(T)
    np.testing.assert_allclose(modes[0], theta, atol=1e-12)
    assert len(np.unique(modes.round(6), axis=0)) == 8
    np.testing.assert_array_equal(modes[1][1:], modes[0][1:])  # bit 0 turns leg 1 alone
    for mode in modes:
        reachable = rrs_modes.assembly_modes(mode)
        assert np.nanmin(np.abs(reachable - T).max(axis=(1, 2))) < 1e-9


def test_arrays_of_wrists_keep_their_leading_dimensions() -> None:
    theta = np.radians(np.arange(24.0)).reshape(2, 4, 3)
    T = rrs.forward(theta)
    assert T.shape == (2, 4, 4, 4)
    assert rrs.inverse_pose(T).shape == (2, 4, 3)
    assert rrs.inverse_modes(T).shape == (2, 4, 8, 3)
    assert rrs.inverse(*rrs.tilt_of(T)).shape == (2, 4, 3)
    with pytest.raises(InvalidError, match="last dimension must be 3"):
        rrs.forward(np.zeros(4))


@pytest.mark.parametrize(
    "cranks_deg", [(60, 60, 60), (0, 0, 0), (0, 120, 120), (31, 77, 104), (5, 90, 17)]
)
def test_assembly_modes_are_all_that_a_random_search_finds(cranks_deg: tuple[float, ...]) -> None:
    theta = np.radians(cranks_deg)
    modes = rrs_modes.assembly_modes(theta)
    count = int((~np.isnan(modes[:, 0, 0])).sum())
    np.testing.assert_allclose(modes[0], rrs.forward(theta), atol=1e-9)
    r, z = (0.056 + 0.025 * np.sin(theta))[:, None], (0.025 * np.cos(theta))[:, None]
    starts = np.random.default_rng(5).uniform(-np.pi, np.pi, (3, 3000))
    ones = np.ones((1, 3000))
    with np.errstate(all="ignore"):
        phi = rrs.solve_couplers(r * ones, z * ones, starts)
    phi = wrap(phi[:, ~np.isnan(phi).any(axis=0)])
    found = rrs.platform_pose(r - 0.061 * np.cos(phi), z + 0.061 * np.sin(phi))
    gap = np.abs(found[:, None] - modes[None, :count]).max(axis=(2, 3))
    assert gap.min(axis=1).max() < 1e-6  # whatever the search finds is listed
    assert gap.min(axis=0).max() < 1e-6  # and whatever is listed is found


@pytest.mark.parametrize("cranks_deg", [(31, 77, 104), (5, 90, 17), (100, 20, 60)])
def test_each_real_root_of_the_polynomial_is_one_assembly_mode(
    cranks_deg: tuple[float, ...],
) -> None:
    theta = np.radians(cranks_deg)
    r, z = 0.056 + 0.025 * np.sin(theta), 0.025 * np.cos(theta)
    roots = rrs_modes.coupler_roots(r, z)
    real = np.angle(roots[np.abs(np.abs(roots) - 1.0) < 1e-6])
    modes = rrs_modes.assembly_modes(theta)
    modes = modes[~np.isnan(modes[:, 0, 0])]
    ball = modes[:, :3, 3] + 0.056 * modes[:, :3, 0]
    phi = np.arctan2(ball[:, 2] - z[0], r[0] - ball[:, 0])
    assert len(roots) == 16
    np.testing.assert_allclose(np.sort(real), np.sort(phi), atol=1e-7)
