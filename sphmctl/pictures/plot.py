"""A plan as one SVG: path, what binds, joints, speeds and margins. Light and dark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sphmctl.motion import JOINT_NAMES, Floats, Plan
from sphmctl.pictures import charts, figures
from sphmctl.pictures.charts import Chart, Line, Mark, safe
from sphmctl.pictures.figures import Binding, Limits, Margin

WIDTH, EDGE, GAP = 1120.0, 20.0, 20.0
PATH_HEIGHT, PANEL_HEIGHT = 340.0, 190.0
HEAD = 24.0
"""Above a panel, for its title."""

POINTS = 600
"""Points kept of each line: twice the pixels of a panel."""

NEAR_SPANS = 1.0
"""A range's end is drawn in a joint's panel when it is nearer than so many of its own spans."""

NEAR_PERCENT = 40.0
"""From this share on the limit itself is drawn; below, it would leave the lines no room."""

MOST_MARGIN_DEG = 60.0
"""Joints further from the ends of their range are not drawn: nobody has to care about them."""

LEAST_PATH_MM = 20.0
"""A view of the path never shows less: one along the path shall look like a point."""

SLENDER = 0.3
"""A path is seen from the side along y; from the front where it would be slender so."""

LEAST_SPAN_DEG = 2.0
"""A joint's panel never shows less: a standing joint shall look still."""

BINDING_COLOURS = 8
"""Labels with a colour of their own; further ones share the last."""

STYLE = """
svg { color-scheme: light dark; --page: #ffffff; --ink: #1b1f24; --soft: #5b6470; --rule: #dfe3e8;
  --level: #b3261e; --c1: #2b66c0; --c2: #b4430b; --c3: #1a7f5a; --c4: #7a3fb0; --c5: #9a6b00;
  --c6: #b3266b; --c7: #007a8a; --c8: #5b6470; --c9: #4d7a0f; background: var(--page); }
@media (prefers-color-scheme: dark) { svg { --page: #12151a; --ink: #e8ebef; --soft: #9aa5b1;
  --rule: #313842; --level: #ff8a80; --c1: #7db2ff; --c2: #ffb46b; --c3: #63d2a3; --c4: #c9a2ff;
  --c5: #e6c45c; --c6: #ff9ac6; --c7: #6fd6e4; --c8: #9aa5b1; --c9: #b4dc6e; } }
text { font: 11px system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif;
  fill: var(--soft); }
.page { fill: var(--page); }
.title { font-size: 22px; font-weight: 650; fill: var(--ink); }
.head { font-size: 14px; font-weight: 600; fill: var(--ink); } .note { font-size: 13px; }
.end { text-anchor: end; } .middle { text-anchor: middle; }
.mark { fill: var(--ink); font-size: 13px; font-weight: 600; paint-order: stroke;
  stroke: var(--page); stroke-width: 3px; stroke-linejoin: round; } .dot { fill: var(--ink); }
.grid { stroke: var(--rule); } .axis { stroke: var(--soft); }
.level { stroke: var(--level); stroke-width: 1.2; stroke-dasharray: 5 4; }
.line { fill: none; stroke-linejoin: round; stroke-linecap: round; stroke-width: 1.4; }
.limit { stroke: var(--level); stroke-dasharray: 5 4; }
.knot { stroke: var(--ink); stroke-width: 4; opacity: .45; }
""" + "\n".join(
    f".s{k} {{ stroke: var(--c{k}); }} .f{k} {{ fill: var(--c{k}); }}" for k in range(1, 10)
)


@dataclass(frozen=True)
class Panel:
    """A chart with its title, and to the right of this a legend or a note."""

    title: str
    chart: Chart
    legend: tuple[str, ...] = ()
    note: str = ""


def plot(
    plan: Plan,
    limits: Limits,
    binding: Binding | None = None,
    asked: Floats | None = None,
    margins: Sequence[Margin] = (),
) -> str:
    """The picture's text.

    Args:
        binding: what rules the motion; None leaves that strip out.
        asked: the tool's speed (m/s) and acceleration (m/s2) that each row may have, (n, 2).
        margins: drawn below, each with a panel of its own.
    """
    parts: list[str] = []
    y = _header(plan, parts)
    deep, wide, _ = np.ptp(plan.tool[:, :3, 3], axis=0)
    side = 1 if deep < SLENDER * wide else 0
    y = _row(parts, y, [_projection(plan, *axes) for axes in ((0, 1), (side, 2))])
    if binding is not None and len(plan.t) > 1:
        y = _binding(parts, y, plan, binding)
    joints = [_joint(plan, limits, joint) for joint in range(9)]
    for first in (0, 3, 6):
        y = _row(parts, y, joints[first : first + 3])
    y = _row(parts, y, _of_tool(plan, asked))
    y = _row(parts, y, _shares(plan, limits))
    y = _row(parts, y, [_range_margins(plan, limits)])
    given = [_margin(plan, margin) for margin in margins]
    for k in range(0, len(given), 2):
        y = _row(parts, y, given[k : k + 2])
    size = f'width="{WIDTH:g}" height="{y:g}" viewBox="0 0 {WIDTH:g} {y:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    page = f'<rect class="page" width="{WIDTH:g}" height="{y:g}"/>'
    title = f"<title>{safe(plan.name)}: plan</title>"
    return "\n".join([head, title, f"<style>{STYLE}</style>", page, *parts, "</svg>\n"])


def _header(plan: Plan, parts: list[str]) -> float:
    parts.append(charts.text("title", EDGE, 40.0, plan.name))
    told = f"{figures.headline(plan)}, {len(plan.t)} rows"
    parts.append(charts.text("note end", WIDTH - EDGE, 40.0, told))
    return 58.0


def _row(parts: list[str], y: float, panels: list[Panel]) -> float:
    """Panels beside each other, as wide as they are; returns where the next row begins."""
    x = EDGE
    for panel in panels:
        parts.append(charts.text("head", x, y + 14.0, panel.title))
        at = x + panel.chart.width
        if panel.note:
            parts.append(charts.text("note end", at - 12.0, y + 14.0, panel.note))
        for k, name in reversed(list(enumerate(panel.legend, start=1))):
            at -= 9.0 + 6.6 * len(name)
            parts.append(charts.text(f"note f{k}", at, y + 14.0, name))
        parts.append(charts.place(panel.chart, x, y + HEAD))
        x += panel.chart.width + GAP
    return y + HEAD + max(panel.chart.height for panel in panels) + 10.0


def _wide(columns: int) -> float:
    return (WIDTH - 2.0 * EDGE - (columns - 1) * GAP) / columns


def _projection(plan: Plan, across: int, up: int) -> Panel:
    """The tool's path seen along one axis of the base frame; stops of the arm as dots."""
    mm = figures.tool_mm(plan)
    stops = mm[[knot.sample for knot in plan.knots]] if plan.knots else mm[:0]
    apart = np.full(3 * len(stops), np.nan)  # lone points, interrupted, are drawn as dots
    dots_x, dots_y = apart.copy(), apart
    dots_x[1::3], dots_y[1::3] = stops[:, across], stops[:, up]
    lines = (
        Line(*charts.stride(mm[:, across], mm[:, up], 2 * POINTS), "s1"),
        Line(dots_x, dots_y, "knot"),
    )
    marks = tuple(
        Mark(float(mm[point.sample, across]), float(mm[point.sample, up]), point.name)
        for point in plan.points
    )
    title = "Path from above" if up == 1 else "Path from the side"
    chart = Chart(
        title,
        lines,
        f"{'xyz'[across]} in the path's base, mm",
        f"{'xyz'[up]} in the path's base, mm",
        _wide(2),
        PATH_HEIGHT,
        marks,
        equal=True,
        least_span=LEAST_PATH_MM,
    )
    return Panel(title, chart, note="small dots: stops" if plan.knots else "")


def _over_time(
    plan: Plan, title: str, unit: str, lines: tuple[Line, ...], columns: int, **more: Any
) -> Chart:
    """A chart over the whole plan's time, as wide as so many beside each other may be."""
    ends = 0.0, plan.duration_s or 1.0
    return Chart(title, lines, "time, s", unit, _wide(columns), PANEL_HEIGHT, x_shown=ends, **more)


def _joint(plan: Plan, limits: Limits, joint: int) -> Panel:
    degrees = np.degrees(plan.joints[:, joint])
    span = max(float(np.ptp(degrees)), LEAST_SPAN_DEG)
    ends = np.degrees(limits.ranges[joint])
    room = (degrees.min() - ends[0], ends[1] - degrees.max())
    near = [distance < NEAR_SPANS * span for distance in room]
    name = JOINT_NAMES[joint]
    line = Line(*charts.thin(plan.t, degrees, POINTS), f"s{joint + 1}")
    levels = tuple(float(end) for end, drawn in zip(ends, near, strict=True) if drawn)
    least = LEAST_SPAN_DEG
    chart = _over_time(plan, name, "degrees", (line,), 3, levels=levels, least_span=least)
    return Panel(name, chart)


def _of_tool(plan: Plan, asked: Floats | None) -> list[Panel]:
    """Speed and acceleration of the tool point, and what the path asks for, dashed."""
    panels = []
    for k, (kind, unit) in enumerate((("speed", "mm/s"), ("acceleration", "mm/s²"))):
        t_s, values = figures.tool_rates(plan)[k]
        lines = [Line(*charts.thin(t_s, values, POINTS), "s1")]
        if asked is not None:
            wanted = np.where(np.isfinite(asked[:, k]), asked[:, k] * 1000.0, np.nan)
            lines.append(Line(*charts.thin(plan.t, wanted, POINTS), "limit"))
        title = f"Tool {kind}"
        panels.append(Panel(title, _over_time(plan, title, unit, tuple(lines), 2, shown=(0.0,))))
    return panels


def _shares(plan: Plan, limits: Limits) -> list[Panel]:
    """Speeds and accelerations of all joints over their limits."""
    panels = []
    for title, (t_s, share) in (
        ("Speed, % of the limit", figures.speed_percent(plan, limits)),
        ("Acceleration, % of the limit", figures.acceleration_percent(plan, limits)),
    ):
        levels = (100.0,) if share.max(initial=0.0) > NEAR_PERCENT else ()
        lines = _of_joints(t_s, share)
        chart = _over_time(plan, title, "%", lines, 2, levels=levels, shown=(0.0,))
        panels.append(Panel(title, chart, JOINT_NAMES))
    return panels


def _of_joints(t_s: Floats, values: Floats) -> tuple[Line, ...]:
    return tuple(
        Line(*charts.thin(t_s, values[:, joint], POINTS), f"s{joint + 1}") for joint in range(9)
    )


def _range_margins(plan: Plan, limits: Limits) -> Panel:
    title = f"Distance from the nearer end of the range, up to {MOST_MARGIN_DEG:g} degrees"
    room = figures.range_margin_deg(plan, limits)
    room = np.where(room <= MOST_MARGIN_DEG, room, np.nan)
    lines = _of_joints(plan.t, room)
    return Panel(title, _over_time(plan, title, "degrees", lines, 1, levels=(0.0,)), JOINT_NAMES)


def _margin(plan: Plan, margin: Margin) -> Panel:
    values = np.where(np.isfinite(margin.values), margin.values, np.nan)
    title = margin.name[0].upper() + margin.name[1:]
    lines = (Line(*charts.thin(plan.t, values, POINTS), "s1"),)
    levels = () if margin.limit is None else (margin.limit,)
    return Panel(title, _over_time(plan, title, margin.unit, lines, 2, levels=levels, shown=(0.0,)))


def _binding(parts: list[str], y: float, plan: Plan, binding: Binding) -> float:
    """A strip over time in the colour of what rules the motion, and how long each does."""
    order = enumerate(binding.shares, start=1)
    colour = {label: min(k, BINDING_COLOURS) for k, (label, _) in order}
    parts.append(charts.text("head", EDGE, y + 14.0, "What binds"))
    x, width = EDGE + 46.0, WIDTH - 2.0 * EDGE - 58.0
    pixels = np.linspace(0.0, plan.duration_s, int(width) + 1)
    middle = (pixels[1:] + pixels[:-1]) / 2.0
    rows = np.minimum(np.searchsorted(plan.t, middle), len(plan.t) - 1)
    begin = 0
    for k in range(1, len(rows) + 1):
        if k < len(rows) and binding.rows[rows[k]] == binding.rows[rows[begin]]:
            continue
        label = binding.rows[rows[begin]]
        box = f'x="{x + begin:g}" y="{y + HEAD:g}" width="{k - begin}" height="22"'
        number = colour.get(label, BINDING_COLOURS)
        parts.append(f'<rect class="f{number}" {box}><title>{safe(label)}</title></rect>')
        begin = k
    for value in charts.ticks(0.0, plan.duration_s, 20):
        along = x + value / plan.duration_s * width
        parts.append(charts.text("tick middle", along, y + HEAD + 35.0, f"{value:g}"))
    at, below = x, y + HEAD + 56.0
    for label, share in binding.shares:
        told = f"{label} {share:.0%}"
        if at + 7.0 * len(told) > WIDTH - EDGE:
            at, below = x, below + 18.0
        parts.append(charts.text(f"note f{colour[label]}", at, below, told))
        at += 16.0 + 7.0 * len(told)
    return below + 22.0
