"""The source images of a result, matched by time."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import FrameSet
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.in_step import InStepRecording
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.viewing.corrected import as_corrected
from markerless_tracker.viewing.reopened import reopened
from markerless_tracker.viewing.windows import Window, windows


class ResultImages:
    """Images of a result's source, scaled down for pictures.

    Args:
        result: the result.
        source: the recording, None = the one that the result names.
        width_px: largest width of a picture.
        whole: whether pictures show whole images, or only the window in which the person moves.

    Attributes:
        rig: the cameras of the scaled images.
        windows: camera -> the part of its images that pictures show.
        fps: rate of the source, 1/s.

    Raises:
        DatasetError: the recording does not exist or cannot be read.
        CalibrationError, ImageError, ConfigError: as `reopened`.
    """

    def __init__(
        self,
        result: StoredResult,
        source: Path | None = None,
        *,
        width_px: int = 640,
        whole: bool = True,
    ) -> None:
        path = source or (Path(result.source) if result.source else None)
        if path is None or not path.exists():
            found = (
                "the result names no source"
                if path is None
                else f"{path}: the images of the result are not there"
            )
            raise DatasetError(f"{found}, expected the recording's folder with --source")
        full = reopened(result, path).rig
        rig = as_corrected(full, full, result.summary)
        self.windows: Mapping[str, Window] = (
            dict.fromkeys(rig.names, Window()) if whole else windows(result, rig)
        )
        widest = max(self.windows[camera.name].size * camera.size_px[0] for camera in rig)
        recording = reopened(result, path, scale=min(1.0, width_px / widest))
        # Bags may lack sets, so that every k-th set is not one set per k periods.
        self._regular = isinstance(recording, VideoRecording)
        offsets = result.summary.get("time_offsets_s")
        if offsets:
            recording = InStepRecording(recording, offsets)
        self._recording = recording
        self._stamps_ns = result.stamps_ns
        self.rig: CameraRig = as_corrected(recording.rig, full, result.summary)
        self.fps = recording.fps

    def frames(self, rows: Sequence[int]) -> Iterator[tuple[int, FrameSet]]:
        """Rows of the result with their images, in order; rows without images are left out.

        Args:
            rows: increasing rows of the result.

        Raises:
            DatasetError: no row has images, or the source cannot be read.
        """
        wanted = [(row, int(self._stamps_ns[row])) for row in rows]
        if not wanted:
            return
        missing: DatasetError | None = None
        start, every = 0, self._every(wanted)
        try:
            start = self._recording.start_index(wanted[0][1])
        except DatasetError as error:
            # The source may begin later than the result.
            missing, every = error, 1
        found = 0
        for images in self._recording.frames(start=start, every=every):
            while found < len(wanted) and self._is_past(wanted[found][1], images):
                wanted.pop(found)
            if found == len(wanted):
                break
            row, stamp_ns = wanted[found]
            if abs(images.stamp_ns - stamp_ns) <= self._tolerance_ns:
                yield row, images
                found += 1
        if found == 0 and missing is not None:
            raise missing

    @property
    def _tolerance_ns(self) -> float:
        return 0.5e9 / self.fps

    def _is_past(self, stamp_ns: int, images: FrameSet) -> bool:
        return images.stamp_ns - stamp_ns > self._tolerance_ns

    def _every(self, wanted: Sequence[tuple[int, int]]) -> int:
        """Largest step over the source's frames that skips no stamp; 1 for an irregular source."""
        if not self._regular:
            return 1
        steps = np.diff([stamp_ns for _, stamp_ns in wanted]) * self.fps / 1e9
        whole = np.rint(steps).astype(np.int64)
        if not whole.size or np.abs(steps - whole).max() > 0.25 or whole.min() < 1:
            return 1
        return int(np.gcd.reduce(whole))
