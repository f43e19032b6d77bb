"""Singular poses: derivatives by differences, the arm's determinant, assembly modes that merge."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from numpy.typing import ArrayLike

from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs, rrs_modes
from sphmctl.robots.geometry import wrap
from sphmctl.robots.sphm import RANGES9, load, singular

STEP = 1e-6
MIDDLE = np.radians([60.0, 60.0, 60.0])


def with_cranks(cranks_deg: ArrayLike) -> Floats:
    """Joints (n, 9) with a harmless arm."""
    cranks = np.atleast_2d(np.radians(np.asarray(cranks_deg, dtype=np.float64)))
    arm = np.radians([0.0, -90.0, 90.0, 0.0, 45.0, 0.0])
    return np.hstack([np.broadcast_to(arm, (len(cranks), 6)), cranks])


def grid(steps: int) -> Floats:
    """Crank triples over the whole range, degrees."""
    line = np.linspace(0.0, 120.0, steps)
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)


def test_the_loop_equations_give_the_couplers_rates_found_by_differences() -> None:
    theta = np.random.default_rng(1).uniform(0.02, np.radians(120.0), (200, 3))
    equations = singular.loops(theta)
    rates = -np.linalg.solve(equations.A, equations.C)
    for crank in range(3):
        ahead, behind = theta.copy(), theta.copy()
        ahead[:, crank] += STEP
        behind[:, crank] -= STEP
        phi = wrap(singular.loops(ahead).phi - singular.loops(behind).phi)
        np.testing.assert_allclose(rates[:, :, crank], phi / (2.0 * STEP), atol=1e-7)


def test_the_couplers_found_are_those_of_newtons_method() -> None:
    theta = np.random.default_rng(2).uniform(0.0, np.radians(120.0), (200, 3))
    r = rrs.BASE_RADIUS_M + rrs.CRANK_M * np.sin(theta.T)
    z = rrs.CRANK_M * np.cos(theta.T)
    start = np.arccos((r - rrs.PLATFORM_RADIUS_M) / rrs.COUPLER_M)
    newton = rrs.solve_couplers(r, z, start)
    np.testing.assert_allclose(singular.loops(theta).phi.T, newton, atol=1e-9)
    residual = rrs.newton_step(r, z, newton)[0]
    assert np.abs(residual).max() < 1e-9


def test_the_margin_is_1_at_the_middle_and_control_is_never_lost_in_range() -> None:
    assert singular.margins(with_cranks([60, 60, 60])).parallel == pytest.approx([1.0])
    assert singular.margins(with_cranks(grid(13))).parallel.min() > 0.2


def end_of_the_built_mode(way: Floats) -> float:
    """The share of a way in crank space, from mid-range, at which the built assembly ends."""
    shares = np.linspace(0.0, 1.0, 2001)
    first = int(np.isnan(rrs.forward(MIDDLE + shares[:, None] * way)[:, 0, 0]).argmax())
    low, high = shares[first - 1], shares[first]
    for _ in range(50):
        half = (low + high) / 2.0
        broken = np.isnan(rrs.forward(MIDDLE + half * way)[0, 0])
        low, high = (low, half) if broken else (half, high)
    return float(low)


@pytest.mark.parametrize("beyond_deg", [(6.0, 6.0, 140.0), (-5.0, 135.0, 8.0), (129.0, -2.0, -6.0)])
def test_where_two_assembly_modes_merge_the_parallel_margin_is_gone(
    beyond_deg: tuple[float, float, float],
) -> None:
    way = np.radians(beyond_deg) - MIDDLE
    end = end_of_the_built_mode(way)
    shares = end - np.array([1e-2, 1e-3, 1e-4])
    cranks = MIDDLE + shares[:, None] * way
    apart = []
    for modes in rrs_modes.assembly_modes(cranks):
        others = modes[1:][np.isfinite(modes[1:, 0, 0])]
        apart.append(float(np.abs(others - modes[0]).max(axis=(1, 2)).min()))
    margins = singular.margins(with_cranks(np.degrees(cranks))).parallel
    # As at the edge of a fold both fall as the root of what is left of the way: their ratio stays,
    # and the squares are 0 where the assembly ends (Newton's method gives up a little before).
    ratios = apart / margins
    assert ratios[1] == pytest.approx(ratios[2], rel=0.05)
    assert apart[2] < apart[0] / 3.0
    squares = margins**2
    zero = shares[2] + squares[2] * (shares[2] - shares[1]) / (squares[1] - squares[2])
    assert zero == pytest.approx(end, abs=1e-4)


def test_a_crank_at_0_is_a_serial_singularity_and_no_parallel_one() -> None:
    level = singular.margins(with_cranks([0, 0, 0]))
    assert level.serial_rad[0] < 1e-7
    assert level.parallel[0] > 0.5
    # The platform does not move by that crank there, and does a degree further on.
    move = [
        np.abs(rrs.forward(theta + [STEP, 0, 0]) - rrs.forward(theta)).max() / STEP
        for theta in (np.zeros(3), np.radians([1.0, 0.0, 0.0]))
    ]
    assert move[0] < 1e-6
    assert move[1] > 1e-4


def test_the_knee_angle_is_the_one_between_crank_and_coupler() -> None:
    theta = np.random.default_rng(3).uniform(0.0, np.radians(120.0), (100, 3))
    T = rrs.forward(theta)
    for leg, angle in enumerate(rrs.LEG_ANGLES):
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        crank = np.sin(theta[:, leg, None]) * radial
        crank = crank + np.cos(theta[:, leg, None]) * [0.0, 0.0, 1.0]
        ball = T[:, :3, 3] + 0.056 * T[:, :3, :2] @ [np.cos(angle), np.sin(angle)]
        coupler = (ball - 0.056 * radial - 0.025 * crank) / 0.061
        between = np.arccos(np.clip((crank * coupler).sum(axis=1), -1.0, 1.0))
        knees = singular.knee_angles(theta, singular.loops(theta).phi)
        np.testing.assert_allclose(knees[:, leg], between, atol=1e-7)


def test_the_arms_margins_multiply_to_the_determinant_of_its_jacobian() -> None:
    rng = np.random.default_rng(4)
    q = rng.uniform(kr6.RANGES[:, 0], kr6.RANGES[:, 1], (300, 6))
    J = np.empty((300, 6, 6))
    T = kr6.forward(q)
    for axis in range(6):
        step = np.zeros(6)
        step[axis] = STEP
        change = (kr6.forward(q + step) - kr6.forward(q - step)) / (2.0 * STEP)
        J[:, :3, axis] = change[:, :3, 3]
        spin = change[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)
        J[:, 3:, axis] = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    found = singular.margins(np.hstack([q, np.ones((300, 3))]))
    product = np.sin(found.wrist_rad) * np.sin(found.elbow_rad) * found.shoulder_m
    # What remains are the two links: 455 mm, and 421.46 from axis 3 to the wrist centre.
    links_m2 = 0.455 * np.hypot(0.420, 0.035)
    np.testing.assert_allclose(np.abs(np.linalg.det(J)), links_m2 * product, atol=1e-8)


def test_rows_on_which_the_wrist_does_not_close_have_no_margin_and_harm_no_others() -> None:
    q = with_cranks([[60, 60, 60], [6, 6, 140], [60, 60, 60]])
    assert np.isnan(rrs.forward(q[1, 6:])[0, 0])
    np.testing.assert_array_equal(np.isnan(singular.margins(q).parallel), [False, True, False])


def test_rows_that_repeat_the_one_before_give_what_each_gives_alone() -> None:
    joints = np.random.default_rng(3).uniform(RANGES9[:, 0], RANGES9[:, 1], (6, 9))
    joints = joints[[0, 0, 1, 2, 2, 2, 1, 3, 4, 4, 5]]
    joints[:, :6] += np.linspace(0.0, 0.1, len(joints))[:, None]
    together = singular.margins(joints)
    alone = [singular.margins(row) for row in joints]
    for field in fields(together):
        expected = np.concatenate([getattr(one, field.name) for one in alone])
        np.testing.assert_allclose(getattr(together, field.name), expected, rtol=1e-12)
    torques = load.holding_torques(joints, load.Payload(0.1, (0.0, 0.0, 0.02)))
    one_by_one = [load.holding_torques(row, load.Payload(0.1, (0.0, 0.0, 0.02))) for row in joints]
    np.testing.assert_allclose(torques, np.concatenate(one_by_one), rtol=1e-9)
