"""Line charts as inline SVG with labels in HTML.

The curves scale with the page (`preserveAspectRatio="none"`) while texts keep their size, so that a
chart is legible on a phone and on paper. Colours are classes of the page's style sheet, so that
they follow its light and dark scheme.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from markerless_tracker.geometry import FloatArray

MOST_POINTS = 600
"""Columns of a curve; in each the smallest and the largest value are drawn."""

_SIDE = 1000.0
_MOST_TICKS = 6


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a chart.

    Attributes:
        label: for the legend.
        style: class of its colour: `left`, `right`, `s0` to `s7`.
        x, y: (n,) points; NaN interrupts the curve.
    """

    label: str
    style: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True)
class Level:
    """A horizontal line at a value, with a label."""

    label: str
    value: float


@dataclass(frozen=True)
class Mark:
    """A vertical line at an x, in a style."""

    style: str
    x: float


def line_chart(
    title: str,
    unit: str,
    curves: Sequence[Curve],
    *,
    levels: Sequence[Level] = (),
    marks: Sequence[Mark] = (),
    low: float | None = None,
) -> str:
    """A chart as HTML (`<figure>`); without finite values a note in place of the curves.

    Args:
        title: heading.
        unit: of y, beside the heading.
        curves: the curves.
        levels: horizontal lines.
        marks: vertical lines; more than `MOST_POINTS` are not drawn.
        low: lower end of y; None = from the values.
    """
    heading = f'{escape(title)} <span class="unit">{escape(unit)}</span>'
    known = [curve for curve in curves if np.isfinite(curve.y).any()]
    if not known:
        return f'<figure class="chart"><figcaption>{heading}</figcaption><p>no values</p></figure>'
    x = np.concatenate([curve.x for curve in known])
    y = np.concatenate([curve.y for curve in known])
    x0, x1 = _range(float(np.nanmin(x)), float(np.nanmax(x)))
    values = [float(np.nanmin(y)), float(np.nanmax(y)), *(level.value for level in levels)]
    y0, y1 = _range(min(values) if low is None else low, max(values))
    y_ticks = ticks(y0, y1)
    x_ticks = [tick for tick in ticks(x0, x1) if x0 - 1e-9 <= tick <= x1 + 1e-9]
    y0, y1 = min(y0, y_ticks[0]), max(y1, y_ticks[-1])

    def across(value: float) -> float:
        return (value - x0) / (x1 - x0)

    def down(value: float) -> float:
        return (y1 - value) / (y1 - y0)

    lines = [_horizontal("grid", down(tick)) for tick in y_ticks]
    lines += [_horizontal("level", down(level.value)) for level in levels]
    if len(marks) <= MOST_POINTS:
        lines += _verticals([mark for mark in marks if x0 <= mark.x <= x1], across)
    for curve in known:
        shown = thinned(curve.x, curve.y)
        lines.append(_path(f"line {curve.style}", _points(shown, across, down)))
    labels = [
        f'<span class="yt" style="top:{100 * down(tick):.2f}%">{_number(tick, y_ticks)}</span>'
        for tick in y_ticks
    ]
    labels += [
        f'<span class="xt" style="left:{100 * across(tick):.2f}%">{_number(tick, x_ticks)}</span>'
        for tick in x_ticks
    ]
    labels += [
        f'<span class="lt" style="top:{100 * down(level.value):.2f}%">{escape(level.label)}</span>'
        for level in levels
    ]
    says = "; ".join(
        f"{curve.label or title}: {np.nanmin(curve.y):.1f} to {np.nanmax(curve.y):.1f} {unit}"
        for curve in known
    )
    return (
        f'<figure class="chart"><figcaption>{heading}{_legend(known)}</figcaption>'
        f'<div class="plot"><svg viewBox="0 0 {_SIDE:g} {_SIDE:g}" preserveAspectRatio="none" '
        f'role="img" aria-label="{escape(f"{title}. {says}")}">{"".join(lines)}</svg>'
        f'{"".join(labels)}<span class="xu">s</span></div>{_levels(levels)}</figure>'
    )


def ticks(low: float, high: float) -> list[float]:
    """Round numbers (steps of 1, 2, 5 times a power of ten) from below `low` to above `high`."""
    rough = (high - low) / _MOST_TICKS
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= rough * 0.999))
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return [float(step * k) for k in np.arange(first, last + 0.5)]


def thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A curve with at most about 2 `MOST_POINTS` points that looks the same.

    A NaN in a gap of x that is wider than a column is kept.
    """
    if x.size <= 2 * MOST_POINTS:
        return x, y
    rows: list[int] = []
    for part in np.array_split(np.arange(x.size), MOST_POINTS):
        values = y[part]
        if np.isfinite(values).any():
            rows += sorted({int(part[np.nanargmin(values)]), int(part[np.nanargmax(values)])})
        else:
            rows.append(int(part[0]))
    gaps = np.isnan(y[1:-1]) & (x[2:] - x[:-2] > (x[-1] - x[0]) / MOST_POINTS)
    rows = sorted({*rows, *(np.flatnonzero(gaps) + 1).tolist()})
    return x[rows], y[rows]


def _range(low: float, high: float) -> tuple[float, float]:
    if high - low > 1e-9 * max(abs(low), abs(high), 1.0):
        return low, high
    return low - 0.5, high + 0.5


def _points(
    points: tuple[FloatArray, FloatArray],
    across: Callable[[float], float],
    down: Callable[[float], float],
) -> str:
    words, pen_down = [], False
    for x, y in zip(points[0].tolist(), points[1].tolist(), strict=True):
        if not (np.isfinite(x) and np.isfinite(y)):
            pen_down = False
            continue
        words.append(f"{'L' if pen_down else 'M'}{_at(across(x))} {_at(down(y))}")
        pen_down = True
    return "".join(words)


def _at(fraction: float) -> str:
    return f"{_SIDE * fraction:.1f}"


def _horizontal(style: str, fraction: float) -> str:
    return _path(style, f"M0 {_at(fraction)}H{_SIDE:g}")


def _verticals(marks: Sequence[Mark], across: Callable[[float], float]) -> list[str]:
    """Vertical lines, one path for each style."""
    drawn: dict[str, str] = {}
    for mark in marks:
        drawn[mark.style] = drawn.get(mark.style, "") + f"M{_at(across(mark.x))} 0V{_SIDE:g}"
    return [_path(f"mark {style}", d) for style, d in drawn.items()]


def _path(style: str, d: str) -> str:
    return f'<path class="{style}" d="{d}"/>'


def _legend(curves: Sequence[Curve]) -> str:
    entries = dict.fromkeys((curve.label, curve.style) for curve in curves if curve.label)
    if not entries:
        return ""
    items = "".join(
        f'<li><span class="key {style}"></span>{escape(label)}</li>' for label, style in entries
    )
    return f'<ul class="legend">{items}</ul>'


def _levels(levels: Sequence[Level]) -> str:
    """The labels of levels as a list, for screens too small for labels beside the curves."""
    if not levels:
        return ""
    items = "".join(
        f'<li><span class="key"></span>{escape(level.label)}</li>'
        for level in sorted(levels, key=lambda level: -level.value)
    )
    return f'<ul class="legend levels">{items}</ul>'


def _number(value: float, all_ticks: Sequence[float]) -> str:
    step = all_ticks[1] - all_ticks[0] if len(all_ticks) > 1 else 1.0
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return f"{value + 0.0:.{digits}f}"
