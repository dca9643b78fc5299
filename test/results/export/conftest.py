"""Results of made-up motions, and an independent reader of BVH."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, Subject, load_body, markers
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.tracking import TrackerConfig

START_NS = 1_500_000_000
PERIOD_NS = 16_666_667


@pytest.fixture(scope="session")
def person() -> BodyModel:
    """A body whose lengths are no one's generic ones."""
    body = load_body("person31", 1.81)
    lengths = {**body.lengths_m, "l_thigh": 0.5, "r_forearm": 0.21}
    cones = dict(zip(body.cone_names, body.cone_shape, strict=True))
    return load_body("person31", Subject("odd", lengths, cones))


@pytest.fixture(scope="session")
def motion(person: BodyModel) -> np.ndarray:
    """(12, p) poses that move every parameter by about half a radian."""
    rng = np.random.default_rng(5)
    poses = person.neutral + rng.normal(0.0, 0.3, (12, person.size))
    poses[:, person.translations] = rng.normal(0.0, 1.0, (12, len(person.translations)))
    return poses


@pytest.fixture
def make_result(person: BodyModel, motion: np.ndarray, tmp_path: Path) -> Callable[..., Path]:
    """`make_result(lost=, left_out=)`: NAME of a result; frames lost, stamps without a frame."""

    def make(lost: Sequence[int] = (), left_out: Sequence[int] = (), **options: bool) -> Path:
        name = tmp_path / "made" / "walk"
        config = TrackerConfig.from_mapping({"body": "person31"})
        with ResultWriter(name, person, config, fps=60.0, source="odd", **options) as writer:
            for index, pose in enumerate(motion):
                if index in left_out:
                    continue
                sd = np.full((15, 3), 0.01 * (1 + index))
                found = TrackResult(
                    stamp_ns=START_NS + index * PERIOD_NS,
                    state=TrackState.LOST if index in lost else TrackState.TRACKING,
                    pose=pose,
                    markers_m=markers(person, pose),
                    fitness=1.5,
                    iou={"cam01": 0.8},
                    evaluations=10,
                    confidence=Confidence(np.full(person.size, 0.02), sd, np.eye(6)),
                )
                writer.add(found)
                writer.body = replace(person)
        return name

    return make


class Bvh:
    """A BVH file, read by the format's description alone.

    Attributes:
        names: of the joints; the end of a joint is NAME_end.
        period: s.
        positions: (n, joints, 3).
        angles: channel name of a joint -> (n,) values.
    """

    def __init__(self, path: Path) -> None:
        words = path.read_text(encoding="utf-8").split()
        joints: list[tuple[str, int]] = []
        offsets: dict[int, np.ndarray] = {}
        channels: dict[int, list[str]] = {}
        stack: list[int] = []
        i = 0
        while words[i] != "MOTION":
            word = words[i]
            if word in ("ROOT", "JOINT", "End"):
                parent = stack[-1] if stack else -1
                name = f"{joints[parent][0]}_end" if word == "End" else words[i + 1]
                joints.append((name, parent))
                i += 2
            elif word == "{":
                stack.append(len(joints) - 1)
                i += 1
            elif word == "}":
                stack.pop()
                i += 1
            elif word == "OFFSET":
                offsets[stack[-1]] = np.array(words[i + 1 : i + 4], dtype=float)
                i += 4
            elif word == "CHANNELS":
                count = int(words[i + 1])
                channels[stack[-1]] = words[i + 2 : i + 2 + count]
                i += 2 + count
            else:
                assert word == "HIERARCHY"
                i += 1
        assert words[i + 1] == "Frames:" and words[i + 3 : i + 5] == ["Frame", "Time:"]
        count, self.period = int(words[i + 2]), float(words[i + 5])
        rows = np.array(words[i + 6 :], dtype=float).reshape(count, -1)
        self.names = [name for name, _ in joints]
        self.positions = np.zeros((count, len(joints), 3))
        turned = np.zeros((count, len(joints), 3, 3))
        column = 0
        for index, (_, parent) in enumerate(joints):
            place, rotation = np.tile(offsets[index], (count, 1)), np.tile(np.eye(3), (count, 1, 1))
            for channel in channels.get(index, []):
                axis, value = "XYZ".index(channel[0]), rows[:, column]
                column += 1
                if channel.endswith("position"):
                    place[:, axis] = value
                else:
                    rotation = rotation @ _rotations(axis, np.deg2rad(value))
            if parent < 0:
                self.positions[:, index], turned[:, index] = place, rotation
                continue
            self.positions[:, index] = self.positions[:, parent] + np.einsum(
                "nij,nj->ni", turned[:, parent], place
            )
            turned[:, index] = turned[:, parent] @ rotation
        assert column == rows.shape[1]


def _rotations(axis: int, angles: np.ndarray) -> np.ndarray:
    found = np.tile(np.eye(3), (len(angles), 1, 1))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, i, i] = found[:, j, j] = np.cos(angles)
    found[:, j, i], found[:, i, j] = np.sin(angles), -np.sin(angles)
    return found


@pytest.fixture(scope="session")
def read_bvh() -> type[Bvh]:
    return Bvh
