"""BVH files, read by the format's description alone, and the joint angles that they hold.

The angles follow docs/joint-angles.md: segments have axes at rest, x forward, y along the segment
and up, z right, and rotate relative to one another. A BVH file has all of that: offsets, rotations.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

MARKERS = {
    "Hips": "Pelvis", "Neck": "Neck", "Neck_end": "Head", "LeftArm": "LShoulder",
    "LeftForeArm": "LElbow", "LeftForeArm_end": "LWrist", "RightArm": "RShoulder",
    "RightForeArm": "RElbow", "RightForeArm_end": "RWrist", "LeftUpLeg": "LHip",
    "LeftLeg": "LKnee", "LeftLeg_end": "LAnkle", "RightUpLeg": "RHip", "RightLeg": "RKnee",
    "RightLeg_end": "RAnkle",
}  # fmt: skip
"""Joint or end of one -> marker at the same place, of bodies without wrists and ankles."""
_TRUNK = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Columns x, y, z of the trunk at rest, where the person faces the file's z."""


class Bvh:
    """A BVH file.

    Attributes:
        names: of the joints; the end of a joint is NAME_end.
        period: s.
        positions: (n, joints, 3).
        rest: (joints, 3) positions without any rotation, the root at its offset.
        rotations: (n, joints, 3, 3) of the joints in the world, the identity at rest.
    """

    def __init__(self, path: Path) -> None:
        words = path.read_text(encoding="utf-8").split()
        joints: list[tuple[str, int]] = []
        offsets: dict[int, NDArray[np.float64]] = {}
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
                assert word == "HIERARCHY", word
                i += 1
        assert words[i + 1] == "Frames:" and words[i + 3 : i + 5] == ["Frame", "Time:"]
        count, self.period = int(words[i + 2]), float(words[i + 5])
        rows = np.array(words[i + 6 :], dtype=float).reshape(count, -1)
        self.names = [name for name, _ in joints]
        self.rest = np.zeros((len(joints), 3))
        self.positions = np.zeros((count, len(joints), 3))
        self.rotations = np.zeros((count, len(joints), 3, 3))
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
                self.rest[index] = offsets[index]
                self.positions[:, index], self.rotations[:, index] = place, rotation
                continue
            above = self.rotations[:, parent]
            self.rest[index] = self.rest[parent] + offsets[index]
            self.positions[:, index] = self.positions[:, parent] + np.einsum(
                "nij,nj->ni", above, place
            )
            self.rotations[:, index] = above @ rotation
        assert column == rows.shape[1]

    def angles(self) -> Iterator[tuple[tuple[str, str, str], NDArray[np.float64]]]:
        """By joint: its angles' names in order, `` for none, and (n, 3) angles in degrees."""
        for segment, reference, names, about_z, signs in joints():
            if segment not in self.names:
                continue
            own = self.rotations[:, self.names.index(segment)] @ self._axes(segment)
            if reference:
                above = self.rotations[:, self.names.index(reference)] @ self._axes(reference)
                own = above.transpose(0, 2, 1) @ own
            found = Rotation.from_matrix(own).as_euler("ZXY" if about_z else "YXZ", degrees=True)
            yield names, found * signs

    def _axes(self, segment: str) -> NDArray[np.float64]:
        """(3, 3) columns x, y, z of a segment at rest."""
        side = "Left" if segment.startswith("Left") else "Right"
        lower = {
            "Arm": "ForeArm", "ForeArm": "ForeArm_end", "UpLeg": "Leg", "Leg": "Leg_end",
        }.get(segment.removeprefix(side))  # fmt: skip
        ends = {"Spine": ("Neck", "Hips"), "Neck": ("Neck_end", "Neck")}.get(segment)
        if lower is not None:
            ends = (segment, f"{side}{lower}")
        if ends is None:
            return _TRUNK
        up = self.rest[self.names.index(ends[0])] - self.rest[self.names.index(ends[1])]
        up /= np.linalg.norm(up)
        right = _TRUNK[:, 2] - up * (_TRUNK[:, 2] @ up)
        right /= np.linalg.norm(right)
        return np.column_stack([np.cross(up, right), up, right])


def joints() -> Iterator[tuple[str, str, tuple[str, str, str], bool, NDArray[np.float64]]]:
    """Segment, reference, the angles' names in order, whether about z first, their signs."""
    ones = np.ones(3)
    yield "Hips", "", ("pelvis_tilt", "pelvis_list", "pelvis_rotation"), True, ones
    lumbar = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
    yield "Spine", "Hips", lumbar, True, ones
    yield "Neck", "Spine", ("neck_extension", "neck_bending", "neck_rotation"), True, ones
    for side, s, sign in (("Right", "r", 1.0), ("Left", "l", -1.0)):
        turned = np.array([1.0, sign, sign])
        hip = (f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}")
        arm = (f"arm_flex_{s}", f"arm_add_{s}", f"arm_rot_{s}")
        knee, elbow = (f"knee_angle_{s}", "", ""), (f"elbow_flex_{s}", "", "")
        clavicle = (f"clav_prot_{s}", f"clav_elev_{s}", "")
        yield f"{side}UpLeg", "Hips", hip, True, turned
        yield f"{side}Leg", f"{side}UpLeg", knee, True, np.array([-1.0, sign, sign])
        yield f"{side}Shoulder", "Spine", clavicle, False, np.array([sign, -sign, 1.0])
        yield f"{side}Arm", "Spine", arm, True, turned
        yield f"{side}ForeArm", f"{side}Arm", elbow, True, turned


def _rotations(axis: int, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    found = np.tile(np.eye(3), (len(angles), 1, 1))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, i, i] = found[:, j, j] = np.cos(angles)
    found[:, j, i], found[:, i, j] = np.sin(angles), -np.sin(angles)
    return found
