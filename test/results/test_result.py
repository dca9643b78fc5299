"""Results on disk: NAME.trc with the markers, NAME.json with everything else."""

import json
from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker import __version__
from markerless_tracker.body import MARKER_NAMES, load_body, read_subject
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Confidence, LimbState, TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter, versions
from markerless_tracker.tracking import TrackerConfig


@pytest.fixture(scope="module")
def body():
    return load_body("balan31", 1.7)


@pytest.fixture
def config():
    return TrackerConfig.from_mapping({"preset": "paper", "seed": 12, "edge_weight": 0.25})


def result(stamp_ns: int, value: float | None = 0.0, **changes) -> TrackResult:
    """A frame whose every coordinate is `value`, or that has no estimate."""
    fields = {
        "stamp_ns": stamp_ns,
        "state": TrackState.LOST if value is None else TrackState.TRACKING,
        "pose": None if value is None else np.full(31, value),
        "markers_m": None if value is None else np.full((15, 3), value),
        "fitness": float("nan") if value is None else 1.5,
        "iou": {} if value is None else {"cam01": 0.75},
        "evaluations": 1000,
    }
    return TrackResult(**{**fields, **changes})


def test_markers_come_back_and_frames_without_an_estimate_are_blank(tmp_path, body, config):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        for stamp_ns, value in ((0, 1.25), (16_666_667, None), (33_333_333, -0.5)):
            writer.add(result(stamp_ns, value))
    track = read_trc(tmp_path / "out.trc")
    assert track.names == MARKER_NAMES
    np.testing.assert_array_equal(track.stamps_ns, [0, 16_666_667, 33_333_333])
    np.testing.assert_array_equal(track.tracked, [True, False, True])
    assert (track.positions_m[0] == 1.25).all()
    assert (track.positions_m[2] == -0.5).all()
    line = (tmp_path / "out.trc").read_text(encoding="utf-8").splitlines()[6]
    assert line.split() == ["2", "0.016666667"]


def test_the_summary_says_what_made_the_result(tmp_path, body, config):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0, source="walk") as writer:
        writer.add(result(0, 0.5))
        writer.add(result(20_000_000, None))
        writer.note({"skipped": 3})
    data = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert data["source"] == "walk"
    assert data["seed"] == 12
    assert TrackerConfig.from_mapping(data["settings"]) == config
    assert data["versions"]["markerless_tracker"] == __version__
    assert data["body"]["name"] == "balan31"
    assert data["body"]["parameters"] == list(body.parameter_names)
    assert data["body"]["lengths_m"] == dict(body.lengths_m)
    assert data["skipped"] == 3
    first, second = data["frames"]
    assert first["stamp_ns"] == 0
    assert first["state"] == "TRACKING"
    assert first["fitness"] == 1.5
    assert first["evaluations"] == 1000
    assert first["iou"] == {"cam01": 0.75}
    assert first["parameters"] == [0.5] * 31
    assert (second["state"], second["fitness"], second["parameters"]) == ("LOST", None, None)


def test_the_summary_is_json_that_others_read_as_well(tmp_path, body, config):
    """No NaN or Infinity, which only Python reads."""
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        writer.add(result(0, None))

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    text = (tmp_path / "out.json").read_text(encoding="utf-8")
    json.loads(text, parse_constant=refuse)


def test_the_body_may_be_fitted_during_the_run(tmp_path, body, config):
    grown = load_body("balan31", 1.9)
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        writer.add(result(0))
        writer.body = grown
    data = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    np.testing.assert_array_equal(list(data["body"]["cones_m"].values()), grown.cone_shape)


def test_the_content_does_not_depend_on_where_it_is_written(tmp_path, body, config):
    texts = []
    for name in (tmp_path / "with.dots.b", tmp_path / "deep" / "folder" / "with.dots.b"):
        with ResultWriter(name, body, config, fps=59.94) as writer:
            writer.add(result(0, 0.1))
        texts += [name.parent / f"{name.name}{suffix}" for suffix in (".trc", ".json")]
    assert texts[0].read_bytes() == texts[2].read_bytes()
    assert texts[1].read_bytes() == texts[3].read_bytes()


def test_exposure_is_written(tmp_path, body, config):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        writer.add(result(0, exposure={"cam01": (1.25, 1.0, 0.75)}))
    frame = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["frames"][0]
    assert frame["exposure"] == {"cam01": [1.25, 1.0, 0.75]}


def test_no_frame_at_all_is_a_result_too(tmp_path, body, config):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0):
        pass
    assert len(read_trc(tmp_path / "out.trc")) == 0
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["frames"] == []


def test_what_was_found_before_an_error_is_written(tmp_path, body, config):
    with (
        pytest.raises(DatasetError, match="later"),
        ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer,
    ):
        writer.add(result(0, 1.0))
        raise DatasetError("a later frame cannot be read")
    assert len(read_trc(tmp_path / "out.trc")) == 1


@pytest.mark.parametrize("taken", ["parent", "trc", "json"])
def test_a_target_that_cannot_be_written_is_refused_at_once(tmp_path, body, config, taken):
    name = tmp_path / "folder" / "out"
    if taken == "parent":
        name.parent.write_text("a file", encoding="utf-8")
    else:
        (name.parent / f"out.{taken}").mkdir(parents=True)
    with pytest.raises(DatasetError, match=r"out\.(trc|json): cannot be written: ") as caught:
        ResultWriter(name, body, config, fps=60.0)
    assert "\n" not in str(caught.value)


def test_versions_name_what_numbers_depend_on():
    found = versions()
    assert found["markerless_tracker"] == __version__
    assert found["numpy"] == np.__version__
    assert {"python", "numba", "scipy"} <= set(found)


def test_the_subject_it_writes_gives_the_same_body_again(tmp_path) -> None:
    body = load_body("person31", 1.69)
    shape = body.cone_shape.copy()
    shape[:, :, :2] *= 1.1
    fitted = replace(body, cone_shape=shape)
    with ResultWriter(tmp_path / "walk", body, TrackerConfig(), fps=60.0) as writer:
        writer.body = fitted
        writer.add(result(0))
    again = load_body("person31", read_subject(tmp_path / "walk.subject.yaml"))
    np.testing.assert_array_equal(again.cone_shape, fitted.cone_shape)
    assert again.lengths_m == fitted.lengths_m


def test_without_a_tracked_person_there_is_no_subject_file(tmp_path, body, config) -> None:
    path = tmp_path / "walk.subject.yaml"
    path.write_text("of an earlier run", encoding="utf-8")
    with ResultWriter(tmp_path / "walk", body, config, fps=60.0) as writer:
        writer.add(result(0, None))
    assert not path.exists()


def test_standard_deviations_stand_beside_the_pose(tmp_path, body, config):
    sure = Confidence(np.full(body.size, 0.1), np.full((15, 3), 0.0123), np.eye(6))
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        writer.add(result(0, confidence=sure))
        writer.add(result(1))
    with_them, without = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["frames"]
    assert with_them["parameters_sd"] == [0.1] * body.size
    assert with_them["markers_sd_mm"]["LKnee"] == [12.3, 12.3, 12.3]
    assert "markers_sd_mm" not in without


def test_each_limb_has_its_state_where_there_is_an_estimate(tmp_path, body, config):
    limbs = {
        "l_arm": LimbState(TrackState.LOST, 0.41239, float("nan")),
        "r_arm": LimbState(TrackState.TRACKING, 1.0, 0.25),
    }
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        writer.add(result(0, limbs=limbs))
        writer.add(result(1, None))
    with_them, without = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["frames"]
    assert with_them["limbs"] == {
        "l_arm": {"state": "LOST", "inside_fraction": 0.412, "particle_sd_ratio": None},
        "r_arm": {"state": "TRACKING", "inside_fraction": 1.0, "particle_sd_ratio": 0.25},
    }
    assert "limbs" not in without


def test_joint_angles_stand_in_each_frame_continuous_in_time(tmp_path):
    body = load_body("person31", 1.7)
    sure = Confidence(np.full(body.size, 0.01), np.full((15, 3), 0.01), np.eye(6))
    with ResultWriter(tmp_path / "out", body, TrackerConfig(), fps=60.0) as writer:
        for k, heading in enumerate((4.6, 4.8, 5.0)):
            pose = body.neutral.copy()
            pose[body.index("pelvis_rz")], pose[body.index("l_knee")] = heading, -0.5
            writer.add(result(k, pose=pose, confidence=sure))
        writer.add(result(4, None))
    frames = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["frames"]
    assert "angles" not in frames[3]
    rotations = [frame["angles"]["pelvis_rotation"] for frame in frames[:3]]
    assert rotations == pytest.approx(np.rad2deg([4.6, 4.8, 5.0]) - 90.0, abs=0.01)
    assert frames[0]["angles"]["knee_angle_l"] == pytest.approx(28.65, abs=0.01)
    assert frames[0]["angles_sd"]["knee_angle_l"] == pytest.approx(0.57, abs=0.01)
    assert list(frames[0]["angles"]) == list(frames[0]["angles_sd"])
