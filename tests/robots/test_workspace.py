"""The workspace against the paper's Tables 3 and 4, the closed-form inverse, and itself."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from sphmctl.errors import InfeasibleError
from sphmctl.motion import Floats
from sphmctl.robots import kr6, sphm
from sphmctl.robots.geometry import from_parts, pose_matrix
from sphmctl.robots.sphm import workspace_extents as extents
from sphmctl.robots.sphm.bodies import Plane as Ceiling
from sphmctl.robots.sphm.bodies import clearances, obstacle_clearances
from sphmctl.robots.sphm.workspace import Plane, Region, Robot, Survey, survey
from sphmctl.robots.sphm.workspace_sampling import in_space, sample
from sphmctl.robots.sphm.workspace_slices import (
    Slice,
    arm_alone,
    cells,
    grid_for,
    hand_of,
    marked,
    slice_of,
)

TABLES_3_4 = Path(__file__).parent.parent / "vectors" / "workspace_tables3_4.csv"
ROW: dict[Plane, str] = {
    "a1_0": "arm_plane_axis1_at_0",
    "a1_90": "arm_plane_axis1_at_plus_minus_90",
}
PLANES: tuple[Plane, ...] = ("a1_0", "a1_90")
FACE = Robot(tool=pose_matrix([0.0, 0.0, 0.0075], [0.0, 0.0, 0.0]))
SAMPLES = 20_000


def printed(plane: Plane, robot: str) -> tuple[list[float], float]:
    """Extents, mm, and area, % of the arm's, as the paper prints them."""
    with TABLES_3_4.open() as file:
        row = next(
            row
            for row in csv.DictReader(file)
            if (row["slice"], row["robot"]) == (ROW[plane], robot)
        )
    ends = ("horizontal_min_mm", "horizontal_max_mm", "z_min_mm", "z_max_mm")
    return [float(row[end]) for end in ends], float(row["area_percent_of_kuka"])


def narrowed(joint: int, low_deg: float, high_deg: float) -> Floats:
    ranges = sphm.RANGES9.copy()
    ranges[joint] = np.radians([low_deg, high_deg])
    return ranges


@pytest.fixture(scope="module")
def surveys() -> dict[Plane, Survey]:
    return {plane: survey(FACE, plane, SAMPLES, seed=1) for plane in PLANES}


@pytest.mark.parametrize("plane", PLANES)
def test_the_extents_of_tables_3_and_4_are_met_within_4_mm(
    surveys: dict[Plane, Survey], plane: Plane
) -> None:
    for name, ours in (("kuka", surveys[plane].arm), ("hybrid", surveys[plane].hybrid)):
        found_mm = 1e3 * np.array([*ours.horizontal_m, *ours.z_m])
        np.testing.assert_allclose(found_mm, printed(plane, name)[0], rtol=0, atol=4.0)


@pytest.mark.parametrize("plane", PLANES)
def test_the_area_ratios_of_the_paper_are_met_within_1_and_a_half_points(
    surveys: dict[Plane, Survey], plane: Plane
) -> None:
    found = surveys[plane]
    ratio = 100.0 * found.hybrid.area_m2 / found.arm.area_m2
    assert abs(ratio - printed(plane, "hybrid")[1]) < 1.5


@pytest.mark.parametrize("plane", PLANES)
def test_samples_never_pass_the_extents_that_optimisation_found(
    surveys: dict[Plane, Survey], plane: Plane
) -> None:
    found = surveys[plane]

    def inside(sampled: Region, true: Region) -> bool:
        pairs = ((sampled.horizontal_m, true.horizontal_m), (sampled.z_m, true.z_m))
        return all(t[0] - 1e-9 <= s[0] and s[1] <= t[1] + 1e-9 for s, t in pairs)

    assert inside(found.sampled_arm, found.arm)
    assert inside(found.sampled_hybrid, found.hybrid)
    assert found.free_hybrid.area_m2 < found.sampled_hybrid.area_m2


def test_the_joints_of_an_extent_are_in_range_free_and_get_there() -> None:
    found = extents.of_hybrid(FACE, "a1_0")
    ends = [*found.horizontal_m, *found.z_m]
    reached = sphm.forward(found.joints, FACE.tool)[:, :3, 3]
    np.testing.assert_allclose(reached[[0, 1, 2, 3], [0, 0, 2, 2]], ends, atol=1e-12)
    assert (sphm.margin_of(found.joints) >= 0.0).all()
    assert (clearances(found.joints, FACE.tool) >= 0.0).all()
    # Arm stretched from axis 2 at 25 mm, the platform furthest out: added up by hand.
    straight_m = 0.455 + np.hypot(0.420, 0.035) + 0.099 + 0.086 + 0.0075
    np.testing.assert_allclose(ends[:2], [0.025 - straight_m, 0.025 + straight_m], atol=1e-8)
    np.testing.assert_allclose(ends[3], 0.400 + straight_m, atol=1e-8)


def test_extents_keep_to_the_plane_where_a4_has_no_0_and_a1_no_0() -> None:
    ranges = narrowed(3, 100.0, 185.0)
    ranges[0] = np.radians([10.0, 170.0])
    found = extents.of_hybrid(Robot(ranges, FACE.tool), "a1_0")
    whole = extents.of_hybrid(FACE, "a1_0")
    np.testing.assert_allclose(found.horizontal_m, whole.horizontal_m, atol=1e-7)
    assert np.abs(sphm.forward(found.joints, FACE.tool)[:, 1, 3]).max() < 1e-9


def arm_reaches(robot: Robot, point: Floats) -> bool:
    """Whether the closed-form inverse brings the flange there with axis 1 at 0, whichever way."""
    heading = np.radians(np.arange(0.0, 360.0))
    c, s, zero, one = np.cos(heading), np.sin(heading), np.zeros(360), np.ones(360)
    columns = [np.stack(v, axis=1) for v in ((s, zero, -c), (zero, one, zero), (c, zero, s))]
    flange = from_parts(np.stack(columns, axis=2), np.array([point[0], 0.0, point[1]]))
    q = kr6.inverse_in_range(flange, robot.ranges[:6])
    return bool((np.abs(q[..., 0]) < 1e-9).any())


def away_from_the_edge(cut: Slice, points: Floats, distance_m: float) -> Floats:
    around = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
    near = np.array([cut.contains(*(points + distance_m * np.array(step)).T) for step in around])
    return np.asarray(points[(near == near[0]).all(axis=0)])


@pytest.mark.parametrize(
    "robot",
    [FACE, Robot(ranges=narrowed(4, -30.0, 60.0)), Robot(ranges=narrowed(3, -90.0, 90.0))],
    ids=["whole", "A5 narrow", "A4 narrow"],
)
def test_the_cut_of_the_arm_is_where_its_closed_form_inverse_has_answers(robot: Robot) -> None:
    cut = slice_of(robot, arm_alone())
    points = np.random.default_rng(2).uniform([-1.05, -0.5], [1.05, 1.4], (150, 2))
    points = away_from_the_edge(cut, points, 0.006)
    assert len(points) > 120
    expected = [arm_reaches(robot, point) for point in points]
    assert cut.contains(*points.T).tolist() == expected
    assert 0.2 < np.mean(expected) < 0.9


def test_the_area_on_the_grid_is_the_integral_over_the_arcs() -> None:
    cut = slice_of(FACE, hand_of(FACE))
    turn = np.minimum(np.nan_to_num(cut.high_rad - cut.low_rad), 2.0 * np.pi)
    exact = float((turn * cut.distance_m).sum() * cut.distance_m[-1] / (len(turn) - 1))
    grid = grid_for(float(cut.distance_m[-1]))
    assert grid.area_m2(cells(cut, "a1_0", grid)) == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("elbow_held", [False, True])
def test_every_sample_is_in_the_plane_in_range_and_within_the_cut(
    plane: Plane, elbow_held: bool
) -> None:
    ranges = sphm.RANGES9.copy()
    if elbow_held:
        # At this A5 the hand stands so to the line from axis 2 that its length hardly counts, and
        # the platform's shift aside, up to 7 mm, decides where the cut ends.
        ranges[[2, 4]] = np.radians([[89.9, 90.1], [-64.0, 64.0]])
    robot = Robot(ranges, FACE.tool, mount_yaw=0.3)
    cloud = sample(robot, plane, SAMPLES, seed=3)
    place = sphm.forward(cloud.joints, robot.tool, robot.mount_yaw)[:, :3, 3]
    across, horizontal = (1, 0) if plane == "a1_0" else (0, 1)
    np.testing.assert_allclose(place[:, across], 0.0, atol=1e-12)
    np.testing.assert_allclose(place[:, [horizontal, 2]], cloud.point_m, atol=1e-12)
    assert (sphm.margin_of(cloud.joints, robot.ranges) >= -1e-12).all()
    grid = grid_for(1.1, 0.002)
    inside = cells(slice_of(robot, hand_of(robot)), plane, grid)
    wide = inside.copy()
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        wide |= np.roll(inside, step, axis)
    assert not (marked(cloud.point_m, robot.mirrored(plane), grid) & ~wide).any()
    assert cloud.free.tolist() == (clearances(cloud.joints, robot.tool, 0.3) >= 0).all(1).tolist()
    assert (cloud.arm_free | ~cloud.free).all()
    assert elbow_held or cloud.arm_free.sum() > cloud.free.sum()


def test_the_flange_of_a_sample_is_the_arms_with_a4_at_a_half_turn_or_none() -> None:
    cloud = sample(FACE, "a1_0", SAMPLES, seed=4)
    arm = cloud.joints[:, :6].copy()
    arm[:, 3] = np.pi * np.round(arm[:, 3] / np.pi)
    place = kr6.forward(arm)[:, :3, 3]
    np.testing.assert_allclose(place[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(place[:, [0, 2]], cloud.flange_m, atol=1e-12)


def test_a_seed_gives_the_same_samples_on_any_number_of_threads() -> None:
    one, four = (sample(FACE, "a1_90", SAMPLES, seed=5, threads=n) for n in (1, 4))
    assert one.joints.tobytes() == four.joints.tobytes()
    assert one.free.tobytes() == four.free.tobytes()
    assert len(np.unique(one.joints[:, 1])) == SAMPLES  # no block repeats another
    other = sample(FACE, "a1_90", SAMPLES, seed=6, threads=4)
    assert not np.array_equal(one.joints[:100], other.joints[:100])


def test_a_ceiling_holds_extents_and_free_samples_below_it() -> None:
    ceiling = Ceiling("ceiling", np.array([0.0, 0.0, 1.2]), np.array([0.0, 0.0, -1.0]))
    robot = Robot(tool=FACE.tool, obstacles=(ceiling,))
    found = extents.of_hybrid(robot, "a1_0")
    assert 1.15 < found.z_m[1] < 1.2
    cloud = sample(robot, "a1_0", SAMPLES, seed=1)
    assert cloud.point_m[cloud.free, 1].max() < 1.2 < cloud.point_m[:, 1].max()
    assert cloud.flange_m[cloud.arm_free, 1].max() < 1.2


def wall(axis: int) -> Ceiling:
    """One 500 mm from the base, across x (0) or y (1)."""
    return Ceiling("wall", 0.5 * np.eye(3)[axis], -np.eye(3)[axis])


def test_a_wall_on_one_side_leaves_the_other_side_as_it_was(surveys: dict[Plane, Survey]) -> None:
    robot = Robot(tool=FACE.tool, obstacles=(wall(1),))
    found, whole = survey(robot, "a1_90", SAMPLES, seed=1), surveys["a1_90"]
    for ours, all_, arm in (
        (found.hybrid, whole.hybrid, False),
        (found.arm, whole.arm, True),
    ):
        # Axis 2 is 25 mm before axis 1, so that the arm reaches further to its front.
        np.testing.assert_allclose(ours.horizontal_m[0], all_.horizontal_m[0], atol=1e-7)
        assert ours.horizontal_m[0] < -(0.050 + (0.931 if arm else 1.043))
        np.testing.assert_allclose(ours.z_m, all_.z_m, atol=1e-7)
        # The platform is 10 mm thick each way about its middle, 7.5 mm behind the tool's point.
        assert 0.495 < ours.horizontal_m[1] < (0.5 if arm else 0.4976)
    reached = sphm.forward(extents.of_hybrid(robot, "a1_90").joints, robot.tool, robot.mount_yaw)[
        :, :3, 3
    ]
    np.testing.assert_allclose(reached[:2, 1], found.hybrid.horizontal_m, atol=1e-12)
    for points, region in (
        (found.cloud.flange_m[found.cloud.arm_free], found.free_arm),
        (found.cloud.point_m[found.cloud.free], found.free_hybrid),
    ):
        assert region.horizontal_m[0] < -0.9
        assert region.horizontal_m[1] == points[:, 0].max() < 0.5
        grid = found.grid(0.020)
        seen = marked(points, found.mirrored, grid).any(axis=1)
        assert grid.horizontal_m[seen].max() < 0.5 + grid.cell_m


def test_a_wall_along_the_plane_takes_nothing_from_its_extents(
    surveys: dict[Plane, Survey],
) -> None:
    found = survey(Robot(tool=FACE.tool, obstacles=(wall(0),)), "a1_90", 300, seed=1)
    for ours, whole in ((found.hybrid, surveys["a1_90"].hybrid), (found.arm, surveys["a1_90"].arm)):
        np.testing.assert_allclose(ours.horizontal_m, whole.horizontal_m, atol=1e-7)
        np.testing.assert_allclose(ours.z_m, whole.z_m, atol=1e-7)


@pytest.mark.parametrize("plane", PLANES)
def test_samples_in_space_are_where_their_own_axis_1_puts_them_and_free_there(
    plane: Plane,
) -> None:
    robot = Robot(tool=FACE.tool, mount_yaw=0.3, obstacles=(wall(1),))
    cloud = sample(robot, plane, 4000, seed=7)
    joints = cloud.joints[:3000].copy()
    joints[:, 0] = cloud.axis_1[:3000]
    gaps = (
        clearances(joints, robot.tool, 0.3),
        obstacle_clearances(joints, robot.obstacles, robot.tool, 0.3),
    )
    free = (np.hstack(gaps) >= 0.0).all(axis=1)
    flange, point = in_space(robot, cloud, 3000)
    expected = sphm.forward(joints[free], robot.tool, 0.3)[:, :3, 3]
    np.testing.assert_allclose(point, expected, atol=1e-12)
    assert point[:, 1].max() < 0.5
    assert len(flange) > len(point) > 1000


@pytest.mark.parametrize("limit_deg", [-120.0, 120.0])
def test_the_outline_holds_what_the_hand_reaches_at_the_ends_of_its_range(
    limit_deg: float,
) -> None:
    cut = slice_of(FACE, arm_alone())
    q = np.zeros((4000, 6))
    q[:, 2] = np.linspace(kr6.RANGES[2, 0], kr6.RANGES[2, 1], 4000)
    q[:, 4] = np.radians(limit_deg)
    around = 0.0005 * np.exp(2j * np.pi * np.arange(8) / 8)
    for end in kr6.RANGES[1]:
        q[:, 1] = end
        points = kr6.forward(q)[:, [0, 2], 3]
        near = [cut.contains(*(points + [step.real, step.imag]).T) for step in around]
        assert np.logical_or.reduce(near).all()


def test_ranges_that_leave_the_plane_out_are_told() -> None:
    with pytest.raises(InfeasibleError, match="needs A1 at 90 degrees, beyond its range of -100"):
        survey(Robot(ranges=narrowed(0, -100.0, 80.0)), "a1_90", 10, 1)
    with pytest.raises(InfeasibleError, match="A4 at 0 or 180 degrees, and its range is 20 to 60"):
        survey(Robot(ranges=narrowed(3, 20.0, 60.0)), "a1_0", 10, 1)
