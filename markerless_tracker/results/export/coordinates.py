"""The coordinates of a result as OpenSim names and measures them: degrees, metres, Y up."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.axes import FROM_WORLD
from markerless_tracker.results.export.skeleton import poses, skeleton
from markerless_tracker.results.stored_result import StoredResult

_AXES = "xyz"
_BALL_MOVES = ("flexion", "adduction", "rotation")


def coordinate_names(body: BodyModel) -> tuple[str, ...]:
    """Names (p,) of the coordinates of the exported `.osim`, in the order of the parameters.

    Those of the body's parameters; the translations of the root along x, y, z of the world are
    named by the axis of OpenSim's ground that they follow. A ball joint whose parameters have no
    axes has the coordinates `NAME_flexion_S`, `NAME_adduction_S` and `NAME_rotation_S` of side S.
    """
    renamed = {f"_t{_AXES[world]}": f"_t{_AXES[axis]}" for axis, world in enumerate(FROM_WORLD)}
    names = list(body.parameter_names)
    for index in set(body.root.tolist()) & set(body.translations.tolist()):
        stem, ending = names[index][:-3], names[index][-3:]
        names[index] = stem + renamed.get(ending, ending)
    for segment in skeleton(body).segments:
        if segment.ball:
            side, _, stem = segment.name.partition("_")
            if not stem:
                side, stem = "", side
            ending = f"_{side}" if side else ""
            for move, what in zip(segment.moves, _BALL_MOVES, strict=True):
                names[move.parameter] = f"{stem}_{what}{ending}"
    return tuple(names)


def coordinate_values(body: BodyModel, parameters: FloatArray) -> FloatArray:
    """Values (n, p) of the coordinates in m and rad, of poses (n, p); NaN where the pose is."""
    bones = skeleton(body)
    values = np.array(parameters, dtype=np.float64)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    balls = [segment for segment in bones.segments if segment.ball]
    if not balls or not known.size:
        return values
    nodes = [segment.node for segment in bones.segments]
    axes = poses(body, nodes, values[known])[..., :3]
    for segment in balls:
        own = axes[:, bones.segments.index(segment)] @ segment.R_segment_node.T
        above = bones.segments[segment.parent]
        parent = axes[:, segment.parent] @ above.R_segment_node.T
        relative = (
            segment.R_parent_anatomical.T
            @ parent.transpose(0, 2, 1)
            @ own
            @ segment.R_segment_anatomical
        )
        found = Rotation.from_matrix(relative).as_euler("ZXY")
        for column, move in enumerate(segment.moves):
            values[known, move.parameter] = found[:, column] * move.axis.sum()
    return values


def motion_columns(
    part: StoredResult, body: BodyModel, names: Sequence[str]
) -> tuple[tuple[str, ...], FloatArray]:
    """Columns of a `.mot`: the result's joint angles, if it has any, then the model's coordinates.

    Args:
        part: the frames, n of them.
        body: the tracked body, p parameters.
        names: (p,) of `coordinate_names`.

    Returns:
        The columns' names and values (n, k), in degrees and metres.
    """
    factors = np.full(body.size, np.rad2deg(1.0))
    factors[body.translations] = 1.0
    values = coordinate_values(body, part.parameters) * factors
    fresh = [column for column, name in enumerate(part.angle_names) if name not in names]
    return (
        (*(part.angle_names[column] for column in fresh), *names),
        np.concatenate([part.angles_deg[:, fresh], values], axis=1),
    )
