"""Capsules: their distances against FCL, their places against the chain, what is left out."""

from __future__ import annotations

import time
from itertools import product

import fcl
import numpy as np
import pytest

from sphmctl.motion import Floats
from sphmctl.robots import kr6, rrs, sphm
from sphmctl.robots.capsules import between_segments, to_box, to_plane
from sphmctl.robots.geometry import abc_to_matrix, invert, pose_matrix
from sphmctl.robots.sphm import bodies

PEN = pose_matrix([0.0, 0.0, 0.0589], [0.0, 0.0, 0.0])
GROUP = {g: [k for k, other in enumerate(bodies.BODY_GROUPS) if other == g] for g in bodies.GROUPS}


def random_joints(seed: int, count: int) -> Floats:
    """Joints in range; half of them with cranks on edges, where the wrist is widest and lowest."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(sphm.RANGES9[:, 0], sphm.RANGES9[:, 1], (count, 9))
    q[: count // 2, 6:] = np.radians(rng.choice([0.0, 60.0, 90.0, 120.0], (count // 2, 3)))
    return q


def capsule(p: Floats, d: Floats, radius_m: float) -> fcl.CollisionObject:
    """FCL's capsule about a segment; it lies along z about its centre."""
    length_m = float(np.linalg.norm(d))
    z = d / length_m if length_m else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.8 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    return fcl.CollisionObject(fcl.Capsule(radius_m, length_m), fcl.Transform(R, p + d / 2.0))


def fcl_distance(one: fcl.CollisionObject, other: fcl.CollisionObject) -> float:
    """FCL's distance; 0 or less where they overlap."""
    return float(fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()))


def gaps(p: Floats, d: Floats, ours: str, other: str) -> Floats:
    """Every gap between two groups, (k, n), one pair of bodies after the other."""
    return np.stack(
        [
            between_segments(p[:, i], d[:, i], p[:, j], d[:, j])
            - (bodies.RADII_M[i] + bodies.RADII_M[j])
            for i, j in product(GROUP[ours], GROUP[other])
        ]
    )


def test_distances_of_segments_are_those_of_fcl() -> None:
    rng = np.random.default_rng(1)
    p, d, q, e = rng.uniform(-1.0, 1.0, (4, 3, 2000))
    e[:, :300] = d[:, :300] * rng.uniform(-2.0, 2.0, 300)  # parallel
    e[:, 300:400] = 0.0  # points
    d[:, 350:500] = 0.0
    ours = between_segments(p, d, q, e)
    for k in range(2000):
        theirs = fcl_distance(capsule(p[:, k], d[:, k], 1e-3), capsule(q[:, k], e[:, k], 1e-3))
        if theirs > 0.0:
            assert ours[k] - 2e-3 == pytest.approx(theirs, abs=1e-8)
        else:
            assert ours[k] < 2e-3 + 1e-8


def test_distances_from_a_box_are_those_of_fcl() -> None:
    rng = np.random.default_rng(2)
    p, d = rng.uniform(-1.0, 1.0, (2, 3, 1500))
    d[:, :100] = 0.0
    d[1:, 100:200] = 0.0  # along the box's x once it is not turned
    for pose in (np.eye(4), pose_matrix([0.2, -0.1, 0.3], [0.5, 1.0, -2.0])):
        half = np.array([0.4, 0.2, 0.1])
        ours = to_box(p, d, pose, half)
        box = fcl.CollisionObject(fcl.Box(*(2.0 * half)), fcl.Transform(pose[:3, :3], pose[:3, 3]))
        theirs = np.array([fcl_distance(capsule(p[:, k], d[:, k], 1e-3), box) for k in range(1500)])
        outside = theirs > 0.0
        assert_as_fcl(ours[outside] - 1e-3, theirs[outside])
        assert ours[~outside].max() < 1e-3 + 2e-6
        assert 50 < (~outside).sum() < 1000


def assert_as_fcl(ours: Floats, theirs: Floats) -> None:
    """FCL's search for a box's nearest point ends early now and then, never below the distance."""
    assert (ours <= theirs + 2e-6).all()
    assert (theirs - ours).max() < 1e-3
    assert (theirs - ours < 2e-6).mean() > 0.9


def test_distances_from_a_box_are_the_least_of_many_points() -> None:
    rng = np.random.default_rng(12)
    p, d = rng.uniform(-1.0, 1.0, (2, 3, 300))
    half = np.array([0.4, 0.2, 0.1])
    shares = np.linspace(0.0, 1.0, 4001)
    points = p[:, :, None] + d[:, :, None] * shares
    outside = np.maximum(np.abs(points) - half[:, None, None], 0.0)
    sampled = np.linalg.norm(outside, axis=0).min(axis=1)
    ours = to_box(p, d, np.eye(4), half)
    assert (ours <= sampled + 1e-15).all()
    # Between two samples the distance falls by less than half the way from one to the other.
    assert (sampled - ours <= np.linalg.norm(d, axis=0) / 8000.0).all()
    assert np.median(sampled - ours) < 1e-7


def test_a_segment_on_the_far_side_of_a_plane_has_a_negative_distance() -> None:
    p, d = np.array([[0.0], [0.0], [1.0]]), np.array([[5.0], [0.0], [-3.0]])
    up = np.array([0.0, 0.0, 1.0])
    assert to_plane(p, d, np.array([9.0, 9.0, 0.5]), up) == pytest.approx([-2.5])
    assert to_plane(p, -d, np.array([9.0, 9.0, 0.5]), up) == pytest.approx([0.5])


def chain(q: Floats) -> list[Floats]:
    """The URDF's frames of the links 0 to 4 and the flange, one joint after the other."""

    def joint(x: float, z: float, abc: tuple[float, float, float]) -> Floats:
        return pose_matrix([x, 0.0, z], abc)

    steps = [
        joint(0.0, 0.0, (-q[0], 0.0, 0.0)),
        joint(0.025, 0.400, (0.0, q[1], 0.0)),
        joint(0.455, 0.0, (0.0, q[2], 0.0)),
        joint(0.0, 0.035, (0.0, 0.0, -q[3])),
        joint(0.420, 0.0, (0.0, q[4], 0.0)) @ joint(0.080, 0.0, (0.0, 0.0, -q[5])),
    ]
    frames = [np.eye(4)]
    for step in steps:
        frames.append(frames[-1] @ step)
    return frames


def test_the_arms_bodies_stand_where_the_urdf_has_its_links() -> None:
    for q in random_joints(3, 50):
        frames = chain(q)
        p, d = bodies.segments(q)
        flange = kr6.forward(q[:6])
        np.testing.assert_allclose(frames[5][:3, 3], flange[:3, 3], atol=1e-12)
        for k, body in enumerate(bodies.ARM_BODIES):
            begin = (frames[body.link] @ [*body.begin_m, 1.0])[:3]
            end = (frames[body.link] @ [*body.end_m, 1.0])[:3]
            if k == bodies.HAND:
                end = begin + bodies.HAND_LENGTH_M * flange[:3, 2]
            np.testing.assert_allclose(p[:, k, 0], begin, atol=1e-12)
            np.testing.assert_allclose((p + d)[:, k, 0], end, atol=1e-12)


@pytest.mark.parametrize("yaw_deg", [0.0, 35.0])
def test_the_wrists_links_have_their_lengths_and_end_on_the_platform(yaw_deg: float) -> None:
    q, yaw = random_joints(4, 200), float(np.radians(yaw_deg))
    p, d = bodies.segments(q, PEN, yaw)
    end = p + d
    legs = GROUP["legs"]
    length = np.linalg.norm(d[:, legs], axis=0)
    np.testing.assert_allclose(length[:3], rrs.CRANK_M, atol=1e-12)
    np.testing.assert_allclose(length[3:], rrs.COUPLER_M, atol=1e-12)
    platform = sphm.forward(q, None, yaw)
    ball = platform[:, :3, 3:] + 0.056 * platform[:, :3, :2] @ rrs.LEG_DIRECTIONS
    np.testing.assert_allclose(end[:, legs[3:]].transpose(2, 0, 1), ball, atol=1e-12)
    tip = sphm.forward(q, PEN, yaw)[:, :3, 3] - bodies.TOOL_TIP_M * platform[:, :3, 2]
    np.testing.assert_allclose(end[:, -1].T, tip, atol=1e-12)


@pytest.mark.parametrize("tool_mm", [(0, 0, 58.9), (0, 0, 0), (90, 0, 40), (0, 100, -300)])
def test_hulls_leave_out_nothing_that_is_near(tool_mm: tuple[float, float, float]) -> None:
    q, tool = random_joints(5, 20_000), pose_matrix(np.array(tool_mm) / 1e3, [0.0, 0.0, 0.0])
    # Half of them folded back, where the wrist passes the forearm.
    q[::2, 4] = np.sign(q[::2, 4]) * np.radians(np.linspace(80.0, 120.0, 10_000))
    p, d = bodies.segments(q, tool)
    found = bodies.clearances(q, tool)
    for column, pair in enumerate(bodies.PAIRS):
        exact = gaps(p, d, *pair).min(axis=0)
        np.testing.assert_allclose(found[:, column], np.minimum(exact, bodies.FAR_M), atol=1e-12)


def test_clearances_are_those_of_fcl_between_all_bodies() -> None:
    q = random_joints(6, 60)
    q[::2, 4] = np.radians(110.0)
    found = bodies.clearances(q, PEN)
    p, d = bodies.segments(q, PEN)
    near = 0
    for row in range(len(q)):
        objects = [
            capsule(p[:, k, row], d[:, k, row], float(radius))
            for k, radius in enumerate(bodies.RADII_M)
        ]
        for column, (ours, other) in enumerate(bodies.PAIRS):
            pairs = product(GROUP[ours], GROUP[other])
            theirs = min(fcl_distance(objects[i], objects[j]) for i, j in pairs)
            if 0.0 < theirs < bodies.FAR_M:
                near += 1
                assert found[row, column] == pytest.approx(theirs, abs=1e-8)
            else:
                assert (found[row, column] <= 1e-8) == (theirs <= 0.0)
    assert near > 10


@pytest.mark.parametrize(
    ("ours", "others"),
    [
        ("elbow", ("turret", "servos", "legs", "platform")),
        ("hand", ("legs", "platform", "tool", "link arm", "elbow")),
        ("platform", ("servos",)),
        ("tool", ("servos", "legs")),
    ],
)
def test_pairs_that_are_not_compared_never_touch(ours: str, others: tuple[str, ...]) -> None:
    p, d = bodies.segments(random_joints(7, 20_000), PEN)
    for other in others:
        assert gaps(p, d, ours, other).min() > 0.0, (ours, other)


def test_the_legs_never_touch_each_other_or_the_platform_beside_their_own_joint() -> None:
    p, d = bodies.segments(random_joints(8, 20_000))
    cranks, couplers = GROUP["legs"][:3], GROUP["legs"][3:]
    for i, j in product(range(3), range(3)):
        pairs = [(cranks[i], k) for k in GROUP["platform"]]
        if i != j:
            pairs += [(cranks[i], cranks[j]), (cranks[i], couplers[j]), (couplers[i], couplers[j])]
            pairs += [(k[i], GROUP["servos"][j]) for k in (cranks, couplers)]
        for a, b in pairs:
            reach = bodies.RADII_M[a] + bodies.RADII_M[b]
            assert (between_segments(p[:, a], d[:, a], p[:, b], d[:, b]) - reach).min() > 0.0


def least(q_deg: list[float]) -> tuple[str, str, float]:
    """The nearest pair at one pose and its gap."""
    found = bodies.clearances(np.radians([q_deg]), PEN)[0]
    k = int(found.argmin())
    return (*bodies.PAIRS[k], float(found[k]))


def test_a_hand_turned_back_meets_the_forearm_and_a_straight_one_does_not() -> None:
    folded = least([0, -90, 90, 0, 119, 0, 90, 90, 90])
    assert folded[0] in ("legs", "servos")
    assert folded[1] == "forearm"
    assert folded[2] < -0.01
    assert least([0, -90, 90, 0, 30, 0, 90, 90, 90])[2] == bodies.FAR_M


def test_an_arm_that_bows_to_its_foot_meets_it() -> None:
    assert least([0, 40, 150, 0, 0, 0, 60, 60, 60])[2] < 0.0


def test_obstacles_are_seen_by_every_moving_body_and_not_by_the_base() -> None:
    q = random_joints(9, 40)
    pose = pose_matrix([0.5, 0.1, 0.2], [0.3, 0.2, 0.1])
    box = bodies.Box("post", pose, np.array([0.05, 0.05, 0.4]))
    floor = bodies.Plane("floor", np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    found = bodies.obstacle_clearances(q, (box, floor), PEN)
    pairs = bodies.obstacle_pairs((box, floor))
    assert found.shape == (40, len(pairs))
    assert not any("base" in pair for pair in pairs)
    p, d = bodies.segments(q, PEN)
    post = fcl.CollisionObject(fcl.Box(0.1, 0.1, 0.8), fcl.Transform(pose[:3, :3], pose[:3, 3]))
    for row, (column, (group, name)) in product(range(40), enumerate(pairs)):
        members = GROUP[group]
        if name == "floor":
            ends = np.minimum(p[2, members, row], (p + d)[2, members, row])
            expected = float((ends - bodies.RADII_M[members]).min())
            assert found[row, column] == pytest.approx(expected, abs=1e-12)
            continue
        theirs = min(
            fcl_distance(capsule(p[:, k, row], d[:, k, row], float(bodies.RADII_M[k])), post)
            for k in members
        )
        if theirs > 0.0:
            assert found[row, column] == pytest.approx(theirs, abs=1e-3)
        else:
            assert found[row, column] < 2e-6


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 45.0])
def test_a_pen_may_stand_on_what_it_draws_on(tilt_deg: float) -> None:
    target = np.eye(4)
    target[:3, :3] = abc_to_matrix(np.radians([0.0, tilt_deg, 180.0]))
    target[:3, 3] = [0.5, 0.0, 0.1]
    q = sphm.inverse(target, PEN, np.radians([60.0, 60.0, 60.0])).joints[0]
    table = bodies.Plane("table", np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 1.0]))
    tool = bodies.obstacle_pairs((table,)).index(("tool", "table"))
    gap = bodies.obstacle_clearances(q, (table,), PEN)[0, tool]
    assert 0.0 <= gap < 0.006
    target[2, 3] -= 0.012  # pressed through it
    q = sphm.inverse(target, PEN, np.radians([60.0, 60.0, 60.0])).joints[0]
    assert bodies.obstacle_clearances(q, (table,), PEN)[0, tool] < 0.0


def test_no_poses_have_no_gaps_to_obstacles_and_as_many_columns() -> None:
    table = bodies.Plane("table", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    for obstacles in ((table,), (table, table), ()):
        pairs = bodies.obstacle_pairs(obstacles)
        assert bodies.obstacle_clearances(np.zeros((0, 9)), obstacles).shape == (0, len(pairs))


def test_obstacles_turn_with_their_pose() -> None:
    q = random_joints(10, 20)
    pose = pose_matrix([0.4, 0.3, 0.5], [0.4, -0.7, 1.1])
    p, d = bodies.segments(q)
    back = invert(pose)
    moved = np.einsum("ij,j...->i...", back[:3, :3], p) + back[:3, 3][:, None, None]
    turned = np.einsum("ij,j...->i...", back[:3, :3], d)
    half = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(
        to_box(p, d, pose, half), to_box(moved, turned, np.eye(4), half), atol=1e-12
    )


def test_the_collision_filter_costs_a_few_times_what_forward_kinematics_does() -> None:
    q = random_joints(11, 60_000)
    bodies.clearances(q[:9000], PEN)

    def cpu_s(work: object) -> float:
        assert callable(work)
        begin = time.process_time()
        work(q, PEN)
        return time.process_time() - begin

    ratios = [cpu_s(bodies.clearances) / cpu_s(sphm.forward) for _ in range(3)]
    assert min(ratios) < 6.0  # 3 were measured: 1.6 s for 200,000 samples
