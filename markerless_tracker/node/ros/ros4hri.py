"""Conversion of a body to REP-155 (ROS4HRI): joints, their values, links.

Names, axes and order of the joints are those of the package human_description. That has a single
joint in the waist, so bending and twist of the trunk are lost; arms keep their directions in the
world, but the shoulders' positions do not follow. y and r of a hanging arm rotate about the same
axis, so that only their sum is determined.
"""

import re
import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers, transforms
from markerless_tracker.body.angles.segments import segment_axes, segment_nodes
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray, rotation_from_euler

JOINTS = (
    "waist",
    *(f"{axis}_head" for axis in "ryp"),
    *(f"l_{axis}_shoulder" for axis in "ypr"),
    "l_elbow",
    *(f"r_{axis}_shoulder" for axis in "ypr"),
    "r_elbow",
    *(f"l_{axis}_hip" for axis in "ypr"),
    "l_knee",
    *(f"r_{axis}_hip" for axis in "ypr"),
    "r_knee",
)
"""Names of the joints, in order; each is followed by an underscore and the person's id."""

_LINK_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""(3, 3) from a link's axes (x forward, y left, z up) to a segment's (x forward, y up, z right)."""
_SIDES = {"l": 1.0, "r": -1.0}
_WHOLE_TURN = 2.0 * np.pi
_LOCKED = 1e-9
"""Sine of the angle between two z axes below which they count as equal (gimbal lock)."""
_RADIUS_M, _HEAD_RADIUS_M = 0.04, 0.1


def check_id(name: str, value: str) -> str:
    """The id of a person, checked to be valid by REP-155; may be empty.

    Args:
        name: the parameter.
        value: its value.

    Raises:
        ConfigError: it is not valid; names the parameter.
    """
    if value and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", value):
        raise ConfigError(
            f"{name}: got {value!r}, expected a letter, then letters, digits and underscores"
        )
    return value


class Human:
    """Reads the joints of a body's poses, frame after frame.

    Args:
        body: the body; `take` another that differs in sizes only.
        name: the person's id.
    """

    def __init__(self, body: BodyModel, name: str) -> None:
        self._id = name
        self._last: dict[str, FloatArray] = {}
        self.take(body)

    def take(self, body: BodyModel) -> None:
        """Read poses of this body from now on; the angles remain continuous."""
        self._body = body
        self._nodes, self._axes = segment_nodes(body), segment_axes(body)

    def joints(self, pose: FloatArray) -> dict[str, float]:
        """Values of all `JOINTS` at a pose (p,), by full name, rad."""
        nodes = transforms(self._body, pose)
        links = {
            segment: nodes[self._nodes[segment], :, :3] @ axes @ _LINK_AXES
            for segment, axes in self._axes.items()
        }
        up = links["pelvis"].T @ links["thorax"][:, 2]
        values = {"waist": float(np.arctan2(up[0], up[2]))}
        torso = links["pelvis"] @ rotation_from_euler("y", [values["waist"]])
        r, y, p = _xzy(torso.T @ links["head"])
        values |= {"r_head": float(r), "y_head": float(y), "p_head": -float(p)}
        for side, sign in _SIDES.items():
            arm, thigh = links[f"{side}_upper_arm"], links[f"{side}_thigh"]
            y, p, r = self._nearest(f"{side}_arm", *_zxz(torso.T @ arm))
            names = (f"{side}_y_shoulder", f"{side}_p_shoulder", f"{side}_r_shoulder")
            values |= dict(zip(names, (-sign * y, sign * p, sign * r), strict=True))
            values[f"{side}_elbow"] = _hinge(arm, links[f"{side}_forearm"])
            y, p, r = self._nearest(f"{side}_leg", *_zxy(links["pelvis"].T @ thigh))
            names = (f"{side}_y_hip", f"{side}_p_hip", f"{side}_r_hip")
            values |= dict(zip(names, (-y, sign * p, -r), strict=True))
            values[f"{side}_knee"] = _hinge(thigh, links[f"{side}_shank"])
        return {f"{name}_{self._id}": values[name] for name in JOINTS}

    def urdf(self) -> str:
        """The URDF (text); its root link is ``body_<id>``, at the midpoint of the hips."""
        at = dict(zip(MARKER_NAMES, markers(self._body, self._body.neutral), strict=True))
        neck, head = at["Neck"] - at["Pelvis"], at["Head"] - at["Neck"]
        robot = _Robot(self._id, "body")
        robot.joint("waist", "body", "waist", axis=(0, 1, 0), limits=(-0.5, 1.5))
        robot.joint("torso", "waist", "torso", at=neck)
        robot.cylinder("torso", float(neck[2]))
        robot.joint("r_head", "torso", "r_head", axis=(1, 0, 0), limits=(-1.0, 1.0))
        robot.joint("y_head", "r_head", "y_head", axis=(0, 0, 1), limits=(-1.5, 1.5))
        robot.joint("p_head", "y_head", "p_head", axis=(0, -1, 0), limits=(-1.5, 1.5))
        robot.joint("head", "p_head", "head", at=head - [0.0, 0.0, _HEAD_RADIUS_M])
        robot.sphere("head", _HEAD_RADIUS_M)
        for side, sign in _SIDES.items():
            s = side.upper()
            above = at[f"{s}Shoulder"] - at["Neck"]
            y, p, r = (f"{side}_{axis}_shoulder" for axis in "ypr")
            robot.joint(y, "torso", y, at=above, axis=(0, 0, -sign), limits=(-3.2, 3.2))
            robot.joint(p, y, p, axis=(sign, 0, 0), limits=(-0.5, 3.3))
            robot.joint(r, p, f"{side}_shoulder", axis=(0, 0, sign), limits=(-3.2, 3.2))
            points = [at[f"{s}{name}"] for name in ("Shoulder", "Elbow", "Wrist")]
            robot.limb(side, ("shoulder", "elbow", "wrist"), points, (-0.2, 2.7))
            y, p, r = (f"{side}_{axis}_hip" for axis in "ypr")
            beside = at[f"{s}Hip"] - at["Pelvis"]
            robot.joint(y, "body", y, at=beside, axis=(0, 0, -1), limits=(-1.5, 1.5))
            robot.joint(p, y, p, axis=(sign, 0, 0), limits=(-0.6, 1.6))
            robot.joint(r, p, f"{side}_hip", axis=(0, -1, 0), limits=(-1.0, 2.5))
            points = [at[f"{s}{name}"] for name in ("Hip", "Knee", "Ankle")]
            robot.limb(side, ("hip", "knee", "ankle"), points, (-2.8, 0.2))
        return robot.text()

    def _nearest(self, limb: str, first: FloatArray, second: FloatArray) -> FloatArray:
        """The triple of angles nearest to the last frame's, of the two that give a rotation."""
        last = self._last.get(limb, np.zeros(3))
        found = [last + _folded(angles - last) for angles in (first, second)]
        self._last[limb] = min(found, key=lambda angles: float(np.abs(angles - last).sum()))
        return self._last[limb]


def _xzy(R: FloatArray) -> FloatArray:
    """Angles (3,) of a rotation about x, then the rotated z, then the rotated y."""
    z = np.arcsin(np.clip(-R[0, 1], -1.0, 1.0))
    return np.array([np.arctan2(R[2, 1], R[1, 1]), z, np.arctan2(R[0, 2], R[0, 0])])


def _zxy(R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both triples of angles (3,) of a rotation about z, the rotated x and the rotated y."""
    x = np.arcsin(np.clip(R[2, 1], -1.0, 1.0))
    first = np.array([np.arctan2(-R[0, 1], R[1, 1]), x, np.arctan2(-R[2, 0], R[2, 2])])
    return first, np.array([first[0] + np.pi, np.pi - x, first[2] + np.pi])


def _zxz(R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both triples of angles (3,) of a rotation about z, the rotated x and the rotated z."""
    x = np.arctan2(np.hypot(R[0, 2], R[1, 2]), R[2, 2])
    first = np.array([np.arctan2(R[0, 2], -R[1, 2]), x, np.arctan2(R[2, 0], R[2, 1])])
    if np.sin(x) < _LOCKED:
        first = np.array([0.0, x, np.arctan2(R[1, 0], R[0, 0])])
    return first, np.array([first[0] + np.pi, -x, first[2] + np.pi])


def _folded(angles: FloatArray) -> FloatArray:
    """Angles from -pi to pi."""
    return np.asarray((angles + np.pi) % _WHOLE_TURN - np.pi)


def _hinge(upper: FloatArray, lower: FloatArray) -> float:
    """Angle about -y by which a limb's lower link is rotated from its upper one, rad."""
    along = upper.T @ lower[:, 2]
    return float(np.arctan2(-along[0], along[2]))


class _Robot:
    """Writes a URDF whose names end with an id."""

    def __init__(self, name: str, root: str) -> None:
        self._id = name
        self._robot = Element("robot", name=f"human_{name}")
        self._links: dict[str, Element] = {}
        self._link(root)

    def joint(
        self,
        name: str,
        parent: str,
        child: str,
        *,
        at: FloatArray | None = None,
        axis: tuple[float, float, float] | None = None,
        limits: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """A joint and the link at its end; fixed without an axis."""
        self._link(child)
        kind = "fixed" if axis is None else "revolute"
        joint = SubElement(self._robot, "joint", name=f"{name}_{self._id}", type=kind)
        SubElement(joint, "parent", link=f"{parent}_{self._id}")
        SubElement(joint, "child", link=f"{child}_{self._id}")
        SubElement(joint, "origin", xyz=_text(np.zeros(3) if at is None else at), rpy="0 0 0")
        if axis is not None:
            SubElement(joint, "axis", xyz=_text(np.array(axis)))
            low, high = limits
            SubElement(joint, "limit", lower=f"{low}", upper=f"{high}", effort="100", velocity="20")

    def limb(
        self,
        side: str,
        names: tuple[str, str, str],
        points: list[FloatArray],
        limits: tuple[float, float],
    ) -> None:
        """A limb of two straight links, from its upper link on."""
        upper, lower, end = (f"{side}_{name}" for name in names)
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        down = np.array([0.0, 0.0, -1.0])
        self.cylinder(upper, float(lengths[0]))
        self.joint(lower, upper, lower, at=lengths[0] * down, axis=(0, -1, 0), limits=limits)
        self.cylinder(lower, float(lengths[1]))
        self.joint(end, lower, end, at=lengths[1] * down)

    def cylinder(self, link: str, length: float) -> None:
        """A cylinder from a link's origin downwards."""
        visual = self._visual(link, -0.5 * length)
        SubElement(visual, "cylinder", radius=f"{_RADIUS_M}", length=f"{length:.6g}")

    def sphere(self, link: str, radius: float) -> None:
        """A sphere at a link's origin."""
        SubElement(self._visual(link, 0.0), "sphere", radius=f"{radius}")

    def text(self) -> str:
        """The whole file."""
        ElementTree.indent(self._robot)
        text = ElementTree.tostring(self._robot, encoding="unicode")
        return f'<?xml version="1.0"?>\n{text}\n'

    def _link(self, name: str) -> None:
        self._links[name] = SubElement(self._robot, "link", name=f"{name}_{self._id}")

    def _visual(self, link: str, z: float) -> Element:
        visual = SubElement(self._links[link], "visual")
        SubElement(visual, "origin", xyz=_text(np.array([0.0, 0.0, z])), rpy="0 0 0")
        return SubElement(visual, "geometry")


def _text(values: FloatArray) -> str:
    return " ".join(f"{float(value) + 0.0:.9g}" for value in values)
