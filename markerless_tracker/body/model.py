"""A body as arrays: tree of one-parameter joints, cones, markers, limits, collision pairs."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

IntArray = NDArray[np.int64]

MARKER_NAMES = (
    "Pelvis", "Neck", "Head", "LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist",
    "LHip", "LKnee", "LAnkle", "RHip", "RKnee", "RAnkle",
)  # fmt: skip
"""The 15 markers, in the order of every marker array of this package."""

LIMB_MARKERS = tuple(name for name in MARKER_NAMES if name not in ("Pelvis", "Neck", "Head"))
"""The 12 limb joints."""


FIRST_TRANSLATION = 3
"""Kinds of nodes from here on, up to `SWING_X`, are translations, the lower ones rotations."""
SWING_X = 6
"""Kind of the first node of a swing: moves nothing, holds the first parameter."""
SWING_Y = 7
"""Kind of the second: rotates by the rotation vector (a, b, 0) of both parameters.

Its parent is the first, the node before it, and its fixed transform the identity.
"""


def is_translation(kind: IntArray) -> NDArray[np.bool_]:
    """Which kinds (m,) of nodes translate."""
    return np.asarray((kind >= FIRST_TRANSLATION) & (kind < SWING_X))


@dataclass(frozen=True, eq=False)
class BodyModel:
    """A body of p parameters, m nodes and c cones with one subject's sizes; metres, radians.

    A node is a fixed transform from its parent followed by at most one elementary move (rotation
    or translation by a parameter). Two nodes in a row may share a rotation, a swing.

    Attributes:
        name: name of the description.
        parameter_names: (p,) names in order; joint states contain those that are not in the root.
        node_parent: (m,) parent node, -1 for the world; parents come before children.
        node_fixed: (m, 3, 4) fixed transform from the parent, before the move.
        node_kind: (m,) 0..2 rotation about x, y, z; 3..5 translation along them; `SWING_X` and
            `SWING_Y` a swing; -1 no move.
        node_sign: (m,) factor of the parameter.
        node_parameter: (m,) index of its parameter, -1 for none.
        frames: last node of each frame by name.
        root_frame: name of the frame that all others descend from.
        sigma: (p,) greatest change between frames at 60 fps (SPPSO Eq 1).
        neutral: (p,) standing with hanging arms, the root at the origin.
        prior_mean: (p,) mean of people's poses: neutral, with slightly bent elbows.
        prior_sd: (p,) standard deviation about that mean, infinite for the root: a weak prior of
            the refinement for parameters that the images do not determine.
        limits: (2, p) anatomical lower and upper limits, infinite where free.
        walking_limits: (2, p) published limits, learned from one walk.
        marker_node, marker_offset: (15,) and (15, 3), markers in their nodes' frames.
        cone_names: (c,) names.
        cone_node, cone_fixed: (c,) and (c, 3, 4), each cone's node and its base frame there.
        cone_length: (c,) length along the base frame's +z.
        cone_shape: (c, 2, 4) start and end: radius x, radius y, offset x, offset y.
        cone_edges: (c, 2) whether the sides, and the contour of the end, count as edges.
        collisions: (k, 2) pairs of cones that must not inter-penetrate.
        subspaces: named groups of parameter indices.
        hierarchies: named lists of steps of a hierarchical search; each step names the subspace
            that varies, then those that a soft partition adds.
        lengths_m: the subject's named lengths.
        measured: whether the lengths were measured on the person (not fitted or generic).
    """

    name: str
    parameter_names: tuple[str, ...]
    node_parent: IntArray
    node_fixed: FloatArray
    node_kind: IntArray
    node_sign: FloatArray
    node_parameter: IntArray
    frames: Mapping[str, int]
    root_frame: str
    sigma: FloatArray
    neutral: FloatArray
    prior_mean: FloatArray
    prior_sd: FloatArray
    limits: FloatArray
    walking_limits: FloatArray
    marker_node: IntArray
    marker_offset: FloatArray
    cone_names: tuple[str, ...]
    cone_node: IntArray
    cone_fixed: FloatArray
    cone_length: FloatArray
    cone_shape: FloatArray
    cone_edges: NDArray[np.bool_]
    collisions: IntArray
    subspaces: Mapping[str, IntArray]
    hierarchies: Mapping[str, tuple[tuple[str, ...], ...]]
    lengths_m: Mapping[str, float]
    measured: bool = True

    def __post_init__(self) -> None:
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, locked(value, value.dtype))
        least = np.minimum(self.cone_length, self.cone_shape[:, :, :2].min(axis=(1, 2)))
        if np.any(least <= 0):
            cone = int(least.argmin())
            raise BodyModelError(
                f"body {self.name}, cone {self.cone_names[cone]}: a length or radius of "
                f"{least[cone]:g} m, expected more than 0"
            )

    @property
    def size(self) -> int:
        """Number of parameters p."""
        return len(self.parameter_names)

    @property
    def root(self) -> IntArray:
        """(6,) indices of the parameters that place the root frame in the world."""
        return self.subspaces["root"]

    @property
    def limbs(self) -> tuple[str, ...]:
        """Subspaces of the limbs: the steps of hierarchy 'six' after root, torso and head.

        Empty if hierarchies are declared, but not 'six'.
        """
        if self.hierarchies and "six" not in self.hierarchies:
            return ()
        return tuple(step[0] for step in self.steps("six")[2:])

    def steps(self, hierarchy: str) -> tuple[tuple[str, ...], ...]:
        """The steps of a hierarchy; without any declared, 'six' has one step per subspace.

        Raises:
            BodyModelError: there is no such hierarchy.
        """
        if hierarchy == "six" and not self.hierarchies:
            return tuple((name,) for name in self.subspaces)
        if hierarchy not in self.hierarchies:
            raise BodyModelError(
                f"body {self.name} has no hierarchy {hierarchy!r}, "
                f"expected one of {', '.join(self.hierarchies) or 'six'}"
            )
        return self.hierarchies[hierarchy]

    @cached_property
    def joints(self) -> IntArray:
        """Indices of the parameters that are joints, in order."""
        return np.setdiff1d(np.arange(self.size), self.root)

    @cached_property
    def translations(self) -> IntArray:
        """Indices of the parameters that are translations, in m; the others are angles, in rad."""
        return np.unique(self.node_parameter[is_translation(self.node_kind)])

    @property
    def root_position(self) -> IntArray:
        """(3,) indices of the parameters that are the root's position x, y, z, m, world frame."""
        return np.array([self.index(f"pelvis_t{axis}") for axis in "xyz"])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints (all parameters but the root's), in order."""
        return tuple(self.parameter_names[i] for i in self.joints)

    def index(self, parameter: str) -> int:
        """Index of a named parameter.

        Raises:
            BodyModelError: there is no such parameter.
        """
        try:
            return self.parameter_names.index(parameter)
        except ValueError:
            raise BodyModelError(f"body {self.name} has no parameter {parameter!r}") from None
