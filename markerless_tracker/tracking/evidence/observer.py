"""The evidence of a frame: of the whole views, or near a predicted pose."""

from collections.abc import Mapping

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackState
from markerless_tracker.tracking.evidence.gather import EvidenceMaker
from markerless_tracker.tracking.evidence.prepared import SeenView
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.evidence.views import ViewWatch


class Observer:
    """Makes the evidence of a frame from its segmented views.

    Args:
        evidence: selects the person's parts of the silhouettes.
        views: decides which views are usable.
    """

    def __init__(self, evidence: EvidenceMaker, views: ViewWatch) -> None:
        self._evidence = evidence
        self._views = views

    def whole(self, segmented: Mapping[str, SeenView], stamp_ns: int, body: BodyModel) -> Seen:
        """The evidence of the whole views, of all that is in them."""
        observed = self._evidence.whole(segmented, stamp_ns)
        used, notes = self._views.usable(observed, body, None)
        return Seen(stamp_ns, observed, used, used, (*notes, *self._evidence.take_notes()))

    def near(
        self,
        segmented: Mapping[str, SeenView],
        stamp_ns: int,
        body: BodyModel,
        predicted: FloatArray,
        cameras: Mapping[str, CameraModel],
        state: TrackState,
    ) -> Seen:
        """The evidence of the person near a predicted pose.

        Args:
            segmented: by camera.
            stamp_ns: time of the views.
            body: the tracked body.
            predicted: (p,) its predicted pose.
            cameras: by name.
            state: of the track. A lost body decides no pixels, and an empty view is no fault then.
        """
        observed, left_out = self._evidence.gather(segmented, stamp_ns, body, predicted)
        expected = predicted if state is TrackState.TRACKING else None
        imaged, notes = self._views.usable(observed, body, expected)
        lost = state is TrackState.LOST
        used = imaged if lost else decide(imaged, cameras, body, predicted)
        notes += self._evidence.take_notes()
        return Seen(stamp_ns, observed, used, imaged, notes, left_out)
