"""A second person crossing one view is excluded from the silhouette, with a warning."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.records import Observation, TrackState

CAMERA = "cam02"


def crossing(frames, gap_px: int) -> Iterator[tuple[object, np.ndarray]]:
    """The frames with a second person walking through one view, and that person's mask (h, w).

    The distance to the first person is at least `gap_px`; first on the left, then on the right.
    """
    steps = len(frames)
    for index, frame in enumerate(frames):
        mask = frame.masks[CAMERA] > 0
        left, _, width, _ = cv2.boundingRect(mask.astype(np.uint8))
        room_left, room_right = left - gap_px - width, mask.shape[1] - left - 2 * width - gap_px
        assert room_left > 0 and room_right > 0
        # From the image border to the person, then from the person to the other border.
        before = steps // 2
        if index < before:
            shift = room_left * (index + 1) // before - left
        else:
            part = (index - before) / max(steps - before - 1, 1)
            shift = width + gap_px + int(room_right * part)
        double = np.roll(mask, shift, axis=1)
        near = cv2.dilate(mask.astype(np.uint8), np.ones((2 * gap_px - 1,) * 2, np.uint8))
        assert not (double & (near > 0)).any()
        images = dict(frame.images)
        image = images[CAMERA].copy()
        image[double] = np.roll(images[CAMERA], shift, axis=1)[double]
        images[CAMERA] = image
        yield replace(frame, images=images), double


@pytest.mark.parametrize("every", [1, 1000], ids=["whole images", "regions"])
def test_a_second_person_crossing_a_view_changes_nothing(
    make_tracker, frames, refined_settings, every
) -> None:
    settings = dict(
        refined_settings, evaluations=250, fit_shape=False, **{"region.full_frame_every": every}
    )
    alone = make_tracker(settings, edge_weight=0.0)
    beside = make_tracker(settings, edge_weight=0.0)
    gap = beside.config.region.component_margin_px + 6
    warned = []
    for frame, (crossed, double) in zip(frames, crossing(frames, gap), strict=True):
        expected = alone.step(frame.images, frame.stamp_ns)
        result = beside.step(crossed.images, frame.stamp_ns)
        seen = result.observations[CAMERA]
        u, v = seen.offset_px
        used = np.zeros(double.shape, bool)
        used[v : v + seen.height, u : u + seen.width] = seen.mask
        assert not (used & double).any()
        assert result.state is TrackState.TRACKING
        assert result.pose.tobytes() == expected.pose.tobytes()
        warned.append(any(w.startswith(f"{CAMERA}: ") for w in result.warnings))
    # A person outside the region of interest is not seen at all.
    assert all(warned) if every == 1 else any(warned)
    moved_m = np.linalg.norm(result.markers_m - frames[0].markers_m, axis=1).mean()
    assert moved_m > 0.05, "the start pose itself would pass"


@pytest.mark.parametrize("overlap_px", [6, 20])
def test_a_second_person_touching_the_first_in_one_view_adds_little_error(
    make_tracker, frames, refined_settings, overlap_px
) -> None:
    settings = dict(refined_settings, fit_shape=False, edge_weight=0.0)
    alone, beside = make_tracker(settings), make_tracker(settings)
    errors_mm = np.zeros((2, len(frames)))
    for index, frame in enumerate(frames):
        views = frame.observations
        mask = frame.masks[CAMERA] > 0
        width = cv2.boundingRect(mask.astype(np.uint8))[2]
        both = mask | np.roll(mask, width - overlap_px, axis=1)
        assert cv2.connectedComponents(both.astype(np.uint8))[0] == 2
        edges = np.zeros(mask.shape, np.uint8)
        joined = {**views, CAMERA: Observation.from_mask(CAMERA, frame.stamp_ns, both, edges)}
        for row, (tracker, seen) in enumerate(((alone, views), (beside, joined))):
            found = tracker.step(seen, frame.stamp_ns).markers_m
            errors_mm[row, index] = 1e3 * np.linalg.norm(found - frame.markers_m, axis=1).mean()
    assert errors_mm[1].mean() < errors_mm[0].mean() + 2.0, errors_mm
    held_mm = 1e3 * np.linalg.norm(frames[0].markers_m - frames[-1].markers_m, axis=1).mean()
    assert errors_mm[1, -1] < 0.5 * held_mm, "the start pose itself would pass"
