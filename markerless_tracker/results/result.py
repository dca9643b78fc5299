"""A result on disk: NAME.trc with the 15 markers, NAME.json with everything else.

NAME.subject.yaml holds the sizes of the tracked body, including fitted ones, for the next recording
of the same person.
"""

import math
import platform
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker import __version__
from markerless_tracker.body import MARKER_NAMES, BodyModel, Subject, write_subject
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.datasets import tidy_fps
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.results.appended import not_written
from markerless_tracker.results.journal import Journal
from markerless_tracker.results.target import SUBJECT, earlier_files, path_of, segments
from markerless_tracker.results.target import check_target as check_target
from markerless_tracker.results.trc_stream import TrcStream
from markerless_tracker.tracking import TrackerConfig

_DEPENDENCIES = ("numpy", "numba", "opencv-python-headless", "scipy")
_UNKNOWN_FPS = 60.0
_STEPS = 1000
_MISSING = np.full((len(MARKER_NAMES), 3), np.nan)


class ResultWriter:
    """Writes each result as it comes; also usable as a context manager.

    During a run, NAME.trc has every row so far and NAME.jsonl, the journal, everything else.
    `close` makes NAME.json of the journal and removes the journal. Memory does not grow with the
    frames. Files of an earlier result are kept until the first row comes.

    If a stamp is not later than the one before, NAME.2.trc begins, then NAME.3.trc: the rows of a
    file are in the order of time, and no written row is ever removed. The frames in NAME.json then
    have `segment`, the number of their file. Numbers of files that are there already are passed
    over.

    Args:
        name: path without suffix; the folder is made.
        body: the tracked body; also an attribute, for a tracker that fits it during the run.
        config: the tracker's settings.
        fps: rate of the results, 1/s; None = as the stamps show.
        source: what was tracked: the path of a recording, or `live`.
        overwrite: whether an earlier result of that name may be replaced.
        keep_lost: whether frames in the states LOST and SEARCHING that have an estimate keep it in
            NAME.trc; their rows are blank otherwise. NAME.json has it in any case.

    Attributes:
        trc_path, json_path, journal_path, subject_path: the files.
        frames: frames written.
        not_written: frames that the disk had no room for.

    Raises:
        DatasetError: the files cannot be written, or there is an earlier result or subject file and
            `overwrite` is not set; found out at once.
    """

    def __init__(
        self,
        name: Path,
        body: BodyModel,
        config: TrackerConfig,
        *,
        fps: float | None,
        source: str = "",
        overwrite: bool = True,
        keep_lost: bool = False,
    ) -> None:
        self._name = name
        self._keep_lost = keep_lost
        self.trc_path = path_of(name, ".trc")
        self.json_path = path_of(name, ".json")
        self.journal_path = path_of(name, ".jsonl")
        self.subject_path = path_of(name, SUBJECT)
        self._earlier = earlier_files(name)
        check_target(name, overwrite=overwrite)
        self.body = body
        self.frames, self.not_written = 0, 0
        self._tracked = self._closed = False
        self._config = config
        self._fps = fps
        self._source = source
        self._steps_ns: deque[int] = deque(maxlen=_STEPS)
        self._notes: dict[str, Any] = {}
        self._journal: Journal | None = None
        self._trc: TrcStream | None = None
        self._segment = 1
        self._noted_body: BodyModel | None = None
        self._angles = AngleReader(body)

    def __enter__(self) -> "ResultWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self.close()
        except DatasetError:
            # The first error is more informative.
            if kind is None:
                raise

    def add(self, result: TrackResult) -> None:
        """Write one frame.

        Raises:
            DatasetError: it cannot be written, such as for a full disk. The files hold every frame
                before it, whole, and the next may be tried.
        """
        try:
            self._add(result)
        except DatasetError:
            self.not_written += 1
            raise
        self.frames += 1
        self._tracked = self._tracked or result.state is TrackState.TRACKING

    def note(self, notes: Mapping[str, Any]) -> None:
        """Add entries to the JSON file, such as counts of skipped frames."""
        self._notes.update(notes)

    def close(self) -> None:
        """Complete the files; without any frame an earlier result is kept.

        A second call does nothing.

        Raises:
            DatasetError: a file cannot be completed; the rows and the journal stay as they are.
        """
        if self._closed or (self._journal is None and self._earlier):
            return
        self._closed = True
        journal, trc = self._begun()
        steps: tuple[Callable[[], None], ...] = (
            partial(trc.finish, self._rate()),
            partial(journal.add, self._last_entries()),
            partial(journal.compose, self.json_path),
            self._write_subject,
        )
        failed: DatasetError | None = None
        for finish in steps:
            try:
                finish()
            except DatasetError as error:
                failed = failed or error
        if failed is not None:
            raise failed

    def _add(self, result: TrackResult) -> None:
        journal, trc = self._begun()
        if trc.last_ns is not None:
            if result.stamp_ns > trc.last_ns:
                self._steps_ns.append(result.stamp_ns - trc.last_ns)
            else:
                trc = self._next_segment(trc)
        if self._noted_body is not self.body:
            journal.add(self._body_entry())
            self._noted_body = self.body
            self._angles.take(self.body)
        before = journal.size
        journal.add(_frame(result, self._segment, self._angles))
        try:
            markers_m = result.markers_m
            if markers_m is None or not (self._keep_lost or result.state is TrackState.TRACKING):
                markers_m = _MISSING
            trc.add(result.stamp_ns, markers_m, self._rate())
        except DatasetError:
            journal.cut(before)
            raise

    def _begun(self) -> tuple[Journal, TrcStream]:
        """The files of the run, made with its first frame."""
        if self._journal is None or self._trc is None:
            trc = TrcStream(self.trc_path, MARKER_NAMES, self._rate())
            self._journal, self._trc = Journal(self.journal_path), trc
            self._journal.add(self._summary())
            # From here on readers use the journal.
            self.json_path.unlink(missing_ok=True)
            for path in segments(self._name) if self._earlier else ():
                path.unlink()
        return self._journal, self._trc

    def _next_segment(self, trc: TrcStream) -> TrcStream:
        number = self._segment + 1
        while (path := path_of(self._name, f".{number}.trc")).exists():
            number += 1
        self._trc = TrcStream(path, MARKER_NAMES, self._rate())
        self._segment = number
        self._angles.reset()
        with suppress(DatasetError):
            # Its rows are written; only the final header has not been written.
            trc.finish(self._rate())
        return self._trc

    def _rate(self) -> float:
        """Rate of the results, 1/s; by the stamps, the median of the latest steps."""
        if self._fps is not None:
            return self._fps
        if not self._steps_ns:
            return _UNKNOWN_FPS
        return tidy_fps(1e9 / float(np.median(self._steps_ns)))

    def _write_subject(self) -> None:
        if not self._tracked:
            # No body was fitted; a file of an earlier run would be mistaken for one of this run.
            self.subject_path.unlink(missing_ok=True)
            return
        shapes = zip(self.body.cone_names, self.body.cone_shape, strict=True)
        subject = Subject(
            Path(self._source).name or "tracked",
            dict(self.body.lengths_m),
            dict(shapes),
            self.body.measured,
        )
        try:
            write_subject(self.subject_path, subject)
        except OSError as error:
            raise not_written(self.subject_path, error) from error

    def _last_entries(self) -> dict[str, Any]:
        entries = {**self._body_entry(), **self._notes}
        if self.not_written:
            entries["not_written"] = self.not_written
        return entries

    def _body_entry(self) -> dict[str, Any]:
        return {
            "body": {
                "name": self.body.name,
                "parameters": list(self.body.parameter_names),
                "lengths_m": {k: float(v) for k, v in self.body.lengths_m.items()},
                "cones_m": {
                    name: shape.tolist()
                    for name, shape in zip(self.body.cone_names, self.body.cone_shape, strict=True)
                },
            }
        }

    def _summary(self) -> dict[str, Any]:
        return {
            "source": self._source,
            "seed": self._config.seed,
            "settings": self._config.as_mapping(),
            "versions": versions(),
        }


def _frame(result: TrackResult, segment: int, reader: AngleReader) -> dict[str, Any]:
    """A frame's entry of the JSON file."""
    return {
        "stamp_ns": result.stamp_ns,
        **({"segment": segment} if segment > 1 else {}),
        "state": result.state.value,
        "fitness": result.fitness if math.isfinite(result.fitness) else None,
        "evaluations": result.evaluations,
        "refinements": result.refinements,
        "effort": result.effort,
        "iou": dict(result.iou),
        "exposure": {name: list(gain) for name, gain in result.exposure.items()},
        "parameters": None if result.pose is None else result.pose.tolist(),
        **_angles(result, reader),
        **({"warnings": list(result.warnings)} if result.warnings else {}),
        **_confidence(result),
        **_limbs(result),
    }


def _angles(result: TrackResult, reader: AngleReader) -> dict[str, Any]:
    """Joint angles and their standard deviations by name, degrees (docs/joint-angles.md)."""
    if result.pose is None:
        return {}
    covariance = None if result.confidence is None else result.confidence.covariance
    angles = reader.read(result.pose, result.stamp_ns, covariance)
    entries = {"angles": angles.degrees(), "angles_sd": angles.sd_degrees()}
    return {
        key: {name: round(value, 2) for name, value in values.items()}
        for key, values in entries.items()
        if values is not None
    }


def _confidence(result: TrackResult) -> dict[str, Any]:
    """Standard deviations: of the parameters (m, rad), and per marker along x, y, z (mm)."""
    sure = result.confidence
    if sure is None:
        return {}
    in_mm = np.round(sure.markers_sd_m * 1000.0, 2).tolist()
    return {
        "parameters_sd": np.round(sure.pose_sd, 5).tolist(),
        "markers_sd_mm": dict(zip(MARKER_NAMES, in_mm, strict=True)),
    }


def _limbs(result: TrackResult) -> dict[str, Any]:
    """Per limb its state, its fraction inside the silhouettes, its particle_sd_ratio."""
    if not result.limbs:
        return {}
    limbs = {
        name: {
            "state": limb.state.value,
            "inside_fraction": _rounded(limb.inside_fraction),
            "particle_sd_ratio": _rounded(limb.particle_sd_ratio),
        }
        for name, limb in result.limbs.items()
    }
    return {"limbs": limbs}


def _rounded(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None


def versions() -> dict[str, str]:
    """Versions of Python, this package and what its numbers depend on."""
    found = {"python": platform.python_version(), "markerless_tracker": __version__}
    for name in _DEPENDENCIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
