"""Silhouettes of a synthetic person under disturbances of real rooms."""

from typing import Any

import numpy as np
import pytest

from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.synthesis import SyntheticScene

LEAST = 0.85


def overlap(**look: Any) -> float:
    """Mean IoU of two cameras at 0, 2 and 8 s."""
    scene = SyntheticScene(body="person31", cameras=2, fps=1.0, **look)
    segmenters = {n: Segmenter(n, learn_background(b)) for n, b in scene.backgrounds(10).items()}
    found = []
    for index in (0, 2, 8):
        images, masks, _ = scene.frame(index)
        for name, exact in masks.items():
            mask = segmenters[name].observe(images[name], scene.stamp_ns(index)).mask
            found.append((mask & exact).sum() / (mask | exact).sum())
    return float(np.mean(found))


@pytest.mark.parametrize(
    "look",
    [
        {},
        {"light": "drift"},
        {"light": "step"},
        {"noise": 8.0},
        {"grey": True},
        {"shadow": 0.6},
        {"grey": True, "dull": True},
    ],
    ids=["plain", "drift", "step", "noise", "grey", "hard shadow", "dull clothes on grey"],
)
def test_the_silhouette_stays_accurate(look: dict[str, Any]) -> None:
    assert overlap(**look) >= LEAST
