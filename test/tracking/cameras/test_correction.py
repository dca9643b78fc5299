"""A camera whose image is shifted back while the person is tracked."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.records import Observation
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.cameras.check import FEW_CHECKS
from markerless_tracker.tracking.cameras.correction import CameraCorrection

CONFIG = TrackerConfig(threads=1)
OFF_PX = (-5.0, 3.0)


def test_the_image_is_shifted_back_and_the_camera_named(scene, tracked) -> None:
    wrong = scene.rig.shifted({"cam03": OFF_PX})
    correction = CameraCorrection(wrong, CONFIG)
    notes = [correction.add(tracked(index), scene.body) for index in range(FEW_CHECKS + 1)]
    assert notes[:-1] == [()] * FEW_CHECKS
    (line,) = notes[-1]
    assert line.startswith("cam03: silhouettes (+") and "is shifted by" in line
    for name in scene.rig.names:
        true = scene.rig[name].matrix
        np.testing.assert_allclose(correction.rig[name].matrix, true, atol=1.0)
    assert [n for n, shift in correction.shifts().items() if shift.corrected] == ["cam03"]
    correction.reset()
    assert correction.rig is wrong


def test_a_correction_that_stays_is_not_reported_again(scene, tracked) -> None:
    correction = CameraCorrection(scene.rig.shifted({"cam03": OFF_PX}), CONFIG)
    for index in range(FEW_CHECKS + 1):
        correction.add(tracked(index), scene.body)
    corrected = correction.rig
    assert correction.add(tracked(FEW_CHECKS + 1), scene.body) == ()
    assert correction.rig is corrected


def test_a_correction_that_was_imprecise_is_replaced(scene, tracked) -> None:
    correction = CameraCorrection(scene.rig.shifted({"cam03": OFF_PX}), CONFIG)
    for index in range(FEW_CHECKS + 1):
        correction.add(tracked(index), scene.body)
    before = correction.rig["cam03"].matrix[0, 2]
    scale = correction._check._found["cam03"][0][2]
    # 20 mm more to the right in all checks, so in their median.
    correction._check._found["cam03"] = [
        (u + 0.02 * scale, v, s) for u, v, s in correction._check._found["cam03"]
    ]
    (line,) = correction.add(tracked(FEW_CHECKS + 1), scene.body)
    assert line.startswith("cam03")
    assert correction.rig["cam03"].matrix[0, 2] == pytest.approx(before + 0.02 * scale, abs=0.5)


def test_either_of_two_cameras_is_shifted_in_part_until_one_is_the_wrong_one(
    scene, monkeypatch, tracked
) -> None:
    correction = CameraCorrection(scene.rig, CONFIG)
    check = correction._check
    for name in scene.rig.names:
        check._found[name] = [(20.0 if name in ("cam01", "cam03") else 0.0, 0.0, 200.0)] * 4
    check._gains.extend([{"cam01": 2.0, "cam03": 1.9}] * FEW_CHECKS)
    check._suspect()
    monkeypatch.setattr(check, "add", lambda result, body, **_: True)
    assert len(correction.add(tracked(0), scene.body)) == 2
    moved = {c.name: c.matrix[0, 2] - scene.rig[c.name].matrix[0, 2] for c in correction.rig}
    assert moved == pytest.approx({"cam01": 15.0, "cam02": 0.0, "cam03": 5.0, "cam04": 0.0})
    check._gains.extend([{"cam01": 2.0, "cam03": 1.0}] * FEW_CHECKS)
    check._suspect()
    again, shifted = correction.add(tracked(0), scene.body)
    assert again.startswith("cam03") and shifted.startswith("cam01")
    assert correction.rig["cam03"] is scene.rig["cam03"]
    assert correction.rig["cam01"].matrix[0, 2] == scene.rig["cam01"].matrix[0, 2] + 20.0


def test_without_corrections_the_shift_is_known_only(scene, tracked) -> None:
    wrong = scene.rig.shifted({"cam03": OFF_PX})
    correction = CameraCorrection(wrong, replace(CONFIG, correct_cameras=False))
    for index in range(FEW_CHECKS + 1):
        assert correction.add(tracked(index), scene.body) == ()
    assert correction.rig is wrong
    shift = correction.shifts()["cam03"]
    assert shift.disagrees and not shift.corrected


def test_the_paper_preset_corrects_nothing() -> None:
    assert TrackerConfig().correct_cameras
    assert not TrackerConfig.from_mapping({"preset": "paper"}).correct_cameras


def test_a_tracker_corrects_and_is_reset(scene) -> None:
    """The whole path: poses come nearer to the truth, and later evidence uses the new camera."""
    wrong = scene.rig.shifted({"cam03": (-7.0, 5.0)})
    _, _, pose = scene.frame(0)
    errors = {}
    for corrects in (False, True):
        config = replace(CONFIG, correct_cameras=corrects, evaluations=250)
        tracker = Tracker(wrong, scene.body, config, start_pose=pose, shape_known=True)
        warnings: list[str] = []
        for index in range(12):
            _, masks, _ = scene.frame(index)
            seen = {
                name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
                for name, mask in masks.items()
            }
            found = tracker.step(seen, index * 100_000_000)
            warnings += [line for line in found.warnings if "is shifted by" in line]
        errors[corrects] = np.linalg.norm(found.markers_m - scene.markers(11), axis=1).mean()
        assert (tracker.rig is wrong) == (not corrects) == (not warnings)
    assert tracker.shifts["cam03"].disagrees
    assert tracker._outlook(0).rig is tracker.evidence.rig is tracker.rig
    assert tracker._searcher.cameras["cam03"] is tracker.rig["cam03"]
    assert errors[True] < 0.7 * errors[False]
    tracker.reset()
    assert tracker.rig is wrong and tracker.shifts == {}
