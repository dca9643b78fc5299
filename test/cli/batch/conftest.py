"""A folder of small trials, and quick settings for them."""

import shutil
from pathlib import Path

import pytest
import yaml


@pytest.fixture
def trials(walk, tmp_path: Path) -> Path:
    """Three recordings that can be tracked and a broken one."""
    folder = tmp_path / "trials"
    for name in ("a/one", "a/two", "b/three", "b/broken"):
        shutil.copytree(walk, folder / name)
    (folder / "b" / "broken" / "cam02.mkv").write_bytes(b"broken")
    return folder


@pytest.fixture
def options(search, tmp_path: Path) -> list[str]:
    """Quick settings, and each recording's own start."""
    path = tmp_path / "settings.yaml"
    quick = {**search, "evaluations": 200, "refinement": "none", "fit_shape": False}
    path.write_text(yaml.safe_dump(quick), encoding="utf-8")
    return ["--config", str(path), "--start", "{source}/ground_truth.trc"]
