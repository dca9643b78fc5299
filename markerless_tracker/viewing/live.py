"""The output of a running tracker, in the Rerun viewer or in a file for it."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.drawing.overlay import Image
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.viewing.rerun_file import (
    APPLICATION,
    TIMELINE,
    blueprint,
    log_body,
    log_pictures,
    log_world,
    require_rerun,
)

CURVES = {"angles": "joint angles, degrees", "overlap": "overlap"}
"""Folders of the curves over time, and their titles."""


class LiveRecording:
    """A recording of the Rerun viewer that grows.

    Args:
        path: file, *.rrd; None opens the viewer.

    Raises:
        ConfigError: rerun-sdk is not installed.
        DatasetError: the file cannot be written, or the viewer cannot be started.
    """

    def __init__(self, path: Path | None) -> None:
        self._rr = require_rerun()
        self._stream = self._rr.RecordingStream(APPLICATION)
        self._cameras: tuple[str, ...] = ()
        try:
            if path is None:
                self._stream.spawn()
            else:
                self._stream.save(path)
        except (OSError, RuntimeError, ValueError) as error:
            what = "the Rerun viewer cannot be started" if path is None else f"{path}"
            raise DatasetError(f"{what}: {error}") from error
        log_world(self._rr, self._stream)

    def arrange(self, cameras: tuple[str, ...]) -> None:
        """Show these cameras; no effect if they are shown already."""
        if cameras != self._cameras:
            self._cameras = cameras
            self._stream.send_blueprint(blueprint(cameras, CURVES))

    def add(
        self,
        stamp_ns: int,
        *,
        markers_m: FloatArray | None = None,
        angles_rad: Mapping[str, float] | None = None,
        overlap: Mapping[str, float] | None = None,
        state: str = "",
        pictures: Mapping[str, Image] | None = None,
    ) -> None:
        """Log the given values at the stamp of their images.

        Args:
            stamp_ns: stamp of the images.
            markers_m: (15, 3) m, world frame.
            angles_rad: joint -> angle.
            overlap: camera -> overlap of silhouette and body.
            state: SEARCHING, TRACKING or LOST; without TRACKING no body is shown.
            pictures: camera -> image (h, w, 3) BGR.
        """
        rr, stream = self._rr, self._stream
        stream.set_time(TIMELINE, duration=stamp_ns / 1e9)
        if markers_m is not None and len(markers_m) == len(MARKER_NAMES):
            log_body(rr, stream, MARKER_NAMES, np.asarray(markers_m, np.float64))
        if state:
            stream.log("state", rr.TextLog(state))
            if state != "TRACKING":
                stream.log("world/body", rr.Clear(recursive=True))
        for name, angle in (angles_rad or {}).items():
            stream.log(f"angles/{name}", rr.Scalars(math.degrees(angle)))
        for name, value in (overlap or {}).items():
            stream.log(f"overlap/{name}", rr.Scalars(value))
        log_pictures(rr, stream, pictures or {})

    def close(self) -> None:
        """Write all pending data."""
        self._stream.flush()
        self._stream.disconnect()
