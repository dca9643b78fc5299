"""A tracker in a process of its own gives the bytes of one here; its end is no trouble."""

import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest

from markerless_tracker.compiled import compilation, compiled_elsewhere
from markerless_tracker.errors import CalibrationError, ConfigError, ImageError, TrackerError
from markerless_tracker.imaging import learn_background
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking import Tracker, TrackerConfig, TrackerSetup
from markerless_tracker.tracking.processes.tracker_process import TrackerProcess


def said(result: TrackResult) -> tuple[object, ...]:
    """What a result says, as bytes; covariances depend on the number of BLAS threads, which the
    process has but one of.
    """
    assert result.pose is not None
    views = tuple(
        (o.camera, o.offset_px, o.mask_words.tobytes(), o.not_background.tobytes(), o.edges.shape)
        for o in result.observations.values()
    )
    limbs, exposure = repr(result.limbs), tuple(result.exposure.items())
    return result.pose.tobytes(), result.state, views, limbs, exposure, result.warnings


@pytest.fixture
def setup(scene, backgrounds, refined_settings) -> TrackerSetup:
    config = TrackerConfig.from_mapping(
        {**refined_settings, "edge_weight": 0.0, "evaluations": 500, "threads": 2}
    )
    make = partial(
        Tracker,
        scene.rig,
        scene.body,
        config,
        start_pose=scene.pose(0),
        backgrounds=backgrounds,
    )
    return TrackerSetup(make(), make, None)


@pytest.fixture
def reports() -> list[str]:
    return []


@pytest.fixture
def process(setup, reports) -> Iterator[TrackerProcess]:
    started = TrackerProcess(setup, reports.append)
    started.warm_up()
    yield started
    started.close()


@pytest.fixture
def here(setup, frames) -> list[tuple[object, ...]]:
    tracker = setup.make()
    tracker.warm_up()
    return [said(tracker.step(f.images, f.stamp_ns)) for f in frames]


def test_results_are_the_same_bytes_again_and_again(process, here, frames, setup, reports) -> None:
    """With sets prepared beside the steps, in memory that is used anew after three sets."""
    for _ in range(2):
        with ThreadPoolExecutor(1) as pool:
            ahead = pool.submit(process.prepare, frames[0].images, frames[0].stamp_ns)
            for i, frame in enumerate(frames):
                prepared = ahead.result()
                following = frames[min(i + 1, len(frames) - 1)]
                ahead = pool.submit(process.prepare, following.images, following.stamp_ns)
                assert said(process.step(prepared, frame.stamp_ns)) == here[i]
        process.reset()
    assert process.cpu_s > 0.0 and not reports
    assert setup.tracker.state is TrackState.SEARCHING, "the tracker here took steps, too"


def test_images_and_observations_that_were_not_prepared_are_tracked(process, frames, here) -> None:
    assert said(process.step(frames[0].images, frames[0].stamp_ns)) == here[0]
    views = {**frames[1].images, "cam01": frames[1].observations["cam01"]}
    result = process.step(views, frames[1].stamp_ns)
    assert result.state is TrackState.TRACKING
    exact = frames[1].observations["cam01"].mask
    np.testing.assert_array_equal(
        result.observations["cam01"].in_full_frame(result.observations["cam01"].mask), exact
    )


def test_sets_that_were_prepared_and_left_out_are_forgotten(process, frames, here) -> None:
    for frame in frames[1:]:
        process.prepare(frame.images, frame.stamp_ns)
    process.reset()
    assert said(process.step(frames[0].images, frames[0].stamp_ns)) == here[0]


def test_the_fitted_body_and_the_confidence_come_with_the_result(process, frames, setup) -> None:
    before = process.body.cone_shape.copy()
    tracker = setup.make()
    for frame in frames:
        there = process.step(frame.images, frame.stamp_ns)
        result = tracker.step(frame.images, frame.stamp_ns)
        np.testing.assert_allclose(
            there.confidence.markers_sd_m, result.confidence.markers_sd_m, rtol=1e-6
        )
        np.testing.assert_array_equal(process.body.cone_shape, tracker.body.cone_shape)
    assert not np.array_equal(process.body.cone_shape, before), "the shape was not fitted"


def test_what_the_tracker_raises_is_raised_here_and_the_next_set_is_tracked(
    process, frames, here
) -> None:
    small = {name: image[:-2] for name, image in frames[0].images.items()}
    with pytest.raises(ImageError, match="cam01"):
        process.step(small, 0)
    with pytest.raises(CalibrationError, match="cam99"):
        process.prepare({"cam99": frames[0].images["cam01"]}, 0)
    large = {name: np.tile(image, (3, 1, 1)) for name, image in frames[0].images.items()}
    with pytest.raises(ImageError, match=r"cam01.* \d+x\d+"):
        process.prepare(large, 0)
    with pytest.raises(ConfigError, match="effort"):
        process.step(frames[0].images, frames[0].stamp_ns, 2.0)
    process.reset()
    assert said(process.step(frames[0].images, frames[0].stamp_ns)) == here[0]


def test_settings_change_there(process, frames, setup) -> None:
    more = TrackerConfig.from_mapping({**setup.tracker.config.by_name(), "evaluations": 1000})
    one = process.step(frames[0].images, frames[0].stamp_ns)
    process.reset()
    process.configure(more)
    other = process.step(frames[0].images, frames[0].stamp_ns)
    assert other.evaluations > one.evaluations > 0


def test_other_backgrounds_are_used_there_and_known_here(process, frames, backgrounds) -> None:
    small = learn_background([np.zeros((10, 10, 3), np.uint8)] * 2, camera="cam01")
    with pytest.raises(ImageError, match="cam01"):
        process.take_backgrounds({"cam01": small})
    process.take_backgrounds(backgrounds)
    assert process.segmenter("cam01").background is backgrounds["cam01"]
    result = process.step(frames[0].images, frames[0].stamp_ns)
    assert result.state is TrackState.TRACKING


@pytest.mark.parametrize("prepared", [True, False], ids=["prepared", "images"])
def test_a_process_that_was_killed_leaves_the_tracking_to_this_one(
    process, frames, here, reports, prepared
) -> None:
    process.step(frames[0].images, frames[0].stamp_ns)
    os.kill(process.pid, signal.SIGKILL)

    def views(frame: Any) -> Any:
        return process.prepare(frame.images, frame.stamp_ns) if prepared else frame.images

    results = [said(process.step(views(f), f.stamp_ns)) for f in frames]
    assert results == here
    assert len(reports) == 1 and "ended" in reports[0]


def test_a_closed_tracker_does_not_go_on_here(process, frames, reports) -> None:
    process.close()
    with pytest.raises(TrackerError, match="closed"):
        process.step(frames[0].images, frames[0].stamp_ns)
    assert not reports


def test_closing_ends_it_and_what_it_started(setup) -> None:
    process = TrackerProcess(setup)
    pid = process.pid
    children = _children(pid)
    process.close()
    assert children
    until_s = time.monotonic() + 120
    while any(os.path.exists(f"/proc/{ended}") for ended in (pid, *children)):
        assert time.monotonic() < until_s
        time.sleep(0.01)


def _children(pid: int) -> list[int]:
    with open(f"/proc/{pid}/task/{pid}/children") as file:
        return [int(word) for word in file.read().split()]


def test_progress_of_another_process_is_reported() -> None:
    told: list[tuple[str, int, int]] = []
    with compilation(lambda *values: told.append(values)) as counted:
        compiled_elsewhere("twice", 3, 10_000)
        compiled_elsewhere("twice", 4, 10_000)
    compiled_elsewhere("too late", 5, 10_000)
    assert told == [("twice", 3, 10_000), ("twice", 4, 10_000)]
    assert counted.done == 4
