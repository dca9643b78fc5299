"""A second person who crosses one view is kept out of what is fitted, and told of."""

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.records import Observation, TrackState

CAMERA = "cam02"


def crossing(frames, gap_px: int) -> Iterator[tuple[object, np.ndarray]]:
    """The frames with the person's double walking through one view, and the double's mask (h, w).

    Never nearer to the person than `gap_px`; from the left, then on the right.
    """
    steps = len(frames)
    for index, frame in enumerate(frames):
        mask = frame.masks[CAMERA] > 0
        left, _, width, _ = cv2.boundingRect(mask.astype(np.uint8))
        room_left, room_right = left - gap_px - width, mask.shape[1] - left - 2 * width - gap_px
        assert room_left > 0 and room_right > 0
        # From its edge of the image up to the person, then on from his other side.
        before = steps // 2
        if index < before:
            shift = room_left * (index + 1) // before - left
        else:
            share = (index - before) / max(steps - before - 1, 1)
            shift = width + gap_px + int(room_right * share)
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
    told = []
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
        told.append(any(w.startswith(f"{CAMERA}: ") for w in result.warnings))
    # Whoever is outside the region that is looked at is not seen at all.
    assert all(told) if every == 1 else any(told)


@pytest.mark.parametrize("overlap_px", [6, 20])
def test_a_second_person_who_touches_him_in_one_view_costs_little(
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
