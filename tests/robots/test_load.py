"""The servos' static load: by hand where it is level, by differences of the potential elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from sphmctl.motion import Floats
from sphmctl.robots import rrs, sphm
from sphmctl.robots.sphm import load

STEP = 1e-6
UPRIGHT = [0.0, -90.0, 90.0, 0.0, -90.0, 0.0]  # the flange looks up
DOWN = [0.0, -90.0, 90.0, 0.0, 90.0, 0.0]


def pose(arm_deg: list[float], cranks_deg: list[float]) -> Floats:
    return np.radians([[*arm_deg, *cranks_deg]])


@pytest.mark.parametrize(("arm", "sign"), [(UPRIGHT, 1.0), (DOWN, -1.0)])
@pytest.mark.parametrize("crank_deg", [10.0, 60.0, 110.0])
def test_a_level_platform_shares_its_weight_among_three_servos(
    arm: list[float], sign: float, crank_deg: float
) -> None:
    found = load.holding_torques(pose(arm, [crank_deg] * 3), load.Payload(0.2, (0.0, 0.0, 0.05)))
    # heave = 25 cos(theta) + sqrt(61^2 - 25^2 sin^2(theta)): its slope lifts the whole weight.
    s, c = np.sin(np.radians(crank_deg)), np.cos(np.radians(crank_deg))
    slope_m = -0.025 * s - 0.025**2 * s * c / np.sqrt(0.061**2 - (0.025 * s) ** 2)
    weight_n = 9.80665 * (load.PLATFORM_KG + 0.2)
    np.testing.assert_allclose(found, [[sign * weight_n * slope_m / 3.0] * 3], rtol=1e-9)


@pytest.mark.parametrize("yaw_deg", [0.0, 50.0])
def test_torques_are_the_slope_of_the_potential_in_any_pose(yaw_deg: float) -> None:
    rng, yaw = np.random.default_rng(1), float(np.radians(yaw_deg))
    q = rng.uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (100, 9))
    q[:, 6:] = np.maximum(q[:, 6:], 0.01)
    payload = load.Payload(0.3, (0.02, -0.03, 0.08))
    carried = np.eye(4)
    carried[:3, 3] = payload.centre_m

    def potential_j(joints: Floats) -> Floats:
        platform = sphm.forward(joints, None, yaw)[:, 2, 3]
        hanging = sphm.forward(joints, carried, yaw)[:, 2, 3]
        return np.asarray(9.80665 * (load.PLATFORM_KG * platform + payload.mass_kg * hanging))

    found = load.holding_torques(q, payload, yaw)
    for leg in range(3):
        step = np.zeros(9)
        step[6 + leg] = STEP
        slope = (potential_j(q + step) - potential_j(q - step)) / (2.0 * STEP)
        np.testing.assert_allclose(found[:, leg], slope, atol=1e-8)


def test_a_crank_in_line_with_its_coupler_holds_nothing() -> None:
    found = load.holding_torques(pose(UPRIGHT, [0.0, 0.0, 0.0]), load.Payload(1.0, (0.0, 0.0, 0.0)))
    assert np.abs(found).max() < 1e-7


def test_a_wrist_that_does_not_close_has_no_load_and_harms_no_others() -> None:
    q = np.vstack([pose(UPRIGHT, [60, 60, 60]), pose(UPRIGHT, [6, 6, 140])])
    found = load.holding_torques(q, load.Payload(0.1, (0.0, 0.0, 0.0)))
    assert np.isnan(rrs.forward(q[1, 6:])[0, 0])
    np.testing.assert_array_equal(np.isnan(found).any(axis=1), [False, True])
