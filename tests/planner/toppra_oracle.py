"""Durations by toppra 0.6 (H. Pham), the reference implementation of the method. x86-64 only."""

from __future__ import annotations

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint as limits_of
from numpy.typing import NDArray

from sphmctl.planner.topp import Bounds

Floats = NDArray[np.float64]

DIRECTIONS = 360
"""Sides of the polygon around the circle of the tool's acceleration: 0.004 % outside it."""


def toppra_duration_s(
    joints: Floats, s: Floats, limits: Bounds, tool: Floats | None = None
) -> float:
    """How long toppra takes along joints (n, 9) and tool points (n, 2) on the grid s (n,).

    The tool's speed is held by a tenth joint that runs with s, so s must then be arc length.
    """
    toppra.setup_logging("ERROR")
    interpolation = limits_of.DiscretizationType.Interpolation
    speeds, columns = limits.joint_speeds, [joints]
    accelerations = limits.joint_accelerations
    free = 1e4
    if tool is not None:
        columns += [s[:, None], tool]
        speeds = np.concatenate([speeds, [float(limits.tool_speed)], [free, free]])
        accelerations = np.concatenate([accelerations, [free, free, free]])
    values = np.hstack(columns)
    path = toppra.SplineInterpolator(s, values)
    rules = [
        limits_of.JointVelocityConstraint(np.column_stack([-speeds, speeds])),
        limits_of.JointAccelerationConstraint(
            np.column_stack([-accelerations, accelerations]), discretization_scheme=interpolation
        ),
    ]
    if tool is not None:
        angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        sides = np.column_stack([np.cos(angle), np.sin(angle)])
        limit = np.full(DIRECTIONS, float(np.asarray(limits.tool_acceleration)))
        rules.append(
            limits_of.SecondOrderConstraint(
                lambda _q, _speed, acceleration: acceleration[-2:],
                lambda _q: sides,
                lambda _q: limit,
                values.shape[1],
                discretization_scheme=interpolation,
            )
        )
    solver = toppra.algorithm.TOPPRA(rules, path, gridpoints=s, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(0.0, 0.0)
    return float(np.sum(2.0 * np.diff(s) / (speed[1:] + speed[:-1])))
