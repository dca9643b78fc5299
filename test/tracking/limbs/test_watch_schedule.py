"""Which frames the searches of limbs, headings and exchanged pairs fall on."""

import numpy as np

from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.unexplained import Unexplained
from markerless_tracker.tracking.limbs.watch import LONGEST_TURN_NS, LimbWatch
from markerless_tracker.tracking.search import Searcher


def searches_of(monkeypatch, every_ns, count, areas_m2=None):
    """What each of `count` frames searches, while an exchange is always possible."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=(164, 123), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    package = "markerless_tracker.tracking.limbs"
    now: list[str] = []
    for name, value in (
        ("watch.find_unexplained", lambda *_: Unexplained(dict(areas_m2 or {}), {})),
        ("watch.FIRST_WAIT_NS", 0),
        ("facing.FacingWatch.compare", lambda *_: now.append("facing")),
        ("exchange.LEAST_M", 0.0),
        ("search.LimbSearch.takes", lambda *_: now.append("exchange")),
        ("search.LimbSearch.elsewhere", lambda *_: now.append("limb")),
    ):
        monkeypatch.setattr(f"{package}.{name}", value)
    body, watch = scene.body, LimbWatch(scene.rig)
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    contours = searcher.frame(seen, 0, pose).contours
    frames = []
    for number in range(count):
        now.clear()
        watch.recover(searcher, contours, Seen(number * every_ns, seen, seen, seen), pose)
        frames.append(sorted(now))
    return frames


def test_searches_that_can_wait_are_spread_over_dense_frames(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 16_666_667, 61)
    first, *others = frames
    assert first == ["exchange", "facing", "limb"]
    assert max(map(len, others)) == 1
    counts = {name: sum(frame == [name] for frame in others) for name in first}
    # In a second: every 50, 250 and 100 ms, the last two up to three frames later.
    assert counts == {"exchange": 20, "facing": 3, "limb": 9}


def test_searches_of_frames_far_apart_do_not_wait(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 50_000_000, 21)
    assert frames[2::10] == [["exchange", "limb"]] * 2
    assert sum("exchange" in frame for frame in frames) == 21
    assert sum("limb" in frame for frame in frames) == 11


def test_the_rotation_goes_on_while_every_dense_frame_is_searched(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 16_666_667, 61, {"r_leg": 0.01})
    # The leg near unexplained silhouette, and the limb in rotation; once that is the leg itself.
    both = [number for number, frame in enumerate(frames) if frame.count("limb") == 2]
    every = LONGEST_TURN_NS // 16_666_667 + 1
    assert np.diff(both).tolist() == [every, every, 2 * every, every]
