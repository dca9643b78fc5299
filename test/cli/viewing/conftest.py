"""A tracked result."""

import json
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main


@pytest.fixture(scope="session")
def tracked(walk: Path, search, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """NAME of a tracked result of the recording `walk`."""
    folder = tmp_path_factory.mktemp("tracked")
    config = folder / "settings.yaml"
    quick = {**search, "evaluations": 200, "refinement": "none", "fit_shape": False}
    config.write_text(json.dumps(quick), encoding="utf-8")
    words = ["track", walk, "-o", folder / "out", "--config", config]
    assert main([str(w) for w in [*words, "--start", walk / "ground_truth.trc"]]) == 0
    return folder / "out"
