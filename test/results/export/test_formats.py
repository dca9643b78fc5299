"""Exports read back by independent readers; made-up motions that move every joint."""

import csv
import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.body.angles import ROOT_ANGLES
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import read_trc
from markerless_tracker.results.read import read_result

START_NS, PERIOD_NS = 1_500_000_000, 16_666_667


@pytest.fixture
def export(capsys):
    """`export(name, *words)`: the written files and the warnings."""

    def run(name: Path, *words: str) -> tuple[list[Path], str]:
        assert main(["export", str(name), *words]) == 0
        captured = capsys.readouterr()
        return [Path(line) for line in captured.out.splitlines()], captured.err

    return run


def in_file_axes(person, motion) -> np.ndarray:
    """(n, 15, 3) the markers that the body has, m, Y up."""
    return np.array([markers(person, pose) for pose in motion])[:, :, [1, 2, 0]]


def test_bvh(make_result, export, readers, read_bvh, person, motion) -> None:
    (path,), warnings = export(make_result(), "--to", "bvh")
    found = read_bvh(path)
    assert path.name == "walk.bvh" and not warnings
    assert found.period == pytest.approx(1 / 60, abs=1e-8)
    truth = in_file_axes(person, motion)
    for joint, marker in readers("bvh_file").MARKERS.items():
        column = read_trc(path.with_suffix(".trc")).names.index(marker)
        error = found.positions[:, found.names.index(joint)] / 100.0 - truth[:, column]
        assert np.abs(error).max() < 1e-5, joint


def test_a_frame_without_a_pose_repeats_the_last_one_in_bvh_and_is_reported(
    make_result, export, read_bvh
) -> None:
    (path,), warnings = export(make_result(lost=[0, 4, 5], left_out=[8]), "--to", "bvh")
    found = read_bvh(path).positions
    assert len(found) == 12
    for frame, shown in ((0, 1), (4, 3), (5, 3), (8, 7)):
        np.testing.assert_array_equal(found[frame], found[shown])
    assert np.abs(found[6] - found[3]).max() > 1.0
    assert "walk.bvh: 4 frames without a pose repeat the last one" in warnings


def test_c3d(make_result, export, person, motion) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    (path,), _ = export(make_result(lost=[2], left_out=[6, 7]), "--to", "c3d")
    found = ezc3d.c3d(str(path))
    point = found["parameters"]["POINT"]
    assert point["UNITS"]["value"] == ["mm"] and point["RATE"]["value"] == [60.0]
    assert point["LABELS"]["value"] == list(read_trc(path.with_suffix(".trc")).names)
    assert found["header"]["points"]["frame_rate"] == 60.0
    positions = found["data"]["points"][:3].transpose(2, 1, 0)
    truth = in_file_axes(person, motion) * 1000.0
    assert positions.shape == truth.shape
    held = [0, 1, 3, 4, 5, 8, 9, 10, 11]
    assert np.abs(positions[held] - truth[held]).max() < 0.01
    assert np.isnan(positions[[2, 6, 7]]).all()
    np.testing.assert_array_equal(
        found["parameters"]["TRACKER"]["FIRST_NS"]["value"], [str(START_NS)]
    )


def test_csv(make_result, export, person, motion) -> None:
    (path,), _ = export(make_result(lost=[2]), "--to", "csv")
    with path.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert list(rows[0]) == ["time", "joint", "x", "y", "z", "sd", "state"]
    assert len(rows) == 12 * 15
    truth = in_file_axes(person, motion)
    for frame in (0, 3, 11):
        block = rows[15 * frame : 15 * (frame + 1)]
        xyz = np.array([[float(row[axis]) for axis in "xyz"] for row in block])
        assert np.abs(xyz - truth[frame]).max() < 1e-6
        assert float(block[0]["time"]) == pytest.approx((START_NS + frame * PERIOD_NS) / 1e9)
        assert float(block[3]["sd"]) == pytest.approx(0.01 * (1 + frame) * 3**0.5, abs=1e-5)
        assert block[3]["joint"] == "LShoulder" and block[3]["state"] == "TRACKING"
    assert {(row["x"], row["sd"], row["state"]) for row in rows[30:45]} == {("", "", "LOST")}


def test_npz_has_the_arrays_of_the_result(make_result, export, person, motion) -> None:
    name = make_result(lost=[2])
    (path,), _ = export(name, "--to", "npz")
    found, result = np.load(path), read_result(name)
    values = {entry.name: getattr(result, entry.name) for entry in fields(result)}
    arrays = {key for key, value in values.items() if isinstance(value, np.ndarray)}
    assert "angles_sd_deg" in arrays and arrays <= set(found)
    np.testing.assert_array_equal(found["angles_sd_deg"], result.angles_sd_deg)
    truth = in_file_axes(person, motion)
    truth[2] = np.nan
    np.testing.assert_allclose(found["positions_m"], truth, atol=1e-6)
    np.testing.assert_array_equal(found["stamps_ns"], result.stamps_ns)
    np.testing.assert_array_equal(found["parameters"], result.parameters)
    np.testing.assert_array_equal(found["states"], result.states)
    assert found["marker_names"].tolist() == list(result.marker_names)
    assert str(found["axes"]).startswith("Y up")


def test_the_same_result_gives_the_same_bytes(make_result, export, tmp_path) -> None:
    name = make_result(lost=[2])
    kinds = "bvh,c3d,csv,mot,npz,osim"
    first, _ = export(name, "--to", kinds, "-o", str(tmp_path / "a" / "walk"))
    second, _ = export(name, "--to", kinds, "-o", str(tmp_path / "b" / "walk"))
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name


def test_a_bag_has_the_topics_of_the_node(make_result, export, person, motion) -> None:
    from rosbags.highlevel import AnyReader

    name = make_result(lost=[2])
    (path,), _ = export(name, "--to", "bag")
    result = read_result(name)
    poses: dict[int, np.ndarray] = {}
    joints: dict[int, dict[str, float]] = {}
    deviations: dict[int, dict[str, float]] = {}
    states = []
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/marker_poses":
                assert message.header.frame_id == "map"
                at = [pose.position for pose in message.poses]
                poses[stamp] = np.array([[point.x, point.y, point.z] for point in at])
            elif connection.topic == "/joint_states":
                joints[stamp] = dict(zip(message.name, message.position, strict=True))
            elif connection.topic == "/joint_deviations":
                deviations[stamp] = dict(zip(message.name, message.position, strict=True))
            elif connection.topic == "/state":
                states.append(message.status[0].message)
        topics = set(reader.topics)
    assert topics == {
        "/marker_poses", "/joint_states", "/joint_deviations", "/root_pose", "/tf", "/state",
        "/robot_description",
    }  # fmt: skip
    assert len(poses) == len(joints) == 11 and states[2] == "LOST" and len(states) == 12
    last = START_NS + 11 * PERIOD_NS
    np.testing.assert_allclose(poses[last], markers(person, motion[11]), atol=1e-6)
    assert len(joints[last]) >= len(person.joints)
    assert deviations[last].keys() == joints[last].keys() and not joints[last].keys() & set(
        ROOT_ANGLES
    )
    for joint, value in deviations[last].items():
        column = result.angle_names.index(joint)
        assert value == pytest.approx(np.deg2rad(result.angles_sd_deg[11, column])) and value > 0.0
    for joint, value in joints[last].items():
        if joint in result.angle_names:
            assert value == pytest.approx(np.deg2rad(result.angle(joint)[11]))
        else:
            assert value == pytest.approx(motion[11][person.index(joint)])


def test_other_marker_names(make_result, export) -> None:
    name = make_result()
    (path,), _ = export(name, "--to", "trc", "--names", "plugin-gait")
    assert path.name == "walk.plugin-gait.trc"
    renamed, own = read_trc(path), read_trc(name.with_suffix(".trc"))
    assert renamed.names[3:6] == ("LSJC", "LEJC", "LWJC")
    assert renamed.names[:3] == ("PELO", "Neck", "Head")
    np.testing.assert_array_equal(renamed.positions_m, own.positions_m)
    assert path.read_text(encoding="utf-8").splitlines()[0].endswith("\twalk.plugin-gait.trc")


def test_existing_files_are_replaced_with_force_only(make_result, capsys) -> None:
    name = make_result()
    for kind in ("csv", "osim", "bag"):
        words = ["export", str(name), "--to", kind]
        assert main(words) == 0
        capsys.readouterr()
        assert main(words) == 1
        captured = capsys.readouterr()
        assert "exists already" in captured.err and "--force" in captured.err
        assert main([*words, "--force"]) == 0
    assert main(["export", str(name), "--to", "trc", "--force"]) == 1
    assert "this is the result" in capsys.readouterr().err


def test_lost_frames_are_kept_on_request(make_result, export, person, motion) -> None:
    name = make_result(lost=[2], keep_lost=True)
    (path,), _ = export(name, "--to", "npz")
    assert np.isnan(np.load(path)["positions_m"][2]).all()
    (path,), _ = export(name, "--to", "npz", "--keep-lost", "--force")
    truth = in_file_axes(person, motion)
    np.testing.assert_allclose(np.load(path)["positions_m"], truth, atol=1e-6)


def test_what_cannot_be_exported_fails_in_one_line(tmp_path, make_result, capsys) -> None:
    assert main(["export", str(tmp_path / "none"), "--to", "csv"]) == 1
    assert "none.trc: no such file" in capsys.readouterr().err
    name = make_result()
    name.with_suffix(".json").unlink()
    assert main(["export", str(name), "--to", "csv"]) == 1
    error = capsys.readouterr().err
    assert "walk.json: no such file" in error and error.count("\n") == 1
    with pytest.raises(SystemExit):
        main(["export", str(name), "--to", "docx"])
    assert "format 'docx', expected some of bvh, c3d" in capsys.readouterr().err


@pytest.mark.parametrize("form", ["bvh", "mot", "osim"])
def test_a_result_without_a_body_is_named(make_result, capsys, form: str) -> None:
    path = make_result(lost=range(12)).with_suffix(".json")
    content = json.loads(path.read_text(encoding="utf-8"))
    del content["body"]["lengths_m"]
    path.write_text(json.dumps(content), encoding="utf-8")
    assert main(["export", str(path.with_suffix("")), "--to", form]) == 1
    assert f"{path}: no `body.lengths_m`, expected the sizes" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("form", "lost", "left_out", "expected"),
    [
        ("bvh", range(12), (), "walk: no frame has a pose"),
        ("c3d", (), range(12), "walk: no frame, expected at least one"),
    ],
)
def test_a_result_that_a_format_cannot_hold(
    make_result, capsys, form: str, lost, left_out, expected: str
) -> None:
    name = make_result(lost=lost, left_out=left_out)
    assert main(["export", str(name), "--to", form]) == 1
    assert expected in capsys.readouterr().err
    assert not name.with_suffix(f".{form}").exists()


def test_a_result_is_not_exported_onto_itself(make_result, capsys) -> None:
    name = make_result()
    before = name.with_suffix(".trc").read_bytes()
    for more in (["--force"], ["-o", str(name), "--force"], ["-o", f"{name}.trc", "--force"]):
        assert main(["export", str(name), "--to", "csv,trc", *more]) == 1
        assert "walk.trc: this is the result" in capsys.readouterr().err
    assert name.with_suffix(".trc").read_bytes() == before
    with pytest.raises(SystemExit):
        main(["export", str(name), "--to", ","])
    assert "',' names no format, expected some of bvh" in capsys.readouterr().err


def test_the_markers_of_an_earlier_export_are_no_part_of_a_new_one(make_result, capsys) -> None:
    """The earlier result had gaps."""
    name = make_result()
    stale = name.with_name(f"{name.name}.ik.trc")
    stale.write_text("earlier")
    assert main(["export", str(name), "--to", "osim", "--force", "--json"]) == 0
    written = json.loads(capsys.readouterr().out)["files"]
    assert not stale.exists() and str(stale) not in written
