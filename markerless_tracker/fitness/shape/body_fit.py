"""Lengths and sections of a body from several frames, their poses free along with them.

Silhouettes alone let a pose and a body trade against each other: a longer thigh and a bent knee,
a deeper chest and a trunk farther back. What holds them is what is known of people: lengths and
sections scatter by little about those of a stature, so the outlines are made to weigh little
against that. Frames differ, and where they do, one body has to explain them all.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import LengthPrior, Sizes
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.contour.outline_rows import outline_rows, pose_slopes, surface
from markerless_tracker.fitness.contour.row_kernels import eliminated, normal_equations, solved
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M, RESIDUAL_SIGMA_M
from markerless_tracker.fitness.shape.sections import Sections
from markerless_tracker.geometry import FloatArray

ALONG = 9.0
"""Sections are wrong along a whole limb: residuals agree over so many pieces of outline."""
AMONG = 3.0
"""And from frame to frame: so many frames tell what one would alone."""
_STEP = 1e-4
_LONGEST_STEP = 0.1
"""Of a length, as a share of it, in one iteration."""
_DAMPING = 1e-3


@dataclass(eq=False)
class _Frame:
    contours: ContourFrame
    pose: FloatArray


class BodyFit:
    """Fits one body to frames that are added as they come.

    Args:
        sizes: makes the body of other lengths.
        body: the body to begin with; its lengths' generic sections are believed in.
        belief: about the lengths.
        limits: (2, p) of the poses.
    """

    def __init__(
        self, sizes: Sizes, body: BodyModel, belief: LengthPrior, limits: FloatArray
    ) -> None:
        self._sizes = sizes
        self._belief = belief
        self._limits = limits
        self._lengths = np.log(sizes.of(body))
        self._like = sizes.body(np.exp(self._lengths))
        self._sections = Sections(self._like)
        self._numbers = self._sections.generic
        self._frames: list[_Frame] = []

    @property
    def body(self) -> BodyModel:
        """The body as fitted so far."""
        return self._made(self._lengths)

    @property
    def poses(self) -> FloatArray:
        """(n, p) the poses of the frames as fitted so far."""
        return np.array([frame.pose for frame in self._frames])

    def add(self, contours: ContourFrame, pose: FloatArray) -> None:
        """Take a frame's contours and about its pose (p,)."""
        self._frames.append(_Frame(contours, pose))

    def iterate(self, truncation_m: float) -> None:
        """One damped Gauss-Newton step of lengths, sections and all poses.

        The poses are eliminated first (Schur complement): each meets the others only by the body.
        Equations that cannot be solved change nothing.

        Args:
            truncation_m: outline further than this from a silhouette's edge is an outlier.
        """
        body = self.body
        longer = [self._made(self._lengths + step) for step in _STEP * np.eye(len(self._lengths))]
        hessian, slope = self._believed()
        parts = []
        for frame in self._frames:
            own, pull = self._equations(frame, body, longer, truncation_m)
            parts.append(eliminated(own, pull, body.size, hessian, slope))
        hessian[np.diag_indices_from(hessian)] *= 1.0 + _DAMPING
        step = solved(hessian, slope)
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

    def _believed(self) -> tuple[FloatArray, FloatArray]:
        """Normal equations of what is believed of lengths and sections."""
        sections, split = self._sections, len(self._lengths)
        size = split + sections.size
        hessian, slope = np.zeros((size, size)), np.zeros(size)
        hessian[:split, :split] = self._belief.precision
        slope[:split] = self._belief.precision @ (self._lengths - self._belief.mean)
        rest = np.arange(split, size)
        hessian[rest, rest] = 1.0 / sections.spread**2
        slope[split:] = (self._numbers - sections.generic) / sections.spread**2
        return hessian, slope

    def _equations(
        self, frame: _Frame, body: BodyModel, longer: list[BodyModel], truncation_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """One frame's normal equations (p + k, p + k) and (p + k,): of its pose, of the body."""
        frame.contours.collect(frame.pose, truncation_m, body)
        rows = outline_rows(frame.contours)
        points = surface(body, frame.pose, rows)
        by_length = [
            np.einsum("ni,ni->n", rows.gradient, surface(other, frame.pose, rows) - points) / _STEP
            for other in longer
        ]
        by_pose = pose_slopes(body, frame.pose, rows)
        by_section = self._sections.slopes(body, frame.pose, rows)
        slopes = np.column_stack([by_pose, *by_length, by_section])
        weight = rows.weight / (CORRELATION_M * RESIDUAL_SIGMA_M**2 * ALONG * AMONG)
        hessian, slope = normal_equations(slopes, weight, rows.value)
        usual = 1.0 / (AMONG * body.prior_sd**2)
        pose = np.arange(body.size)
        hessian[pose, pose] = (hessian[pose, pose] + usual + 1e-9) * (1.0 + _DAMPING)
        slope[pose] += usual * (frame.pose - body.prior_mean)
        return hessian, slope
