"""Evidence made ahead gives the same bytes as `step` alone, however the calls lie in time."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.records import Observation, TrackState

SMALL = {"evaluations": 100, "edge_weight": 0.0, "region.full_frame_every": 5}


def said(result) -> tuple[object, ...]:
    """All that a result says, as bytes."""
    views = tuple(
        (o.camera, o.offset_px, o.mask_words.tobytes(), o.not_background.tobytes())
        for o in result.observations.values()
    )
    pose = None if result.pose is None else result.pose.tobytes()
    return pose, result.state, views, result.warnings, tuple(result.exposure.items())


@pytest.fixture
def alone(make_tracker, frames, swarm_settings):
    tracker = make_tracker(swarm_settings, **SMALL)
    results = [tracker.step(f.images, f.stamp_ns) for f in frames]
    assert results[-1].state is TrackState.TRACKING
    whole = 256 * 192
    sizes = [o.edges.size for r in results[2:] for o in r.observations.values()]
    assert min(sizes) < whole // 2, "no region was used"
    return [said(result) for result in results]


def test_the_next_set_is_prepared_before_the_step(
    make_tracker, frames, swarm_settings, alone
) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    ahead = tracker.prepare(frames[0].images, frames[0].stamp_ns)
    for i, frame in enumerate(frames):
        prepared = ahead
        if i + 1 < len(frames):
            ahead = tracker.prepare(frames[i + 1].images, frames[i + 1].stamp_ns)
        assert prepared.seen, "nothing was made ahead"
        assert said(tracker.step(prepared, frame.stamp_ns)) == alone[i]


def test_the_next_set_is_prepared_beside_the_step(
    make_tracker, frames, swarm_settings, alone
) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(tracker.prepare, frames[0].images, frames[0].stamp_ns)
        for i, frame in enumerate(frames):
            prepared = ahead.result()
            following = frames[min(i + 1, len(frames) - 1)]
            ahead = pool.submit(tracker.prepare, following.images, following.stamp_ns)
            assert said(tracker.step(prepared, frame.stamp_ns)) == alone[i]


def test_a_camera_that_is_corrected_meanwhile(make_tracker, scene, frames, swarm_settings) -> None:
    """The regions of a set that is prepared beside a step follow from the cameras before it."""
    times = [(f.images, 100_000_000 * i) for i, f in enumerate([*frames, *frames[::-1]])]

    def tracker():
        wrong = scene.rig.shifted({"cam02": (2.0, -1.5)})
        return make_tracker(swarm_settings, rig=wrong, **SMALL, correct_cameras=True)

    alone, one = [], tracker()
    for images, stamp_ns in times:
        alone.append(said(one.step(images, stamp_ns)))
    assert one.rig["cam02"].matrix[0, 2] != tracker().rig["cam02"].matrix[0, 2]
    other = tracker()
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(other.prepare, *times[0])
        for i, (_, stamp_ns) in enumerate(times):
            prepared = ahead.result()
            ahead = pool.submit(other.prepare, *times[min(i + 1, len(times) - 1)])
            assert said(other.step(prepared, stamp_ns)) == alone[i]


def test_sets_prepared_late_early_or_left_out(make_tracker, frames, swarm_settings, alone) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    early = [tracker.prepare(f.images, f.stamp_ns) for f in frames[:4]]
    results = [tracker.step(p, f.stamp_ns) for p, f in zip(early, frames, strict=False)]
    tracker.prepare(frames[0].images, frames[0].stamp_ns)
    for frame in frames[4:]:
        prepared = tracker.prepare(frame.images, frame.stamp_ns)
        results.append(tracker.step(prepared, frame.stamp_ns))
    assert [said(result) for result in results] == alone


def test_sets_are_made_ahead_again_after_one_that_was_skipped(
    make_tracker, frames, swarm_settings, alone
) -> None:
    """The skipped set was prepared during a step, as was the one after it."""
    tracker = make_tracker(swarm_settings, **SMALL)
    held, skipped, late = (tracker.prepare(f.images, f.stamp_ns) for f in frames[:3])
    assert skipped.seen and not late.seen
    tracker.step(held, frames[0].stamp_ns)
    tracker.step(late, frames[2].stamp_ns)
    for frame in frames[3:]:
        prepared = tracker.prepare(frame.images, frame.stamp_ns)
        assert prepared.seen
        tracker.step(prepared, frame.stamp_ns)
        made = tracker._lookahead.made(prepared, frame.stamp_ns, prepared.outlook)[1]
        assert made is prepared.seen


def test_after_a_reset_it_is_made_anew(make_tracker, frames, swarm_settings, alone) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    for frame in frames[:4]:
        tracker.step(frame.images, frame.stamp_ns)
    stale = tracker.prepare(frames[0].images, frames[0].stamp_ns)
    tracker.reset()
    assert said(tracker.step(stale, frames[0].stamp_ns)) == alone[0]


def test_a_wrong_image_is_refused_and_passed_over(
    make_tracker, frames, swarm_settings, alone
) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    for i, frame in enumerate(frames[:4]):
        with pytest.raises(ImageError, match="cam01"):
            tracker.prepare({"cam01": np.zeros((5, 5, 3), np.uint8)}, frame.stamp_ns)
        with pytest.raises(ImageError, match="cam01"):
            tracker.step({"cam01": np.zeros((5, 5, 3), np.uint8)}, frame.stamp_ns)
        prepared = tracker.prepare(frame.images, frame.stamp_ns)
        assert prepared.seen
        assert said(tracker.step(prepared, frame.stamp_ns)) == alone[i]


def test_ready_made_observations_pass(make_tracker, frames, swarm_settings) -> None:
    tracker = make_tracker(swarm_settings, **SMALL)
    frame = frames[0]
    prepared = tracker.prepare(frame.observations, frame.stamp_ns)
    assert all(isinstance(v.observation, Observation) for v in prepared.seen.values())
    result = tracker.step(prepared, frame.stamp_ns)
    assert result.state is TrackState.TRACKING and result.exposure == {}


def test_a_background_that_follows_gets_the_images_in_order(
    make_tracker, frames, swarm_settings
) -> None:
    settings = {**SMALL, "background.follow_s": 5.0}
    one, other = (make_tracker(swarm_settings, **settings) for _ in range(2))
    ahead = other.prepare(frames[0].images, frames[0].stamp_ns)
    for i, frame in enumerate(frames[:-1]):
        prepared = ahead
        ahead = other.prepare(frames[i + 1].images, frames[i + 1].stamp_ns)
        a, b = one.step(frame.images, frame.stamp_ns), other.step(prepared, frame.stamp_ns)
        assert said(a) == said(b)


def test_a_process_of_its_own_prepares_the_sets(
    make_tracker, frames, swarm_settings, alone
) -> None:
    tracker = make_tracker(swarm_settings, **SMALL, threads=2)
    tracker.evidence.start_process()
    tracker.warm_up()
    assert tracker.evidence.process_cpu_s > 0.0
    for i, frame in enumerate(frames):
        used_s = tracker.evidence.process_cpu_s
        prepared = tracker.prepare(frame.images, frame.stamp_ns)
        assert tracker.evidence.process_cpu_s > used_s, "the process did nothing"
        assert said(tracker.step(prepared, frame.stamp_ns)) == alone[i]
    tracker.evidence.close()
