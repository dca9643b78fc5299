"""Statistics over the frames of a run, in constant memory."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.raster.bits import count_bits
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.results.verdict.beyond import Beyond
from markerless_tracker.results.verdict.frame_warnings import FrameWarnings, WarningKind
from markerless_tracker.results.verdict.histogram import Histogram
from markerless_tracker.results.verdict.static_silhouette import StaticSilhouette
from markerless_tracker.tracking.evidence.views import MOST_COVER

SAMPLES = 3
"""Number of frames whose silhouettes are kept."""
APART_NS = 500_000_000
"""Least time between them."""
_LEAST_VIEWS = 2
"""Least number of cameras with a silhouette in them."""


@dataclass
class Silhouettes:
    """Counts of one camera's silhouettes.

    Attributes:
        images: frames with an observation of the camera.
        empty: frames without any silhouette.
        full: frames whose silhouette covers more than `MOST_COVER` of the image.
    """

    images: int = 0
    empty: int = 0
    full: int = 0

    def add(self, observation: Observation) -> None:
        """Count an observation."""
        self.images += 1
        if not observation.mask_words.any():
            self.empty += 1
            return
        width, height = observation.size_px
        pixels = int(count_bits(observation.mask_words))
        self.full += pixels > MOST_COVER * width * height


@dataclass
class Stretch:
    """A period without a tracked person.

    Attributes:
        from_ns, to_ns: stamps of its first and last frame.
        frames: number of its frames; 0 if there is no such period.
    """

    from_ns: int = 0
    to_ns: int = 0
    frames: int = 0


@dataclass(eq=False)
class RunRecord:
    """Counts and medians of a run, and a few of its silhouettes.

    Attributes:
        rig: the cameras, as the tracker has them.
        frames: frames added.
        states: state -> frames.
        overlap: camera -> overlap (IoU) of its silhouette and the body, in frames with a pose.
        lost_limbs: limb -> tracked frames in which it was lost.
        lowest_m: height of the lowest marker, in tracked frames.
        silhouettes: camera -> counts of its silhouettes.
        samples: silhouettes of some frames, by camera.
        stretch: the longest period without a tracked person after the first tracked frame.
        before: the period before the first tracked frame.
        warnings: of the frames.
        body: the body of the last tracked frame; None before the first.
        static: static parts of the silhouettes.
        beyond: how far the silhouettes extend beyond the body.
    """

    rig: CameraRig
    frames: int = 0
    states: Counter[str] = field(default_factory=Counter)
    overlap: dict[str, Histogram] = field(default_factory=dict)
    lost_limbs: Counter[str] = field(default_factory=Counter)
    lowest_m: Histogram = field(default_factory=lambda: Histogram(-5.0, 5.0, 2000))
    silhouettes: dict[str, Silhouettes] = field(default_factory=dict)
    samples: list[Mapping[str, Observation]] = field(default_factory=list)
    stretch: Stretch = field(default_factory=Stretch)
    before: Stretch = field(default_factory=Stretch)
    warnings: FrameWarnings = field(default_factory=FrameWarnings)
    body: BodyModel | None = None

    def __post_init__(self) -> None:
        self.static, self.beyond = StaticSilhouette(self.rig), Beyond()
        self._current = Stretch()
        self._sampled_ns = 0

    def add(
        self, result: TrackResult, body: BodyModel, frame: int | None = None
    ) -> list[WarningKind]:
        """Take a frame; returns the kinds of warning that it is the first of.

        Args:
            result: of the frame.
            body: as tracked.
            frame: its number in the recording; None = as counted here.
        """
        number = self.frames if frame is None else frame
        self.frames += 1
        self.states[result.state.value] += 1
        for name, observation in result.observations.items():
            self.silhouettes.setdefault(name, Silhouettes()).add(observation)
        self._sample(result)
        if result.pose is not None:
            for name, overlap in result.iou.items():
                self.overlap.setdefault(name, Histogram(0.0, 1.0, 200)).add(overlap)
        if result.state is TrackState.TRACKING:
            self.body = body
            for name, covered in self.static.add(result, body).items():
                self.beyond.add(result, self.rig[name], covered)
            if result.markers_m is not None:
                self.lowest_m.add(float(result.markers_m[:, 2].min()))
            for name, limb in result.limbs.items():
                self.lost_limbs[name] += limb.state is TrackState.LOST
        self._follow(result)
        return self.warnings.add(number, result.warnings)

    @property
    def tracked(self) -> int:
        """Frames in which the person was tracked."""
        return self.states[TrackState.TRACKING.value]

    @property
    def median_overlap(self) -> dict[str, float]:
        """Camera -> median overlap in frames with a pose, in the rig's order."""
        return {n: self.overlap[n].median for n in self.rig.names if n in self.overlap}

    def _sample(self, result: TrackResult) -> None:
        if len(self.samples) == SAMPLES:
            return
        if self.samples and abs(result.stamp_ns - self._sampled_ns) < APART_NS:
            return
        seen = {n: o for n, o in result.observations.items() if o.mask_words.any()}
        if len(seen) >= _LEAST_VIEWS:
            self.samples.append(seen)
            self._sampled_ns = result.stamp_ns

    def _follow(self, result: TrackResult) -> None:
        if result.state is TrackState.TRACKING:
            self._current = Stretch()
            return
        begun = self._current.from_ns if self._current.frames else result.stamp_ns
        self._current = Stretch(begun, result.stamp_ns, self._current.frames + 1)
        if not self.tracked:
            self.before = self._current
        elif self._current.frames > self.stretch.frames:
            self.stretch = self._current
