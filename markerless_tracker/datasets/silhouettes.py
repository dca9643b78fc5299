"""Silhouettes made elsewhere, as images on disk: `DIR/CAMERA/FRAME.png`."""

from pathlib import Path

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets.video.images import numbered_files, read_image
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging.images import scale_image
from markerless_tracker.observation import Observation

_PERSON = 128


class Silhouettes:
    """A folder per camera with an image per frame: person from 128 on, background below.

    Files are named by the number of their frame in the recording, such as 000050.png.

    Args:
        folder: holds a folder for every camera.
        rig: the cameras, at the scale of the tracker's images; images of another size are scaled.

    Raises:
        DatasetError: a camera has no folder, or a file's name is no number.
    """

    def __init__(self, folder: Path, rig: CameraRig) -> None:
        missing = [name for name in rig.names if not (folder / name).is_dir()]
        if missing:
            raise DatasetError(
                f"{folder}: no folder {', '.join(missing)}, expected one of silhouettes per camera"
            )
        self._rig = rig
        self._files: dict[str, dict[int, Path]] = {}
        for name in rig.names:
            files = numbered_files(folder / name)
            for file in files:
                if not file.stem.isdecimal():
                    raise DatasetError(
                        f"{file}: expected a frame number as its name, such as 000050.png"
                    )
            self._files[name] = {int(file.stem): file for file in files}

    def views(self, index: int, stamp_ns: int) -> dict[str, Observation]:
        """Observations of the cameras that have a silhouette of a frame, without edges.

        Args:
            index: number of the frame in the recording.
            stamp_ns: its stamp.

        Raises:
            DatasetError, ImageError: an image cannot be read.
        """
        found = {}
        for camera in self._rig:
            file = self._files[camera.name].get(index)
            if file is not None:
                image = read_image(file)
                image = image if image.ndim == 2 else image[..., 0]
                mask = scale_image(image, camera.size_px) >= _PERSON
                edges = np.zeros(mask.shape, dtype=np.uint8)
                found[camera.name] = Observation.from_mask(camera.name, stamp_ns, mask, edges)
        return found
