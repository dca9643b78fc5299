"""Subjects: a person's segment lengths and, if known, the sections of the cones."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from markerless_tracker.body.description import BodyDescription, shipped_lengths
from markerless_tracker.body.files import is_number, read_yaml
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray

STATURE_RANGE_M = (0.5, 2.6)
"""Least and largest stature of a person."""


@dataclass(frozen=True)
class Subject:
    """Sizes in metres.

    Attributes:
        name: name in messages and results.
        lengths_m: segment lengths by the names of the body description.
        cones_m: (2, 4) per cone, start and end: radius x, radius y, offset x, offset y. Other
            cones get the description's ratios to their length.
        measured: whether the lengths were measured on the person (not fitted or generic).
    """

    name: str
    lengths_m: Mapping[str, float]
    cones_m: Mapping[str, FloatArray] = field(default_factory=dict)
    measured: bool = True

    def __post_init__(self) -> None:
        for key, value in self.lengths_m.items():
            if not (is_number(value) and 0.0 < value < 3.0):
                raise BodyModelError(
                    f"subject {self.name}: length {key} is {value!r}, "
                    "expected metres between 0 and 3"
                )
        for key, shape in self.cones_m.items():
            if np.shape(shape) != (2, 4) or not np.isfinite(np.asarray(shape, dtype=float)).all():
                raise BodyModelError(
                    f"subject {self.name}: cone {key} is {np.asarray(shape, object).tolist()}, "
                    "expected two rows of "
                    "[radius x, radius y, offset x, offset y] in metres"
                )
            least_m = float(np.min(np.asarray(shape, dtype=float)[:, :2]))
            if least_m <= 0.0:
                raise BodyModelError(
                    f"subject {self.name}: cone {key} has a radius of {least_m:g} m, "
                    "expected more than 0"
                )


def subject_from_stature(description: BodyDescription, stature_m: float) -> Subject:
    """A generic person of a given stature, by the description's fractions of stature.

    Raises:
        BodyModelError: the stature is not between 0.5 and 2.6 m.
    """
    least_m, most_m = STATURE_RANGE_M
    if not least_m <= stature_m <= most_m:
        raise BodyModelError(f"stature is {stature_m} m, expected between {least_m} and {most_m}")
    lengths = {name: float(v["stature"]) * stature_m for name, v in description.lengths.items()}
    return Subject(f"stature {stature_m:g} m", lengths, measured=False)


def subject_from_markers(
    description: BodyDescription, markers_m: Mapping[str, FloatArray]
) -> Subject:
    """Segment lengths from one row of named markers (3,), in m, any frame.

    Left and right lengths (names that begin with ``l_`` and ``r_``) are replaced by their mean,
    since people's sides differ less than markers' positions. A missing Pelvis is the midpoint of
    the hips. A length without markers follows from the stature that the other lengths imply.

    Raises:
        BodyModelError: fewer than half of the lengths can be measured.
    """
    measured = measured_lengths(description, markers_m)
    if 2 * len(measured) < len(description.lengths):
        raise BodyModelError(
            f"{len(measured)} of {len(description.lengths)} segment lengths can be measured from "
            f"markers {', '.join(sorted(markers_m)) or 'none'}, expected at least half"
        )
    return Subject("markers", _completed(description, _both_sides_alike(measured)))


def measured_lengths(
    description: BodyDescription, markers_m: Mapping[str, FloatArray]
) -> dict[str, float]:
    """The lengths (m) for which both markers (3,) are given, left and right separately."""
    known = complete_markers(markers_m)
    measured: dict[str, float] = {}
    for name, entry in description.lengths.items():
        start, end = entry.get("markers", (None, None))
        if start in known and end in known:
            measured[name] = float(np.linalg.norm(known[start] - known[end]))
    return measured


def _both_sides_alike(lengths: Mapping[str, float]) -> dict[str, float]:
    """The lengths, with `l_` and `r_` replaced by their mean where both are known."""
    alike = dict(lengths)
    for name in lengths:
        other = "r_" + name[2:]
        if name.startswith("l_") and other in lengths:
            alike[name] = alike[other] = 0.5 * (lengths[name] + lengths[other])
    return alike


def fitted_lengths(description: BodyDescription, subject: Subject) -> dict[str, float]:
    """A subject's lengths (m) for a body, in the body's order.

    A subject measured for another body may lack lengths (hands, feet) or have additional ones.
    Missing lengths follow from the stature that the others imply.

    Raises:
        BodyModelError: the subject lacks more than half of the lengths, or has one that no body
            has.
    """
    known = {name: float(v) for name, v in subject.lengths_m.items() if name in description.lengths}
    if len(known) < len(subject.lengths_m):
        shipped = shipped_lengths()
        unknown = [str(n) for n in subject.lengths_m if n not in known and n not in shipped]
        if unknown:
            raise BodyModelError(
                f"subject {subject.name}: no body has a length {', '.join(unknown)}, "
                f"{description.name} has {', '.join(description.lengths)}"
            )
    missing = [name for name in description.lengths if name not in known]
    if 2 * len(missing) > len(description.lengths):
        raise BodyModelError(
            f"subject {subject.name}: lengths {', '.join(missing)} of body {description.name} are "
            "missing, expected at least half of them"
        )
    return _completed(description, known)


def _completed(description: BodyDescription, known: Mapping[str, float]) -> dict[str, float]:
    """All lengths; the unknown ones from the median stature that the known ones imply."""
    fractions = {name: float(v["stature"]) for name, v in description.lengths.items()}
    if len(known) == len(fractions):
        return {name: known[name] for name in fractions}
    stature = float(np.median([known[name] / fractions[name] for name in known]))
    return {name: known.get(name, f * stature) for name, f in fractions.items()}


def complete_markers(markers_m: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The finite markers; a missing Pelvis is the midpoint of the hips."""
    known = {
        name: np.asarray(p, dtype=float) for name, p in markers_m.items() if np.isfinite(p).all()
    }
    if "Pelvis" not in known and "LHip" in known and "RHip" in known:
        known["Pelvis"] = 0.5 * (known["LHip"] + known["RHip"])
    return known


def read_subject(path: Path) -> Subject:
    """Read a subject file (YAML: name, lengths_m, optional cones_m and measured).

    Raises:
        BodyModelError: it cannot be read, or has unknown or impossible entries.
    """
    data = read_yaml(path, "subject")
    if not isinstance(data, dict) or not isinstance(data.get("lengths_m"), dict):
        raise BodyModelError(
            f"{path}: expected name, lengths_m and optionally cones_m and measured"
        )
    unknown = sorted(set(map(str, data)) - {"name", "lengths_m", "cones_m", "measured"})
    if unknown:
        raise BodyModelError(f"{path}: unknown entry {', '.join(unknown)}")
    measured = data.get("measured", True)
    if not isinstance(measured, bool):
        raise BodyModelError(f"{path}: measured is {measured!r}, expected true or false")
    shapes = _shapes(data, path)
    try:
        return Subject(str(data.get("name", path.stem)), data["lengths_m"], shapes, measured)
    except BodyModelError as error:
        raise BodyModelError(f"{path}: {error}") from error


def is_subject_file(path: Path) -> bool:
    """Whether a YAML file has the lengths of a subject.

    Raises:
        BodyModelError: it cannot be read.
    """
    data = read_yaml(path, "file")
    return isinstance(data, dict) and "lengths_m" in data


def write_subject(path: Path, subject: Subject) -> None:
    """Write a subject file that `read_subject` reads back exactly."""
    data: dict[str, Any] = {
        "name": subject.name,
        "lengths_m": {name: float(v) for name, v in subject.lengths_m.items()},
    }
    if not subject.measured:
        data["measured"] = False
    if subject.cones_m:
        data["cones_m"] = {name: np.asarray(v).tolist() for name, v in subject.cones_m.items()}
    path.write_text(
        yaml.safe_dump(data, sort_keys=False, default_flow_style=None), encoding="utf-8"
    )


def _shapes(data: dict[str, Any], path: Path) -> dict[str, FloatArray]:
    try:
        return {name: np.array(v, dtype=float) for name, v in (data.get("cones_m") or {}).items()}
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise BodyModelError(
            f"{path}: cones_m must map cones to two rows of four numbers"
        ) from error
