"""The estimate of the tracked person's body, and the schedule of its fits."""

from collections.abc import Generator, Mapping
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.shape.section_fit import (
    TRUNCATION_M,
    fit_shape,
    shape_fitting,
    unfitted,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.loss import LEAST_FIT, silhouette_fit
from markerless_tracker.tracking.person.body_fitting import BodyFitting, Unmeasured
from markerless_tracker.tracking.person.first_frame import StartMarkers, shape_of_first_frame
from markerless_tracker.tracking.person.later_fits import LaterFits
from markerless_tracker.tracking.person.varied import VariedFrames
from markerless_tracker.tracking.refinement import floor_precision
from markerless_tracker.tracking.search import FrameSearch, SearcherFor
from markerless_tracker.tracking.stages.frame import frame_stages

AWAY_S = 5.0
"""After this time without a person another one may come, with a body of other sizes."""
START_FRAMES = 30
"""Frames that may disagree with a given start pose before tracking begins without a fit."""
REVISION_STEPS = 4
"""Gauss-Newton steps of a revision, which begins with the present sections."""
PIECES = 2
"""Pieces of a revision that are computed in each tracked frame, so that no frame takes much longer
than others. A piece is the sums of one step over one frame."""

RECOVERED_FRAMES = 30
"""The lengths are fitted again if a limb is found elsewhere during a fit, or within this many
frames after it."""
MOST_RECOVERED = 6
"""Largest number of fits of the lengths that are made again for that reason."""


class BodyEstimate:
    """Estimate of the person's body: first its sections are fitted, then its lengths.

    Sections are fitted in one frame with the pose held, lengths over several tracked frames; an
    automatic start fits both to its own frames before that (`take_found`). With a given start,
    sections are revised when a tracked pose differs from those fitted to. A body that was not
    measured is fitted again when poses have become more varied. Only frames whose silhouettes agree
    with the body are used (f_s of at least `LEAST_FIT`). If a limb was in a wrong place during a
    fit of the lengths, or shortly after it, they are fitted again. A fit in progress is completed
    first: while the generic body fits badly, limbs are found elsewhere often.

    Args:
        body: with generic sections, and lengths that were measured or follow from a stature.
        config: `fit_shape`, `fit_lengths` and the settings of the refinement.
        shape_known: whether the sections are the person's already.
        start_markers: the markers that a given start pose was computed from.
        person: what is known of a person whose lengths were not measured; None if they were.

    Attributes:
        generic: the body before any fit.
        body: the present estimate.
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

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings from the next fit on."""
        self._config = config

    def reset(self) -> None:
        """Return to the generic body."""
        self.body = self.generic
        self.sections_fitted = not self._fits_sections
        self.sized = None if self._person is None else self._person.sized
        self._first: tuple[Mapping[str, Observation], int, FloatArray] | None = None
        self._disagreeing = 0
        self._varied: VariedFrames | None = None
        self._revision: Generator[None, None, BodyModel] | None = None
        self._reported = False
        self._lengths: BodyFitting | None = None
        self._later: LaterFits | None = None
        self._since_fit = self._recovered = 0
        self._wrong_limb = False
        if self._person is not None and self._fits_lengths:
            self._begin_lengths(self._person)

    @property
    def _fits_lengths(self) -> bool:
        """Whether lengths that were not measured are fitted to tracked frames."""
        return self._fits_sections and self._config.fit_lengths

    def may_be_anothers(self, away_s: float) -> bool:
        """Whether a body that was not measured was found for a person who may not return.

        Args:
            away_s: time since the person was seen last.
        """
        person = self._person
        if person is None or away_s <= AWAY_S:
            return False
        fitted = self._fits_sections and self.sections_fitted
        return fitted or (person.sized is not None and self.sized is None)

    @property
    def unfitted(self) -> Unmeasured | None:
        """What is known of a person whose lengths an automatic start is to fit; else None."""
        fits = self._config.fit_lengths and not self.sections_fitted
        return self._person if fits else None

    @property
    def awaits_first_frame(self) -> bool:
        """Whether tracking from a given start waits for a frame to fit the sections to."""
        return not self.sections_fitted and self._disagreeing < START_FRAMES

    def fit_first_frame(
        self,
        searcher_for: SearcherFor,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        start: FloatArray,
    ) -> FloatArray | None:
        """Fit the sections to a frame, if its silhouettes agree with the body.

        They must agree at the start pose, or at the pose found by a search from there.

        Args:
            searcher_for: makes a searcher of a body.
            observations: the evidence.
            stamp_ns: its time.
            start: (p,) given pose.

        Returns:
            The pose (p,) that the sections were fitted at; None if the frame disagrees.
        """
        search = searcher_for(self.body).frame(observations, stamp_ns, start)
        if not _agrees(search):
            search.run(frame_stages(self.body, self._config, start, self.body.sigma))
        if not _agrees(search):
            self._disagreeing += 1
            return None
        return self._fit_sections(searcher_for, observations, stamp_ns, search.pose)

    def take_warnings(self) -> tuple[str, ...]:
        """Warnings that were not yet reported, one line each."""
        warn = not self.sections_fitted and self._disagreeing == START_FRAMES
        if not warn or self._reported:
            return ()
        self._reported = True
        return (
            f"start: the silhouettes of {START_FRAMES} frames disagree with the start pose; "
            "tracking goes on with the body's generic shape",
        )

    def take_found(self, body: BodyModel, *, settled: bool) -> None:
        """Take the body of an automatic start; with `settled` it has been fitted."""
        self.body = body
        if settled:
            self.sections_fitted, self.sized = True, None

    def fit_tracked_frame(
        self, search: FrameSearch, *, rotated: bool = False, recovered: bool = False
    ) -> FloatArray | None:
        """Use a tracked frame for what remains to be fitted, if it agrees with the body.

        Args:
            search: of the frame.
            rotated: whether another heading was found.
            recovered: whether a limb was found elsewhere, so that it was in a wrong place before.

        Returns:
            If `body` has changed: the difference (p,) of its poses from those of the former body.
        """
        if rotated:
            return self.restart_lengths()
        self._since_fit += 1
        if recovered:
            self._limb_was_wrong()
        agrees = _agrees(search)
        if agrees and self._later is not None:
            self._later.keep(search)
        if self._revision is not None:
            return self._continue(self._revision)
        if not agrees:
            return None
        if self.sections_fitted and self._lengths is None:
            self._revise(search)
            return None
        if not self.sections_fitted:
            frames = [(search.contours, search.pose)]
            self.body = fit_shape(self.body, frames, hands=self._config.fit_lengths)
            self.sections_fitted = True
            return np.zeros(self.body.size)
        assert self._lengths is not None and self._person is not None
        fitted = self._lengths.add(self.body, search.contours, search.pose)
        if fitted is None:
            return None
        self._lengths, self._since_fit = None, 0
        self.body = fitted.body
        if self._wrong_limb:
            self._fit_again(self._person)
        return fitted.moved

    def cameras_changed(self, searcher_for: SearcherFor) -> None:
        """Fit the body anew: lengths in the next frames, or sections in the same first frame.

        Args:
            searcher_for: makes a searcher of a body, with the new cameras.
        """
        if self._person is not None and self._fits_lengths:
            self._begin_lengths(self._person)
        elif self._first is not None:
            self._revision = None
            self._fit_sections(searcher_for, *self._first)

    def restart_lengths(self) -> FloatArray | None:
        """Restart the fit of an unmeasured body, which was fitted to poses with a wrong heading.

        Without fits of lengths the sections stay as the start found them.

        Returns:
            As `fit_tracked_frame`.
        """
        if self._person is None or not self._fits_lengths:
            return None
        sizes = self._person.sizes
        self.body = sizes.body(sizes.of(self.body))
        self._begin_lengths(self._person)
        return np.zeros(self.body.size)

    def _limb_was_wrong(self) -> None:
        """Fit the lengths again, if they are being fitted or were a short time ago.

        The frames that were kept for later fits are forgotten.
        """
        person = self._person
        if person is None or not self._fits_lengths:
            return
        if self._lengths is not None:
            self._wrong_limb = True
        elif self._since_fit <= RECOVERED_FRAMES and self._fit_again(person):
            return
        self._later, self._revision = LaterFits(person), None

    def _fit_again(self, person: Unmeasured) -> bool:
        """Begin a further fit of the lengths; returns False after too many of them."""
        if self._recovered == MOST_RECOVERED:
            return False
        self._recovered += 1
        self._begin_lengths(person)
        return True

    def _begin_lengths(self, person: Unmeasured) -> None:
        self._lengths = BodyFitting(person, self.limits, floor_precision(self._config))
        self._later, self._revision = LaterFits(person), None
        self._wrong_limb = False

    def _revise(self, search: FrameSearch) -> None:
        """Start a revision of the body, if this frame's pose differs from those fitted to."""
        if self._later is not None and self._later.due():
            self._revision = self._later.fit(search)
            return
        if self._varied is None or not self._varied.takes(search.pose, self.body):
            return
        self._revision = shape_fitting(
            self._varied.prior, self._varied.add(search.contours, search.pose), start=self.body,
            iterations=REVISION_STEPS, truncation_m=(TRUNCATION_M[1], TRUNCATION_M[1]),
            hands=self._config.fit_lengths,
        )  # fmt: skip

    def _continue(self, revision: Generator[None, None, BodyModel]) -> FloatArray | None:
        """Continue a revision; when it is complete, return as `fit_tracked_frame`."""
        try:
            for _ in range(PIECES):
                next(revision)
        except StopIteration as end:
            self._revision = None
            self.body = end.value
            return np.zeros(self.body.size)
        return None

    def warm_up(
        self,
        searcher_for: SearcherFor,
        observations: Mapping[str, Observation],
        pose: FloatArray,
    ) -> None:
        """Compile what the fits need; call `reset` then. Arguments as of `fit_first_frame`."""
        if self._fits_sections:
            self._fit_sections(searcher_for, observations, 0, pose)
        if self._lengths is not None:
            contours = searcher_for(self.body).frame(observations, 0, pose).contours
            self._lengths.warm_up(self.body, contours, pose)

    def _fit_sections(
        self,
        searcher_for: SearcherFor,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        pose: FloatArray,
    ) -> FloatArray:
        def contours(body: BodyModel, at: FloatArray) -> ContourFrame:
            return searcher_for(body).frame(observations, stamp_ns, at).contours

        self._first = observations, stamp_ns, pose
        self.body, pose = shape_of_first_frame(
            self.generic, pose, self._start_markers, contours, self._config, self.limits
        )
        # A body made with other lengths has the pose prior of all people, not this person's.
        known = self.generic
        self.body = replace(self.body, prior_mean=known.prior_mean, prior_sd=known.prior_sd)
        # The lengths from the first frame, all else generic.
        prior = unfitted(self.body, known)
        self.sections_fitted = True
        self._varied = VariedFrames(prior, contours(self.body, pose), pose)
        return pose


def _agrees(search: FrameSearch) -> bool:
    return silhouette_fit(search.terms().values()) >= LEAST_FIT
