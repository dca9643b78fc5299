import json

import pytest

from markerless_tracker.benchmarks.silhouettes.generated import measure_generated
from markerless_tracker.cli.benchmark.silhouettes import generated_table
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis.scenes import DEVELOPMENT_SEEDS


def test_one_scene_with_its_motion_and_posture() -> None:
    done, pictures = [], []

    def picture(name):
        return lambda camera, frame, image: pictures.append((name, camera, frame))

    figures = measure_generated(
        "development", scenes=1, frames=1, picture=picture,
        progress=lambda count, total: done.append((count, total)),
    )  # fmt: skip
    assert done == [(1, 1)]
    (row,) = figures["scenes"]
    assert row["seed"] == figures["worst_seed"] == DEVELOPMENT_SEEDS[0]
    assert figures["iou_median"] == figures["iou_worst"] == figures["iou_mean"] == row["iou_mean"]
    both = 0.5 * (row["motion_iou"] + row["posture_iou"])
    assert row["iou_mean"] == pytest.approx(both) and 0.0 < both < 1.0
    assert set(figures["cameras"]) == {"cam01", "cam02", "cam03", "cam04"}
    assert {"iou", "precision", "recall", "shadow_leak", "ms"} <= set(figures["cameras"]["cam01"])
    assert set(figures["opencv"]) == {"mog2", "knn"}
    assert len(pictures) == 8 and len({name for name, _, _ in pictures}) == 2
    json.dumps(figures)
    assert generated_table(figures).row_count == 4


def test_an_unknown_set() -> None:
    with pytest.raises(ConfigError, match="'all', expected one of development, test"):
        measure_generated("all")
