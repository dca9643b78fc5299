"""TotalCapture: a take with `TC_S1_NAME_cam1.mp4`, `calibration.cal` above it, Vicon joints."""

import math
import re
from pathlib import Path

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets.folder import VideoRecording
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.upright.axes import upright, upright_points
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import FloatArray, transform

CALIBRATION = "calibration.cal"
POSITIONS = "gt_skel_gbl_pos.txt"
UP = "y"
METRES_PER_INCH = 0.0254
JOINTS = {
    "Hips": "Pelvis", "Neck": "Neck",
    "LeftArm": "LShoulder", "LeftForeArm": "LElbow", "LeftHand": "LWrist",
    "LeftUpLeg": "LHip", "LeftLeg": "LKnee", "LeftFoot": "LAnkle",
    "RightArm": "RShoulder", "RightForeArm": "RElbow", "RightHand": "RWrist",
    "RightUpLeg": "RHip", "RightLeg": "RKnee", "RightFoot": "RAnkle",
}  # fmt: skip
"""Joint of the Vicon skeleton -> our marker; its Head is the joint below the skull, not the top."""
_VIDEO = re.compile(r"TC_(?P<subject>S\d+)_(?P<take>.+)_cam(?P<camera>\d+)", re.IGNORECASE)
_ABOVE = 4
"""Folders above a take in which the calibration is looked for."""


class TotalCaptureRecording(VideoRecording):
    """A take; cameras are named cam1, ..., world in m with z up.

    Read are the videos, `calibration.cal` in the take's folder or one above it (pixels, k1 and m, y
    up), and, where it exists, `gt_skel_gbl_pos.txt` (inches; row i belongs to frame i) in the
    take's folder or in `vicon/S1/TAKE/` beside `video/S1/TAKE/`.

    Args:
        path: the folder of the take's videos.
        scale: factor for all images.
        input_fps: another rate, 1/s.

    Raises:
        DatasetError: videos are missing, are those of several takes, or cannot be read.
        CalibrationError: the calibration is missing or malformed.
    """

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        file = calibration_file(path)
        if file is None:
            raise CalibrationError(f"{path}: no {CALIBRATION} here or in a folder above")
        cameras = read_cameras(file)
        videos = {int(match["camera"]): (video, match) for video, match in _videos(path)}
        takes = sorted({match["take"] for _, match in videos.values()})
        if len(takes) != 1:
            raise DatasetError(
                f"{path}: takes {', '.join(takes) or 'none'}, expected the videos "
                "TC_S1_TAKE_cam1.mp4, ... of one"
            )
        beyond = [number for number in sorted(videos) if not 1 <= number <= len(cameras)]
        if beyond:
            raise CalibrationError(
                f"{file}: {len(cameras)} cameras, but there is a video of camera {beyond[0]}"
            )
        chosen = CameraRig(tuple(cameras[number - 1] for number in sorted(videos)))
        super().__init__(
            path,
            {f"cam{number}": videos[number][0] for number in sorted(videos)},
            upright(chosen, up=UP),
            scale=scale,
            input_fps=input_fps,
        )
        match = next(iter(videos.values()))[1]
        self.name = f"{match['subject']}_{match['take']}"
        self._take = (match["subject"], match["take"])

    def _ground_truth(self) -> MarkerTrack | None:
        """Joints of the Vicon skeleton; None without their file.

        Raises:
            DatasetError: the file is malformed.
        """
        subject, take = self._take
        folder = self.path.resolve()
        places = [
            folder, *(above / "vicon" / subject / take for above in list(folder.parents)[:_ABOVE])
        ]  # fmt: skip
        file = next((p / POSITIONS for p in places if (p / POSITIONS).is_file()), None)
        if file is None:
            return super()._ground_truth()
        names, positions = read_positions(file)
        stamps = np.array([stamp_of(frame, self.fps) for frame in range(len(positions))])
        metres = upright_points(positions * METRES_PER_INCH, up=UP)
        columns = [names.index(name) for name in JOINTS]
        return MarkerTrack(tuple(JOINTS.values()), stamps, metres[:, columns])


def is_totalcapture(path: Path) -> bool:
    """Whether a folder has a take's videos, and a calibration in it or above."""
    return path.is_dir() and any(_videos(path)) and calibration_file(path) is not None


def calibration_file(path: Path) -> Path | None:
    """The calibration of a take: in its folder or the nearest above."""
    folder = path.resolve()
    places = (above / CALIBRATION for above in (folder, *list(folder.parents)[:_ABOVE]))
    return next((place for place in places if place.is_file()), None)


def read_cameras(path: Path) -> list[CameraModel]:
    """Read a `calibration.cal`; world and lengths as in the file.

    It holds the number of cameras and of distortion coefficients, and of each camera min_row
    max_row min_col max_col, fx fy cx cy, the coefficients (k1, k2), R row by row, t, with
    X_cam = R X + t.

    Raises:
        CalibrationError: the file cannot be read or is malformed; names the camera and field.
    """
    try:
        values = [float(word) for word in path.read_text(encoding="ascii").split()]
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise CalibrationError(f"{path}: {error}, expected numbers only") from error
    infinite = [number for number, value in enumerate(values, start=1) if not math.isfinite(value)]
    if infinite:
        raise CalibrationError(
            f"{path}: number {infinite[0]} is {values[infinite[0] - 1]}, expected finite numbers"
        )
    count, order = (int(value) for value in (*values[:2], 0, 0)[:2])
    each = 4 + 4 + order + 9 + 3
    if count < 1 or order not in (0, 1, 2) or len(values) != 2 + count * each:
        raise CalibrationError(
            f"{path}: {len(values)} numbers, of which the first say {count} cameras with {order} "
            f"distortion coefficients, expected 2 + {max(count, 1)} * {each}"
        )
    cameras = []
    for number in range(count):
        own = np.array(values[2 + number * each : 2 + (number + 1) * each])
        top, bottom, left, right, fx, fy, cx, cy = own[:8].tolist()
        distortion = np.zeros(5)
        distortion[:order] = own[8 : 8 + order]
        pose = own[8 + order :]
        try:
            cameras.append(
                CameraModel(
                    name=f"cam{number + 1}",
                    size_px=(round(right - left) + 1, round(bottom - top) + 1),
                    matrix=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
                    distortion=distortion,
                    T_cam_world=transform(pose[:9].reshape(3, 3), pose[9:]),
                )
            )
        except CalibrationError as error:
            raise CalibrationError(f"{path}: {error}") from error
    return cameras


def read_positions(path: Path) -> tuple[list[str], FloatArray]:
    """Names (m,) and positions (n, m, 3), in inches, of a `gt_skel_gbl_pos.txt`.

    Raises:
        DatasetError: the file cannot be read or is malformed; names the line.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise DatasetError(f"{path}: cannot be read: {reason}") from error
    names = lines[0].split() if lines else []
    missing = [name for name in JOINTS if name not in names]
    if missing:
        raise DatasetError(f"{path}: line 1: no joint {', '.join(missing)}, expected their names")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        if not words:
            break
        try:
            rows.append(np.array([float(word) for word in words]).reshape(len(names), 3))
        except ValueError as error:
            raise DatasetError(
                f"{path}: line {number}: {len(words)} values, expected {3 * len(names)} numbers"
            ) from error
    return names, np.array(rows).reshape(-1, len(names), 3)


def _videos(path: Path) -> list[tuple[Path, re.Match[str]]]:
    found = []
    for video in sorted(path.iterdir()) if path.is_dir() else []:
        match = _VIDEO.fullmatch(video.stem)
        if match and video.suffix.lower() in VIDEO_SUFFIXES:
            found.append((video, match))
    return found
