"""A made-up person as a small recording folder, with its truth."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import MarkerTrack, new_recording
from markerless_tracker.synthesis import SyntheticScene

FRAMES = 6


@pytest.fixture(scope="session")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames at 30 Hz in four lossless views, `ground_truth.trc` beside them."""
    scene = SyntheticScene(
        body="balan31", motion="walk", size_px=(192, 144), fps=30.0, seed=4, noise=2.0
    )
    folder = tmp_path_factory.mktemp("made-up") / "walk"
    truth = MarkerTrack(
        MARKER_NAMES,
        np.array([scene.stamp_ns(i) for i in range(FRAMES)]),
        np.stack([scene.markers(i) for i in range(FRAMES)]),
    )
    with new_recording(folder, scene.rig, scene.fps, lossless=True) as recording:
        for name, images in scene.backgrounds(6).items():
            recording.write_background(name, images)
        for i in range(FRAMES):
            recording.write(scene.frame(i)[0])
        recording.write_truth(truth)
    return folder


@pytest.fixture(scope="session")
def search() -> dict[str, Any]:
    """Every setting of a quick search."""
    return {
        "body": "balan31",
        "optimizer": "sppso",
        "evaluations": 1000,
        "refinement": "contour",
        "refine_iterations": 3,
        "fit_shape": True,
        "prediction": 0.6,
        "sigma_scale": 0.5,
        "edge_weight": 0.5,
        "edge_rule": "outline",
        "limits": "anatomical",
        "collision": "elliptic",
        "seed": 1,
        "threads": 1,
    }
