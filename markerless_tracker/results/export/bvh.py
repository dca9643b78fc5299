"""BVH files (Biovision hierarchy): a skeleton and its motion, in centimetres, Y up."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.axes import ROTATION_FILE_WORLD, to_file
from markerless_tracker.results.export.grid import Grid
from markerless_tracker.results.export.new_file import new_file, number
from markerless_tracker.results.export.skeleton import Skeleton, poses, skeleton
from markerless_tracker.results.read import ResultReader

JOINT_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "pelvis": "Hips", "thorax": "Spine", "head": "Neck",
        "l_clavicle": "LeftShoulder", "l_shoulder": "LeftArm", "l_elbow": "LeftForeArm",
        "l_wrist": "LeftHand", "l_hip": "LeftUpLeg", "l_knee": "LeftLeg", "l_ankle": "LeftFoot",
        "l_foot": "LeftFoot",
        "r_clavicle": "RightShoulder", "r_shoulder": "RightArm", "r_elbow": "RightForeArm",
        "r_wrist": "RightHand", "r_hip": "RightUpLeg", "r_knee": "RightLeg", "r_ankle": "RightFoot",
        "r_foot": "RightFoot",
    }
)  # fmt: skip
"""Segments -> names that character animation knows; others keep theirs."""
_CM_PER_M = 100.0
_ROTATIONS = "Zrotation Xrotation Yrotation"
_DIGITS = 6
# Readers expect a length; markers in a joint's centre are no ends.
_SHORTEST_END_M = 0.001


def write_bvh(path: Path, reader: ResultReader, names: tuple[str, ...]) -> tuple[Grid, int]:
    """Write the skeleton at rest (standing, facing +z) and its joint rotations per frame.

    Positions are in cm; rotations in degrees, about z, then the rotated x, then the rotated y. BVH
    has no empty frames: a frame without a pose repeats the last one (the first one before it).

    Args:
        path: the file.
        reader: the result.
        names: the markers' names, which BVH has no place for.

    Returns:
        The constant rate, with what it left out, and the number of frames that repeat a pose.

    Raises:
        DatasetError, BodyModelError: the file cannot be written, the result has no pose or its
            body is unknown.
    """
    del names
    body = reader.body()
    bones = skeleton(body)
    grid = Grid(reader)
    first = _first_pose(reader)
    frames = grid.frames()
    repeated = 0
    with new_file(path) as sink:
        sink.write("\n".join(_hierarchy(body, bones)) + "\n")
        sink.write(f"MOTION\nFrames: {frames}\nFrame Time: {1.0 / grid.fps:.9f}\n")
        for part in grid.parts():
            found = part.part.parameters[part.rows]
            missing = (part.rows < 0) | ~np.isfinite(found).all(axis=1)
            repeated += int(missing.sum())
            shown = np.where(missing, 0, np.arange(len(found)))
            np.maximum.accumulate(shown, out=shown)
            chosen = np.where(missing[shown][:, None], first, found[shown])
            first = chosen[-1]
            for row in _channels(body, bones, chosen).tolist():
                sink.write(" ".join(number(value, _DIGITS) for value in row) + "\n")
    return grid, repeated


def _first_pose(reader: ResultReader) -> FloatArray:
    for part in reader.chunks():
        known = np.flatnonzero(np.isfinite(part.parameters).all(axis=1))
        if known.size:
            pose: FloatArray = part.parameters[known[0]]
            return pose
    raise DatasetError(f"{reader.name}: no frame has a pose, expected one: BVH has no empty frames")


def _channels(body: BodyModel, bones: Skeleton, parameters: FloatArray) -> FloatArray:
    """(n, 3 + 3 s) position of the root in cm, then Z, X, Y rotations in degrees per segment."""
    nodes = [segment.node for segment in bones.segments]
    rest = poses(body, nodes, body.neutral[None])[0]
    world = poses(body, nodes, parameters)
    turned = world[..., :3] @ rest[:, :, :3].transpose(0, 2, 1)
    columns = [to_file(world[:, 0, :, 3]) * _CM_PER_M]
    for index in _order(bones):
        above = bones.segments[index].parent
        local = turned[:, index]
        if above >= 0:
            local = turned[:, above].transpose(0, 2, 1) @ local
        local = ROTATION_FILE_WORLD @ local @ ROTATION_FILE_WORLD.T
        columns.append(Rotation.from_matrix(local).as_euler("ZXY", degrees=True))
    return np.concatenate(columns, axis=1)


def _order(bones: Skeleton, root: int = 0) -> Iterator[int]:
    """Segments depth first, as the hierarchy lists them."""
    yield root
    for index, segment in enumerate(bones.segments):
        if segment.parent == root:
            yield from _order(bones, index)


def _hierarchy(body: BodyModel, bones: Skeleton) -> list[str]:
    nodes = [segment.node for segment in bones.segments]
    centres = poses(body, nodes, body.neutral[None])[0, :, :, 3]
    ends = markers(body, body.neutral)
    owner = np.array(bones.node_segment)[body.marker_node]
    lines = ["HIERARCHY"]

    def add(index: int, depth: int) -> None:
        segment = bones.segments[index]
        pad, inner = "\t" * depth, "\t" * (depth + 1)
        above = centres[segment.parent] if segment.parent >= 0 else centres[index]
        channels = (
            f"6 Xposition Yposition Zposition {_ROTATIONS}" if not depth else f"3 {_ROTATIONS}"
        )
        name = JOINT_NAMES.get(segment.name, segment.name)
        lines.extend(
            [
                f"{pad}{'JOINT' if depth else 'ROOT'} {name}",
                f"{pad}{{",
                f"{inner}OFFSET {_offset(centres[index] - above)}",
                f"{inner}CHANNELS {channels}",
            ]
        )
        children = [child for child, other in enumerate(bones.segments) if other.parent == index]
        for child in children:
            add(child, depth + 1)
        if not children:
            lines.extend(_end(inner, ends[owner == index] - centres[index]))
        lines.append(f"{pad}}}")

    add(0, 0)
    return lines


def _end(pad: str, offsets_m: FloatArray) -> Sequence[str]:
    """The end of a segment without children: its marker farthest from the joint."""
    lengths = np.linalg.norm(offsets_m, axis=1)
    end = np.zeros(3)
    if lengths.size and lengths.max() > _SHORTEST_END_M:
        end = offsets_m[int(lengths.argmax())]
    return [f"{pad}End Site", f"{pad}{{", f"{pad}\tOFFSET {_offset(end)}", f"{pad}}}"]


def _offset(vector_m: FloatArray) -> str:
    return " ".join(number(value, _DIGITS) for value in (to_file(vector_m) * _CM_PER_M).tolist())
