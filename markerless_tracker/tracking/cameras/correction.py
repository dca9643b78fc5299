"""Corrects a camera whose silhouettes lie beside the body, as long as the person is tracked."""

from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.records import TrackResult
from markerless_tracker.tracking.cameras.check import CameraCheck, Shift
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.search import FrameSearch

_CHANGED_M = 0.010
"""A correction is replaced when a later estimate differs from it by this much, at the body."""


class CameraCorrection:
    """Corrects cameras that `CameraCheck` suspects, by the shift of their images.

    While either of two cameras may be the wrong one, each image is shifted by its share: the
    silhouettes agree, and the body is at most half as far off as with the wrong choice.

    A camera that was touched after its calibration shows the person beside where the others see
    it. A shift of the principal point explains most of that for a person who stays at about the
    same distance; a rotation cannot be told from it.

    Args:
        rig: the cameras as calibrated.
        config: `correct_cameras`, and what the check needs.

    Attributes:
        rig: the cameras as corrected so far.
    """

    def __init__(self, rig: CameraRig, config: TrackerConfig) -> None:
        self._calibrated = rig
        self._corrects = config.correct_cameras
        self._check = CameraCheck(rig, config)
        self.reset()

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings from the next frame on; whether cameras are corrected is none."""
        self._check.configure(config)

    def reset(self) -> None:
        """Return to the cameras as calibrated."""
        self._check.reset()
        self.rig = self._calibrated
        self._shifts_px: dict[str, tuple[float, float]] = {}

    def shifts(self) -> dict[str, Shift]:
        """By camera, its shift from the body as the others see it, as calibrated."""
        return {
            name: replace(shift, corrected=name in self._shifts_px)
            for name, shift in self._check.shifts().items()
        }

    def add(
        self,
        result: TrackResult,
        body: BodyModel,
        *,
        search: FrameSearch | None = None,
        late: bool = False,
        searched: bool = False,
    ) -> tuple[str, ...]:
        """Take a frame; returns a line for each camera whose correction has changed in `rig`.

        Arguments as of `CameraCheck.add`.
        """
        weighed = self._check.add(result, body, search=search, late=late, searched=searched)
        if not weighed or not self._corrects:
            return ()
        shares, shifts = self._check.shares, self._check.shifts()
        changed = [
            f"{name}: its image is as calibrated again"
            for name in self._shifts_px
            if name not in shares
        ]
        self._shifts_px = {n: shift for n, shift in self._shifts_px.items() if n in shares}
        for name, share in shares.items():
            shift = shifts[name]
            u, v = share * shift.px[0], share * shift.px[1]
            change_px = float(np.hypot(*np.subtract((u, v), self._shifts_px.get(name, (0.0, 0.0)))))
            if change_px * shift.m_per_px < _CHANGED_M:
                continue
            self._shifts_px[name] = (u, v)
            changed.append(
                f"{name}: silhouettes ({shift.px[0]:+.1f}, {shift.px[1]:+.1f}) px beside the body "
                f"as the other cameras see it: its image is shifted by ({u:+.1f}, {v:+.1f}) px"
            )
        if changed:
            self.rig = self._calibrated.shifted(self._shifts_px)
        return tuple(changed)
