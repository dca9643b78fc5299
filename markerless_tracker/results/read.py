"""Reads results: NAME.trc and NAME.json together, a chunk at a time."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.datasets.markers.trc import TrcRows
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackState
from markerless_tracker.results.journal import open_summary
from markerless_tracker.results.stored import summary_of
from markerless_tracker.results.stored_result import StoredResult, stored_body

CHUNK_FRAMES = 4096
"""Frames that `ResultReader.chunks` reads at a time."""


def read_result(name: str | Path, *, keep_lost: bool = False) -> StoredResult:
    """A result from its files, as arrays; about 2 kB of memory per frame.

    Args:
        name: NAME of NAME.trc and NAME.json (or NAME.jsonl of a run without end), or NAME.trc;
            NAME.2 is the second part of a result whose time was set back.
        keep_lost: whether frames in the states LOST and SEARCHING keep their estimate.

    Raises:
        DatasetError: a file is missing or malformed.
    """
    return StoredResult.joined(ResultReader(name, keep_lost=keep_lost).chunks())


class ResultReader:
    """Reads a result a chunk of frames at a time: memory does not grow with its length.

    Args:
        name: as for `read_result`.
        keep_lost: as for `read_result`.

    Attributes:
        name: path without suffix.
        summary: every entry of the JSON file but the frames.
        marker_names, parameter_names, angle_names, camera_names: names of the columns.
        fps: rate of the results, 1/s.

    Raises:
        DatasetError: a file is missing or malformed.
    """

    def __init__(self, name: str | Path, *, keep_lost: bool = False) -> None:
        path = Path(name)
        if path.suffix.lower() != ".trc":
            path = path.with_name(path.name + ".trc")
        self._trc_path = path
        self.name = path.with_suffix("")
        found = summary_of(path)
        if found is None:
            raise DatasetError(f"{self.name}.json: no such file, expected a result of `track`")
        self._summary_name, self._segment = found
        self._where = f"{self._summary_name}.json"
        self._keep_lost = keep_lost
        self.summary, frames = open_summary(self._summary_name)
        with TrcRows(path) as rows:
            self.marker_names, self.fps = rows.names, rows.fps
        if not 0.0 < self.fps < math.inf:
            raise DatasetError(f"{path}: DataRate is {self.fps}, expected a number above 0")
        body = self.summary.get("body")
        names = body.get("parameters", []) if isinstance(body, dict) else []
        if not isinstance(names, list):
            raise DatasetError(f"{self._where}: `body.parameters` is {names!r}, expected a list")
        self.parameter_names = tuple(str(parameter) for parameter in names)
        # All frames with a pose have the same angles, or none.
        posed = (frame for frame in frames if frame.get("parameters") is not None)
        first = next(posed, {})
        self.angle_names = tuple(self._table(first, "angles"))
        # A camera may be missing in that frame; the verdict at the end of a run has all of them.
        verdict = self.summary.get("verdict")
        overlap = (verdict.get("overlap") if isinstance(verdict, dict) else None) or {}
        if not isinstance(overlap, dict):
            raise DatasetError(
                f"{self._where}: `verdict.overlap` is {overlap!r}, expected a mapping"
            )
        self.camera_names = tuple(sorted({*overlap, *self._table(first, "iou")}))

    def body(self) -> BodyModel:
        """The tracked body with the person's sizes.

        Raises:
            BodyModelError, DatasetError: the result's body is not described or cannot be loaded.
        """
        return stored_body(self.summary, self._where)

    def chunks(self, size: int = CHUNK_FRAMES) -> Iterator[StoredResult]:
        """Parts of at most `size` frames, in order; one without frames if there is none.

        Raises:
            DatasetError: a row or frame is malformed.
        """
        _, frames = open_summary(self._summary_name)
        with TrcRows(self._trc_path) as rows:
            positions = _Positions(rows)
            part: list[tuple[dict[str, Any], FloatArray]] = []
            empty = True
            for frame in frames:
                if frame.get("segment", 1) != self._segment:
                    continue
                part.append((frame, positions.at(frame["stamp_ns"])))
                if len(part) == size:
                    yield self._part(part)
                    part, empty = [], False
            if part or empty:
                yield self._part(part)

    def _part(self, part: list[tuple[dict[str, Any], FloatArray]]) -> StoredResult:
        frames = [frame for frame, _ in part]
        n, m = len(frames), len(self.marker_names)
        states = np.array([str(frame.get("state", "")) for frame in frames], dtype="U9")
        blank = np.zeros(n, dtype=np.bool_)
        if not self._keep_lost:
            blank = states != TrackState.TRACKING.value
        filled = np.array([bool(frame.get("filled", False)) for frame in frames], dtype=np.bool_)
        blank &= ~filled
        positions = np.array([row for _, row in part], dtype=np.float64).reshape(n, m, 3)
        sd = np.full((n, m, 3), np.nan)
        angles, angles_sd = np.full((2, n, len(self.angle_names)), np.nan)
        overlap = np.full((n, len(self.camera_names)), np.nan)
        parameters, parameters_sd = np.full((2, n, len(self.parameter_names)), np.nan)
        fitness = np.full(n, np.nan)
        for row, frame in enumerate(frames):
            try:
                deviations = self._table(frame, "markers_sd_mm")
                for column, marker in enumerate(self.marker_names):
                    if marker in deviations:
                        sd[row, column] = deviations[marker]
                found = self._table(frame, "angles")
                if found:
                    angles[row] = [_number(found.get(name)) for name in self.angle_names]
                    known = self._table(frame, "angles_sd")
                    angles_sd[row] = [_number(known.get(name)) for name in self.angle_names]
                agreement = self._table(frame, "iou")
                overlap[row] = [_number(agreement.get(name)) for name in self.camera_names]
                self._take_parameters(frame, "parameters", parameters[row])
                self._take_parameters(frame, "parameters_sd", parameters_sd[row])
                fitness[row] = _number(frame.get("fitness"))
            except (TypeError, ValueError, OverflowError) as error:
                raise DatasetError(
                    f"{self._where}: the frame at {frame['stamp_ns']} ns is malformed: {error}"
                ) from error
        for values in (positions, sd, angles, angles_sd, overlap, parameters, parameters_sd):
            values[blank] = np.nan
        return StoredResult(
            source=str(self.summary.get("source", "")),
            fps=self.fps,
            summary=self.summary,
            marker_names=self.marker_names,
            parameter_names=self.parameter_names,
            angle_names=self.angle_names,
            camera_names=self.camera_names,
            stamps_ns=np.array([frame["stamp_ns"] for frame in frames], dtype=np.int64),
            states=states,
            filled=filled,
            fitness=fitness,
            positions_m=positions,
            positions_sd_m=sd / 1000.0,
            parameters=parameters,
            parameters_sd=parameters_sd,
            angles_deg=angles,
            angles_sd_deg=angles_sd,
            overlap=overlap,
            where=self._where,
        )

    def _table(self, frame: dict[str, Any], key: str) -> dict[str, Any]:
        """A frame's values by name; empty if it has none."""
        values = frame.get(key) or {}
        if not isinstance(values, dict):
            raise DatasetError(
                f"{self._where}: `{key}` of the frame at {frame['stamp_ns']} ns is {values!r}, "
                "expected a mapping"
            )
        return values

    def _take_parameters(self, frame: dict[str, Any], key: str, out: FloatArray) -> None:
        """Fill out (p,) with a frame's values, if it has any."""
        values = frame.get(key)
        if values is None:
            return
        if len(values) != out.size:
            raise ValueError(f"`{key}` has {len(values)} values, expected {out.size}")
        out[:] = values


class _Positions:
    """Rows of a marker file by increasing stamp."""

    def __init__(self, rows: TrcRows) -> None:
        self._missing = np.full((len(rows.names), 3), np.nan)
        self._rows = (
            (stamp, row)
            for stamps, positions in rows.chunks()
            for stamp, row in zip(stamps.tolist(), positions, strict=True)
        )
        self._next = next(self._rows, None)

    def at(self, stamp_ns: int) -> FloatArray:
        """(m, 3) positions in m, NaN where the file has no row."""
        while self._next is not None and self._next[0] < stamp_ns:
            self._next = next(self._rows, None)
        if self._next is None or self._next[0] != stamp_ns:
            return self._missing
        row: FloatArray = self._next[1]
        return row


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
