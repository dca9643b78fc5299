"""Makes searchers with the cameras and the settings that are in use."""

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.threads import mapper
from markerless_tracker.libraries import usable_cores
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.search import Searcher, make_searcher


class Searchers:
    """Makes the searchers of a tracker.

    Args:
        rig: the cameras.
        config: the settings.

    Attributes:
        rig, config: those of the next searcher; they may be replaced.
        mapper: `map`, or one that uses threads; for the cameras.
    """

    def __init__(self, rig: CameraRig, config: TrackerConfig) -> None:
        self.rig, self.config = rig, config
        self._threads = config.threads or usable_cores()
        # One thread is reserved for the evidence of the next set.
        self._near_threads = max(1, self._threads - 1)
        self.mapper = mapper(min(self._near_threads, len(rig)))

    def near(self, body: BodyModel) -> Searcher:
        """A searcher near a predicted pose."""
        return self._made(body, self._near_threads)

    def start(self, body: BodyModel) -> Searcher:
        """A searcher of an automatic start, which uses all threads."""
        return self._made(body, self._threads)

    def _made(self, body: BodyModel, threads: int) -> Searcher:
        return make_searcher(
            body, rig=self.rig, config=self.config, threads=threads, mapper=self.mapper
        )
