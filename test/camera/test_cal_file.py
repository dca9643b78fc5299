"""`.cal` files: their numbers, in every order of the pose, and what is wrong with others."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera.cal_file import read_cal
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import rotation_from_rodrigues

LENS = [700.0, 710.0, 320.0, 240.0, 0.01, -0.1, 0.2, 0.001, -0.002, 0.03]
VECTOR = np.array([1.2, 0.3, -0.4])
ROTATION = rotation_from_rodrigues(VECTOR)
T_MM = np.array([100.0, -200.0, 3000.0])


def write(path: Path, *parts) -> Path:
    values = np.concatenate([np.ravel(part) for part in parts])
    path.write_text("\n".join(f"{value:.15g}" for value in values), encoding="ascii")
    return path


def test_numbers_of_humaneva(tmp_path: Path) -> None:
    found = read_cal(write(tmp_path / "C1.cal", LENS, ROTATION, T_MM), "C1", (640, 480))
    assert (found.name, found.size_px) == ("C1", (640, 480))
    np.testing.assert_allclose(
        found.matrix, [[700.0, 7.0, 320.0], [0.0, 710.0, 240.0], [0.0, 0.0, 1.0]]
    )
    np.testing.assert_allclose(found.distortion, LENS[5:])
    np.testing.assert_allclose(found.T_cam_world[:3, :3], ROTATION, atol=1e-12)
    np.testing.assert_allclose(found.T_cam_world[:3, 3], [0.1, -0.2, 3.0])


@pytest.mark.parametrize("order", list(permutations([ROTATION, T_MM, VECTOR])))
def test_the_pose_with_its_rotation_vector_in_any_order(tmp_path: Path, order) -> None:
    found = read_cal(write(tmp_path / "C1.cal", LENS, *order), "C1", (640, 480))
    np.testing.assert_allclose(found.T_cam_world[:3, :3], ROTATION, atol=1e-12)
    np.testing.assert_allclose(found.T_cam_world[:3, 3], [0.1, -0.2, 3.0])


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([LENS, ROTATION], "19 numbers, expected 22"),
        ([[-1.0, *LENS[1:]], ROTATION, T_MM], "fc is -1 710, expected positive"),
        ([LENS, 2.0 * ROTATION, T_MM], "R .* is not a rotation matrix"),
        ([LENS, ROTATION, T_MM, VECTOR + 0.1], "no rotation matrix R with its rotation vector"),
        ([LENS, ROTATION, [np.nan, 0.0, 0.0]], "not finite"),
    ],
)
def test_other_numbers(tmp_path: Path, parts, message: str) -> None:
    with pytest.raises(CalibrationError, match=f"C1.cal: .*{message}"):
        read_cal(write(tmp_path / "C1.cal", *parts), "C1", (640, 480))


def test_other_files(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="C1.cal: cannot be read: No such file"):
        read_cal(tmp_path / "C1.cal", "C1", (640, 480))
    (tmp_path / "C1.cal").write_text("1 2 three", encoding="ascii")
    with pytest.raises(CalibrationError, match="C1.cal: could not convert .*'three'"):
        read_cal(tmp_path / "C1.cal", "C1", (640, 480))
    (tmp_path / "C1.cal").write_bytes(b"\xff\x00")
    with pytest.raises(CalibrationError, match="C1.cal: not a text file"):
        read_cal(tmp_path / "C1.cal", "C1", (640, 480))
