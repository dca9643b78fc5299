"""Objective at the reference pose compared with the objective at the result."""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, pose_from_markers
from markerless_tracker.body.start import POSE_MARKERS
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.fitness import Fitness
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackResult
from markerless_tracker.results.score import match_rows
from markerless_tracker.tracking import Tracker
from markerless_tracker.tracking.search import make_fitness


class TruthScore:
    """Compares f at the reference pose with f at the result, frame by frame.

    f is the objective that the search maximises: the mean over the views of f_s + edge_weight f_e,
    for both poses with the tracked body. A negative difference means that the model prefers a wrong
    pose, a positive one that the search missed a better pose. A lost tracker may also score above
    the truth, so the difference has to be read together with the error.

    Args:
        tracker: the tracker whose results are compared.
        reference: reference markers; rows are matched by time.
        stamps_ns: (n,) the stamps of all results to come, in order.

    Raises:
        DatasetError: the reference lacks a marker that every pose needs.
    """

    def __init__(
        self, tracker: Tracker, reference: MarkerTrack, stamps_ns: NDArray[np.int64]
    ) -> None:
        self._tracker = tracker
        self._reference = reference.with_pelvis()
        needed_m = self._reference.selected(POSE_MARKERS).positions_m
        self._known = np.asarray(np.isfinite(needed_m).all(axis=(1, 2)))
        blank = np.full((len(stamps_ns), 1, 3), np.nan)
        rows, of = match_rows(MarkerTrack(("none",), stamps_ns, blank), self._reference)
        self._row = {int(stamps_ns[r]): int(k) for r, k in zip(rows, of, strict=True)}
        self._fitness: Fitness | None = None
        self.differences: list[float] = []

    def add(self, result: TrackResult) -> None:
        """Add the next result; frames without a reference or a pose are left out."""
        row = self._row.get(result.stamp_ns)
        if row is None or result.pose is None or not self._known[row]:
            return
        markers_m = dict(zip(self._reference.names, self._reference.positions_m[row], strict=True))
        truth = pose_from_markers(self._tracker.body, markers_m)
        self.differences.append(self._f(truth, result) - self._f(result.pose, result))

    @property
    def mean(self) -> float:
        """Mean of f(truth) - f(result) over the frames; NaN without any."""
        return float(np.mean(self.differences)) if self.differences else float("nan")

    def _f(self, pose: FloatArray, result: TrackResult) -> float:
        fitness = self._fitness_of(self._tracker.body)
        terms = fitness.terms(fitness.lay_out(result.observations), pose).values()
        weight = self._tracker.config.edge_weight
        return float(np.mean([t.silhouette + weight * t.edges for t in terms]))

    def _fitness_of(self, body: BodyModel) -> Fitness:
        if self._fitness is None or self._fitness.body is not body:
            self._fitness = make_fitness(body, self._tracker.rig, self._tracker.config)
        return self._fitness
