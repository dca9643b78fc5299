"""Builds the arrays of a `BodyModel` from a body's description and a subject's sizes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from markerless_tracker.body.description import BodyDescription, Move, parse_chain
from markerless_tracker.body.model import FIRST_TRANSLATION, MARKER_NAMES, SWING_X, BodyModel
from markerless_tracker.body.subject import Subject, fitted_lengths
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray

_AXES = "xyz"
_FIRST_KIND = {"r": 0, "t": FIRST_TRANSLATION, "s": SWING_X}
_PRIOR_SD_RAD = 0.6
"""Prior standard deviation of a joint for which the description states none."""


class _Nodes:
    """Node arrays, extended chain by chain."""

    def __init__(self, parameters: tuple[str, ...], lengths: Mapping[str, float]) -> None:
        self.parameters = parameters
        self.lengths = lengths
        self.parent: list[int] = []
        self.fixed: list[FloatArray] = []
        self.kind: list[int] = []
        self.sign: list[float] = []
        self.parameter: list[int] = []

    def append(self, parent: int, chain: tuple[Move, ...], where: str) -> int:
        """Append a frame; its last node carries the fixed moves after the last joint."""
        fixed = np.eye(4)
        for move in chain:
            if isinstance(move.argument, str) and move.argument in self.parameters:
                kind = _FIRST_KIND[move.kind[0]] + _AXES.index(move.kind[1])
                parent = self._node(
                    parent, fixed, kind, move.factor, self.parameters.index(move.argument)
                )
                fixed = np.eye(4)
            else:
                fixed = fixed @ self.constant(move, where)
        if parent < 0 or not np.array_equal(fixed, np.eye(4)):
            parent = self._node(parent, fixed, -1, 0.0, -1)
        return parent

    def place(self, chain: tuple[Move, ...], where: str) -> FloatArray:
        """The transform (4, 4) of a chain without parameters."""
        fixed = np.eye(4)
        for move in chain:
            fixed = fixed @ self.constant(move, where)
        return fixed

    def constant(self, move: Move, where: str) -> FloatArray:
        """The transform (4, 4) of a move by a number or a length."""
        if move.kind[0] == "s":
            raise BodyModelError(f"{where}: swings by {move.argument!r}, expected a parameter")
        value = (
            move.argument if isinstance(move.argument, float) else self.lengths.get(move.argument)
        )
        if value is None:
            raise BodyModelError(f"{where}: {move.argument!r} is neither a parameter nor a length")
        result = np.eye(4)
        axis = _AXES.index(move.kind[1])
        if move.kind[0] == "t":
            result[axis, 3] = move.factor * value
            return result
        if not isinstance(move.argument, float):
            raise BodyModelError(f"{where}: rotates by the length {move.argument!r}")
        i, j = (axis + 1) % 3, (axis + 2) % 3
        # Exact for multiples of 90 degrees.
        angle = move.factor * value
        cos, sin = np.round([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))], 15)
        result[i, i], result[i, j], result[j, i], result[j, j] = cos, -sin, sin, cos
        return result

    def _node(self, parent: int, fixed: FloatArray, kind: int, sign: float, parameter: int) -> int:
        self.parent.append(parent)
        self.fixed.append(fixed[:3])
        self.kind.append(kind)
        self.sign.append(sign)
        self.parameter.append(parameter)
        return len(self.parent) - 1


def build_body(description: BodyDescription, subject: Subject) -> BodyModel:
    """Build the model of a described body with a subject's sizes.

    Raises:
        BodyModelError: the description refers to an undefined name, or the subject lacks a length
            or names a cone that the body does not have.
    """
    d = description
    lengths = fitted_lengths(d, subject)
    parameters = tuple(d.parameters)
    nodes = _Nodes(parameters, lengths)
    frames: dict[str, int] = {"world": -1}
    for name, entry in d.frames.items():
        where = f"body {d.name}, frame {name}"
        chain = parse_chain(_get(entry, "chain", where), where)
        frames[name] = nodes.append(
            _look(frames, _get(entry, "parent", where), where), chain, where
        )
    del frames["world"]
    moving = set(nodes.parameter)
    idle = [name for i, name in enumerate(parameters) if i not in moving]
    if idle:
        raise BodyModelError(f"body {d.name}: no frame is moved by parameter {', '.join(idle)}")
    missing, extra = sorted(set(MARKER_NAMES) - set(d.markers)), set(d.markers) - set(MARKER_NAMES)
    if missing or extra:
        raise BodyModelError(
            f"body {d.name}: markers must be exactly {', '.join(MARKER_NAMES)}; "
            f"missing: {', '.join(missing) or 'none'}, others: {', '.join(sorted(extra)) or 'none'}"
        )

    marker_places = []
    for name in MARKER_NAMES:
        where = f"body {d.name}, marker {name}"
        place = nodes.place(parse_chain(d.markers[name].get("chain", ""), where), where)
        marker_places.append(
            (_look(frames, _get(d.markers[name], "frame", where), where), place[:3, 3])
        )

    unknown = sorted(set(subject.cones_m) - set(d.cones))
    if unknown:
        raise BodyModelError(
            f"subject {subject.name}: body {d.name} has no cone {', '.join(unknown)}"
        )
    cone_node, cone_fixed, cone_length, cone_shape, cone_edges = [], [], [], [], []
    for name, cone in d.cones.items():
        where = f"body {d.name}, cone {name}"
        cone_node.append(_look(frames, _get(cone, "frame", where), where))
        cone_fixed.append(nodes.place(parse_chain(cone.get("placement", ""), where), where)[:3])
        unit = _look(lengths, _get(cone, "length", where), where)
        cone_length.append(unit * float(cone.get("factor", 1.0)))
        shape = subject.cones_m.get(name)
        if shape is None:
            shape = unit * np.array(
                [_get(cone, "start", where), _get(cone, "end", where)], dtype=float
            )
        cone_shape.append(np.asarray(shape, dtype=float).reshape(2, 4))
        edges = cone.get("edges", ["sides"])
        cone_edges.append(["sides" in edges, "top" in edges])

    cones = {name: i for i, name in enumerate(d.cones)}
    index = {name: i for i, name in enumerate(parameters)}
    limits, walking, neutral = _limits(d)
    return BodyModel(
        name=d.name,
        parameter_names=parameters,
        node_parent=np.array(nodes.parent, dtype=np.int64),
        node_fixed=np.array(nodes.fixed),
        node_kind=np.array(nodes.kind, dtype=np.int64),
        node_sign=np.array(nodes.sign),
        node_parameter=np.array(nodes.parameter, dtype=np.int64),
        frames=frames,
        root_frame=d.root,
        sigma=np.array(
            [float(_get(v, "sigma", f"parameter {k}")) for k, v in d.parameters.items()]
        ),
        neutral=neutral,
        prior_mean=neutral
        + np.array(
            [np.deg2rad(float(v.get("prior_mean_deg", 0.0))) for v in d.parameters.values()]
        ),
        prior_sd=np.array(
            [
                np.inf if k in d.subspaces["root"] else float(v.get("prior_sd_rad", _PRIOR_SD_RAD))
                for k, v in d.parameters.items()
            ]
        ),
        limits=limits,
        walking_limits=walking,
        marker_node=np.array([node for node, _ in marker_places], dtype=np.int64),
        marker_offset=np.array([offset for _, offset in marker_places]),
        cone_names=tuple(d.cones),
        cone_node=np.array(cone_node, dtype=np.int64),
        cone_fixed=np.array(cone_fixed),
        cone_length=np.array(cone_length),
        cone_shape=np.array(cone_shape),
        cone_edges=np.array(cone_edges, dtype=np.bool_),
        collisions=np.array(
            [[_look(cones, name, "collisions") for name in pair] for pair in d.collisions],
            dtype=np.int64,
        ).reshape(-1, 2),
        subspaces={
            name: np.array([_look(index, p, f"subspace {name}") for p in members], dtype=np.int64)
            for name, members in d.subspaces.items()
        },
        hierarchies=d.hierarchies,
        lengths_m=lengths,
        measured=subject.measured,
    )


def _limits(d: BodyDescription) -> tuple[FloatArray, FloatArray, FloatArray]:
    neutral = np.array([np.deg2rad(float(v.get("neutral", 0.0))) for v in d.parameters.values()])
    limits = np.tile([[-np.inf], [np.inf]], (1, neutral.size))
    walking = limits.copy()
    for i, entry in enumerate(d.parameters.values()):
        if "limits" in entry:
            limits[:, i] = np.deg2rad(entry["limits"]) + neutral[i]
        if "walking" in entry:
            walking[:, i] = entry["walking"]
    wrong = (limits[0] >= limits[1]) | (walking[0] >= walking[1])
    if wrong.any():
        name = list(d.parameters)[int(wrong.argmax())]
        raise BodyModelError(f"body {d.name}: {name}: a lower limit is not below its upper limit")
    return limits, walking, neutral


def _get(entry: Any, key: str, where: str) -> Any:
    if not isinstance(entry, Mapping) or key not in entry:
        raise BodyModelError(f"{where}: needs {key!r}, got {entry!r}")
    return entry[key]


def _look(table: Mapping[str, Any], name: str, where: str) -> Any:
    if name not in table:
        raise BodyModelError(
            f"{where}: {name!r} is not defined (before it), known: {', '.join(table)}"
        )
    return table[name]
