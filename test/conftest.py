"""Fixtures for every room: recordings that may lie beside the project."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SHARED_DATA = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def project_root() -> Path:
    """Folder of the source tree."""
    return ROOT


def _recording(name: str) -> Path:
    folder = SHARED_DATA / name
    if not (folder / "calibration.toml").is_file():
        pytest.skip(f"the recording {name} is not on this machine (looked in {SHARED_DATA})")
    return folder


@pytest.fixture(scope="session")
def balance_real() -> Path:
    """Folder of a real recording, in the neutral layout."""
    return _recording("balance_real")


@pytest.fixture(scope="session")
def render_walk() -> Path:
    """Folder of a rendered recording with exact masks, in the neutral layout."""
    return _recording("render_walk")
