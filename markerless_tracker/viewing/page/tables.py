"""Tables of the page."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from markerless_tracker.results.gait import Parameter
from markerless_tracker.viewing.page.report import Report


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, kind: str = "wide") -> str:
    """A table; its first column is text, the others are numbers, or text by `kind`."""
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows
    )
    return (
        f'<div class="{kind}"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        "</div>"
    )


def number(value: float | None, digits: int = 1, *, sign: str = "") -> str:
    """A number as text; a dash for None."""
    return "-" if value is None or not math.isfinite(value) else f"{value:{sign}.{digits}f}"


def figures_table(reports: Sequence[Report]) -> str:
    """The figures of all results, one column per result."""
    rows = [("figure", *(report.name for report in reports))]
    rows += [(label, *values) for label, values in _figures(reports)]
    return table(rows[0], rows[1:])


def joints_table(report: Report) -> str:
    """Error and standard deviation of each marker."""
    result, score = report.result, report.score
    sd = np.sqrt((result.positions_sd_m**2).sum(axis=2)) * 1000.0
    rows = []
    for column, name in enumerate(result.marker_names):
        known = sd[np.isfinite(sd[:, column]), column]
        row = [name]
        if score is not None:
            row += _errors(report, name)
        row += [
            number(float(np.median(known)) if known.size else None),
            number(float(np.quantile(known, 0.95)) if known.size else None),
        ]
        rows.append(row)
    errors = (
        ["error, mm", "worst, mm", "forward, mm", "left, mm", "up, mm"] if score is not None else []
    )
    return table(["joint", *errors, "sd, mm (median)", "sd, mm (95 %)"], rows)


def gait_table(parameters: Sequence[Parameter]) -> str:
    """Gait parameters with their spread."""
    return table(
        ["parameter", "mean", "sd", "number"],
        [
            [
                f"{found.name}, {found.unit}",
                number(found.mean, _digits(found)),
                number(found.sd, _digits(found)),
                str(found.count),
            ]
            for found in parameters
            if found.count
        ],
    )


def mapping_table(heading: tuple[str, str], values: Mapping[str, Any]) -> str:
    """Names and values; nested mappings have dotted names."""
    rows = [[name, _plain(value)] for name, value in dotted(values).items()]
    return table(heading, rows, kind="wide words")


def dotted(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A nested mapping by dotted names."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            found.update(dotted(value, f"{prefix}{name}."))
        else:
            found[f"{prefix}{name}"] = value
    return found


def _plain(value: Any) -> str:
    """The value of a setting in the notation of YAML and ROS."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _errors(report: Report, name: str) -> list[str]:
    score = report.score
    if score is None or name not in score.names:
        return ["-"] * 5
    errors = score.joint_mm[:, score.names.index(name)]
    known = errors[np.isfinite(errors)]
    bias = score.bias.get(name, (math.nan,) * 3)
    return [
        number(score.joints[name]),
        number(float(known.max()) if known.size else None),
        *(number(value, sign="+") for value in bias),
    ]


def _digits(found: Parameter) -> int:
    return 0 if found.unit in ("%", "steps/min") else 2


def _figures(reports: Sequence[Report]) -> list[tuple[str, list[str]]]:
    """Label and a text for each result; rows that no result has are left out."""
    rows: list[tuple[str, list[str]]] = [
        ("frames", [str(len(report.result)) for report in reports]),
        ("tracked", [str(report.tracked) for report in reports]),
        ("frames per second", [f"{report.result.fps:g}" for report in reports]),
    ]
    scores = [report.score for report in reports]
    more = [report.measures for report in reports]
    rows += [
        ("mean error, mm", [number(s.mean_mm if s else None) for s in scores]),
        ("worst frame, mm", [number(s.max_mm if s else None) for s in scores]),
        ("mean error of the limbs, mm", [number(s.limbs_mm if s else None) for s in scores]),
        ("mean error, offsets off, mm", [number(s.offsets_off_mm if s else None) for s in scores]),
        ("MPJPE, mm", [number(m.mpjpe_mm if m else None) for m in more]),
        ("PA-MPJPE, mm", [number(m.pa_mpjpe_mm if m else None) for m in more]),
        ("PCK (150 mm)", [number(m.pck if m else None, 3) for m in more]),
        ("frames compared", [str(s.frames) if s else "-" for s in scores]),
        ("sd of a joint, mm", [number(report.sd_mm) for report in reports]),
        ("stature, m", [number(report.verdict.get("stature_m"), 2) for report in reports]),
    ]
    gaits = [report.gait.parameters() if report.gait else () for report in reports]
    named = {found.name: found for found in (*(p for ps in gaits for p in ps),)}
    for name in ("stride length", "cadence", "speed"):
        if name in named:
            values = [{p.name: p for p in parameters}.get(name) for parameters in gaits]
            texts = [number(p.mean, _digits(p)) if p else "-" for p in values]
            rows.append((f"{name}, {named[name].unit}", texts))
    cameras = sorted({name for report in reports for name in report.overlap})
    rows += [
        (f"overlap, {name}", [number(report.overlap.get(name), 2) for report in reports])
        for name in cameras
    ]
    settings = [report.result.summary.get("settings") or {} for report in reports]
    rows += [
        (name, [str(values.get(name, "-")) for values in settings])
        for name in ("preset", "optimizer", "body", "evaluations", "seed")
    ]
    return [(label, texts) for label, texts in rows if any(text != "-" for text in texts)]
