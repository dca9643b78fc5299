"""The joints of a URDF as arrays, and the transforms of their links at given joint values."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from markerless_tracker.geometry import FloatArray

_TURNS = ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class UrdfJoints:
    """At least one joint: those of a URDF that move, or those that are fixed.

    Attributes:
        links: (parent, child) of each of n joints.
        names: of the joint whose value each has: its own, or that of the joint it mimics.
        multipliers: (n,) of those values.
        origins_m: (n, 3) of the joints in their parents.
        rotations: n rotations from the joints' axes to their parents' at value 0.
        axes: (n, 3) in the joints' axes, unit vectors.
        slides: (n,) whether a joint translates.
    """

    links: tuple[tuple[str, str], ...]
    names: tuple[str, ...]
    multipliers: FloatArray
    origins_m: FloatArray
    rotations: Any
    axes: FloatArray
    slides: NDArray[np.bool_]

    def transforms(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Translations (n, 3) and quaternions (n, 4) (w, x, y, z) of the children in their parents.

        Args:
            values: of the joints by name, rad or m; a joint without a value is at 0.
        """
        at = self.multipliers * np.array([values.get(name, 0.0) for name in self.names])
        moves = at[:, None] * self.axes
        turned = self.rotations * Rotation.from_rotvec(np.where(self.slides[:, None], 0.0, moves))
        slid = self.rotations.apply(np.where(self.slides[:, None], moves, 0.0))
        return self.origins_m + slid, turned.as_quat()[:, [3, 0, 1, 2]]


def read_joints(urdf: str) -> tuple[UrdfJoints, UrdfJoints]:
    """The moving and the fixed joints of a URDF (text) that has both."""
    joints = ElementTree.fromstring(urdf).findall("joint")
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    moving = [joint for joint in joints if joint.get("type") != "fixed"]
    return _arrays(moving), _arrays(fixed)


def _arrays(joints: list[ElementTree.Element]) -> UrdfJoints:
    return UrdfJoints(
        links=tuple((_text(j, "parent", "link"), _text(j, "child", "link")) for j in joints),
        names=tuple(_text(j, "mimic", "joint") or str(j.get("name")) for j in joints),
        multipliers=np.array([float(_text(j, "mimic", "multiplier") or 1.0) for j in joints]),
        origins_m=_triples(joints, "origin", "xyz", "0 0 0"),
        rotations=Rotation.from_euler("xyz", _triples(joints, "origin", "rpy", "0 0 0")),
        axes=_triples(joints, "axis", "xyz", "1 0 0"),
        slides=np.array([joint.get("type") not in _TURNS for joint in joints], dtype=np.bool_),
    )


def _text(joint: ElementTree.Element, tag: str, key: str) -> str:
    """An attribute of a joint's element; empty without one."""
    element = joint.find(tag)
    return "" if element is None else element.get(key, "")


def _triples(joints: list[ElementTree.Element], tag: str, key: str, otherwise: str) -> FloatArray:
    texts = [_text(joint, tag, key) or otherwise for joint in joints]
    return np.array([[float(part) for part in text.split()] for text in texts])
