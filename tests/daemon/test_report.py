"""The report page: well-formed, complete, self-contained, and honest about what is missing."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from sphmctl.daemon.assess import PointResult, Skew, SkewTrace, Tracking
from sphmctl.daemon.report import Event, ReportInput, Trace, page, write_report
from sphmctl.motion import JOINT_NAMES
from sphmctl.pictures import charts

POSE = (623.563, -0.0049, 0.0, -179.9995, 0.0, 180.0)


def make_run() -> ReportInput:
    t = np.arange(0.0, 10.0, 0.01)
    required = 30.0 * np.sin(t)[:, None] * np.ones(9)
    tool = np.stack([100.0 * np.cos(t), 100.0 * np.sin(t), 0.0 * t], axis=1)
    skew = np.where(np.abs(np.cos(t)) > 0.5, 4.0, np.nan)
    return ReportInput(
        name="octagon",
        started="2026-03-04 14:20:31",
        outcome="completed",
        cause="",
        emulated=True,
        duration_s=24.13,
        planned_s=23.5,
        t_s=t,
        required_deg=required,
        measured_deg=required + 0.21,
        tool_required_mm=tool,
        tool_reached_mm=tool + 0.1,
        tracking=Tracking(0.31, 0.42),
        points=(
            PointResult("A", POSE, tuple(v + 0.5 for v in POSE), 0.87, 0.13),
            PointResult("B", POSE, None, None, None),
        ),
        skew=Skew(1.25, 4.75, 6.5, 0.62, 0.44),
        trace=Trace(t, SkewTrace(t, np.zeros((len(t), 3)), skew)),
        notes=("34 knots in all",),
        events=(Event(3.218, "warning", "the controller was late"),),
        files=("plan.csv", "summary.json"),
    )


def text_of(html: str) -> str:
    body = ElementTree.fromstring(html).find("body")
    assert body is not None
    return " ".join(" ".join(body.itertext()).split())


def test_the_page_is_well_formed_and_shows_every_figure() -> None:
    text = text_of(page(make_run()))
    for figure in ("24.13 s", "0.42 mm", "0.31°", "1.25 ms", "4.75 ms", "6.50 ms", "62 %", "0.44°"):
        assert figure in text
    for name in (*JOINT_NAMES, "EMULATED: no robot has moved.", "34 knots in all", "plan.csv"):
        assert name in text
    assert "3.218 s warning the controller was late" in text
    assert "every figure inside its limit" in text


def test_the_table_shows_required_and_reached_of_each_named_point() -> None:
    rows = ElementTree.fromstring(page(make_run())).findall(".//tbody/tr")
    cells = [["".join(cell.itertext()) for cell in row] for row in rows[:2]]
    pose = ["623.56", "0.00", "0.00", "−180.00", "0.00", "180.00"]
    reached = ["624.06", "0.50", "0.50", "−179.50", "0.50", "180.50"]
    assert cells[0] == ["A", *pose, *reached, "0.87", "0.13"]
    assert cells[1] == ["B", *pose, "not reached"]


def test_the_page_loads_nothing_and_runs_nothing() -> None:
    html = page(make_run())
    assert not re.search(r"https?:|//[a-z]|<script|@import|url\(|\ssrc=", html, re.IGNORECASE)
    links = re.findall(r'href="([^"]*)"', html)
    assert links == ["plan.csv", "summary.json"]


def test_text_from_outside_is_escaped_everywhere() -> None:
    nasty = '<b onclick="x">&\x00\x1b[31m\udc80'
    run = replace(
        make_run(),
        name=nasty,
        started=nasty,
        outcome="faulted",
        cause=nasty,
        points=(PointResult(nasty, POSE, POSE, 0.0, 0.0),),
        notes=(nasty,),
        events=(Event(0.0, nasty, nasty),),
        files=(nasty.rstrip("\udc80"),),
    )
    html = page(run)
    assert "<b " not in html
    assert "\x00" not in html
    assert "\x1b" not in html
    assert html.encode("utf-8")
    assert text_of(html).count('<b onclick="x">&') >= 8


def test_a_figure_outside_its_limit_is_named() -> None:
    run = replace(make_run(), tracking=Tracking(0.3, 1.7), skew=Skew(1.0, 12.0, 14.0, 0.3, 0.4))
    text = text_of(page(run))
    assert "Outside its limit: Tool off the path, at most, Skew, 99 %, Instants counted" in text
    assert text.count("✗ outside") == 3


def test_a_run_on_a_real_cell_has_no_banner_and_no_skew() -> None:
    run = replace(make_run(), emulated=False, skew=None, trace=None)
    text = text_of(page(run))
    assert "EMULATED" not in text
    assert "Skew" not in text


def test_a_run_that_ended_at_once_still_has_a_page() -> None:
    run = replace(
        make_run(),
        outcome="faulted",
        cause="servo 2 did not answer",
        t_s=np.empty(0),
        required_deg=np.empty((0, 9)),
        measured_deg=np.empty((0, 9)),
        tool_required_mm=np.empty((0, 3)),
        tool_reached_mm=np.empty((0, 3)),
        tracking=Tracking(None, None),
        points=(),
        skew=Skew(None, None, None, 0.0, None),
        trace=Trace(np.empty(0), SkewTrace(np.empty(0), np.empty((0, 3)), np.empty(0))),
        notes=(),
        events=(),
        files=(),
    )
    text = text_of(page(run))
    assert "faulted" in text
    assert "servo 2 did not answer" in text
    assert "nan" not in text.lower()


def test_the_file_replaces_an_older_one_and_leaves_no_draft(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text("old")
    write_report(path, make_run())
    assert path.read_text(encoding="utf-8") == page(make_run())
    assert list(tmp_path.iterdir()) == [path]


def test_a_thinned_line_keeps_its_peaks_and_its_size() -> None:
    x = np.arange(100_000.0)
    y = np.zeros(100_000)
    y[31_415], y[92_653] = 7.0, -7.0
    thin_x, thin_y = charts.thin(x, y)
    assert len(thin_x) <= charts.POINTS + 2
    assert (thin_y.max(), thin_y.min()) == (7.0, -7.0)
    assert (thin_x[0], thin_x[-1]) == (0.0, 99_999.0)


def test_a_gap_in_the_data_interrupts_the_line() -> None:
    line = charts.Line(np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0]), "measured")
    svg = charts.draw(charts.Chart("test", (line,), "x", "y"))
    path = re.findall(r'class="line measured" d="([^"]+)"', svg)[0]
    assert path.count("M") == 2


def test_the_largest_value_is_drawn_at_its_height() -> None:
    line = charts.Line(np.array([0.0, 10.0]), np.array([0.0, 100.0]), "measured")
    svg = charts.draw(charts.Chart("test", (line,), "x", "y"))
    start_x, start_y, end_x, end_y = map(
        float,
        re.findall(r"[ML]([\d.]+) ([\d.]+)", svg)[0]
        + (re.findall(r"[ML]([\d.]+) ([\d.]+)", svg)[1]),
    )
    grid = {
        float(y): float(value.replace("−", "-"))
        for y, value in re.findall(r'class="tick end" x="[\d.]+" y="([\d.]+)">([^<]+)<', svg)
    }
    zero, hundred = (next(y - 3.5 for y, v in grid.items() if v == w) for w in (0.0, 100.0))
    assert (start_y, end_y) == pytest.approx((zero, hundred), abs=0.11)
    assert end_x > start_x


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, [0.0, 2.5, 5.0, 7.5, 10.0]),
        (-0.5, 0.5, [-0.5, -0.25, 0.0, 0.25, 0.5]),
        (310.0, 624.0, [400.0, 500.0, 600.0]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    assert charts.ticks(low, high, 5) == expected


def test_a_plan_view_has_one_scale() -> None:
    t = np.linspace(0.0, 2 * np.pi, 201)
    line = charts.Line(300.0 * np.cos(t), 300.0 * np.sin(t), "measured")
    svg = charts.draw(charts.Chart("circle", (line,), "x", "y", width=700.0, equal=True))
    points = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", svg), dtype=np.float64)
    assert np.ptp(points[:, 0]) == pytest.approx(np.ptp(points[:, 1]), abs=0.3)
