"""The controller's own drive: where it stops, how slowly it can go, and what takes no time."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.errors import InfeasibleError
from sphmctl.motion import Plan
from sphmctl.pathfile import load_path
from sphmctl.planner import plan
from tests.planner.oracle import aside_mm, controller_block_s, pen_mm

Planner = Callable[..., Plan]

HEAD = """version: 1
name: test
tool: octagon_pen
speed: {tcp_mm_s: 100, tcp_mm_s2: 500}
wrist: {policy: fixed, cranks_deg: [60, 60, 60]}
points:
  P: {pose: [560, 0, 60, 180, 0, 180]}
  Q: {pose: [560, 100, 60, 180, 0, 180]}
  R: {pose: [600, 100, 60, 180, 0, 180]}
moves:
  - ptp: P
"""
CORNER_MM = np.array([[560.0, 0, 60], [560, 100, 60], [600, 100, 60]])


@pytest.fixture
def planned(tmp_path: FilePath) -> Planner:
    def make(moves: str, speed: float = 1.0) -> Plan:
        file = tmp_path / "path.yaml"
        file.write_text(HEAD + moves)
        return plan(load_path(file), emulated_cell(), speed)

    return make


def around(blend_mm: float) -> str:
    """Round the corner Q."""
    blend = f"    blend_mm: {blend_mm:.7f}\n" if blend_mm else ""
    return f"  - lin: Q\n{blend}  - lin: R\n"


def rest_to_rest_s(length: float, speed: float, acceleration: float) -> float:
    """A trapezoid's time."""
    peak = min(speed, np.sqrt(length * acceleration))
    return float(length / peak + peak / acceleration)


@pytest.mark.parametrize("blend_mm", [1e-6, 0.001, 0.01, 0.1, 0.5])
def test_a_tiny_blend_takes_no_more_than_a_stop_and_the_corner_itself(
    planned: Planner, blend_mm: float
) -> None:
    sharp, made = planned(around(0.0)), planned(around(blend_mm))
    # The corner is no longer than the two sides it cuts. Its bend is at most 4 by the blend, as an
    # arc's would be 1 by it, and it may take one stop more within itself.
    speed = np.sqrt(0.7 * 500.0 * blend_mm / 4.0)
    corner_s = 2.0 * rest_to_rest_s(blend_mm, speed, 350.0)
    print(f"{blend_mm} mm: {made.duration_s:.3f} s, {sharp.duration_s:.3f} s without")
    assert made.duration_s <= sharp.duration_s + corner_s


def test_a_tiny_blend_of_a_polyline_is_none(planned: Planner, tmp_path: FilePath) -> None:
    (tmp_path / "p.csv").write_text("x_mm,y_mm,z_mm\n560,40,60\n600,40,60\n")
    took_s = [
        planned("  - polyline: {csv: p.csv}\n" + blend + "  - lin: R\n").duration_s
        for blend in ("", "    blend_mm: 0.0001\n")
    ]
    assert took_s[0] == took_s[1]


@pytest.mark.parametrize("blend_mm", [0.1, 1.0, 10.0])
def test_knots_at_a_blend_keep_the_chords_on_the_path_and_the_controllers_time(
    planned: Planner, blend_mm: float
) -> None:
    made = planned(around(blend_mm))
    begin, begin_s = made.joints[0, :6], 0.0
    for knot in made.knots:
        end_s = float(made.t[knot.sample])
        took_s = controller_block_s(begin, knot.joints, knot.velocity, knot.acceleration)
        assert took_s == pytest.approx(end_s - begin_s, rel=1e-6)
        for share in np.linspace(0.0, 1.0, 9):
            arm = np.degrees(begin + share * (knot.joints - begin))
            tip, _ = pen_mm(np.append(arm, [60.0, 60.0, 60.0]))
            aside = min(aside_mm(tip, *CORNER_MM[:2]), aside_mm(tip, *CORNER_MM[1:]))
            # A blend runs beside the corner by less than half of itself.
            assert aside < 0.3 + blend_mm / 2.0
        begin, begin_s = knot.joints, end_s


def test_a_stop_stands_where_a_slow_line_runs_on_as_a_fast_one(planned: Planner) -> None:
    made = planned(
        "  - lin: {pose: [560, 60, 60, 180, 0, 180]}\n    speed: {tcp_mm_s: 20}\n  - lin: Q\n"
    )
    stops = [1000.0 * made.tool[knot.sample, 1, 3] for knot in made.knots]
    assert np.abs(np.array(stops) - 60.0).min() < 0.5
    # Each line at its own speed, and one stop more within each.
    slow, fast = rest_to_rest_s(30.0, 20.0, 500.0), rest_to_rest_s(20.0, 100.0, 500.0)
    assert made.duration_s <= 1.01 * 2.0 * (slow + fast)


def test_the_least_speed_that_a_refusal_tells_is_the_least_one(planned: Planner) -> None:
    text = "  - lin: {pose: [560, 5, 60, 180, 0, 180]}\n"
    with pytest.raises(InfeasibleError) as caught:
        planned(text, 0.001)
    found = re.fullmatch(
        r"the arm would have to creep at (\S+) % of its speed, and its controller takes 0.01 % at "
        r"least: the least speed for this path is (\S+) % of its own",
        caught.value.problems[0].message,
    )
    assert found is not None
    crept, least = map(float, found.groups())
    assert crept * least / 0.1 == pytest.approx(0.01, rel=0.01)
    made = planned(text, least / 100.0)
    assert min(knot.velocity for knot in made.knots) == pytest.approx(1e-4, rel=0.01)
    with pytest.raises(InfeasibleError) as caught:
        planned(text, 0.99 * least / 100.0)
    told = caught.value.problems[0].message.split()
    assert float(told[told.index("creep") + 2]) < 0.01


def test_a_path_too_slow_at_any_percentage_is_told_how_much_faster_it_must_be(
    planned: Planner,
) -> None:
    with pytest.raises(InfeasibleError, match=r"creep .* ask for \S+ times the speed there") as got:
        planned("  - lin: {pose: [560, 0.5, 60, 180, 0, 180]}\n    speed: {tcp_mm_s: 0.1}\n")
    times = float(got.value.problems[0].message.split()[-5])
    planned(
        "  - lin: {pose: [560, 0.5, 60, 180, 0, 180]}\n"
        f"    speed: {{tcp_mm_s: {0.1 * times:.6f}}}\n"
    )


def test_no_slow_ramp_is_refused_for_rounding(planned: Planner) -> None:
    # The lowest acceleration, divided by what A2 moves and multiplied by it, is less than it was.
    turns = "  - ptp: {joints_deg: [0, -90, 90, 0, 90, 0, 60, 60, 60]}\n"
    for away in (0.062, 0.0, 0.074, 0.0, 0.113, 0.0, 0.119):
        turns += f"  - ptp: {{joints_deg: [0, {-90.0 + away:.3f}, 90, 0, 90, 0, 60, 60, 60]}}\n"
        turns += "    speed: {joint_percent: 20, joint_acceleration_percent: 1}\n"
    accelerations = [knot.acceleration for knot in planned(turns, 0.1).knots[1:]]
    assert accelerations == [1e-4] * 7


@pytest.mark.parametrize("length_mm", [0.0, 1e-5, 9e-4])
def test_a_line_too_short_to_move_is_left_out_with_a_note(
    planned: Planner, length_mm: float
) -> None:
    made = planned(f"  - lin: {{pose: [560, {length_mm:.6f}, 60, 180, 0, 180]}}\n  - ptp: P\n")
    assert (len(made.t), made.knots) == (1, ())
    assert made.notes[0] == "P to there (move 2): nothing moves by as much as 1 um; left out"
    assert made.notes[1].startswith("move 3 (ptp to P): nothing moves by as much as 1 um")
