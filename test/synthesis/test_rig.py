"""Cameras around a subject."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.camera import project, project_camera
from markerless_tracker.geometry import apply
from markerless_tracker.synthesis import look_at, ring_rig


@given(
    st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0.5, 5)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 2)),
)
def test_a_camera_looks_at_its_target_upright(eye, target) -> None:
    eye, target = np.array(eye), np.array(target)
    if np.hypot(*(eye - target)[:2]) < 0.1:
        return
    T = look_at(eye, target)
    seen = apply(T, np.stack([eye, target, target + [0, 0, 0.1]]))
    np.testing.assert_allclose(seen[0], 0, atol=1e-9)
    np.testing.assert_allclose(seen[1], [0, 0, np.linalg.norm(target - eye)], atol=1e-9)
    assert seen[2, 0] == pytest.approx(0, abs=1e-9) and seen[2, 1] < 0
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize("cameras", [1, 2, 4, 7])
@pytest.mark.parametrize("size", [(656, 490), (270, 480)])
def test_every_camera_sees_the_whole_person(cameras, size) -> None:
    rig = ring_rig(cameras, size)
    assert rig.names == tuple(f"cam{i + 1:02d}" for i in range(cameras))
    places = [[0.9, 0], [-0.9, 0], [0, 0.9], [0, -0.9], [0, 0]]
    points = np.array([[x, y, z] for x, y in places for z in (0.0, 1.75)])
    pixels = project(points, rig)
    assert np.isfinite(pixels).all()
    assert (pixels >= 0).all() and (pixels <= np.array(size) - 1).all()


def test_the_target_lies_in_the_middle_of_the_image() -> None:
    for camera in ring_rig(3, (640, 480), distortion=(0.0,) * 5):
        np.testing.assert_allclose(
            project_camera(np.array([[0, 0, 0.85]]), camera)[0], [319.5, 239.5]
        )
