"""Looking only around the predicted body gives what the whole images give, but for specks."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.drawing import silhouette
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.tracking.evidence.selection import (
    body_lines,
    body_region,
    explained_in_region,
    explained_part,
    place_cones,
)

SPECKS_PX = 12
"""A hand covers about 40 pixels here."""


def with_things(frames, scene):
    """The frames with a patch beside the person, touching the edge of any region, and a far one."""
    changed = []
    for frame in frames:
        images = {}
        for name, image in frame.images.items():
            left, top, width, height = cv2.boundingRect(frame.masks[name].astype(np.uint8))
            image = image.copy()
            beside = left + width + 4
            image[top + 5 : top + 12, beside : beside + 60] = (20, 200, 240)
            image[-12:, :12] = 0
            images[name] = image
        changed.append(replace(frame, images=images))
    return changed


@pytest.mark.parametrize("undecided", [True, False], ids=["three classes", "two classes"])
@pytest.mark.parametrize("things", [False, True], ids=["alone", "among things"])
def test_the_pose_is_that_of_whole_images(
    make_tracker, frames, scene, swarm_settings, things, undecided
) -> None:
    frames = with_things(frames, scene) if things else frames
    small = {"evaluations": 200, "edge_weight": 0.0, "shadow.undecided": undecided}
    whole = make_tracker(swarm_settings, **{"region.full_frame_every": 1}, **small)
    part = make_tracker(swarm_settings, **{"region.full_frame_every": 4}, **small)
    sizes = []
    for frame in frames:
        a, b = (tracker.step(frame.images, frame.stamp_ns) for tracker in (whole, part))
        assert a.state is b.state is TrackState.TRACKING
        assert a.pose.tobytes() == b.pose.tobytes()
        for name, seen in b.observations.items():
            u, v = seen.offset_px
            cut = np.s_[v : v + seen.height, u : u + seen.width]
            np.testing.assert_array_equal(seen.mask, a.observations[name].mask[cut])
            if undecided:
                one, other = (
                    o.in_full_frame(o.not_background) for o in (seen, a.observations[name])
                )
                np.testing.assert_array_equal(one[cut], other[cut])
            # Specks among undecided pixels do not ask for a wider region.
            beyond = int(a.observations[name].mask.sum()) - int(seen.mask.sum())
            assert 0 <= beyond <= (SPECKS_PX if undecided else 0)
        sizes.append([seen.edges.size for seen in b.observations.values()])
    moved_m = np.linalg.norm(b.markers_m - frames[0].markers_m, axis=1).mean()
    assert moved_m > 0.03, "the start pose itself would pass"
    full = 256 * 192
    # Regions follow from the pose of the set before the last one: the first two use whole images.
    assert sizes[0] == sizes[1] == [full] * 4
    if not things:
        assert all(sum(size == full for size in row) < 2 for row in sizes[2:])
    assert any(size < full // 2 for row in sizes[2:] for size in row)


def lines(camera, body, pose):
    return body_lines(camera, place_cones(body, pose))


def seen_in(mask, region: Region) -> Observation:
    part = np.ascontiguousarray(mask[region.slices])
    return Observation.from_mask(
        "cam01",
        5,
        part,
        np.zeros(part.shape, np.uint8),
        size_px=(240, 180),
        offset_px=(region.left, region.top),
    )


def test_exposure_is_reported_per_camera(make_tracker, frames, swarm_settings) -> None:
    tracker = make_tracker(swarm_settings, evaluations=100)
    for frame, gain in zip(frames[:2], (1.0, 1.2), strict=True):
        views = {
            name: np.clip(image * gain, 0, 255).astype(np.uint8)
            for name, image in frame.images.items()
        }
        exact = dict(views)
        last = next(reversed(exact))
        exact[last] = frame.observations[last]
        exposure = tracker.step(exact, frame.stamp_ns).exposure
        assert set(exposure) == set(views) - {last}
        for values in exposure.values():
            assert values == pytest.approx((gain,) * 3, rel=0.02)


def test_the_region_holds_the_body_and_its_margin(camera, body, pose):
    mask = np.asarray(silhouette(body, pose, camera)).astype(np.uint8)
    box = cv2.boundingRect(mask)
    bare = body_region(lines(camera, body, pose), 0.0, 0)
    wide = body_region(lines(camera, body, pose), 0.2, 0)
    assert bare.left <= box[0] and bare.right >= box[0] + box[2]
    assert bare.top <= box[1] and bare.bottom >= box[1] + box[3]
    depth_m = np.linalg.norm(camera.T_cam_world[:3, 3])
    margin = 0.2 * camera.matrix[0, 0] / depth_m
    assert bare.left - wide.left == pytest.approx(margin, rel=0.3)
    assert body_region(lines(camera, body, pose), 0.0, 30).left <= bare.left - 29
    assert body_region(lines(camera, body, pose), 1e6, 0) == Region(0, 0, 240, 180)


@pytest.mark.parametrize("away_m", [50.0, -50.0, 1e9])
def test_a_body_out_of_sight_has_no_region(camera, body, pose, away_m):
    for axis in ("pelvis_tx", "pelvis_ty"):
        moved = pose.copy()
        moved[body.index(axis)] = away_m
        region = body_region(lines(camera, body, moved), 0.1, 0)
        assert region is None or region.width * region.height < 240 * 180 / 4


def test_what_is_kept_in_a_region_is_what_is_kept_of_the_frame(camera, body, pose):
    mask = np.asarray(silhouette(body, pose, camera)).astype(bool)
    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    region = Region(left, top, left + width, top + height).grown(20, (240, 180))
    mask[region.top + 30 : region.top + 36, region.left : region.left + 5] = True
    mask[2:6, 2:6] = True
    whole = explained_part(seen_in(mask, Region(0, 0, 240, 180)), lines(camera, body, pose), 0)[0]
    found = explained_in_region(seen_in(mask, region), lines(camera, body, pose), 0, 3)
    assert found is not None and found[1] == 30
    np.testing.assert_array_equal(found[0].mask, whole.mask[region.slices])


def test_a_body_cut_by_the_region_asks_for_the_frame(camera, body, pose):
    mask = np.asarray(silhouette(body, pose, camera)).astype(bool)
    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    box = Region(left, top, left + width, top + height)
    assert explained_in_region(seen_in(mask, box), lines(camera, body, pose), 0, 3) is None
    near = box.grown(2, (240, 180))
    assert explained_in_region(seen_in(mask, near), lines(camera, body, pose), 0, 3) is None
    assert explained_in_region(seen_in(mask, near), lines(camera, body, pose), 0, 2) is not None
    # Cut by the frame itself: there is nothing more to see.
    whole = Region(0, 0, 240, 180)
    assert explained_in_region(seen_in(mask, whole), lines(camera, body, pose), 0, 500) is not None


def test_undecided_pixels_at_a_side_do_not_ask_for_the_frame(camera, body, pose):
    person = np.asarray(silhouette(body, pose, camera)).astype(bool)
    left, top, width, height = cv2.boundingRect(person.astype(np.uint8))
    region = Region(left, top, left + width, top + height).grown(10, (240, 180))
    # A shadow on the floor, from the feet out of the region, and then a thing on it.
    floor = np.zeros_like(person)
    floor[top + height - 6 : top + height - 1, left : left + width + 40] = True
    floor &= ~person
    thing = np.zeros_like(person)
    thing[top + height - 8 : top + height, left + width + 30 : left + width + 36] = True

    def seen(part: Region, mask) -> Observation:
        return Observation.from_mask(
            "cam01", 5, mask[part.slices], np.zeros(mask[part.slices].shape, np.uint8),
            undecided=(floor & ~mask)[part.slices], size_px=(240, 180),
            offset_px=(part.left, part.top),
        )  # fmt: skip

    found = explained_in_region(seen(region, person | thing), lines(camera, body, pose), 0, 5)
    assert found is not None and found[1] == 0
    np.testing.assert_array_equal(found[0].mask, person[region.slices])
    # The person leaves the region in the same place.
    assert (
        explained_in_region(seen(region, person | floor), lines(camera, body, pose), 0, 5) is None
    )
    # All that is near the body is undecided: the frame may tell more.
    nobody = np.zeros_like(person)
    assert explained_in_region(seen(region, nobody), lines(camera, body, pose), 0, 5) is None


def test_a_region_without_the_body_asks_for_the_frame(camera, body, pose):
    region = Region(0, 0, 240, 180)
    nothing = np.zeros((180, 240), dtype=bool)
    assert explained_in_region(seen_in(nothing, region), lines(camera, body, pose), 0, 3) is None
    nothing[2:8, 2:8] = True
    assert explained_in_region(seen_in(nothing, region), lines(camera, body, pose), 0, 3) is None
