"""CMU Panoptic: a sequence with `calibration_NAME.json`, HD videos and 3D joints per frame."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.formats.numbers import array_of, read_json
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.upright.axes import upright, upright_points
from markerless_tracker.datasets.video.images import find_stream, numbered_files
from markerless_tracker.datasets.video.rates import stamp_of, tidy_fps
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import FloatArray, transform

FPS = 30000.0 / 1001.0
"""Rate of the HD cameras, 1/s."""
UP, UNITS = "-y", "cm"
JOINTS = (
    "Neck", "Nose", "Pelvis", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle",
    "RShoulder", "RElbow", "RWrist", "RHip", "RKnee", "RAnkle", "LEye", "LEar", "REye", "REar",
)  # fmt: skip
"""The joints of coco19 in order, under our names."""
LEAST_CONFIDENCE = 0.1
_POSES = "hdPose3d_stage1_coco19"


class PanopticRecording(VideoRecording):
    """The HD cameras of a sequence, named hd_00_00, hd_00_01, ...; world in m with z up.

    Read are `calibration_*.json` (K, distCoef, R, t in cm, world with y down), the videos
    `hdVideos/hd_00_05.mp4` or the images `hdImgs/00_05/` of as many cameras as there are, and,
    where they exist, the joints of `hdPose3d_stage1_coco19/body3DScene_FRAME.json` as reference
    markers.

    Args:
        path: the sequence's folder.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: images are missing or cannot be read.
        CalibrationError: the calibration is malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        file = _calibration(path)
        if file is None:
            raise DatasetError(f"{path}: no calibration_*.json, expected one")
        sources, cameras = {}, []
        for number, entry in enumerate(_cameras(file)):
            if not isinstance(entry, dict) or not isinstance(entry.get("name"), str):
                raise CalibrationError(f"{file}: cameras {number}: no name, expected a string")
            if entry.get("type") != "hd":
                continue
            name = f"hd_{entry['name']}"
            source = find_stream(path / "hdVideos", name) or (
                find_stream(path / "hdImgs", entry["name"]) if (path / "hdImgs").is_dir() else None
            )
            if source is not None:
                sources[name] = source
                cameras.append(_camera(f"{file}: {entry['name']}", name, entry))
        if not cameras:
            raise DatasetError(
                f"{path}: no images of an HD camera, expected hdVideos/hd_00_00.mp4 or "
                "hdImgs/00_00/"
            )
        self._first_frame = _first_frame(path, sources)
        if input_fps is None and any(source.is_dir() for source in sources.values()):
            input_fps = tidy_fps(FPS)
        rig = upright(CameraRig(tuple(cameras)), up=UP, units=UNITS)
        super().__init__(path, sources, rig, scale=scale, input_fps=input_fps)

    def _ground_truth(self) -> MarkerTrack | None:
        """Joints of the person with the most frames; None without any.

        Raises:
            DatasetError: a file of joints is malformed.
        """
        files = sorted((self.path / _POSES).glob("body3DScene_*.json"))
        people: dict[Any, dict[int, FloatArray]] = {}
        for file in files:
            frame = _number(file) - self._first_frame
            for body, joints in _bodies(file) if frame >= 0 else []:
                people.setdefault(body, {})[frame] = joints
        if not people:
            return super()._ground_truth()
        counts = Counter({body: len(frames) for body, frames in people.items()})
        chosen, most = counts.most_common(1)[0]
        if len(counts) > 1:
            self.warn(
                f"{self.name}: joints of {len(counts)} persons, those of id {chosen} are the "
                f"reference ({most} frames)"
            )
        frames = sorted(people[chosen])
        return MarkerTrack(
            JOINTS,
            np.array([stamp_of(frame, self.fps) for frame in frames]),
            upright_points(np.stack([people[chosen][f] for f in frames]), up=UP, units=UNITS),
        )


def is_panoptic(path: Path) -> bool:
    """Whether a folder is a sequence with images of HD cameras."""
    if not any((path / folder).is_dir() for folder in ("hdVideos", "hdImgs")):
        return False
    return _calibration(path) is not None


def _calibration(path: Path) -> Path | None:
    own = path / f"calibration_{path.resolve().name}.json"
    return own if own.is_file() else next(iter(sorted(path.glob("calibration_*.json"))), None)


def _cameras(file: Path) -> list[Any]:
    try:
        entries = read_json(file).get("cameras")
    except DatasetError as error:
        raise CalibrationError(str(error)) from error
    if not isinstance(entries, list):
        raise CalibrationError(f"{file}: cameras is {type(entries).__name__}, expected a list")
    return entries


def _camera(where: str, name: str, entry: Mapping[str, Any]) -> CameraModel:
    width, height = array_of(where, entry, "resolution", (2,)).tolist()
    try:
        return CameraModel(
            name=name,
            size_px=(round(width), round(height)),
            matrix=array_of(where, entry, "K", (3, 3)),
            distortion=array_of(where, entry, "distCoef", (5,)),
            T_cam_world=transform(
                array_of(where, entry, "R", (3, 3)), array_of(where, entry, "t", (3,))
            ),
        )
    except CalibrationError as error:
        text = str(error)
        raise CalibrationError(text if text.startswith(where) else f"{where}: {text}") from error


def _bodies(file: Path) -> list[tuple[Any, FloatArray]]:
    """Id and (19, 3) joints in cm of every person in a file; NaN below the least confidence."""
    bodies = read_json(file).get("bodies")
    if not isinstance(bodies, list):
        raise DatasetError(f"{file}: bodies is {type(bodies).__name__}, expected a list")
    found = []
    for number, body in enumerate(bodies):
        try:
            values = np.array(body["joints19"], dtype=np.float64).reshape(len(JOINTS), 4)
            joints = np.where(values[:, 3:] > LEAST_CONFIDENCE, values[:, :3], np.nan)
            if not isinstance(body["id"], int | str):
                raise TypeError
            found.append((body["id"], joints))
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(
                f"{file}: bodies {number}: expected id and joints19 with {len(JOINTS)} times "
                "x y z confidence"
            ) from error
    return found


def _first_frame(path: Path, sources: Mapping[str, Path]) -> int:
    """The frame of the first images; videos begin with frame 0."""
    firsts = {
        name: _number(numbered_files(source)[0]) if source.is_dir() else 0
        for name, source in sources.items()
    }
    if len(set(firsts.values())) > 1:
        listed = ", ".join(f"{name} {number}" for name, number in firsts.items())
        raise DatasetError(f"{path}: cameras begin with different frames ({listed})")
    return next(iter(firsts.values()))


def _number(file: Path) -> int:
    digits = file.stem.rpartition("_")[2]
    if not digits.isdecimal():
        raise DatasetError(f"{file}: expected a frame number at the end of its name")
    return int(digits)
