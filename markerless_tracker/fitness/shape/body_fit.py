"""Lengths and sections of a body, fitted together with its poses in several frames.

Silhouettes alone do not separate pose and body: a longer thigh looks like a bent knee, a deeper
chest like a trunk farther back. Priors separate them: lengths and sections vary little among people
of one stature. The outlines therefore get a small weight. All frames share one body.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import LengthPrior, Sizes
from markerless_tracker.fitness.contour import (
    ContourFrame,
    OutlineRows,
    add_pose_prior,
    eliminated,
    floor_rows,
    joined_rows,
    length_jacobian,
    normal_equations,
    outline_rows,
    pose_jacobian,
    solved,
    surface,
)
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M, RESIDUAL_SIGMA_M
from markerless_tracker.fitness.shape.sections import Sections
from markerless_tracker.geometry import FloatArray

ALONG = 9.0
"""Number of pieces of outline that count as one, since errors of sections extend along a limb."""
AMONG = 3.0
"""Number of frames that count as one independent frame."""
LIMB_OFFSET_SD_RATIO = 0.08
"""Standard deviation of limbs' offsets among people, relative to the generic radius, if poses are
fitted, too. With a larger one the sections of thighs, calves and feet would be fitted beside the
line of the joints, and bent knees would be too straight."""
AGREEING_SD_M = 0.007
"""Standard deviation of a view's residuals up to which all views have the same weight. Views of a
camera with a worse calibration or worse silhouettes have larger residuals and a smaller weight."""
_STEP = 1e-4
"""Change of a log length in the finite differences."""
_LONGEST_STEP = 0.1
"""Largest change of a log length in one iteration."""
_DAMPING = 1e-3
_MEDIAN_TO_SD = 1.4826
"""Standard deviation over median absolute value, of Gaussian residuals."""


@dataclass(eq=False)
class _Frame:
    contours: ContourFrame
    pose: FloatArray


class BodyFit:
    """Fits one body to frames that are added one by one.

    Args:
        sizes: makes the body of other lengths.
        body: the initial body; the prior of the sections (`Sections`) follows from its lengths.
        belief: prior of the lengths.
        limits: (2, p) of the poses.
        varied: whether the frames show many poses. The offsets of limbs then have a narrower prior
            (`LIMB_OFFSET_SD_RATIO`), and cameras whose outlines disagree with the body have less
            weight (`AGREEING_SD_M`).
        floor_precision: of each part below z = 0 (`contour.floor`), 1 / m²; 0 for no floor.
    """

    def __init__(
        self,
        sizes: Sizes,
        body: BodyModel,
        belief: LengthPrior,
        limits: FloatArray,
        *,
        varied: bool = False,
        floor_precision: float = 0.0,
    ) -> None:
        self._sizes = sizes
        self._belief = belief
        self._limits = limits
        self._lengths = np.log(sizes.of(body))
        self._like = sizes.body(np.exp(self._lengths))
        self._varied = varied
        self._floor_precision = floor_precision
        self._sections = Sections(self._like, LIMB_OFFSET_SD_RATIO if varied else None)
        self._numbers = self._sections.prior_mean
        self._frames: list[_Frame] = []
        self._view_sd_m: dict[str, float] = {}

    @property
    def body(self) -> BodyModel:
        """The present body."""
        return self._made(self._lengths)

    @property
    def poses(self) -> FloatArray:
        """(n, p) the present poses of the frames."""
        return np.array([frame.pose for frame in self._frames])

    def add(self, contours: ContourFrame, pose: FloatArray) -> None:
        """Add a frame: its contours and its approximate pose (p,)."""
        self._frames.append(_Frame(contours, pose))

    def pieces(self, truncation_m: float) -> Iterator[None]:
        """One damped Gauss-Newton step of lengths, sections and all poses, in pieces.

        Each piece makes one frame's equations. They are solved when the iterator is resumed after
        the last piece. Frames that are added meanwhile take part.

        The poses are eliminated first (Schur complement), since only the body couples them
        (docs/normal-equations.md). Equations that cannot be solved change nothing.

        Args:
            truncation_m: residuals beyond this distance are outliers.
        """
        body = self.body
        longer = [self._made(self._lengths + step) for step in _STEP * np.eye(len(self._lengths))]
        hessian, gradient = self._prior()
        parts = []
        spreads: dict[str, list[float]] = {}
        for frame in self._frames:
            own, pull = self._equations(frame, body, longer, truncation_m, spreads)
            parts.append(eliminated(own, pull, body.size, hessian, gradient))
            yield
        self._view_sd_m = {name: float(np.mean(values)) for name, values in spreads.items()}
        hessian[np.diag_indices_from(hessian)] *= 1.0 + _DAMPING
        step = solved(hessian, gradient)
        if not np.isfinite(step).all():
            return
        split = len(self._lengths)
        step[:split] = np.clip(step[:split], -_LONGEST_STEP, _LONGEST_STEP)
        numbers = np.clip(self._numbers + step[split:], *self._sections.bounds)
        step[split:] = numbers - self._numbers
        self._lengths, self._numbers = self._lengths + step[:split], numbers
        for frame, part in zip(self._frames, parts, strict=True):
            moved = frame.pose - part @ np.append(step, 1.0)
            frame.pose = np.clip(moved, *self._limits)

    def _made(self, log_lengths: FloatArray) -> BodyModel:
        sized = self._sizes.body(np.exp(log_lengths), self._like)
        return self._sections.put(sized, self._numbers)

    def _prior(self) -> tuple[FloatArray, FloatArray]:
        """Normal equations of the priors of lengths and sections."""
        sections, split = self._sections, len(self._lengths)
        size = split + sections.size
        hessian, gradient = np.zeros((size, size)), np.zeros(size)
        hessian[:split, :split] = self._belief.precision
        gradient[:split] = self._belief.precision @ (self._lengths - self._belief.mean)
        rest = np.arange(split, size)
        hessian[rest, rest] = 1.0 / sections.prior_sd**2
        gradient[split:] = (self._numbers - sections.prior_mean) / sections.prior_sd**2
        return hessian, gradient

    def _equations(
        self,
        frame: _Frame,
        body: BodyModel,
        longer: list[BodyModel],
        truncation_m: float,
        spreads: dict[str, list[float]],
    ) -> tuple[FloatArray, FloatArray]:
        """One frame's normal equations (p + k, p + k) and (p + k,): its pose, then the body.

        Adds the standard deviation of each view's residuals, m, to `spreads`.
        """
        frame.contours.collect(frame.pose, truncation_m, body)
        outline = outline_rows(frame.contours)
        trust = self._trust(outline, frame.contours.views.names, spreads)
        weight = trust * outline.weight / (CORRELATION_M * RESIDUAL_SIGMA_M**2 * ALONG * AMONG)
        floor = floor_rows(body, frame.pose, self._floor_precision / AMONG)
        rows = joined_rows(replace(outline, weight=weight), floor)
        points = surface(body, frame.pose, rows)
        by_length = length_jacobian(longer, frame.pose, rows, points, _STEP)
        by_pose = pose_jacobian(body, frame.pose, rows)
        by_section = self._sections.jacobian(body, frame.pose, rows)
        jacobian = np.concatenate([by_pose, by_length, by_section], axis=1)
        hessian, gradient = normal_equations(jacobian, rows.weight, rows.value)
        precision = 1.0 / (AMONG * body.prior_sd**2)
        off = frame.pose - body.prior_mean
        add_pose_prior(hessian, gradient, precision, off, damping=_DAMPING)
        return hessian, gradient

    def _trust(
        self, rows: OutlineRows, names: Sequence[str], spreads: dict[str, list[float]]
    ) -> FloatArray:
        """Factor (n,) of each residual's weight: at most 1, less in views that disagree.

        A view's standard deviation is that of all frames in the last step; in the first step, that
        of the frame. It is computed from the median, which few outliers do not change.
        """
        if not self._varied:
            return np.ones(len(rows.view))
        factor = np.ones(len(names))
        for view, name in enumerate(names):
            values = np.abs(rows.value[rows.view == view])
            if values.size == 0:
                continue
            sd_m = _MEDIAN_TO_SD * float(np.median(values))
            spreads.setdefault(name, []).append(sd_m)
            sd_m = self._view_sd_m.get(name, sd_m)
            factor[view] = (AGREEING_SD_M / max(sd_m, AGREEING_SD_M)) ** 2
        return np.asarray(factor[rows.view])
