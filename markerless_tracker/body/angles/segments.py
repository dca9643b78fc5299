"""Segment frames of a body: x forward, y up along the segment, z right at the anatomical posture.

Found from the body's own frames at its neutral pose, which stands upright with straight, hanging
limbs: a segment's y axis is the line between its markers there, its z axis the trunk's, made
perpendicular to y. So any body reports angles by the same definitions.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body.angles.definitions import GROUND, JOINTS, SEGMENTS, Joint
from markerless_tracker.body.kinematics import carried, markers, move_axes, transforms
from markerless_tracker.body.model import MARKER_NAMES, BodyModel, IntArray, is_translation
from markerless_tracker.geometry import FloatArray

TRUNK_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) columns x, y, z of the trunk at neutral: the world's x, z and -y."""
GROUND_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(3, 3) columns x, y, z of the ground: the world's y, z and x."""


@dataclass(frozen=True, eq=False)
class JointFrames:
    """The joints of a body that have angles, as arrays.

    Attributes:
        joints: j definitions.
        node, reference: (j,) nodes of the segments and of their references, -1 for the ground.
        fixed, reference_fixed: (j, 3, 3) from the nodes' axes to the segments'.
        moved: (k,) nodes that rotate.
        between: (j, k) 1 or -1 where a node rotates the segment, or the reference, alone.
        parameter: (k, p) 1 at each node's parameter.
        others: indices of parameters that rotate none of the segments relative to its reference.
    """

    joints: tuple[Joint, ...]
    node: IntArray
    reference: IntArray
    fixed: FloatArray
    reference_fixed: FloatArray
    moved: IntArray
    between: FloatArray
    parameter: FloatArray
    others: frozenset[int]

    def relative(self, nodes: FloatArray) -> FloatArray:
        """Rotations (j, 3, 3) of the segments relative to their references.

        Args:
            nodes: (m, 3, 4) world transforms of the body's nodes.
        """
        return np.asarray(self._references(nodes).transpose(0, 2, 1) @ self._segments(nodes))

    def velocities(self, body: BodyModel, nodes: FloatArray) -> FloatArray:
        """Angular velocities (j, 3, p) relative to the references, in their axes, by parameter."""
        axes = move_axes(body, nodes, self.moved)
        world = (self.between[:, :, None] * axes).transpose(0, 2, 1)
        return np.asarray(self._references(nodes).transpose(0, 2, 1) @ world @ self.parameter)

    def _segments(self, nodes: FloatArray) -> FloatArray:
        return np.asarray(nodes[self.node, :, :3] @ self.fixed)

    def _references(self, nodes: FloatArray) -> FloatArray:
        axes = nodes[self.reference, :, :3] @ self.reference_fixed
        axes[self.reference < 0] = GROUND_AXES
        return np.asarray(axes)


def segment_nodes(body: BodyModel) -> dict[str, int]:
    """Nodes of the segments that a body has, by the segments' names."""
    found = {}
    for name, segment in SEGMENTS.items():
        frame = next((frame for frame in segment.frames if frame in body.frames), None)
        if frame is not None:
            found[name] = body.frames[frame]
    return found


def segment_axes(body: BodyModel) -> dict[str, FloatArray]:
    """By segment: rotation (3, 3) from the axes of its node to its own."""
    rest = transforms(body, body.neutral)
    at = dict(zip(MARKER_NAMES, markers(body, body.neutral), strict=True))
    axes = {}
    for name, node in segment_nodes(body).items():
        ends = SEGMENTS[name].axis
        placed = TRUNK_AXES
        if ends is not None:
            up = at[ends[0]] - at[ends[1]]
            up = up / np.linalg.norm(up)
            right = TRUNK_AXES[:, 2] - up * (TRUNK_AXES[:, 2] @ up)
            right = right / np.linalg.norm(right)
            placed = np.column_stack([np.cross(up, right), up, right])
        axes[name] = rest[node, :, :3].T @ placed
    return axes


def chain_of(body: BodyModel, node: int) -> tuple[int, list[int]]:
    """The frame above a frame's node, -1 for the world, and the nodes from there to it."""
    ends, chain = set(body.frames.values()), [node]
    while (above := int(body.node_parent[chain[0]])) >= 0 and above not in ends:
        chain.insert(0, above)
    return above, chain


def _rotates_about_a_point(body: BodyModel, chain: list[int]) -> bool:
    """Whether a chain's moves are rotations about one point, translated only before and after."""
    moving = [k for k, node in enumerate(chain) if body.node_kind[node] >= 0]
    if not moving or is_translation(body.node_kind[chain]).any():
        return False
    between = chain[moving[0] + 1 : moving[-1] + 1]
    return not np.any(body.node_fixed[between, :, 3])


def reported_joints(body: BodyModel) -> dict[Joint, str | None]:
    """The joints of a body whose angles are reported.

    Their segment hangs on the reference, or on a segment that does (an arm on a clavicle, which is
    the value then), and rotates about one point.
    """
    nodes = segment_nodes(body)
    names = {node: name for name, node in nodes.items()}
    found: dict[Joint, str | None] = {}
    for joint in JOINTS:
        if joint.segment not in nodes:
            continue
        if joint.reference == GROUND:
            if nodes[joint.segment] == body.frames[body.root_frame]:
                found[joint] = None
            continue
        above, chain = chain_of(body, nodes[joint.segment])
        if joint.reference not in nodes or not _rotates_about_a_point(body, chain):
            continue
        between = names.get(above)
        if between == joint.reference:
            found[joint] = None
        elif any(j.segment == between and j.reference == joint.reference for j in found):
            found[joint] = between
    return found


def joint_frames(body: BodyModel) -> JointFrames:
    """The reported joints of a body as arrays."""
    nodes, axes = segment_nodes(body), segment_axes(body)
    joints = tuple(reported_joints(body))
    node = np.array([nodes[joint.segment] for joint in joints], dtype=np.int64)
    reference = np.array([nodes.get(joint.reference, -1) for joint in joints], dtype=np.int64)
    rotates = (body.node_kind >= 0) & ~is_translation(body.node_kind)
    moved = np.flatnonzero(rotates)
    hang = carried(body, moved)
    above = hang[reference] * (reference >= 0)[:, None]
    parameter = np.zeros((len(moved), body.size))
    parameter[np.arange(len(moved)), body.node_parameter[moved]] = 1.0
    between = hang[node] - above
    alone = ~np.abs(between).any(axis=0)
    return JointFrames(
        joints=joints,
        node=node,
        reference=reference,
        fixed=np.array([axes[joint.segment] for joint in joints]).reshape(-1, 3, 3),
        reference_fixed=np.array(
            [axes.get(joint.reference, np.eye(3)) for joint in joints]
        ).reshape(-1, 3, 3),
        moved=moved,
        between=between,
        parameter=parameter,
        others=frozenset(int(k) for k in body.node_parameter[moved[alone]]),
    )
