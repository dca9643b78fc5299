"""TotalCapture and MPI-INF-3DHP: small files of their formats."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.datasets.formats import mpi_inf_3dhp, totalcapture
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import apply

from .conftest import FRAMES, SIZE, TRUTH_M, changed, in_world_of, points_of, with_lens

# --- TotalCapture


def total_rig(make_rig) -> CameraRig:
    return with_lens(make_rig("cam1", "cam2"), [-0.1, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture
def take(make_rig, write_video, tmp_path: Path) -> Path:
    root = tmp_path / "totalcapture"
    folder = root / "video" / "S1" / "walking2"
    lines = ["2 1"]
    for number, camera in enumerate(in_world_of(total_rig(make_rig), up="y")):
        write_video(folder / f"TC_S1_walking2_{camera.name}.avi", number)
        K, T = camera.matrix, camera.T_cam_world
        lines += [
            f"0 {SIZE[1] - 1} 0 {SIZE[0] - 1}",
            f"{K[0, 0]!r} {K[1, 1]!r} {K[0, 2]!r} {K[1, 2]!r}",
            repr(camera.distortion[0]),
            *(" ".join(map(repr, row)) for row in (*T[:3, :3].tolist(), T[:3, 3].tolist())),
        ]
    text = "\n".join(lines).replace("np.float64(", "").replace(")", "")
    (root / "calibration.cal").write_text(text + "\n", encoding="ascii")
    return folder


def write_positions(take: Path) -> Path:
    names = ["Head", *totalcapture.JOINTS, "Spine3"]
    stated = points_of(TRUTH_M[:, : len(names)], up="y") / 0.0254
    rows = ["\t".join(" ".join(map(str, p)) for p in row) for row in stated.tolist()]
    path = take.parents[2] / "vicon" / "S1" / "walking2" / "gt_skel_gbl_pos.txt"
    path.parent.mkdir(parents=True)
    path.write_text("\n".join(["\t".join(names), *rows, "", ""]), encoding="ascii")
    return path


def test_totalcapture_cameras_and_joints(take: Path, make_rig, check) -> None:
    assert detect_format(take) == "totalcapture"
    recording = open_recording(take)
    check(recording, total_rig(make_rig))
    assert recording.name == "S1_walking2" and recording.ground_truth() is None
    write_positions(take)
    truth = recording.ground_truth()
    assert truth.names == tuple(totalcapture.JOINTS.values()) and len(truth) == FRAMES
    np.testing.assert_allclose(truth.positions_m, TRUTH_M[:, 1:15], atol=1e-12)
    # A choice of cameras keeps their calibrations.
    (take / "TC_S1_walking2_cam1.avi").unlink()
    kept, true = open_recording(take).rig, total_rig(make_rig)
    assert kept.names == ("cam2",)
    np.testing.assert_allclose(kept["cam2"].T_cam_world, true["cam2"].T_cam_world, atol=1e-12)


def test_totalcapture_files_that_are_malformed(take: Path, write_video) -> None:
    recording, path = open_recording(take), write_positions(take)
    changed(path, "Hips", "Hip")
    with pytest.raises(DatasetError, match="pos.txt: line 1: no joint Hips"):
        recording.ground_truth()
    changed(path, "Hip\t", "Hips\t")
    text = path.read_text(encoding="ascii").splitlines()
    path.write_text("\n".join([*text[:2], text[2] + " 7"]), encoding="ascii")
    with pytest.raises(DatasetError, match="pos.txt: line 3: 49 values, expected 48 numbers"):
        recording.ground_truth()
    write_video(take / "TC_S1_walking3_cam3.avi", 0)
    with pytest.raises(DatasetError, match="takes walking2, walking3, expected .* of one"):
        open_recording(take)
    (take / "TC_S1_walking3_cam3.avi").rename(take / "TC_S1_walking2_cam3.avi")
    with pytest.raises(CalibrationError, match="2 cameras, but there is a video of camera 3"):
        open_recording(take)
    calibration = take.parents[2] / "calibration.cal"
    text = calibration.read_text(encoding="ascii")
    for number in (1, 3, 8):
        words = text.split()
        words[number - 1] = "nan"
        calibration.write_text(" ".join(words), encoding="ascii")
        with pytest.raises(CalibrationError, match=f"calibration.cal: number {number} is nan"):
            open_recording(take)
    calibration.write_text(text, encoding="ascii")
    changed(calibration, "2 1\n", "3 1\n")
    with pytest.raises(CalibrationError, match="44 numbers, of which the first say 3 cameras"):
        open_recording(take)
    calibration.write_text("two cameras", encoding="ascii")
    with pytest.raises(CalibrationError, match="calibration.cal: .*'two', expected numbers only"):
        open_recording(take)
    calibration.unlink()
    assert detect_format(take) is None


# --- MPI-INF-3DHP


@pytest.fixture
def mpi(make_rig, write_video, tmp_path: Path) -> Path:
    folder = tmp_path / "S1" / "Seq2"
    rig = with_lens(make_rig("video_0", "video_7"), [0.0] * 5)
    lines, cells = ["Skeleton"], np.empty((8, 1), dtype=object)
    cells[:, 0] = [np.zeros((0, 84))] * 8
    for number, camera in enumerate(in_world_of(rig, up="y", units="mm")):
        write_video(folder / "imageSequence" / f"{camera.name}.avi", number)
        K = np.eye(4)
        K[:3, :3] = camera.matrix
        values = [" ".join(map(str, m.ravel().tolist())) for m in (K, camera.T_cam_world)]
        lines += [
            f"name          {camera.name.removeprefix('video_')}", "  sensor        10 10",
            f"  size          {SIZE[0]} {SIZE[1]}", "  animated      0",
            f"  intrinsic     {values[0]} ", f"  extrinsic     {values[1]} ", "  radial        0",
        ]  # fmt: skip
        stated = points_of(TRUTH_M.reshape(-1, 3), up="y", units="mm")
        joints = apply(camera.T_cam_world, stated).reshape(FRAMES, -1)
        cells[int(camera.name.removeprefix("video_")), 0] = joints
    (folder / "camera.calibration").write_text("\n".join(lines) + "\n", encoding="ascii")
    savemat(folder / "annot.mat", {"annot3": cells})
    return folder


def test_mpi_inf_3dhp_cameras_and_joints(mpi: Path, make_rig, check) -> None:
    assert detect_format(mpi) == "mpi_inf_3dhp"
    recording = open_recording(mpi)
    check(recording, with_lens(make_rig("video_0", "video_7"), [0.0] * 5))
    assert recording.name == "S1_Seq2"
    truth = recording.ground_truth()
    assert truth.names == mpi_inf_3dhp.JOINTS and len(truth) == FRAMES
    np.testing.assert_allclose(truth.positions_m, TRUTH_M, atol=1e-9)
    (mpi / "imageSequence" / "video_0.avi").unlink()
    truth = open_recording(mpi).ground_truth()
    np.testing.assert_allclose(truth.positions_m, TRUTH_M, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  intrinsic     40.0", "  intrinsic     a", "video_0: intrinsic is .*4 x 4 finite"),
        ("  extrinsic", "  outside", "video_0: extrinsic is missing, expected 4 x 4 numbers"),
        ("radial        0", "radial        1", "video_0: radial is 1, expected 0"),
        ("name", "camera", "no camera, expected lines `name 0`"),
    ],
)
def test_mpi_inf_3dhp_calibrations_that_are_malformed(mpi, old, new, message) -> None:
    changed(mpi / "camera.calibration", old, new)
    with pytest.raises(CalibrationError, match=f"camera.calibration: {message}"):
        open_recording(mpi)


def test_mpi_inf_3dhp_calibration_that_is_cut(mpi: Path) -> None:
    file = mpi / "camera.calibration"
    text = file.read_text(encoding="ascii")
    file.write_text(text[: text.rindex("name")], encoding="ascii")
    with pytest.raises(CalibrationError, match="camera.calibration: no camera video_7, expected"):
        open_recording(mpi)


def test_mpi_inf_3dhp_annotations_that_are_malformed(mpi: Path) -> None:
    recording = open_recording(mpi)
    cells = np.empty((1, 1), dtype=object)
    cells[0, 0] = np.zeros((3, 50))
    savemat(mpi / "annot.mat", {"annot3": cells})
    with pytest.raises(DatasetError, match=r"annot3 of camera 0 has shape \(3, 50\), expected"):
        recording.ground_truth()
    savemat(mpi / "annot.mat", {"annot2": cells})
    with pytest.raises(DatasetError, match="annot3 has 0 cells"):
        recording.ground_truth()
    (mpi / "annot.mat").write_bytes(b"broken")
    with pytest.raises(DatasetError, match="cannot be read as a MATLAB file"):
        recording.ground_truth()
