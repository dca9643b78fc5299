"""The empty scene: `background/NAME.{png,jpg,mp4}`, a folder NAME of images, learned `NAME.npz`."""

from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets.video.images import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    numbered_files,
    open_stream,
    read_image,
)
from markerless_tracker.errors import DatasetError, ImageError
from markerless_tracker.imaging import (
    BackgroundModel,
    Image,
    read_background_model,
    scale_background_model,
    scale_image,
)
from markerless_tracker.imaging.background import MODEL_SUFFIX

# More empty images than this teach nothing new and would not fit memory at full size.
MAX_FRAMES = 120


def read_background(
    folder: str | Path,
    rig: CameraRig,
    *,
    stored_sizes_px: Mapping[str, tuple[int, int]] | None = None,
    ignore_others: bool = False,
) -> dict[str, list[Image]]:
    """Read the empty-scene images of a rig, at most `MAX_FRAMES` (the first) per camera.

    Args:
        folder: holds `NAME.png`, `.jpg`, `.mp4` (or another image or video type), or a folder
            `NAME` of numbered images, for any of the cameras.
        rig: the cameras of the (scaled) images wanted.
        stored_sizes_px: size of each camera's images before scaling; images may have that size
            or the rig's.
        ignore_others: whether files of other cameras are left alone instead of refused.

    Returns:
        Camera name -> images in the rig's size; a camera without any is omitted.

    Raises:
        DatasetError: no such folder, an unreadable file, a name that is no camera's, or two
            sources for one camera.
        ImageError: an image's size is neither the stored nor the rig's.
    """
    folder = _existing(folder)
    sources: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if not (path.is_dir() or path.suffix.lower() in IMAGE_SUFFIXES + VIDEO_SUFFIXES):
            continue
        name = path.name if path.is_dir() else path.stem
        if ignore_others and name not in rig.names:
            continue
        _check_name(path, name, rig)
        if name in sources:
            raise DatasetError(f"{path}: {name} has another background, {sources[name].name}")
        sources[name] = path
    stored = stored_sizes_px or {}
    return {
        camera.name: _load(sources[camera.name], camera.size_px, stored.get(camera.name))
        for camera in rig
        if camera.name in sources
    }


def read_background_models(
    folder: str | Path,
    rig: CameraRig,
    *,
    stored_sizes_px: Mapping[str, tuple[int, int]] | None = None,
    ignore_others: bool = False,
) -> dict[str, BackgroundModel]:
    """Read the learned backgrounds (`NAME.npz`) among the empty scenes of a rig.

    A folder may hold images and a model of the same camera; the model takes precedence, because it
    also holds the noise of each pixel.

    Args:
        folder: as in `read_background`.
        rig: the cameras of the (scaled) images wanted.
        stored_sizes_px: as in `read_background`; a model of images in that size is scaled down.
        ignore_others: as in `read_background`.

    Returns:
        Camera name -> model in the rig's size; a camera without one is omitted.

    Raises:
        DatasetError: no such folder, or a name that is no camera's.
        ImageError: no model, or one whose size is neither the stored nor the rig's.
    """
    models: dict[str, BackgroundModel] = {}
    for path in sorted(_existing(folder).glob(f"*{MODEL_SUFFIX}")):
        if ignore_others and path.stem not in rig.names:
            continue
        _check_name(path, path.stem, rig)
        model = read_background_model(path)
        size_px = rig[path.stem].size_px
        _check_size(path, model.size_px, size_px, (stored_sizes_px or {}).get(path.stem))
        models[path.stem] = scale_background_model(model, size_px)
    return {name: models[name] for name in rig.names if name in models}


def background_size(folder: str | Path, camera: str) -> tuple[int, int]:
    """(width, height) of a camera's empty scene: of its images, else of its learned model.

    Raises:
        DatasetError: the folder holds none.
        ImageError: it cannot be read.
    """
    folder = _existing(folder)
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name == camera:
            image = read_image(numbered_files(path)[0]) if numbered_files(path) else None
        elif path.suffix.lower() in IMAGE_SUFFIXES and path.stem == camera:
            image = read_image(path)
        elif path.suffix.lower() in VIDEO_SUFFIXES and path.stem == camera:
            with closing(open_stream(path)) as stream:
                return stream.size_px
        else:
            continue
        if image is not None:
            return int(image.shape[1]), int(image.shape[0])
    model = folder / f"{camera}{MODEL_SUFFIX}"
    if not model.is_file():
        raise DatasetError(
            f"{folder} holds nothing for {camera}, expected an image, clip or learned model "
            f"({MODEL_SUFFIX}) of that name"
        )
    return read_background_model(model).size_px


def _existing(folder: str | Path) -> Path:
    folder = Path(folder)
    if not folder.is_dir():
        raise DatasetError(f"{folder}: no such folder of backgrounds")
    return folder


def _check_name(path: Path, name: str, rig: CameraRig) -> None:
    if name not in rig.names:
        raise DatasetError(f"{path}: {name} is no camera, expected {', '.join(rig.names)}")


def _check_size(
    path: Path, came: tuple[int, int], size_px: tuple[int, int], stored_px: tuple[int, int] | None
) -> None:
    sizes = dict.fromkeys((stored_px or size_px, size_px))
    if came not in sizes:
        expected = " or ".join(f"{w}x{h}" for w, h in sizes)
        raise ImageError(f"{path}: background of {came[0]}x{came[1]} px, expected {expected} px")


def _load(path: Path, size_px: tuple[int, int], stored_px: tuple[int, int] | None) -> list[Image]:
    images = []
    for image in _images(path):
        _check_size(path, (int(image.shape[1]), int(image.shape[0])), size_px, stored_px)
        images.append(scale_image(image, size_px))
    return images


def _images(path: Path) -> Iterator[Image]:
    """At most `MAX_FRAMES` images of a file, a folder or a clip, one after the other."""
    if path.suffix.lower() in IMAGE_SUFFIXES and path.is_file():
        yield read_image(path)
        return
    if path.is_dir():
        files = numbered_files(path)[:MAX_FRAMES]
        if not files:
            raise DatasetError(f"{path}: holds no image, expected {', '.join(IMAGE_SUFFIXES)}")
        yield from map(read_image, files)
        return
    with closing(open_stream(path)) as stream:
        for _ in range(MAX_FRAMES):
            if (image := stream.read()) is None:
                return
            yield image
