"""OpenSim models (`.osim`): the tracked body with the person's lengths and these markers."""

import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.body import BodyModel
from markerless_tracker.datasets.markers.trc import seconds
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.coordinates import BACK, Coordinates, ModelJoint
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.export.skeleton import MOST_ROTATIONS, Skeleton
from markerless_tracker.results.export.trc import write_renamed_trc
from markerless_tracker.results.read import ResultReader

_VERSION = "40000"
"""Read by every OpenSim 4."""
_CREDITS = (
    "Kinematics only: masses and inertias are nominal. For dynamics, scale a musculoskeletal model "
    "with the marker file."
)
# Nominal: OpenSim assembles no model with massless segments.
_MASS_KG, _INERTIA = "1", "0.01 0.01 0.01 0 0 0"
# OpenSim's cylinders lie along y, cones along z.
_Z_TO_Y: FloatArray = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]).T


def write_osim(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write NAME.osim and NAME.ik.xml, the setup of OpenSim's inverse kinematics on the TRC.

    The model has one body per segment (and one that undoes a clavicle's rotation, below
    the arm), the coordinates of the `.mot`, the 15 markers and a cylinder
    per cone. Its default pose is the first one of the result, where inverse kinematics begins.
    OpenSim's inverse kinematics stops at a blank row: if there are any, or if the markers have
    other names than in NAME.trc, the setup uses NAME.ik.trc, which has the other rows.

    Args:
        path: the model.
        reader: the result.
        names: (15,) the markers' names.

    Raises:
        DatasetError, BodyModelError: the files cannot be written, or the result's body is unknown.
    """
    body = reader.body()
    extent = _extent(reader, body)
    _write(path, _model(body, extent.pose, names, path.stem))
    marker_file = path.with_suffix(".ik.trc")
    if extent.blank or names != reader.marker_names or path.parent != reader.name.parent:
        write_renamed_trc(marker_file, reader, names, blank_rows=False)
    else:
        # One of an earlier result of that name is not part of this export.
        marker_file.unlink(missing_ok=True)
        marker_file = reader.name.with_name(f"{reader.name.name}.trc")
    _write(path.with_suffix(".ik.xml"), _setup(path, marker_file.name, names, extent))


@dataclass(frozen=True, eq=False)
class _Extent:
    """First and last stamp with markers, whether rows are blank, and the first pose (p,)."""

    first_ns: int
    last_ns: int
    blank: bool
    pose: FloatArray


def _extent(reader: ResultReader, body: BodyModel) -> _Extent:
    first, last, blank = None, 0, False
    pose: FloatArray | None = None
    for part in reader.chunks():
        marked = np.isfinite(part.positions_m).any(axis=(1, 2))
        blank = blank or not marked.all()
        known = np.flatnonzero(marked)
        if known.size:
            first = int(part.stamps_ns[known[0]]) if first is None else first
            last = int(part.stamps_ns[known[-1]])
        posed = np.flatnonzero(np.isfinite(part.parameters).all(axis=1))
        if pose is None and posed.size:
            pose = part.parameters[posed[0]]
    return _Extent(first or 0, last, blank, body.neutral if pose is None else pose)


def _model(body: BodyModel, pose: FloatArray, names: tuple[str, ...], title: str) -> Element:
    coordinates = Coordinates(body)
    bones = coordinates.bones
    document = Element("OpenSimDocument", Version=_VERSION)
    model = SubElement(document, "Model", name=title)
    for key, text in (
        ("credits", _CREDITS),
        ("gravity", "0 -9.80665 0"),
        ("length_units", "meters"),
        ("force_units", "N"),
    ):
        SubElement(model, key).text = text
    SubElement(model, "Ground", name="ground")
    bodies = _set(model, "BodySet", "bodyset")
    segment_of = {segment.name: k for k, segment in enumerate(bones.segments)}
    for joint in coordinates.joints:
        entry = SubElement(bodies, "Body", name=joint.child)
        SubElement(entry, "mass").text = _MASS_KG
        SubElement(entry, "mass_center").text = "0 0 0"
        SubElement(entry, "inertia").text = _INERTIA
        if joint.child in segment_of:
            _add_cones(entry, body, bones, segment_of[joint.child])
    joints = _set(model, "JointSet", "jointset")
    at_start = dict(zip(coordinates.names, coordinates.values(pose[None])[0].tolist(), strict=True))
    for joint in coordinates.joints:
        _add_joint(joints, joint, at_start)
    _add_couplers(model, coordinates.names)
    markers = _set(model, "MarkerSet", "markerset")
    for name, node, offset in zip(
        names, body.marker_node.tolist(), body.marker_offset, strict=True
    ):
        place = bones.node_place[node]
        entry = SubElement(markers, "Marker", name=name)
        frame = bones.segments[bones.node_segment[node]].name
        SubElement(entry, "socket_parent_frame").text = f"/bodyset/{frame}"
        SubElement(entry, "location").text = _numbers(place[:, :3] @ offset + place[:, 3])
        SubElement(entry, "fixed").text = "true"
    return document


def _add_joint(joints: Element, described: ModelJoint, values: Mapping[str, float]) -> None:
    joint = SubElement(joints, "CustomJoint", name=f"{described.child}_joint")
    above = described.parent
    parent = "/ground" if above == "ground" else f"/bodyset/{above}"
    SubElement(joint, "socket_parent_frame").text = "parent_offset"
    SubElement(joint, "socket_child_frame").text = "child_offset"
    coordinates = SubElement(joint, "coordinates")
    for coordinate in described.coordinates:
        entry = SubElement(coordinates, "Coordinate", name=coordinate.name)
        SubElement(entry, "default_value").text = _number(values[coordinate.name])
        SubElement(entry, "range").text = _numbers(coordinate.limits)
        SubElement(entry, "clamped").text = "false"
    frames = SubElement(joint, "frames")
    own = np.column_stack([described.R_child_joint, np.zeros(3)])
    _add_offset(frames, "child_offset", f"/bodyset/{described.child}", own)
    _add_offset(frames, "parent_offset", parent, described.T_parent_joint)
    transform = SubElement(joint, "SpatialTransform")
    for kind in (True, False):
        moves = [c for c in described.coordinates if c.rotates == kind]
        axes = _complete([move.axis for move in moves])
        for number in range(MOST_ROTATIONS):
            label = f"{'rotation' if kind else 'translation'}{number + 1}"
            axis = SubElement(transform, "TransformAxis", name=label)
            moving = number < len(moves)
            SubElement(axis, "coordinates").text = moves[number].name if moving else ""
            SubElement(axis, "axis").text = _numbers(axes[number])
            if moving:
                function = SubElement(axis, "LinearFunction", name="function")
                SubElement(function, "coefficients").text = "1 0"
            else:
                function = SubElement(axis, "Constant", name="function")
                SubElement(function, "value").text = "0"


def _add_couplers(model: Element, names: tuple[str, ...]) -> None:
    """Constraints that make every coordinate that undoes another one its reverse."""
    constraints = _set(model, "ConstraintSet", "constraintset")
    for name in names:
        if not name.endswith(BACK):
            continue
        entry = SubElement(constraints, "CoordinateCouplerConstraint", name=f"{name}_coupler")
        SubElement(entry, "isEnforced").text = "true"
        function = SubElement(entry, "coupled_coordinates_function")
        linear = SubElement(function, "LinearFunction")
        SubElement(linear, "coefficients").text = "-1 0"
        SubElement(entry, "independent_coordinate_names").text = name.removesuffix(BACK)
        SubElement(entry, "dependent_coordinate_name").text = name


def _complete(axes: list[FloatArray]) -> list[FloatArray]:
    """Three independent axes, those given first."""
    found = list(axes)
    for candidate in np.eye(3):
        if len(found) == MOST_ROTATIONS:
            break
        if np.linalg.matrix_rank(np.array([*found, candidate]), tol=0.1) == len(found) + 1:
            found.append(candidate)
    return found


def _add_cones(entry: Element, body: BodyModel, bones: Skeleton, index: int) -> None:
    components = SubElement(entry, "components")
    for cone in range(len(body.cone_names)):
        node = int(body.cone_node[cone])
        if bones.node_segment[node] != index:
            continue
        shape, length = body.cone_shape[cone], float(body.cone_length[cone])
        own, fixed = bones.node_place[node], body.cone_fixed[cone]
        middle = np.array([*shape[:, 2:].mean(axis=0), 0.5 * length])
        rotation = own[:, :3] @ fixed[:, :3]
        centre = own[:, :3] @ (fixed[:, :3] @ middle + fixed[:, 3]) + own[:, 3]
        frame = _add_offset(
            components,
            f"{body.cone_names[cone]}_cone",
            "..",
            np.column_stack([rotation @ _Z_TO_Y, centre]),
        )
        cylinder = SubElement(
            SubElement(frame, "attached_geometry"), "Cylinder", name=body.cone_names[cone]
        )
        SubElement(cylinder, "radius").text = _number(float(shape[:, :2].mean()))
        SubElement(cylinder, "half_height").text = _number(0.5 * length)


def _add_offset(parent: Element, name: str, socket: str, place: FloatArray) -> Element:
    frame = SubElement(parent, "PhysicalOffsetFrame", name=name)
    SubElement(frame, "socket_parent").text = socket
    SubElement(frame, "translation").text = _numbers(place[:, 3])
    with warnings.catch_warnings():
        # At 90 degrees SciPy sets one of two angles to 0, which is correct here.
        warnings.filterwarnings("ignore", "Gimbal lock detected")
        angles = Rotation.from_matrix(place[:, :3]).as_euler("XYZ")
    SubElement(frame, "orientation").text = _numbers(angles)
    return frame


def _setup(model: Path, marker_file: str, names: tuple[str, ...], extent: _Extent) -> Element:
    document = Element("OpenSimDocument", Version=_VERSION)
    # OpenSim names the file of marker errors after the tool, without its suffix after a dot.
    tool = SubElement(document, "InverseKinematicsTool", name=model.stem.replace(".", "_"))
    for key, text in (
        ("model_file", model.name),
        ("constraint_weight", "Inf"),
        ("accuracy", "1e-06"),
        ("time_range", f"{seconds(extent.first_ns)} {seconds(extent.last_ns)}"),
        ("marker_file", marker_file),
        ("output_motion_file", f"{model.stem}.ik.mot"),
        ("report_errors", "true"),
    ):
        SubElement(tool, key).text = text
    tasks = _set(tool, "IKTaskSet", "tasks")
    for name in names:
        task = SubElement(tasks, "IKMarkerTask", name=name)
        SubElement(task, "apply").text = "true"
        SubElement(task, "weight").text = "1"
    return document


def _set(parent: Element, kind: str, name: str) -> Element:
    return SubElement(SubElement(parent, kind, name=name), "objects")


def _write(path: Path, document: Element) -> None:
    ElementTree.indent(document)
    with new_file(path) as sink:
        sink.write('<?xml version="1.0" encoding="UTF-8" ?>\n')
        sink.write(ElementTree.tostring(document, encoding="unicode") + "\n")


def _number(value: float) -> str:
    return f"{value + 0.0:.12g}"


def _numbers(values: FloatArray) -> str:
    return " ".join(_number(float(value)) for value in values)
