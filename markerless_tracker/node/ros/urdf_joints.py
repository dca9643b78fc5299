"""The joints of a URDF as arrays, and the transforms of their links at given joint values."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.geometry import FloatArray, quaternion_from_rotation, rotation_from_euler


@dataclass(frozen=True, eq=False)
class UrdfJoints:
    """The moving or the fixed joints of a URDF, at least one.

    Attributes:
        links: (parent, child) of each of n joints.
        names: by joint, the name of the joint whose value it has: its own, or the one it mimics.
        multipliers: (n,) of those values.
        origins_m: (n, 3) of the joints in their parents.
        slides_m: (n, 3) unit axes of prismatic joints in their parents; 0 for others.
        halves: (n,) 0.5 for joints that rotate, 0 for others.
        at_zero, at_pi: (n, 4) quaternions (w, x, y, z) from the children's axes to the parents' at
            the values 0 and pi.
    """

    links: tuple[tuple[str, str], ...]
    names: tuple[str, ...]
    multipliers: FloatArray
    origins_m: FloatArray
    slides_m: FloatArray
    halves: FloatArray
    at_zero: FloatArray
    at_pi: FloatArray

    def transforms(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Translations (n, 3) and quaternions (n, 4) (w, x, y, z) of the children in their parents.

        Args:
            values: of the joints by name, rad or m; 0 for a joint without a value.
        """
        at = self.multipliers * np.array([values.get(name, 0.0) for name in self.names])
        half = self.halves * at
        quaternions = np.cos(half)[:, None] * self.at_zero + np.sin(half)[:, None] * self.at_pi
        return self.origins_m + at[:, None] * self.slides_m, quaternions


def read_joints(urdf: str) -> tuple[UrdfJoints, UrdfJoints]:
    """The moving and the fixed joints of a URDF (text) that has both."""
    joints = ElementTree.fromstring(urdf).findall("joint")
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    moving = [joint for joint in joints if joint.get("type") != "fixed"]
    return _arrays(moving), _arrays(fixed)


def _arrays(joints: list[ElementTree.Element]) -> UrdfJoints:
    angles_rad = _triples(joints, "origin", "rpy", "0 0 0")
    rotations = np.array([rotation_from_euler("zyx", rpy[::-1]) for rpy in angles_rad])
    axes = _triples(joints, "axis", "xyz", "1 0 0")
    slides = np.array([joint.get("type") == "prismatic" for joint in joints])
    at_zero = np.array([quaternion_from_rotation(rotation) for rotation in rotations])
    half_turn = np.column_stack([np.zeros(len(axes)), axes])
    return UrdfJoints(
        links=tuple((_text(j, "parent", "link"), _text(j, "child", "link")) for j in joints),
        names=tuple(_text(j, "mimic", "joint") or str(j.get("name")) for j in joints),
        multipliers=np.array([float(_text(j, "mimic", "multiplier") or 1.0) for j in joints]),
        origins_m=_triples(joints, "origin", "xyz", "0 0 0"),
        slides_m=slides[:, None] * np.einsum("nij,nj->ni", rotations, axes),
        halves=np.where(slides, 0.0, 0.5),
        at_zero=at_zero,
        at_pi=_product(at_zero, half_turn),
    )


def _text(joint: ElementTree.Element, tag: str, key: str) -> str:
    """An attribute of a joint's element; empty without one."""
    element = joint.find(tag)
    return "" if element is None else element.get(key, "")


def _triples(joints: list[ElementTree.Element], tag: str, key: str, otherwise: str) -> FloatArray:
    texts = [_text(joint, tag, key) or otherwise for joint in joints]
    return np.array([[float(part) for part in text.split()] for text in texts])


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products (n, 4) of quaternions (w, x, y, z)."""
    w = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(axis=1)
    return np.column_stack(
        [w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])]
    )
