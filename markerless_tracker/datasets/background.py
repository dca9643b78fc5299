"""Images of the empty scene: `background/NAME.{png,jpg,mp4}`, or a folder NAME of such images."""

from collections.abc import Mapping
from pathlib import Path

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets.video import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    numbered_files,
    open_stream,
    read_image,
)
from markerless_tracker.errors import DatasetError, ImageError
from markerless_tracker.imaging import Image, scale_image

# More empty images than this teach nothing new and would not fit memory at full size.
MAX_FRAMES = 120


def read_background(
    folder: str | Path,
    rig: CameraRig,
    *,
    stored_sizes_px: Mapping[str, tuple[int, int]] | None = None,
) -> dict[str, list[Image]]:
    """Read the empty-scene images of a rig, at most `MAX_FRAMES` (the first) per camera.

    Args:
        folder: holds `NAME.png`, `.jpg`, `.mp4` (or another image or video type), or a folder
            `NAME` of numbered images, for any of the cameras.
        rig: the cameras of the (scaled) images wanted.
        stored_sizes_px: size of each camera's images before scaling; images may come in that size
            or in the rig's.

    Returns:
        Camera name -> images in the rig's size; a camera without any is not there.

    Raises:
        DatasetError: no such folder, an unreadable file, a name that is no camera's, or two
            sources for one camera.
        ImageError: an image's size is neither the stored nor the rig's.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DatasetError(f"{folder}: no such folder of backgrounds")
    sources: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if not (path.is_dir() or path.suffix.lower() in IMAGE_SUFFIXES + VIDEO_SUFFIXES):
            continue
        name = path.name if path.is_dir() else path.stem
        if name not in rig.names:
            raise DatasetError(f"{path}: {name} is no camera, expected {', '.join(rig.names)}")
        if name in sources:
            raise DatasetError(f"{path}: {name} has another background, {sources[name].name}")
        sources[name] = path
    stored = stored_sizes_px or {}
    return {
        camera.name: _load(sources[camera.name], camera.size_px, stored.get(camera.name))
        for camera in rig
        if camera.name in sources
    }


def _load(path: Path, size_px: tuple[int, int], stored_px: tuple[int, int] | None) -> list[Image]:
    images = []
    for image in _images(path):
        came = (int(image.shape[1]), int(image.shape[0]))
        if came not in (size_px, stored_px or size_px):
            expected = " or ".join(
                f"{w}x{h}" for w, h in dict.fromkeys((stored_px or size_px, size_px))
            )
            raise ImageError(
                f"{path}: background of {came[0]}x{came[1]} px, expected {expected} px"
            )
        images.append(scale_image(image, size_px))
    return images


def _images(path: Path) -> list[Image]:
    if path.suffix.lower() in IMAGE_SUFFIXES and path.is_file():
        return [read_image(path)]
    if path.is_dir():
        files = numbered_files(path)[:MAX_FRAMES]
        if not files:
            raise DatasetError(f"{path}: holds no image, expected {', '.join(IMAGE_SUFFIXES)}")
        return [read_image(file) for file in files]
    stream = open_stream(path)
    images: list[Image] = []
    while len(images) < MAX_FRAMES and (image := stream.read()) is not None:
        images.append(image)
    stream.close()
    return images
