"""A camera that disagrees with the others."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.camera import CameraRig
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.cameras.check import (
    EVERY_NS,
    FEW_CHECKS,
    MANY_CHECKS,
    REMEMBERED,
    CameraCheck,
    Shift,
    describe,
)

CONFIG = TrackerConfig(threads=1)
FRAME_NS = 200_000_000


@pytest.fixture
def checked(scene, tracked) -> Callable[..., CameraCheck]:
    """Checks a rig's cameras over some frames."""

    def made(rig: CameraRig, frames: int = 8) -> CameraCheck:
        check = CameraCheck(rig, CONFIG)
        for index in range(frames):
            check.add(tracked(index), scene.body)
        return check

    return made


def test_cameras_that_agree_are_not_named(scene, checked) -> None:
    check = checked(scene.rig)
    shifts = check.shifts()
    assert not check.suspects
    assert tuple(shifts) == scene.rig.names
    assert all(shift.length_m < 0.01 for shift in shifts.values())
    assert describe(shifts) == []


def test_the_camera_that_is_off_is_named(scene, checked) -> None:
    wrong = scene.rig.shifted({"cam03": (-5.0, 3.0)})
    check = checked(wrong)
    shifts = check.shifts()
    assert check.suspects == {"cam03"}
    assert [name for name, shift in shifts.items() if shift.disagrees] == ["cam03"]
    np.testing.assert_allclose(shifts["cam03"].px, (5.0, -3.0), atol=1.0)
    (line,) = describe(shifts)
    assert line.startswith("cam03: silhouettes (+")


def test_other_settings_are_used_from_the_next_frame_on(scene, tracked, monkeypatch) -> None:
    used: list[TrackerConfig] = []

    def noted(contours, pose, config):
        used.append(config)
        return pose

    monkeypatch.setattr("markerless_tracker.tracking.cameras.check._refined", noted)
    check = CameraCheck(scene.rig, CONFIG)
    check.add(tracked(0), scene.body)
    other = TrackerConfig(threads=1, min_improvement=0.5)
    check.configure(other)
    check.add(tracked(1), scene.body)
    assert used[0] is CONFIG and used[-1] is other


def test_few_checks_and_lost_frames_say_nothing(scene) -> None:
    assert not Shift((9.0, 9.0), 0.1, 2).disagrees
    check = CameraCheck(scene.rig, CONFIG)
    check.add(TrackResult(0, TrackState.LOST, None, None, float("nan"), {}, 0), scene.body)
    assert check.shifts() == {}


@pytest.mark.parametrize("name", ["cam01", "cam02", "cam03", "cam04"])
@pytest.mark.parametrize("shift_px", [(5.0, 0.0), (0.0, 5.0), (-4.0, 4.0)])
def test_the_camera_across_is_not_blamed(scene, name, shift_px, checked) -> None:
    """Opposite cameras show about the same shift sideways, in opposite directions."""
    check = checked(scene.rig.shifted({name: shift_px}), FEW_CHECKS + 1)
    assert check.suspects == {name}


def test_of_three_cameras_none_is_suspected(scene, checked) -> None:
    three = scene.rig.shifted({"cam03": (-5.0, 3.0)}).selected(["cam01", "cam02", "cam03"])
    check = checked(three)
    assert not check.suspects and check.shifts()["cam03"].disagrees


def test_a_frame_compares_one_camera_and_checks_become_rarer(scene, tracked) -> None:
    frame_ns = 16_666_667
    check = CameraCheck(scene.rig, CONFIG)
    standing = tracked(0)
    counts = [0]
    for index in range(600):
        check.add(replace(standing, stamp_ns=index * frame_ns), scene.body)
        counts.append(sum(shift.checks for shift in check.shifts().values()))
    assert max(np.diff(counts)) == 1
    cameras = len(scene.rig)
    few = 1 + (FEW_CHECKS * EVERY_NS[0]) // frame_ns
    assert counts[few] == pytest.approx(cameras * FEW_CHECKS, abs=2)
    many = few + ((MANY_CHECKS - FEW_CHECKS) * EVERY_NS[1]) // frame_ns
    assert counts[many] == pytest.approx(cameras * MANY_CHECKS, abs=2)
    later = (600 - many) * frame_ns / EVERY_NS[2]
    assert counts[-1] - counts[many] == pytest.approx(cameras * later, abs=2)


def test_a_late_tracker_compares_one_camera_a_frame_and_seldom(scene, tracked) -> None:
    """First each camera `FEW_CHECKS` times, as ever, since that may find a wrong one."""
    check = CameraCheck(scene.rig, CONFIG)
    standing, cameras = tracked(0), len(scene.rig)
    counts = []
    for index in range(60):
        check.add(replace(standing, stamp_ns=index * EVERY_NS[0]), scene.body, late=True)
        counts.append(sum(shift.checks for shift in check.shifts().values()))
    few = FEW_CHECKS * cameras
    assert counts[:few] == [*range(1, few + 1)]
    later = (60 - few) * EVERY_NS[0] * cameras / EVERY_NS[2]
    assert counts[-1] - few == pytest.approx(later, abs=2)


@pytest.mark.parametrize(
    ("frame_ns", "searched", "compared"),
    [
        # Every 10 ms: the cameras are due at 0, 20 and 40 ms.
        (10_000_000, "-----", [1, 1, 2, 2, 3]),
        (10_000_000, "-++-+", [1, 1, 1, 2, 2]),
        # The second one waits for `DENSE_NS` at most; then all that are due are compared.
        (10_000_000, "-++++++++", [1, 1, 1, 1, 1, 1, 4, 4, 4]),
        # Where frames are far apart, none waits.
        (50_000_000, "-+++", [1, 3, 6, 8]),
    ],
)
def test_frames_that_took_long_put_a_comparison_off(
    frame_ns, searched, compared, scene, tracked
) -> None:
    check = CameraCheck(scene.rig, CONFIG)
    standing, counts = tracked(0), []
    for index, long in enumerate(searched):
        frame = replace(standing, stamp_ns=index * frame_ns)
        check.add(frame, scene.body, searched=long == "+")
        counts.append(sum(shift.checks for shift in check.shifts().values()))
    assert counts == compared


def test_a_camera_that_is_touched_during_a_long_run_is_found(scene, tracked) -> None:
    standing = tracked(0)
    check = CameraCheck(scene.rig.shifted({"cam03": (-5.0, 3.0)}), CONFIG)
    for name in check._found:
        check._found[name].extend([(0.0, 0.0, 200.0)] * 1000)
    check._checks = 1000
    for index in range(REMEMBERED // 2 + 4 + MANY_CHECKS):
        check.add(replace(standing, stamp_ns=4 * index * EVERY_NS[2]), scene.body)
    assert check.suspects == {"cam03"}


def test_it_is_told_when_all_were_compared(scene, tracked) -> None:
    check = CameraCheck(scene.rig, CONFIG)
    standing = tracked(0)
    step_ns = EVERY_NS[0] // len(scene.rig)
    told = [check.add(replace(standing, stamp_ns=i * step_ns), scene.body) for i in range(9)]
    assert told == [False, False, False, True] * 2 + [False]


def test_checks_go_on_after_time_was_set_back(scene, tracked) -> None:
    check = CameraCheck(scene.rig, CONFIG)
    standing = tracked(0)
    check.add(replace(standing, stamp_ns=10**15), scene.body)
    for index in range(3):
        check.add(replace(standing, stamp_ns=index * FRAME_NS), scene.body)
    assert len(check.shifts()) == len(scene.rig)


def test_a_second_camera_is_left_out_after_the_worst_one(scene) -> None:
    check = CameraCheck(cameras_like(scene.rig, 6), CONFIG)
    bad = {"cam01": (20.0, 0.0, 200.0), "cam02": (0.0, 16.0, 200.0), "cam03": (0.0, 30.0, 200.0)}
    for left_out in (set(), {"cam01"}, {"cam01", "cam02"}):
        assert check.suspects == left_out
        for name in check._found:
            check._found[name] = [bad.get(name, (0.0, 0.0, 200.0))] * 8
        # The third disagrees most, and explains least.
        gains = {"cam01": 3.0, "cam02": 2.0, "cam03": 0.5}
        check._gains.extend([{n: gain for n, gain in gains.items() if n not in left_out}] * 3)
        check._suspect()


@pytest.mark.parametrize(
    ("gains", "shares"),
    [
        ((2.0, 1.0), {"cam01": 1.0}),
        ((2.0, 2.0), {"cam01": 0.5, "cam02": 0.5}),
        ((1.9, 2.0), {"cam01": 0.25, "cam02": 0.75}),
        ((-1.0, -2.0), {}),
    ],
)
def test_while_either_of_two_may_be_wrong_each_has_a_share(scene, gains, shares) -> None:
    check = CameraCheck(scene.rig, CONFIG)
    for name in ("cam01", "cam02"):
        check._found[name] = [(20.0, 0.0, 200.0)] * 4
    check._gains.extend([dict(zip(("cam01", "cam02"), gains, strict=True))] * FEW_CHECKS)
    check._suspect()
    assert check.shares == pytest.approx(shares)
    assert check.suspects == {name for name, share in shares.items() if share == 1.0}
    check._gains.extend([*check._gains] * (MANY_CHECKS // FEW_CHECKS))
    check._suspect()
    assert len(check.suspects) == (1 if shares else 0)


def test_a_doubt_at_the_limit_does_not_come_and_go(scene) -> None:
    check = CameraCheck(scene.rig, CONFIG)
    check._gains.extend([{"cam01": 1.0, "cam02": 1.0}] * FEW_CHECKS)
    for shift_px, doubted in ((5.9, False), (6.1, True), (5.9, True), (3.9, False)):
        check._found["cam01"] = check._found["cam02"] = [(shift_px, 0.0, 200.0)] * 4
        check._suspect()
        assert bool(check.shares) == doubted


def test_gains_count_in_frames_in_which_all_doubted_cameras_have_one(scene) -> None:
    """A gain that was found with a part of the shift is smaller."""
    check = CameraCheck(scene.rig, CONFIG)
    check._found["cam01"] = check._found["cam03"] = [(20.0, 0.0, 200.0)] * 4
    check._gains.extend([{"cam01": 9.0}] * FEW_CHECKS)
    check._suspect()
    assert not check.shares
    check._gains.extend([{"cam01": 1.0, "cam03": 2.0}] * FEW_CHECKS)
    check._suspect()
    assert check.suspects == {"cam03"}


def test_all_is_forgotten(scene, checked) -> None:
    check = checked(scene.rig.shifted({"cam03": (-5.0, 3.0)}))
    check.reset()
    assert not check.suspects and check.shifts() == {}


def cameras_like(rig: CameraRig, count: int) -> CameraRig:
    """A rig of so many cameras, all where the first one is."""
    return CameraRig(tuple(replace(rig["cam01"], name=f"cam{i + 1:02d}") for i in range(count)))
