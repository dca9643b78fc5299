"""Pose2Sim projects: videos matched with their calibration, sizes that differ."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera import CameraRig, read_calibration, write_calibration
from markerless_tracker.datasets import Pose2SimRecording, open_recording, write_image
from markerless_tracker.errors import DatasetError


@pytest.fixture
def project(make_recording) -> Path:
    folder = make_recording(backgrounds=0)
    (folder / "videos").mkdir()
    (folder / "calibration").mkdir()
    for video in folder.glob("*.mkv"):
        video.rename(folder / "videos" / video.name)
    (folder / "calibration.toml").rename(folder / "calibration" / "Calib_scene.toml")
    return folder


def test_a_project_is_read(project: Path) -> None:
    recording = open_recording(project)
    assert isinstance(recording, Pose2SimRecording)
    assert recording.warnings == () and recording.room_stills() == {}
    assert len(list(recording.frames())) == 6


def test_the_matrix_is_scaled_to_the_video_per_axis(project: Path) -> None:
    path = project / "calibration" / "Calib_scene.toml"
    path.write_text(path.read_text().replace("[64, 48]", "[68.0, 96.0]", 1))
    stored = read_calibration(path)["cam01"].matrix
    recording = open_recording(project)
    matrix = recording.rig["cam01"].matrix
    np.testing.assert_allclose(matrix[0], stored[0] * 64 / 68, rtol=1e-15)
    np.testing.assert_allclose(matrix[1], stored[1] * 48 / 96, rtol=1e-15)
    assert recording.rig["cam01"].size_px == (64, 48)
    assert len(recording.warnings) == 1
    assert "cam01" in recording.warnings[0] and "68x96" in recording.warnings[0]


def test_videos_with_other_names_are_paired_in_order(project: Path) -> None:
    for name, other in (("cam01", "a"), ("cam02", "b")):
        (project / "videos" / f"{name}.mkv").rename(project / "videos" / f"{other}.mkv")
    recording = open_recording(project)
    assert "cam01 = a.mkv, cam02 = b.mkv" in recording.warnings[0]
    (project / "videos" / "c.mkv").write_bytes(b"")
    with pytest.raises(DatasetError, match="3 videos.*cam01, cam02"):
        open_recording(project)


def test_no_calibration_and_two_calibrations_are_refused(project: Path) -> None:
    toml = project / "calibration" / "Calib_scene.toml"
    shutil.copy(toml, project / "calibration" / "other.toml")
    with pytest.raises(DatasetError, match="Calib_scene.toml, other.toml"):
        open_recording(project)
    toml.unlink()
    (project / "calibration" / "other.toml").unlink()
    with pytest.raises(DatasetError, match="no calibration"):
        open_recording(project)


def test_a_project_without_calibration_folder_is_refused_by_format(project: Path) -> None:
    shutil.rmtree(project / "calibration")
    with pytest.raises(DatasetError, match="no calibration folder"):
        open_recording(project, format="pose2sim")


def test_room_stills_are_scaled_to_the_images(project: Path) -> None:
    still = np.zeros((96, 68, 3), np.uint8)
    write_image(project / "calibration" / "extrinsics" / "cam02_ext.png", still)
    stills = open_recording(project, scale=0.5).room_stills()
    assert list(stills) == ["cam02"] and stills["cam02"][0].shape == (24, 32, 3)


def test_qualisys_calibration_gives_the_same_rig(project: Path) -> None:
    toml = project / "calibration" / "Calib_scene.toml"
    rig = read_calibration(toml)
    toml.unlink()
    (project / "calibration" / "Calib.qca.txt").write_text(qca(rig))
    for read, expected in zip(open_recording(project).rig, rig, strict=True):
        np.testing.assert_allclose(read.matrix, expected.matrix, atol=1e-9)
        np.testing.assert_allclose(read.T_cam_world, expected.T_cam_world, atol=1e-9)
        np.testing.assert_array_equal(read.distortion, expected.distortion)


def qca(rig: CameraRig) -> str:
    cameras = ""
    for camera in rig:
        r = np.diag([1.0, -1.0, -1.0]) @ camera.T_cam_world[:3, :3]
        x, y, z = camera.T_world_cam[:3, 3] * 1000.0
        cells = " ".join(f'r{i + 1}{j + 1}="{r[i, j]}"' for i in range(3) for j in range(3))
        k, (k1, k2, p1, p2, k3) = camera.matrix * 64.0, camera.distortion
        cameras += (
            f'<camera serial="{camera.name}"><fov_video_max left="0" top="0" '
            f'right="{camera.size_px[0] - 1}" bottom="{camera.size_px[1] - 1}"/>'
            f'<transform {cells} x="{x}" y="{y}" z="{z}"/>'
            f'<intrinsic focalLengthU="{k[0, 0]}" focalLengthV="{k[1, 1]}" '
            f'centerPointU="{k[0, 2]}" centerPointV="{k[1, 2]}" skew="0" '
            f'radialDistortion1="{k1}" radialDistortion2="{k2}" radialDistortion3="{k3}" '
            f'tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/></camera>'
        )
    return f"<calibration><cameras>{cameras}</cameras></calibration>"


def test_a_real_rig_round_trips_through_qualisys(balance_real: Path, tmp_path: Path) -> None:
    from markerless_tracker.camera import read_qca

    rig = read_calibration(balance_real / "calibration.toml")
    (tmp_path / "rig.qca.txt").write_text(qca(rig))
    write_calibration(tmp_path / "rig.toml", read_qca(tmp_path / "rig.qca.txt"))
    for read, expected in zip(read_calibration(tmp_path / "rig.toml"), rig, strict=True):
        np.testing.assert_allclose(read.matrix, expected.matrix, atol=1e-9)
        np.testing.assert_allclose(read.T_cam_world, expected.T_cam_world, atol=1e-9)


def test_a_trial_of_a_batch_session_has_the_calibration_beside_it(project: Path) -> None:
    trial = project / "Trial_1"
    trial.mkdir()
    (project / "videos").rename(trial / "videos")
    recording = open_recording(trial)
    assert isinstance(recording, Pose2SimRecording) and recording.name == "Trial_1"
    assert len(list(recording.frames())) == 6
