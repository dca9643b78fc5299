"""A result read back from its files: named arrays over time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, Subject, load_description
from markerless_tracker.body.build import build_body
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import BodyModelError, DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackState, locked
from markerless_tracker.results.target import segments

_PER_FRAME = (
    "stamps_ns", "states", "filled", "fitness", "positions_m", "positions_sd_m", "parameters",
    "parameters_sd", "angles_deg", "angles_sd_deg", "overlap",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StoredResult:
    """The result of a run of n frames; world frame (Z up), NaN = unknown.

    Attributes:
        source: what was tracked: the path of a recording, or `live`.
        fps: rate of the results, 1/s.
        summary: every entry of the JSON file but the frames: settings, versions, body, cameras.
        marker_names: (15,) names of the markers.
        parameter_names: (p,) names of the body's parameters.
        angle_names: (k,) names of the joint angles; none if the result has no angles.
        camera_names: (c,) names of the cameras that the body was compared with.
        stamps_ns: (n,) int64 stamps.
        states: (n,) SEARCHING, TRACKING or LOST.
        filled: (n,) whether the frame is interpolated (`track --fill-gaps`).
        fitness: (n,) fitness in [0, 2].
        positions_m: (n, 15, 3) positions of the markers in m.
        positions_sd_m: (n, 15, 3) their standard deviations along x, y, z in m.
        parameters: (n, p) the body's parameters in m and rad.
        parameters_sd: (n, p) their standard deviations.
        angles_deg: (n, k) joint angles in degrees.
        angles_sd_deg: (n, k) their standard deviations.
        overlap: (n, c) overlap (IoU) of each camera's silhouette and the body, 0 to 1.
        where: names the result in messages: the path of its JSON file.
    """

    source: str
    fps: float
    summary: Mapping[str, Any]
    marker_names: tuple[str, ...]
    parameter_names: tuple[str, ...]
    angle_names: tuple[str, ...]
    camera_names: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    states: NDArray[np.str_]
    filled: NDArray[np.bool_]
    fitness: FloatArray
    positions_m: FloatArray
    positions_sd_m: FloatArray
    parameters: FloatArray
    parameters_sd: FloatArray
    angles_deg: FloatArray
    angles_sd_deg: FloatArray
    overlap: FloatArray
    where: str = "result"

    def __post_init__(self) -> None:
        for name in _PER_FRAME:
            value = getattr(self, name)
            object.__setattr__(self, name, locked(value, value.dtype))

    def __len__(self) -> int:
        return int(self.stamps_ns.size)

    @property
    def times_s(self) -> FloatArray:
        """(n,) times in s."""
        return np.asarray(self.stamps_ns / 1e9, dtype=np.float64)

    @property
    def tracked(self) -> NDArray[np.bool_]:
        """(n,) whether the state is TRACKING."""
        return np.asarray(self.states == TrackState.TRACKING.value)

    def position(self, marker: str) -> FloatArray:
        """(n, 3) positions of a marker in m, world frame.

        Raises:
            DatasetError: there is no such marker.
        """
        return self.positions_m[:, _index(self.marker_names, marker, "marker")]

    def sd(self, marker: str) -> FloatArray:
        """(n, 3) standard deviations of a marker along x, y, z in m.

        Raises:
            DatasetError: there is no such marker.
        """
        return self.positions_sd_m[:, _index(self.marker_names, marker, "marker")]

    def parameter(self, name: str) -> FloatArray:
        """(n,) values of a parameter of the body, m or rad.

        Raises:
            DatasetError: there is no such parameter.
        """
        return self.parameters[:, _index(self.parameter_names, name, "parameter")]

    def angle(self, name: str) -> FloatArray:
        """(n,) a joint angle in degrees.

        Raises:
            DatasetError: there is no such angle.
        """
        return self.angles_deg[:, _index(self.angle_names, name, "angle")]

    def velocities_m_s(self) -> FloatArray:
        """(n, 15, 3) velocities in m/s, world frame: differences of the neighbouring frames.

        One-sided beside a frame without a pose; NaN where there is no neighbour within twice the
        period of the results.
        """
        return velocities(self.stamps_ns, self.positions_m, self.fps)

    def markers(self) -> MarkerTrack:
        """The positions as a track, as `read_trc` gives them."""
        return MarkerTrack(self.marker_names, self.stamps_ns, self.positions_m)

    def body(self) -> BodyModel:
        """The tracked body with the person's sizes.

        Raises:
            BodyModelError, DatasetError: the result's body is not described or cannot be loaded.
        """
        return stored_body(self.summary, self.where)

    def rows(self, rows: slice | NDArray[Any]) -> "StoredResult":
        """The result with those frames only."""
        return self.with_arrays(**{name: getattr(self, name)[rows] for name in _PER_FRAME})

    def with_arrays(self, **arrays: NDArray[Any]) -> "StoredResult":
        """The result with other arrays."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return StoredResult(**{**values, **arrays})

    def to_pandas(self) -> Any:
        """A tidy `pandas.DataFrame`: time, joint, x, y, z, sd (all in s and m), state, filled.

        World frame, Z up; `sd` is the root of the summed variances along x, y and z.

        Raises:
            DatasetError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise DatasetError("to_pandas needs pandas: pip install pandas") from error
        count, markers = len(self), len(self.marker_names)
        x, y, z = self.positions_m.reshape(-1, 3).T
        return pandas.DataFrame(
            {
                "time": np.repeat(self.times_s, markers),
                "joint": np.tile(self.marker_names, count),
                "x": x,
                "y": y,
                "z": z,
                "sd": np.sqrt((self.positions_sd_m**2).sum(axis=2)).reshape(-1),
                "state": np.repeat(self.states, markers),
                "filled": np.repeat(self.filled, markers),
            }
        )

    @classmethod
    def joined(cls, parts: Iterator["StoredResult"]) -> "StoredResult":
        """The frames of several parts of one result, in order.

        Raises:
            DatasetError: there is no part.
        """
        pieces = list(parts)
        if not pieces:
            raise DatasetError("the result has no frame")
        return pieces[0].with_arrays(
            **{
                name: np.concatenate([getattr(part, name) for part in pieces])
                for name in _PER_FRAME
            }
        )


def stored_body(summary: Mapping[str, Any], where: str = "result") -> BodyModel:
    """The body that a result's JSON file describes.

    Args:
        summary: the entries of the file.
        where: names the result in messages.

    Raises:
        BodyModelError: the body of its settings cannot be loaded or does not fit.
        DatasetError: there is no description, or it is malformed.
    """
    entry = summary.get("body")
    if not isinstance(entry, Mapping) or "lengths_m" not in entry:
        raise DatasetError(f"{where}: no `body.lengths_m`, expected the sizes of the tracked body")
    lengths_m, cones_m = entry["lengths_m"], entry.get("cones_m", {})
    settings = summary.get("settings") or {}
    tables = {"body.lengths_m": lengths_m, "body.cones_m": cones_m, "settings": settings}
    for key, table in tables.items():
        if not isinstance(table, Mapping):
            raise DatasetError(f"{where}: `{key}` is {table!r}, expected a mapping")
    name = settings.get("body") or entry.get("name")
    try:
        cones = {cone: np.array(shape, dtype=np.float64) for cone, shape in cones_m.items()}
        stored = tuple(entry.get("parameters", ()))
    except (TypeError, ValueError, OverflowError) as error:
        raise DatasetError(
            f"{where}: `body.cones_m` or `body.parameters` is not as the tracker writes it"
        ) from error
    try:
        subject = Subject(str(summary.get("source") or "tracked"), lengths_m, cones)
        body = build_body(load_description(str(name)), subject)
    except BodyModelError as error:
        raise BodyModelError(f"{where}: {error}") from error
    if stored != body.parameter_names:
        raise BodyModelError(
            f"{where}: `body.parameters` has {len(stored)} names, expected the {body.size} of "
            f"the body {name}: was the body's file changed?"
        )
    return body


def velocities(stamps_ns: NDArray[np.int64], values: FloatArray, fps: float) -> FloatArray:
    """Rates of change per second of values (n, ...) at stamps (n,); see `velocities_m_s`."""
    count = len(values)
    shape = (count,) + (1,) * (values.ndim - 1)
    before, after = np.full((2, *values.shape), np.nan)
    seconds = np.diff(stamps_ns) / 1e9
    near = (seconds <= 2.0 / fps).reshape((-1,) + (1,) * (values.ndim - 1))
    steps = np.where(near, np.diff(values, axis=0), np.nan)
    before[1:], after[:-1] = steps, steps
    since, until = np.zeros(shape), np.zeros(shape)
    since[1:, ...], until[:-1, ...] = seconds.reshape(near.shape), seconds.reshape(near.shape)
    total = np.nan_to_num(before) + np.nan_to_num(after)
    duration = np.where(np.isfinite(before), since, 0.0) + np.where(np.isfinite(after), until, 0.0)
    known = (duration > 0.0) & np.isfinite(values)
    return np.asarray(np.where(known, total / np.where(known, duration, 1.0), np.nan))


def _index(names: tuple[str, ...], name: str, kind: str) -> int:
    if name not in names:
        raise DatasetError(f"no {kind} {name!r}, expected one of {', '.join(names) or 'none'}")
    return names.index(name)


def set_back(name: Path, more: Sequence[Path]) -> str:
    """A line that says that a result has more parts than the one that is shown."""
    return (
        f"{name}: the time was set back during the run; shown until then, later frames are in "
        f"{', '.join(map(str, more))}"
    )


def result_names(name: Path) -> list[Path]:
    """NAME and NAME.2, NAME.3, ... of a result whose time was set back.

    Raises:
        DatasetError: there is no NAME.trc.
    """
    if not name.with_name(name.name + ".trc").exists():
        raise DatasetError(f"{name}.trc: no such file, expected the name of a result")
    return [name, *(path.with_suffix("") for path in segments(name))]
