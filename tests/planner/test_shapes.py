"""Shapes by arc length: on their formulas, as long as they are, driven at unit speed."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from sphmctl.errors import InvalidError
from sphmctl.motion import Floats
from sphmctl.planner import curve, shapes
from sphmctl.planner.shapes import Segment, Way
from sphmctl.planner.spline import Track, monotone_slopes, smooth_slopes
from sphmctl.planner.turning import about, shortest, to_quaternion, to_rotation

seeds = st.integers(0, 2**32 - 1)


def points(seed: int, count: int, size_m: float = 0.1) -> Floats:
    """Random points that are not too close to each other."""
    found = np.random.default_rng(seed).uniform(-size_m, size_m, (count, 3))
    apart = np.linalg.norm(found[:, None] - found[None], axis=2) + np.eye(count)
    assume(apart.min() > 0.05 * size_m)
    return found


def assert_unit_speed(way: Way, within: float = 1e-6) -> None:
    """Central differences of the point are unit vectors, and the tangent; those of it, the bend."""
    h = 1e-6
    s = np.linspace(h, way.length_m - h, 1001)
    joints = way.joints_m
    s = s[np.abs(s[:, None] - joints).min(axis=1) > 2.0 * h]
    (p, t, _), (q, u, _) = way.at(s - h), way.at(s + h)
    _, tangent, bend = way.at(s)
    speed = (q - p) / (2.0 * h)
    assert np.abs(np.linalg.norm(speed, axis=1) - 1.0).max() < within
    assert np.abs(speed - tangent).max() < within
    scale = 1.0 + np.linalg.norm(bend, axis=1).max()
    assert np.abs((u - t) / (2.0 * h) - bend).max() < 1e-4 * scale


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_an_arc_lies_on_the_circle_through_its_points(seed: int) -> None:
    a, b, c = points(seed, 3)
    try:
        way = shapes.arc(a, b, c)
    except InvalidError:
        assume(False)
        return
    p = way.at(np.linspace(0.0, way.length_m, 200))[0]
    distance = np.linalg.norm(p - way.centre, axis=1)
    assume(way.radius_m < 1.0)
    assert np.abs(distance - way.radius_m).max() < 1e-12
    assert np.abs((p - way.centre) @ way.normal).max() < 1e-12
    np.testing.assert_allclose(p[[0, -1]], [a, c], atol=1e-12)
    # The third point is passed on the way, and not on the rest of the circle.
    spoke = b - way.centre
    passed = np.arctan2(spoke @ way.y, spoke @ way.x) % (2.0 * np.pi)
    assert 0.0 < passed < way.angle_rad
    np.testing.assert_allclose(way.at(np.array([passed * way.radius_m]))[0][0], b, atol=1e-12)
    assert_unit_speed(way)


def test_an_arc_of_known_points_is_the_one_drawn_by_hand() -> None:
    a, b, c = np.array([[0.1, 0.0, 0.05], [0.0, 0.1, 0.05], [-0.1, 0.0, 0.05]])
    half = shapes.arc(a, b, c)
    assert half.length_m == pytest.approx(np.pi * 0.1, abs=1e-15)
    np.testing.assert_allclose(half.at(np.array([0.0]))[1][0], [0.0, 1.0, 0.0], atol=1e-15)
    long_way = shapes.arc(a, c, b)
    assert long_way.length_m == pytest.approx(1.5 * np.pi * 0.1, abs=1e-15)
    full = shapes.arc(a, b, c, full=True)
    np.testing.assert_allclose(full.at(np.array([full.length_m]))[0][0], a, atol=1e-15)
    assert full.length_m == pytest.approx(2.0 * np.pi * 0.1, abs=1e-15)


@settings(max_examples=25, deadline=None)
@given(seeds, st.floats(-2000.0, 2000.0), st.floats(0.0, 0.05))
def test_a_helix_lies_on_its_formula(seed: int, turn_deg: float, pitch_m: float) -> None:
    assume(abs(turn_deg) > 1.0)
    begin, centre, normal = points(seed, 3)
    n = normal / np.linalg.norm(normal)
    assume(np.linalg.norm(np.cross(begin - centre, n)) > 0.002)
    way = shapes.helix(begin, centre, normal, float(np.radians(turn_deg)), pitch_m)
    share = np.linspace(0.0, 1.0, 200)
    p = way.at(share * way.length_m)[0]
    # Turned and shifted by scipy's rotations, which are not ours.
    turned = Rotation.from_rotvec(np.radians(turn_deg) * share[:, None] * n)
    rise = pitch_m * abs(turn_deg) / 360.0 * share
    expected = centre + turned.apply(begin - centre) + rise[:, None] * n
    np.testing.assert_allclose(p, expected, atol=1e-12)
    around = np.linalg.norm(np.cross(begin - centre, n)) * np.radians(abs(turn_deg))
    assert way.length_m == pytest.approx(np.hypot(around, rise[-1]), rel=1e-12)
    assert_unit_speed(way)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(2, 12), st.booleans())
def test_a_spline_is_scipys_through_its_points_by_arc_length(
    seed: int, count: int, closed: bool
) -> None:
    given_points = points(seed, max(count, 3) if closed else count)
    if closed:
        given_points = np.concatenate([given_points, given_points[:1]])
    try:
        way = curve.spline(given_points, closed)
    except InvalidError:
        assume(False)
    x = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given_points, axis=0), axis=1))])
    oracle = CubicSpline(x, given_points, bc_type="periodic" if closed else "natural")
    np.testing.assert_allclose(smooth_slopes(x, given_points, closed), oracle(x, 1), atol=1e-11)
    joints = way.joints_m
    np.testing.assert_allclose(way.at(joints)[0], given_points, atol=1e-12)
    for i in range(len(x) - 1):
        length, _ = quad(
            lambda u: float(np.linalg.norm(oracle(u, 1))), x[i], x[i + 1], epsabs=1e-13, limit=200
        )
        assert joints[i + 1] - joints[i] == pytest.approx(length, abs=1e-10)
    # C2: tangent and bend agree on both sides of each point.
    h = 1e-9
    (_, t, k), (_, u, m) = way.at(joints[1:-1] - h), way.at(joints[1:-1] + h)
    bends = np.linalg.norm(way.at(np.linspace(0.0, way.length_m, 2000))[2], axis=1)
    assume(bends.max() < 500.0)  # a bend of less than 2 mm is none that differences could follow
    assert np.abs(t - u).max(initial=0.0) < 1e-5
    assert np.abs(k - m).max(initial=0.0) < 1e-3 * (1.0 + bends.max() ** 2)
    assert_unit_speed(way)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(3, 12))
def test_a_rounded_polyline_keeps_to_its_lines_and_cuts(seed: int, count: int) -> None:
    g = np.random.default_rng(seed)
    steps = g.normal(size=(count - 1, 3))
    # No direction is more than asin(1 / 1.1) off x, so no corner turns by more than 131 degrees.
    steps = steps / np.linalg.norm(steps, axis=1)[:, None] + [1.1, 0.0, 0.0]
    steps *= g.uniform(0.005, 0.1, count - 1)[:, None]
    corners = np.cumsum(np.vstack([g.uniform(-0.5, 0.5, 3), steps]), axis=0)
    length = np.linalg.norm(steps, axis=1)
    cuts = np.minimum(np.minimum(length[:-1], length[1:]) / 2.0, 0.01)
    way, at = curve.rounded(corners, cuts)
    near = np.linalg.norm(way.at(at)[0] - corners, axis=1)
    assert near[[0, -1]].max() < 1e-15
    assert np.all(near[1:-1] < 0.57 * cuts)
    s = np.linspace(0.0, way.length_m, 3000)
    p, t, bend = way.at(s)
    inside = np.any(
        np.linalg.norm(p[:, None] - corners[1:-1], axis=2) <= cuts * (1.0 + 1e-9), axis=1
    )
    segments = [Segment(a, b) for a, b in pairwise(corners)]
    beside = np.min(
        [np.linalg.norm(np.cross(p - one.begin, one.at(s[:1])[1]), axis=1) for one in segments],
        axis=0,
    )
    assert np.all(inside | (beside < 1e-12))
    # The tangent turns by no more than the bend says: it is continuous.
    step = s[1] - s[0]
    sharpest = np.linalg.norm(bend, axis=1).max()
    assert np.linalg.norm(np.diff(t, axis=0), axis=1).max() <= 1.3 * sharpest * step
    assert_unit_speed(way, within=1e-6 * max(1.0, (sharpest / 300.0) ** 2))


def test_corners_bend_no_more_than_is_said() -> None:
    for turn_deg, most in ((10, 1.3), (45, 1.3), (90, 1.3), (135, 2.0)):
        a = np.radians(turn_deg)
        corners = np.array([[-1.0, 0, 0], [0, 0, 0], [np.cos(a), np.sin(a), 0]]) * 0.1
        way, _ = curve.rounded(corners, np.array([0.02]))
        bend = np.linalg.norm(way.at(np.linspace(0, way.length_m, 4001))[2], axis=1).max()
        assert 1.0 < bend * 0.02 / np.tan(a / 2.0) < most


def test_points_that_give_no_shape_are_told_of() -> None:
    p = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.0, 0, 0.1]])
    with pytest.raises(InvalidError, match=r"\[0, 0, 0\], \[100, 0, 0\] and \[200, 0, 0\] lie on"):
        shapes.arc(p[0], p[1], p[2])
    with pytest.raises(InvalidError, match=r"\[100, 0, 0\] is there twice"):
        shapes.arc(p[0], p[1], p[1])
    with pytest.raises(InvalidError, match=r"begin \[0, 0, 100\] stands on the axis"):
        shapes.helix(p[3], p[0], np.array([0.0, 0, 2.0]), 1.0, 0.0)
    with pytest.raises(InvalidError, match=r"turns back on the spot near x 100.0"):
        curve.spline(p[[0, 1, 0]], False)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_quaternions_are_scipys(seed: int) -> None:
    oracle = Rotation.random(40, rng=np.random.default_rng(seed))
    R = oracle.as_matrix()
    q = to_quaternion(R)
    w_last = q[:, [1, 2, 3, 0]]
    sign = np.sign(np.sum(w_last * oracle.as_quat(), axis=1))[:, None]
    np.testing.assert_allclose(sign * w_last, oracle.as_quat(), atol=1e-14)
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) >= 0.0)
    np.testing.assert_allclose(to_rotation(3.0 * q), R, atol=1e-14)
    v = R[:, :, 0]
    np.testing.assert_allclose(shortest(v[0], v[1:]) @ v[0], v[1:], atol=1e-12)
    np.testing.assert_allclose(
        about(v[0], np.arange(5.0)),
        Rotation.from_rotvec(np.arange(5.0)[:, None] * v[0]).as_matrix(),
        atol=1e-14,
    )


@settings(max_examples=25, deadline=None)
@given(seeds, st.integers(2, 20))
def test_a_monotone_track_overshoots_nothing(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    s, values = np.cumsum(rng.uniform(0.1, 1.0, count)), rng.uniform(0.0, 120.0, (count, 3))
    track = Track.monotone(s, values)
    fine = np.linspace(s[0], s[-1], 2000)
    found, slope = track.at(fine)
    i = np.clip(np.searchsorted(s, fine, "right") - 1, 0, count - 2)
    low, high = np.minimum(values[i], values[i + 1]), np.maximum(values[i], values[i + 1])
    assert np.all((found >= low - 1e-9) & (found <= high + 1e-9))
    np.testing.assert_allclose(track.at(s)[0], values, atol=1e-12)
    np.testing.assert_allclose(monotone_slopes(s, values), track.at(s)[1], atol=1e-9)
    part = track.part(float(fine[300]), float(fine[1500]))
    np.testing.assert_allclose(part.at(fine[300:1500] - fine[300])[0], found[300:1500], atol=1e-9)
    h = 1e-6
    middle = fine[1:-1]
    rate = (track.at(middle + h)[0] - track.at(middle - h)[0]) / (2.0 * h)
    assert np.abs(rate - slope[1:-1]).max() < 1e-2


def test_splines_and_polylines_take_linear_time() -> None:
    def cost_s(count: int) -> float:
        t = np.linspace(0.0, 20.0, count)
        p = np.stack([0.55 + 0.05 * np.cos(t), 0.1 * np.sin(1.1 * t), 0.1 + 0.01 * t], axis=1)
        begin = time.process_time()
        length = np.linalg.norm(np.diff(p, axis=0), axis=1)
        line, _ = curve.rounded(p, np.minimum(length[1:], length[:-1]) / 2.0)
        line.at(np.linspace(0.0, line.length_m, 3 * count))
        curve.spline(p, False)
        return time.process_time() - begin

    cost_s(1000)
    small = min(cost_s(4000) for _ in range(3))
    assert cost_s(40_000) < 25.0 * small
