"""HumanEva-II: images, calibration, mocap in step with them, the empty scene."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.io import savemat

from markerless_tracker.datasets import MarkerTrack, detect_format, open_recording, write_trc
from markerless_tracker.errors import CalibrationError, DatasetError

from .conftest import FRAMES, SIZE, cal_numbers, picture

ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed (extra [formats])")
NAMES = ("C1", "C2")
POINTS = [side + point for point in ("FEP", "FEO", "TIO", "CLO", "HUO", "RAO") for side in "LR"]


def write_c3d(path: Path, positions_mm: np.ndarray, labels=POINTS) -> None:
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = [f"S2:{label}" for label in labels]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, positions_mm.shape[1], positions_mm.shape[0]))
    points[:3] = positions_mm.transpose(2, 1, 0)
    content["data"]["points"] = points
    content.write(str(path))


@pytest.fixture
def subject(make_rig, write_images, tmp_path: Path) -> Path:
    """Three images of two cameras; five frames of mocap, the first one of the first image."""
    folder = tmp_path / "S2"
    for part in ("Calibration_Data", "Sync_Data", "Mocap_Data", "Background"):
        (folder / part).mkdir(parents=True)
    for number, model in enumerate(make_rig(*NAMES)):
        images = folder / "Image_Data" / f"Combo_1_({model.name})"
        write_images(images, number, "frame{:05d}.bmp")
        cal = folder / "Calibration_Data" / f"{model.name}.cal"
        cal.write_text(cal_numbers(model), encoding="ascii")
        sync = folder / "Sync_Data" / f"Combo_1_({model.name}).ofs"
        sync.write_text("1\n1\n2\n", encoding="ascii")
    rng = np.random.default_rng(1)
    mocap = rng.normal(0.0, 500.0, (5, len(POINTS), 3))
    mocap[3, 0] = 0.0
    write_c3d(folder / "Mocap_Data" / "Combo_1.c3d", mocap)
    np.save(tmp_path / "mocap.npy", mocap)
    return folder


def test_images_and_cameras(subject: Path, make_rig, check) -> None:
    assert detect_format(subject) == "humaneva"
    recording = open_recording(subject)
    check(recording, make_rig(*NAMES))
    assert (recording.name, recording.fps, recording.warnings) == ("S2_Combo_1", 60.0, ())
    assert open_recording(subject, input_fps=30.0).fps == 30.0
    half = open_recording(subject, scale=0.5)
    assert half.rig["C1"].size_px == (16, 12)


def test_mocap_has_the_times_of_the_images(subject: Path, tmp_path: Path) -> None:
    truth = open_recording(subject).ground_truth()
    assert set(truth.names) == {
        side + joint
        for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")
        for side in "LR"
    }
    # 120 Hz: every second frame belongs to an image.
    assert truth.stamps_ns[::2].tolist() == [0, 16_666_667, 33_333_333]
    mocap = np.load(tmp_path / "mocap.npy") / 1000.0
    np.testing.assert_allclose(
        truth.positions_m[:, truth.names.index("RElbow")], mocap[:, POINTS.index("RHUO")], atol=1e-6
    )
    # A point at the origin is missing.
    assert np.isnan(truth.positions_m[3, truth.names.index("LHip")]).all()
    for name in NAMES:
        (subject / "Sync_Data" / f"Combo_1_({name}).ofs").write_text("2 1 2", encoding="ascii")
    assert open_recording(subject).ground_truth().stamps_ns[0] == 16_666_667
    for name in NAMES:
        (subject / "Sync_Data" / f"Combo_1_({name}).ofs").write_text("1 3 2", encoding="ascii")
    assert len(open_recording(subject).ground_truth()) == 3


def test_exported_mocap_and_none(subject: Path) -> None:
    (subject / "Mocap_Data" / "Combo_1.c3d").unlink()
    assert open_recording(subject).ground_truth() is None
    names = ("torsoDistal", "upperLArmProximal")
    track = MarkerTrack(names, np.array([0, 8_333_333]), np.ones((2, 2, 3)))
    write_trc(subject / "Mocap_Data" / "Combo_1.trc", track, 120.0)
    truth = open_recording(subject).ground_truth()
    assert truth.names == ("Pelvis", "LShoulder") and truth.stamps_ns.tolist() == [0, 8_333_333]


def test_the_images_of_a_camera_choose_the_trial(subject: Path, write_images) -> None:
    for number, name in enumerate(NAMES):
        write_images(subject / "Image_Data" / f"Combo_4_({name})", number, frames=1)
    with pytest.raises(DatasetError, match="Image_Data: trials Combo_1, Combo_4, expected one"):
        open_recording(subject)
    chosen = subject / "Image_Data" / "Combo_4_(C2)"
    assert detect_format(chosen) == "humaneva"
    assert open_recording(chosen).name == "S2_Combo_4"


def test_videos(subject: Path, make_rig, write_video, check) -> None:
    for number, name in enumerate(NAMES):
        shutil.rmtree(subject / "Image_Data" / f"Combo_1_({name})")
        write_video(subject / "Image_Data" / f"Combo_1_({name}).avi", number)
    recording = open_recording(subject)
    check(recording, make_rig(*NAMES))
    assert recording.fps == 60.0


def test_the_empty_scene_from_clips_or_statistics(subject: Path, write_images) -> None:
    assert open_recording(subject).background_frames() == {}
    write_images(subject / "Background" / "Background_1_(C1)", 7, frames=2)
    write_images(subject / "Background" / "Background_2_(C1)", 8, frames=1)
    means = np.empty((1, 2), dtype=object)
    means[0, 0] = picture(9, 0)[..., ::-1] / 255.0
    means[0, 1] = picture(9, 1)[..., ::-1] / 255.0
    file = subject / "Background" / "Background_(C2).mat"
    savemat(file, {"bg_means": means, "bg_vars": means})
    found = open_recording(subject).background_frames()
    for image, (number, frame) in zip(found["C1"], [(7, 0), (7, 1), (8, 0)], strict=True):
        np.testing.assert_array_equal(image, picture(number, frame))
    for frame, image in enumerate(found["C2"]):
        np.testing.assert_array_equal(image, picture(9, frame))
    savemat(file, {"other": means})
    with pytest.raises(DatasetError, match=r"Background_\(C2\).mat: no bg_means"):
        open_recording(subject).background_frames()
    means[0, 1] = np.zeros((4, 4))
    savemat(file, {"bg_means": means})
    with pytest.raises(DatasetError, match=r"bg_means 2 has shape \(4, 4\), expected \(h, w, 3\)"):
        open_recording(subject).background_frames()
    file.write_bytes(b"no file of MATLAB")
    with pytest.raises(DatasetError, match=r"Background_\(C2\).mat: cannot be read as a MATLAB"):
        open_recording(subject).background_frames()
    file.unlink()
    cv2.imwrite(str(subject / "Background" / "Background_1_(C1)" / "9.png"), np.zeros((4, 4, 3)))
    with pytest.raises(DatasetError, match=f"C1: images of 4x4 px, expected {SIZE[0]}x{SIZE[1]}"):
        open_recording(subject).background_frames()


def test_statistics_are_a_mixture_with_their_variances(subject: Path, write_images) -> None:
    def cells(values: list[np.ndarray]) -> np.ndarray:
        found = np.empty((1, len(values)), dtype=object)
        found[0] = values
        return found

    file = subject / "Background" / "Background_(C2).mat"
    means = [picture(9, number)[..., ::-1] / 255.0 for number in range(2)]
    spread = np.random.default_rng(3).uniform(1e-4, 1e-2, means[0].shape)
    spread[0, 0] = 0.0
    savemat(file, {"bg_means": cells(means), "bg_vars": cells([spread, 2.0 * spread])})
    models = open_recording(subject).background_models()
    assert list(models) == ["C2"]
    model = models["C2"]
    np.testing.assert_array_equal(model.image, picture(9, 0))
    expected = np.where(spread > 0.0, spread, 1e-3)[..., ::-1] * 255.0**2
    np.testing.assert_allclose(model.variance, expected, rtol=1e-5)
    (mode,) = model.modes
    assert (mode.weight == 0.5).all()
    np.testing.assert_allclose(mode.mean, picture(9, 1), atol=1e-3)
    np.testing.assert_allclose(mode.variance[1:], 2.0 * expected[1:], rtol=1e-5)
    assert open_recording(subject, scale=0.5).background_models()["C2"].size_px == (16, 12)
    for variances, message in (
        ([spread], "bg_vars has 1 cells, expected 2"),
        ([spread, -spread], "bg_vars 2 has negative values"),
        ([spread, spread * np.nan], "bg_vars 2 has shape .*finite"),
    ):
        savemat(file, {"bg_means": cells(means), "bg_vars": cells(variances)})
        with pytest.raises(DatasetError, match=rf"Background_\(C2\).mat: {message}"):
            open_recording(subject).background_models()
    # Clips go before statistics.
    write_images(subject / "Background" / "Background_1_(C2)", 7, frames=1)
    assert open_recording(subject).background_models() == {}


def test_malformed_files_are_named(subject: Path) -> None:
    sync = subject / "Sync_Data" / "Combo_1_(C2).ofs"
    for text, message in (
        ("1 1", "im_st mc_st mc_sc has 2 numbers, expected 3"),
        ("1 1 x", "im_st mc_st mc_sc: could not convert"),
        ("1 1 0", "mc_sc is 0, expected above 0"),
        ("1 20 2", "is 1 20 2, that of the first camera 1 1 2"),
    ):
        sync.write_text(text, encoding="ascii")
        with pytest.raises(DatasetError, match=rf"Combo_1_\(C2\).ofs.*{message}"):
            open_recording(subject).ground_truth()
    sync.unlink()
    with pytest.raises(DatasetError, match=r"Combo_1_\(C2\).ofs: .* cannot be read: No such file"):
        open_recording(subject).ground_truth()
    write_c3d(subject / "Mocap_Data" / "Combo_1.c3d", np.ones((5, 2, 3)), ["LFEP", "RFEP"])
    sync.write_text("1 1 2", encoding="ascii")
    with pytest.raises(DatasetError, match=r"Combo_1.c3d: no label LFEO, .*S2:LFEP"):
        open_recording(subject).ground_truth()
    (subject / "Calibration_Data" / "C2.cal").unlink()
    with pytest.raises(CalibrationError, match="C2.cal: cannot be read"):
        open_recording(subject)
    shutil.rmtree(subject / "Image_Data")
    (subject / "Image_Data").mkdir()
    with pytest.raises(DatasetError, match="Image_Data: trials none, expected one"):
        open_recording(subject)
    assert FRAMES == 3
