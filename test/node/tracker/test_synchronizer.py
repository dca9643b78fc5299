import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.tracker.synchronizer import ABSENT_S, STOPPED_VIEWS, Synchronizer

CAMERAS = ("a", "b", "c", "d")
FRAME_NS = 16_666_667


def feed(sets: Synchronizer[str], *arrivals: tuple[str, int]) -> None:
    for camera, stamp in arrivals:
        sets.add(camera, stamp, f"{camera}{stamp}", now_s=0.0)


def every_camera(*stamps: int) -> list[tuple[str, int]]:
    return [(camera, stamp) for stamp in stamps for camera in CAMERAS]


def test_a_set_is_complete_with_its_last_view_and_handed_out_once() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    feed(sets, ("c", 5), ("a", 5), ("d", 5))
    assert sets.take() is None
    assert sets.add("b", 5, "b5", now_s=1.5)
    matched = sets.take()
    assert matched is not None
    assert matched.stamp_ns == 5 and matched.arrived_s == 1.5 and not matched.restarted
    assert dict(matched.views) == {"a": "a5", "b": "b5", "c": "c5", "d": "d5"}
    assert list(matched.views) == list(CAMERAS)
    assert sets.take() is None and sets.held == 0


def test_the_newest_complete_set_wins_and_the_others_count_as_skipped() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    feed(sets, *every_camera(1, 2, 3))
    matched = sets.take()
    assert matched is not None and matched.stamp_ns == 3
    assert sets.counts.skipped == 2 and sets.counts.complete == 3 and sets.counts.incomplete == 0


def test_cameras_with_different_delays_lose_nothing() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    delays = {"a": 0, "b": 3, "c": 0, "d": 8}
    taken = []
    for tick in range(600 + 8):
        for camera, delay in delays.items():
            if 0 <= tick - delay < 600:
                feed(sets, (camera, (tick - delay) * FRAME_NS))
        if (matched := sets.take()) is not None:
            taken.append(matched.stamp_ns // FRAME_NS)
    assert taken == list(range(600))
    assert sets.counts.incomplete == 0


def test_sets_with_a_lost_view_count_once_each() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    arrivals = [x for x in every_camera(*range(10)) if x not in [("b", 3), ("c", 3), ("a", 7)]]
    feed(sets, *arrivals)
    counts = sets.counts
    assert (counts.complete, counts.incomplete) == (8, 2)


def test_memory_is_bounded_while_a_camera_is_silent_and_it_is_named() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS, depth=8)
    for stamp in range(1000):
        for camera in ("a", "b", "d"):
            sets.add(camera, stamp, "", now_s=stamp / 500)
    assert sets.held == 3 * 8
    assert sets.take() is None
    assert sets.silent(1000 / 500) == ("c",)
    assert sets.counts.incomplete == 1000 - 8
    # It recovers with the first frame that all have.
    feed(sets, *every_camera(1000))
    assert sets.take() is not None


def test_a_camera_that_stops_is_left_out_and_taken_back() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b", "c"))
    taken = []
    for number in range(60):
        stopped = 10 <= number < 40
        for name in ("a", "b") if stopped else ("a", "b", "c"):
            sets.add(name, number, name, now_s=number / 20.0)
        found = sets.take()
        taken.append(None if found is None else "".join(found.views))
    first = taken.index("ab")
    assert taken[:10] == ["abc"] * 10 and 10 + STOPPED_VIEWS - 2 <= first <= 10 + STOPPED_VIEWS
    assert taken[10:first] == [None] * (first - 10)
    assert taken[first:40] == ["ab"] * (40 - first)
    # The set that its return belongs to was complete without it.
    assert taken[40:] == ["ab"] + ["abc"] * 19


def test_a_camera_never_heard_is_left_out_after_a_while() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b", "c"))
    taken = []
    for number in range(200):
        for name in ("a", "b") if number < 150 else ("a", "b", "c"):
            sets.add(name, number, name, now_s=number / 20.0)
        found = sets.take()
        taken.append(None if found is None else "".join(found.views))
        assert sets.left_out(number / 20.0) == (("c",) if 100 <= number < 150 else ())
    first = taken.index("ab")
    assert first == ABSENT_S * 20 and taken[first:151] == ["ab"] * (151 - first)
    assert taken[151:] == ["abc"] * 49


def test_the_last_but_one_camera_is_waited_for() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b"))
    sets.add("b", -1, "b", now_s=0.0)
    for number in range(200):
        sets.add("a", number, "a", now_s=number / 20.0)
        assert sets.take() is None and sets.left_out(number / 20.0) == ()


def test_all_cameras_are_silent_before_and_long_after_their_images() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    assert sets.silent(0.0) == CAMERAS
    feed(sets, *every_camera(1))
    assert sets.silent(0.5) == ()
    assert sets.silent(1.5) == CAMERAS


def stamps_taken(*stamps: int) -> tuple[list[tuple[int, bool]], Synchronizer[str]]:
    """What is handed out, with `restarted`, of sets that come in that order."""
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    taken = []
    for stamp in stamps:
        feed(sets, *every_camera(stamp))
        if (matched := sets.take()) is not None:
            taken.append((matched.stamp_ns, matched.restarted))
    return taken, sets


def test_time_set_back_is_accepted_with_the_third_set_in_a_row() -> None:
    taken, sets = stamps_taken(*range(10, 16), *range(6))
    forward = [(stamp, False) for stamp in range(10, 16)]
    assert taken == [*forward, (2, True), (3, False), (4, False), (5, False)]
    assert (sets.counts.restarts, sets.counts.late, sets.counts.incomplete) == (1, 2, 0)


@pytest.mark.parametrize(
    ("stamps", "late"),
    [
        ([10, 11, 0, 12, 13], 1),
        ([11, 10, 13, 12, 15, 14, 17, 16], 4),
        ([13, 12, 11, 10, 14], 3),
        ([10, 5, 11, 6, 12, 7, 13, 8], 4),
        ([10, 11, 11, 11, 11, 12], 0),
    ],
)
def test_late_sets_are_dropped_and_no_restart(stamps: list[int], late: int) -> None:
    taken, sets = stamps_taken(*stamps)
    assert [stamp for stamp, _ in taken] == sorted(stamp for stamp, _ in taken)
    assert not any(restarted for _, restarted in taken)
    assert (sets.counts.restarts, sets.counts.late) == (0, late)


def test_views_that_repeat_a_stamp_are_dropped_and_counted() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b"))
    feed(sets, ("a", 5), ("a", 5), ("b", 5), ("b", 5), ("a", 5))
    assert sets.take() is not None and sets.take() is None
    assert (sets.counts.complete, sets.counts.duplicates, sets.held) == (1, 3, 0)


def test_a_restart_is_reported_even_if_its_first_sets_were_skipped() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    feed(sets, *every_camera(7))
    sets.take()
    feed(sets, *every_camera(0, 1, 2, 3))
    matched = sets.take()
    assert matched is not None and matched.stamp_ns == 3 and matched.restarted


def test_a_restart_with_views_of_the_old_pass_on_their_way_loses_no_set() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b"))
    order = [("a", 8), ("a", 9), *(("a", stamp) for stamp in range(4)), ("b", 8), ("b", 9)]
    feed(sets, *order, *(("b", stamp) for stamp in range(4)), ("a", 4), ("b", 4))
    assert (sets.counts.complete, sets.counts.late, sets.counts.incomplete) == (5, 2, 0)


def test_offsets_name_the_camera_whose_stamps_differ() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    assert sets.offsets_ns() == {}
    for number in range(6):
        for camera, offset in (("a", 0), ("b", 0), ("c", 2_000_000), ("d", 0)):
            feed(sets, (camera, number * FRAME_NS + offset))
    assert sets.take() is None
    assert sets.offsets_ns() == {"a": 0, "b": 0, "c": 2_000_000, "d": 0}


def test_a_stamp_far_in_the_future_does_not_block() -> None:
    sets: Synchronizer[str] = Synchronizer(CAMERAS)
    feed(sets, *every_camera(1), ("a", 10**18), *every_camera(2, 3))
    assert sets.counts.complete == 3
    feed(sets, *every_camera(10**18), *every_camera(4, 5, 6))
    matched = sets.take()
    assert matched is not None and matched.stamp_ns == 6


def test_equal_stamps_need_to_be_equal_unless_a_tolerance_is_given() -> None:
    exact: Synchronizer[str] = Synchronizer(("a", "b"))
    feed(exact, ("a", 1000), ("b", 1001))
    assert exact.take() is None
    loose: Synchronizer[str] = Synchronizer(("a", "b"), tolerance_ns=1)
    feed(loose, ("b", 1001), ("a", 1000))
    matched = loose.take()
    assert matched is not None and matched.stamp_ns == 1000


def test_a_tolerance_picks_the_nearest_and_bounds_the_whole_set() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b", "c"), tolerance_ns=4)
    feed(sets, ("a", 100), ("a", 103), ("b", 107))
    # 103 and 107 lie near, but 107 and 99 do not.
    feed(sets, ("c", 99))
    assert sets.take() is None
    feed(sets, ("c", 104))
    matched = sets.take()
    assert matched is not None and list(matched.views.values()) == ["a103", "b107", "c104"]


def test_counting_anew_forgets_what_waits_but_not_what_is_on_its_way() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b"))
    feed(sets, ("a", 1), ("b", 1), ("a", 2), ("b", 2), ("a", 3))
    assert sets.start_counting().complete == 2
    assert sets.take() is None and sets.counts.complete == 0
    feed(sets, ("b", 3))
    assert sets.take() is not None
    for counts in sets.camera_counts.values():
        assert counts.received == counts.matched == 1


def test_take_wakes_up_for_a_set_of_another_thread() -> None:
    sets: Synchronizer[str] = Synchronizer(("a",))
    timer = threading.Timer(0.05, feed, (sets, ("a", 1)))
    timer.start()
    assert sets.take(timeout_s=120.0) is not None
    timer.join()


@pytest.mark.parametrize("cameras", [(), ("a", "a")])
def test_impossible_cameras(cameras: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError, match="cameras"):
        Synchronizer(cameras)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 6)), max_size=120),
    st.integers(0, 2),
    st.integers(1, 5),
)
def test_whatever_arrives_sets_are_sound_and_memory_bounded(
    arrivals: list[tuple[str, int]], tolerance: int, depth: int
) -> None:
    sets: Synchronizer[tuple[str, int]] = Synchronizer("abc", tolerance_ns=tolerance, depth=depth)
    for camera, stamp in arrivals:
        sets.add(camera, stamp, (camera, stamp), now_s=0.0)
        assert sets.held <= 3 * depth + 3
        if stamp % 2 and (matched := sets.take()) is not None:
            stamps = [seen for _, seen in matched.views.values()]
            assert [name for name, _ in matched.views.values()] == list("abc")
            assert max(stamps) - min(stamps) <= tolerance and matched.stamp_ns == min(stamps)


@settings(max_examples=100, deadline=None)
@given(
    st.dictionaries(st.sampled_from("abcd"), st.integers(0, 6), min_size=4),
    st.sets(st.tuples(st.sampled_from("abcd"), st.integers(0, 39)), max_size=30),
)
def test_every_set_is_either_complete_or_incomplete(
    delays: dict[str, int], lost: set[tuple[str, int]]
) -> None:
    """With in-order delivery, losses and delays: complete + incomplete + held = offered."""
    sets: Synchronizer[int] = Synchronizer(CAMERAS)
    for tick in range(40 + 8):
        for camera in CAMERAS:
            frame = tick - delays[camera]
            if 0 <= frame < 40 and (camera, frame) not in lost:
                sets.add(camera, frame, frame, now_s=0.0)
    # A last complete set settles all that came before it.
    for camera in CAMERAS:
        sets.add(camera, 40, 40, now_s=0.0)
    gone = sum(all((camera, frame) in lost for camera in CAMERAS) for frame in range(40))
    broken = {frame for _, frame in lost}
    assert sets.counts.complete == 41 - len(broken)
    assert sets.counts.incomplete == len(broken) - gone


def test_a_set_knows_how_many_it_replaced_and_the_time_since_the_one_before() -> None:
    sets: Synchronizer[int] = Synchronizer(("a", "b"))

    def send(stamp_ns: int, now_s: float) -> None:
        for camera in sets.cameras:
            sets.add(camera, stamp_ns, stamp_ns, now_s=now_s)

    for number in range(1, 5):
        send(number, 0.1 * number)
    taken = sets.take()
    assert taken is not None and (taken.stamp_ns, taken.replaced) == (4, 3)
    assert taken.period_s == pytest.approx(0.1)
    send(5, 0.7)
    taken = sets.take()
    assert taken is not None and taken.replaced == 0 and taken.period_s == pytest.approx(0.3)
    assert sets.late_ns is None
    send(3, 0.8)
    assert sets.take() is None and sets.late_ns == 3


def test_every_view_is_counted_for_its_camera() -> None:
    sets: Synchronizer[str] = Synchronizer(("a", "b"), tolerance_ns=3)
    feed(sets, ("a", 10), ("b", 12), ("a", 20), ("a", 30), ("b", 32), ("b", 32), ("a", 29))
    feed(sets, ("b", 29), ("a", 40))
    counts = sets.camera_counts
    assert (counts["a"].received, counts["b"].received) == (5, 4)
    assert (counts["a"].matched, counts["b"].matched) == (2, 2)
    assert (counts["a"].late, counts["b"].late) == (1, 1)
    assert (counts["a"].dropped, counts["b"].dropped) == (1, 1)
    assert counts["b"].offset_ms == pytest.approx(1e-6)
    sets.start_counting()
    # One view of camera a waits for its set.
    assert (sets.camera_counts["a"].received, sets.camera_counts["b"].received) == (1, 0)
