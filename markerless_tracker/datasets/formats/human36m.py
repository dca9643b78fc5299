"""Human3.6M: an action's videos `S1/Videos/ACTION.CAMERA.mp4`, and `metadata.xml` above them."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.human36m_joints import (
    JOINTS,
    SHIFTED,
    joints_file,
    read_joints,
)
from markerless_tracker.datasets.formats.numbers import image_sizes
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.upright.axes import upright, upright_points
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import FloatArray, rotation_from_euler, transform

CAMERAS = ("54138969", "55011271", "58860488", "60457274")
METADATA = "metadata.xml"
UNITS = "mm"
_SUBJECTS, _POSE, _LENS = 11, 6, 9
_ABOVE = 3
_RELEASE = "Release-v*"
_VIDEO = re.compile(rf"(?P<action>[^_].*)\.(?P<camera>{'|'.join(CAMERAS)})")


class Human36mRecording(VideoRecording):
    """An action of a subject; cameras are named cam_54138969, ..., world in m with z up.

    Read are the videos, `metadata.xml` (its element w0) in a folder above them or in `Release-v*/`
    there, and, where it exists, `S1/MyPoseFeatures/D3_Positions/ACTION.cdf` as reference markers.

    Args:
        path: the subject's folder with `Videos/`, or one video of the action in it.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: no action or several, or a video cannot be read.
        CalibrationError: the metadata is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        subject, found = _actions(path)
        match = re.fullmatch(r"S(\d+)", subject.resolve().name)
        if match is None or not 1 <= int(match[1]) <= _SUBJECTS:
            raise DatasetError(f"{subject}: expected a subject's folder S1, ..., S{_SUBJECTS}")
        if len(found) != 1:
            raise DatasetError(
                f"{subject / 'Videos'}: actions {', '.join(found) or 'none'}, expected one, or one "
                "video of the action as the source"
            )
        ((action, videos),) = found.items()
        file = metadata_file(subject)
        if file is None:
            raise CalibrationError(f"{subject}: no {METADATA} in a folder above")
        sources = {f"cam_{camera}": video for camera, video in videos.items()}
        poses, lenses = _parameters(file)
        sizes = image_sizes(sources)
        cameras = []
        for name in sources:
            number = CAMERAS.index(name.removeprefix("cam_"))
            where = f"{file}: w0: {name} of S{match[1]}"
            pose = poses[number, int(match[1]) - 1]
            cameras.append(_camera(where, name, sizes[name], pose, lenses[number]))
        rig = upright(CameraRig(tuple(cameras)), units=UNITS)
        super().__init__(subject, sources, rig, scale=scale, input_fps=input_fps)
        self.name = f"{subject.resolve().name}_{action}"
        self._action = action

    def _ground_truth(self) -> MarkerTrack | None:
        """Joints of the action; None without their file.

        Raises:
            DatasetError: the file is malformed, or cdflib is not installed.
        """
        file = joints_file(self.path, self._action)
        if file is None:
            return super()._ground_truth()
        positions = upright_points(read_joints(file), units=UNITS)
        if self.name in SHIFTED:
            self.warn(
                f"{self.name}: the data set has the joints of this action 0.2 m too far along x; "
                "they are left as they are"
            )
        stamps = np.array([stamp_of(frame, self.fps) for frame in range(len(positions))])
        return MarkerTrack(tuple(JOINTS), stamps, positions)


def is_human36m(path: Path) -> bool:
    """Whether a path is a subject's folder or a video in it, with the metadata above."""
    subject, found = _actions(path)
    return bool(found) and metadata_file(subject) is not None


def trials(path: Path) -> list[Path]:
    """One video of each action of a subject."""
    return [next(iter(videos.values())) for videos in _actions(path)[1].values()]


def metadata_file(subject: Path) -> Path | None:
    """The file of the cameras: in the nearest folder above a subject's."""
    folder = subject.resolve()
    for above in (folder, *list(folder.parents)[:_ABOVE]):
        places = [above / METADATA, *sorted(above.glob(f"{_RELEASE}/{METADATA}"), reverse=True)]
        found = next((place for place in places if place.is_file()), None)
        if found is not None:
            return found
    return None


def _actions(path: Path) -> tuple[Path, dict[str, dict[str, Path]]]:
    """The subject's folder, and action -> camera -> video; one action if the path is a video."""
    chosen = _VIDEO.fullmatch(path.stem) if path.is_file() else None
    subject = path.parent.parent if path.is_file() else path
    folder = subject / "Videos"
    actions: dict[str, dict[str, Path]] = {}
    for video in sorted(folder.iterdir()) if folder.is_dir() else []:
        match = _VIDEO.fullmatch(video.stem) if video.suffix.lower() in VIDEO_SUFFIXES else None
        if match and (not path.is_file() or (chosen and match["action"] == chosen["action"])):
            actions.setdefault(match["action"], {})[match["camera"]] = video
    return subject, actions


def _parameters(path: Path) -> tuple[FloatArray, FloatArray]:
    """(4, 11, 6) three angles in rad and a position in mm; (4, 9) f f c c k1 k2 k3 p1 p2."""
    try:
        text = ElementTree.parse(path).getroot().findtext("w0")
    except (OSError, ElementTree.ParseError) as error:
        raise CalibrationError(f"{path}: cannot be read as XML: {error}") from error
    expected = len(CAMERAS) * (_SUBJECTS * _POSE + _LENS)
    try:
        values = np.array([float(word) for word in (text or "").strip(" \n\t[]").split()])
    except ValueError as error:
        raise CalibrationError(f"{path}: w0: {error}, expected {expected} numbers") from error
    if values.size != expected or not np.isfinite(values).all():
        raise CalibrationError(f"{path}: w0 has {values.size} numbers, expected {expected}")
    split = len(CAMERAS) * _SUBJECTS * _POSE
    return (
        values[:split].reshape(len(CAMERAS), _SUBJECTS, _POSE),
        values[split:].reshape(len(CAMERAS), _LENS),
    )


def _camera(
    where: str, name: str, size_px: tuple[int, int], pose: FloatArray, lens: FloatArray
) -> CameraModel:
    # Rx Ry Rz; the position is the camera's, in the world.
    rotation = rotation_from_euler("xyz", pose[:3])
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = lens.tolist()
    try:
        return CameraModel(
            name=name,
            size_px=size_px,
            matrix=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
            distortion=np.array([k1, k2, p1, p2, k3]),
            T_cam_world=transform(rotation, -rotation @ pose[3:]),
        )
    except CalibrationError as error:
        raise CalibrationError(f"{where}: {error}") from error
