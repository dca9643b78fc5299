"""One pass over a recording: motion, brightness, silhouettes and static scene of every camera."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.checks.pictures import small_grey
from markerless_tracker.checks.scene import DIFFERENCE
from markerless_tracker.datasets import Recording
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image

MOST_FRAMES = 600
"""Largest number of frames that are read, consecutive from the first."""
_STILLS = 31
_MOTION_S = 0.05


@dataclass(frozen=True, eq=False)
class CameraSignals:
    """Signals of one camera.

    Attributes:
        motion: (n,) mean change within 1/20 s above the noise, grey levels.
        gain: (n,) brightness relative to the background.
        height_px: (n,) height of the silhouette at the recording's scale, 0 without any.
        scene: (h, w) median over frames of the scene, grey, small.
        background: (h, w) empty scene, grey, small; None if the recording has none.
        kinds: of the images and of the background, `grey` or `colour`, each once.
    """

    motion: FloatArray
    gain: FloatArray
    height_px: FloatArray
    scene: FloatArray
    background: FloatArray | None
    kinds: tuple[str, ...]


def read_signals(
    recording: Recording,
    *,
    progress: Callable[[int, int | None], None] | None = None,
) -> dict[str, CameraSignals]:
    """Read a recording once, and measure every camera.

    Without an empty scene, the median of the frames replaces it.

    Args:
        recording: the images.
        progress: called with the number of sets read and their expected number.

    Raises:
        DatasetError, ImageError: images or backgrounds cannot be read.
    """
    most = min(MOST_FRAMES, recording.frame_count or MOST_FRAMES)
    small: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in recording.rig.names}
    kinds: dict[str, set[str]] = {name: set() for name in recording.rig.names}
    for number, frame in enumerate(recording.frames()):
        if number >= most:
            break
        for name, image in frame.images.items():
            small[name].append(small_grey(image))
            kinds[name].add(_kind(image))
        if progress is not None:
            progress(number + 1, most)
    backgrounds = _backgrounds(recording, kinds)
    return {
        camera.name: _signals(
            small[camera.name],
            backgrounds.get(camera.name),
            camera.size_px[0],
            tuple(sorted(kinds[camera.name])),
            apart=max(1, round(_MOTION_S * recording.fps)),
        )
        for camera in recording.rig
    }


def _signals(
    images: list[NDArray[np.uint8]],
    background: FloatArray | None,
    width_px: int,
    kinds: tuple[str, ...],
    *,
    apart: int,
) -> CameraSignals:
    step = max(1, len(images) // _STILLS)
    scene = np.median(np.array(images[::step], dtype=np.float32), axis=0).astype(np.float64)
    base = scene if background is None else background
    motion, gain, height = (np.zeros(len(images)) for _ in range(3))
    usable = (base > 20.0) & (base < 240.0)
    recent: deque[NDArray[np.float32]] = deque(maxlen=apart)
    for number, image in enumerate(images):
        now = cv2.GaussianBlur(image, (0, 0), 1.2).astype(np.float32)
        if len(recent) == apart:
            change = np.abs(now - recent[0])
            # Most of the image is static, so that the median change is noise.
            noise = 3.0 * float(np.median(change)) + 0.5
            motion[number] = float(np.maximum(change - noise, 0.0).mean())
        recent.append(now)
        # The median ratio: a person covers less than half of the image.
        gain[number] = float(np.median(now[usable] / base[usable])) if usable.any() else 1.0
        differs = np.abs(now - gain[number] * base) > DIFFERENCE
        height[number] = _blob_height(differs) * width_px / image.shape[1]
    # Zeros in the first frames of every camera would look like common motion.
    motion[:apart] = motion[apart : apart + 1] if len(images) > apart else 0.0
    return CameraSignals(motion, gain, height, scene, background, kinds)


def _blob_height(mask: NDArray[np.bool_]) -> int:
    """Height of the largest connected region, px."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 3), np.uint8))
    count, _, table, _ = cv2.connectedComponentsWithStats(closed)
    if count < 2:
        return 0
    best = 1 + int(np.argmax(table[1:, cv2.CC_STAT_AREA]))
    return int(table[best, cv2.CC_STAT_HEIGHT]) if table[best, cv2.CC_STAT_AREA] > 20 else 0


def _backgrounds(recording: Recording, kinds: Mapping[str, set[str]]) -> Mapping[str, FloatArray]:
    """Empty scenes by camera; whether they are grey or in colour is added to `kinds`."""
    models = recording.background_models()
    found = {name: small_grey(model.image).astype(np.float64) for name, model in models.items()}
    for name, model in models.items():
        kinds[name].add(_kind(model.image))
    for name, images in recording.background_frames().items():
        if name not in models:
            kinds[name].update(map(_kind, images))
        stack = np.array([small_grey(image) for image in images], dtype=np.float64)
        found.setdefault(name, np.median(stack, axis=0))
    return found


def _kind(image: Image) -> str:
    return "grey" if image.ndim == 2 else "colour"
