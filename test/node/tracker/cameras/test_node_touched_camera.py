"""A camera that was touched after its calibration, over the real middleware."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.camera import read_calibration, write_calibration
from markerless_tracker.viewing.corrected import as_corrected

OFF_PX = (-5.0, 3.0)
MOST_SETS = 200


def test_its_image_is_shifted_back_and_the_log_names_it(
    tmp_path: Path, begin: Any, world: Any
) -> None:
    rig = read_calibration(world.folder / "calibration.toml")
    write_calibration(tmp_path / "touched.toml", rig.shifted({"cam03": OFF_PX}))
    live = begin(calibration_file=tmp_path / "touched.toml", result_file=tmp_path / "walk")
    says = "as the other cameras see it: its image is shifted by (+"
    for _ in range(MOST_SETS):
        if says in live.process.output:
            break
        live.track()
    lines = [line for line in live.process.output.splitlines() if says in line]
    assert lines and "cam03: silhouettes (+" in lines[-1], live.process.output
    live.track()
    live.process.signal(signal.SIGINT)
    assert live.process.wait() == 0, live.process.output
    summary = json.loads((tmp_path / "walk.json").read_text())
    assert summary["scale"] == 1.0
    assert [name for name, one in summary["cameras"].items() if one["corrected"]] == ["cam03"]
    # So pictures of the result are drawn with the cameras as corrected.
    assert as_corrected(rig, rig, summary)["cam03"].matrix[0, 2] > rig["cam03"].matrix[0, 2]
