"""Cameras at fault, found by silhouettes alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import inverse, rotation_from_rodrigues, transform
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


def uneven(scene: SyntheticScene) -> CameraRig:
    """The cameras of a scene, moved along their ring by different angles."""
    cameras = []
    for camera, degrees in zip(scene.rig, (0.0, 25.0, -10.0, 35.0), strict=True):
        about_z = rotation_from_rodrigues(np.array([0.0, 0.0, np.deg2rad(degrees)]))
        turned = transform(about_z, [0.0, 0.0, 0.0])
        cameras.append(replace(camera, T_cam_world=camera.T_cam_world @ inverse(turned)))
    return CameraRig(tuple(cameras))


@pytest.mark.parametrize("by", [1, 2, 3])
def test_cameras_numbered_from_another_one_on_are_named(scene: SyntheticScene, by: int) -> None:
    rig = uneven(scene)
    views = []
    for index in (0, 9):
        masks = body_masks(scene.body, scene.pose(index), rig.cameras)
        views.append({
            name: Observation.from_mask(name, 0, mask.view(np.uint8), 0 * mask.view(np.uint8))
            for name, mask in masks.items()
        })  # fmt: skip
    assert find_fault(rig, views) is None
    names = rig.names
    wrong = [replace(rig.cameras[(k + by) % 4], name=name) for k, name in enumerate(names)]
    fault = find_fault(CameraRig(tuple(wrong)), views)
    assert fault is not None and set(fault.cameras) == set(names), fault
    assert dict(fault.shifted) == {name: names[(k + by) % 4] for k, name in enumerate(names)}
    assert fault.after > 0.95 and fault.before < 0.93
    assert f"cam01 has that of {names[by]}" in fault.describe()
