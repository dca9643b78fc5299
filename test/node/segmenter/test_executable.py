"""The executable `segmenter`: a signal while it compiles, and images after that."""

import signal
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")


def test_a_signal_while_compiling_ends_it_at_once(
    other_domain: None, start: Any, tmp_path: Path
) -> None:
    picture = np.random.default_rng(0).integers(90, 110, (48, 64, 3), dtype=np.uint8)
    (tmp_path / "empty").mkdir()
    cv2.imwrite(str(tmp_path / "empty" / "cam01.png"), picture)
    process = start(
        "segmenter", environment={"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        camera="cam01", background_dir=tmp_path / "empty",
    )  # fmt: skip
    end_s = time.monotonic() + 120.0
    while "compiling" not in process.output:
        assert process.running and time.monotonic() < end_s, process.output
        time.sleep(0.05)
    used = process.shared_memory()
    process.signal(signal.SIGINT)
    assert process.wait() == 0, process.output
    assert "ready" not in process.output and "Traceback" not in process.output
    assert not [path for path in used if path.exists()]
