"""The coordinates of a result as OpenSim names and measures them: degrees, metres, Y up.

The coordinates of a joint with reported angles (docs/joint-angles.md) are these angles, between the
segments' anatomical axes, as determined by the pose; they move the model to the pose. The
translations of the pelvis are along the axes of the marker file. Joints without reported angles
have the body's own parameters. An arm's angles are relative to the thorax, but the arm is attached
to a clavicle: an extra segment at the shoulder reverses the clavicle's rotation. Its coordinates
`NAME_back` are those of the clavicle with the sign reversed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.body import BodyModel, transforms
from markerless_tracker.body.angles.segments import joint_frames, reported_joints
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.axes import FROM_WORLD, ROTATION_FILE_WORLD
from markerless_tracker.results.export.skeleton import Skeleton, skeleton
from markerless_tracker.results.pose_angles import PoseAngles
from markerless_tracker.results.stored_result import StoredResult

BACK = "_back"
"""Suffix of a coordinate that reverses another one."""
_AXES = "XYZ"
_CONSTANT_RAD = 1e-9
_GROUND_M = 100.0
_WORLD_IN_GROUND: FloatArray = np.column_stack([ROTATION_FILE_WORLD, np.zeros(3)])


@dataclass(frozen=True, eq=False)
class Coordinate:
    """One coordinate of a joint.

    Attributes:
        name: of the coordinate.
        axis: (3,) unit vector in the joint's frame at zero, sign included.
        rotates: rotation, else translation.
        limits: (2,) its range, rad or m.
    """

    name: str
    axis: FloatArray
    rotates: bool
    limits: FloatArray


@dataclass(frozen=True, eq=False)
class ModelJoint:
    """A joint of the exported model.

    Attributes:
        child, parent: names of the segments; the parent of the first is `ground`.
        T_parent_joint: (3, 4) pose of the joint at zero in the parent.
        R_child_joint: (3, 3) the joint's axes in the child.
        coordinates: in order, each rotation about the axis as moved by those before.
    """

    child: str
    parent: str
    T_parent_joint: FloatArray
    R_child_joint: FloatArray
    coordinates: tuple[Coordinate, ...]


class Coordinates:
    """The coordinates of a body's model and their values.

    Args:
        body: the body.

    Attributes:
        bones: its segments.
        joints: parents first; more than the segments where extra ones undo a rotation.
        names: of all coordinates, in the order of the joints.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self.bones: Skeleton = skeleton(body)
        self._frames = joint_frames(body)
        self._reader = PoseAngles(body)
        self._between = reported_joints(body)
        self._own: dict[str, int] = {}
        self._unnamed: dict[str, tuple[int, int]] = {}
        self._root = -1
        self.joints = tuple(self._joints())
        self.names = tuple(c.name for joint in self.joints for c in joint.coordinates)

    def values(
        self,
        parameters: FloatArray,
        names: Sequence[str] = (),
        near_rad: FloatArray | None = None,
    ) -> FloatArray:
        """Values (n, k) of the coordinates, m and rad, of poses (n, p); NaN where the pose is.

        Angles go on from one row to the next where none are reported.

        Args:
            parameters: the poses.
            names: of reported angles.
            near_rad: (n, len(names)) reported angles; the nearest of both solutions is returned.
        """
        found = np.full((len(parameters), len(self.names)), np.nan)
        columns = [names.index(name) if name in names else -1 for name in self._reader.names]
        last = np.zeros(len(columns))
        for row in np.flatnonzero(np.isfinite(parameters).all(axis=1)):
            near = last
            if near_rad is not None:
                reported = np.append(near_rad[row], np.nan)[columns]
                near = np.where(np.isfinite(reported), reported, last)
            last = self._reader.read(parameters[row], near)
            at = self._pose_values(parameters[row], last)
            found[row] = [
                -at[name.removesuffix(BACK)] if name.endswith(BACK) else at[name]
                for name in self.names
            ]
        return found

    def factors(self) -> FloatArray:
        """(k,) from m and rad to the m and degrees of a motion file."""
        rotates = [c.rotates for joint in self.joints for c in joint.coordinates]
        return np.where(rotates, np.rad2deg(1.0), 1.0)

    def _pose_values(self, pose: FloatArray, angles_rad: FloatArray) -> dict[str, float]:
        at = dict(zip(self._reader.names, angles_rad.tolist(), strict=True))
        at.update({name: float(pose[index]) for name, index in self._own.items()})
        nodes = transforms(self._body, pose)
        if self._root >= 0:
            place = nodes[self._root, :, 3]
            for k, world in enumerate(FROM_WORLD):
                at[f"pelvis_t{_AXES[k].lower()}"] = float(place[world])
        relative = self._frames.relative(nodes)
        for name, (joint, which) in self._unnamed.items():
            at[name] = float(_euler(relative[joint], self._frames.joints[joint].order)[which])
            at[name] *= self._frames.joints[joint].signs[which]
        return at

    def _joints(self) -> list[ModelJoint]:
        reported = {
            self.bones.node_segment[int(node)]: k for k, node in enumerate(self._frames.node)
        }
        found: list[ModelJoint] = []
        for index in range(len(self.bones.segments)):
            if index in reported:
                found.extend(self._anatomical(index, reported[index], found))
            else:
                found.append(self._of_parameters(index))
        return found

    def _anatomical(self, index: int, k: int, before: list[ModelJoint]) -> list[ModelJoint]:
        """The joint of a segment with reported angles, after the one that undoes a clavicle's."""
        segment, joint = self.bones.segments[index], self._frames.joints[k]
        own = self._axes_in_segment(int(self._frames.node[k]), self._frames.fixed[k])
        name, parent = segment.name, "ground"
        coordinates = self._angles(k)
        at = segment.T_parent_joint[:, 3]
        if segment.parent < 0:
            self._root = segment.node
            limits = np.array([-_GROUND_M, _GROUND_M])
            moves = [
                Coordinate(f"pelvis_t{a.lower()}", np.eye(3)[i], False, limits)
                for i, a in enumerate(_AXES)
            ]
            # Translations are those of the ground; rotations begin with its axes.
            return [ModelJoint(name, parent, np.eye(4)[:3], own, (*moves, *coordinates))]
        parent = self.bones.segments[segment.parent].name
        if self._between[joint] is None:
            reference = self._axes_in_segment(
                int(self._frames.reference[k]), self._frames.reference_fixed[k]
            )
            return [ModelJoint(name, parent, np.column_stack([reference, at]), own, coordinates)]
        over = next(other for other in before if other.child == parent)
        undone = tuple(
            Coordinate(c.name + BACK, c.axis, True, np.sort(-c.limits))
            for c in reversed(over.coordinates)
        )
        base = f"{name}_base"
        place = np.column_stack([over.R_child_joint, at])
        # The base has the axes of the thorax, whatever the clavicle does.
        return [
            ModelJoint(base, parent, place, np.eye(3), undone),
            ModelJoint(name, base, np.eye(4)[:3], own, coordinates),
        ]

    def _axes_in_segment(self, node: int, fixed: FloatArray) -> FloatArray:
        return np.asarray(self.bones.node_place[node][:, :3] @ fixed)

    def _angles(self, k: int) -> tuple[Coordinate, ...]:
        """The angles of a joint that change; those without a name get one of their axis."""
        joint = self._frames.joints[k]
        limits = np.array([-np.pi, np.pi])
        found = []
        for which, (name, axis, sign) in enumerate(
            zip(joint.names, joint.order, joint.signs, strict=True)
        ):
            if not name or name not in self._reader.names:
                if not self._changes(k, which):
                    continue
                name = f"{joint.segment}_{_AXES[axis].lower()}"
                self._unnamed[name] = (k, which)
            found.append(Coordinate(name, sign * np.eye(3)[axis], True, limits))
        return tuple(found)

    def _changes(self, k: int, which: int) -> bool:
        rng = np.random.default_rng(0)
        for _ in range(4):
            pose = self._body.neutral + rng.uniform(-0.3, 0.3, self._body.size)
            relative = self._frames.relative(transforms(self._body, pose))[k]
            if abs(_euler(relative, self._frames.joints[k].order)[which]) > _CONSTANT_RAD:
                return True
        return False

    def _of_parameters(self, index: int) -> ModelJoint:
        """A joint without reported angles, by the body's own parameters."""
        segment = self.bones.segments[index]
        if segment.swings:
            raise BodyModelError(
                f"body {self._body.name}: {segment.moves[0].name} is part of a swing, whose frame "
                "must be that of a hip or shoulder"
            )
        place, parent = segment.T_parent_joint, "ground"
        if segment.parent >= 0:
            parent = self.bones.segments[segment.parent].name
        else:
            rotation = _WORLD_IN_GROUND[:, :3]
            place = np.column_stack([rotation @ place[:, :3], rotation @ place[:, 3]])
        free = {True: np.pi, False: _GROUND_M}
        coordinates = []
        for move in segment.moves:
            self._own[move.name] = move.parameter
            low, high = self._body.limits[:, move.parameter]
            if not np.isfinite([low, high]).all():
                low, high = -free[move.rotates], free[move.rotates]
            coordinates.append(
                Coordinate(move.name, move.axis, move.rotates, np.array([low, high]))
            )
        return ModelJoint(segment.name, parent, place, np.eye(3), tuple(coordinates))


def _euler(rotation: FloatArray, order: tuple[int, int, int]) -> FloatArray:
    turn = Rotation.from_matrix(rotation)
    return np.asarray(turn.as_euler("ZXY") if order == (2, 0, 1) else turn.as_euler("YXZ"))


def motion_columns(
    part: StoredResult, coordinates: Coordinates
) -> tuple[tuple[str, ...], FloatArray]:
    """Columns of a `.mot`: the model's coordinates, the angles near those that the result has.

    Args:
        part: the frames, n of them.
        coordinates: of the tracked body.

    Returns:
        The columns' names and values (n, k), in degrees and metres.
    """
    known = np.deg2rad(part.angles_deg)
    values = coordinates.values(part.parameters, part.angle_names, known)
    return coordinates.names, values * coordinates.factors()
