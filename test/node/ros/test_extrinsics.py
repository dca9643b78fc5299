from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import (
    inverse,
    quaternion_from_rotation,
    rotation_from_rodrigues,
    transform,
)
from markerless_tracker.node.ros.extrinsics import TransformTree


def stamped(parent: str, child: str, T: Any) -> Any:
    w, x, y, z = quaternion_from_rotation(T[:3, :3])
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            rotation=SimpleNamespace(w=w, x=x, y=y, z=z),
            translation=SimpleNamespace(x=T[0, 3], y=T[1, 3], z=T[2, 3]),
        ),
    )


def some(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return transform(rotation_from_rodrigues(rng.normal(size=3)), rng.normal(size=3))


def test_transforms_are_chained_up_to_the_world() -> None:
    tree = TransformTree()
    T_map_rig, T_rig_cam = some(1), some(2)
    assert tree.T_cam_world("cam01") is None
    tree.update([stamped("rig", "cam01_optical_frame", T_rig_cam)])
    assert tree.T_cam_world("cam01") is None
    tree.update([stamped("map", "rig", some(9)), stamped("/map", "/rig", T_map_rig)])
    found = tree.T_cam_world("cam01")
    assert found is not None
    np.testing.assert_allclose(found, inverse(T_map_rig @ T_rig_cam), atol=1e-12)


@pytest.mark.parametrize("wrong", [0.0, float("nan")])
def test_a_quaternion_that_is_no_rotation_is_named(wrong: float) -> None:
    tree = TransformTree()
    message = stamped("map", "cam01_optical_frame", some(1))
    message.transform.rotation = SimpleNamespace(w=wrong, x=wrong, y=wrong, z=wrong)
    with pytest.raises(CalibrationError, match="map -> cam01_optical_frame: rotation"):
        tree.update([message])
    assert tree.T_cam_world("cam01") is None


def test_a_cycle_does_not_hang() -> None:
    tree = TransformTree()
    tree.update(
        [stamped("a", "cam01_optical_frame", some(1)), stamped("cam01_optical_frame", "a", some(2))]
    )
    assert tree.T_cam_world("cam01") is None
