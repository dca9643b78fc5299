"""The joints of a URDF as arrays, and the transforms of their links at given joint values."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.geometry import FloatArray, quaternion_from_rotation, rotation_from_euler


@dataclass(frozen=True, eq=False)
class UrdfJoints:
    """At least one joint: those of a URDF that move, or those that are fixed.

    Attributes:
        links: (parent, child) of each of n joints.
        names: of the joint whose value each has: its own, or that of the joint it mimics.
        multipliers: (n,) of those values.
        origins_m: (n, 3) of the joints in their parents.
        slides_m: (n, 3) how a joint that translates moves per metre, in its parent; 0 of others.
        turns: (n,) 0.5 of a joint that rotates, 0 of others.
        still, turned: (n, 4) quaternions (w, x, y, z) from the children's axes to the parents': at
            value 0, and rotated by half a turn.
    """

    links: tuple[tuple[str, str], ...]
    names: tuple[str, ...]
    multipliers: FloatArray
    origins_m: FloatArray
    slides_m: FloatArray
    turns: FloatArray
    still: FloatArray
    turned: FloatArray

    def transforms(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Translations (n, 3) and quaternions (n, 4) (w, x, y, z) of the children in their parents.

        Args:
            values: of the joints by name, rad or m; a joint without a value is at 0.
        """
        at = self.multipliers * np.array([values.get(name, 0.0) for name in self.names])
        half = self.turns * at
        quaternions = np.cos(half)[:, None] * self.still + np.sin(half)[:, None] * self.turned
        return self.origins_m + at[:, None] * self.slides_m, quaternions


def read_joints(urdf: str) -> tuple[UrdfJoints, UrdfJoints]:
    """The moving and the fixed joints of a URDF (text) that has both."""
    joints = ElementTree.fromstring(urdf).findall("joint")
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    moving = [joint for joint in joints if joint.get("type") != "fixed"]
    return _arrays(moving), _arrays(fixed)


def _arrays(joints: list[ElementTree.Element]) -> UrdfJoints:
    turns = _triples(joints, "origin", "rpy", "0 0 0")
    rotations = np.array([rotation_from_euler("zyx", rpy[::-1]) for rpy in turns]).reshape(-1, 3, 3)
    axes = _triples(joints, "axis", "xyz", "1 0 0")
    slides = np.array([joint.get("type") == "prismatic" for joint in joints])
    still = np.array([quaternion_from_rotation(rotation) for rotation in rotations]).reshape(-1, 4)
    turned = np.column_stack([np.zeros(len(axes)), axes])
    return UrdfJoints(
        links=tuple((_text(j, "parent", "link"), _text(j, "child", "link")) for j in joints),
        names=tuple(_text(j, "mimic", "joint") or str(j.get("name")) for j in joints),
        multipliers=np.array([float(_text(j, "mimic", "multiplier") or 1.0) for j in joints]),
        origins_m=_triples(joints, "origin", "xyz", "0 0 0"),
        slides_m=slides[:, None] * np.einsum("nij,nj->ni", rotations, axes),
        turns=np.where(slides, 0.0, 0.5),
        still=still,
        turned=_product(still, turned),
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
