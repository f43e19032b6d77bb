"""Paths that cannot be driven, one file for each reason: joint, place and sentence are right."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import pytest

from sphmctl.config import emulated_cell
from sphmctl.pathfile import load_path
from sphmctl.planner.plan import TIMINGS, draw_up

FILES = FilePath(__file__).parent / "refused"
OCTAGON = FilePath(__file__).parents[2] / "configs" / "paths" / "octagon.yaml"
REACH_MM = 455.0 + (420.0**2 + 35.0**2) ** 0.5


@dataclass(frozen=True)
class Refusal:
    """What is to be told.

    Attributes:
        along_mm: how far along the move, from and to; None where the move alone is the place.
        words: of the sentence.
    """

    joint: str
    move: str
    along_mm: tuple[float, float] | None
    limit: float | None
    words: str


REFUSALS = {
    # Wrist centre 99 + 69.53 + 58.9 mm over z = 300: reach ends at x 892.6 of the line from 600.
    "reach": Refusal("", "move 2 (lin)", (292.0, 293.1), REACH_MM, "wrist centre would be"),
    # Half of the turn of 20 degrees about axis 1: 10 degrees at 558.7 mm from it.
    "range": Refusal("A1", "move 2 (circle)", (97.4, 98.1), 170.0, "would have to stand at"),
    "speed": Refusal("A4", "move 2 (lin)", None, 381.0, "would need a speed of"),
    "acceleration": Refusal(
        "theta7", "move 2 (lin)", None, 3437.7468, "would need an acceleration of"
    ),
    "collision": Refusal("", "move 2 (ptp)", None, 0.0, "the servos reach"),
    # From 60 to 140 degrees over 200 mm: 120 at 150 mm.
    "crank_limit": Refusal("theta8", "move 2 (lin)", (150.0, 150.6), 120.0, "have to stand at 140"),
    "branch_change": Refusal("A4", "move 2 (lin)", None, 180.0, "it is another branch"),
    # A tilt rising to 50 degrees over 200 mm passes the steepest one on the way.
    "impossible_tilt": Refusal("", "move 2 (lin)", (130.0, 145.0), None, "tilted by 34.86 degrees"),
}


@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize("name", REFUSALS)
def test_it_is_refused_with_its_reason_joint_and_place(name: str, timing: str) -> None:
    path = load_path(FILES / f"{name}.yaml")
    outcome = draw_up(path, emulated_cell(), 1.0, timing)
    assert outcome.made is None
    problem, wanted = outcome.problems[0], REFUSALS[name]
    print(problem.where, problem.message, sep=": ")
    assert problem.joint == wanted.joint
    assert wanted.words in problem.message
    line, move, *along = problem.where.split(", ")
    assert (line, move) == (f"line {path.moves[1].line}", wanted.move)
    if wanted.along_mm is not None:
        low, high = wanted.along_mm
        assert low <= float(along[0].split()[0]) <= high
    if wanted.limit is not None:
        assert problem.limit == pytest.approx(wanted.limit)


def test_every_file_is_looked_at() -> None:
    assert {file.stem for file in FILES.glob("*.yaml")} == set(REFUSALS)


@pytest.mark.parametrize("timing", TIMINGS)
def test_the_octagon_with_its_singular_poses_and_limits_is_not_refused(timing: str) -> None:
    outcome = draw_up(load_path(OCTAGON), emulated_cell(), 1.0, timing)
    assert outcome.problems == ()
    assert outcome.made is not None


def test_a_tilt_that_no_cranks_hold_is_told_at_a_ptp_too(tmp_path: FilePath) -> None:
    file = tmp_path / "path.yaml"
    text = "version: 1\nname: t\nwrist: {heave_mm: 70, tilt_deg: [50, 0]}\n"
    file.write_text(text + "moves:\n  - ptp: {pose: [500, -100, 300, 180, 0, 180]}\n")
    (problem,) = draw_up(load_path(file), emulated_cell()).problems
    assert (problem.where, problem.value) == ("line 5, move 1 (ptp)", 70.0)
    assert problem.limit == pytest.approx(64.5508, abs=1e-4)
    assert "a heave of 70 mm; tilted by 50 degrees towards 0 degrees it goes" in problem.message
