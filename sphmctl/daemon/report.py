"""The page that a run leaves behind: required against measured, figures, table, events.

One file that needs nothing else: no script, no font, no address. The joints over time are Figure 15
of Elsamanty et al., Appl. Sci. 2023, 13, 2088, the table of named points is its Table 6.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from sphmctl.daemon.assess import PointResult, Skew, SkewTrace, Tracking
from sphmctl.daemon.report_style import STYLE
from sphmctl.motion import JOINT_NAMES, Floats
from sphmctl.pictures import charts
from sphmctl.pictures.charts import Chart, Line, Mark, safe

JOINT_SPAN_DEG = 2.0
"""A joint's panel never shows less, deg: a standing joint shall look still, not noisy."""

POSE_NAMES = ("x mm", "y mm", "z mm", "A °", "B °", "C °")

OUTCOMES = {"completed": "good", "stopped": "bad", "faulted": "bad"}
"""What a run's outcome can be, and how it is coloured."""


@dataclass(frozen=True)
class Limits:
    """What a run is held to: the acceptance figures of the octagon on the emulated cell."""

    tcp_mm: float = 1.0
    skew_p99_ms: float = 10.0
    share_counted: float = 0.4
    crank_error_deg: float = 0.5


@dataclass(frozen=True)
class Event:
    """Something that happened: time since the run began (s), how bad, and what."""

    t_s: float
    level: str
    text: str


@dataclass(frozen=True)
class Trace:
    """Skew and crank error over the time of the run, from the emulated machine's true joints."""

    t_s: Floats
    skew: SkewTrace


@dataclass(frozen=True)
class ReportInput:
    """All that the page shows.

    Attributes:
        name: the path's name.
        started: when, as the reader shall see it.
        outcome: "completed", "stopped" or "faulted".
        cause: why it did not complete, one sentence; empty when it did.
        emulated: whether the devices were emulated.
        planned_s: duration of the plan.
        t_s: time of each measured row, shape (m,).
        required_deg, measured_deg: nine joints of each row, shape (m, 9).
        tool_required_mm, tool_reached_mm: tool points in the path's base frame, (n, 3) and (m, 3).
        skew, trace: None without the true joints, as on a real cell.
        files: names of the files beside the page.
    """

    name: str
    started: str
    outcome: str
    cause: str
    emulated: bool
    duration_s: float
    planned_s: float
    t_s: Floats
    required_deg: Floats
    measured_deg: Floats
    tool_required_mm: Floats
    tool_reached_mm: Floats
    tracking: Tracking
    points: tuple[PointResult, ...]
    skew: Skew | None = None
    trace: Trace | None = None
    notes: tuple[str, ...] = ()
    events: tuple[Event, ...] = ()
    files: tuple[str, ...] = ()
    limits: Limits = Limits()


@dataclass(frozen=True)
class _Figure:
    """A key figure; `ok` is None where nothing limits it."""

    name: str
    value: str
    limit: str = ""
    ok: bool | None = None


def write_report(path: Path, run: ReportInput) -> None:
    """Write the page in one step, so that no half page is ever there."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(page(run), encoding="utf-8")
    os.replace(draft, path)


def page(run: ReportInput) -> str:
    """The page as HTML that is also well-formed XML."""
    figures = _figures(run)
    sections = [
        _header(run, figures),
        _cards(figures),
        _joints(run),
        _paths(run),
        _points(run.points),
        _list("Notes of the plan", run.notes, "The plan has no notes."),
        _events(run.events),
        _files(run.files),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f"<title>{safe(run.name)}: {safe(run.outcome)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{''.join(sections)}"
        "<footer>Written by sphmctl. Angles in degrees, lengths in mm, A, B, C as KUKA turns: "
        "Rz(A) Ry(B) Rx(C).</footer>\n</main>\n</body>\n</html>\n"
    )


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{safe(title)}</h2>\n{body}</section>\n"


def _header(run: ReportInput, figures: list[_Figure]) -> str:
    banner = '<p class="banner">EMULATED: no robot has moved.</p>\n' if run.emulated else ""
    style = OUTCOMES.get(run.outcome, "bad")
    return (
        f"{banner}<header><h1>{safe(run.name)}</h1>"
        f'<span class="badge {style}">{safe(run.outcome)}</span>'
        f'<span class="when">{safe(run.started)}</span></header>\n'
        f'<p class="verdict">{safe(_verdict(run, figures))}</p>\n'
    )


def _verdict(run: ReportInput, figures: list[_Figure]) -> str:
    """What happened and whether it was good, in one or two sentences."""
    if run.outcome != "completed":
        return run.cause or f"The run was {run.outcome} after {run.duration_s:.1f} s."
    over = [figure.name for figure in figures if figure.ok is False]
    if over:
        return f"The path was followed to its end. Outside its limit: {', '.join(over)}."
    return "The path was followed to its end, with every figure inside its limit."


def _figures(run: ReportInput) -> list[_Figure]:
    limits, tracking, skew = run.limits, run.tracking, run.skew
    figures = [
        _Figure("Duration", f"{run.duration_s:.2f} s", f"planned {run.planned_s:.2f} s"),
        _bounded("Tool off the path, at most", tracking.max_tcp_mm, "mm", limits.tcp_mm),
        _bounded("Joint off the path, at most", tracking.max_joint_deg, "°", None),
    ]
    if skew is None:
        return figures
    share = 100.0 * skew.share_counted
    return [
        *figures,
        _bounded("Skew, median", skew.p50_ms, "ms", None),
        _bounded("Skew, 99 %", skew.p99_ms, "ms", limits.skew_p99_ms),
        _bounded("Skew, largest", skew.max_ms, "ms", None),
        _Figure(
            "Instants counted for skew",
            f"{share:.0f} %",
            f"limit: at least {100.0 * limits.share_counted:.0f} %",
            skew.share_counted >= limits.share_counted,
        ),
        _bounded("Crank error, at most", skew.max_crank_error_deg, "°", limits.crank_error_deg),
    ]


def _bounded(name: str, value: float | None, unit: str, limit: float | None) -> _Figure:
    space = "" if unit == "°" else " "
    text = "none" if value is None else f"{value:.2f}{space}{unit}"
    if limit is None:
        return _Figure(name, text)
    ok = None if value is None else value <= limit
    return _Figure(name, text, f"limit: {limit:g}{space}{unit}", ok)


def _cards(figures: list[_Figure]) -> str:
    cards = []
    for figure in figures:
        sign = {None: "", True: " ✓ inside", False: " ✗ outside"}[figure.ok]
        style = {None: "", True: " good", False: " bad"}[figure.ok]
        cards.append(
            f'<div class="card"><span class="name">{safe(figure.name)}</span>'
            f'<span class="value{style}">{safe(figure.value)}</span>'
            f'<span class="limit">{safe(figure.limit)}<span class="{style.strip()}">{sign}</span>'
            "</span></div>"
        )
    return _section("Key figures", f'<div class="figures">{"".join(cards)}</div>\n')


def _joints(run: ReportInput) -> str:
    """Figure 15 of the paper: nine joints over time."""
    panels = []
    for j, name in enumerate(JOINT_NAMES):
        required = charts.thin(run.t_s, run.required_deg[:, j])
        measured = charts.thin(run.t_s, run.measured_deg[:, j])
        chart = Chart(
            f"{name} over time, required and measured",
            (Line(*required, "required"), Line(*measured, "measured")),
            "time, s",
            "degrees",
            least_span=JOINT_SPAN_DEG,
        )
        worst = np.abs(run.measured_deg[:, j] - run.required_deg[:, j]).max(initial=0.0)
        head = f'<h3>{name} <span class="aside">at most {worst:.2f}° apart</span></h3>'
        panels.append(f'<div class="card">{head}{charts.draw(chart)}</div>\n')
    legend = (
        '<div class="legend"><span class="required">required: the plan where the arm is</span>'
        '<span class="measured">measured</span></div>\n'
    )
    return _section(
        "Joints over time, required against measured (Figure 15)",
        f'{legend}<div class="panels">{"".join(panels)}</div>\n',
    )


def _paths(run: ReportInput) -> str:
    """The tool's path from above and, where the truth is known, skew over time."""
    marks = tuple(Mark(p.required[0], p.required[1], p.name) for p in run.points)
    required, reached = run.tool_required_mm, run.tool_reached_mm
    top = Chart(
        "Tool path from above, required and reached",
        (
            Line(*charts.stride(required[:, 0], required[:, 1]), "required"),
            Line(*charts.stride(reached[:, 0], reached[:, 1]), "measured"),
        ),
        "x, mm",
        "y, mm",
        width=560.0,
        height=470.0,
        marks=marks,
        equal=True,
    )
    legend = (
        '<div class="legend"><span class="required">required</span>'
        '<span class="measured">reached</span></div>'
    )
    card = f'<div class="card"><h3>Tool path from above</h3>{legend}{charts.draw(top)}</div>\n'
    column = "" if run.trace is None else f"<div>{_skew(run.trace, run.limits)}</div>\n"
    return _section("Tool path and timing", f'<div class="pair">{card}{column}</div>\n')


def _skew(trace: Trace, limits: Limits) -> str:
    """Skew and the three crank errors over time, from the true joints."""
    late = Chart(
        "Skew over time",
        (Line(*charts.thin(trace.t_s, trace.skew.skew_ms), "measured"),),
        "time, s",
        "ms",
        width=560.0,
        levels=(limits.skew_p99_ms,),
        shown=(0.0,),
    )
    errors = trace.skew.crank_error_deg
    styles = ("measured", "second", "third")
    error = Chart(
        "Crank errors over time",
        tuple(Line(*charts.thin(trace.t_s, errors[:, i]), styles[i]) for i in range(3)),
        "time, s",
        "degrees",
        width=560.0,
        levels=(-limits.crank_error_deg, limits.crank_error_deg),
    )
    return (
        '<div class="card"><h3>Skew between wrist and arm, where it counts</h3>'
        '<div class="legend"><span class="measured">skew</span>'
        f'<span class="level">limit of the 99 % value</span></div>{charts.draw(late)}</div>\n'
        '<div class="card below"><h3>Crank errors, true less planned</h3>'
        '<div class="legend"><span class="measured">theta7</span><span class="second">theta8</span>'
        f'<span class="third">theta9</span><span class="level">limit</span></div>'
        f"{charts.draw(error)}</div>"
    )


def _points(points: tuple[PointResult, ...]) -> str:
    """Table 6 of the paper: named points, required and reached."""
    if not points:
        return _section("Named points (Table 6)", '<p class="soft">The path names no points.</p>\n')
    names = "".join(
        f"<th{_first(i)}>{name}</th>"
        for i, name in enumerate((*POSE_NAMES, *POSE_NAMES, "mm", "°"))
    )
    head = (
        '<thead><tr><th></th><th colspan="6" class="first">required</th>'
        '<th colspan="6" class="first">reached</th><th colspan="2" class="first">error</th></tr>'
        f"<tr><th>point</th>{names}</tr></thead>"
    )
    rows = "".join(_point_row(point) for point in points)
    return _section(
        "Named points, required against reached (Table 6)",
        f'<div class="card scroll"><table>{head}<tbody>{rows}</tbody></table></div>\n',
    )


def _first(column: int) -> str:
    return ' class="first"' if column in (0, 6, 12) else ""


def _point_row(point: PointResult) -> str:
    cells = [f"{value:.2f}" for value in point.required]
    if point.reached is None or point.position_error_mm is None or point.angle_error_deg is None:
        end = '<td colspan="8" class="first text bad">not reached</td>'
    else:
        cells += [f"{value:.2f}" for value in point.reached]
        cells += [f"{point.position_error_mm:.2f}", f"{point.angle_error_deg:.2f}"]
        end = ""
    body = "".join(f"<td{_first(i)}>{_signed(cell)}</td>" for i, cell in enumerate(cells))
    return f"<tr><th>{safe(point.name)}</th>{body}{end}</tr>\n"


def _signed(cell: str) -> str:
    """No minus before a zero, and a real minus elsewhere."""
    return cell.lstrip("-") if float(cell) == 0.0 else cell.replace("-", "−")


def _list(title: str, items: Iterable[str], none: str) -> str:
    entries = "".join(f"<li>{safe(item)}</li>\n" for item in items)
    return _section(
        title, f"<ul>\n{entries}</ul>\n" if entries else f'<p class="soft">{none}</p>\n'
    )


def _events(events: tuple[Event, ...]) -> str:
    if not events:
        return _section("Events", '<p class="soft">No faults and no warnings.</p>\n')
    rows = "".join(
        f'<tr><th>{event.t_s:.3f} s</th><td class="text{_level(event.level)}">'
        f'{safe(event.level)}</td><td class="text">{safe(event.text)}</td></tr>\n'
        for event in events
    )
    return _section(
        "Events",
        f'<div class="card scroll"><table class="events"><tbody>{rows}</tbody></table></div>\n',
    )


def _level(level: str) -> str:
    return " bad" if level in ("error", "critical", "fault") else ""


def _files(files: tuple[str, ...]) -> str:
    links = "".join(f'<li><a href="{quote(name)}">{safe(name)}</a></li>\n' for name in files)
    return _section("Files beside this page", f"<ul>\n{links}</ul>\n") if links else ""
