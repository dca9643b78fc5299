"""A made-up walk as a recording, and the result of a perfect tracker on it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

SD_M = 0.02


@pytest.fixture(scope="session")
def seen() -> SyntheticScene:
    """The scene of the recording `walk`."""
    return SyntheticScene(
        body="balan31", motion="walk", size_px=(192, 144), fps=30.0, seed=4, noise=2.0
    )


@pytest.fixture
def make_result(seen: SyntheticScene, tmp_path: Path) -> Callable[..., Path]:
    """`make_result(name, frames=, lost=, source=, notes=)`: NAME of a result with exact poses."""

    def make(
        name: str = "out",
        *,
        frames: int = 6,
        lost: tuple[int, ...] = (),
        source: Path | str = "",
        notes: dict[str, Any] | None = None,
    ) -> Path:
        body, path = seen.body, tmp_path / name
        config = TrackerConfig.from_mapping({"body": "balan31"})
        sd = np.full((15, 3), SD_M)
        with ResultWriter(path, body, config, fps=30.0, source=str(source)) as writer:
            for index in range(frames):
                gone = index in lost
                pose = None if gone else seen.pose(index)
                writer.add(
                    TrackResult(
                        stamp_ns=seen.stamp_ns(index),
                        state=TrackState.LOST if gone else TrackState.TRACKING,
                        pose=pose,
                        markers_m=None if pose is None else markers(body, pose),
                        fitness=1.5,
                        iou={} if gone else {"cam01": 0.9, "cam02": 0.8},
                        evaluations=0,
                        confidence=None
                        if gone
                        else Confidence(np.full(body.size, 0.1), sd, np.eye(6)),
                    )
                )
            writer.note(notes or {})
        return path

    return make
