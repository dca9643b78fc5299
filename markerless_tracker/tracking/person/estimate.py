"""The body of the tracked person: what is known of it, and what is still to be fitted."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.person.body_fitting import BodyFitting, Unmeasured
from markerless_tracker.tracking.person.first_frame import (
    ContourMaker,
    StartMarkers,
    shape_of_first_frame,
)


class BodyEstimate:
    """A body that becomes the person's: first its sections, then its lengths are fitted.

    Sections are fitted in one frame with the pose held, lengths over several tracked frames.

    Args:
        body: with generic sections, and lengths that were measured or follow from a stature.
        config: `fit_shape`, `fit_lengths` and the settings of the refinement.
        shape_known: whether the sections are the person's already.
        start_markers: the markers that a given start pose was computed from.
        person: what is known of a person whose lengths were not measured; None if they were.

    Attributes:
        generic: the body before any fit.
        body: the body so far.
        limits: (2, p) its joint limits.
        sections_fitted: whether the sections are the person's, or are not to be fitted.
        sized: makes the body of a stature, m, while the stature is to be found; else None.
    """

    def __init__(
        self,
        body: BodyModel,
        config: TrackerConfig,
        *,
        shape_known: bool = False,
        start_markers: StartMarkers | None = None,
        person: Unmeasured | None = None,
    ) -> None:
        self.generic = body
        self.limits = joint_limits(body, config)
        self._config = config
        self._start_markers = start_markers
        self._person = person
        self._fits_sections = config.fit_shape and not shape_known
        self.reset()

    def reset(self) -> None:
        """Back to the generic body."""
        self.body = self.generic
        self.sections_fitted = not self._fits_sections
        self.sized = None if self._person is None else self._person.sized
        self._lengths: BodyFitting | None = None
        if self._person is not None and self._fits_sections and self._config.fit_lengths:
            self._lengths = BodyFitting(self._person, self.limits)

    def fit_first_frame(self, pose: FloatArray, contours: ContourMaker) -> FloatArray:
        """Fit the sections to a frame with the body at a pose (p,).

        Returns:
            The pose (p,) that they were fitted at: a noisy start is refined first.
        """
        self.body, pose = shape_of_first_frame(
            self.generic, pose, self._start_markers, contours, self._config, self.limits
        )
        self.sections_fitted = True
        return pose

    def take_found(self, body: BodyModel, *, settled: bool) -> None:
        """Take the body of an automatic start; once settled its sections are fitted."""
        self.body = body
        if settled:
            self.sections_fitted, self.sized = True, None

    def fit_tracked_frame(self, contours: ContourFrame, pose: FloatArray) -> FloatArray | None:
        """Use a tracked frame for the fit of the lengths, if they are still to be fitted.

        Args:
            contours: the frame's evidence.
            pose: (p,) tracked.

        Returns:
            Once `body` has changed: how far (p,) its poses lie from those tracked so far.
        """
        if self._lengths is None:
            return None
        fitted = self._lengths.add(self.body, contours, pose)
        if fitted is None:
            return None
        self._lengths = None
        self.body = fitted.body
        return fitted.moved

    def warm_up(self, pose: FloatArray, contours: ContourMaker) -> None:
        """Compile what the fits need; `reset` then."""
        if self._fits_sections:
            self.fit_first_frame(pose, contours)
        if self._lengths is not None:
            self._lengths.warm_up(self.body, contours(self.body, pose), np.asarray(pose))
