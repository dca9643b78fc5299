"""Decides which searches a frame gets in addition to the contour refinement."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.search import FrameSearch
from markerless_tracker.tracking.stages.frame import (
    contour_stage,
    frame_stages,
    rescue_stages,
)

WORSE = 0.01
"""A frame is explained badly if its f lies this far below the track's usual f."""
NEAR = 0.1
"""A pose is refined once more if a parameter has moved by more than this, rad or m."""
FAR_S = 0.045
"""Frames farther apart than this are all searched: a limb can be lost from each to the next."""
VERY_DENSE_S = 0.025
"""If frames follow each other faster than this, what one could not explain need not be searched
again in the next one."""
_MEMORY = 0.05
"""Weight of a frame in the running mean of the track's cost."""


class Effort:
    """Decides which frames are searched by swarms, and which by the limbs' searches.

    The refinement follows a body that moves as predicted. Swarms find what it has lost, so they are
    needed if a frame is explained worse than usual in this track, or if a limb is in doubt. With an
    effort below 1, frames explained as usual and without a limb in doubt get less: swarms and the
    limbs' searches alternate, and frames count as far apart only beyond `FAR_S` / effort. A search
    takes longer than `FAR_S`, so a tracker that is late would search every frame and remain late. A
    frame explained worse than usual gets all searches: a lost limb would cost many more.

    Args:
        needed_only: whether swarms search only the frames that need them; else all frames.
    """

    def __init__(self, *, needed_only: bool) -> None:
        self._needed_only = needed_only
        self.reset()

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings from the next frame on."""
        self._needed_only = config.refine.swarms == "needed"

    def reset(self) -> None:
        """Forget all frames."""
        self._usual_cost: float | None = None
        self._left_cost = 0.0
        self._credit = 0.0
        self._granted = True
        self._reduced = False
        self._limbs_frame = False
        self._swarms = False
        self._doubt = False
        self._badly = True
        self._allowed = True
        self._late = False
        self._very_dense = False

    def begin(self, effort: float, *, doubt: bool, since_s: float = 0.0) -> None:
        """Begin a frame.

        Args:
            effort: fraction of the frames explained as usual that may be searched in addition, 0 to
                1. With 0 no frame is.
            doubt: whether a limb is in doubt.
            since_s: time since the last frame.

        Raises:
            ConfigError: the effort is not between 0 and 1.
        """
        if not 0.0 <= effort <= 1.0:
            raise ConfigError(f"effort is {effort}, expected 0 to 1")
        self._credit = min(1.0, self._credit + effort)
        # Sums of fractions such as a tenth fall short of 1 by a rounding.
        far_s = FAR_S if doubt else FAR_S / max(effort, 1e-9)
        self._granted = self._credit > 1.0 - 1e-9 or (effort > 0.0 and since_s > far_s)
        if self._granted:
            self._credit = 0.0
            self._limbs_frame = not self._limbs_frame
        self._reduced, self._swarms = effort < 1.0 and not doubt, False
        self._doubt, self._allowed, self._late = doubt, effort > 0.0, effort < 1.0
        self._very_dense = since_s < VERY_DENSE_S

    @property
    def granted(self) -> bool:
        """Whether this frame may be searched in addition to the refinement."""
        return self._granted

    @property
    def badly(self) -> bool:
        """Whether this frame is explained worse than usual; valid after `judge`."""
        return self._badly

    @property
    def late(self) -> bool:
        """Whether the effort is below 1: sets come faster than they are tracked."""
        return self._late

    @property
    def reduced(self) -> bool:
        """Whether a frame gets a single search, by swarms or for limbs."""
        return self._reduced

    @property
    def for_limbs(self) -> bool:
        """Whether this frame may be searched by the limbs' searches; valid after `search`."""
        return self._granted and not (self._reduced and self._swarms)

    def search(
        self,
        search: FrameSearch,
        body: BodyModel,
        config: TrackerConfig,
        centre: FloatArray,
        sigma: FloatArray,
    ) -> None:
        """Search a frame with the stages of `frame_stages`, with swarms only if they are needed.

        Args:
            search: of the frame.
            body, config, centre, sigma: as for `frame_stages`.
        """
        if config.refinement == "none":
            search.run(frame_stages(body, config, centre, sigma))
            return
        begin = search.pose
        search.run((contour_stage("align", body, config, centre, sigma),))
        self.judge(search.cost)
        swarms = self._swarms = self.wants_swarms
        if swarms:
            search.run(rescue_stages(body, config, centre, sigma))
        # A refinement that moved the pose by little has converged.
        if swarms or float(np.abs(search.pose - begin).max()) > NEAR:
            search.run((contour_stage("polish", body, config, centre, sigma),))

    def judge(self, cost: float) -> None:
        """Grant all searches to a frame that is explained badly, unless the effort is 0.

        Args:
            cost: of the pose after the first refinement.
        """
        usual = self._usual_cost
        if usual is not None and self._very_dense:
            usual = max(usual, self._left_cost)
        self._badly = usual is None or cost > usual + WORSE
        if self._badly and self._allowed:
            self._granted, self._reduced, self._credit = True, False, 0.0

    @property
    def wants_swarms(self) -> bool:
        """Whether swarms search this frame; valid after `judge`."""
        if not self._granted or (self._reduced and self._limbs_frame):
            return False
        return self._badly or self._doubt or not self._needed_only

    def tracked(self, cost: float) -> None:
        """Add the cost of a frame in which the person was tracked to the running mean.

        What remains after all searches of a frame explained badly is usual for the frames that
        follow within `VERY_DENSE_S`: they would be searched in vain. It fades like the mean.
        """
        left, usual = self._left_cost, self._usual_cost
        if usual is None:
            self._usual_cost = cost
            return
        searched = self._badly and self._granted
        self._left_cost = max(cost, left, usual) if searched else left + _MEMORY * (cost - left)
        self._usual_cost = usual + _MEMORY * (cost - usual)
