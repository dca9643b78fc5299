"""Calibrations by OpenCV, ROS and EasyMocap beside plain videos and image folders."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import rodrigues_from_rotation

NAMES = ("left", "right")


def storage(path: Path, fields: dict) -> None:
    """A file as OpenCV's FileStorage writes it."""
    file = cv2.FileStorage(str(path), cv2.FileStorage_WRITE)
    for name, value in fields.items():
        file.write(name, value)
    file.release()


def of_opencv(model: CameraModel) -> dict:
    T = model.T_cam_world
    return {
        "image_width": model.size_px[0],
        "image_height": model.size_px[1],
        "camera_matrix": model.matrix,
        "distortion_coefficients": model.distortion.reshape(1, 5),
        "R": T[:3, :3],
        "T": T[:3, 3].reshape(3, 1),
    }


def of_ros(model: CameraModel) -> dict:
    """As camera_calibration's `ost.yaml`."""

    def matrix(values: np.ndarray, rows: int) -> dict:
        flat = np.ravel(values).tolist()
        return {"rows": rows, "cols": len(flat) // rows, "data": flat}

    return {
        "image_width": model.size_px[0],
        "image_height": model.size_px[1],
        "camera_name": model.name,
        "camera_matrix": matrix(model.matrix, 3),
        "distortion_model": "plumb_bob",
        "distortion_coefficients": matrix(model.distortion, 1),
        "rectification_matrix": matrix(np.eye(3), 3),
        "projection_matrix": matrix(np.eye(3, 4), 3),
    }


def write_extrinsics(path: Path, rig: CameraRig) -> None:
    poses = {}
    for camera in rig:
        T = camera.T_world_cam
        quaternion = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
        poses[camera.name] = {
            "translation": dict(zip("xyz", T[:3, 3].tolist(), strict=True)),
            "rotation": dict(zip("xyzw", quaternion, strict=True)),
        }
    path.write_text(yaml.safe_dump(poses), encoding="utf-8")


@pytest.fixture
def folder(write_video, tmp_path: Path) -> Path:
    for number, name in enumerate(NAMES):
        write_video(tmp_path / "trial" / f"{name}.avi", number)
    return tmp_path / "trial"


@pytest.mark.parametrize("suffix", ["yaml", "yml", "xml", "json"])
def test_files_of_opencv(folder: Path, make_rig, check, suffix: str) -> None:
    rig = make_rig(*NAMES)
    assert detect_format(folder) is None
    for model in rig:
        storage(folder / f"{model.name}.{suffix}", of_opencv(model))
    assert detect_format(folder) == "opencv"
    check(open_recording(folder), rig)


def test_files_of_ros_with_poses_of_tf(tmp_path: Path, make_rig, write_images, check) -> None:
    rig, folder = make_rig(*NAMES), tmp_path / "trial"
    (folder / "calibration").mkdir(parents=True)
    for number, model in enumerate(rig):
        write_images(folder / "images" / model.name, number)
        text = yaml.safe_dump(of_ros(model))
        (folder / "calibration" / f"{model.name}.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"left.yaml: no pose, expected R and T .*left in"):
        open_recording(folder, input_fps=30.0)
    write_extrinsics(folder / "calibration" / "extrinsics.yaml", rig)
    with pytest.raises(DatasetError, match="left states no rate, expected --input-fps"):
        open_recording(folder)
    check(open_recording(folder, input_fps=30.0), rig)


def test_a_pair_of_easymocap(folder: Path, make_rig, check) -> None:
    rig = make_rig(*NAMES)
    (folder / "videos").mkdir()
    inner, outer = {"names": "left right"}, {"names": "left right"}
    for model in rig:
        (folder / f"{model.name}.avi").rename(folder / "videos" / f"{model.name}.avi")
        T = model.T_cam_world
        inner |= {f"K_{model.name}": model.matrix, f"dist_{model.name}": model.distortion[None]}
        outer |= {
            f"R_{model.name}": rodrigues_from_rotation(T[:3, :3]).reshape(3, 1),
            f"Rot_{model.name}": T[:3, :3],
            f"T_{model.name}": T[:3, 3].reshape(3, 1),
        }
    storage(folder / "intri.yml", inner)
    storage(folder / "extri.yml", outer)
    assert detect_format(folder) == "opencv"
    check(open_recording(folder), rig)
    del outer["T_right"]
    storage(folder / "extri.yml", outer)
    with pytest.raises(CalibrationError, match="extri.yml: no T_right, expected 3 numbers"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"camera_matrix": None}, "no camera_matrix, expected 3x3 numbers"),
        ({"camera_matrix": np.eye(2)}, "camera_matrix has shape 2x2, expected 3x3"),
        ({"distortion_coefficients": np.ones((1, 8))}, "has 8 coefficients, expected k1 k2 p1"),
        ({"R": 2.0 * np.eye(3)}, "R is not a rotation matrix"),
        ({"T": np.zeros((2, 1))}, "T has shape 2, expected 3"),
        ({"T": None}, "no T, expected 3 numbers"),
        ({"image_width": 100}, "image_width is 100, expected 32 as the images of right"),
        ({"image_width": "wide"}, "image_width is 'wide', expected a finite number"),
        ({"distortion_model": "equidistant"}, "distortion_model is 'equidistant', expected plumb"),
    ],
)
def test_malformed_fields_are_named(folder: Path, make_rig, change: dict, message: str) -> None:
    left, right = make_rig(*NAMES)
    storage(folder / "left.yaml", of_opencv(left))
    fields = {**of_opencv(right), **change}
    storage(folder / "right.yaml", {k: v for k, v in fields.items() if v is not None})
    with pytest.raises(CalibrationError, match=f"right.yaml: .*{message}"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1, 2]", "expected a mapping, got list"),
        ("a: [", "not a YAML file"),
        (
            "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n",
            "camera_matrix: rows and cols are 3 and 0",
        ),
        ("%YAML:1.0\n---\nx: [", "cannot be read by OpenCV"),
        (
            "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 1\n   cols: -7\n   dt: d\n"
            "   data: [ 1., 2., 3. ]\n",
            "camera_matrix: rows and cols are 1 and -7, data has 3 values",
        ),
        ("camera_matrix: {rows: 3, cols: 3, data: [1, 2]}", "camera_matrix: data is .*3x3 numbers"),
    ],
)
def test_malformed_files_are_named(folder: Path, text: str, message: str) -> None:
    (folder / "left.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match=f"left.yaml: .*{message}"):
        open_recording(folder)


@pytest.mark.parametrize(
    "text",
    [
        "left: 3",
        "left: {translation: {x: 1, y: 2}, rotation: {x: 0, y: 0, z: 0, w: 1}}",
        "left: {translation: {x: N, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}".replace(
            "N", "1" + "0" * 400
        ),
    ],
)
def test_malformed_poses_are_named(folder: Path, make_rig, text: str) -> None:
    left, _ = make_rig(*NAMES)
    (folder / "left.yaml").write_text(yaml.safe_dump(of_ros(left)), encoding="utf-8")
    (folder / "extrinsics.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match="extrinsics.yaml: left: expected translation x, y"):
        open_recording(folder)
    text = "left: {translation: {x: 1, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 2}}"
    (folder / "extrinsics.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match="left: rotation is no unit quaternion"):
        open_recording(folder)
    text = "left: {translation: {x: 1, y: .nan, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}"
    (folder / "extrinsics.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"left: translation is \[1.0, nan, 3.0\]"):
        open_recording(folder)


def test_a_camera_without_its_other_half_is_left_out_with_a_warning(
    folder: Path, make_rig, write_video, check
) -> None:
    rig = make_rig(*NAMES)
    for model in make_rig(*NAMES, "top"):
        storage(folder / f"{model.name}.yaml", of_opencv(model))
    write_video(folder / "phone.avi", 2)
    recording = open_recording(folder)
    check(recording, rig)
    unused, unknown = recording.warnings
    assert unused.endswith("top.yaml: left out, there are no images of top")
    assert unknown.endswith("phone.avi: left out, there is no calibration phone.yaml")


def test_without_images(folder: Path) -> None:
    with pytest.raises(DatasetError, match="no images of any camera"):
        open_recording(folder, format="opencv")


def test_vectors_as_opencv_5_writes_them(folder: Path, make_rig) -> None:
    """One-dimensional arrays have `sizes` instead of `rows` and `cols`. With a byte order mark."""
    rig = make_rig(*NAMES)
    for model in rig:
        numbers = of_opencv(model)
        numbers |= {"T": model.T_cam_world[:3, 3], "distortion_coefficients": model.distortion}
        file = folder / f"{model.name}.yml"
        storage(file, numbers)
        file.write_text(file.read_text(), encoding="utf-8-sig")
    for read, true in zip(open_recording(folder).rig, rig, strict=True):
        np.testing.assert_allclose(read.T_cam_world, true.T_cam_world, atol=1e-9)
        np.testing.assert_allclose(read.distortion, true.distortion, atol=1e-9)


@pytest.mark.parametrize("sizes", ["[ 4 ]", "[ 3, 2 ]", "[ 0 ]", "[ -1 ]", "3"])
def test_vectors_of_another_size_are_refused(folder: Path, make_rig, sizes: str) -> None:
    for model in make_rig(*NAMES):
        file = folder / f"{model.name}.yml"
        storage(file, of_opencv(model))
        lines = file.read_text().splitlines()
        vector = f"T: !!opencv-nd-matrix\n   sizes: {sizes}\n   dt: d\n   data: [ 0., 0. ]"
        at = next(number for number, line in enumerate(lines) if line.startswith("T:"))
        file.write_text("\n".join([*lines[:at], vector, ""]))
    with pytest.raises(CalibrationError, match=r"left.yml: T: sizes are .*, data has 2 values"):
        open_recording(folder)
