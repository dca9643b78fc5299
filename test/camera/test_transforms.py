"""Chains of transforms, and quaternions in the order of ROS."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.camera import TransformTree, quaternion_xyzw
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import (
    quaternion_from_rotation,
    rotation_from_rodrigues,
    transform,
)


def stamped(parent: str, child: str, T: Any, quaternion: Any = None) -> Any:
    x, y, z, w = quaternion_xyzw(T[:3, :3]) if quaternion is None else quaternion
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
            translation=SimpleNamespace(x=T[0, 3], y=T[1, 3], z=T[2, 3]),
        ),
    )


def pose(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return transform(rotation_from_rodrigues(rng.normal(size=3)), rng.normal(size=3))


def test_a_chain_leads_to_its_root_and_to_every_ancestor() -> None:
    tree = TransformTree()
    tree.add([stamped("/map", "/rig", pose(9)), stamped("rig", "cam", pose(2))])
    tree.add([stamped("map", "rig", pose(1))])  # the newest counts
    root, T = tree.root("cam")
    assert root == "map" and "cam" in tree and "map" not in tree
    np.testing.assert_allclose(T, pose(1) @ pose(2), atol=1e-12)
    for ancestor, expected in (("map", T), ("rig", pose(2)), ("cam", np.eye(4))):
        found = tree.between(ancestor, "cam")
        assert found is not None
        np.testing.assert_allclose(found, expected, atol=1e-12)
    assert tree.between("cam", "map") is None
    assert tree.root("other")[0] == "other"


def test_a_cycle_ends() -> None:
    tree = TransformTree()
    tree.add([stamped("a", "b", pose(1)), stamped("b", "a", pose(2))])
    assert tree.between("map", "a") is None
    with pytest.raises(CalibrationError, match="from a upwards form a cycle"):
        tree.root("a")


@pytest.mark.parametrize(
    ("quaternion", "reported"),
    [
        ((0.0, 0.0, 0.0, 0.0), "to cam has no rotation"),
        ((0.0, 0.0, 1e-9, 0.0), "to cam has no rotation"),
        ((0.0, np.nan, 0.0, 1.0), "to cam is not finite"),
        ((np.inf, 0.0, 0.0, 1.0), "to cam is not finite"),
    ],
)
def test_invalid_transforms_are_refused(quaternion, reported: str) -> None:
    tree = TransformTree()
    with pytest.raises(CalibrationError, match=reported):
        tree.add([stamped("map", "cam", np.eye(4), quaternion)])
    assert "cam" not in tree


@given(st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3))
def test_quaternions_agree_with_the_geometry(vector: list[float]) -> None:
    rotation = rotation_from_rodrigues(vector)
    w, x, y, z = quaternion_from_rotation(rotation)
    found = np.array(quaternion_xyzw(rotation))
    assert found[3] >= 0.0
    expected = np.array([x, y, z, w])
    # At rotations by pi both signs are the same rotation.
    assert min(np.abs(found - expected).max(), np.abs(found + expected).max()) < 1e-7
