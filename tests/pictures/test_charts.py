"""Scales and labels of charts: they can be read, and cover nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sphmctl.motion import Floats
from sphmctl.pictures import charts
from sphmctl.pictures.charts import Chart, Line, Mark

LETTER, HEIGHT = 7.5, 9.0
"""A bold letter of 13 px in DejaVu Sans, at least; what stands above the line of writing."""


@given(st.floats(-1e4, 1e4), st.floats(-6.0, 5.0), st.integers(3, 20))
def test_a_scale_has_two_numbers_at_least(low: float, power: float, most: int) -> None:
    high = low + 10.0**power
    found = charts.ticks(low, high, most)
    assert 2 <= len(found) <= max(most, 5)
    assert np.all(np.diff(found) > 0.0)
    slack = 1e-6 * (high - low) + 1e-9
    assert low - slack <= found[0] < found[-1] <= high + slack


def labels(svg: str) -> list[tuple[str, float, float]]:
    """Each label's words and where the middle of its line of writing is."""
    found = re.findall(r'<text class="mark middle" x="([-\d.]+)" y="([-\d.]+)">([^<]+)<', svg)
    return [(words, float(x), float(y)) for x, y, words in found]


def boxes(svg: str) -> Floats:
    """Left, top, right and bottom of the labels, (m, 4)."""
    return np.array(
        [
            (x - LETTER * len(words) / 2, y - HEIGHT, x + LETTER * len(words) / 2, y)
            for words, x, y in labels(svg)
        ]
    )


ANGLES = np.linspace(0.0, 2.0 * np.pi, 9)
SHAPES = {
    "corners": (np.cos(ANGLES), np.sin(ANGLES)),
    "a line along x": (np.linspace(-1.0, 1.0, 9), np.zeros(9)),
    "a line along y": (np.zeros(9), np.linspace(-1.0, 1.0, 9)),
    "an S": (np.sin(np.linspace(0.0, 2.0 * np.pi, 9)), np.linspace(-1.0, 1.0, 9)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_labels_lie_off_lines_dots_each_other_and_the_frame(shape: str) -> None:
    x, y = (100.0 * values for values in SHAPES[shape])
    names = ["begin", "B", "C, D", "middle", "E", "F", "G", "end"]
    marks = tuple(Mark(float(a), float(b), name) for a, b, name in zip(x, y, names, strict=False))
    svg = charts.draw(Chart("test", (Line(x, y, "s1"),), "x", "y", 520.0, 340.0, marks, equal=True))
    taken = boxes(svg)
    assert len(taken) == 8
    dots = np.array(re.findall(r'<circle class="dot" cx="([\d.]+)" cy="([\d.]+)"', svg), float)
    path = re.findall(r'<path class="line s1" d="([^"]+)"', svg)[0]
    corners = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", path), float)
    share = np.linspace(0.0, 1.0, 100)[:, None, None]
    ink = (corners[:-1] + share * np.diff(corners, axis=0)).reshape(-1, 2)
    for k, (left, top, right, bottom) in enumerate(taken):
        for points, reach in ((dots, 3.0), (ink, 0.5)):
            inside = (points > [left - reach, top - reach]) & (
                points < [right + reach, bottom + reach]
            )
            assert not np.all(inside, axis=1).any()
        others = np.delete(taken, k, axis=0)
        apart = (
            (others[:, 0] >= right)
            | (others[:, 2] <= left)
            | (others[:, 1] >= bottom)
            | (others[:, 3] <= top)
        )
        assert apart.all()
        assert 46.0 < left < right < 520.0 - 12.0
        assert 10.0 < top < bottom < 340.0 - 36.0


def test_points_on_one_place_share_a_dot_and_a_label() -> None:
    x = np.array([0.0, 50.0, 100.0])
    marks = (Mark(0.0, 0.0, "A"), Mark(100.0, 0.0, "B"), Mark(100.9, 0.0, "C"), Mark(0, 0, "A"))
    svg = charts.draw(Chart("test", (Line(x, 0.0 * x, "s1"),), "x", "y", marks=marks, equal=True))
    assert sorted(words for words, _, _ in labels(svg)) == ["A", "B, C"]
    assert svg.count('class="dot"') == 2


def test_long_numbers_leave_room_for_what_the_axis_shows() -> None:
    y = np.array([-37.8, -37.2])
    svg = charts.draw(Chart("test", (Line(np.arange(2.0), y, "s1"),), "time, s", "degrees"))
    ends = re.findall(r'class="tick end" x="([\d.]+)" y="[\d.]+">([^<]+)<', svg)
    assert max(len(number) for _, number in ends) >= 5
    # 11 px digits are 7 px wide; the label's letters end 14 px from the left edge.
    assert min(float(x) - 7.0 * len(number) for x, number in ends) >= 14.0
