"""Contours: what moves draw, where they run on, how corners are blended, where the arm stands."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from sphmctl.config import emulated_cell
from sphmctl.errors import InfeasibleError, InvalidError
from sphmctl.pathfile import load_path
from sphmctl.planner.contour import Contour
from sphmctl.planner.legs import Setup
from sphmctl.planner.outline import contours
from sphmctl.robots.geometry import angle_between, pose_matrix

PATHS = FilePath(__file__).parents[2] / "configs" / "paths"
HEAD = "version: 1\nname: t\nwrist: auto\n"
BEGIN = "moves:\n  - ptp: {pose: [500, 0, 100, 180, 0, 180]}\n"


def drawn(file: FilePath, cranks_deg: list[float] | None = None) -> tuple[Contour, ...]:
    """The contours of a path that begins at a pose."""
    path = load_path(file)
    setup = Setup.of(path, emulated_cell())
    first, *moves = path.moves
    assert first.point is not None
    assert first.point.pose is not None
    pose = first.point.pose
    begin = pose_matrix(np.array(pose[:3]) / 1000.0, np.radians(pose[3:]))
    cranks = None if cranks_deg is None else np.radians(cranks_deg)
    return contours(path.file, moves, begin, setup.tool_pose, cranks)


def of(tmp_path: FilePath, moves: str, head: str = HEAD, begin: str = BEGIN) -> tuple[Contour, ...]:
    file = tmp_path / "path.yaml"
    file.write_text(head + begin + moves)
    return drawn(file)


def refusal(tmp_path: FilePath, moves: str) -> str:
    with pytest.raises((InvalidError, InfeasibleError)) as caught:
        of(tmp_path, moves)
    return str(caught.value)


def assert_smooth(contour: Contour) -> None:
    """Unit speed, and tangent, tool and wrist without a jump, seen from both sides everywhere."""
    h = 1e-7
    s = contour.grid(0.001)[1:-1]
    before, here, behind = (contour.pose(s + shift) for shift in (-h, 0.0, h))
    rates = (here - before) / h, (behind - here) / h
    for rate in rates:
        assert np.abs(np.linalg.norm(rate[:, :3, 3], axis=1) - 1.0).max() < 1e-6
        np.testing.assert_allclose(rate[:, :3, 3], contour.tangent(s), atol=1e-3)
    # What bends and turning rates of 500 per metre add within 0.1 um.
    assert np.abs(rates[0] - rates[1]).max() < 2e-3 * (1.0 + 0.1 * np.abs(rates[0]).max())
    assert np.abs(contour.tangent(s + h) - contour.tangent(s - h)).max() < 2e-3
    if contour.wrist is not None:
        (a, slope), (b, slope_on) = contour.wrist.at(s - h), contour.wrist.at(s + h)
        assert np.abs(a - b).max() < 1e-3
        assert np.abs(slope - slope_on).max() < 1e-2 * (1.0 + np.abs(slope).max())


@pytest.mark.parametrize("name", sorted(file.name for file in PATHS.glob("*.yaml")))
def test_the_shipped_paths_draw_smooth_contours(name: str) -> None:
    path = load_path(PATHS / name)
    if not any(move.draws for move in path.moves):
        return
    found = drawn(PATHS / name, [60.0, 60.0, 60.0])
    assert sum(contour.length_m for contour in found) > 0.2
    for contour, following in pairwise(found):
        np.testing.assert_allclose(contour.end, following.pose(np.zeros(1))[0], atol=1e-6)
    for contour in found:
        assert_smooth(contour)
        t = contour.tangent(contour.grid(0.001))
        assert np.linalg.norm(np.diff(t, axis=0), axis=1).max() < 0.11


def test_the_octagon_stops_at_its_corners_and_keeps_its_cranks_linear() -> None:
    found = drawn(PATHS / "octagon.yaml", [120.0, 120.0, 120.0])
    assert len(found) == 8
    side = found[1]
    assert side.length_m == pytest.approx(0.125, abs=1e-4)
    share = np.linspace(0.0, 1.0, 11)
    goal = side.wrist_at(share * side.length_m)
    assert goal.policy == "cranks"
    assert goal.cranks_rad is not None
    expected = np.radians(90.0 - 30.0 * share)[:, None] * np.ones(3)
    np.testing.assert_allclose(goal.cranks_rad, expected, atol=1e-12)
    assert side.marks == (("C", side.length_m),)
    assert side.place(side.length_m / 2.0)[1] == pytest.approx(500.0 * side.length_m)


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        st.tuples(
            st.integers(-60, 60), st.integers(-90, 90), st.integers(-50, 50), st.integers(-20, 20)
        ),
        min_size=2,
        max_size=5,
        unique_by=lambda row: row[:3],
    ),
    st.floats(1.0, 40.0),
    st.sampled_from(["lin", "arc", "mixed"]),
)
def test_blended_corners_stay_within_the_blend(
    tmp_path: FilePath, rows: list[tuple[int, int, int, int]], blend_mm: float, kind: str
) -> None:
    text, ends = "", []
    for index, (x, y, z, b) in enumerate(rows):
        to = f"[{560 + x}, {y}, {100 + z}, 180, {b}, 180]"
        ends.append([560 + x, y, 100 + z])
        if kind == "arc" or (kind == "mixed" and index % 2):
            text += f"  - arc: {{via: [{540 + y / 3}, {y / 2 + 7}, {130 + x / 3}], to: {to}}}\n"
        else:
            text += f"  - lin: {{pose: {to}}}\n"
        if index < len(rows) - 1:
            text += f"    blend_mm: {blend_mm}\n"
    try:
        sharp = of(tmp_path, "".join(x + "\n" for x in text.splitlines() if "blend" not in x))
        found = of(tmp_path, text)
    except InvalidError:
        assume(False)
        return
    assert len(found) == 1
    contour = found[0]
    corners = [span for span in contour.spans if len(span.moves) == 2]
    assert len(corners) == len(rows) - 1
    for span, at in zip(corners, ends, strict=False):
        p = span.shape.pose(np.linspace(0.0, span.length_m, 200))[:, :3, 3]
        assert np.linalg.norm(p - np.array(at) / 1000.0, axis=1).max() <= blend_mm / 1000.0 + 2e-12
    halves = [sum(c.length_m for c in sharp) / 2.0]
    assert contour.length_m >= halves[0]
    sharpest = max(
        float(
            np.linalg.norm(span.shape.way.at(np.linspace(0, span.length_m, 300))[2], axis=1).max()
        )
        for span in contour.spans
    )
    assume(sharpest < 300.0)
    assert_smooth(contour)
    numbers = [contour.place(float(s))[0] for s in np.linspace(0.0, contour.length_m, 200)]
    assert numbers == sorted(numbers)
    assert (numbers[0], numbers[-1]) == (2, len(rows) + 1)


def test_a_corner_cuts_at_most_half_of_its_neighbours(tmp_path: FilePath) -> None:
    text = "  - lin: {pose: [500, 40, 100, 180, 0, 180]}\n    blend_mm: 500\n"
    text += "  - lin: {pose: [560, 40, 100, 180, 0, 180]}\n"
    (contour,) = of(tmp_path, text)
    assert contour.spans[0].length_m == pytest.approx(0.02)
    assert contour.spans[2].length_m == pytest.approx(0.04)
    straight = contour.pose(np.array([0.02, contour.length_m - 0.04]))[:, :3, 3]
    np.testing.assert_allclose(straight, [[0.5, 0.02, 0.1], [0.52, 0.04, 0.1]], atol=1e-12)
    middle = (0.02 + contour.length_m - 0.04) / 2.0
    asked = [middle, middle - 1e-9, 0.01, contour.length_m - 0.01]
    places = [contour.place(at) for at in asked]
    assert [number for number, _ in places] == [3, 2, 2, 3]
    assert [mm for _, mm in places] == pytest.approx([0.0, 40.0, 10.0, 50.0], abs=1e-5)


def test_lines_in_line_run_on_and_others_stop(tmp_path: FilePath) -> None:
    straight = "  - lin: {pose: [500, 40, 100, 180, 0, 180]}\n"
    straight += "  - lin: {pose: [500, 90, 100, 180, 0, 180]}\n"
    (contour,) = of(tmp_path, straight)
    assert contour.length_m == pytest.approx(0.09)
    bent = straight + "  - lin: {pose: [500.1, 150, 100, 180, 0, 180]}\n"
    assert [round(c.length_m, 3) for c in of(tmp_path, bent)] == [0.09, 0.06]
    turning = straight.replace("90, 100, 180, 0", "90, 100, 180, 5")
    assert len(of(tmp_path, turning)) == 2


def test_each_orientation_rule_does_what_it_says(tmp_path: FilePath) -> None:
    arc = "  - arc: {via: [550, 50, 100], to: [600, 0, 100, 180, 10, 180]}\n"
    s = np.linspace(0.0, np.pi * 0.05, 50)
    (held,) = of(tmp_path, arc + "    orientation: fixed\n")
    begin = held.pose(s)[0, :3, :3]
    np.testing.assert_allclose(held.pose(s)[:, :3, :3], [begin] * 50, atol=1e-15)
    (turning,) = of(tmp_path, arc)
    angles = np.degrees(angle_between(begin, turning.pose(s)[:, :3, :3]))
    np.testing.assert_allclose(angles, np.linspace(0.0, 10.0, 50), atol=1e-9)
    (following,) = of(tmp_path, arc + "    orientation: tangent\n")
    R, t = following.pose(s)[:, :3, :3], following.tangent(s)
    along = np.einsum("nij,nj->ni", np.swapaxes(R, 1, 2), t)
    np.testing.assert_allclose(along, [along[0]] * 50, atol=1e-12)
    np.testing.assert_allclose(R[:, :, 2], [[0.0, 0.0, -1.0]] * 50, atol=1e-12)
    centre, n = np.array([0.54, 0.01, -0.2]), np.array([0.8, 0.6, 0.0])
    for rule in (
        "{normal_to: sphere, centre: [540, 10, -200]}",
        "{normal_to: cylinder, centre: [540, 10, -200], axis: [4, 3, 0]}",
    ):
        turn, on = of(tmp_path, f"{arc}    orientation: {rule}\n")
        assert turn.still
        out = on.pose(s)[:, :3, 3] - centre
        if "cylinder" in rule:
            out = out - (out @ n)[:, None] * n
        out /= np.linalg.norm(out, axis=1)[:, None]
        np.testing.assert_allclose(on.pose(s)[:, :3, 2], -out, atol=1e-12)
    _, plane = of(tmp_path, arc + "    orientation: {normal_to: plane, normal: [0, 1, 5]}\n")
    wanted = -np.array([0.0, 1.0, 5.0]) / np.sqrt(26.0)
    np.testing.assert_allclose(plane.pose(s)[:, :3, 2], [wanted] * 50, atol=1e-12)


def test_the_tool_turns_with_the_tangent_at_corners_too(tmp_path: FilePath) -> None:
    text = "  - lin: {pose: [560, 0, 100, 180, 0, 180]}\n    blend_mm: 20\n"
    text += "  - lin: {pose: [560, 60, 100, 180, 0, 180]}\n"
    head = HEAD + "orientation: tangent\n"
    (blended,) = of(tmp_path, text, head)
    stops = of(tmp_path, text.replace("    blend_mm: 20\n", ""), head)
    assert [contour.still for contour in stops] == [False, True, False]
    for end in (blended.end, stops[-1].end):
        R = blended.pose(np.zeros(1))[0, :3, :3]
        expected = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ R
        np.testing.assert_allclose(end[:3, :3], expected, atol=1e-12)
    assert stops[1].place(0.0) == (3, 0.0)


def test_a_spline_passes_its_poses(tmp_path: FilePath) -> None:
    text = "  - spline: {through: [[540, 40, 120, 180, 8, 175], [580, 0, 90], "
    text += "[560, -60, 100, 170, 0, 180]]}\n"
    (contour,) = of(tmp_path, text)
    reached = contour.pose(contour.joints_m)
    angles = np.radians(np.array([[180.0, 0, 180], [180, 8, 175], [180, 8, 175], [170, 0, 180]]))
    xyz = np.array([[500.0, 0, 100], [540, 40, 120], [580, 0, 90], [560, -60, 100]]) / 1000.0
    np.testing.assert_allclose(reached, pose_matrix(xyz, angles), atol=1e-12)
    assert_smooth(contour)


def test_wrist_parameters_run_along_the_move(tmp_path: FilePath) -> None:
    text = "  - lin: {pose: [560, 0, 100, 180, 0, 180]}\n"
    text += "    wrist: {heave_mm: [60, 70], tilt_deg: 6, tilt_turns: 2, tilt_towards_deg: 90}\n"
    text += "    blend_mm: 10\n"
    text += "  - lin: {pose: [560, 90, 100, 180, 0, 180]}\n"
    text += "    wrist: {heave_mm: 70, tilt_deg: [6, 0], tilt_towards_deg: 90}\n"
    (contour,) = of(tmp_path, text)
    goal = contour.wrist_at(np.array([0.0, 0.03, contour.length_m]))
    assert goal.policy == "motion"
    assert goal.heave_m == pytest.approx([0.06, 0.065, 0.07])
    assert goal.tilt_rad == pytest.approx(np.radians([6.0, 6.0, 0.0]))
    assert goal.direction_rad == pytest.approx(np.radians([90.0, 450.0, 810.0]))
    assert_smooth(contour)
    first, change, second = of(
        tmp_path,
        "  - lin: {pose: [560, 0, 100, 180, 0, 180]}\n    wrist: {policy: level, heave_mm: 60}\n"
        "  - lin: {pose: [560, 90, 100, 180, 0, 180]}\n    wrist: {policy: level, heave_mm: 80}\n",
    )
    assert (first.still, change.still, second.still) == (False, True, False)
    heave = change.wrist_at(np.array([0.0, change.length_m])).heave_m
    assert heave == pytest.approx([0.06, 0.08])
    (free,) = of(tmp_path, "  - lin: {pose: [560, 0, 100, 180, 0, 180]}\n    wrist: level\n")
    assert free.wrist_at(np.zeros(3)).heave_m is None


def test_unknown_cranks_are_filled_in_later(tmp_path: FilePath) -> None:
    text = "  - lin: {pose: [560, 0, 100, 180, 0, 180], cranks_deg: [30, 60, 90]}\n"
    text += "    wrist: cranks\n    blend_mm: 10\n"
    text += "  - circle: {via: [[500, 40, 100], [530, -40, 100]]}\n    wrist: cranks\n"
    (contour,) = of(tmp_path, text)
    s = np.array([0.0, 0.025, contour.length_m])
    goal = contour.wrist_at(s, np.radians([90.0, 60.0, 30.0])).cranks_rad
    assert goal is not None
    expected = np.radians([[90, 60, 30], [65, 60, 55], [30, 60, 90]])
    np.testing.assert_allclose(goal, expected, atol=1e-12)
    fixed = text.replace(", cranks_deg: [30, 60, 90]", "").replace("wrist: cranks", "wrist: fixed")
    (contour,) = of(tmp_path, fixed)
    kept = contour.wrist_at(s, np.radians([90.0, 60.0, 30.0])).cranks_rad
    assert kept is not None
    np.testing.assert_allclose(np.degrees(kept), [[90, 60, 30]] * 3, atol=1e-12)
    unknown = contour.wrist_at(s).cranks_rad
    assert unknown is not None
    assert np.isnan(unknown).all()


def test_a_polyline_stops_at_sharp_points_and_runs_through_a_curve(tmp_path: FilePath) -> None:
    turned = np.linspace(0.05, 2.0, 40)
    arc = np.stack([500 + 50 * np.cos(turned), 50 + 50 * np.sin(turned), 0 * turned + 100], axis=1)
    rows = np.concatenate([[[500.0, 0, 100], [550, 0, 100], [550, 50, 100]], arc])
    text = "x_mm,y_mm,z_mm\n" + "".join(f"{x:.6f},{y:.6f},{z}\n" for x, y, z in rows)
    (tmp_path / "rows.csv").write_text(text)
    line, curve = of(tmp_path, "  - polyline: {csv: rows.csv}\n")
    assert line.length_m == pytest.approx(0.05)
    assert curve.length_m == pytest.approx(0.05 + 2 * 0.05, abs=1e-4)
    assert curve.place(0.01)[1] == pytest.approx(60.0)
    p = curve.pose(np.linspace(0.0, curve.length_m, 5000))[:, :3, 3]
    vertices = rows[2:] / 1000.0
    near = np.linalg.norm(p[:, None] - vertices, axis=2).min(axis=0)
    assert near.max() < 6e-5
    (blended,) = of(tmp_path, "  - polyline: {csv: rows.csv}\n    blend_mm: 5\n"
                    "  - lin: {pose: [500, 50, 150, 180, 0, 180]}\n")  # fmt: skip
    assert_smooth(blended)


def test_a_grid_has_every_joint_and_no_wide_step() -> None:
    (contour,) = drawn(PATHS / "blend.yaml")
    grid = contour.grid(0.003)
    assert np.all(np.diff(grid) > 0.0)
    assert np.diff(grid).max() <= 0.003 + 1e-12
    assert np.isin(contour.joints_m, grid).all()
    assert np.isin(contour.edges_m, contour.joints_m).all()
    assert (grid[0], grid[-1]) == (0.0, contour.length_m)
    turns = np.linalg.norm(np.diff(contour.tangent(contour.grid(1.0)), axis=0), axis=1)
    assert turns.max() < 0.2
    shuffled = np.random.default_rng(1).permutation(grid)
    np.testing.assert_array_equal(contour.pose(shuffled)[np.argsort(shuffled)], contour.pose(grid))


def test_a_corner_takes_the_slower_of_two_speeds(tmp_path: FilePath) -> None:
    text = "  - lin: {pose: [560, 0, 100, 180, 0, 180]}\n    speed: {tcp_mm_s: 50}\n"
    text += "    blend_mm: 10\n  - lin: {pose: [560, 90, 100, 180, 0, 180]}\n"
    (contour,) = of(tmp_path, text)
    middle = contour.edges_m[1] + contour.spans[1].length_m * 0.9
    speed, acceleration = contour.speeds(np.array([0.0, middle, contour.length_m]))
    np.testing.assert_allclose(speed, [0.05, 0.05, 0.1])
    np.testing.assert_allclose(acceleration, 0.5)


def test_turning_on_the_spot_is_a_contour_of_its_own(tmp_path: FilePath) -> None:
    (contour,) = of(tmp_path, "  - lin: {pose: [500, 0, 100, 180, 20, 180]}\n")
    assert contour.still
    assert len(contour.grid(0.002)) >= 5
    turned = angle_between(contour.pose(np.zeros(1))[0, :3, :3], contour.end[:3, :3])
    assert np.degrees(turned) == pytest.approx(20.0)


def lin(pose: str, *keys: str) -> str:
    """A line in the file, with keys beside it."""
    return "".join([f"  - lin: {{pose: [{pose}]}}\n", *(f"    {key}\n" for key in keys)])


THERE = "550, 0, 100, 180, 0, 180"
AWAY = "orientation: {normal_to: plane, normal: [0, 0, -1]}"
CENTRE = "orientation: {normal_to: sphere, centre: [550, 0, 100]}"


@pytest.mark.parametrize(
    ("moves", "words"),
    [
        (
            "  - arc: {via: [550, 0, 100], to: [600, 0, 100]}\n",
            "line 6, column 5: move 2 (arc): [500, 0, 100], [550, 0, 100] and [600, 0, 100] lie",
        ),
        ("  - arc: {via: [550, 0, 100], to: [500, 0, 100]}\n", "[500, 0, 100] is there twice"),
        ("  - circle: {centre: [500, 0, 0], normal: [0, 0, 3]}\n", "stands on the axis"),
        (lin("550, 0, 100, 0, 0, 180"), "half a turn"),
        (
            "  - spline: {through: [[550, 0, 100], [550, 0, 100]]}\n",
            "[550, 0, 100] is there twice in a row",
        ),
        (
            "  - spline: {through: [[550, 0, 100], [580, 50, 100], [500, 0, 100]], closed: true}\n",
            "goes back to the begin by itself",
        ),
        (
            "  - spline: {through: [[550, 0, 100], [500, 0, 100]]}\n",
            "turns back on the spot near x 550",
        ),
        (
            lin(THERE, "blend_mm: 5") + lin("500, 0, 100, 180, 0, 180"),
            "line 6, column 5: move 2 (lin): its corner with the next move cannot be blended: ",
        ),
        (
            lin(THERE, "blend_mm: 5") + lin("550, 50, 100, 180, 0, 180", "wrist: level"),
            "the wrist policy changes there from 'auto' to 'level'",
        ),
        (
            lin(THERE, "blend_mm: 5") + lin("550, 0, 100, 180, 9, 180"),
            "the tool stands in one of them",
        ),
        (lin("500, 0, 150, 180, 0, 180", "orientation: tangent"), "runs along the normal"),
        (lin(THERE, AWAY), "points away from the plane"),
        (lin(THERE, CENTRE), "meets the sphere's centre"),
    ],
)
def test_moves_that_cannot_be_drawn_are_told_of(tmp_path: FilePath, moves: str, words: str) -> None:
    assert words in refusal(tmp_path, moves)


def test_a_long_polyline_takes_little_time_and_linearly(tmp_path: FilePath) -> None:
    def cost_s(count: int) -> float:
        t = np.linspace(0.0, 20.0, count)
        rows = [500 + 50 * np.sin(t), 100 * np.sin(1.1 * t), 100 + 10 * t + np.cos(t) - 1]
        np.savetxt(tmp_path / "rows.csv", np.stack(rows, axis=1), "%.5f", ",",
                   header="x_mm,y_mm,z_mm", comments="")  # fmt: skip
        begin = time.process_time()
        (contour,) = of(tmp_path, "  - polyline: {csv: rows.csv}\n")
        contour.pose(np.linspace(0.0, contour.length_m, 3 * count))
        return time.process_time() - begin

    cost_s(1000)
    small = min(cost_s(5_000) for _ in range(2))
    assert small < 1.0  # 0.15 s on a machine of its own
    assert cost_s(50_000) < 20.0 * small


def test_a_corner_begins_at_the_blend_and_takes_bend_and_turning_rate_over(
    tmp_path: FilePath,
) -> None:
    text = lin("560, 0, 100, 180, 0, 180", "blend_mm: 10")
    text += "  - arc: {via: [590, 30, 100], to: [560, 60, 100, 180, 10, 180]}\n"
    (contour,) = of(tmp_path, text)
    line, corner, arc = contour.spans
    assert line.length_m == pytest.approx(0.05)
    assert arc.length_m == pytest.approx(np.pi * 0.03 - 0.01)
    bend = corner.shape.way.at(np.array([0.0, corner.length_m]))[2]
    assert np.linalg.norm(bend, axis=1) == pytest.approx([0.0, 1.0 / 0.03], abs=1e-9)
    h = 1e-5
    s = np.array([contour.edges_m[2] - h, contour.edges_m[2], contour.edges_m[2] + h])
    turned = angle_between(*contour.pose(s)[[[0, 1], [1, 2]], :3, :3].swapaxes(0, 1))
    assert turned / h == pytest.approx(np.radians(10.0) / (np.pi * 0.03), rel=0.02)


def test_a_sampled_curve_is_rounded_within_50_um(tmp_path: FilePath) -> None:
    turned = np.radians(15.0) * np.arange(1, 13)
    rows = [500 + 80 * np.sin(turned), 80 - 80 * np.cos(turned), 100 + 0 * turned]
    text = "".join(f"{x:.6f},{y:.6f},{z}\n" for x, y, z in np.stack(rows, axis=1))
    (tmp_path / "rows.csv").write_text("x_mm,y_mm,z_mm\n" + text)
    (contour,) = of(tmp_path, "  - polyline: {csv: rows.csv}\n")
    p = contour.pose(np.linspace(0.0, contour.length_m, 20_000))[:, :3, 3]
    near = np.linalg.norm(p[:, None] - np.stack(rows, axis=1) / 1000.0, axis=2).min(axis=0)
    assert 4e-5 < near[:-1].max() < 5.1e-5
