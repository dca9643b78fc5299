"""Every export of one result, read by programs of others: `bench/results/readback.py` in small."""

import os
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.results.pose_angles import PoseAngles
from markerless_tracker.results.read import read_result
from markerless_tracker.results.smooth import Smoothing, smooth_result

# The wheel takes over LD_LIBRARY_PATH, with which later processes no longer find ROS 2.
_ENVIRONMENT = dict(os.environ)
pytest.importorskip("opensim", reason="opensim is not installed")
os.environ.clear()
os.environ.update(_ENVIRONMENT)
pytest.importorskip("ezc3d", reason="ezc3d is not installed")

MOST_MM, MOST_DEGREES, MOST_RMS_MM = 0.1, 0.01, 15.0


@pytest.fixture(scope="session")
def raised(person) -> np.ndarray:
    """(72, p) poses of a person who raises both arms past the horizontal while they turn."""
    time = np.linspace(0.0, 2.0 * np.pi, 72)
    poses = np.tile(person.neutral, (72, 1))
    for side, sign in (("l", 1.0), ("r", -1.0)):
        for axis, size in (("x", 0.9), ("y", 1.1), ("z", 0.6)):
            column = person.index(f"{side}_shoulder_{axis}")
            poses[:, column] += sign * size * np.sin(time + 0.4 * ord(axis))
        poses[:, person.index(f"{side}_elbow")] += (
            0.6
            * (1.0 + np.cos(time))
            * np.sign(person.limits[:, person.index(f"{side}_elbow")].sum())
        )
    poses[:, person.index("pelvis_rz")] = 2.5 + 1.5 * np.sin(time)
    return poses


def own_angles(name: Path) -> tuple[np.ndarray, np.ndarray]:
    """(n, k) angles of the poses alone and those of the result, degrees."""
    result = read_result(name)
    reader = PoseAngles(result.body())
    assert reader.names == result.angle_names
    near = np.deg2rad(result.angles_deg)
    own = [reader.read(pose, at) for pose, at in zip(result.parameters, near, strict=True)]
    return np.rad2deg(own), result.angles_deg


@pytest.mark.parametrize("case", ["every joint", "arms past the horizontal", "blank rows"])
def test_every_export_read_by_other_programs(case, make_result, raised, readers, capsys) -> None:
    changes = {
        "every joint": {},
        "arms past the horizontal": {"poses": raised},
        "blank rows": {"lost": (0, 4, 5, 11)},
    }[case]
    name = make_result(**changes)
    readback = readers("readers")
    assert main(["export", str(name), "--to", readback.FORMATS]) == 0
    found = readback.read_back(name)
    assert set(found) == {"trc", "c3d", "csv", "npz", "bag", "mot + osim", "bvh", "json", "ik"}
    for kind, off in found.items():
        assert off.mm <= (MOST_RMS_MM if kind == "ik" else MOST_MM), (kind, off)
        assert np.isnan(off.degrees) or off.degrees <= MOST_DEGREES, (kind, off)
        assert np.isnan(off.s) or off.s < 1e-6, (kind, off)
    assert found["trc"].notes["blank rows"] == len(changes.get("lost", ()))
    if case == "arms past the horizontal":
        # Where the reported angles keep a split of their own, the motion follows the pose.
        own, reported = own_angles(name)
        assert np.abs(own - reported).max() > 0.5
        left = found["mot + osim"].notes["frames near a singularity"]
        assert 0 < left < len(raised)


def test_angles_of_a_smoothed_result_are_those_of_its_poses(make_result, raised, readers) -> None:
    rng = np.random.default_rng(2)
    name = make_result(poses=raised + rng.normal(0.0, 0.03, raised.shape))
    smooth_result(name, Smoothing(6.0))
    own, reported = own_angles(name)
    away = ~np.array(
        [readers("readers").Result(name).near[a] for a in read_result(name).angle_names]
    )
    assert away.mean() > 0.8
    assert np.abs(own - reported)[away.T].max() < 0.006
