"""The coordinates of a result as OpenSim names and measures them: degrees, metres, Y up."""

from collections.abc import Sequence

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.axes import FROM_WORLD
from markerless_tracker.results.stored_result import StoredResult

_AXES = "xyz"


def coordinate_names(body: BodyModel) -> tuple[str, ...]:
    """Names (p,) of the coordinates of the exported `.osim`, in the order of the parameters.

    Those of the body's parameters; the translations of the root along x, y, z of the world are
    named by the axis of OpenSim's ground that they follow.
    """
    renamed = {f"_t{_AXES[world]}": f"_t{_AXES[axis]}" for axis, world in enumerate(FROM_WORLD)}
    names = list(body.parameter_names)
    for index in set(body.root.tolist()) & set(body.translations.tolist()):
        stem, ending = names[index][:-3], names[index][-3:]
        names[index] = stem + renamed.get(ending, ending)
    return tuple(names)


def rotations(body: BodyModel) -> FloatArray:
    """(p,) factor from the parameters' units to those of `.mot`: degrees per rad, 1 for metres."""
    factors = np.full(body.size, np.rad2deg(1.0))
    factors[body.translations] = 1.0
    return factors


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
    values = part.parameters * rotations(body)
    fresh = [column for column, name in enumerate(part.angle_names) if name not in names]
    return (
        (*(part.angle_names[column] for column in fresh), *names),
        np.concatenate([part.angles_deg[:, fresh], values], axis=1),
    )
