"""Legs and arms that were tracked into each other's place are exchanged."""

from dataclasses import dataclass

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.crossed import in_each_others_place, is_crossed
from markerless_tracker.tracking.candidates.mirror import Mirror
from markerless_tracker.tracking.candidates.postures import postures
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.exchange import (
    EVERY_NS,
    LEAST_GAIN,
    LEAST_GAIN_PLACED,
    LEAST_M,
    LEAST_SUM,
    PAIRS,
    PairExchange,
)
from markerless_tracker.tracking.limbs.recovered import Recovered
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher

EXCHANGE = "markerless_tracker.tracking.limbs.exchange"
ENDS = {"legs": ("LAnkle", "RAnkle"), "arms": ("LWrist", "RWrist")}


@dataclass(frozen=True, eq=False)
class Walking:
    """A frame of a walk with a pair of limbs far apart, and the pose with the pair exchanged."""

    pair: str
    scene: SyntheticScene
    seen: dict[str, Observation]
    pose: FloatArray
    swapped: FloatArray

    def off_m(self, pose: FloatArray) -> float:
        """Largest error of the pair's ends."""
        return float(self._apart_m(pose, self.pose).max())

    def _apart_m(self, pose: FloatArray, other: FloatArray) -> FloatArray:
        body, rows = self.scene.body, [MARKER_NAMES.index(name) for name in ENDS[self.pair]]
        return np.linalg.norm(markers(body, pose) - markers(body, other), axis=1)[rows]


@pytest.fixture(scope="module", params=PAIRS)
def walking(request) -> Walking:
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    pair, rows = request.param, [MARKER_NAMES.index(name) for name in ENDS[request.param]]
    best, apart = 0, 0.0
    for frame in range(0, 40, 4):
        at = markers(scene.body, scene.frame(frame)[2])[rows]
        if (gap := abs(float(at[0, 0] - at[1, 0]))) > apart:
            best, apart = frame, gap
    _, masks, pose = scene.frame(best)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    swapped, limbs = pose.copy(), scene.body.subspaces[pair]
    swapped[limbs] = Mirror(scene.body).of(pose)[limbs]
    return Walking(pair, scene, seen, pose, swapped)


def recovered(
    walking: Walking, pose: FloatArray, watch: LimbWatch | None = None, stamp_ns: int = 0
) -> Recovered:
    """What is found elsewhere at a pose while that pair's exchange is due."""
    scene = walking.scene
    body, config = scene.body, TrackerConfig(threads=1)
    searcher = Searcher(scene.rig, body, config, limits=body.limits, threads=1)
    watch = watch or LimbWatch(scene.rig)
    watch._schedule.exchange._next = PAIRS.index(walking.pair)
    contours = searcher.frame(walking.seen, stamp_ns, pose).contours
    seen = Seen(stamp_ns, walking.seen, walking.seen, walking.seen)
    return watch.recover(searcher, contours, seen, pose)


def test_an_exchanged_pair_is_exchanged_back(walking: Walking) -> None:
    assert walking.off_m(walking.swapped) > 0.2
    found = recovered(walking, walking.swapped)
    assert found.names[:1] == (walking.pair,)
    assert found.notes[0] == f"{walking.pair}: found elsewhere"
    body = walking.scene.body
    assert set(body.subspaces[walking.pair]) <= set(found.jumped(body))
    assert walking.off_m(found.pose) < 0.05


def test_gains_too_small_for_one_frame_add_up(walking: Walking, monkeypatch) -> None:
    for name in ("LEAST_GAIN", "LEAST_GAIN_PLACED"):
        monkeypatch.setattr(f"{EXCHANGE}.{name}", 9.0)
    watch = LimbWatch(walking.scene.rig)
    found = [recovered(walking, walking.swapped, watch, i * EVERY_NS) for i in range(3)]
    assert [walking.pair in one.names for one in found] == [False, False, True]
    assert walking.off_m(found[2].pose) < 0.05


def test_when_an_exchange_is_taken() -> None:
    exchange, some, far_m = PairExchange(), 0.4 * LEAST_SUM, 2.0 * LEAST_M

    def taken(*gains: float, least_gain: float = LEAST_GAIN, moved_m: float = far_m) -> list[bool]:
        exchange.forget_gains()
        return [exchange.add_comparison("arms", gain, least_gain, moved_m) for gain in gains]

    assert taken(LEAST_GAIN) == [True]
    # 0.4, 0.76 and 1.08 of the least sum; then it begins anew.
    assert taken(some, some, some, some) == [False, False, True, False]
    # A worse fit lowers the sum, to 0 at least.
    assert taken(some, some, -some, some) == [False, False, False, False]
    assert taken(-1.0, some, some, some) == [False, False, False, True]
    # The exchange must fit better now, too.
    assert taken(some, some, 0.99 * LEAST_GAIN, least_gain=1.0)[2]
    assert taken(0.9, 0.9, -0.1, 0.1, least_gain=1.0) == [False, False, False, True]
    # Two comparisons are too few.
    assert taken(0.9, 0.9, 0.9, least_gain=1.0) == [False, False, True]
    # An exchange that the refinement took back tells nothing.
    assert taken(some, some, some, some, moved_m=0.0) == [False] * 4
    assert taken(0.9, least_gain=0.0, moved_m=0.0) == [False]
    assert taken(0.0, least_gain=0.0, moved_m=0.0) == [False]
    assert taken(0.0, least_gain=0.0) == [True]
    assert taken(0.9, 0.9, least_gain=1.0) == [False, False]
    assert not exchange.add_comparison("arms", 0.9, 1.0, moved_m=0.0)
    assert exchange.add_comparison("arms", 0.9, 1.0, far_m)


def test_each_pair_has_a_sum_of_its_own() -> None:
    exchange, some, far_m = PairExchange(), 0.4 * LEAST_SUM, 2.0 * LEAST_M
    pairs = ("arms", "legs") * 2
    assert not any(exchange.add_comparison(pair, some, LEAST_GAIN, far_m) for pair in pairs)
    assert exchange.add_comparison("legs", some, LEAST_GAIN, far_m)
    exchange.reset()
    assert not exchange.add_comparison("arms", some, LEAST_GAIN, far_m)


def test_a_pair_in_its_place_stays(walking: Walking) -> None:
    assert walking.pair not in recovered(walking, walking.pose).names


def test_the_pairs_are_tried_in_turn_where_it_changes_anything(walking: Walking) -> None:
    body, exchange = walking.scene.body, PairExchange()
    stamps = [10, 10 + EVERY_NS, 10 + 2 * EVERY_NS]
    tried = [exchange.take_due(body, walking.pose, body.limits, stamp) for stamp in stamps]
    assert [one and one[0] for one in tried] == [PAIRS[0], PAIRS[1], PAIRS[0]]
    other = tried[PAIRS.index(walking.pair)]
    assert other is not None
    np.testing.assert_allclose(
        markers(body, other.poses[0]), markers(body, walking.swapped), atol=0.01
    )
    assert other.least_gains == (LEAST_GAIN, LEAST_GAIN_PLACED)
    assert exchange.take_due(body, walking.pose, body.limits, stamps[-1] + EVERY_NS - 1) is None
    # Time that was set back begins anew.
    assert exchange.take_due(body, walking.pose, body.limits, 0) is not None
    exchange.reset()
    assert exchange.take_due(body, body.neutral, body.limits, 0) is None
    assert LEAST_M > 0.0


def test_a_pair_alone_in_another_place_is_tried_every_time(walking: Walking) -> None:
    body, exchange = walking.scene.body, PairExchange()
    pose, limbs = body.neutral.copy(), body.subspaces[walking.pair]
    pose[limbs] = walking.pose[limbs]
    for stamp in (0, EVERY_NS):
        tried = exchange.take_due(body, pose, body.limits, stamp)
        assert tried is not None and tried[0] == walking.pair


@pytest.fixture(scope="module")
def standing() -> Walking:
    """A person who stands with the legs apart, and the same silhouettes with crossed legs."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)
    body, apart = scene.body, scene.body.neutral.copy()
    apart[body.index("l_hip_x")] += 0.15
    apart[body.index("r_hip_x")] -= 0.15
    masks = body_masks(body, apart, list(scene.rig))
    seen = {
        name: Observation.from_mask(name, 0, mask.astype(np.uint8), np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    crossed = in_each_others_place(body, apart, "legs", body.limits)
    return Walking("legs", scene, seen, apart, crossed)


def test_crossed_legs_take_each_others_place(standing: Walking) -> None:
    body, rows = standing.scene.body, [MARKER_NAMES.index(name) for name in ENDS["legs"]]
    assert not is_crossed(body, standing.pose, "legs")
    assert is_crossed(body, standing.swapped, "legs")
    apart, crossed = (markers(body, pose)[rows] for pose in (standing.pose, standing.swapped))
    np.testing.assert_allclose(crossed, apart[::-1], atol=0.07)
    # Exchanged angles would leave them crossed.
    mirrored = standing.swapped.copy()
    mirrored[body.subspaces["legs"]] = Mirror(body).of(mirrored)[body.subspaces["legs"]]
    assert is_crossed(body, mirrored, "legs")


def test_what_is_crossed_no_more_need_not_be_better(standing: Walking) -> None:
    body = standing.scene.body
    due = PairExchange().take_due(body, standing.swapped, body.limits, 0)
    assert due is not None and due.name == "legs" and due.least_gains == (0.0,)
    assert not is_crossed(body, due.poses[0], "legs")
    due = PairExchange().take_due(body, standing.pose, body.limits, 0)
    assert due is None or due.least_gains == (LEAST_GAIN, LEAST_GAIN_PLACED)


def test_legs_that_a_start_crossed_are_found(standing: Walking) -> None:
    assert standing.off_m(standing.swapped) > 0.2
    found = recovered(standing, standing.swapped)
    assert found.names[:1] == ("legs",)
    assert standing.off_m(found.pose) < 0.05
    assert "legs" not in recovered(standing, standing.pose).names


def test_arms_in_each_others_place_return_though_their_elbows_are_not(standing: Walking) -> None:
    """One arm is stretched out forwards, the other hangs. Exchanged angles do not reach that."""
    scene, body = standing.scene, standing.scene.body
    true = body.neutral.copy()
    names = ("l_shoulder_y", "l_shoulder_x", "l_elbow", "r_elbow")
    true[[body.index(name) for name in names]] += (-1.4, -0.3, 0.2, 0.2)
    true = np.clip(true, *body.limits)
    seen = {
        name: Observation.from_mask(name, 0, mask.astype(np.uint8), np.zeros(mask.shape, np.uint8))
        for name, mask in body_masks(body, true, list(scene.rig)).items()
    }
    swapped = in_each_others_place(body, true, "arms", body.limits)
    assert not is_crossed(body, swapped, "arms")
    arms = Walking("arms", scene, seen, true, swapped)
    assert arms.off_m(swapped) > 0.3
    assert arms.off_m(recovered(arms, swapped).pose) < 0.05


def test_arms_crossed_on_the_chest_are_in_their_place(standing: Walking) -> None:
    """The wrists are on the other side, the elbows are not."""
    body = standing.scene.body
    folded = postures(body)[-1]
    points = dict(zip(MARKER_NAMES, markers(body, folded), strict=True))
    assert points["LWrist"][1] < points["RWrist"][1] and points["LElbow"][1] > points["RElbow"][1]
    assert not is_crossed(body, folded, "arms")
