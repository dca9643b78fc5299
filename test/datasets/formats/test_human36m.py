"""Human3.6M: small files of its formats."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.datasets.formats.human36m_joints import JOINTS
from markerless_tracker.errors import CalibrationError, DatasetError

from .conftest import FRAMES, TRUTH_M, changed, in_world_of

POSES = Path("MyPoseFeatures", "D3_Positions")


@pytest.fixture
def subject(make_rig, write_video, tmp_path: Path) -> Path:
    folder = tmp_path / "h36m" / "S5"
    rig = in_world_of(make_rig("cam_54138969", "cam_58860488"), units="mm")
    poses, lenses = np.zeros((4, 11, 6)), np.zeros((4, 9))
    for number, (row, camera) in enumerate(zip((0, 2), rig, strict=True)):
        T_cam_world = camera.T_cam_world.copy()
        R, t = T_cam_world[:3, :3], T_cam_world[:3, 3]
        poses[row, [4, 8]] = [*Rotation.from_matrix(R).as_euler("XYZ"), *(-R.T @ t)]
        k1, k2, p1, p2, k3 = camera.distortion
        K = camera.matrix
        lenses[row] = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], k1, k2, k3, p1, p2]
        name = camera.name.removeprefix("cam_")
        write_video(folder / "Videos" / f"Walking 1.{name}.avi", number)
        write_video(folder / "Videos" / f"_ALL.{name}.avi", number)
    numbers = " ".join(map(str, [*poses.ravel().tolist(), *lenses.ravel().tolist()]))
    text = f"<metadata><w0>[{numbers}]</w0></metadata>"
    (tmp_path / "h36m" / "Release-v1.2").mkdir()
    (tmp_path / "h36m" / "Release-v1.2" / "metadata.xml").write_text(text, encoding="utf-8")
    return folder


def test_human36m_cameras_of_a_subject(subject: Path, write_video, make_rig, check) -> None:
    rig = make_rig("cam_54138969", "cam_58860488")
    assert detect_format(subject) == "human36m"
    recording = open_recording(subject)
    check(recording, rig)
    assert recording.name == "S5_Walking 1" and recording.ground_truth() is None
    for number, name in enumerate(("54138969", "58860488")):
        write_video(subject / "Videos" / f"Phoning.{name}.avi", number)
    with pytest.raises(DatasetError, match="actions Phoning, Walking 1, expected one"):
        open_recording(subject)
    video = subject / "Videos" / "Phoning.58860488.avi"
    assert detect_format(video) == "human36m"
    check(open_recording(video), rig)


def test_human36m_metadata_that_is_malformed(subject: Path) -> None:
    path = subject.parent / "Release-v1.2" / "metadata.xml"
    whole = path.read_text(encoding="utf-8")
    changed(path, "[0.", "[0. 0.")
    with pytest.raises(CalibrationError, match="w0 has 301 numbers, expected 300"):
        open_recording(subject)
    path.write_text(whole.replace("w0", "w1"), encoding="utf-8")
    with pytest.raises(CalibrationError, match="w0 has 0 numbers, expected 300"):
        open_recording(subject)
    path.write_text("no XML", encoding="utf-8")
    with pytest.raises(CalibrationError, match="metadata.xml: cannot be read as XML"):
        open_recording(subject)
    path.write_text(whole.replace("40.0", "-40.0"), encoding="utf-8")
    with pytest.raises(CalibrationError, match="w0: cam_54138969 of S5: .*focal lengths"):
        open_recording(subject)
    path.unlink()
    assert detect_format(subject) is None
    path.write_text(whole, encoding="utf-8")
    subject.rename(subject.with_name("walks"))
    with pytest.raises(DatasetError, match="walks: expected a subject's folder S1, ..., S11"):
        open_recording(subject.with_name("walks"))


@pytest.fixture
def write_cdf() -> Callable[..., Path]:
    """`write_cdf(path, values, name)`: a CDF with one variable of one record."""
    cdfwrite = pytest.importorskip(
        "cdflib.cdfwrite", reason="cdflib is not installed (extra [formats])"
    )

    def write(path: Path, values: np.ndarray, name: str = "Pose") -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        text = values.dtype.kind == "U"
        spec: dict[str, Any] = {
            "Variable": name,
            "Data_Type": 51 if text else 44,  # CDF_CHAR, CDF_REAL4
            "Num_Elements": 5 if text else 1,
            "Rec_Vary": True,
            "Dim_Sizes": [] if text else list(values.shape),
        }
        file = cdfwrite.CDF(path)
        file.write_var(spec, var_data=values if text else values[None].astype(np.float32))
        file.close()
        return path

    return write


def stated_mm() -> np.ndarray:
    """(frames, 96): the joints that are read from TRUTH_M, the others far away."""
    joints = np.full((FRAMES, 32, 3), 9e4)
    joints[:, list(JOINTS.values())] = TRUTH_M[:, : len(JOINTS)] * 1000.0
    return joints.reshape(FRAMES, -1)


def test_human36m_joints_of_an_action(subject: Path, write_cdf) -> None:
    recording = open_recording(subject)
    path = write_cdf(subject / POSES / "Walking 1.cdf", stated_mm())
    write_cdf(subject / POSES / "Walking.cdf", stated_mm() + 1e3)
    truth = recording.ground_truth()
    assert truth.names[:3] == ("Pelvis", "Neck", "Head") and len(truth.names) == 15
    assert truth.stamps_ns.tolist() == [0, 33_333_333, 66_666_667]
    np.testing.assert_allclose(truth.positions_m, TRUTH_M[:, :15], atol=1e-6)
    # The skeleton that the data set states: 0 Hips, 1 RightUpLeg, 6 LeftUpLeg, 19 LeftHand, ...
    places = {"Pelvis": 0, "RHip": 1, "LHip": 6, "LWrist": 19, "RShoulder": 25}
    for name, place in places.items():
        stated = stated_mm().reshape(FRAMES, 32, 3)[:, place] / 1000.0
        np.testing.assert_allclose(truth.positions_m[:, truth.names.index(name)], stated, atol=1e-6)
    assert recording.warnings == ()
    # As h36m-fetch unpacks them.
    path.unlink()
    assert recording.ground_truth() is None
    write_cdf(subject / "Poses_D3_Positions" / "Walking 1.cdf", stated_mm())
    np.testing.assert_array_equal(recording.ground_truth().positions_m, truth.positions_m)


def test_human36m_joints_that_are_known_to_be_wrong(subject: Path, write_cdf) -> None:
    subject = subject.rename(subject.with_name("S9"))
    for video in (subject / "Videos").glob("Walking 1.*"):
        video.rename(video.with_name(video.name.replace("Walking 1", "Greeting")))
    write_cdf(subject / POSES / "Greeting.cdf", stated_mm())
    recording = open_recording(subject)
    np.testing.assert_allclose(recording.ground_truth().positions_m, TRUTH_M[:, :15], atol=1e-6)
    assert "S9_Greeting: the data set has the joints of this action 0.2 m" in recording.warnings[0]


@pytest.mark.parametrize(
    ("values", "name", "message"),
    [
        (np.zeros((3, 64)), "Pose", r"Pose is float32 of shape \(1, 3, 64\), expected frames x 96"),
        (np.array(["words"]), "Pose", r"Pose is <U5 of shape \(1,\), expected frames x 96"),
        (np.zeros((3, 96)), "Poses", "Pose cannot be read: .*Pose.*; expected frames x 96"),
    ],
)
def test_human36m_joints_that_are_malformed(subject, write_cdf, values, name, message) -> None:
    write_cdf(subject / POSES / "Walking 1.cdf", values, name)
    with pytest.raises(DatasetError, match=f"Walking 1.cdf: {message}"):
        open_recording(subject).ground_truth()


def test_human36m_files_of_joints_that_are_damaged(subject: Path, write_cdf) -> None:
    recording = open_recording(subject)
    path = write_cdf(subject / POSES / "Walking 1.cdf", stated_mm())
    whole = path.read_bytes()
    path.write_bytes(whole[:-300])
    with pytest.raises(DatasetError, match="Walking 1.cdf: Pose cannot be read: "):
        recording.ground_truth()
    path.write_bytes(b"broken")
    with pytest.raises(DatasetError, match="Walking 1.cdf: cannot be read as CDF: "):
        recording.ground_truth()


def test_human36m_joints_without_their_library(subject: Path, monkeypatch) -> None:
    (subject / POSES).mkdir(parents=True)
    (subject / POSES / "Walking 1.cdf").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "cdflib", None)
    with pytest.raises(DatasetError, match=r"reading CDF needs cdflib: .*\(extra \[formats\]\)"):
        open_recording(subject).ground_truth()
