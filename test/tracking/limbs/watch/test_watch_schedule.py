"""Which frames the searches of limbs, headings and exchanged pairs fall on."""

from collections import Counter
from math import ceil

import numpy as np
import pytest

from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.round_robin import PER_LIMB_NS, PUT_OFF
from markerless_tracker.tracking.limbs.unexplained import Unexplained
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher


def searches_of(monkeypatch, every_ns, count, areas_m2=None, named=False, wait_ns=0, **how):
    """What each of `count` frames searches, while an exchange is always possible.

    Limbs are `limb`, or their names with `named`.
    """
    scene = SyntheticScene(body="person31", motion="stand", size_px=(164, 123), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    package = "markerless_tracker.tracking.limbs"
    now: list[str] = []

    def compared(_, other, close):
        now.append("exchange")
        return other, -1.0

    def not_taken(_, limb, *__):
        name = next(n for n in body.limbs if np.array_equal(body.subspaces[n], limb))
        now.append(name if named else "limb")
        return False

    for name, value in (
        ("watch.find_unexplained", lambda *_: Unexplained(dict(areas_m2 or {}), {})),
        ("schedule.FIRST_WAIT_NS", wait_ns),
        ("facing.FacingWatch.compare", lambda *_: now.append("facing")),
        ("exchange.LEAST_M", 0.0),
        ("search.LimbSearch.compared", compared),
        ("search.LimbSearch.drawn", lambda _, limb, *__: np.zeros((1, len(limb)))),
        ("search.LimbSearch.take_drawn", not_taken),
    ):
        monkeypatch.setattr(f"{package}.{name}", value)
    body, watch = scene.body, LimbWatch(scene.rig)
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    contours = searcher.frame(seen, 0, pose).contours
    frames = []
    for number in range(count):
        now.clear()
        at = Seen(number * every_ns, seen, seen, seen)
        found = watch.recover(searcher, contours, at, pose, **how)
        assert found.searched == bool(now)
        frames.append(sorted(now))
    return frames


def test_searches_that_can_wait_are_spread_over_dense_frames(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 16_666_667, 61)
    first, *others = frames
    assert first == ["exchange", "facing", "limb"]
    assert max(map(len, others)) == 1
    counts = {name: sum(frame == [name] for frame in others) for name in first}
    # In a second: every 50, 250 and 96 ms, up to three frames later.
    assert counts == {"exchange": 19, "facing": 3, "limb": 10}


def test_of_the_limbs_near_unexplained_silhouette_one_is_searched_in_a_dense_frame(
    monkeypatch,
) -> None:
    """The next one is due while the likeliest, which was searched in vain, waits."""
    monkeypatch.setattr("markerless_tracker.tracking.limbs.round_robin.PER_LIMB_NS", 10**12)
    monkeypatch.setattr("markerless_tracker.tracking.limbs.exchange.EVERY_NS", 10**12)
    areas_m2 = {"r_leg": 0.02, "l_leg": 0.01}
    frames = searches_of(monkeypatch, 16_666_667, 5, areas_m2, named=True, wait_ns=20_000_000)
    legs = [[name for name in frame if name.endswith("leg")] for frame in frames]
    assert legs == [["l_leg", "r_leg"], [], ["r_leg"], ["l_leg"], []]


@pytest.fixture
def begun(stander, monkeypatch):
    """A stander whose last frame drew a limb that is not compared yet, its number, and for each
    draw and each comparison the limb and the numbers of the frames.
    """
    package, now = "markerless_tracker.tracking.limbs", 0
    drawn: list[tuple[bytes, int]] = []
    compared: list[tuple[bytes, int, int]] = []

    def draw(_, limb, *__):
        drawn.append((limb.tobytes(), now))
        return np.full((1, len(limb)), now)

    def take(_, limb, draws):
        compared.append((limb.tobytes(), int(draws[0, 0]), now))
        return False

    def frame(**how):
        nonlocal now
        stander.recover(now * 16_666_667, **how)
        now += 1

    monkeypatch.setattr(f"{package}.watch.find_unexplained", lambda *_: Unexplained({}, {}))
    monkeypatch.setattr(f"{package}.search.LimbSearch.drawn", draw)
    monkeypatch.setattr(f"{package}.search.LimbSearch.take_drawn", take)
    while len(drawn) < 4:
        frame()
    return stander, frame, drawn, compared


def test_a_limb_in_rotation_is_drawn_in_a_dense_frame_and_compared_in_the_next(begun) -> None:
    _, frame, drawn, compared = begun
    frame()
    (limb, first), *others = drawn
    assert compared == [(limb, first, first), *((name, at, at + 1) for name, at in others)]


def test_a_limb_that_was_drawn_is_searched_once_where_all_are(begun) -> None:
    _, frame, drawn, compared = begun
    limb, at = drawn[-1]
    compared.clear()
    frame(badly=True)
    assert len({name for name, *_ in compared}) == len(compared) == 4
    assert [when for name, when, _ in compared if name == limb] == [at]


def test_a_watch_that_was_reset_compares_nothing_that_was_drawn_before(begun) -> None:
    stander, frame, _, compared = begun
    compared.clear()
    stander.watch.reset()
    frame()
    assert all(when == now for _, when, now in compared)


def test_no_limb_is_left_out_where_several_became_due_meanwhile(begun, monkeypatch) -> None:
    stander, frame, drawn, _ = begun
    limbs = {stander.body.subspaces[name].tobytes(): name for name in stander.body.limbs}
    stander.watch.reset()
    drawn.clear()
    package = "markerless_tracker.tracking.limbs"
    # Nine tenths of a limb a frame, put off while another one is suspected.
    monkeypatch.setattr(f"{package}.round_robin.PER_LIMB_NS", 17_568_000)
    monkeypatch.setattr(f"{package}.schedule.FIRST_WAIT_NS", 0)
    monkeypatch.setattr(f"{package}.exchange.EVERY_NS", 10**12)
    monkeypatch.setattr(f"{package}.facing.FIRST_EVERY_NS", 10**12)
    for area_m2 in (0.0, 0.01, 0.01, 0.0, 0.0, 0.0):
        areas_m2 = {"r_leg": area_m2} if area_m2 else {}
        monkeypatch.setattr(
            f"{package}.watch.find_unexplained", lambda *_, found=areas_m2: Unexplained(found, {})
        )
        frame()
    names = [limbs[limb] for limb, _ in drawn]
    assert [name for name in names if name != "r_leg"] == ["l_arm", "r_arm", "l_leg"]


def test_all_limbs_are_searched_where_a_frame_is_explained_badly(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 16_666_667, 7, badly=True)
    assert all(frame.count("limb") == 4 for frame in frames)
    late = searches_of(monkeypatch, 100_000_000, 7, badly=True, late=True)
    assert all(frame.count("limb") == 1 for frame in late)


def test_searches_of_frames_far_apart_do_not_wait(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 50_000_000, 21)
    assert all(frame.count("exchange") == 1 for frame in frames)
    # (50 / 40)² a frame.
    assert {frame.count("limb") for frame in frames[1:]} == {1, 2}
    assert sum(frame.count("limb") for frame in frames) == 1 + 31


@pytest.mark.parametrize("every_ns", [50_000_000, 66_666_667, 100_000_000, 133_333_333])
@pytest.mark.parametrize("areas_m2", [{}, {"r_leg": 0.02, "l_leg": 0.01}])
def test_a_late_tracker_searches_every_limb(monkeypatch, every_ns, areas_m2) -> None:
    """Comparisons of whole poses fall on the same frames as some limbs of the rotation."""
    frames = searches_of(monkeypatch, every_ns, 120, areas_m2, named=True, late=True, single=True)
    limbs = {"l_arm", "r_arm", "l_leg", "r_leg"}
    assert all(len(frame) == 1 for frame in frames if limbs.intersection(frame))
    counts = Counter(name for frame in frames for name in frame)
    for name in limbs:
        assert counts[name] >= (5 if areas_m2 else 14)
    assert all(counts[name] >= 20 for name in areas_m2)


def test_the_rotation_goes_on_while_every_dense_frame_is_searched(monkeypatch) -> None:
    frames = searches_of(monkeypatch, 16_666_667, 61, {"r_leg": 0.01})
    # The leg near unexplained silhouette, and the limb in rotation; once that is the leg itself.
    both = [number for number, frame in enumerate(frames) if frame.count("limb") == 2]
    every = ceil(PUT_OFF * (PER_LIMB_NS / 16_666_667) ** 2)
    np.testing.assert_allclose(np.diff(both), [every, every, 2 * every, every], atol=1)
