"""Bodies as URDF whose joints are the reported angles, for viewers and other ROS programs."""

import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.angles.definitions import GROUND, Joint
from markerless_tracker.body.angles.segments import (
    chain_of,
    reported_joints,
    segment_axes,
    segment_nodes,
)
from markerless_tracker.body.kinematics import transforms
from markerless_tracker.body.model import (
    FIRST_TRANSLATION,
    MARKER_NAMES,
    SWING_X,
    BodyModel,
    is_translation,
)
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray, roll_pitch_yaw

_AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
# Required by URDF; the body has no limits of effort or speed.
_EFFORT, _VELOCITY = "100", "20"


def urdf(body: BodyModel) -> str:
    """The URDF (text) of a body; its root link is the body's root frame.

    Joints are the reported angles (docs/joint-angles.md), in rad, about their own axes one after
    the other; the link at the end of a joint has the name and the axes of the body's frame. An arm
    is reported relative to the thorax but hangs on a clavicle: joints that mimic the clavicle's,
    with the opposite sign, come first. An angle that is one parameter has its limits, others are
    continuous. Parameters that are part of no reported angle are joints with their own names; if
    one moves several joints, the first has its name and the others mimic it. The 15 markers are
    links on fixed joints, cones are cylinders with their mean radius.

    Raises:
        BodyModelError: a frame is no descendant of the root frame, or two links have the same name.
    """
    return _Writer(body).text()


class _Writer:
    """Writes the URDF of one body."""

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self._robot = Element("robot", name=body.name)
        self._frames = {node: name for name, node in reversed(list(body.frames.items()))}
        self._nodes, self._axes = segment_nodes(body), segment_axes(body)
        self._joints = {
            self._nodes[joint.segment]: (joint, between)
            for joint, between in reported_joints(body).items()
            if joint.reference != GROUND
        }
        self._reader = AngleReader(body)
        self._shown = set(self._reader.names)
        self._seen: set[int] = set()
        self._links: list[str] = []
        self._elements: dict[int, Element] = {}

    def text(self) -> str:
        """The whole file."""
        body = self._body
        node = root = body.frames[body.root_frame]
        above = {-1}
        while node >= 0:
            above.add(node)
            node = int(body.node_parent[node])
        names = {root: self._link(self._frames[root], root)}
        for frame in dict.fromkeys(body.frames.values()):
            if frame in above:
                continue
            parent, chain = chain_of(body, frame)
            if parent not in names:
                raise BodyModelError(
                    f"body {body.name}: frame {self._frames[frame]} is no descendant of the root "
                    f"frame {body.root_frame}"
                )
            if frame in self._joints:
                self._angles(*self._joints[frame], names[parent], parent, chain)
            else:
                self._parameters(names[parent], chain)
            names[frame] = self._frames[frame]
        for name, node, offset in zip(
            MARKER_NAMES, body.marker_node, body.marker_offset, strict=True
        ):
            fixed = np.column_stack([np.eye(3), offset])
            self._fixed(f"{name}_marker", fixed, names[int(node)], self._link(name))
        for cone, node in enumerate(body.cone_node.tolist()):
            _visual(self._elements[node], body, cone)
        if len(set(self._links)) != len(self._links):
            raise BodyModelError(
                f"body {body.name}: names of frames, parameters and markers must be distinct"
            )
        ElementTree.indent(self._robot)
        text = ElementTree.tostring(self._robot, encoding="unicode")
        return f'<?xml version="1.0"?>\n{text}\n'

    def _link(self, name: str, node: int | None = None) -> str:
        element = SubElement(self._robot, "link", name=name)
        if node is not None:
            self._elements[node] = element
        self._links.append(name)
        return name

    def _angles(
        self, joint: Joint, between: str | None, link: str, parent: int, chain: list[int]
    ) -> None:
        """A frame on the angles of its joint: origin, rotations, and the frame's own axes."""
        body, frame = self._body, chain[-1]
        start = body.node_fixed[chain[0], :, 3]
        rest = transforms(body, body.neutral)
        turn = rest[parent, :, :3].T @ rest[frame, :, :3]
        offset = rest[parent, :, :3].T @ (rest[frame, :, 3] - rest[parent, :, 3])
        end = turn.T @ (offset - start)
        above = joint.reference if between is None else between
        placed = np.column_stack([self._axes[above], start])
        limits = self._limits(joint, chain)
        name = self._frames[frame]
        for axis, sign, angle, mimics in self._rotations(joint, between):
            child = self._link(f"{name}_without_{angle}" if mimics else f"{angle}_link")
            element = SubElement(
                self._robot,
                "joint",
                name=child if mimics else angle,
                type="revolute" if limits else "continuous",
            )
            _origin(element, placed)
            SubElement(element, "parent", link=link)
            SubElement(element, "child", link=child)
            SubElement(element, "axis", xyz=_numbers(sign * np.array(_AXES[axis])))
            if limits:
                _limit(element, *limits)
            if mimics:
                SubElement(element, "mimic", joint=angle, multiplier="-1")
            link, placed = child, np.eye(3, 4)
        axes = self._axes[joint.segment].T
        fixed = placed[:, :3] @ np.column_stack([axes, axes @ end])
        fixed[:, 3] += placed[:, 3]
        self._fixed(f"{name}_fixed", fixed, link, self._link(name, frame))

    def _rotations(self, joint: Joint, between: str | None) -> list[tuple[int, int, str, bool]]:
        """Axis, sign and angle of a joint's rotations in order, and whether it mimics the angle."""
        found = []
        if between is not None:
            (on, _) = self._joints[self._nodes[between]]
            steps = list(zip(on.order, on.signs, on.names, strict=True))
            found = [(a, s, n, True) for a, s, n in reversed(steps) if n in self._shown]
        steps = list(zip(joint.order, joint.signs, joint.names, strict=True))
        return found + [(a, s, n, False) for a, s, n in steps if n in self._shown]

    def _limits(self, joint: Joint, chain: list[int]) -> tuple[float, float] | None:
        """Limits of a joint's only angle, that of its only parameter; None of others."""
        body = self._body
        moving = [node for node in chain if body.node_kind[node] >= 0]
        names = [name for name in joint.names if name in self._shown]
        limits = body.limits[:, body.node_parameter[moving[0]]]
        if len(moving) != 1 or len(names) != 1 or not np.isfinite(limits).all():
            return None
        parameter = int(body.node_parameter[moving[0]])
        reader = self._reader
        pose, found = body.neutral.copy(), []
        for value in limits:
            pose[parameter] = value
            reader.reset()
            found.append(reader.read(pose).values_rad[reader.names.index(names[0])])
        return float(min(found)), float(max(found))

    def _parameters(self, link: str, chain: list[int]) -> None:
        """A frame on its parameters: each node is a joint."""
        body = self._body
        for node in chain:
            kind, parameter = int(body.node_kind[node]), int(body.node_parameter[node])
            inner = f"{body.parameter_names[parameter]}_link" if parameter >= 0 else f"node_{node}"
            child = self._link(self._frames.get(node, inner), node)
            if kind < 0:
                self._fixed(f"{child}_fixed", body.node_fixed[node], link, child)
            else:
                self._parameter(node, kind, parameter, link, child)
            link = child

    def _parameter(self, node: int, kind: int, parameter: int, parent: str, child: str) -> None:
        body = self._body
        if kind >= SWING_X:
            raise BodyModelError(
                f"body {body.name}: {body.parameter_names[parameter]} is part of a swing, whose "
                "frame must be that of a hip or shoulder"
            )
        name, sign = body.parameter_names[parameter], float(body.node_sign[node])
        low, high = body.limits[:, parameter]
        slides = bool(is_translation(body.node_kind[[node]])[0])
        free = not slides and not np.isfinite([low, high]).all()
        joint = SubElement(
            self._robot,
            "joint",
            name=f"{name}_{node}" if parameter in self._seen else name,
            type="prismatic" if slides else "continuous" if free else "revolute",
        )
        _origin(joint, body.node_fixed[node])
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        SubElement(joint, "axis", xyz=_numbers(sign * np.array(_AXES[kind % FIRST_TRANSLATION])))
        if not free:
            _limit(joint, *(float(np.clip(value, -1e3, 1e3)) for value in (low, high)))
        if parameter in self._seen:
            SubElement(joint, "mimic", joint=name)
        self._seen.add(parameter)

    def _fixed(self, name: str, fixed: FloatArray, parent: str, child: str) -> None:
        joint = SubElement(self._robot, "joint", name=name, type="fixed")
        _origin(joint, fixed)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)


def _limit(joint: Element, lower: float, upper: float) -> None:
    SubElement(
        joint, "limit", lower=_number(lower), upper=_number(upper), effort=_EFFORT,
        velocity=_VELOCITY,
    )  # fmt: skip


def _visual(link: Element, body: BodyModel, cone: int) -> None:
    shape, length = body.cone_shape[cone], float(body.cone_length[cone])
    fixed = body.cone_fixed[cone].copy()
    fixed[:, 3] += fixed[:, :3] @ np.array([*shape[:, 2:].mean(axis=0), 0.5 * length])
    visual = SubElement(link, "visual", name=body.cone_names[cone])
    _origin(visual, fixed)
    geometry = SubElement(visual, "geometry")
    radius = float(shape[:, :2].mean())
    SubElement(geometry, "cylinder", radius=_number(radius), length=_number(length))


def _origin(parent: Element, fixed: FloatArray) -> None:
    rpy = roll_pitch_yaw(fixed[:, :3])
    SubElement(parent, "origin", xyz=_numbers(fixed[:, 3]), rpy=_numbers(rpy))


def _number(value: float) -> str:
    return f"{value + 0.0:.15g}"


def _numbers(values: FloatArray) -> str:
    return " ".join(_number(float(value)) for value in values)
