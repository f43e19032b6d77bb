"""What rules a plan and what its tool may do: held against differences of the plan's own rows."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pathfile import load_path
from sphmctl.planner import outcome
from sphmctl.planner.plan import Made

PATHS = Path(__file__).parents[2] / "configs" / "paths"
CELL = emulated_cell()


@cache
def made(name: str, timing: str = "stops", speed: float = 1.0) -> Made:
    return outcome(load_path(PATHS / f"{name}.yaml"), CELL, speed, timing)


def rates(found: Made) -> tuple[Floats, Floats, Floats]:
    """Rows (k,) with both neighbours 4 ms away, and there the 10 speeds and accelerations."""
    t = found.plan.t
    values = np.hstack([found.plan.joints, found.plan.tool[:, :3, 3]])
    even = np.isclose(np.diff(t), 0.004)
    rows = 1 + np.flatnonzero(even[1:] & even[:-1])
    speed = (values[rows + 1] - values[rows - 1]) / 0.008
    force = (values[rows + 1] - 2.0 * values[rows] + values[rows - 1]) / 0.004**2
    both = [
        np.column_stack([np.abs(x[:, :9]), np.linalg.norm(x[:, 9:], axis=1)])
        for x in (speed, force)
    ]
    return rows.astype(float), both[0], both[1]


@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_what_rules_the_controllers_drive_is_used_up_there(speed: float) -> None:
    found = made("octagon", speed=speed)
    rows, speeds, forces = rates(found)
    labels = np.array(found.binding)[rows.astype(int)]
    assert set(labels) == {"tool speed", "tool acceleration"}
    # 100 mm/s and 500 mm/s2 is what the octagon asks for.
    assert speeds[labels == "tool speed", 9] == pytest.approx(0.1 * speed, rel=0.011)
    ramps = forces[labels == "tool acceleration", 9]
    assert np.mean(ramps > 0.98 * 0.5 * speed**2) > 0.9  # but where up meets down
    assert len(found.binding) == len(found.plan.t)


def test_joints_that_rule_are_named() -> None:
    found = made("octagon_joints")
    rows, speeds, forces = rates(found)
    labels = np.array(found.binding)[rows.astype(int)]
    limits = {"speed": CELL.speeds_rad_s, "acceleration": CELL.accelerations_rad_s2}
    assert {"theta7 speed", "A2 acceleration", "A1 acceleration"} <= set(labels)
    for label in set(labels):
        joint, kind = label.split()
        k = JOINT_NAMES.index(joint)
        every = (speeds if kind == "speed" else forces)[labels == label][:, :9]
        share = np.median(every / limits[kind], axis=0)
        assert share.argmax() in (k, *(range(6, 9) if k > 5 else ()))


TIGHT = """\
version: 1
name: tight
tool: octagon_pen
speed: {tcp_mm_s: 100, tcp_mm_s2: 500}
wrist: {policy: fixed, cranks_deg: [60, 60, 60]}
moves:
  - ptp: {pose: [560, 0, 100, 180, 0, 180]}
  - circle: {centre: [559, 0, 100], normal: [0, 0, 1], turn_deg: 360}
"""


def test_a_bend_that_keeps_the_tool_slow_is_told_as_its_acceleration(tmp_path: Path) -> None:
    (tmp_path / "tight.yaml").write_text(TIGHT)
    found = outcome(load_path(tmp_path / "tight.yaml"), CELL)
    assert set(found.binding) == {"tool acceleration"}
    _, speeds, forces = rates(found)
    assert speeds[:, 9].max() < 0.03
    # What the bend takes and what goes along share the whole; some blocks cruise for an instant.
    assert 0.35 < np.median(forces[:, 9]) < 0.5


@pytest.mark.parametrize("timing", ["stops", "optimal"])
@pytest.mark.parametrize("name", ["octagon", "octagon_joints", "wrist_motion"])
def test_shares_are_those_of_the_rows(name: str, timing: str) -> None:
    found = made(name, timing)
    owned = np.diff(found.plan.t)
    labels = np.array(found.binding[1:])
    assert sum(share for _, share in found.shares) == pytest.approx(1.0)
    for label, share in found.shares:
        assert owned[labels == label].sum() / owned.sum() == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize("timing", ["stops", "optimal"])
def test_the_tool_may_have_what_the_path_asks_for_where_it_follows_one(timing: str) -> None:
    asked = made("octagon", timing, 0.5).asked
    assert asked[1:] == pytest.approx(np.tile([0.05, 0.125], (len(asked) - 1, 1)))
    assert np.isinf(made("octagon_joints", timing).asked).all()


def test_margins_have_a_value_for_each_row_and_the_worst_is_told() -> None:
    found = made("octagon")
    A5 = next(m for m in found.margins if m.title == "A5 from 0")
    assert A5.values == pytest.approx(np.abs(np.degrees(found.plan.joints[:, 4])))
    for margin in found.margins:
        worst = margin.values.max() if "load" in margin.name else margin.values.min()
        assert margin.values.shape == found.plan.t.shape
        assert margin.value == worst == margin.values[margin.row]
