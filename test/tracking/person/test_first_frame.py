"""A noisy start is recognised and settled; an exact one is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_description, markers, pose_from_markers
from markerless_tracker.body.build import build_body
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.body.subject import measured_lengths, subject_from_markers
from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.person.first_frame import (
    StartMarkers,
    shape_of_first_frame,
    start_noise_m,
)
from markerless_tracker.tracking.search import Searcher

DESCRIPTION = load_description("person31")


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(
        body="person31", stature_m=1.72, motion="walk", cameras=4, size_px=(400, 300), seed=5
    )


@pytest.fixture(scope="module")
def contours(scene):
    pose = scene.pose(7)
    observations = {}
    for camera in scene.rig:
        mask = silhouette(scene.body, pose, camera)
        edges = np.zeros(mask.shape, dtype=np.uint8)
        observations[camera.name] = Observation.from_mask(camera.name, 0, mask, edges)

    def make(body, at):
        config = TrackerConfig.from_mapping({"threads": 1})
        searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
        return searcher.frame(observations, 0, at).contours

    return make


def start_of(named, noise_m):
    subject = subject_from_markers(DESCRIPTION, named)
    body = build_body(DESCRIPTION, subject)

    positions = np.array([named[name] for name in MARKER_NAMES])
    begun = StartMarkers(positions, noise_m, Sizes(DESCRIPTION))
    return body, pose_from_markers(body, named), begun


def settled(start, contours):
    body, pose, begun = start
    config = TrackerConfig.from_mapping({"threads": 1})
    return shape_of_first_frame(body, pose, begun, contours, config, body.limits)


def test_noise_is_estimated_from_the_two_sides() -> None:
    assert start_noise_m({"l_thigh": 0.42, "r_thigh": 0.40}) == pytest.approx(0.010)
    assert start_noise_m({"l_thigh": 0.4, "r_thigh": 0.4, "torso": 0.5}) == 0.0
    assert start_noise_m({"torso": 0.5, "l_thigh": 0.4}) == 0.0


def test_the_estimate_is_about_right(scene) -> None:
    true = markers(scene.body, scene.pose(7))
    rng = np.random.default_rng(1)
    found = [
        start_noise_m(
            measured_lengths(
                DESCRIPTION,
                dict(zip(MARKER_NAMES, true + rng.normal(0.0, 0.01, true.shape), strict=True)),
            )
        )
        for _ in range(200)
    ]
    assert 0.008 < np.sqrt(np.mean(np.square(found))) < 0.012


def test_an_exact_start_is_held(scene, contours) -> None:
    true = markers(scene.body, scene.pose(7))
    start = start_of(dict(zip(MARKER_NAMES, true, strict=True)), 0.0)
    body, pose = settled(start, contours)
    np.testing.assert_array_equal(pose, start[1])
    # No marker shows the hands' length.
    others = {"hand": start[0].lengths_m["hand"]}
    assert body.lengths_m | others == start[0].lengths_m


def test_a_noisy_start_comes_nearer_to_the_truth(scene, contours) -> None:
    true = markers(scene.body, scene.pose(7))
    before, after = [], []
    for seed in range(3):
        noisy = true + np.random.default_rng(seed).normal(0.0, 0.02, true.shape)
        start = start_of(dict(zip(MARKER_NAMES, noisy, strict=True)), 0.02)
        body, pose = settled(start, contours)
        before.append(np.linalg.norm(markers(start[0], start[1]) - true, axis=1).mean())
        after.append(np.linalg.norm(markers(body, pose) - true, axis=1).mean())
        for name, length in body.lengths_m.items():
            if name.startswith("l_"):
                assert length == body.lengths_m["r_" + name[2:]]
    assert np.mean(after) < 0.75 * np.mean(before)


def test_missing_markers_are_no_obstacle(scene, contours) -> None:
    true = markers(scene.body, scene.pose(7))
    body, pose, begun = start_of(dict(zip(MARKER_NAMES, true, strict=True)), 0.02)
    positions = begun.positions_m.copy()
    positions[MARKER_NAMES.index("Head")] = np.nan
    body, pose = settled((body, pose, replace(begun, positions_m=positions)), contours)
    assert np.isfinite(pose).all()
    assert np.linalg.norm(markers(body, pose) - true, axis=1).mean() < 0.02
