"""A body as rigid segments, each rotating about one point, for files of skeletons."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, transforms
from markerless_tracker.body.model import SWING_X, IntArray, is_translation
from markerless_tracker.geometry import FloatArray

MOST_ROTATIONS = 3


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
        swings: whether moves are parts of a swing, which rotate together and have no axes.
    """

    name: str
    parent: int
    T_parent_joint: FloatArray
    moves: tuple[Move, ...]
    node: int
    swings: bool


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
        self.swings = False

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
            rotates = not is_translation(body.node_kind[[node]])[0]
            if not (own >= 0 and _goes_on(segments[own], parent, fixed, rotates, children)):
                own, place = len(segments), _with_segment(segments, own, place)
            grown = segments[own]
            grown.rotation = place[:, :3]
            axis = float(body.node_sign[node]) * grown.rotation[:, kind % 3]
            parameter = int(body.node_parameter[node])
            grown.moves.append(Move(body.parameter_names[parameter], parameter, rotates, axis))
            grown.node = node
            grown.swings = grown.swings or kind >= SWING_X
        elif own < 0:
            own, place = len(segments), _with_segment(segments, own, place)
            segments[own].node = node
        if node in names:
            segments[own].names.append(names[node])
        segment_of.append(own)
        places.append(place)
    finished = [
        Segment(
            name=entry.names[0] if entry.names else f"{entry.moves[-1].name}_link",
            parent=entry.parent,
            T_parent_joint=entry.place,
            moves=tuple(entry.moves),
            node=entry.node,
            swings=entry.swings,
        )
        for entry in segments
    ]
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
