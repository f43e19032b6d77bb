"""Durations without jerk limit beside toppra's, on the same rows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sphmctl.planner.timelaw import Bounds, TimeLaw, time_law
from tests.planner.timing_paths import Way, bounds, octagon, rounded_square, stream_use, waves
from tests.planner.toppra_oracle import toppra_duration_s

SLOWER = 1.01
FASTER = 0.998
"""Ours may be faster by what two ways of taking derivatives on the same rows differ."""


def duration_s(way: Way, limits: Bounds, stops: tuple[int, ...] = ()) -> float:
    law = time_law(way.joints, way.s, way.tool, limits, way.cuts, stops, 0.0)
    assert isinstance(law, TimeLaw)
    assert stream_use(law, way, limits, 2).max() <= 1.005
    return law.duration_s


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(300, 1500))
def test_random_smooth_paths_take_as_long(seed: int, rows: int) -> None:
    way = waves(seed, rows)
    ratio = duration_s(way, bounds()) / toppra_duration_s(way.joints, way.s, bounds())
    assert FASTER <= ratio <= SLOWER


@pytest.mark.parametrize("tool", [(0.1, 0.5), (1.0, 10.0), (10.0, 1000.0)])
def test_the_octagons_sides_take_as_long(tool: tuple[float, float]) -> None:
    way = octagon(0.001)
    limits = bounds(*tool)
    ours = duration_s(way, limits, way.cuts)
    joints, point = way.joints, way.tool[:, :2]
    theirs = 0.0
    for low, high in pairwise((0, *way.cuts, len(way.s) - 1)):
        side = slice(low, high + 1)
        theirs += toppra_duration_s(joints[side], way.s[side], limits, point[side])
    print(f"{tool}: ours {ours:.4f} s, toppra {theirs:.4f} s")
    assert FASTER <= ours / theirs <= SLOWER


def test_a_square_with_round_corners_takes_as_long_at_the_joints_limits() -> None:
    way = rounded_square(0.02, 0.2, 0.0005)
    limits = Bounds(bounds().joint_speeds, bounds().joint_accelerations)
    ours, theirs = duration_s(way, limits), toppra_duration_s(way.joints, way.s, limits)
    print(f"ours {ours:.4f} s, toppra {theirs:.4f} s")
    assert 0.99 <= ours / theirs <= SLOWER


@pytest.mark.parametrize("seed", range(6))
def test_the_tools_polygon_costs_less_than_one_percent(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.uniform(-6.0, 6.0, 5)

    def heading(s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> object:
        return sum(c * np.sin((k + 1) * 5.0 * s) for k, c in enumerate(turn))

    s = np.linspace(0.0, 0.5, 1001)
    fine = np.linspace(0.0, 0.5, 100_001)
    angle = np.asarray(heading(fine), dtype=np.float64)
    middle = (angle[1:] + angle[:-1]) / 2.0
    step = fine[1]
    x = np.append(0.0, np.cumsum(np.cos(middle) * step))[::100]
    y = np.append(0.0, np.cumsum(np.sin(middle) * step))[::100]
    tool = np.column_stack([x, y])
    limits = Bounds(np.full(9, 1e3), np.full(9, 1e6), 0.4, 2.0)
    joints = np.zeros((len(s), 9))
    law = time_law(joints, s, np.column_stack([tool, 0.0 * s]), limits, filter_s=0.0)
    assert isinstance(law, TimeLaw)
    theirs = toppra_duration_s(joints, s, limits, tool)
    print(f"ours {law.duration_s:.4f} s, toppra {theirs:.4f} s")
    assert FASTER <= law.duration_s / theirs <= SLOWER
