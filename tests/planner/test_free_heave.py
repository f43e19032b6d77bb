"""`level` and `tilt`: what the flange keeps, what a free heave may cost, where profiles begin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
import pytest

from sphmctl.config import emulated_cell
from sphmctl.motion import Floats, Plan
from sphmctl.pathfile import load_path
from sphmctl.planner.plan import Outcome, draw_up
from sphmctl.robots import rrs
from tests.planner.oracle import pen_mm

Drawer = Callable[..., Outcome]

HEAD = "version: 1\nname: t\ntool: octagon_pen\nspeed: {tcp_mm_s: 100, tcp_mm_s2: 500}\n"
START = "ptp: {pose: [560, 0, 60, 180, 0, 180]}"
ALONG = "lin: {pose: [560, 100, 60, 180, 0, 180]}"
LEANING = "lin: {pose: [560, 50, 60, 180, 10, 180]}"
CORNER = "lin: {pose: [600, 50, 60, 180, 10, 180]}"


@pytest.fixture
def drawn(tmp_path: FilePath) -> Drawer:
    def draw(wrist: str, *moves: str) -> Outcome:
        file = tmp_path / "path.yaml"
        listed = "".join(f"  - {move}\n" for move in moves)
        file.write_text(f"{HEAD}wrist: {wrist}\nmoves:\n{listed}")
        return draw_up(load_path(file), emulated_cell())

    return draw


def made(outcome: Outcome) -> Plan:
    assert outcome.made is not None, outcome.problems
    return outcome.made.plan


def flange_z(plan: Plan) -> Floats:
    """The direction of the flange in each row, by the paper's D-H table."""
    return np.array([pen_mm(row)[1] for row in np.degrees(plan.joints)])


def heave_mm(crank_deg: float) -> float:
    """Of equal cranks, by the paper's formula."""
    up = np.radians(90.0 - crank_deg)
    return float(25.0 * np.sin(up) + np.sqrt(61.0**2 - 25.0**2 * np.cos(up) ** 2))


BACK = "lin: {pose: [560, 0, 60, 180, 0, 180]}"
BEHIND = "lin: {pose: [630, 80, 60, 180, 15, 180]}"
LEVEL_AGAIN = "lin: {pose: [660, 110, 60, 180, 0, 180]}"
ON_THE_SPOT = "lin: {pose: [560, 50, 60, 180, 4, 175]}"
BY_PTP = "ptp: {pose: [520, 50, 60, 180, 5, 180]}"


@pytest.mark.parametrize(
    "moves",
    [
        (LEANING, CORNER),
        (LEANING, BACK),
        (LEANING, CORNER, BEHIND, LEVEL_AGAIN),
        (LEANING, ON_THE_SPOT, CORNER),
        (LEANING, BY_PTP, BACK),
        (LEANING, "dwell_s: 0.1", CORNER),
    ],
    ids=["corner", "back", "three corners", "on the spot", "ptp between", "rest"],
)
def test_tilt_keeps_the_flanges_direction_over_all_moves(
    drawn: Drawer, moves: tuple[str, ...]
) -> None:
    plan = made(drawn("tilt", START, *moves))
    turned = flange_z(plan) - [0.0, 0.0, -1.0]
    joints = np.degrees(plan.joints)
    ends = [0, *(knot.sample for knot in plan.knots)]
    # A ptp is straight in joint space; elsewhere each row keeps it.
    rows = ends if BY_PTP in moves else slice(None)
    assert np.linalg.norm(turned[rows], axis=1).max() < 1e-9
    assert np.ptp(joints[:, 6:], axis=0).max() > 10.0


def test_tilt_keeps_the_direction_that_the_flange_has_where_it_begins(drawn: Drawer) -> None:
    tilted = f"{START}\n    wrist: {{policy: fixed, cranks_deg: [50, 60, 70]}}"
    z = flange_z(made(drawn("tilt", tilted, LEANING, CORNER)))
    assert np.linalg.norm(z[0] - [0.0, 0.0, -1.0]) > 0.05
    np.testing.assert_allclose(z, np.broadcast_to(z[0], z.shape), atol=1e-9)


FAR = "pose: [520, 50, 160, 180, 45, 180]"
FURTHER = "lin: {pose: [520, 0, 160, 180, 45, 180]}"


def test_a_ptp_that_cannot_keep_the_flanges_direction_is_refused_and_cranks_begin_another(
    drawn: Drawer,
) -> None:
    refused = drawn("tilt", START, LEANING, f"ptp: {{{FAR}}}", FURTHER)
    problem = refused.problems[0]
    assert problem.where == "line 9, move 3 (ptp)"
    assert problem.value == pytest.approx(45.0)
    assert "to keep the flange's direction" in problem.message
    assert "give the point 'cranks_deg'" in problem.message
    again = f"ptp: {{{FAR}, cranks_deg: [60, 60, 60]}}"
    z = flange_z(made(drawn("tilt", START, LEANING, again, FURTHER)))
    lean = np.degrees(np.arccos(-z[-1, 2]))
    assert lean == pytest.approx(45.0, abs=1e-6)


NEAR_A5_ZERO = [
    (
        "ptp: {pose: [560, 20, 60, 180, 0, 180]}",
        "lin: {pose: [560, 60, 60, 180, 18, 180]}",
    ),
    (START, ALONG, "lin: {pose: [560, 100, 60, 180, 15, 180]}"),
    (
        "ptp: {pose: [560, 50, 60, 180, 0, 180]}",
        "lin: {pose: [560, 50, 60, 180, 25, 180]}",
    ),
    (
        "ptp: {pose: [560, 5, 60, 180, 0, 180]}",
        "lin: {pose: [560, 45, 60, 180, 25, 180]}",
    ),
]
WIDE = (
    "ptp: {pose: [333.261, -206.618, 174.821, 201.68, 0, 180]}",
    "lin: {pose: [348.391, -157.261, 78.959, 201.68, 0, 180]}",
    "lin: {pose: [290.24, -175.026, 109.048, 201.68, 0, 180]}",
)


@pytest.mark.parametrize("moves", [*NEAR_A5_ZERO, WIDE])
def test_a_free_heave_drives_what_a_kept_one_drives_and_is_not_slower(
    drawn: Drawer, moves: tuple[str, ...]
) -> None:
    free = made(drawn("level", *moves))
    kept = made(drawn(f"{{policy: level, heave_mm: {heave_mm(60.0):.9f}}}", *moves))
    assert free.duration_s <= 1.03 * kept.duration_s
    assert np.ptp(free.joints[:, 6:], axis=1).max() < 1e-9
    travel = [np.abs(np.diff(plan.joints[:, :3], axis=0)).sum() for plan in (free, kept)]
    assert travel[0] <= 1.01 * travel[1]


@pytest.mark.parametrize("crank_deg", [60, 80, 95])
@pytest.mark.parametrize(("b_deg", "c_deg"), [(12, 180), (8, 186), (0, 190)])
def test_a_turn_on_the_spot_takes_no_longer_than_with_the_heave_kept(
    drawn: Drawer, crank_deg: float, b_deg: float, c_deg: float
) -> None:
    begin = f"{START[:-1]}, cranks_deg: [{crank_deg}, {crank_deg}, {crank_deg}]}}"
    turn = f"lin: {{pose: [560, 0, 60, 180, {b_deg}, {c_deg}]}}"
    free = made(drawn("tilt", begin, turn))
    direction, tilt, _ = np.degrees(rrs.tilt_of(rrs.forward(free.joints[-1, 6:])))
    # The same turn as a motion of the wrist at the heave at which it stands.
    kept = f"{{heave_mm: {heave_mm(crank_deg):.9f}, tilt_deg: [0, {tilt:.9f}], "
    kept += f"tilt_towards_deg: {direction:.9f}}}"
    assert free.duration_s <= 1.03 * made(drawn(kept, begin, turn)).duration_s


# A4 leaves its range at the heave at which it begins; at a lower one it does not.
PAST_A4 = (
    "ptp: {joints_deg: [-53.8, -43.79, 105.02, 25.44, 3.95, -7.27, 96.64, 96.64, 96.64]}",
    "lin: {pose: [424.840797, 530.144931, 186.347347, -119.568037, 29.695177, -175.828355]}",
)


def test_where_the_heave_leads_nowhere_the_wrist_first_goes_to_another_on_the_spot(
    drawn: Drawer,
) -> None:
    kept = drawn("fixed", *PAST_A4)
    assert [problem.joint for problem in kept.problems] == ["A4"]
    plan = made(drawn("level", *PAST_A4))
    cranks = np.degrees(plan.joints[:, 6])
    moved = np.flatnonzero(np.abs(np.diff(cranks)) > 1e-9)
    place = plan.tool[:, :3, 3]
    assert np.abs(place[moved] - place[0]).max() < 1e-12
    assert abs(cranks[-1] - cranks[0]) > 1.0
    assert any("(move 2): the wrist goes to another heave first" in note for note in plan.notes)


# The best heave is at the end of a crank's range, where a cubic between rows would overshoot.
TO_THE_END = (
    "ptp: {joints_deg: [16.08, -87.92, 96.27, -16.58, 7.31, 12.49, 92.91, 92.91, 92.91]}",
    "lin: {pose: [614.795288, -137.651214, 708.463464, 164.478536, 61.459112, 172.094407]}",
)


def test_cranks_led_along_the_end_of_their_range_stay_within_it(drawn: Drawer) -> None:
    cranks = np.degrees(made(drawn("tilt", *TO_THE_END)).joints[:, 6:])
    assert cranks.max() <= 120.0 + 1e-9


def test_a_ptp_stands_where_its_profile_begins(drawn: Drawer) -> None:
    plan = made(drawn("{policy: level, heave_mm: [60, 80]}", START, ALONG))
    cranks = np.degrees(plan.joints[:, 6])
    assert heave_mm(cranks[0]) == pytest.approx(60.0, abs=1e-9)
    assert heave_mm(cranks[-1]) == pytest.approx(80.0, abs=1e-9)
    assert (np.diff(cranks) <= 1e-12).all()
    length = np.linalg.norm(plan.tool[:, :3, 3] - plan.tool[0, :3, 3], axis=1)
    assert np.abs(np.diff(cranks)[np.diff(length) < 1e-9]).max(initial=0.0) < 1e-9
    tilted = made(drawn("{heave_mm: 70, tilt_deg: [6, 0], tilt_turns: 0.25}", START, ALONG))
    direction, tilt, heave = rrs.tilt_of(rrs.forward(tilted.joints[0, 6:]))
    np.testing.assert_allclose(np.degrees([direction, tilt]), [0.0, 6.0], atol=1e-9)
    assert heave == pytest.approx(0.07)


@pytest.mark.parametrize(
    ("profile", "where", "value", "limit"),
    [
        ("[30, 80]", "line 7, move 1 (ptp)", 30.0, heave_mm(120.0)),
        ("[60, 90]", "line 8, move 2 (lin), 86.8 mm along", 86.0417, heave_mm(0.0)),
    ],
)
def test_a_heave_out_of_range_is_told_first_and_with_numbers(
    drawn: Drawer, profile: str, where: str, value: float, limit: float
) -> None:
    problems = drawn(f"{{policy: level, heave_mm: {profile}}}", START, ALONG).problems
    first = problems[0]
    assert first.where == where
    assert first.value == pytest.approx(value, abs=1e-4)
    assert first.limit == pytest.approx(limit)
    assert "would have to hold a heave of" in first.message
    assert not any("nan" in problem.message for problem in problems)


def test_cranks_that_a_refused_move_leaves_unknown_are_no_problem_of_the_next(
    drawn: Drawer,
) -> None:
    nowhere = "ptp: {pose: [2560, 0, 60, 180, 0, 180], cranks_deg: [60, 60, 60]}"
    (problem,) = drawn("fixed", nowhere, ALONG).problems
    assert problem.where == "line 7, move 1 (ptp)"
