"""Which limbs are lost; finding those outside the silhouettes, and those wrong inside them."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.round_robin import PER_LIMB_NS
from markerless_tracker.tracking.limbs.schedule import FIRST_WAIT_NS, VERY_DENSE_NS
from markerless_tracker.tracking.limbs.unexplained import Unexplained
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.search import Searcher

TRACKING, LOST = TrackState.TRACKING, TrackState.LOST
ARM = [MARKER_NAMES.index(name) for name in ("LElbow", "LWrist")]
SIZE_PX = (328, 245)
APART_NS = 100_000_000
"""Time between frames so far apart that all limbs are searched."""


def observed(masks):
    return {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }


def searcher_of(scene, threads=1, **changes):
    config = TrackerConfig(threads=threads, **changes)
    body = scene.body
    return Searcher(scene.rig, body, config, limits=body.limits, threads=threads)


def contours_of(searcher, seen, pose):
    return searcher.frame(seen, 0, pose).contours


def none(limb):
    """No draws of a limb."""
    return np.empty((0, len(limb)))


def recover(watch, searcher, contours, seen, stamp_ns, pose, *, single=False):
    """What `recover` finds: the pose and the names."""
    found = watch.recover(searcher, contours, Seen(stamp_ns, seen, seen, seen), pose, single=single)
    return found.pose, found.names


def gaps(body, pose, true):
    return np.linalg.norm(markers(body, pose) - markers(body, true), axis=1)


@pytest.fixture(scope="module")
def standing():
    """A scene, its silhouettes, the true pose and one whose left arm is raised beside them."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=SIZE_PX, seed=3)
    _, masks, pose = scene.frame(0)
    raised = pose.copy()
    raised[scene.body.index("l_shoulder_y")] += 2.0
    return scene, observed(masks), pose, raised


@pytest.fixture(scope="module")
def balancing():
    """The same with arms held out to the sides, and a pose whose left arm lies on the trunk."""
    scene = SyntheticScene(body="person31", motion="balance", size_px=SIZE_PX, seed=3)
    _, masks, pose = scene.frame(0)
    hidden = pose.copy()
    arm = scene.body.subspaces["l_arm"]
    hidden[arm] = scene.body.neutral[arm]
    return scene, observed(masks), pose, hidden


def test_states_name_the_limb_that_is_off(standing) -> None:
    scene, seen, pose, raised = standing
    watch = LimbWatch(scene.rig)
    particle_sd_ratio = np.full(scene.body.size, 0.25)
    for at, expected in ((pose, TRACKING), (raised, LOST), (pose, TRACKING)):
        states = watch.assess(scene.body, at, seen, particle_sd_ratio)
        assert states.pop("l_arm").state is expected
        assert {limb.state for limb in states.values()} == {TRACKING}
        assert watch.lost == (("l_arm",) if expected is LOST else ())
        assert {limb.particle_sd_ratio for limb in states.values()} == {0.25}


def test_a_lost_arm_is_found_alone(standing, monkeypatch) -> None:
    scene, seen, pose, raised = standing
    monkeypatch.setattr("markerless_tracker.tracking.limbs.exchange.LEAST_M", 9.0)
    searcher = searcher_of(scene)
    watch = LimbWatch(scene.rig)
    watch.assess(scene.body, raised, seen, np.full(scene.body.size, np.nan))
    found, names = recover(watch, searcher, contours_of(searcher, seen, raised), seen, 0, raised)
    assert names == ("l_arm",)
    assert gaps(scene.body, raised, pose)[ARM].min() > 0.3
    assert gaps(scene.body, found, pose)[ARM].max() < 0.13


def test_a_wrong_arm_inside_the_silhouettes_is_found_in_rotation(balancing) -> None:
    scene, seen, pose, hidden = balancing
    body = scene.body
    assert gaps(body, hidden, pose)[ARM].max() > 0.3
    searcher = searcher_of(scene)
    watch = LimbWatch(scene.rig)
    states = watch.assess(body, hidden, seen, np.full(body.size, np.nan))
    assert states["l_arm"].state is TRACKING
    at, taken = hidden, []
    for stamp_ns in range(0, 8 * APART_NS, APART_NS):
        at, names = recover(watch, searcher, contours_of(searcher, seen, at), seen, stamp_ns, at)
        taken += names
    assert taken[0] == "l_arm"
    assert gaps(body, at, pose)[ARM].max() < 0.08


def test_limbs_in_their_place_are_left_alone(balancing) -> None:
    scene, seen, pose, _ = balancing
    searcher = searcher_of(scene)
    watch = LimbWatch(scene.rig)
    for stamp_ns in range(0, 4 * APART_NS, APART_NS):
        contours = contours_of(searcher, seen, pose)
        assert recover(watch, searcher, contours, seen, stamp_ns, pose) == (pose, ())


def test_a_body_that_names_no_limbs_has_none_to_look_for(standing) -> None:
    scene, seen, pose, _ = standing
    body = replace(scene.body, hierarchies={"twelve": scene.body.hierarchies["twelve"]})
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    watch = LimbWatch(scene.rig)
    assert watch.assess(body, pose, seen, np.zeros(body.size)) == {}
    contours = contours_of(searcher, seen, pose)
    assert recover(watch, searcher, contours, seen, 0, pose) == (pose, ())


def test_rotation_is_by_time_and_depends_on_nothing_else(balancing, monkeypatch) -> None:
    scene, seen, _, hidden = balancing
    explained = "markerless_tracker.tracking.limbs.watch.find_unexplained"
    monkeypatch.setattr(explained, lambda *_: Unexplained({}, {}))

    def found(stamps, threads=1):
        searcher = searcher_of(scene, threads)
        watch = LimbWatch(scene.rig)
        contours = contours_of(searcher, seen, hidden)
        return [recover(watch, searcher, contours, seen, stamp, hidden)[1] for stamp in stamps]

    # The arm is the first in rotation, and no limb comes again so soon.
    assert found([0, 1, PER_LIMB_NS // 2]) == [("l_arm",), (), ()]
    assert found([0, PER_LIMB_NS], threads=2) == found([0, PER_LIMB_NS])
    assert scene.body.limbs[0] == "l_arm"


def test_a_limb_near_unexplained_silhouette_is_searched_in_every_frame(balancing) -> None:
    scene, seen, _, hidden = balancing
    searcher = searcher_of(scene)
    watch = LimbWatch(scene.rig)
    contours = contours_of(searcher, seen, hidden)
    for stamp_ns in (0, 1, PER_LIMB_NS):
        names = recover(watch, searcher, contours, seen, stamp_ns, hidden)[1]
        assert "l_arm" in names


def test_limbs_that_may_lie_in_unexplained_silhouette_take_dues(balancing, monkeypatch) -> None:
    """The likeliest is searched in every frame, and one of the others."""
    scene, seen, pose, _ = balancing
    limbs = ("r_leg", "l_leg", "r_arm", "l_arm")
    for name, value in (
        ("watch.find_unexplained", lambda *_: Unexplained(dict.fromkeys(limbs, 0.01), {})),
        (
            "search.drawn_limbs",
            lambda _f, _r, _p, limb, *_, **__: searched.append(limb.tobytes()) or none(limb),
        ),
    ):
        monkeypatch.setattr(f"markerless_tracker.tracking.limbs.{name}", value)
    monkeypatch.setattr("markerless_tracker.tracking.limbs.schedule.FIRST_WAIT_NS", 0)
    searcher, watch, searched = searcher_of(scene), LimbWatch(scene.rig), []
    contours = contours_of(searcher, seen, pose)
    recover(watch, searcher, contours, seen, 0, pose)
    searched.clear()
    for number in (1, 2, 3):
        recover(watch, searcher, contours, seen, number * VERY_DENSE_NS, pose)
    name_of = {scene.body.subspaces[name].tobytes(): name for name in limbs}
    names = [name_of[limb] for limb in searched]
    assert names[::2] == ["r_leg"] * 3 and set(names[1::2]) == {"l_leg", "r_arm", "l_arm"}


def test_where_there_is_time_for_one_thing_limbs_and_the_whole_body_take_dues(
    standing, monkeypatch
) -> None:
    scene, seen, pose, _ = standing
    limbs = ("r_leg", "l_leg", "r_arm", "l_arm")
    done: list[str] = []
    package = "markerless_tracker.tracking.limbs"

    def faces(*_):
        done.append("facing")

    def drawn(_f, _r, _p, limb, *_, **__):
        done.append(next(n for n in limbs if np.array_equal(scene.body.subspaces[n], limb)))
        return none(limb)

    monkeypatch.setattr(
        f"{package}.watch.find_unexplained", lambda *_: Unexplained(dict.fromkeys(limbs, 0.01), {})
    )
    monkeypatch.setattr(f"{package}.search.drawn_limbs", drawn)
    monkeypatch.setattr(f"{package}.schedule.FIRST_WAIT_NS", 0)
    monkeypatch.setattr(f"{package}.facing.FacingWatch.compare", faces)
    monkeypatch.setattr(f"{package}.exchange.LEAST_M", 9.0)
    searcher, watch = searcher_of(scene), LimbWatch(scene.rig)
    contours = contours_of(searcher, seen, pose)
    for number in range(24):
        before = len(done)
        recover(watch, searcher, contours, seen, number * APART_NS, pose, single=True)
        assert len(done) == before + 1
    assert set(done) == {*limbs, "facing"}


@pytest.mark.parametrize("late", [False, True])
def test_draws_near_a_limb_are_left_out_unless_sets_are_late(balancing, monkeypatch, late) -> None:
    scene, seen, pose, _ = balancing
    thorough: list[bool] = []

    def drawn(_f, _r, _p, limb, *_, **options):
        thorough.append(options["thorough"])
        return none(limb)

    package = "markerless_tracker.tracking.limbs"
    monkeypatch.setattr(
        f"{package}.watch.find_unexplained", lambda *_: Unexplained({"r_leg": 0.01}, {})
    )
    monkeypatch.setattr(f"{package}.search.drawn_limbs", drawn)
    searcher, watch = searcher_of(scene), LimbWatch(scene.rig)
    contours = contours_of(searcher, seen, pose)
    watch.recover(searcher, contours, Seen(0, seen, seen, seen), pose, late=late)
    assert set(thorough) == {not late}


def test_a_limb_that_is_not_found_waits_longer_after_each_search(balancing, monkeypatch) -> None:
    scene, seen, pose, _ = balancing
    searched: list[int] = []
    for name, value in (
        ("watch.find_unexplained", lambda *_: Unexplained({"r_leg": 0.01}, {})),
        (
            "search.drawn_limbs",
            lambda _f, _r, _p, limb, *_, **__: searched.append(now) or none(limb),
        ),
        ("round_robin.PER_LIMB_NS", 10**12),
    ):
        monkeypatch.setattr(f"markerless_tracker.tracking.limbs.{name}", value)
    searcher, watch = searcher_of(scene), LimbWatch(scene.rig)
    contours = contours_of(searcher, seen, pose)
    for now in range(0, 20 * FIRST_WAIT_NS, FIRST_WAIT_NS // 2):
        recover(watch, searcher, contours, seen, now, pose)
    # Once more at first: the next limb in rotation.
    frames = sorted({at // FIRST_WAIT_NS for at in searched})
    assert frames == [0, 1, 3, 7, 15]


def test_a_limb_does_not_wait_where_more_silhouette_is_unexplained_than_before(
    balancing, monkeypatch
) -> None:
    """An arm that was searched in vain while it was hidden comes into view."""
    scene, seen, pose, _ = balancing
    areas: dict[str, float] = {"l_leg": 0.01}
    searched: list[tuple[int, bytes]] = []
    for name, value in (
        ("watch.find_unexplained", lambda *_: Unexplained(dict(areas), {})),
        (
            "search.drawn_limbs",
            lambda _f, _r, _p, limb, *_, **__: searched.append((now, limb)) or none(limb),
        ),
    ):
        monkeypatch.setattr(f"markerless_tracker.tracking.limbs.{name}", value)
    arm = scene.body.subspaces["l_arm"].tobytes()
    searcher, watch = searcher_of(scene), LimbWatch(scene.rig)
    contours = contours_of(searcher, seen, pose)
    for now in range(0, 20 * APART_NS, APART_NS):
        recover(watch, searcher, contours, seen, now, pose)
    assert scene.body.limbs[0] == "l_arm"
    last = max(at for at, limb in searched if limb.tobytes() == arm)
    for more_m2 in (0.011, 0.023):
        searched.clear()
        areas["l_arm"] = more_m2
        now = last = last + 2
        recover(watch, searcher, contours, seen, now, pose)
        assert arm in [limb.tobytes() for _, limb in searched]
    searched.clear()
    areas["l_arm"] = 0.024
    now = last + 2
    recover(watch, searcher, contours, seen, now, pose)
    assert arm not in [limb.tobytes() for _, limb in searched]


def test_the_same_search_gives_the_same_bytes_with_any_number_of_threads(standing) -> None:
    scene, seen, _, raised = standing
    poses = []
    for threads in (1, 2):
        searcher = searcher_of(scene, threads)
        contours = contours_of(searcher, seen, raised)
        found, _ = recover(LimbWatch(scene.rig), searcher, contours, seen, 0, raised)
        poses.append(found.tobytes())
    assert poses[0] == poses[1]


@pytest.mark.parametrize("limb", ["l_arm", "r_arm"])
def test_a_tracker_that_starts_with_a_wrong_arm_finds_it_in_a_quarter_of_a_second(limb) -> None:
    scene = SyntheticScene(body="person31", motion="balance", size_px=SIZE_PX, seed=3)
    body = scene.body
    arm = [MARKER_NAMES.index(f"{limb[0].upper()}{name}") for name in ("Elbow", "Wrist")]
    start = scene.frame(0)[2].copy()
    start[body.subspaces[limb]] = body.neutral[body.subspaces[limb]]
    tracker = Tracker(scene.rig, body, TrackerConfig(threads=1), start_pose=start, shape_known=True)
    found = []
    for frame in range(16):
        _, masks, true = scene.frame(frame)
        result = tracker.step(observed(masks), round(frame * 1e9 / 60))
        found += [warning for warning in result.warnings if limb in warning]
        assert set(result.limbs) == set(body.limbs)
    assert f"{limb}: found elsewhere" in found
    assert gaps(body, result.pose, true)[arm].max() < 0.08
    assert result.limbs[limb].state is TRACKING


def test_a_limb_that_gets_lost_is_told_once_also_without_refinement(standing) -> None:
    """The swarm is too narrow to find it."""
    scene, seen, _, raised = standing
    config = TrackerConfig.from_mapping(
        {"threads": 1, "refinement": "none", "sigma.scale": 0.01, "evaluations": 100}
    )
    tracker = Tracker(scene.rig, scene.body, config, start_pose=raised, shape_known=True)
    first, second = (tracker.step(seen, round(k * 1e9 / 60)) for k in range(2))
    assert first.limbs["l_arm"].state is second.limbs["l_arm"].state is LOST
    assert first.limbs["l_arm"].particle_sd_ratio > 0.0
    assert "l_arm: lost" in first.warnings and "l_arm: lost" not in second.warnings
