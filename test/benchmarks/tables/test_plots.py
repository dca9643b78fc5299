"""Pictures of the error over time."""

from pathlib import Path

import pytest

from markerless_tracker.benchmarks.tables.plots import write_plot
from markerless_tracker.errors import ConfigError

ROW = {"curve": {"s": [0.0, 0.5], "mean_mm": [10.0, 30.0]}, "mean_mm": 20.0}


def test_a_picture_with_a_line_per_row(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra [plots])")
    import cv2
    import numpy as np

    one, two = tmp_path / "new" / "one.png", tmp_path / "two.png"
    write_plot(one, "walk", [("sppso", ROW)])
    write_plot(two, "walk", [("sppso", ROW), ("apf", {**ROW, "mean_mm": 5.0})])
    images = [cv2.imread(str(path)) for path in (one, two)]
    assert images[0] is not None and images[0].shape == images[1].shape
    assert not np.array_equal(*images)


def test_without_matplotlib_the_message_names_the_extra(tmp_path: Path, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ConfigError, match=r"matplotlib is not installed.*\[plots\]"):
        write_plot(tmp_path / "x.png", "walk", [("sppso", ROW)])
