"""A body as rigid segments, each rotating about one point, for files of skeletons."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, transforms
from markerless_tracker.body.model import FIRST_TRANSLATION, IntArray
from markerless_tracker.geometry import FloatArray

MOST_ROTATIONS = 3
FIRST_COUPLED = 6
"""Nodes of this kind or a higher one rotate together with a neighbour, without an axis of their
own.
"""
ANATOMICAL: FloatArray = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) OpenSim's axes of a segment, x forward, y up, z right, in the world, body neutral."""
BALL_AXES = (2, 0, 1)
"""Axes of a ball joint's rotations, each as moved by those before: z flexion, x adduction, y
rotation (Rajagopal et al. 2016)."""


@dataclass(frozen=True, eq=False)
class Move:
    """One parameter of a joint.

    Attributes:
        name: of the parameter.
        parameter: its index in the pose.
        rotates: rotation, else translation.
        axis: (3,) unit vector in the joint's frame at zero, sign of the parameter included.
    """

    name: str
    parameter: int
    rotates: bool
    axis: FloatArray


@dataclass(frozen=True, eq=False)
class Segment:
    """A rigid segment and the joint that moves it.

    Attributes:
        name: of the segment: the frame of the body that it ends with.
        parent: index of its parent segment, -1 for the world.
        T_parent_joint: (3, 4) pose of the joint at zero in the parent segment.
        moves: translations, then at most three rotations, each about an axis that the earlier ones
            have rotated.
        node: the body's node at the joint, with which the segment rotates.
        R_segment_node: (3, 3) rotation from that node's axes to the segment's.
        ball: whether the joint's rotations are those of `BALL_AXES` between the anatomical axes of
            parent and segment, since no axes belong to the body's parameters.
        R_parent_anatomical, R_segment_anatomical: (3, 3) anatomical axes in parent and segment.
    """

    name: str
    parent: int
    T_parent_joint: FloatArray
    moves: tuple[Move, ...]
    node: int
    R_segment_node: FloatArray
    ball: bool
    R_parent_anatomical: FloatArray
    R_segment_anatomical: FloatArray


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The segments of a body, parents first.

    Attributes:
        segments: the segments.
        node_segment: (m,) segment of each node of the body.
        node_place: (m, 3, 4) pose of each node in its segment.
    """

    segments: tuple[Segment, ...]
    node_segment: tuple[int, ...]
    node_place: FloatArray


class _Open:
    """A segment under construction."""

    def __init__(self, parent: int, place: FloatArray) -> None:
        self.parent, self.place = parent, place
        self.moves: list[Move] = []
        self.rotation = np.eye(3)
        self.node = -1
        self.names: list[str] = []
        self.ball = False

    @property
    def rotations(self) -> int:
        return sum(move.rotates for move in self.moves)


def skeleton(body: BodyModel) -> Skeleton:
    """The segments of a body: moves about one point belong to one joint."""
    names = {node: name for name, node in body.frames.items()}
    children = np.bincount(body.node_parent[body.node_parent >= 0], minlength=len(body.node_parent))
    segments: list[_Open] = []
    segment_of: list[int] = []
    places: list[FloatArray] = []
    for node, parent in enumerate(body.node_parent.tolist()):
        fixed = body.node_fixed[node]
        own = segment_of[parent] if parent >= 0 else -1
        place = _joined(places[parent], fixed) if parent >= 0 else fixed
        kind = int(body.node_kind[node])
        if kind >= 0:
            rotates = kind < FIRST_TRANSLATION or kind >= FIRST_COUPLED
            if not (own >= 0 and _goes_on(segments[own], parent, fixed, rotates, children)):
                own, place = len(segments), _with_segment(segments, own, place)
            grown = segments[own]
            grown.rotation = place[:, :3]
            axis = float(body.node_sign[node]) * grown.rotation[:, kind % 3]
            parameter = int(body.node_parameter[node])
            grown.moves.append(Move(body.parameter_names[parameter], parameter, rotates, axis))
            grown.node = node
            grown.ball = grown.ball or kind >= FIRST_COUPLED
        elif own < 0:
            own, place = len(segments), _with_segment(segments, own, place)
            segments[own].node = node
        if node in names:
            segments[own].names.append(names[node])
        segment_of.append(own)
        places.append(place)
    neutral = transforms(body, body.neutral)[:, :, :3]
    finished: list[Segment] = []
    for entry in segments:
        own = places[entry.node][:, :3]
        above, joint = ANATOMICAL, ANATOMICAL
        if entry.parent >= 0:
            parent_segment = finished[entry.parent]
            R_world_parent = neutral[parent_segment.node] @ parent_segment.R_segment_node.T
            above = R_world_parent.T @ ANATOMICAL
        joint = (neutral[entry.node] @ own.T).T @ ANATOMICAL
        name = entry.names[0] if entry.names else f"{entry.moves[-1].name}_link"
        moves = tuple(entry.moves)
        if entry.ball:
            signs = (1.0, -1.0, -1.0) if name.startswith("l_") else (1.0, 1.0, 1.0)
            moves = tuple(
                Move(move.name, move.parameter, True, sign * np.eye(3)[axis])
                for move, sign, axis in zip(entry.moves, signs, BALL_AXES, strict=True)
            )
        finished.append(
            Segment(
                name=name,
                parent=entry.parent,
                T_parent_joint=entry.place,
                moves=moves,
                node=entry.node,
                R_segment_node=own,
                ball=entry.ball,
                R_parent_anatomical=above,
                R_segment_anatomical=joint,
            )
        )
    return Skeleton(
        tuple(finished),
        tuple(segment_of),
        np.array(places),
    )


def poses(body: BodyModel, nodes: list[int], parameters: FloatArray) -> FloatArray:
    """World transforms (n, k, 3, 4) of k nodes at poses (n, p) without NaN."""
    return np.array([transforms(body, pose)[nodes] for pose in parameters]).reshape(
        -1, len(nodes), 3, 4
    )


def _with_segment(segments: list[_Open], parent: int, place: FloatArray) -> FloatArray:
    """Open a segment at a place in its parent; returns the place in the new segment."""
    segments.append(_Open(parent, place))
    return np.eye(4)[:3]


def _goes_on(
    segment: _Open, parent: int, fixed: FloatArray, rotates: bool, children: IntArray
) -> bool:
    """Whether a node's move belongs to the joint of its parent's segment."""
    return (
        segment.node == parent
        and children[parent] == 1
        and not fixed[:, 3].any()
        and (segment.rotations < MOST_ROTATIONS if rotates else segment.rotations == 0)
    )


def _joined(first: FloatArray, second: FloatArray) -> FloatArray:
    rotation = first[:, :3] @ second[:, :3]
    return np.column_stack([rotation, first[:, :3] @ second[:, 3] + first[:, 3]])
