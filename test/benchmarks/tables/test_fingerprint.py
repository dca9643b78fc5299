"""Keys of stored runs."""

import os
from pathlib import Path

from markerless_tracker.benchmarks.tables.fingerprint import (
    code_files,
    file_key,
    recording_key,
    run_key,
)


def test_the_code_key_depends_on_every_source_and_body(project_root: Path) -> None:
    package = project_root / "markerless_tracker"
    names = {
        path.relative_to(package).as_posix() for path in code_files() if package in path.parents
    }
    assert names == {path.relative_to(package).as_posix() for path in package.rglob("*.py")}
    assert "tracking/tracker.py" in names
    bodies = {path.name for path in code_files() if path.suffix == ".yaml"}
    assert bodies == {path.name for path in (project_root / "config" / "bodies").iterdir()}


def test_a_run_key_depends_on_its_settings() -> None:
    assert run_key({"seed": 1, "body": "a"}) == run_key({"body": "a", "seed": 1})
    assert run_key({"seed": 1}) != run_key({"seed": 2})


def test_a_recording_key_depends_on_sizes_and_times(tmp_path: Path) -> None:
    file = tmp_path / "walk" / "cam01.mp4"
    file.parent.mkdir()
    file.write_bytes(b"one")
    os.utime(file, ns=(10**18, 10**18))
    key = recording_key(tmp_path / "walk")
    assert recording_key(tmp_path / "walk") == key
    os.utime(file, ns=(10**18, 10**18 + 1))
    assert recording_key(tmp_path / "walk") != key


def test_a_file_key_depends_on_the_content(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("same")
    (tmp_path / "b").write_text("same")
    assert file_key(tmp_path / "a") == file_key(tmp_path / "b") != file_key(tmp_path / "missing")
