"""The entries of a result's JSON file for the rows of its marker file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackState
from markerless_tracker.results.journal import read_summary

_WITHOUT_PERSON = (TrackState.LOST.value, TrackState.SEARCHING.value)


@dataclass(frozen=True, eq=False)
class StoredFrames:
    """Rows of a result's marker file, with their entries of its JSON file.

    Attributes:
        track: the markers; rows of frames in the states LOST and SEARCHING are blank.
        markers_sd_mm: (n, m, 3) standard deviations of the markers along x, y, z of the world, mm;
            NaN = unknown.
    """

    track: MarkerTrack
    markers_sd_mm: FloatArray


def stored_frames(path: Path, track: MarkerTrack) -> StoredFrames | None:
    """Frames of the JSON file (or the journal of a run without end) beside a marker file.

    NAME.trc belongs to NAME.json. So does NAME.2.trc, written after time was set back, unless there
    is a NAME.2.json. Frames are matched by stamp.

    Args:
        path: the marker file.
        track: its content.

    Returns:
        None if there is neither file.

    Raises:
        DatasetError: the file is no result of a tracker, or a frame of it is malformed.
    """
    found = summary_of(path)
    if found is None:
        return None
    name, segment = found
    row_of = {stamp: row for row, stamp in enumerate(track.stamps_ns.tolist())}
    column_of = {marker: column for column, marker in enumerate(track.names)}
    sd_mm = np.full(track.positions_m.shape, np.nan)
    blank = np.zeros(len(track), dtype=np.bool_)
    for number, frame in enumerate(read_summary(name)["frames"]):
        where = f"{name}.json: frame {number}"
        row = row_of.get(frame["stamp_ns"])
        if row is None or frame.get("segment", 1) != segment:
            continue
        blank[row] = frame.get("state") in _WITHOUT_PERSON
        deviations = frame.get("markers_sd_mm") or {}
        if not isinstance(deviations, dict):
            raise DatasetError(f"{where}: `markers_sd_mm` is no table of markers")
        for marker in deviations.keys() & column_of.keys():
            sd_mm[row, column_of[marker]] = _deviation(deviations[marker], where, marker)
    positions = np.where(blank[:, None, None], np.nan, track.positions_m)
    return StoredFrames(MarkerTrack(track.names, track.stamps_ns, positions), sd_mm)


def summary_of(path: Path) -> tuple[Path, int] | None:
    """The result's path without suffix, and the number of this marker file.

    None if there is neither NAME.json nor NAME.jsonl.
    """
    name = path.with_suffix("") if path.suffix.lower() == ".trc" else path
    candidates = [(name, 1)]
    number = name.suffix[1:]
    if number.isascii() and number.isdecimal():
        candidates.append((name.with_suffix(""), int(number)))
    for base, segment in candidates:
        if any(base.with_name(base.name + suffix).exists() for suffix in (".json", ".jsonl")):
            return base, segment
    return None


def _deviation(value: Any, where: str, marker: str) -> FloatArray:
    """(3,) standard deviations; None is unknown."""
    try:
        sd = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        sd = np.empty(0)
    if sd.shape != (3,) or (sd < 0).any():
        raise DatasetError(
            f"{where}: `markers_sd_mm` of {marker} is {value!r}, expected three numbers from 0 on"
        )
    return sd
