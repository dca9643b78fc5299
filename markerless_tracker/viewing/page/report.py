"""Content of the page for a result: its stored values and its comparison with a reference."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.records import TrackState
from markerless_tracker.results.comparison.measures import Measures, measures
from markerless_tracker.results.gait import Gait, gait
from markerless_tracker.results.score import Score, score
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.results.verdict.verdict import CLEARLY, fits_worst, limb_in_words


@dataclass(frozen=True, eq=False)
class Film:
    """A film and a still picture of it.

    Attributes:
        data: WebM.
        still: JPEG of a few frames, for paper.
        frames: pictures of the film.
    """

    data: bytes
    still: bytes
    frames: int


@dataclass(frozen=True, eq=False)
class Report:
    """A result on the page.

    Attributes:
        name: its heading.
        result: the result.
        score, measures: comparison with the reference; None without a reference.
        gait: gait parameters; None if the person does not walk.
        film: the film; None without images.
        why_no_film: why there is no film; empty with a film.
    """

    name: str
    result: StoredResult
    score: Score | None
    measures: Measures | None
    gait: Gait | None
    film: Film | None
    why_no_film: str = ""

    @property
    def verdict(self) -> Mapping[str, Any]:
        """The verdict in the result's files; {} if the run did not end."""
        found = self.result.summary.get("verdict")
        return found if isinstance(found, Mapping) else {}

    @property
    def tracked(self) -> int:
        """Frames in which the person was tracked."""
        return int(self.result.tracked.sum())

    @property
    def sd_mm(self) -> float:
        """Median over frames and markers of the root of the summed variances, mm."""
        sd = np.sqrt((self.result.positions_sd_m**2).sum(axis=2)) * 1000.0
        known = sd[np.isfinite(sd)]
        return float(np.median(known)) if known.size else math.nan

    @property
    def overlap(self) -> dict[str, float]:
        """Camera -> median overlap of its silhouette and the body."""
        columns = zip(self.result.camera_names, self.result.overlap.T, strict=True)
        return {
            name: float(np.nanmedian(values))
            for name, values in columns
            if np.isfinite(values).any()
        }

    def sentence(self) -> str:
        """The verdict in one sentence."""
        result, frames = self.result, len(self.result)
        if not frames:
            return "The result has no frame."
        seconds = duration_s(result)
        if not self.tracked:
            return f"No person was found in {frames} frames ({seconds:.1f} s)."
        words = [
            f"One person was found and tracked in {self.tracked} of {frames} frames "
            f"({seconds:.1f} s at {result.fps:g}/s)"
        ]
        for state in (TrackState.LOST, TrackState.SEARCHING):
            count = int((result.states == state.value).sum())
            if count:
                words.append(f"{count} {'frame' if count == 1 else 'frames'} {state.value.lower()}")
        if self.overlap:
            words.append(self._fits())
        limb = self.verdict.get("worst_limb")
        if limb:
            lost = self.verdict.get("worst_limb_lost")
            frames_lost = f"{lost} {'frame' if lost == 1 else 'frames'}"
            words.append(f"the {limb_in_words(limb)} was lost in {frames_lost}")
        else:
            words.append("no limb was lost" if self.verdict else "")
        if math.isfinite(self.sd_mm):
            words.append(f"the standard deviation of a joint is {self.sd_mm:.0f} mm (median)")
        return ", ".join(word for word in words if word) + "."

    def _fits(self) -> str:
        """How well the body fits the silhouettes of the cameras."""
        worst = fits_worst(self.overlap)
        least, most = min(self.overlap.values()), max(self.overlap.values())
        if worst:
            return f"{worst} fits worst (overlap {least:.2f})"
        if len(self.overlap) == 1:
            return f"the overlap of the only camera is {least:.2f}"
        if most - least < CLEARLY:
            return f"all cameras fit alike (overlap {least:.2f})"
        return f"the overlap of the cameras is {least:.2f} to {most:.2f}"


def duration_s(result: StoredResult) -> float:
    """Time from the first frame to the end of the last, s; 0 without frames."""
    if not len(result):
        return 0.0
    return float(result.times_s[-1] - result.times_s[0]) + 1.0 / result.fps


def make_report(
    name: str,
    result: StoredResult,
    *,
    reference: MarkerTrack | None = None,
    film: Film | None = None,
    why_no_film: str = "",
) -> Report:
    """Compare a result with a reference, and find its gait.

    Raises:
        DatasetError: result and reference have no marker or no time in common.
    """
    figures = more = None
    if reference is not None:
        # As `evaluate`: interpolated frames and those without a person are not compared.
        known = result.rows(result.tracked)
        track = known.markers()
        figures = score(track, reference, markers_sd_mm=1000.0 * known.positions_sd_m)
        more = measures(track, reference)
    return Report(name, result, figures, more, gait(result), film, why_no_film)
