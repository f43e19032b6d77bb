"""The optimal timing along whole paths: each move at its own speed, and what the stops cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.motion import Floats, Plan
from sphmctl.pathfile import Path, load_path
from sphmctl.planner import check, plan
from sphmctl.planner.plan import Made, draw_up
from sphmctl.planner.sampling import verify
from tests.planner.test_stops import HEAD

SHIPPED = FilePath(__file__).parents[2] / "configs" / "paths"
Written = Callable[[str], Path]


@pytest.fixture
def written(tmp_path: FilePath) -> Written:
    def write(moves: str) -> Path:
        file = tmp_path / "path.yaml"
        file.write_text(HEAD + moves)
        return load_path(file)

    return write


def made(path: Path, filter_s: float = 0.024) -> Made:
    found = draw_up(path, emulated_cell(), 1.0, "optimal", filter_s)
    assert found.made is not None, found.problems
    return found.made


def tool_rates(planned: Plan) -> tuple[Floats, Floats, Floats]:
    """Points (n, 3), mm, between two instants of the controller; speeds, accelerations there."""
    grid = np.abs(planned.t / 0.004 - np.round(planned.t / 0.004)) < 1e-6
    points, dt = planned.tool[grid, :3, 3] * 1000.0, np.diff(planned.t[grid])[:, None]
    speed = np.diff(points, axis=0) / dt
    force = np.linalg.norm(np.diff(speed, axis=0), axis=1) / ((dt[1:] + dt[:-1]) / 2.0)[:, 0]
    return (points[1:] + points[:-1]) / 2.0, np.linalg.norm(speed, axis=1), force


MIDDLE = "  - lin: {pose: [560, 60, 60, 180, 0, 180]}\n"
SLOW_FIRST = MIDDLE + "    speed: {tcp_mm_s: 20}\n  - lin: Q\n"
SLOW_LAST = MIDDLE + "  - lin: Q\n    speed: {tcp_mm_s: 20}\n"
BLENDED = "  - lin: Q\n    blend_mm: 10\n    speed: {tcp_mm_s: 50}\n  - lin: R\n"
BLENDED_ON = "  - lin: Q\n    blend_mm: 10\n  - lin: R\n    speed: {tcp_mm_s: 50}\n"


@pytest.mark.parametrize(
    ("moves", "slow_mm_s"),
    [(SLOW_FIRST, 20.0), (SLOW_LAST, 20.0), (BLENDED, 50.0), (BLENDED_ON, 50.0)],
)
def test_moves_that_run_on_into_each_other_keep_each_its_own_speed(
    written: Written, moves: str, slow_mm_s: float
) -> None:
    middle, speed, _ = tool_rates(made(written(moves)).plan)
    if "blend" in moves:
        first = middle[:, 1] < 90.0
        behind = middle[:, 0] > 570.0
    else:
        first, behind = middle[:, 1] < 59.9, middle[:, 1] > 60.1
    slow, fast = (first, behind) if moves in (SLOW_FIRST, BLENDED) else (behind, first)
    assert speed[slow].max() <= slow_mm_s * 1.005
    assert speed[slow].max() >= slow_mm_s * 0.99
    assert 1.8 * slow_mm_s < speed[fast].max() <= 100.5


def test_moves_that_run_on_keep_each_its_own_acceleration(written: Written) -> None:
    text = MIDDLE + "    speed: {tcp_mm_s2: 50}\n  - lin: Q\n"
    middle, _, force = tool_rates(made(written(text)).plan)
    first = (middle[1:, 1] < 59.0) & (middle[:-1, 1] < 59.0)
    behind = (middle[1:, 1] > 61.0) & (middle[:-1, 1] > 61.0)
    assert 49.0 < force[first].max() <= 50.25
    assert 490.0 < force[behind].max() <= 502.5


@pytest.mark.parametrize(("part", "limit"), [(slice(0, 400), 20.0), (slice(-120, None), 100.0)])
def test_rows_beyond_their_own_moves_speed_are_refused(
    written: Written, part: slice, limit: float
) -> None:
    drawn = draw_up(written(SLOW_FIRST), emulated_cell(), 1.0, "optimal")
    assert drawn.made is not None
    rows = drawn.made.rows
    steps = np.diff(rows.t)
    steps[part] *= 0.99
    hurried = replace(rows, t=np.append(0.0, np.cumsum(steps)))
    found = verify(drawn.blocks, hurried, drawn.setup, 1.0)
    told = [problem.limit for problem in found if " mm/s;" in problem.message]
    assert told == [pytest.approx(limit)]
    assert not verify(drawn.blocks, rows, drawn.setup, 1.0)


def test_what_only_the_stops_cannot_do_is_no_reason_to_refuse_the_optimal_timing(
    written: Written,
) -> None:
    turns = "    wrist: {heave_mm: 65, tilt_deg: 8, tilt_turns: 100}\n"
    slow = "    speed: {tcp_mm_s: 0.1}\n"
    for text, words in (
        ("  - ptp: P\n" + turns + "  - lin: Q\n" + turns, "more than 200 stops"),
        ("  - lin: {pose: [560, 0.5, 60, 180, 0, 180]}\n" + slow, "would have to creep at"),
    ):
        path = written(text)
        report = check(path, emulated_cell())
        assert not report.feasible
        assert words in report.problems[0].message
        fast = made(path)
        assert fast.driven_s is None
        assert fast.plan.knots == ()
        assert "its controller cannot drive it (line " in fast.plan.notes[-1]
        assert words in fast.plan.notes[-1]
        assert fast.plan.points[-1].sample <= len(fast.plan.t) - 1


def test_the_jerk_bound_costs_its_24_ms_from_each_rest_to_the_next_and_nothing_else(
    written: Written,
) -> None:
    corners = [[560.0 + 6.0 * (i % 2), 4.0 * i] for i in range(1, 9)]
    lines = "".join(f"  - lin: {{pose: [{x}, {y}, 60, 180, 0, 180]}}\n" for x, y in corners)
    lengths = np.linalg.norm(np.diff([[560.0, 0.0], *corners], axis=0), axis=1)
    peak = np.minimum(100.0, np.sqrt(500.0 * lengths))
    trapezoids_s = float((lengths / peak + peak / 500.0).sum())
    path = written(lines)
    assert made(path, 0.0).plan.duration_s == pytest.approx(trapezoids_s, rel=0.005)
    bounded = made(path)
    assert bounded.plan.duration_s == pytest.approx(trapezoids_s + 8 * 0.024, rel=0.005)
    # Each side is one block of the controller, which bounds no jerk: so much it takes less.
    assert bounded.driven_s == pytest.approx(trapezoids_s, rel=0.005)


@pytest.mark.parametrize("name", sorted(file.stem for file in SHIPPED.glob("*.yaml")))
def test_no_shipped_path_takes_longer_than_with_stops_but_for_the_jerk_bound(name: str) -> None:
    path, cell = load_path(SHIPPED / f"{name}.yaml"), emulated_cell()
    driven, fast = plan(path, cell), plan(path, cell, 1.0, "optimal")
    stretches = len(fast.points) + sum(move.draws for move in path.moves)
    assert fast.duration_s <= driven.duration_s + 0.024 * stretches
    if name != "octagon_joints":
        assert fast.duration_s < driven.duration_s
