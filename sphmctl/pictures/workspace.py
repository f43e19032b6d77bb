"""A workspace as one SVG: clouds in space, cuts by the plane, what can be pointed where.

In the manner of Elsamanty et al., Appl. Sci. 2023, 13, 2088, Figures 6 to 9, arm alone on the left,
hybrid on the right. Light and dark.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sphmctl.motion import Floats
from sphmctl.pictures import charts
from sphmctl.pictures.charts import Chart, Line, Mark, safe
from sphmctl.pictures.plot import EDGE, GAP, WIDTH
from sphmctl.pictures.plot import STYLE as PLOT_STYLE
from sphmctl.robots.sphm.workspace import Survey
from sphmctl.robots.sphm.workspace_capability import Capability, lean, share
from sphmctl.robots.sphm.workspace_robot import Bools
from sphmctl.robots.sphm.workspace_sampling import in_space
from sphmctl.robots.sphm.workspace_slices import Grid, Slice, cells

SPACE_DOTS, PLANE_DOTS = 7000, 8000
"""Samples drawn, those in space less the ones that collide: enough to fill a panel, and a picture
of less than a megabyte."""

OUTLINE_CELL_M = 0.004
"""Of the grid whose steps draw an outline: less than a pixel."""

PANEL_WIDTH, PANEL_HEIGHT = 530.0, 480.0
HEAD, KEY = 24.0, 18.0
"""Above a panel, for its title and for what its colours mean."""
KEY_PX, LETTER_PX = 10.0, 5.8
"""A key's patch, and what a letter beside it takes on average."""

AZIMUTH_RAD, ELEVATION_RAD = float(np.radians(-50.0)), float(np.radians(22.0))
"""Where the clouds are looked at from: from the front, a little from the right, and from above."""

AXES_M = 1.2
BANDS = 5
"""Colours of height in the clouds, and steps of the maps."""

HEIGHTS_MM = (-100, 300, 700, 1100)
"""Where one colour of the clouds ends and the next begins."""

LEAN_STEPS_DEG = (0, 15, 30, 60, 90)
"""From where each step of the map of leans begins."""

STYLE = (
    PLOT_STYLE
    + """
.dots { stroke-width: 1.6; opacity: .5; } .outline { stroke-width: 1.6; }
.beyond { stroke: var(--c2); } .alone { stroke: var(--c1); } .soft { stroke: var(--soft); }
.cell { stroke: var(--c3); stroke-linecap: square; stroke-width: var(--cell); }
.key { stroke-width: 10; opacity: .8; }
"""
    + "\n".join(f".m{k} {{ opacity: {0.15 + 0.2 * k:.2f}; }}" for k in range(BANDS))
)


def picture(survey: Survey, map_: Capability, notes: tuple[str, ...]) -> str:
    """The picture's text; `notes` are lines of figures below the title."""
    name = "axis 1 at 0" if survey.plane == "a1_0" else "axis 1 at −90 and 90 degrees"
    title = f"Workspace of the arm and of the hybrid, {name}"
    parts = [charts.text("title", EDGE, 40.0, title)]
    y = 62.0
    for note in notes:
        parts.append(charts.text("note", EDGE, y, note))
        y += 19.0
    cloud = survey.cloud
    arm, hybrid = cloud.flange_m[cloud.arm_free], cloud.point_m[cloud.free]
    arm_spun, hybrid_spun = in_space(survey.robot, cloud, SPACE_DOTS)
    rows = [
        [
            _space("Arm alone: samples in space", arm_spun),
            _space("Hybrid: samples in space", hybrid_spun),
        ],
        [
            _cut("Arm alone: samples and cut", survey, arm, (survey.arm_cut,)),
            _cut("Hybrid: samples and cut", survey, hybrid, (survey.hybrid_cut, survey.arm_cut)),
        ],
        _maps(survey, map_),
        _leans(survey, map_),
    ]
    for row in rows:
        for column, panel in enumerate(row):
            x = EDGE + column * (PANEL_WIDTH + GAP)
            parts.append(charts.text("head", x, y + 14.0, panel.chart.title))
            parts += _key(panel.key, x, y + HEAD + 8.0)
            parts.append(f'<g style="--cell: {_cell_px(panel.chart, map_.grid):.2f}px">')
            parts += [charts.place(panel.chart, x, y + HEAD + KEY), "</g>"]
        y += HEAD + KEY + PANEL_HEIGHT + 10.0
    size = f'width="{WIDTH:g}" height="{y:g}" viewBox="0 0 {WIDTH:g} {y:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    page = f'<rect class="page" width="{WIDTH:g}" height="{y:g}"/>'
    about = f"<title>{safe(title)}</title>"
    return "\n".join([head, about, f"<style>{STYLE}</style>", page, *parts, "</svg>\n"])


@dataclass(frozen=True)
class Panel:
    """A chart, and its key: the style of each kind of dot, cell or line, and what it means."""

    chart: Chart
    key: tuple[tuple[str, str], ...]


def _key(entries: tuple[tuple[str, str], ...], x: float, y: float) -> list[str]:
    """Patches with their meaning in a row from x on; lines as short strokes."""
    parts = []
    for style, meaning in entries:
        line = style.startswith("outline")
        end, shape = (KEY_PX, style) if line else (0.0, f"{style} key")
        start = x if line else x + KEY_PX / 2.0
        parts.append(f'<path class="line {shape}" d="M{start:.1f} {y:.1f}h{end:g}"/>')
        parts.append(charts.text("tick", x + KEY_PX + 5.0, y + 3.5, meaning))
        x += KEY_PX + 18.0 + LETTER_PX * len(meaning)
    return parts


def _space(head: str, point_m: Floats) -> Panel:
    """A cloud (n, 3) seen from aside, by height."""
    band = np.digitize(1e3 * point_m[:, 2], HEIGHTS_MM)
    seen = _seen(point_m.T)
    lines = [_dots(seen[:, band == k], f"dots s{5 - k}") for k in range(BANDS) if (band == k).any()]
    tips = AXES_M * np.eye(3)
    marks = []
    for (across, up), name in zip((_seen(tips) * 1e3).T.tolist(), "xyz", strict=True):
        lines.append(Line(np.array([0.0, across]), np.array([0.0, up]), "outline soft"))
        marks.append(Mark(across, up, name))
    ends = [f"{edge}".replace("-", "−") for edge in HEIGHTS_MM]
    between = [f"{low} to {high}" for low, high in pairwise(ends)]
    names = f"z below {ends[0]}", *between, f"above {ends[-1]} mm"
    return Panel(
        _chart(head, tuple(lines), "across the view, mm", "up the view, mm", tuple(marks)),
        tuple((f"dots s{5 - k}", name) for k, name in enumerate(names)),
    )


def _seen(xyz: Floats) -> Floats:
    """Points (3, n) across and up in the view, (2, n)."""
    ca, sa, ce, se = (f(a) for a in (AZIMUTH_RAD, ELEVATION_RAD) for f in (np.cos, np.sin))
    x, y, z = xyz
    return np.stack([-sa * x + ca * y, ce * z - se * (ca * x + sa * y)])


def _cut(head: str, survey: Survey, point_m: Floats, cuts: tuple[Slice, ...]) -> Panel:
    some = point_m[:PLANE_DOTS]  # samples come in no order
    grid = survey.grid(OUTLINE_CELL_M)
    styles = ("outline alone",) if len(cuts) == 1 else ("outline beyond", "outline alone")
    lines = [_dots(some.T, "dots soft")]
    lines += [
        _outline(cells(cut, survey.plane, grid), grid, style)
        for cut, style in zip(cuts, styles, strict=True)
    ]
    names = ("the hybrid's cut", "the arm's cut")[-len(cuts) :]
    key = ("dots soft", "samples free of collisions"), *zip(styles, names, strict=True)
    return Panel(_chart(head, tuple(lines), _across(survey), "z, mm"), key)


def _outline(inside: Bools, grid: Grid, style: str) -> Line:
    """The edges between cells inside and outside, each run of them as one stroke."""
    strokes = []
    for turned in (False, True):
        area = inside.T if turned else inside
        along, over = (grid.z_m, grid.horizontal_m) if turned else (grid.horizontal_m, grid.z_m)
        edge = area[:, 1:] != area[:, :-1]
        for row in np.flatnonzero(edge.any(axis=0)):
            jumps = np.diff(np.concatenate([[0], edge[:, row].astype(np.int8), [0]]))
            at = over[row] + grid.cell_m / 2.0
            half = grid.cell_m / 2.0
            for first, after in zip(
                np.flatnonzero(jumps == 1), np.flatnonzero(jumps == -1), strict=True
            ):
                ends = [along[first] - half, along[after - 1] + half, np.nan]
                level = [at, at, np.nan]
                strokes.append([level, ends] if turned else [ends, level])
    x, y = np.concatenate(strokes, axis=1) * 1e3 if strokes else np.full((2, 1), np.nan)
    return Line(x, y, style)


def _maps(survey: Survey, map_: Capability) -> list[Panel]:
    """How much of all directions in the plane can be pointed to."""
    panels = []
    for name, reached in (("Arm alone", map_.arm), ("Hybrid", map_.hybrid)):
        value = np.where(reached.any(axis=-1), share(reached), np.nan)
        band = np.minimum(np.floor(value * BANDS), BANDS - 1)
        head = f"{name}: how many of all directions can be pointed to"
        ends = [f"{100 * k // BANDS} to {100 * (k + 1) // BANDS} %" for k in range(BANDS)]
        panels.append(_mapped(survey, map_.grid, head, band, ends))
    return panels


def _leans(survey: Survey, map_: Capability) -> list[Panel]:
    """How far one may lean from straight down."""
    panels = []
    for name, reached in (("Arm alone", map_.arm), ("Hybrid", map_.hybrid)):
        angle = np.degrees(lean(reached))
        band = np.where(np.isnan(angle), np.nan, np.digitize(angle + 1e-9, LEAN_STEPS_DEG) - 1.0)
        head = f"{name}: how far one may lean from straight down"
        ends = [f"{low} to {high}°" for low, high in pairwise((*LEAN_STEPS_DEG, 180))]
        panels.append(_mapped(survey, map_.grid, head, band, ends))
    return panels


def _mapped(survey: Survey, grid: Grid, head: str, band: Floats, names: list[str]) -> Panel:
    """Cells in steps of these names."""
    lines = []
    for k in range(BANDS):
        column, row = np.nonzero(band == k)
        places = np.stack([grid.horizontal_m[column], grid.z_m[row]])
        lines.append(_dots(places, f"cell m{k}"))
    edge = _outline(
        cells(survey.hybrid_cut, survey.plane, survey.grid(OUTLINE_CELL_M)),
        survey.grid(OUTLINE_CELL_M),
        "outline soft",
    )
    key = tuple((f"cell m{k}", name) for k, name in enumerate(names))
    return Panel(_chart(head, (*lines, edge), _across(survey), "z, mm"), key)


def _dots(place_m: Floats, style: str) -> Line:
    """Points (2, n) as lone points of a line, which charts draws as dots."""
    x, y = np.full((2, 2 * place_m.shape[1]), np.nan)
    x[::2], y[::2] = place_m * 1e3
    return Line(x, y, style)


def _across(survey: Survey) -> str:
    return "x, mm" if survey.plane == "a1_0" else "y, mm"


def _chart(
    title: str, lines: tuple[Line, ...], x: str, y: str, marks: tuple[Mark, ...] = ()
) -> Chart:
    return Chart(title, lines, x, y, PANEL_WIDTH, PANEL_HEIGHT, marks, equal=True)


def _cell_px(chart: Chart, grid: Grid) -> float:
    """How wide a map's cell is in a chart."""
    return grid.cell_m * 1e3 * charts.scale(chart)
