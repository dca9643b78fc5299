"""Statures and girths that a start tries."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.evidence.hull import Hull, find_hulls
from markerless_tracker.tracking.search import make_searcher
from markerless_tracker.tracking.start.sizing import (
    GIRTHS,
    Sized,
    SizeSearch,
    first_statures_m,
    with_girth,
)


def hull_of(height_m: float) -> Hull:
    points = np.array([[0.0, 0.0, 0.015], [0.0, 0.0, height_m + 0.015]])
    return Hull(points, points, points)


@pytest.mark.parametrize(
    ("height_m", "expected"),
    [(1.70, (1.70,)), (1.0, (1.70,)), (1.86, (1.86, 1.5)), (2.1, (1.70, 1.694))],
)
def test_a_low_hull_is_no_short_and_a_high_one_no_tall_person(height_m, expected) -> None:
    assert first_statures_m(hull_of(height_m)) == pytest.approx(expected, abs=0.001)


def test_a_girth_multiplies_the_radii_alone() -> None:
    body = load_body("person31", 1.7)
    wide = with_girth(body, 1.2)
    np.testing.assert_allclose(wide.cone_shape[:, :, :2], 1.2 * body.cone_shape[:, :, :2])
    np.testing.assert_array_equal(wide.cone_shape[:, :, 2:], body.cone_shape[:, :, 2:])
    assert wide.lengths_m == body.lengths_m


def test_stature_and_girth_of_a_stout_person_are_found() -> None:
    """The silhouettes are those of a body that is 16 % wider than the generic one."""
    scene = SyntheticScene(body="person31", stature_m=1.78, size_px=(256, 192), seed=2)
    pose, stout = scene.motion.pose(0.0), with_girth(scene.body, GIRTHS[2])
    masks = {camera.name: silhouette(stout, pose, camera) for camera in scene.rig}
    views = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    config = TrackerConfig(threads=1)
    sizes = Sizes(load_description("person31"))

    def searcher_for(body):
        return make_searcher(body, rig=scene.rig, config=config, threads=1, mapper=map)

    searcher = searcher_for(sizes.of_stature(1.70))
    frame = FramePopulation(searcher, views, 0, pose)
    found = Sized(frame, frame.selected(frame.refined(pose[None], 6, (0.12, 0.05))), searcher)
    hull = next(find_hulls({camera.name: camera for camera in scene.rig}, views))
    search = SizeSearch(searcher_for, searcher.body, sizes.of_stature, girths=True)
    coarse = search.coarse(found, hull, views, 0)
    assert coarse.population.costs[0] < found.population.costs[0] - 0.02
    legs = coarse.searcher.body.lengths_m["l_thigh"] / sizes.of_stature(1.78).lengths_m["l_thigh"]
    assert legs == pytest.approx(1.0, abs=0.04)
    radii = coarse.searcher.body.cone_shape[:, :, :2] / stout.cone_shape[:, :, :2]
    assert np.median(radii) == pytest.approx(1.0, abs=0.08)
