"""Joints of Human3.6M: `D3_Positions/ACTION.cdf`, files of NASA's CDF, read with cdflib."""

from pathlib import Path

import numpy as np

from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray

FOLDERS = ("MyPoseFeatures/D3_Positions", "Poses_D3_Positions")
"""Where the files are below a subject's folder: as unpacked by tar, and by h36m-fetch."""
JOINTS = {
    "Pelvis": 0, "Neck": 13, "Head": 15,
    "LShoulder": 17, "LElbow": 18, "LWrist": 19, "RShoulder": 25, "RElbow": 26, "RWrist": 27,
    "LHip": 6, "LKnee": 7, "LAnkle": 8, "RHip": 1, "RKnee": 2, "RAnkle": 3,
}  # fmt: skip
"""Our marker -> place of its joint; 15 is the end of the head, its top."""
SHIFTED = ("S9_Greeting", "S9_SittingDown 1", "S9_Waiting 1")
"""Actions whose joints are 0.2 m beside the person in the data set itself."""
_COUNT = 32
_VARIABLE = "Pose"


def joints_file(subject: Path, action: str) -> Path | None:
    """The file of an action's joints below a subject's folder; None without."""
    files = (subject / folder / f"{action}.cdf" for folder in FOLDERS)
    return next((file for file in files if file.is_file()), None)


def read_joints(path: Path) -> FloatArray:
    """(n, 15, 3) positions of `JOINTS` in mm in the world of the cameras; row i is frame i.

    The file's variable Pose has 96 numbers per frame: x, y, z of the 32 joints.

    Raises:
        DatasetError: cdflib is not installed, or the file cannot be read or is malformed.
    """
    try:
        import cdflib
    except ImportError as error:
        raise DatasetError(
            f"{path}: reading CDF needs cdflib: pip install cdflib (extra [formats])"
        ) from error
    expected = f"expected frames x {3 * _COUNT} numbers"
    try:
        content = cdflib.CDF(str(path))
    except Exception as error:  # damaged bytes raise any exception
        raise DatasetError(f"{path}: cannot be read as CDF: {error}") from error
    try:
        stored = np.asarray(content.varget(_VARIABLE))
    except Exception as error:  # as above; a variable that is missing is a ValueError
        raise DatasetError(f"{path}: {_VARIABLE} cannot be read: {error}; {expected}") from error
    if stored.dtype.kind not in "fiu" or stored.shape[-1:] != (3 * _COUNT,) or not stored.size:
        raise DatasetError(
            f"{path}: {_VARIABLE} is {stored.dtype} of shape {stored.shape}, {expected}"
        )
    positions = stored.astype(np.float64).reshape(-1, _COUNT, 3)
    return np.ascontiguousarray(positions[:, list(JOINTS.values())])
