"""Passages of A5 = 0: where a way changes the sign of A5, the wrist is led through zero itself.

Axes 4 and 6 are in line there. A way that passes beside A5 = 0 has to swing A4 by half a turn;
one that goes through keeps it. A wrist of three free cranks can always be set so that it goes
through: one row of the passage is found by Newton's method, and stays as it is from then on.
"""

from __future__ import annotations

import numpy as np

from sphmctl.motion import Floats
from sphmctl.planner.policies import cost
from sphmctl.planner.policies.families import Family
from sphmctl.planner.policies.graph import Ridge
from sphmctl.planner.policies.known import Task
from sphmctl.robots import kr6, sphm
from sphmctl.robots.sphm.chain import turned

PROBE_RAD = 1e-5
"""Of a crank, for derivatives: their error is then some 1e-10, which costs no step."""

MOST_STEPS = 12
"""Of Newton's method; five are enough from two degrees away."""

THROUGH_RAD = 1e-11
"""What may remain: below it the arm's inverse takes the axes as in line."""


def led_through(task: Task, family: Family, ridge: Ridge) -> Ridge:
    """The way with a pinned layer at A5 = 0 in each change of A5's sign where there is one."""
    for layer in range(len(ridge.rows) - 1, 0, -1):
        a5 = ridge.joints[layer - 1 : layer + 1, 4]
        if a5[0] * a5[1] >= 0.0 or ridge.rows[layer] - ridge.rows[layer - 1] < 2:
            continue
        found = _zero(task, family, ridge, layer, float(a5[0] / (a5[0] - a5[1])))
        if found is not None:
            row, values, joints = found
            ridge = Ridge(
                np.insert(ridge.rows, layer, row),
                np.insert(ridge.values, layer, values, axis=0),
                np.insert(ridge.joints, layer, joints, axis=0),
                np.insert(ridge.pinned, layer, True),
            )
    return ridge


def _zero(
    task: Task, family: Family, ridge: Ridge, layer: int, share: float
) -> tuple[int, Floats, Floats] | None:
    """Row, parameters and joints at A5 = 0 before a layer; None where the family has none."""
    begin, end = (int(row) for row in ridge.rows[layer - 1 : layer + 1])
    way_m = task.way_m[begin] + share * (task.way_m[end] - task.way_m[begin])
    row = int(np.clip(np.searchsorted(task.way_m, way_m), begin + 1, end - 1))
    values, hint = (
        a[layer - 1] + share * (a[layer] - a[layer - 1]) for a in (ridge.values, ridge.joints)
    )
    probe = PROBE_RAD * np.vstack([np.zeros(len(values)), np.eye(len(values))])
    for _ in range(MOST_STEPS):
        beside = cost.aside(_nearest(task, family, row, values + probe, hint)).T
        if np.isnan(beside).any():
            return None
        if np.abs(beside[0]).max() < THROUGH_RAD:
            return row, values, _nearest(task, family, row, values[None], hint)[0]
        slope = (beside[1:] - beside[0]).T / PROBE_RAD
        step = np.linalg.lstsq(slope, beside[0], rcond=None)[0]
        values = np.clip(values - step, family.low[row], family.high[row])
    return None


def _nearest(task: Task, family: Family, row: int, values: Floats, hint: Floats) -> Floats:
    """Joints (k, 9) for parameters (k, d) on the branch of `hint` (9,), whatever A4 and A6 are."""
    setup = task.setup
    cranks = family.cranks(np.full(len(values), row), values)
    flange = sphm.flange_target(task.target[row], cranks, setup.tool, setup.mount_yaw)
    near, limits = hint[:6], setup.ranges[:6]
    arm = turned(kr6.inverse(flange, near), near, limits)
    apart = np.square(arm - near) @ np.array([1.0, 1.0, 1.0, 1e-6, 1e-6, 1e-6])
    pick = np.nan_to_num(apart, nan=np.inf).argmin(axis=-1)
    return np.hstack([arm[np.arange(len(arm)), pick], cranks])
