"""Ready-made evidence of whole frames gives the bytes that their images give."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.imaging import Segmenter
from markerless_tracker.records import TrackState
from markerless_tracker.tracking import TrackerConfig


def said(result) -> tuple[object, ...]:
    """All that a result says, as bytes."""
    views = tuple(
        (o.camera, o.offset_px, o.mask_words.tobytes(), o.not_background.tobytes())
        for o in result.observations.values()
    )
    pose = None if result.pose is None else result.pose.tobytes()
    return pose, result.state, views, result.warnings, tuple(result.exposure.items())


@pytest.mark.parametrize("edge_weight", [0.0, 0.5], ids=["silhouettes", "with edges"])
@pytest.mark.parametrize("mixed", [False, True], ids=["all", "half of the cameras"])
def test_the_result_is_that_of_the_images(
    make_tracker, frames, swarm_settings, backgrounds, edge_weight, mixed
) -> None:
    small = {"evaluations": 100, "edge_weight": edge_weight, "region.full_frame_every": 5}
    config = TrackerConfig.from_mapping({**swarm_settings, **small})
    segmenters = {
        name: Segmenter(name, background, config, edges=edge_weight > 0.0)
        for name, background in backgrounds.items()
        if not mixed or name in ("cam02", "cam03")
    }
    of_images, of_evidence = (make_tracker(swarm_settings, **small) for _ in range(2))
    sizes = []
    for frame in frames:
        images = dict(frame.images)
        # A patch away from the person: components are chosen in the tracker.
        image = images["cam02"].copy()
        left, top, width, height = cv2.boundingRect(frame.masks["cam02"].astype(np.uint8))
        image[top + 5 : top + 12, left + width + 4 : left + width + 40] = (20, 200, 240)
        images["cam02"] = image
        views = dict(images)
        for name, segmenter in segmenters.items():
            seen = segmenter.observe(images[name], frame.stamp_ns)
            views[name] = replace(seen, exposure=segmenter.gain)
        expected = of_images.step(images, frame.stamp_ns)
        found = of_evidence.step(of_evidence.prepare(views, frame.stamp_ns), frame.stamp_ns)
        assert found.state is TrackState.TRACKING
        assert said(found) == said(expected)
        sizes += [o.edges.size for o in found.observations.values()]
    assert min(sizes) < 256 * 192 // 2, "no region was used"
