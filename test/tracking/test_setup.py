"""From files and settings to a tracker."""

import dataclasses

import numpy as np
import pytest
import yaml

from markerless_tracker.body import (
    MARKER_NAMES,
    Subject,
    markers,
    write_pose,
    write_subject,
)
from markerless_tracker.datasets import MarkerTrack, write_trc
from markerless_tracker.errors import BodyModelError, ConfigError, DatasetError
from markerless_tracker.records import TrackState
from markerless_tracker.resources import config_dir
from markerless_tracker.tracking import TrackerConfig, build_tracker


@pytest.fixture
def config(swarm_settings) -> TrackerConfig:
    return TrackerConfig.from_mapping(swarm_settings)


@pytest.fixture
def files(scene, tmp_path):
    """A start as TRC (its first row is empty) and YAML, and a subject."""
    rows = np.stack([np.full((15, 3), np.nan), scene.markers(0), scene.markers(3)])
    track = MarkerTrack(MARKER_NAMES, np.array([0, 16_666_667, 66_666_667]), rows)
    write_trc(tmp_path / "start.trc", track, 60.0)
    write_pose(tmp_path / "start.yaml", scene.body, scene.pose(0))
    write_subject(tmp_path / "subject.yaml", Subject("me", scene.body.lengths_m))
    return tmp_path


def gap_mm(scene, tracker) -> float:
    """Mean distance of the start pose's markers from the truth."""
    start = markers(tracker.body, tracker._motion.start)
    return float(1e3 * np.linalg.norm(start - scene.markers(0), axis=1).mean())


def test_a_marker_file_gives_the_pose_the_time_and_the_lengths(scene, config, files):
    setup = build_tracker(scene.rig, config, start_file=files / "start.trc")
    assert setup.start_stamp_ns == 16_666_667
    lengths = setup.tracker.body.lengths_m
    for name, length in scene.body.lengths_m.items():
        assert lengths[name] == pytest.approx(length, abs=1e-5), name
    assert gap_mm(scene, setup.tracker) < 2.0


def test_a_named_subject_overrules_the_markers(scene, config, files):
    half = Subject("half", {name: 0.5 * v for name, v in scene.body.lengths_m.items()})
    write_subject(files / "half.yaml", half)
    body = build_tracker(
        scene.rig, config, start_file=files / "start.trc", subject_file=files / "half.yaml"
    ).tracker.body
    assert body.lengths_m == pytest.approx(dict(half.lengths_m))
    tall = build_tracker(scene.rig, config, start_file=files / "start.trc", stature=2.0)
    assert tall.tracker.body.lengths_m["torso"] == pytest.approx(0.576)


def test_a_pose_file_starts_with_the_first_frame_that_comes(scene, config, files):
    for subject in (
        {"subject_file": files / "subject.yaml"},
        {"subject_from": files / "start.trc"},
        {"stature": 1.72},
    ):
        setup = build_tracker(scene.rig, config, start_file=files / "start.yaml", **subject)
        assert setup.start_stamp_ns is None
        np.testing.assert_array_equal(setup.tracker._motion.start, scene.pose(0))
        assert gap_mm(scene, setup.tracker) < 1.0


def test_without_a_start_it_looks_for_somebody(scene, config, files):
    setup = build_tracker(scene.rig, config, subject_file=files / "subject.yaml")
    assert setup.start_stamp_ns is None
    assert setup.tracker.body.lengths_m == scene.body.lengths_m
    assert setup.tracker.state is TrackState.SEARCHING


def test_two_subjects(scene, config, files):
    with pytest.raises(ConfigError, match="subject_file and stature both name a subject"):
        build_tracker(
            scene.rig, config, start_file=files / "start.yaml",
            subject_file=files / "subject.yaml", stature=1.8,
        )  # fmt: skip
    with pytest.raises(ConfigError, match="subject_from and stature both name a subject"):
        build_tracker(
            scene.rig, config, start_file=files / "start.yaml",
            subject_from=files / "start.trc", stature=1.8,
        )  # fmt: skip


def test_a_pose_file_alone_lacks_a_subject(scene, config, files):
    with pytest.raises(ConfigError, match=r"start.yaml gives a pose but no subject: name one"):
        build_tracker(scene.rig, config, start_file=files / "start.yaml")


def test_a_subject_is_no_start_pose(scene, config, files):
    with pytest.raises(ConfigError, match=r"subject.yaml: a subject, no start pose"):
        build_tracker(scene.rig, config, start_file=files / "subject.yaml")


def test_a_marker_file_without_any_marker(scene, config, tmp_path):
    empty = MarkerTrack(MARKER_NAMES, np.array([0]), np.full((1, 15, 3), np.nan))
    write_trc(tmp_path / "empty.trc", empty, 60.0)
    with pytest.raises(ConfigError, match="empty.trc: holds no marker in any row"):
        build_tracker(scene.rig, config, start_file=tmp_path / "empty.trc")


def test_files_that_are_not_there(scene, config, files):
    with pytest.raises(DatasetError, match="nowhere.trc"):
        build_tracker(scene.rig, config, start_file=files / "nowhere.trc")
    with pytest.raises(BodyModelError, match="nowhere.yaml"):
        build_tracker(scene.rig, config, start_file=files / "nowhere.yaml", stature=1.7)
    with pytest.raises(BodyModelError, match="missing.yaml"):
        build_tracker(
            scene.rig, config, start_file=files / "start.yaml", subject_file=files / "missing.yaml"
        )


def test_a_start_of_another_body_is_refused(scene, config, files):
    data = yaml.safe_load((files / "start.yaml").read_text(encoding="utf-8"))
    data["tail_x"] = 0.1
    (files / "other.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    with pytest.raises(BodyModelError, match="no parameter 'tail_x'"):
        build_tracker(scene.rig, config, start_file=files / "other.yaml", stature=1.7)


def test_an_unknown_body_is_refused_listing_those_there_are(scene, config, files):
    other = dataclasses.replace(config, body="robot")
    with pytest.raises(BodyModelError, match="body 'robot' is unknown, expected balan31"):
        build_tracker(scene.rig, other, start_file=files / "start.trc")


def test_a_budget_that_cannot_be_spent_is_refused_before_the_first_frame(scene, config, files):
    other = dataclasses.replace(config, evaluations=1050)
    with pytest.raises(ConfigError, match="evaluations is 1050"):
        build_tracker(scene.rig, other, start_file=files / "start.trc")


def test_sections_given_with_the_subject_are_not_fitted(scene, refined_settings, files, frames):
    config = TrackerConfig.from_mapping(refined_settings)
    shapes = dict(zip(scene.body.cone_names, scene.body.cone_shape, strict=True))
    write_subject(files / "shaped.yaml", Subject("me", scene.body.lengths_m, shapes))
    fitted = []
    for name in ("subject.yaml", "shaped.yaml"):
        tracker = build_tracker(
            scene.rig, config, start_file=files / "start.yaml", subject_file=files / name
        ).tracker
        before = tracker.body.cone_shape
        tracker.step(frames[0].observations, 0)
        fitted.append(not np.array_equal(tracker.body.cone_shape, before))
    assert fitted == [True, False]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        pytest.param("  six:", "  steps:", "no hierarchy six", id="hierarchy"),
        pytest.param("pelvis_rx", "trunk_rx", "no parameter pelvis_rx", id="parameter"),
    ],
)
def test_a_body_that_cannot_be_found_is_refused_before_the_first_frame(
    scene, config, files, old, new, named
):
    description = (config_dir() / "bodies" / "balan31.yaml").read_text()
    assert old in description
    path = files / "own.yaml"
    path.write_text(description.replace(old, new))
    config = dataclasses.replace(config, body=str(path))
    with pytest.raises(ConfigError, match=f"{named}.*give a start pose"):
        build_tracker(scene.rig, config)
    start = files / "start.trc"
    with pytest.raises(ConfigError, match="search_again"):
        build_tracker(scene.rig, dataclasses.replace(config, search_again=True), start_file=start)
    config = dataclasses.replace(config, search_again=False)
    tracker = build_tracker(scene.rig, config, start_file=start).tracker
    tracker.warm_up()
    with pytest.raises(ConfigError, match=f"{named}.*search_again"):
        tracker.configure(dataclasses.replace(config, search_again=True))
    assert tracker.config is config
