"""The path of the reference markers of a recording."""

from pathlib import Path

import pytest

from markerless_tracker.datasets import existing_truth, truth_path
from markerless_tracker.errors import DatasetError


def test_the_truth_is_in_the_folder_of_a_recording_or_of_a_bag_file(tmp_path: Path) -> None:
    (tmp_path / "walk.mcap").touch()
    for source in (tmp_path, tmp_path / "walk.mcap"):
        assert truth_path(source) == tmp_path / "ground_truth.trc"
        with pytest.raises(DatasetError, match=f"{source.name}: no ground_truth.trc, expected"):
            existing_truth(source)
    (tmp_path / "ground_truth.trc").touch()
    assert existing_truth(tmp_path / "walk.mcap") == tmp_path / "ground_truth.trc"
