"""What moves mean, and which paths are refused, with joint, value, limit and place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
import pytest
import yaml

from sphmctl.config import Cell, Limit, Limits, emulated_cell
from sphmctl.errors import InfeasibleError, InvalidError, Problem
from sphmctl.motion import Plan
from sphmctl.pathfile import load_path
from sphmctl.planner import approach, check, plan
from sphmctl.robots import sphm
from sphmctl.robots.geometry import matrix_to_abc
from tests.planner.oracle import ACCELERATIONS_RAD_S2, controller_block_s

Planner = Callable[..., Plan]
CRANKS = "cranks_deg: [60, 60, 60]"
HOME = [0.0, -90, 90, 0, 90, 0, 60, 60, 60]


@pytest.fixture
def planned(tmp_path: FilePath) -> Planner:
    def make(text: str, speed: float = 1.0, cell: Cell | None = None) -> Plan:
        file = tmp_path / "path.yaml"
        file.write_text("version: 1\nname: test\n" + text)
        return plan(load_path(file), cell or emulated_cell(), speed)

    return make


def problems(planned: Planner, text: str, cell: Cell | None = None) -> tuple[Problem, ...]:
    with pytest.raises(InfeasibleError) as caught:
        planned(text, cell=cell)
    assert caught.value.exit_code == 4
    assert "path.yaml, line" in str(caught.value)
    return caught.value.problems


def cell_with(**limits: Limit) -> Cell:
    return emulated_cell().model_copy(update={"limits": Limits(**limits)})


def line(*poses: str, head: str = "") -> str:
    first, *others = poses
    moves = [f"  - ptp: {{pose: {first}, {CRANKS}}}\n"]
    moves += [f"  - lin: {{pose: {pose}, {CRANKS}}}\n" for pose in others]
    return head + "moves:\n" + "".join(moves)


def test_a_line_out_of_reach_is_refused_where_it_leaves_the_reach(planned: Planner) -> None:
    found = problems(planned, line("[500, 0, 300, 180, 0, 180]", "[1000, 0, 300, 180, 0, 180]"))
    assert len(found) == 1
    # Wrist centre: 99 + 69.53 mm over O7 at z = 300; axis 2 at x 25, z 400; reach 876.456.
    height = 300 + 99 + 12.5 + np.sqrt(61**2 - 25**2 * 0.75) - 400
    edge = 25 + np.sqrt((455 + np.hypot(420, 35)) ** 2 - height**2) - 500
    assert found[0].where.startswith("line 5, move 2 (lin), ")
    place = float(found[0].where.split(", ")[2].split()[0])
    assert edge <= place <= edge + 0.8
    assert found[0].limit == pytest.approx(455 + np.hypot(420, 35))
    assert found[0].value == pytest.approx(876.456, abs=1)


def test_joints_beyond_their_range_are_all_named(planned: Planner) -> None:
    found = problems(
        planned,
        "points:\n  P: {joints_deg: [171, -90, 90, 0, 90, 0, 60, 60, 121]}\nmoves:\n"
        f"  - ptp: {{joints_deg: {HOME}}}\n  - ptp: P\n",
    )
    assert [(p.joint, p.value, p.limit) for p in found] == [("A1", 171, 170), ("theta9", 121, 120)]
    assert all(p.where == "line 7, move 2 (ptp to P)" for p in found)


def test_a_crank_that_leaves_its_range_on_a_line_is_placed(planned: Planner) -> None:
    text = line("[500, 0, 300, 180, 0, 180]", "[560, 0, 300, 180, 0, 180]")
    found = problems(planned, text[: text.rindex("[60")] + "[60, 60, 180]}\n")
    assert [(p.joint, p.limit) for p in found] == [("theta9", 120)]
    assert found[0].where == "line 5, move 2 (lin), 30.1 mm along"


def test_a_narrowed_range_of_the_cell_counts(planned: Planner) -> None:
    text = line("[500, -200, 300, 180, 0, 180]", "[500, 200, 300, 180, 0, 180]")
    planned(text)
    found = problems(planned, text, cell_with(a1=Limit(range_deg=(-10.0, 30.0))))
    assert [(p.joint, p.limit) for p in found] == [("A1", -10)]
    # tan(10 degrees) * 500 = 88.2 mm to the left of the middle of the line
    assert 288.1 < float(found[0].where.split(", ")[2].split()[0]) < 288.8


def test_a_line_through_axis_1_is_refused_for_a1(planned: Planner) -> None:
    found = problems(planned, line("[0, -400, 900, 180, 0, 0]", "[0, 400, 900, 180, 0, 0]"))
    assert ("A1", "line 5, move 2 (lin), 399.5 mm along") in [(p.joint, p.where) for p in found]


def test_a_line_beside_axis_1_is_planned_while_a1_can_turn_fast_enough(planned: Planner) -> None:
    text = line("[3, -400, 900, 180, 0, 0]", "[3, 400, 900, 180, 0, 0]")
    a1 = np.degrees(planned(text).joints[:, 0])
    # The flange's axis is the tool's: the wrist centre passes 3 mm before axis 1.
    assert a1[0] == pytest.approx(np.degrees(np.arctan2(400, 3)), abs=1e-6)
    assert np.ptp(a1) == pytest.approx(2 * a1[0], abs=1e-6)
    assert (np.diff(a1) <= 1e-9).all()
    slow = cell_with(a1=Limit(speed_deg_s=0.01))
    found = problems(planned, text, slow)
    assert found[0].joint == "A1"


def test_a_line_that_arrives_on_another_branch_is_refused(planned: Planner) -> None:
    # The same flange pose with A4, A5, A6 turned over.
    found = problems(
        planned,
        "moves:\n  - ptp: {joints_deg: [0, -80, 80, 0, 60, 0, 60, 60, 60]}\n"
        "  - lin: {joints_deg: [0, -90, 90, 180, -60, 180, 60, 60, 60]}\n",
    )
    assert found[0].joint in ("A4", "A5", "A6")
    assert "another branch" in found[0].message


def test_half_a_turn_of_the_tool_on_a_line_is_refused(planned: Planner) -> None:
    found = problems(planned, line("[500, 0, 300, 0, 0, 180]", "[510, 0, 300, 180, 0, 180]"))
    assert found[0].joint == "tool"
    assert "half a turn" in found[0].message


def test_joint_limits_slow_a_line_down_and_are_kept(planned: Planner) -> None:
    head = "speed: {tcp_mm_s: 1000, tcp_mm_s2: 10000}\n"
    text = line("[500, -200, 300, 180, 0, 180]", "[500, 200, 300, 180, 0, 180]", head=head)
    free = planned(text)
    slow = planned(text, cell=cell_with(a1=Limit(speed_deg_s=10.0, acceleration_deg_s2=50.0)))
    assert slow.duration_s > 2 * free.duration_s
    speed = np.diff(slow.joints, axis=0) / np.diff(slow.t)[:, None]
    gap = (np.diff(slow.t)[1:] + np.diff(slow.t)[:-1])[:, None] / 2
    acceleration = np.diff(speed, axis=0) / gap
    assert 9.5 < np.abs(np.degrees(speed[:, 0])).max() <= 10
    assert np.abs(np.degrees(acceleration[:, 0])).max() <= 50.01
    assert np.all(np.abs(np.diff(np.diff(free.joints, axis=0) / np.diff(free.t)[:, None], axis=0)
                         / ((np.diff(free.t)[1:] + np.diff(free.t)[:-1])[:, None] / 2))
                  <= ACCELERATIONS_RAD_S2 * 1.001)  # fmt: skip


def test_a_line_that_a_joint_could_only_creep_along_is_refused(planned: Planner) -> None:
    head = "speed: {tcp_mm_s: 1000}\n"
    text = line("[500, -200, 300, 180, 0, 180]", "[500, 200, 300, 180, 0, 180]", head=head)
    found = problems(planned, text, cell_with(a1=Limit(speed_deg_s=0.5)))
    assert found[0].joint == "A1"
    assert found[0].limit == pytest.approx(0.5)
    assert found[0].value is not None
    assert found[0].value > 60
    assert "move 2 (lin)" in found[0].where


def test_a_scaled_up_plan_must_keep_the_limits(planned: Planner) -> None:
    text = "speed: {joint_percent: 80, joint_acceleration_percent: 50}\n"
    text += f"moves:\n  - ptp: {{joints_deg: {HOME}}}\n"
    text += "  - ptp: {joints_deg: [150, -90, 90, 0, 90, 0, 60, 60, 60]}\n"
    planned(text, 1.2)
    with pytest.raises(InfeasibleError) as caught:
        planned(text, 1.5)
    assert caught.value.problems[0].joint == "A1"
    assert caught.value.problems[0].limit == pytest.approx(360)
    for speed in (0.0, -1.0, 1.51, float("nan")):
        with pytest.raises(InvalidError, match=r"out of range"):
            planned(text, speed)


def test_a_very_slow_run_ramps_no_slower_than_the_controller_can(planned: Planner) -> None:
    text = line("[500, 0, 300, 180, 0, 180]", "[600, 0, 300, 180, 0, 180]")
    slow = planned(text, 0.03)
    assert min(knot.acceleration for knot in slow.knots) == pytest.approx(1e-4)
    begin, begin_s = slow.joints[0, :6], 0.0
    for knot in slow.knots:
        took_s = controller_block_s(begin, knot.joints, knot.velocity, knot.acceleration)
        assert took_s == pytest.approx(slow.t[knot.sample] - begin_s, rel=1e-6)
        begin, begin_s = knot.joints, float(slow.t[knot.sample])
    with pytest.raises(InfeasibleError, match="would have to creep"):
        planned(text, 0.001)


def test_all_problems_are_told_and_at_most_twenty(planned: Planner) -> None:
    beyond = "  - ptp: {joints_deg: [180, 60, 90, 0, 90, 0, 60, 60, 60]}\n"
    found = problems(planned, f"moves:\n  - ptp: {{joints_deg: {HOME}}}\n" + beyond * 3)
    assert [p.joint for p in found] == ["A1", "A2"] * 3
    found = problems(planned, f"moves:\n  - ptp: {{joints_deg: {HOME}}}\n" + beyond * 30)
    assert len(found) == 20


def test_a_rest_stands_still_for_its_time(planned: Planner) -> None:
    joints = "{joints_deg: [10, -90, 90, 0, 90, 0, 60, 60, 60]}"
    head = f"points:\n  H: {{joints_deg: {HOME}}}\nmoves:\n  - ptp: H\n"
    moving = planned(head + f"  - ptp: {joints}\n")
    resting = planned(head + f"  - dwell_s: 0.5\n  - ptp: {joints}\n  - dwell_s: 0.25\n")
    assert resting.duration_s == pytest.approx(moving.duration_s + 0.75)
    assert np.all(resting.joints[resting.t <= 0.5] == resting.joints[0])
    assert len(resting.knots) == len(moving.knots) == 1
    end = resting.knots[0].sample
    assert resting.t[end] == pytest.approx(0.5 + moving.duration_s)
    assert np.all(resting.joints[end:] == resting.joints[-1])


def test_cranks_alone_move_without_a_knot(planned: Planner) -> None:
    text = f"moves:\n  - ptp: {{joints_deg: {HOME}}}\n"
    made = planned(text + "  - ptp: {joints_deg: [0, -90, 90, 0, 90, 0, 90, 60, 60]}\n")
    assert made.knots == ()
    assert made.duration_s > 0.3
    assert np.degrees(made.joints[-1, 6]) == pytest.approx(90)


def test_a_path_of_one_point_is_a_plan_of_one_sample(planned: Planner) -> None:
    made = planned(f"points:\n  H: {{joints_deg: {HOME}}}\nmoves:\n  - ptp: H\n")
    assert (len(made.t), made.duration_s, made.knots) == (1, 0.0, ())
    assert made.points[0].name == "H"


def test_fixed_cranks_stay_and_auto_cranks_are_chosen(planned: Planner) -> None:
    poses = "moves:\n  - ptp: {pose: [500, -50, 300, 180, 0, 180]}\n"
    poses += "  - lin: {pose: [500, 50, 300, 180, 0, 180]}\n"
    fixed = planned("wrist: {policy: fixed, cranks_deg: [10, 20, 30]}\n" + poses)
    np.testing.assert_allclose(np.degrees(fixed.joints[:, 6:]), [[10, 20, 30]] * len(fixed.t))
    auto = planned("wrist: auto\n" + poses)
    cranks = np.degrees(auto.joints[:, 6:])
    assert np.all((cranks > 1) & (cranks < 119))
    np.testing.assert_allclose(auto.tool[-1, :3, 3], [0.5, 0.05, 0.3], atol=1e-12)
    with pytest.raises(InvalidError, match=r"line 5: move 1 .* needs 'cranks_deg'"):
        planned("wrist: fixed\n" + poses)


def test_poses_are_in_the_paths_base_and_at_its_tool(planned: Planner) -> None:
    own = planned(line("[500, 0, 300, 180, 0, 180]", "[500, 60, 300, 180, 0, 180]"))
    base = "base: [100, 50, 20, 90, 0, 0]\ntool: octagon_pen\n"
    # In the turned base x runs along the world's y, and y along its -x; the pen is 58.9 mm long.
    there = planned(
        line("[-50, -400, 221.1, 90, 0, 180]", "[10, -400, 221.1, 90, 0, 180]", head=base)
    )
    np.testing.assert_allclose(there.joints[[0, -1]], own.joints[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(there.tool[0, :3, 3], [-0.05, -0.4, 0.2211], atol=1e-12)


def test_an_unknown_tool_or_base_is_told_with_its_line(planned: Planner) -> None:
    with pytest.raises(
        InvalidError, match=r"path.yaml, line 3: the cell 'emulated' has no tool .pen."
    ):
        planned("tool: pen\n" + line("[500, 0, 300, 180, 0, 180]"))
    with pytest.raises(InvalidError, match=r'path.yaml, line 3: .* no frame "wrld" .did you mean'):
        planned("base: wrld\n" + line("[500, 0, 300, 180, 0, 180]"))


def test_check_gives_the_problems_as_a_verdict(tmp_path: FilePath) -> None:
    file = tmp_path / "path.yaml"
    file.write_text("version: 1\nname: t\n" + line("[2000, 0, 300, 180, 0, 180]"))
    report = check(load_path(file), emulated_cell())
    assert (report.feasible, report.duration_s, report.margins) == (False, None, ())
    assert report.problems[0].where == "line 4, move 1 (ptp)"


def test_the_approach_is_one_slow_synchronous_block() -> None:
    start = np.radians([0.0, -90, 90, 0, 90, 0, -0.1, 60, 120.1])
    goal = np.radians([20.0, -60, 100, 10, 40, -30, 120, 90, 0])
    made = approach(start, goal, emulated_cell(), 0.1)
    np.testing.assert_array_equal(made.joints[0], start)
    np.testing.assert_allclose(made.joints[-1], goal, atol=1e-12)
    (knot,) = made.knots
    assert knot.sample == len(made.t) - 1
    took_s = controller_block_s(start[:6], knot.joints, knot.velocity, knot.acceleration)
    assert took_s == pytest.approx(made.duration_s)
    speed = np.abs(np.degrees(np.diff(made.joints, axis=0))) / np.diff(made.t)[:, None]
    assert np.all(speed <= np.array([36, 30, 36, 38.1, 38.8, 61.5, 36.6, 36.6, 36.6]) + 1e-6)
    share = (made.joints - start) / (goal - start)
    assert np.ptp(share, axis=1).max() < 1e-9


def test_the_approach_refuses_joints_far_out_of_range_and_may_have_nothing_to_do() -> None:
    start = np.radians(HOME)
    still = approach(start, start, emulated_cell(), 0.1)
    assert (still.duration_s, still.knots) == (0.0, ())
    wrong = start.copy()
    wrong[6] = np.radians(120.2)
    with pytest.raises(InfeasibleError, match=r"theta7 would have to stand at 120.2 degrees"):
        approach(wrong, start, emulated_cell(), 0.1)
    with pytest.raises(InfeasibleError, match=r"theta7"):
        approach(start, wrong, emulated_cell(), 0.1)


PASSED = "[0, -60, 100, 0, 50, 0, 60, 60, 60]"
PASSED_OVER = "[0, -60, 100, 180, -50, 180, 60, 60, 60]"
"""The same flange pose, A4 to A6 turned over."""


@pytest.fixture
def through(planned: Planner) -> Callable[..., Plan]:
    """A line of 100 mm along y, in whose middle the path gives nine joints."""
    middle = sphm.forward(np.radians([0.0, -60, 100, 0, 50, 0, 60, 60, 60]))
    abc = np.degrees(matrix_to_abc(middle[:3, :3]))
    ends = [
        [*(1000.0 * middle[:3, 3] + [0.0, y, 0.0]).tolist(), *abc.tolist()] for y in (50.0, -50.0)
    ]

    def make(kind: str, joints: str, wrist: str = "cranks", cranks: str = CRANKS) -> Plan:
        end = f"{{pose: {ends[1]}, {cranks}}}"
        moves = {
            "lin": f"  - lin: {{joints_deg: {joints}}}\n  - lin: {end}\n",
            "spline": f"  - spline: {{through: [{{joints_deg: {joints}}}, {end}]}}\n",
            "last": f"  - lin: {{joints_deg: {joints}}}\n",
        }
        head = f"wrist: {wrist}\nmoves:\n  - ptp: {{pose: {ends[0]}, {cranks}}}\n"
        return planned(head + moves[kind])

    return make


@pytest.mark.parametrize("joints", [PASSED, PASSED_OVER])
@pytest.mark.parametrize("kind", ["lin", "spline", "last"])
def test_nine_joints_that_a_path_gives_are_passed_on_the_way(
    through: Callable[..., Plan], kind: str, joints: str
) -> None:
    plan = through(kind, joints)
    off = np.abs(np.degrees(plan.joints) - yaml.safe_load(joints)).max(axis=1)
    # 4 ms at 100 mm/s is 0.4 mm, and the row nearest to the point half of that.
    assert off.min() < 0.05


@pytest.mark.parametrize("wrist", ["level", "tilt", "auto"])
def test_a_free_wrist_arrives_with_the_joints_that_a_path_gives(
    through: Callable[..., Plan], wrist: str
) -> None:
    end = np.degrees(through("last", PASSED, wrist).joints[-1])
    np.testing.assert_allclose(end, yaml.safe_load(PASSED), atol=1e-6)


def test_nine_joints_that_a_way_does_not_pass_are_refused(through: Callable[..., Plan]) -> None:
    with pytest.raises(InfeasibleError, match="theta7 at 70 degrees, not at the point's 60"):
        through("lin", PASSED, "{policy: fixed, cranks_deg: [70, 70, 70]}")


def test_a_circle_without_length_is_refused(planned: Planner) -> None:
    circle = "  - circle: {centre: [500, 50, 300], normal: [0, 0, 1], turn_deg: 0.001}\n"
    with pytest.raises(InvalidError, match=r"shorter than 0\.001 mm"):
        planned(line("[500, 0, 300, 180, 0, 180]") + circle)


def test_a_jump_of_the_cranks_out_of_the_first_rest_is_refused(planned: Planner) -> None:
    # From the straight legs (heave 86 mm) the cranks would begin with a speed, not from rest.
    found = problems(
        planned,
        "speed: {tcp_mm_s: 1000, tcp_mm_s2: 20000}\n"
        "wrist: {policy: level, heave_mm: [86, 60]}\nmoves:\n"
        "  - ptp: {pose: [500, -100, 300, 180, 0, 180]}\n"
        "  - lin: {pose: [500, 100, 300, 180, 0, 180]}\n",
    )
    assert {problem.joint for problem in found} == {"theta7", "theta8", "theta9"}
    assert all("acceleration" in problem.message for problem in found)
