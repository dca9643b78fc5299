"""Which views are used."""

import numpy as np
import pytest

from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.views import ViewWatch, anybody


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(body="balan31", motion="walk", size_px=(256, 192), seed=4)


def views(scene, **masks):
    _, exact, _ = scene.frame(0)
    return {
        name: Observation.from_mask(name, 0, masks.get(name, mask), np.zeros(mask.shape, "u1"))
        for name, mask in exact.items()
    }


def test_good_views_are_all_used(scene) -> None:
    seen = views(scene)
    assert ViewWatch(scene.rig).usable(seen, scene.body, scene.pose(0)) == (seen, ())


def test_a_blinded_camera_goes_and_comes_back(scene) -> None:
    watch = ViewWatch(scene.rig)
    white = np.ones((192, 256), np.uint8)
    used, notes = watch.usable(views(scene, cam02=white), scene.body, scene.pose(0))
    assert set(used) == {"cam01", "cam03", "cam04"}
    assert notes == ("cam02: left out, silhouette over 100% of the frame",)
    assert watch.usable(views(scene, cam02=white), scene.body, scene.pose(0))[1] == ()
    used, notes = watch.usable(views(scene), scene.body, scene.pose(0))
    assert len(used) == 4 and notes == ("cam02: taken back",)


def test_a_camera_without_image_is_named(scene) -> None:
    seen = views(scene)
    del seen["cam03"]
    used, notes = ViewWatch(scene.rig).usable(seen, scene.body, None)
    assert "cam03" not in used and notes == ("cam03: left out, no image",)


def test_an_empty_view_is_wrong_only_where_the_body_should_be(scene) -> None:
    nothing = np.zeros((192, 256), np.uint8)
    seen = views(scene, cam01=nothing)
    used, notes = ViewWatch(scene.rig).usable(seen, scene.body, scene.pose(0))
    assert "cam01" not in used and "no person where the other views show one" in notes[0]
    # The pose is unknown, or the body is outside that view.
    assert "cam01" in ViewWatch(scene.rig).usable(seen, scene.body, None)[0]
    away = scene.pose(0).copy()
    away[scene.body.index("pelvis_tz")] += 50.0
    assert "cam01" in ViewWatch(scene.rig).usable(seen, scene.body, away)[0]


def test_nobody_anywhere_is_no_fault_of_the_cameras(scene) -> None:
    nothing = np.zeros((192, 256), np.uint8)
    seen = views(scene, **{name: nothing for name in scene.rig.names})
    used, notes = ViewWatch(scene.rig).usable(seen, scene.body, scene.pose(0))
    assert len(used) == 4 and notes == () and not anybody(used)
