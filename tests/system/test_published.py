"""The commonly published streaming program beside ours: what README's table claims, with one seed.

`python tools/bench/published.py` prints the whole table.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sphmctl.cli import main
from tools.bench import published_figures as figures
from tools.bench import published_runs as runs
from tools.bench.published_figures import Path, Stop
from tools.bench.published_runs import BY_PRESENT, BY_SILENCE, Drive, Form

SEED = 1
OURS = Form("ours")
EXACT = Form("exact", "PUB_EXACT")
BLENDED = Form("blended", "PUB_BLENDED")
PLANNED_PERCENT = 31
"""Override at which the published program is not faster than the plan."""


@cache
def drive(form: Form, stop_tau_s: float | None = None, way: str = BY_SILENCE) -> Drive:
    return runs.drive(form, SEED, stop_tau_s, way)


def path(form: Form) -> Path:
    return figures.path_of(drive(form), runs.octagon())


def stop(form: Form, way: str = BY_SILENCE) -> Stop:
    middle_s = float(runs.middles_s()[17])
    return figures.stop_of(drive(form, middle_s, way))


def test_ours_reaches_every_knot_once_and_keeps_the_path() -> None:
    ours = path(OURS)
    assert (ours.points, ours.lost, ours.repeated) == (34, 0, 0)
    assert ours.off_mm < 0.5
    assert ours.speed_mm_s < 102.0


@pytest.mark.parametrize("form", [EXACT, BLENDED], ids=lambda form: form.name)
def test_published_at_full_speed_keeps_the_knots_and_exceeds_the_plan_s_speed(form: Form) -> None:
    theirs = path(form)
    assert theirs.lost == 0
    assert theirs.repeated > 100
    assert theirs.off_mm < 0.5
    assert theirs.speed_mm_s > 2.0 * path(OURS).speed_mm_s
    assert theirs.time_s < path(OURS).time_s


@pytest.mark.parametrize("form", [EXACT, BLENDED], ids=lambda form: form.name)
def test_published_at_the_plan_s_speed_loses_knots_and_leaves_the_path(form: Form) -> None:
    theirs = path(replace(form, override_percent=PLANNED_PERCENT))
    assert theirs.lost >= 2
    assert theirs.off_mm > 2.0 * path(OURS).off_mm


def test_published_with_dense_points_loses_points_although_blended() -> None:
    theirs = path(replace(BLENDED, every_s=0.05))
    assert theirs.lost > theirs.points // 5


@pytest.mark.parametrize("percent", [100, PLANNED_PERCENT])
@pytest.mark.parametrize("form", [EXACT, BLENDED], ids=lambda form: form.name)
def test_after_a_stop_ours_moves_less_than_a_third_as_far(form: Form, percent: int) -> None:
    ours = stop(OURS)
    for way in (BY_SILENCE, BY_PRESENT):
        theirs = stop(replace(form, override_percent=percent), way)
        assert ours.way_deg < theirs.way_deg / 3.0
        assert ours.rest_s < theirs.rest_s


def test_the_published_programs_are_free_of_findings(capsys: pytest.CaptureFixture[str]) -> None:
    files = sorted(str(file) for file in runs.KRL.iterdir())
    assert main.run(["krl", "check", *files]) == 0
    assert "3 files: 0 errors, 0 warnings" in capsys.readouterr().out
