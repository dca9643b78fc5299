"""Calibration files: reading, refusals, and round trips without loss."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.camera import (
    CameraModel,
    CameraRig,
    read_calibration,
    read_qca,
    write_calibration,
)
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import rotation_from_rodrigues, transform

TABLE = """
[cam01]
name = "cam01"
size = [ 656.0, 490.0]
matrix = [ [ 550, 0, 324.18772], [ 0, 550.52764, 252.64918], [ 0, 0, 1]]
distortions = [ -0.05, 0.14, 0.0006, 0.0007]
rotation = [ 0.8110225319, 1.987781733, -1.564078127]
translation = [ -0.0098194002, 0.9242375624, 4.330783821]
fisheye = false

[metadata]
adjusted = false
error = 0.0
"""

QCA = """<?xml version='1.0' encoding='ASCII'?>
<calibration type="regular"><cameras>
<camera active="1" serial="left">
  <fov_video_max bottom="1919" left="0" right="1087" top="0"/>
  <transform r11="0" r12="1" r13="0" r21="0" r22="0" r23="1" r31="1" r32="0" r33="0"
    x="4000" y="-250" z="1500"/>
  <intrinsic centerPointU="32000" centerPointV="61440" focalLengthU="107520" focalLengthV="107584"
    radialDistortion1="-0.046" radialDistortion2="0.14" radialDistortion3="0.02" skew="0"
    tangentalDistortion1="0.0006" tangentalDistortion2="0.0007"/>
</camera></cameras></calibration>
"""


def saved(folder: Path, text: str, name: str = "calibration.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_is_read_and_metadata_is_no_camera(tmp_path: Path) -> None:
    rig = read_calibration(saved(tmp_path, TABLE))
    assert rig.names == ("cam01",)
    camera = rig["cam01"]
    assert camera.size_px == (656, 490)
    assert camera.matrix[1].tolist() == [0.0, 550.52764, 252.64918]
    assert camera.distortion.tolist() == [-0.05, 0.14, 0.0006, 0.0007, 0.0]
    assert camera.T_cam_world[:3, 3].tolist() == [-0.0098194002, 0.9242375624, 4.330783821]
    expected = rotation_from_rodrigues([0.8110225319, 1.987781733, -1.564078127])
    np.testing.assert_allclose(camera.T_cam_world[:3, :3], expected, atol=1e-11)


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ("fisheye = false", "fisheye = true", "fisheye"),
        ("size = [ 656.0, 490.0]\n", "", "size is missing"),
        ("distortions = [ -0.05, 0.14, 0.0006, 0.0007]\n", "", "distortions is missing"),
        ("rotation = [ 0.8110225319, 1.987781733, -1.564078127]\n", "", "rotation is missing"),
        ("translation", "translations", "translation is missing"),
        ("[ 656.0, 490.0]", "[656, 490, 3]", "size"),
        ("[ 656.0, 490.0]", "[656, -1]", "size"),
        ("[ 0, 0, 1]]", "]", "matrix"),
        ("[ 0, 0, 1]]", "[0, 0, 'x']]", "matrix"),
        ("550.52764", "nan", "matrix"),
        ("[ -0.05, 0.14, 0.0006, 0.0007]", "[1, 2]", "distortions"),
        ("[ -0.05, 0.14, 0.0006, 0.0007]", f"[1{'0' * 400}, 0, 0, 0]", "distortions"),
        ("[ 656.0, 490.0]", "[1e300, 490]", "size"),
        ("[ 0.8110225319, 1.987781733, -1.564078127]", "[[1, 0, 0]]", "rotation"),
        ("[ 550, 0,", "[ -550, 0,", "focal lengths"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_camera(tmp_path: Path, old, new, reported) -> None:
    assert old in TABLE
    path = saved(tmp_path, TABLE.replace(old, new))
    with pytest.raises(CalibrationError, match=reported) as error:
        read_calibration(path)
    assert str(path) in str(error.value) and "cam01" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("[cam01\n", "TOML"),
        ("", "no camera"),
        ("[metadata]\nerror = 0.0\n", "no camera"),
        (TABLE + TABLE.replace("[cam01]", "[other]").split("[metadata]")[0], "distinct"),
        (TABLE.replace('name = "cam01"', "name = 3"), "name is 3"),
    ],
)
def test_malformed_files_are_refused(tmp_path: Path, text: str, reported: str) -> None:
    path = saved(tmp_path, text)
    with pytest.raises(CalibrationError, match=reported) as error:
        read_calibration(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="cannot be read"):
        read_calibration(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(CalibrationError, match="not a text file"):
        read_calibration(tmp_path / "binary.toml")
    with pytest.raises(CalibrationError, match="cannot be written"):
        write_calibration(tmp_path / "no" / "where.toml", read_calibration(saved(tmp_path, TABLE)))


def same(a: CameraRig, b: CameraRig) -> bool:
    return a.names == b.names and all(
        p.size_px == q.size_px
        and np.array_equal(p.matrix, q.matrix)
        and np.array_equal(p.distortion, q.distortion)
        and np.array_equal(p.T_cam_world, q.T_cam_world)
        for p, q in zip(a, b, strict=True)
    )


finite = st.floats(-10.0, 10.0, allow_nan=False)
axis = st.one_of(finite, st.sampled_from([0.0, np.pi, -np.pi, np.pi / 2, 3.14159265359]))


@given(
    st.tuples(axis, axis, axis),
    st.tuples(finite, finite, finite),
    st.lists(finite, min_size=4, max_size=5),
    st.floats(0.1, 1.0),
)
def test_a_rig_that_was_read_round_trips_bit_for_bit(
    tmp_path_factory, rotation, translation, lens, scale
) -> None:
    folder = tmp_path_factory.mktemp("rig")
    matrix = np.array([[1668.8827783921186, 0.0, 529.05], [0.0, 1681.07, 948.1], [0.0, 0.0, 1.0]])
    pose = transform(rotation_from_rodrigues(rotation), translation)
    made = CameraRig((CameraModel("cam", (1080, 1920), matrix, np.array(lens), pose),))
    write_calibration(folder / "made.toml", made)
    read = read_calibration(folder / "made.toml").scaled(scale)
    np.testing.assert_allclose(read["cam"].T_cam_world, pose, atol=1e-8)
    write_calibration(folder / "again.toml", read)
    assert same(read, read_calibration(folder / "again.toml"))


@given(st.text(min_size=1, max_size=20).filter(lambda name: name.isprintable()))
def test_any_printable_name_round_trips(tmp_path_factory, name: str) -> None:
    path = tmp_path_factory.mktemp("name") / "calibration.toml"
    pose = transform(np.eye(3), [0.0, 0.0, 3.0])
    matrix = np.array([[500.0, 0.0, 50.0], [0.0, 500.0, 50.0], [0.0, 0.0, 1.0]])
    write_calibration(path, CameraRig((CameraModel(name, (99, 99), matrix, np.zeros(5), pose),)))
    assert read_calibration(path).names == (name,)


def test_shared_recordings_round_trip(balance_real: Path, render_walk: Path, tmp_path) -> None:
    for folder in (balance_real, render_walk):
        rig = read_calibration(folder / "calibration.toml")
        write_calibration(tmp_path / "copy.toml", rig)
        assert len(rig) == 4 and same(rig, read_calibration(tmp_path / "copy.toml"))


def test_qualisys_units_and_axes(tmp_path: Path) -> None:
    camera = read_qca(saved(tmp_path, QCA, "rig.qca.txt"))["left"]
    assert camera.size_px == (1088, 1920)
    expected = [[1680.0, 0.0, 500.0], [0.0, 1681.0, 960.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(camera.matrix, expected)
    # Not divided by 64, and k3 last.
    assert camera.distortion.tolist() == [-0.046, 0.14, 0.0006, 0.0007, 0.02]
    np.testing.assert_allclose(camera.T_world_cam[:3, 3], [4.0, -0.25, 1.5], atol=1e-9)
    # Its third row, the world's x, points backwards: the camera looks along -x, and z is up.
    np.testing.assert_allclose(camera.T_world_cam[:3, 2], [-1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(camera.T_world_cam[:3, 1], [0.0, 0.0, -1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("no xml", "XML"),
        ("<calibration/>", "no camera"),
        (QCA.replace('focalLengthU="107520"', ""), "left.*focalLengthU"),
        (QCA.replace('r12="1"', 'r12="one"'), "left.*r12"),
        (QCA.replace('r12="1"', 'r12="2"'), "left.*rotation"),
        (QCA.replace('serial="left"', ""), "serial"),
        (QCA.replace("fov_video_max", "fov_other"), "left.*fov_video_max"),
        (QCA.replace('right="1087"', 'right="-5"'), "left.*size"),
    ],
)
def test_malformed_qualisys_files_are_refused(tmp_path: Path, text: str, reported: str) -> None:
    path = saved(tmp_path, text, "rig.qca.txt")
    with pytest.raises(CalibrationError, match=reported) as error:
        read_qca(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)
