"""A result on disk: NAME.trc with the 15 markers, NAME.json with everything else.

NAME.subject.yaml holds the sizes of the tracked body, fitted ones included, for the next recording
of the same person.
"""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker import __version__
from markerless_tracker.body import MARKER_NAMES, BodyModel, Subject, write_subject
from markerless_tracker.datasets import MarkerTrack, write_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking import TrackerConfig

_DEPENDENCIES = ("numpy", "numba", "opencv-python-headless", "scipy")


class ResultWriter:
    """Collects results and writes them when closed; also usable as a context manager.

    Args:
        name: path without suffix; NAME.trc, NAME.json and, if a frame was tracked,
            NAME.subject.yaml are written, their folder is made.
        body: the tracked body; also an attribute, for a tracker that fits it on the way.
        config: the tracker's settings.
        fps: rate of the results, 1/s.
        source: what was tracked, for the reader of the JSON file.

    Raises:
        DatasetError: the folder cannot be made or written to; found out at once.
    """

    def __init__(
        self, name: Path, body: BodyModel, config: TrackerConfig, *, fps: float, source: str = ""
    ) -> None:
        self.trc_path = name.with_name(name.name + ".trc")
        self.json_path = name.with_name(name.name + ".json")
        self.subject_path = name.with_name(name.name + ".subject.yaml")
        try:
            name.parent.mkdir(parents=True, exist_ok=True)
            self.json_path.write_text("{}\n", encoding="utf-8")
        except OSError as error:
            raise DatasetError(f"{self.json_path}: cannot be written: {error.strerror}") from error
        self.body = body
        self._config = config
        self._fps = fps
        self._source = source
        self._results: list[TrackResult] = []
        self._notes: dict[str, Any] = {}
        write_trc(self.trc_path, self.track(), fps)

    def __enter__(self) -> "ResultWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, result: TrackResult) -> None:
        """Take one frame; a frame that is not later than the last replaces all from its time on."""
        while self._results and self._results[-1].stamp_ns >= result.stamp_ns:
            self._results.pop()
        # Evidence is large and not written.
        self._results.append(replace(result, observations={}))

    def note(self, notes: Mapping[str, Any]) -> None:
        """Add entries to the JSON file, such as counts of skipped frames."""
        self._notes.update(notes)

    def close(self) -> None:
        """Write the files.

        Raises:
            DatasetError: a file cannot be written.
        """
        write_trc(self.trc_path, self.track(), self._fps)
        try:
            self.json_path.write_text(
                json.dumps(self._summary(), indent=1) + "\n", encoding="utf-8"
            )
            if any(r.state is TrackState.TRACKING for r in self._results):
                write_subject(self.subject_path, self._subject())
            else:
                # Nobody was measured; a file of an earlier run would pass for this one's.
                self.subject_path.unlink(missing_ok=True)
        except OSError as error:
            raise DatasetError(f"{error.filename}: cannot be written: {error.strerror}") from error

    def track(self) -> MarkerTrack:
        """The markers so far; frames without an estimate are rows without markers."""
        missing = np.full((len(MARKER_NAMES), 3), np.nan)
        rows = [missing if r.markers_m is None else r.markers_m for r in self._results]
        return MarkerTrack(
            MARKER_NAMES,
            np.array([r.stamp_ns for r in self._results], dtype=np.int64),
            np.array(rows).reshape(len(rows), len(MARKER_NAMES), 3),
        )

    def _subject(self) -> Subject:
        shapes = zip(self.body.cone_names, self.body.cone_shape, strict=True)
        return Subject(
            self._source or "tracked", dict(self.body.lengths_m), dict(shapes), self.body.measured
        )

    def _summary(self) -> dict[str, Any]:
        return {
            "source": self._source,
            "seed": self._config.seed,
            "settings": self._config.as_mapping(),
            "versions": versions(),
            "body": {
                "name": self.body.name,
                "parameters": list(self.body.parameter_names),
                "lengths_m": {k: float(v) for k, v in self.body.lengths_m.items()},
                "cones_m": {
                    name: shape.tolist()
                    for name, shape in zip(self.body.cone_names, self.body.cone_shape, strict=True)
                },
            },
            **self._notes,
            "frames": [
                {
                    "stamp_ns": r.stamp_ns,
                    "state": r.state.value,
                    "fitness": r.fitness if math.isfinite(r.fitness) else None,
                    "evaluations": r.evaluations,
                    "refinements": r.refinements,
                    "iou": dict(r.iou),
                    "exposure": {name: list(gain) for name, gain in r.exposure.items()},
                    "parameters": None if r.pose is None else r.pose.tolist(),
                    **_confidence(r),
                    **_limbs(r),
                }
                for r in self._results
            ],
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
    """Per limb its state, the share of it inside the silhouettes, the scatter of its swarm."""
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
