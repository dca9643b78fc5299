"""A body's joints under the names of REP-155, read by an independent reader of URDF."""

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers, root_transform
from markerless_tracker.body.anatomy import posture
from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros.ros4hri import JOINTS, Human, check_id

BODY = load_body("person32", 1.8)
CHAINS = {"hip": ("Hip", "Knee", "Ankle"), "shoulder": ("Shoulder", "Elbow", "Wrist")}
POSTURES: dict[str, dict[str, float]] = {
    "arm forward": {"l_shoulder_y": 1.2, "l_elbow": 0.6},
    "arm aside": {"r_shoulder_x": 1.3, "r_elbow": 1.0},
    "step": {"l_hip_y": 0.7, "l_knee": 0.9, "r_hip_y": -0.2, "r_hip_x": 0.3},
    "bow": {"thorax_y": 0.5, "l_shoulder_y": 0.8},
}


def pose_of(name: str) -> np.ndarray:
    pose = posture(BODY, POSTURES[name])
    pose[[BODY.index(f"pelvis_t{axis}") for axis in "xyz"]] = [0.4, -0.3, 1.0]
    pose[BODY.index("pelvis_rz")] = 0.8
    return pose


@pytest.mark.parametrize("name", POSTURES)
def test_limbs_have_the_directions_of_the_body(name: str) -> None:
    yourdfpy: Any = pytest.importorskip("yourdfpy", reason="an independent reader of URDF")
    human, pose = Human(BODY, "p1"), pose_of(name)
    values = human.joints(pose)
    robot = yourdfpy.URDF.load(io.BytesIO(human.urdf().encode()), load_meshes=False)
    assert robot.validate() and robot.base_link == "body_p1"
    assert set(robot.actuated_joint_names) == set(values) == {f"{n}_p1" for n in JOINTS}
    robot.update_cfg(values)
    expected = dict(zip(MARKER_NAMES, markers(BODY, pose), strict=True))
    T = root_transform(BODY, pose)

    def at(link: str) -> np.ndarray:
        return np.asarray((T @ robot.get_transform(f"{link}_p1"))[:3, 3])

    np.testing.assert_allclose(at("torso"), expected["Neck"], atol=0.01)
    for side in "lr":
        for joint, names in CHAINS.items():
            links = [at(f"{side}_{part}") for part in (joint, *(n.lower() for n in names[1:]))]
            points = [expected[f"{side.upper()}{part}"] for part in names]
            np.testing.assert_allclose(np.diff(links, axis=0), np.diff(points, axis=0), atol=0.03)
            for low, high in zip(links, points, strict=True):
                assert np.linalg.norm(low - high) < 0.06


def test_signs_are_those_of_the_convention() -> None:
    def joints(name: str) -> dict[str, float]:
        return Human(BODY, "a").joints(pose_of(name))

    assert joints("step")["l_knee_a"] == pytest.approx(-0.9, abs=0.01)
    assert joints("step")["l_r_hip_a"] > 0.5 and joints("step")["r_p_hip_a"] > 0.2
    assert joints("arm aside")["r_elbow_a"] == pytest.approx(1.0, abs=0.01)
    assert joints("arm aside")["r_p_shoulder_a"] > 1.0
    assert joints("bow")["waist_a"] > 0.4
    still = Human(BODY, "a").joints(BODY.neutral)
    assert max(abs(still[f"{n}_a"]) for n in JOINTS if "shoulder" not in n) < 1e-6


def test_an_angle_goes_on_beyond_half_a_turn() -> None:
    human, found = Human(BODY, "a"), []
    for step in np.linspace(0.2, 2.8, 40):
        found.append(human.joints(posture(BODY, {"l_shoulder_y": float(step)}))["l_p_shoulder_a"])
    assert np.abs(np.diff(found)).max() < 0.2


def test_a_revised_body_continues_the_angles() -> None:
    revised, same = Human(BODY, "a"), Human(BODY, "a")
    rng, changes = np.random.default_rng(2), []
    pose = BODY.neutral.copy()
    arm = [BODY.index(f"l_shoulder_{axis}") for axis in "xyz"]
    for _ in range(200):
        pose[arm] = np.clip(pose[arm] + rng.normal(0.0, 0.15, 3), *BODY.limits[:, arm])
        revised.take(replace(BODY, cone_shape=BODY.cone_shape.copy()))
        found = revised.joints(pose)
        assert found == same.joints(pose)
        changes.append(max(abs(found[n] - v) for n, v in Human(BODY, "a").joints(pose).items()))
    assert max(changes) > 1.0, "the angles of a new person begin near 0"


@pytest.mark.parametrize("value", ["1a", "a-b", "ä", "a b"])
def test_an_id_that_is_none_is_refused(value: str) -> None:
    with pytest.raises(ConfigError, match=f"human_id: got {value!r}, expected a letter"):
        check_id("human_id", value)


def test_ids_and_none() -> None:
    assert check_id("human_id", "a_1") == "a_1" and check_id("human_id", "") == ""
