"""The exported model's joints and coordinates, by forward kinematics of their description alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from markerless_tracker.body import load_body, markers
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.errors import BodyModelError
from markerless_tracker.results.export.coordinates import Coordinates


def placed(found: Coordinates, values: dict[str, float]) -> dict[str, tuple]:
    """Rotation (3, 3) and origin (3,) of every segment in OpenSim's ground."""
    places = {"ground": (np.eye(3), np.zeros(3))}
    for joint in found.joints:
        above, origin = places[joint.parent]
        axes = above @ joint.T_parent_joint[:, :3]
        origin = origin + above @ joint.T_parent_joint[:, 3]
        turned = np.eye(3)
        for c in joint.coordinates:
            if c.rotates:
                turned = turned @ Rotation.from_rotvec(c.axis * values[c.name]).as_matrix()
            else:
                origin = origin + axes @ (c.axis * values[c.name])
        places[joint.child] = (axes @ turned @ joint.R_child_joint.T, origin)
    return places


@pytest.mark.parametrize("name", ["balan31", "humaneva34", "person31", "person34", "person35"])
def test_the_reported_angles_move_the_model_to_the_markers(name) -> None:
    body = load_body(name, 1.75)
    found, rng = Coordinates(body), np.random.default_rng(1)
    assert set(AngleReader(body).names) <= set(found.names)
    assert {"pelvis_tx", "pelvis_ty", "pelvis_tz"} <= set(found.names)
    for _ in range(4):
        pose = body.neutral + rng.uniform(-0.3, 0.3, body.size)
        values = dict(zip(found.names, found.values(pose[None])[0].tolist(), strict=True))
        angles = AngleReader(body).read(pose)
        for angle, value in zip(angles.names, angles.values_rad.tolist(), strict=True):
            assert values[angle] == pytest.approx(value, abs=1e-9), angle
        places, truth = placed(found, values), markers(body, pose)[:, [1, 2, 0]]
        pelvis = [values[f"pelvis_t{axis}"] for axis in "xyz"]
        np.testing.assert_allclose(pelvis, places[found.joints[0].child][1])
        for node, offset, true in zip(body.marker_node, body.marker_offset, truth, strict=True):
            own = found.bones.node_place[node]
            segment = found.bones.segments[found.bones.node_segment[node]].name
            rotation, origin = places[segment]
            at = rotation @ (own[:, :3] @ offset + own[:, 3]) + origin
            np.testing.assert_allclose(at, true, atol=1e-9)


def test_a_swing_without_reported_angles_is_refused() -> None:
    body = load_body("person32", 1.75)
    frames = {"l_coxa" if name == "l_hip" else name: node for name, node in body.frames.items()}
    with pytest.raises(BodyModelError, match="l_hip_x is part of a swing, whose frame must be"):
        Coordinates(replace(body, frames=frames))
