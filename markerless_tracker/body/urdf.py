"""Bodies as URDF with the same joints and joint names, for viewers and other ROS programs."""

import warnings
import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.body.model import MARKER_NAMES, BodyModel
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray

_AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
# Required by URDF; the body has no limits of effort or speed.
_EFFORT, _VELOCITY = "100", "20"


def urdf(body: BodyModel) -> str:
    """The URDF (text) of a body; its root link is the body's root frame.

    Every joint parameter is one joint with its name, axis and anatomical limits; joint values are
    the parameters (rad, m). If a parameter moves several joints, the first has its name and the
    others mimic it. The last link of a frame has the frame's name. The 15 markers are links on
    fixed joints, cones are cylinders with their mean radius.

    Raises:
        BodyModelError: a frame is no descendant of the root frame, or two links have the same name.
    """
    robot = Element("robot", name=body.name)
    root = body.frames[body.root_frame]
    links = _link_names(body, root)
    if len(set(links.values()) | set(MARKER_NAMES)) != len(links) + len(MARKER_NAMES):
        raise BodyModelError(
            f"body {body.name}: names of frames, parameters and markers must be distinct"
        )
    for node, name in links.items():
        link = SubElement(robot, "link", name=name)
        for cone in np.flatnonzero(body.cone_node == node):
            _visual(link, body, int(cone))
    seen: set[int] = set()
    for node, name in links.items():
        if node != root:
            _joint(robot, body, node, links[int(body.node_parent[node])], name, seen)
    for name, node, offset in zip(MARKER_NAMES, body.marker_node, body.marker_offset, strict=True):
        SubElement(robot, "link", name=name)
        fixed = np.column_stack([np.eye(3), offset])
        _fixed_joint(robot, f"{name}_marker", fixed, links[int(node)], name)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _link_names(body: BodyModel, root: int) -> dict[int, str]:
    """Names of the links by node, for the root frame's last node and its descendants."""
    frames = {node: name for name, node in reversed(list(body.frames.items()))}
    above = {root}
    node = root
    while node >= 0:
        node = int(body.node_parent[node])
        above.add(node)
    names = {root: frames[root]}
    for node in range(len(body.node_parent)):
        if node in above:
            continue
        if int(body.node_parent[node]) not in names:
            frame = frames.get(node, f"node {node}")
            raise BodyModelError(
                f"body {body.name}: frame {frame} is no descendant of the root "
                f"frame {body.root_frame}"
            )
        parameter = int(body.node_parameter[node])
        inner = f"{body.parameter_names[parameter]}_link" if parameter >= 0 else f"node_{node}"
        names[node] = frames.get(node, inner)
    return names


def _joint(
    robot: Element, body: BodyModel, node: int, parent: str, child: str, seen: set[int]
) -> None:
    kind, parameter = int(body.node_kind[node]), int(body.node_parameter[node])
    if kind < 0:
        _fixed_joint(robot, f"{child}_fixed", body.node_fixed[node], parent, child)
        return
    name, sign = body.parameter_names[parameter], float(body.node_sign[node])
    low, high = body.limits[:, parameter]
    free = not np.isfinite([low, high]).all()
    rotating = "continuous" if free else "revolute"
    joint = SubElement(
        robot,
        "joint",
        name=f"{name}_{node}" if parameter in seen else name,
        type=rotating if kind < 3 else "prismatic",
    )
    _origin(joint, body.node_fixed[node])
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "axis", xyz=_numbers(sign * np.array(_AXES[kind % 3])))
    if not (free and kind < 3):
        lower, upper = (float(np.clip(value, -1e3, 1e3)) for value in (low, high))
        SubElement(
            joint, "limit", lower=_number(lower), upper=_number(upper), effort=_EFFORT,
            velocity=_VELOCITY,
        )  # fmt: skip
    if parameter in seen:
        SubElement(joint, "mimic", joint=name)
    seen.add(parameter)


def _fixed_joint(robot: Element, name: str, fixed: FloatArray, parent: str, child: str) -> None:
    joint = SubElement(robot, "joint", name=name, type="fixed")
    _origin(joint, fixed)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)


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
    # Roll, pitch, yaw of URDF: Rz(yaw) Ry(pitch) Rx(roll), rotations about fixed axes.
    with warnings.catch_warnings():
        # At a pitch of 90 degrees SciPy sets one of roll and yaw to 0, which is correct here.
        warnings.filterwarnings("ignore", "Gimbal lock detected")
        rpy = Rotation.from_matrix(fixed[:, :3]).as_euler("xyz")
    SubElement(parent, "origin", xyz=_numbers(fixed[:, 3]), rpy=_numbers(rpy))


def _number(value: float) -> str:
    return f"{value + 0.0:.15g}"


def _numbers(values: FloatArray) -> str:
    return " ".join(_number(float(value)) for value in values)
