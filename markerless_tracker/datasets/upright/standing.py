"""The world turned upright by a recording itself: level cameras, and the floor under the person.

Cameras on tripods are nearly level: their x axes are nearly parallel to the floor, which determines
the vertical. The lowest points of the visual hull of moving pixels are the person's soles, which
determine the height of the floor.
"""

from collections.abc import Iterator, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.datasets.recording import Recording
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray, transform
from markerless_tracker.imaging import Image

PERSON = "person"
"""The choice of --up that turns the world like this."""
SETS = 24
"""Number of image sets that are evaluated, evenly spread."""
WIDTH_PX = 240
"""Width to which their images are scaled."""
DIFFERENCE = 16
"""Least difference of a moving pixel from the background, in grey levels of 255."""
SPACING_M = 0.05
RADIUS_M = 2.5
BELOW_SOLES_M = 0.09
"""Extent of a hull of few views below the soles: 0.09 to 0.12 m on three recordings."""
LEAST_HEIGHT_M, LEAST_POINTS = 0.9, 60
"""Least height of a person's hull, and least number of its grid points."""
MOST_ROLL_DEG = 4.0
"""Largest roll of a camera from which the vertical is reliable."""
_LOWEST = 0.005
"""Share of a hull's points below its lowest height: single points are noise."""
_LEAST_SHARE = 0.3
_FAR_M = 4.0
_PULL = 0.02


def stand_upright(recording: Recording) -> None:
    """Move a recording, whose lengths are in m, to a world that stands upright.

    z is up, the floor is z = 0, the origin is below the middle of what the cameras look at, and x
    is the horizontal direction of the view of one of them. Cameras that are rolled get a warning.

    Raises:
        DatasetError: the cameras do not tell up, or no person moves in the recording.
    """
    T_level_old = _above(recording.rig, _up(recording))
    level = recording.rig.moved(T_level_old)
    rolls = {c.name: float(np.rad2deg(np.arcsin(abs(c.T_world_cam[2, 0])))) for c in level}
    worst = max(rolls, key=rolls.__getitem__)
    if rolls[worst] > MOST_ROLL_DEG:
        recording.warn(
            f"{recording.name}: the cameras are not level ({worst} by {rolls[worst]:.0f} degrees "
            "off what most say is up): the world may be as much off; calibrate with a board on the "
            "floor"
        )
    lowest = list(_lowest(level, _masks(recording)))
    if not lowest:
        raise DatasetError(
            f"{recording.name}: no moving person in {SETS} sets of images, under which to find the "
            "floor; expected --up with an axis"
        )
    floor = float(np.median(lowest)) + BELOW_SOLES_M
    recording.move(transform(np.eye(3), [0.0, 0.0, -floor]) @ T_level_old)


def _up(recording: Recording) -> FloatArray:
    """The direction (3,) most orthogonal to all cameras' x axes, towards up in the images."""
    across = np.array([camera.T_world_cam[:3, 0] for camera in recording.rig])
    ups = -np.array([camera.T_world_cam[:3, 1] for camera in recording.rig])
    values, vectors = np.linalg.eigh(across.T @ across)
    # With parallel x axes, as of two cameras side by side, only up in the images decides.
    chosen = vectors[:, 0] if values[1] > 0.05 * values[2] else ups.mean(axis=0)
    agreement = float((ups @ chosen).mean())
    if abs(agreement) < _LEAST_SHARE:
        raise DatasetError(
            f"{recording.name}: the cameras look from above, or are rolled: they do not tell which "
            "direction is up; expected --up with an axis"
        )
    return np.asarray(chosen * np.sign(agreement) / np.linalg.norm(chosen))


def _above(rig: CameraRig, up: FloatArray) -> FloatArray:
    """(4, 4) to a world with z up and the middle of what is looked at as its origin."""
    views = [camera.T_world_cam for camera in rig]
    across = [np.cross(up, np.cross(view[:3, 2], up)) for view in views]
    x = max(across, key=lambda vector: float(np.linalg.norm(vector)))
    x = x / np.linalg.norm(x)
    rotation = np.stack([x, np.cross(up, x), up])
    total, right = np.zeros((3, 3)), np.zeros(3)
    for view in views:
        axis, centre = view[:3, 2], view[:3, 3]
        plane = np.eye(3) - np.outer(axis, axis)
        # A weak pull to a place in front of the cameras decides where the axes are parallel.
        total += plane + _PULL * np.eye(3)
        right += plane @ centre + _PULL * (centre + _FAR_M * axis)
    return transform(rotation, -rotation @ np.linalg.solve(total, right))


def _masks(recording: Recording) -> list[Mapping[str, NDArray[np.bool_]]]:
    """What moves, in small images of some sets, evenly spread: camera -> (h, w)."""
    every = max(1, (recording.frame_count or 1) // SETS)
    shrunk: dict[str, list[Image]] = {name: [] for name in recording.rig.names}
    for number, frame in enumerate(recording.frames(every=every)):
        if number == SETS:
            break
        for name, image in frame.images.items():
            shrunk[name].append(_small(image))
    given = recording.background_frames()
    masks = {}
    for name, images in shrunk.items():
        empty = [_small(image) for image in given.get(name, [])[:SETS]] or images
        background = np.median(np.stack(empty), axis=0)
        masks[name] = [_moving(image, background) for image in images]
    count = min(map(len, masks.values()))
    return [{name: found[i] for name, found in masks.items()} for i in range(count)]


def _small(image: Image) -> Image:
    colour = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    height = max(1, round(WIDTH_PX * image.shape[0] / image.shape[1]))
    small = cv2.resize(colour, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _moving(image: Image, background: FloatArray) -> NDArray[np.bool_]:
    off = (np.abs(image - background).max(axis=2) > DIFFERENCE).astype(np.uint8)
    opened = cv2.morphologyEx(off, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    return np.asarray(closed > 0)


def _lowest(rig: CameraRig, sets: Sequence[Mapping[str, NDArray[np.bool_]]]) -> Iterator[float]:
    """Lowest height (m) of the hull's largest component, for each set that has a person."""
    # Few recordings need it, and it takes a moment to import.
    from scipy import ndimage

    steps = np.arange(-RADIUS_M, RADIUS_M, SPACING_M)
    points = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    places, looking = {}, np.zeros(len(points), dtype=np.int8)
    for camera in rig:
        height, width = sets[0][camera.name].shape if sets else (1, 1)
        pixels = project_camera(points, camera)
        pixels = (pixels + 0.5) * [width / camera.size_px[0], height / camera.size_px[1]]
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0).all(axis=1) & (pixels < [width, height]).all(axis=1)
        columns = np.where(inside[:, None], pixels, 0).astype(np.int32)
        places[camera.name] = (inside, columns[:, 1], columns[:, 0])
        looking += inside
    usable = looking >= min(3, len(rig))
    for masks in sets:
        kept = usable.copy()
        for name, (inside, rows, columns) in places.items():
            kept &= ~inside | masks[name][rows, columns]
        labels, _ = ndimage.label(kept.reshape(len(steps), len(steps), len(steps)))
        sizes = np.bincount(labels.ravel())
        sizes[0] = 0
        if sizes.max(initial=0) < LEAST_POINTS:
            continue
        heights = points[labels.ravel() == int(sizes.argmax()), 2]
        low = float(np.quantile(heights, _LOWEST))
        if heights.max() - low >= LEAST_HEIGHT_M:
            yield low
