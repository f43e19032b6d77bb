"""Line charts as SVG text; colours come from the page's or picture's style sheet by class.

Knows numbers and pixels, nothing of robots. Sizes are in the units of the drawing's viewBox.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TypeVar

import numpy as np

from sphmctl.motion import Floats
from sphmctl.pictures import labels

POINTS = 1000
"""Points kept of a line: more than a panel has pixels, and a page of under a megabyte."""

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
"""Leading figures of a tick distance that people read easily."""

MARGIN = 0.06
"""Free share of an axis above and below the data."""

ROOM = 0.12
"""The same where points have labels beside them."""

NOISE = 1e-6
"""Data that spread less stand still, in whatever unit a chart has; they get an axis of length 1."""

SAME_PX = 5.0
"""Points closer together than a dot is wide are one dot."""

LEFT, DIGIT, BESIDE = 46.0, 7.0, 20.0
"""Room left of the frame; of it, a digit's, and what the axis' label takes."""


Number = TypeVar("Number", float, Floats)


@dataclass(frozen=True)
class Line:
    """One line of a chart: NaN in `y` interrupts it; `style` is its class in the style sheet."""

    x: Floats
    y: Floats
    style: str


@dataclass(frozen=True)
class Mark:
    """A labelled point of a chart."""

    x: float
    y: float
    label: str


@dataclass(frozen=True)
class Chart:
    """What to draw.

    Attributes:
        title: read aloud in place of the drawing.
        lines: drawn in this order.
        x_label, y_label: quantity and unit.
        width, height: of the drawing.
        marks: labelled points on top.
        levels: heights of dashed lines: limits.
        shown, x_shown: what the axes include in any case.
        equal: the same scale on both axes, as for a plan view.
        least_span: an axis never shows less than this in y, so that noise does not fill it; where
            both have the same scale, neither in x.
    """

    title: str
    lines: tuple[Line, ...]
    x_label: str
    y_label: str
    width: float = 360.0
    height: float = 190.0
    marks: tuple[Mark, ...] = ()
    levels: tuple[float, ...] = ()
    shown: tuple[float, ...] = ()
    x_shown: tuple[float, ...] = ()
    equal: bool = False
    least_span: float = 0.0


@dataclass(frozen=True)
class _Frame:
    """The plot's rectangle in the drawing, and the data's range in it."""

    left: float
    top: float
    right: float
    bottom: float
    x: tuple[float, float]
    y: tuple[float, float]

    def px(self, x: Number) -> Number:
        low, high = self.x
        return self.left + (x - low) / (high - low) * (self.right - self.left)

    def py(self, y: Number) -> Number:
        low, high = self.y
        return self.bottom - (y - low) / (high - low) * (self.bottom - self.top)


def safe(text: str) -> str:
    """Text for HTML and XML alike, which know neither control characters nor half code points."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return escape("".join(c for c in whole if c >= " " or c in "\t\n"))


def draw(chart: Chart) -> str:
    """The chart as one `<svg>` element."""
    box = f"0 0 {chart.width:g} {chart.height:g}"
    head = f'<svg class="chart" viewBox="{box}" role="img" aria-label="{safe(chart.title)}">'
    return f"{head}\n{_contents(chart)}\n</svg>"


def place(chart: Chart, x: float, y: float) -> str:
    """The chart as a group, for a larger drawing, with its upper left corner at x, y."""
    head = f'<g class="chart" transform="translate({x:g} {y:g})" role="img" '
    return f'{head}aria-label="{safe(chart.title)}">\n{_contents(chart)}\n</g>'


def scale(chart: Chart) -> float:
    """How much of the drawing one unit of x takes."""
    frame = _frame(chart)
    return frame.px(1.0) - frame.px(0.0)


def _contents(chart: Chart) -> str:
    frame = _frame(chart)
    parts = [
        *_axes(chart, frame),
        *(_level(frame, level) for level in chart.levels),
        *(_path(frame, line) for line in chart.lines),
        *_marks(chart, frame),
    ]
    return "\n".join(part for part in parts if part)


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from low to high, evenly apart: at most `most`, or two or three if fewer."""
    raw = (high - low) / max(most - 1, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    steps = [scale * power * step for scale in (0.1, 1.0, 10.0) for step in STEPS[:-1]]
    widest = next(k for k, step in enumerate(steps) if step >= raw * (1 - 1e-9))
    found: list[float] = []
    for step in reversed(steps[: widest + 1]):
        first = math.ceil(low / step - 1e-9)
        last = math.floor(high / step + 1e-9)
        found = [round(k * step, 10) for k in range(first, last + 1)]
        if len(found) > 1:  # one number alone is no scale
            break
    return found


def thin(x: Floats, y: Floats, points: int = POINTS) -> tuple[Floats, Floats]:
    """About `points` of the points: the lowest and highest of each stretch, so that peaks stay."""
    if len(x) <= points:
        return x, y
    width = math.ceil(len(x) / (points // 2))
    begins = np.arange(0, len(x), width)
    padded = np.full(len(begins) * width, np.nan)
    padded[: len(y)] = y
    stretches = padded.reshape(-1, width)
    # A stretch without any value keeps its first point, which interrupts the line.
    lowest = np.where(np.isnan(stretches), np.inf, stretches).argmin(axis=1)
    highest = np.where(np.isnan(stretches), -np.inf, stretches).argmax(axis=1)
    kept = np.unique(np.concatenate([[0, len(x) - 1], begins + lowest, begins + highest]))
    return x[kept], y[kept]


def stride(x: Floats, y: Floats, points: int = POINTS) -> tuple[Floats, Floats]:
    """Every n-th point and the last: for lines that go anywhere, as in a plan view."""
    if len(x) <= points:
        return x, y
    kept = np.append(np.arange(0, len(x) - 1, math.ceil(len(x) / points)), len(x) - 1)
    return x[kept], y[kept]


def _range(
    values: Sequence[Floats], extra: tuple[float, ...], least: float, margin: float
) -> tuple[float, float]:
    joined = np.concatenate([*values, np.asarray(extra, dtype=np.float64)])
    joined = joined[np.isfinite(joined)]
    low, high = (float(joined.min()), float(joined.max())) if joined.size else (0.0, 1.0)
    span = max(high - low if high - low > NOISE else 1.0, least)
    middle = 0.5 * (low + high)
    half = span * (0.5 + margin)
    return middle - half, middle + half


def _frame(chart: Chart) -> _Frame:
    """The frame, with room left of it for the longest number of its scale."""
    frame = _framed(chart, LEFT)
    longest = max(len(_number(value)) for value in _y_ticks(frame))
    return _framed(chart, max(LEFT, BESIDE + DIGIT * longest))


def _framed(chart: Chart, left: float) -> _Frame:
    top, right, bottom = 10.0, chart.width - 12.0, chart.height - 36.0
    room = ROOM if chart.marks else MARGIN
    least = chart.least_span if chart.equal else 0.0
    x = _range([line.x for line in chart.lines], chart.x_shown, least, room if chart.equal else 0.0)
    extra = chart.levels + chart.shown
    margin = room if chart.equal else MARGIN
    y = _range([line.y for line in chart.lines], extra, chart.least_span, margin)
    if chart.equal:
        per_px = max((x[1] - x[0]) / (right - left), (y[1] - y[0]) / (bottom - top))
        x = _widen(x, per_px * (right - left))
        y = _widen(y, per_px * (bottom - top))
    return _Frame(left, top, right, bottom, x, y)


def _widen(span: tuple[float, float], size: float) -> tuple[float, float]:
    middle = 0.5 * (span[0] + span[1])
    return middle - 0.5 * size, middle + 0.5 * size


def _axes(chart: Chart, frame: _Frame) -> list[str]:
    """Grid lines with their numbers, the frame, and what the axes show."""
    parts = []
    for value in _y_ticks(frame):
        y = frame.py(value)
        parts.append(_segment("grid", frame.left, y, frame.right, y))
        parts.append(text("tick end", frame.left - 5, y + 3.5, _number(value)))
    for value in ticks(*frame.x, max(3, int((frame.right - frame.left) / 48))):
        x = frame.px(value)
        parts.append(_segment("grid", x, frame.top, x, frame.bottom))
        parts.append(text("tick middle", x, frame.bottom + 13, _number(value)))
    parts.append(_segment("axis", frame.left, frame.bottom, frame.right, frame.bottom))
    parts.append(_segment("axis", frame.left, frame.top, frame.left, frame.bottom))
    middle = 0.5 * (frame.top + frame.bottom)
    parts.append(text("label end", frame.right, chart.height - 6, chart.x_label))
    parts.append(
        f'<text class="label middle" transform="translate(11 {middle:.1f}) rotate(-90)">'
        f"{safe(chart.y_label)}</text>"
    )
    return parts


def _y_ticks(frame: _Frame) -> list[float]:
    return ticks(*frame.y, max(3, int((frame.bottom - frame.top) / 34)))


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "−")


def _segment(style: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="{style}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def text(style: str, x: float, y: float, words: str) -> str:
    """A line of text that begins, ends or is centred at x, as its style says."""
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}">{safe(words)}</text>'


def _level(frame: _Frame, level: float) -> str:
    return _segment("level", frame.left, frame.py(level), frame.right, frame.py(level))


def _path(frame: _Frame, line: Line) -> str:
    """The line as a path; each gap begins a new stroke, and a lone point becomes a dot."""
    parts: list[str] = []
    pen_down = False
    for x, y in zip(line.x.tolist(), line.y.tolist(), strict=True):
        if math.isfinite(x) and math.isfinite(y):
            point = f"{frame.px(x):.1f} {frame.py(y):.1f}"
            parts.append(f"L{point}" if pen_down else f"M{point}h0")
            pen_down = True
        else:
            pen_down = False
    return f'<path class="line {line.style}" d="{"".join(parts)}"/>' if parts else ""


def _marks(chart: Chart, frame: _Frame) -> list[str]:
    """Dots, each with its label beside it; dots on one place share a label."""
    spots: list[tuple[float, float]] = []
    names: list[list[str]] = []
    for mark in chart.marks:
        x, y = frame.px(mark.x), frame.py(mark.y)
        near = (k for k, (a, b) in enumerate(spots) if math.hypot(a - x, b - y) < SAME_PX)
        index = next(near, len(spots))
        if index == len(spots):
            spots.append((x, y))
            names.append([])
        if mark.label not in names[index]:
            names[index].append(mark.label)
    if not spots:
        return []
    words = [", ".join(labels_here) for labels_here in names]
    ink = [np.stack([frame.px(line.x), frame.py(line.y)], axis=1) for line in chart.lines]
    room = (frame.left + 2.0, frame.top, frame.right, frame.bottom - 2.0)
    centres = labels.settle(np.array(spots), words, ink, room)
    return [
        *(f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3.2"/>' for x, y in spots),
        *(
            text("mark middle", x, y + 4.5, said)
            for (x, y), said in zip(centres.tolist(), words, strict=True)
        ),
    ]
