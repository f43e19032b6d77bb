"""The drawing of a plan: well-formed, in its scales, honest about what is missing."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from sphmctl.motion import JOINT_NAMES
from sphmctl.pictures import Binding, Margin, figures, plot
from tests.pictures.rig import LIMITS, browse, console, make_plan

SVG = "{http://www.w3.org/2000/svg}"


def group(svg: str, title: str) -> ElementTree.Element:
    """One panel of the drawing."""
    root = ElementTree.fromstring(svg)
    return next(g for g in root.iter(f"{SVG}g") if g.get("aria-label") == title)


def test_every_joint_and_both_sides_of_the_path_have_a_panel() -> None:
    svg = plot(make_plan(), LIMITS)
    for title in (*JOINT_NAMES, "Path from above", "Path from the side"):
        assert group(svg, title).find(f"{SVG}path") is not None
    words = " ".join(ElementTree.fromstring(svg).itertext())
    assert "4.00 s, 2 stops of the arm, 501 rows" in words
    assert "What binds" not in words


def test_a_joints_line_ends_at_the_height_of_its_last_angle() -> None:
    plan = make_plan()
    panel = group(plot(plan, LIMITS), "A1")
    heights = {
        float((tick.text or "").replace("−", "-")): float(tick.get("y", "")) - 3.5
        for tick in panel.iter(f"{SVG}text")
        if tick.get("class") == "tick end"
    }
    (low, y_low), (high, y_high) = min(heights.items()), max(heights.items())
    line = panel.find(f"{SVG}path")
    assert line is not None
    drawn = re.findall(r"L([\d.]+) ([\d.]+)", line.get("d", ""))
    last = low + (float(drawn[-1][1]) - y_low) / (y_high - y_low) * (high - low)
    assert last == pytest.approx(np.degrees(plan.joints[-1, 0]), abs=0.1)


def test_a_range_is_drawn_where_the_joint_comes_near_it() -> None:
    plan = make_plan()
    ranges = LIMITS.ranges.copy()
    ranges[0, 1] = np.radians(12.0)  # A1 begins at 10 degrees
    svg = plot(plan, replace(LIMITS, ranges=ranges))
    levels = [line for line in group(svg, "A1") if line.get("class") == "level"]
    assert len(levels) == 1
    assert not [line for line in group(svg, "A2") if line.get("class") == "level"]


def test_what_binds_is_told_with_its_share_of_the_time_and_drawn_as_long() -> None:
    plan = make_plan()
    binding = ["A2 acceleration" if t < 1.0 else "tool speed" for t in plan.t]
    shares = [("tool speed", 0.75), ("A2 acceleration", 0.25)]
    svg = plot(plan, LIMITS, Binding(binding, shares))
    words = " ".join(ElementTree.fromstring(svg).itertext())
    assert "A2 acceleration 25%" in words
    assert "tool speed 75%" in words
    boxes = re.findall(r'class="f(\d)" x="[\d.]+" y="[\d.]+" width="(\d+)"', svg)
    assert [colour for colour, _ in boxes] == ["2", "1"]
    assert int(boxes[0][1]) / (int(boxes[0][1]) + int(boxes[1][1])) == pytest.approx(0.25, abs=0.01)


def test_margins_that_are_given_have_panels_with_their_limits() -> None:
    plan = make_plan()
    margin = Margin("Gap between tool & forearm", "mm", 20.0 + plan.t, 5.0)
    panel = group(plot(plan, LIMITS, margins=[margin]), "Gap between tool & forearm")
    assert [line for line in panel if line.get("class") == "level"]


def test_shares_of_limits_are_those_of_the_joints() -> None:
    plan = make_plan()
    _, speed = figures.speed_percent(plan, LIMITS)
    _, acceleration = figures.acceleration_percent(plan, LIMITS)
    # 3 u^2 - 2 u^3 in 4 s: 1.5 of the mean speed at most, six times it per time at the ends.
    way = np.abs(plan.joints[-1] - plan.joints[0])
    assert speed.max(axis=0) == pytest.approx(100.0 * 1.5 * way / 4.0 / LIMITS.speeds, rel=1e-3)
    peak = 100.0 * 6.0 * way / 16.0 / LIMITS.accelerations
    assert acceleration.max(axis=0) == pytest.approx(peak, rel=0.01)


def test_a_name_from_outside_is_escaped() -> None:
    svg = plot(
        make_plan(name='<b onload="x">&\x1b'), LIMITS, Binding(["<i>"] * 501, [("<i>", 1.0)])
    )
    assert "<b " not in svg
    assert "<i>" not in svg
    assert '<b onload="x">&' in " ".join(ElementTree.fromstring(svg).itertext())


def test_a_plan_of_one_row_can_be_drawn() -> None:
    plan = make_plan()
    one = replace(
        plan, t=plan.t[:1], joints=plan.joints[:1], tool=plan.tool[:1], knots=(), points=()
    )
    svg = plot(one, LIMITS, Binding(["none"], []))
    ElementTree.fromstring(svg)
    assert "nan" not in svg.replace("nano", "")


def test_chromium_draws_it_and_has_nothing_to_say(tmp_path: Path) -> None:
    page, picture = tmp_path / "plan.svg", tmp_path / "plan.png"
    page.write_text(
        plot(make_plan(), LIMITS, Binding(["tool speed"] * 501, [("tool speed", 1.0)])),
        encoding="utf-8",
    )
    told = browse(tmp_path, page, f"--screenshot={picture}", "--window-size=1120,1700")
    assert console(told.stderr) == []
    assert picture.stat().st_size > 50_000  # an empty page has 5 kB


def test_twenty_labels_are_all_told_inside_the_picture() -> None:
    names = [f"{name} {kind}" for name in JOINT_NAMES for kind in ("speed", "acceleration")]
    rows = [names[k % len(names)] for k in range(501)]
    svg = plot(make_plan(), LIMITS, Binding(rows, [(name, 1 / len(names)) for name in names]))
    told = [
        (float(text.get("x", "")), text.text or "")
        for text in ElementTree.fromstring(svg).iter(f"{SVG}text")
        if re.fullmatch(r".* \d+%", text.text or "")
    ]
    assert len(told) == len(names)
    assert max(x + 7.0 * len(words) for x, words in told) <= 1100.0


def numbers(panel: ElementTree.Element, style: str) -> list[float]:
    """An axis' numbers."""
    ticks = (tick.text or "" for tick in panel.iter(f"{SVG}text") if tick.get("class") == style)
    return [float(tick.replace("−", "-")) for tick in ticks]


def test_every_panel_has_a_scale_on_both_axes_whatever_the_joints_do() -> None:
    plan = make_plan()
    for reach in np.geomspace(1e-9, 300.0, 40):
        joints = plan.joints[0] + np.radians(reach) * np.linspace(-0.3, 0.7, 501)[:, None]
        svg = plot(replace(plan, joints=joints), LIMITS)
        for title in JOINT_NAMES:
            panel = group(svg, title)
            for style in ("tick end", "tick middle"):
                assert len(set(numbers(panel, style))) > 1


def test_a_path_of_one_point_has_scales_that_people_can_read() -> None:
    plan = make_plan()
    one = replace(
        plan, t=plan.t[:1], joints=plan.joints[:1], tool=plan.tool[:1], knots=(), points=()
    )
    svg = plot(one, LIMITS)
    assert numbers(group(svg, "A1"), "tick middle") == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    assert np.ptp(numbers(group(svg, "Path from the side"), "tick end")) >= 10.0
    assert "e−" not in svg


def test_a_path_along_y_is_seen_from_where_it_shows() -> None:
    plan = make_plan()
    tool = np.tile(np.eye(4), (501, 1, 1))
    tool[:, :3, 3] = [0.56, 0.0, 0.06]
    tool[:, 1, 3] = np.linspace(-0.12, 0.12, 501)
    panel = group(plot(replace(plan, tool=tool), LIMITS), "Path from the side")
    dots = [float(dot.get("cx", "")) for dot in panel.iter(f"{SVG}circle")]
    assert len(dots) == 2
    assert abs(dots[0] - dots[1]) > 200.0


def test_the_tools_speed_is_drawn_with_what_the_path_asks_for() -> None:
    plan = make_plan()
    t_s, speed = figures.tool_rates(plan)[0]
    way_mm = np.linalg.norm(np.diff(plan.tool[:, :3, 3], axis=0), axis=1).sum() * 1000.0
    assert np.trapezoid(speed, t_s) == pytest.approx(way_mm, rel=1e-3)
    asked = np.tile([0.1, np.inf], (501, 1))
    asked[:100] = np.inf
    svg = plot(plan, LIMITS, asked=asked)
    dashed = [
        [path.get("d") for path in group(svg, title).iter(f"{SVG}path")][1:]
        for title in ("Tool speed", "Tool acceleration")
    ]
    assert len(dashed[0]) == 1  # from a fifth of the time on
    assert not dashed[1]
    x = [float(x) for x in re.findall(r"[ML]([\d.]+)", dashed[0][0] or "")]
    left, right = 46.0, group(svg, "Tool speed").iter(f"{SVG}line")
    assert min(x) > left + 0.19 * (max(float(line.get("x2", "")) for line in right) - left)


def test_rates_pass_over_rows_just_behind_another() -> None:
    plan = make_plan()
    t = np.insert(plan.t, 250, plan.t[250] - 1e-4)  # a knot off the grid, joints a little beside
    knot = plan.joints[250] - 1e-4 / 0.008 * (plan.joints[250] - plan.joints[249])
    joints = np.insert(plan.joints, 250, knot + 1e-6, axis=0)
    tool = np.insert(plan.tool, 250, plan.tool[250], axis=0)
    odd = replace(plan, t=t, joints=joints, tool=tool)
    _, usual = figures.acceleration_percent(plan, LIMITS)
    _, found = figures.acceleration_percent(odd, LIMITS)
    assert found.max() < 2.0 * usual.max()
