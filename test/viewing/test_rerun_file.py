"""The file for the Rerun viewer, read back."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.overlays import Overlays
from markerless_tracker.viewing.rerun_file import _curves, write_rrd


def test_the_sdk_is_named_where_it_is_missing(
    make_result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match="pip install rerun-sdk"):
        write_rrd(tmp_path / "a.rrd", read_result(make_result()))


def test_a_loss_breaks_the_curves_once(make_result) -> None:
    logged: list[tuple[str, str]] = []
    sdk = SimpleNamespace(Scalars=lambda value: "value", Clear=lambda recursive: "clear")
    stream = SimpleNamespace(log=lambda path, what: logged.append((path, what)))
    result = read_result(make_result(frames=8, lost=(0, 3, 4)))
    for row in range(len(result)):
        _curves(sdk, stream, result, row)
    for name in ("angles/knee_angle_l", "overlap/cam01", "sd_mm/LKnee"):
        found = [what for path, what in logged if path == name]
        assert found == ["value", "value", "clear", "value", "value", "value"]


def test_body_cameras_pictures_and_curves(make_result, walk: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install rerun-sdk")
    from rerun.chunk import RrdReader

    result = read_result(make_result(source=walk, lost=(3,)))
    images = ResultImages(result, width_px=96)
    path = tmp_path / "new" / "a.rrd"
    write_rrd(path, result, rig=images.rig, overlays=Overlays(result, images), rows=[0, 4])
    joints, entities = [], set()
    for chunk in RrdReader(str(path)).stream():
        entities.add(chunk.entity_path)
        if chunk.entity_path == "/world/body/joints":
            joints += chunk.to_record_batch().column("Points3D:positions").to_pylist()
    assert {
        "/world/floor",
        "/world/cameras/cam01",
        "/world/body/bones",
        "/world/cones/torso",
    } <= entities
    assert {"/angles/knee_angle_l", "/overlap/cam01", "/sd_mm/LKnee"} <= entities
    assert len(joints) == 5, "no body in the frame without a pose"
    np.testing.assert_allclose(joints[0], result.positions_m[0], atol=1e-5)
