"""Made-up motions: possible, smooth, on the floor, repeatable."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, Feasibility, load_body, markers
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis import MOTIONS, Motion
from markerless_tracker.synthesis.mesh import body_mesh

BODIES = {name: load_body(name, 1.72) for name in ("balan31", "person31")}
BODY = BODIES["balan31"]
FPS = 60.0


def poses(body, kind, seed, frames=360):
    motion = Motion(body, kind, seed)
    return np.array([motion.pose(i / FPS) for i in range(frames)])


@pytest.mark.parametrize("kind", MOTIONS)
@pytest.mark.parametrize("name", sorted(BODIES))
def test_poses_are_possible(name, kind) -> None:
    body = BODIES[name]
    for seed in (0, 1, 2):
        assert Feasibility(body, body.limits, "elliptic")(poses(body, kind, seed, 240)).all()


@pytest.mark.parametrize(
    ("kind", "most"), [("walk", 1.05), ("balance", 1.05), ("stand", 1.05), ("jog", 2.5)]
)
def test_changes_between_frames_are_those_of_people(kind, most) -> None:
    """In units of the greatest change in recorded walks; running is faster than walking."""
    changes = np.abs(np.diff(poses(BODY, kind, 3), axis=0)) / BODY.sigma
    assert changes.max() < most
    assert changes.max() > 0.1


@pytest.mark.parametrize("kind", MOTIONS)
@pytest.mark.parametrize("name", sorted(BODIES))
def test_feet_stay_near_the_floor(name, kind) -> None:
    body = BODIES[name]
    mesh = body_mesh(body)
    low = [mesh.posed(body, pose)[0][:, 2].min() for pose in poses(body, kind, 4, 120)]
    assert min(low) > -0.02 and max(low) < 0.03


@pytest.mark.parametrize(("kind", "speed"), [("walk", 0.8), ("jog", 1.8)])
def test_walking_goes_forward_around_the_origin(kind, speed) -> None:
    track = poses(BODY, kind, 5)
    position = track[:, [BODY.index("pelvis_tx"), BODY.index("pelvis_ty")]]
    radius = np.linalg.norm(position, axis=1)
    assert 0.8 < radius.min() and radius.max() < 1.25
    velocity = np.diff(position, axis=0) * FPS
    assert np.linalg.norm(velocity, axis=1).mean() == pytest.approx(speed, rel=0.15)
    heading = track[:-1, BODY.index("pelvis_rz")]
    forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    along = (velocity * forward).sum(axis=1) / np.linalg.norm(velocity, axis=1)
    assert along.min() > 0.95


@pytest.mark.parametrize(
    ("kind", "feet"), [("balance", ["LAnkle"]), ("stand", ["LAnkle", "RAnkle"])]
)
def test_standing_feet_stay_over_one_point(kind, feet) -> None:
    rows = [MARKER_NAMES.index(name) for name in feet]
    over = np.array([markers(BODY, pose)[rows, :2].mean(axis=0) for pose in poses(BODY, kind, 6)])
    np.testing.assert_allclose(over, 0.0, atol=1e-9)


def test_legs_and_arms_swing_in_opposition() -> None:
    track = poses(BODY, "walk", 7)
    left, right = (track[:, BODY.index(f"{side}_hip_y")] for side in "lr")
    arm = -track[:, BODY.index("l_shoulder_y")]
    assert np.corrcoef(left, right)[0, 1] < -0.9
    assert np.corrcoef(left, arm)[0, 1] < -0.9


def test_a_seed_names_a_motion() -> None:
    np.testing.assert_array_equal(poses(BODY, "walk", 1, 9), poses(BODY, "walk", 1, 9))
    assert np.abs(poses(BODY, "walk", 1, 9) - poses(BODY, "walk", 2, 9)).max() > 0.05


def test_unknown_motion() -> None:
    with pytest.raises(ConfigError, match="motion is 'fly', expected one of walk, jog, balance"):
        Motion(BODY, "fly")
