"""Fetching the demo's recording, without the network."""

import hashlib
import subprocess
import zipfile
from pathlib import Path

import pytest

from markerless_tracker.cli.demo import fetch
from markerless_tracker.errors import DatasetError

PREFIX = "Pose2Sim/Demo_SinglePerson/"


def make_wheel(folder: Path, names: list[str]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "pose2sim-0.10.49-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, f"content of {name}")
    return path


@pytest.fixture
def trusted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A small wheel in the cache whose checksum is the expected one."""
    wheel = make_wheel(
        tmp_path / "wheel",
        [
            f"{PREFIX}videos/cam01.mp4",
            f"{PREFIX}calibration/Calib.qca.txt",
            f"{PREFIX}calibration/extrinsics/cam01_ext.png",
            f"{PREFIX}calibration/intrinsics/int_cam01_img/cam01_01_int.jpg",
            f"{PREFIX}videos/../../../escaped.mp4",
            f"{PREFIX}Config.toml",
            "Pose2Sim/Demo_Batch/videos/cam01.mp4",
            "Pose2Sim/common.py",
        ],
    )
    monkeypatch.setattr(fetch, "SHA256", hashlib.sha256(wheel.read_bytes()).hexdigest())
    return wheel


def test_only_the_recording_is_unpacked(trusted: Path, tmp_path: Path) -> None:
    project = fetch.fetch_recording(tmp_path)
    found = {p.relative_to(project).as_posix() for p in project.rglob("*") if p.is_file()}
    assert found == {
        "videos/cam01.mp4",
        "calibration/Calib.qca.txt",
        "calibration/extrinsics/cam01_ext.png",
    }
    assert not list(tmp_path.parent.rglob("escaped.mp4"))


def test_nothing_is_downloaded_twice(
    trusted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = fetch.fetch_recording(tmp_path)
    monkeypatch.setattr(fetch, "download_wheel", None)
    assert fetch.fetch_recording(tmp_path) == project


def test_another_wheel_is_refused_and_removed(tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "wheel", [f"{PREFIX}videos/cam01.mp4"])
    with pytest.raises(DatasetError, match="SHA-256"):
        fetch.fetch_recording(tmp_path)
    assert not wheel.exists()
    assert not (tmp_path / "recording").exists()


def test_a_wheel_without_the_recording(trusted: Path, tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "other", ["Pose2Sim/common.py"])
    with pytest.raises(DatasetError, match="Demo_SinglePerson"):
        fetch.unpack(wheel, tmp_path / "recording")
    assert not (tmp_path / "recording").exists()


def test_no_index_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_pip(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        assert command[-1] == fetch.REQUIREMENT
        assert "--no-deps" in command
        return subprocess.CompletedProcess(command, 1, "", "WARNING: slow\nERROR: No matching\n")

    monkeypatch.setattr(subprocess, "run", no_pip)
    with pytest.raises(DatasetError, match=r"cannot be downloaded: ERROR: No matching$"):
        fetch.fetch_recording(tmp_path)
