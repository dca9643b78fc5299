"""Composes the page of its sections."""

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from markerless_tracker import __version__
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.gait import METHOD
from markerless_tracker.viewing.page.charts import MOST_POINTS, Curve, Level, Mark, line_chart
from markerless_tracker.viewing.page.report import Report
from markerless_tracker.viewing.page.style import STYLE
from markerless_tracker.viewing.page.tables import (
    dotted,
    figures_table,
    gait_table,
    joints_table,
    mapping_table,
)

FIRST_ANGLES = ("hip_flexion", "knee_angle", "ankle_angle", "arm_flex", "elbow_flex", "lumbar")
"""Prefixes of the angles that are shown first; the others are collapsed."""

_LONG = {
    "clav": "clavicle", "prot": "protraction", "elev": "elevation", "flex": "flexion",
    "add": "adduction", "rot": "rotation", "dev": "deviation", "pro": "pronation,",
    "sup": "supination",
}  # fmt: skip
"""Abbreviations in the angles' names, and their words."""
_SIDES = (("_l", "left"), ("_r", "right"))
_STYLES = 8
_MOST_EVENTS = 50
"""Events of a foot that are listed."""


def write_page(path: Path, reports: Sequence[Report], *, levels: Sequence[Level] = ()) -> None:
    """Write the page.

    Args:
        path: the file; its folder is made.
        reports: the results, in order.
        levels: errors from elsewhere, as lines in the charts of the error.

    Raises:
        DatasetError: it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = page(reports, levels=levels)
        with new_file(path) as sink:
            sink.write(text)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written: {error.strerror}") from error


def page(reports: Sequence[Report], *, levels: Sequence[Level] = ()) -> str:
    """The page as HTML; see `write_page`."""
    title = ", ".join(report.name for report in reports)
    several = len(reports) > 1
    if several:
        articles = "".join(_article(report) for report in reports)
    else:
        articles = _single(reports[0], levels)
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        # Without it browsers request an icon.
        f'<link rel="icon" href="data:,"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body>"
        f"<header><h1>{escape(title)}</h1></header><main>"
        f"{_errors(reports, levels) if several else ''}"
        f"{'<h2>Figures</h2>' + figures_table(reports) if several else ''}"
        f'<div class="results">{articles}</div>'
        f"</main><footer><p>markerless_tracker {escape(__version__)}. Angles: "
        "docs/joint-angles.md; measures: docs/results.md.</p></footer></body></html>\n"
    )


def _single(report: Report, levels: Sequence[Level]) -> str:
    """The article of the only result: film and figures beside each other, then the rest."""
    return (
        f"<article>{_verdict(report)}"
        f'<div class="top"><div>{_film(report)}</div><div>{figures_table([report])}</div></div>'
        f"{_errors([report], levels)}{_parts(report)}</article>"
    )


def _article(report: Report) -> str:
    """The article of one of several results."""
    return (
        f"<article><h2>{escape(report.name)}</h2>{_verdict(report)}{_film(report)}"
        f"{_parts(report)}</article>"
    )


def _verdict(report: Report) -> str:
    found = f'<p class="verdict">{escape(report.sentence())}</p>'
    notes = [*report.verdict.get("doubts", ()), *report.verdict.get("causes", ())]
    items = "".join(f"<li>{escape(str(text))}</li>" for text in notes)
    return f'{found}<ul class="doubts">{items}</ul>' if notes else found


def _parts(report: Report) -> str:
    """Tables and charts of a result."""
    return "".join(
        [
            f'<h3>Joints</h3>{joints_table(report)}<p class="dim">{_joints_words(report)}</p>',
            _angles(report),
            _gait(report),
            _overlap(report),
            _run(report),
        ]
    )


def _joints_words(report: Report) -> str:
    """Explains the columns of the joints' table."""
    sd = "sd: the standard deviation that the tracker itself states, of x, y and z together."
    if report.score is None:
        return sd
    return (
        "Error: distance to the reference. Forward, left, up: its mean offset in the person's "
        f"heading frame; with offsets off, each joint's is subtracted first. {sd}"
    )


def _film(report: Report) -> str:
    film = report.film
    if film is None:
        return f'<p class="dim">No film: {escape(report.why_no_film)}.</p>'
    return (
        '<video controls muted loop playsinline preload="auto" '
        f'src="{_data("video/webm", film.data)}"></video>'
        f'<img class="still" alt="frames of the film" src="{_data("image/jpeg", film.still)}">'
        '<p class="dim">The tracked body over the images: left limbs cyan, right limbs yellow, '
        "dots are joints, ellipses two standard deviations.</p>"
    )


def _errors(reports: Sequence[Report], levels: Sequence[Level]) -> str:
    curves = [
        Curve(
            f"{report.name}: {report.score.mean_mm:.1f} mm" if report.score else "",
            f"s{number % _STYLES}",
            *_with_breaks(report.score.stamps_ns / 1e9, report.score.frame_mm),
        )
        for number, report in enumerate(reports)
        if report.score is not None
    ]
    if not curves:
        return ""
    told = (
        "Dashed: errors that the papers print, on their own recordings with other cameras."
        if levels
        else ""
    )
    return (
        "<h2>Error</h2>"
        + line_chart("Mean error over the joints", "mm", curves, levels=levels, low=0.0)
        + f'<p class="dim">Distance to the reference, mean over the joints of a frame. {told}</p>'
    )


def _with_breaks(times_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and values (n,) with a NaN where frames are missing, so that no line crosses a gap.

    A live result skips sets, so that its usual steps differ; a gap exceeds nine tenths of them.
    """
    if len(times_s) < 2:
        return times_s, values
    steps = np.diff(times_s)
    gaps = np.flatnonzero(steps > 1.5 * np.quantile(steps, 0.9, method="lower")) + 1
    return np.insert(times_s, gaps, times_s[gaps]), np.insert(values, gaps, np.nan)


def _angles(report: Report) -> str:
    """A chart per angle, left and right together."""
    result = report.result
    groups: dict[str, list[Curve]] = {}
    for name, values in zip(result.angle_names, result.angles_deg.T, strict=True):
        base, label, style = name, "", "s0"
        for ending, side in _SIDES:
            if name.endswith(ending):
                base, label, style = name.removesuffix(ending), side, side
        groups.setdefault(base, []).append(
            Curve(label, style, *_with_breaks(result.times_s, _cut(values)))
        )
    if not groups:
        return ""
    marks = _strikes(report)
    charts = {
        base: line_chart(
            _words(base),
            "degrees",
            sorted(curves, key=lambda curve: curve.label),
            marks=marks,
        )
        for base, curves in groups.items()
    }
    order = [base for start in FIRST_ANGLES for base in charts if base.startswith(start)]
    first = [charts[base] for base in order]
    rest = [chart for base, chart in charts.items() if base not in order]
    folded = (
        f"<details><summary>{len(rest)} more angles</summary>"
        f'<div class="charts">{"".join(rest)}</div></details>'
    )
    return (
        f'<h3>Joint angles</h3>{_strikes_words(marks)}<div class="charts">{"".join(first)}</div>'
        f"{folded if rest else ''}"
    )


def _words(angle: str) -> str:
    """An angle's name in words."""
    return " ".join(_LONG.get(word, word) for word in angle.split("_"))


def _cut(values: np.ndarray) -> np.ndarray:
    """Angles with a gap where they jump from 180 to -180 degrees."""
    jumps = np.abs(np.diff(values, prepend=values[:1])) > 300.0
    return np.where(jumps, np.nan, values)


def _strikes(report: Report) -> list[Mark]:
    if report.gait is None:
        return []
    return [Mark(event.side, event.time_s) for event in report.gait.events if event.strike]


def _strikes_words(marks: Sequence[Mark]) -> str:
    """Explains the marks of the charts."""
    if not marks:
        return ""
    if len(marks) > MOST_POINTS:
        return f'<p class="dim">The {len(marks)} foot strikes are too many to be drawn.</p>'
    return '<p class="dim">Dotted: foot strikes, left and right.</p>'


def _gait(report: Report) -> str:
    if report.gait is None:
        return '<p class="dim">Gait: nobody walks for a complete stride.</p>'
    events = report.gait.events
    listed = "; ".join(
        f"{side} foot {'strike' if strike else 'off'}: "
        + _times([e.time_s for e in events if e.side == side and e.strike == strike])
        for side in ("left", "right")
        for strike in (True, False)
        if any(e.side == side and e.strike == strike for e in events)
    )
    return (
        f"<h3>Gait</h3>{gait_table(report.gait.parameters())}"
        f'<p class="dim">Events, s: {escape(listed)}.</p><p class="dim">{escape(METHOD)}. Stride '
        "length: distance of an ankle between two of its strikes, on the floor. Speed: distance "
        "that the pelvis covers on the floor, by the time of the stride.</p>"
    )


def _times(times_s: Sequence[float]) -> str:
    """The first times in words, and the number of those left out."""
    words = [f"{time_s:.2f}" for time_s in times_s[:_MOST_EVENTS]]
    if more := len(times_s) - len(words):
        words.append(f"and {more} more")
    return ", ".join(words)


def _overlap(report: Report) -> str:
    result = report.result
    if not report.overlap:
        return ""
    curves = [
        Curve(
            f"{name}: {report.overlap[name]:.2f}",
            f"s{number % _STYLES}",
            *_with_breaks(result.times_s, result.overlap[:, result.camera_names.index(name)]),
        )
        for number, name in enumerate(report.overlap)
    ]
    return "<h3>Silhouettes</h3>" + line_chart(
        "Overlap (IoU) of each camera's silhouette and the body", "median in the legend", curves
    )


def _run(report: Report) -> str:
    summary = report.result.summary
    settings = dotted(summary.get("settings") or {})
    run = {
        "source": summary.get("source", ""),
        "seed": summary.get("seed", ""),
        **{f"{name}, version": value for name, value in (summary.get("versions") or {}).items()},
    }
    folded = (
        f"<details><summary>{len(settings)} settings</summary>"
        f"{mapping_table(('setting', 'value'), settings)}</details>"
    )
    return f"<h3>Run</h3>{mapping_table(('', ''), run)}{folded if settings else ''}"


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode('ascii')}"
