"""C3D files: those that are cut are refused before ezc3d reads them, which may hang on them."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets.markers.c3d import read_c3d
from markerless_tracker.errors import DatasetError

ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed (extra [formats])")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Five frames of twelve points."""
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = [f"M{number}" for number in range(12)]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 12, 5))
    points[:3] = np.random.default_rng(0).normal(0.0, 500.0, (3, 12, 5))
    content["data"]["points"] = points
    content.write(str(tmp_path / "trial.c3d"))
    return tmp_path / "trial.c3d"


def test_a_cut_file_is_refused(file: Path) -> None:
    assert read_c3d(file).positions_m.shape == (5, 12, 3)
    content = file.read_bytes()
    # Its last block is filled up behind the data.
    data = (int.from_bytes(content[16:18], "little") - 1) * 512
    for size in range(0, data + 5 * 12 * 16, 40):
        file.write_bytes(content[:size])
        with pytest.raises(DatasetError, match=f"{file}: cannot be read as C3D: ") as caught:
            read_c3d(file)
        assert size < 512 or f"{size} bytes, its header states at least" in str(caught.value)


def test_what_is_no_file_of_this_kind(file: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read: Is a directory"):
        read_c3d(tmp_path)
    with pytest.raises(DatasetError, match="cannot be read: No such file"):
        read_c3d(tmp_path / "none.c3d")
    file.write_bytes(b"\2" + file.read_bytes())
    with pytest.raises(DatasetError, match="cannot be read as C3D: no header of 512 bytes"):
        read_c3d(file)


def test_more_labels_than_points(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = ezc3d.c3d(str(file))
    content["parameters"]["POINT"]["LABELS"]["value"].append("NONE")
    monkeypatch.setattr(ezc3d, "c3d", lambda path: content)
    assert read_c3d(file).names == tuple(f"M{number}" for number in range(12))


def test_labels_beyond_the_first_field(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = ezc3d.c3d(str(file))
    point = content["parameters"]["POINT"]
    labels = point["LABELS"]["value"]
    point["LABELS"]["value"], point["LABELS2"] = labels[:8], {"value": labels[8:]}
    monkeypatch.setattr(ezc3d, "c3d", lambda path: content)
    assert read_c3d(file).names == tuple(f"M{number}" for number in range(12))
