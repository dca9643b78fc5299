"""Cameras at fault, found by silhouettes alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.camera import CameraRig
from markerless_tracker.records import Observation
from markerless_tracker.results.verdict.agreement import find_fault, largest_hull
from markerless_tracker.synthesis import SyntheticScene


@pytest.fixture(scope="module")
def views(scene: SyntheticScene, masks: Any) -> list[dict[str, Observation]]:
    return [
        {
            name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in masks[index].items()
        }
        for index in (0, 9)
    ]


def test_the_right_cameras_have_no_fault(scene: SyntheticScene, views: Any) -> None:
    assert find_fault(scene.rig, views) is None
    assert find_fault(scene.rig, []) is None
    hull = largest_hull(scene.rig, views[0])
    assert hull is not None and 1.5 < hull.height_m < 2.0


@pytest.mark.parametrize(("a", "b"), [(0, 1), (2, 3)])
def test_two_exchanged_cameras_are_named(scene: SyntheticScene, views: Any, a: int, b: int) -> None:
    cameras = list(scene.rig)
    first, second = cameras[a].name, cameras[b].name
    cameras[a], cameras[b] = replace(cameras[b], name=first), replace(cameras[a], name=second)
    fault = find_fault(CameraRig(tuple(cameras)), views)
    assert fault is not None and fault.exchanged == fault.cameras == (first, second)
    assert fault.after > 0.95 and fault.before < 0.8
    assert f"{first} and {second} seem to be exchanged" in fault.describe()


def test_a_camera_whose_silhouette_is_elsewhere_is_named(scene: SyntheticScene, views: Any) -> None:
    wrong = []
    for seen in views:
        mask = np.roll(seen["cam03"].mask, 60, axis=1)
        moved = Observation.from_mask("cam03", 0, mask, np.zeros(mask.shape, np.uint8))
        wrong.append({**seen, "cam03": moved})
    fault = find_fault(scene.rig, wrong)
    assert fault is not None and fault.left_out == "cam03" and fault.cameras == ("cam03",)
    assert fault.describe().startswith("cam03 contradicts the other cameras")
