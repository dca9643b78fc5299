"""Rotations and rigid transforms."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from markerless_tracker.geometry import (
    apply,
    inverse,
    quaternion_from_rotation,
    rodrigues_from_rotation,
    roll_pitch_yaw,
    rotation_from_euler,
    rotation_from_quaternion,
    rotation_from_rodrigues,
    skew,
    transform,
)

number = st.floats(-10, 10)
vector = st.tuples(number, number, number).map(np.array)
direction = vector.filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: v / np.linalg.norm(v))
angle = st.floats(0, np.pi) | st.sampled_from([0.0, 1e-13, 1e-9, 1e-5, np.pi - 1e-7, np.pi])
turn = st.tuples(direction, angle).map(lambda pair: pair[0] * pair[1])


@given(turn)
def test_rotations_are_rotations_and_those_of_opencv(v: np.ndarray) -> None:
    r = rotation_from_rodrigues(v)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(r) == pytest.approx(1)
    np.testing.assert_allclose(r, cv2.Rodrigues(v)[0], atol=1e-9)


@given(st.permutations("xyz"), vector)
def test_turns_about_a_frames_own_axes_are_those_of_scipy(order: list[str], a: np.ndarray) -> None:
    axes = "".join(order)
    expected = Rotation.from_euler(axes.upper(), a).as_matrix()
    np.testing.assert_allclose(rotation_from_euler(axes, a), expected, atol=1e-9)


def test_any_number_of_turns_and_as_many_angles() -> None:
    np.testing.assert_array_equal(rotation_from_euler("", []), np.eye(3))
    twice = rotation_from_euler("xyx", [0.5, 0.0, 0.25])
    np.testing.assert_allclose(twice, rotation_from_euler("x", [0.75]), atol=1e-12)
    with pytest.raises(ValueError, match="shorter"):
        rotation_from_euler("xyz", [0.1, 0.2])


@given(direction, st.floats(-3, 3))
def test_the_axis_is_invariant_and_the_trace_gives_the_angle(axis: np.ndarray, a: float) -> None:
    r = rotation_from_rodrigues(axis * a)
    np.testing.assert_allclose(r @ axis, axis, atol=1e-12)
    assert np.trace(r) == pytest.approx(1 + 2 * np.cos(a))


@given(turn)
def test_rodrigues_vectors_round_trip(v: np.ndarray) -> None:
    back = rodrigues_from_rotation(rotation_from_rodrigues(v))
    assert np.linalg.norm(back) <= np.pi + 1e-9
    if np.linalg.norm(v) < np.pi - 1e-6:
        np.testing.assert_allclose(back, v, atol=1e-8)
    else:  # at half a turn both directions are the same rotation
        np.testing.assert_allclose(np.outer(back, back), np.outer(v, v), atol=1e-5)


@pytest.mark.parametrize("axis", np.eye(3).tolist() + [[0.6, -0.8, 0], [-1, 0, 0], [0, -1, 0]])
def test_rotations_by_pi_round_trip(axis: list[float]) -> None:
    v = np.pi * np.array(axis)
    back = rotation_from_rodrigues(rodrigues_from_rotation(rotation_from_rodrigues(v)))
    np.testing.assert_allclose(back, rotation_from_rodrigues(v), atol=1e-9)


@given(turn)
def test_quaternions_round_trip_and_have_unit_length(v: np.ndarray) -> None:
    r = rotation_from_rodrigues(v)
    q = quaternion_from_rotation(r)
    assert np.linalg.norm(q) == pytest.approx(1) and q[0] >= 0
    np.testing.assert_allclose(rotation_from_quaternion(q), r, atol=1e-12)
    np.testing.assert_allclose(q[0], np.cos(np.linalg.norm(v) / 2), atol=1e-8)


@given(turn, st.floats(0.01, 100), st.sampled_from([-1, 1]))
def test_a_quaternions_length_and_sign_do_not_matter(v: np.ndarray, size: float, sign: int) -> None:
    r = rotation_from_rodrigues(v)
    q = sign * size * quaternion_from_rotation(r)
    np.testing.assert_allclose(rotation_from_quaternion(q), r, atol=1e-12)


@given(vector, vector)
def test_skew_is_the_cross_product(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-12)
    np.testing.assert_array_equal(skew(a), -skew(a).T)


@given(turn, vector, st.lists(vector, min_size=1, max_size=4))
def test_the_inverse_undoes_a_transform(
    v: np.ndarray, t: np.ndarray, points: list[np.ndarray]
) -> None:
    T = transform(rotation_from_rodrigues(v), t)
    moved = apply(T, points)
    expected = [(T @ np.append(p, 1.0))[:3] for p in points]
    np.testing.assert_allclose(moved, expected, atol=1e-10)
    np.testing.assert_allclose(apply(inverse(T), moved), points, atol=1e-10)
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-10)


def test_apply_keeps_the_shape_of_its_points() -> None:
    T = transform(np.eye(3), [1, 2, 3])
    assert apply(T, np.zeros((2, 5, 3))).shape == (2, 5, 3)
    np.testing.assert_array_equal(apply(T, np.zeros(3)), [1, 2, 3])


@given(st.tuples(*[st.floats(-3.1, 3.1)] * 3), st.booleans())
def test_roll_pitch_yaw_give_the_rotation_back(angles, upright) -> None:
    roll, pitch, yaw = angles
    pitch = math.copysign(math.pi / 2, pitch) if upright else pitch
    rotation = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    found = roll_pitch_yaw(rotation)
    np.testing.assert_allclose(
        Rotation.from_euler("xyz", found).as_matrix(), rotation, rtol=0, atol=1e-7
    )
