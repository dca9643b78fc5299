"""What the key of a trial's result depends on."""

import argparse
import shutil
from pathlib import Path

import pytest

from markerless_tracker.cli.batch.plan import plan
from markerless_tracker.cli.batch.verb import add_arguments
from markerless_tracker.errors import ConfigError


@pytest.fixture
def key(walk, tmp_path: Path):
    """`key(*words)`: that of the recording's result with these options."""

    def run(*words: object) -> str:
        parser = argparse.ArgumentParser()
        add_arguments(parser)
        given = [str(walk), "-o", str(tmp_path / "out"), *map(str, words)]
        (trial,) = plan(parser.parse_args(given), {"walk": Path(walk)}, threads=1)
        return trial.key

    return run


def test_not_on_what_the_outputs_hold(key, tmp_path: Path) -> None:
    words = [
        "--debug-images",
        tmp_path / "{name}",
        "--refine-calibration",
        tmp_path / "{name}.toml",
    ]
    before = key(*words)
    (tmp_path / "walk").mkdir()
    (tmp_path / "walk" / "000000.png").write_bytes(b"a picture")
    (tmp_path / "walk.toml").write_text("refined", encoding="utf-8")
    assert key(*words) == before != key()


def test_not_on_results_in_the_recordings_folder(walk, tmp_path: Path) -> None:
    own = shutil.copytree(walk, tmp_path / "own")
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    arguments = parser.parse_args([str(own), "-o", str(own / "out")])
    (before,) = plan(arguments, {"own": own}, threads=1)
    (own / "out").mkdir()
    (own / "out" / "own.trc").write_text("a result")
    (after,) = plan(arguments, {"own": own}, threads=1)
    assert after.key == before.key


def test_a_result_named_like_the_table_is_refused(walk, tmp_path: Path) -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    arguments = parser.parse_args([str(walk), "-o", str(tmp_path / "out")])
    with pytest.raises(ConfigError, match="walk: a recording of the name summary, expected anoth"):
        plan(arguments, {"summary": Path(walk)}, threads=1)
    (trial,) = plan(arguments, {"a/summary": Path(walk)}, threads=1)
    assert trial.name == "a/summary"


def test_on_the_content_of_a_file_of_offsets(key, tmp_path: Path) -> None:
    path = tmp_path / "offsets.yaml"
    path.write_text("cam02: 0.05\n", encoding="utf-8")
    before = key("--time-offsets", path)
    assert key("--time-offsets", path) == before
    path.write_text("cam02: 0.5\n", encoding="utf-8")
    assert key("--time-offsets", path) != before
    assert key("--time-offsets", "cam02=0.5") != key("--time-offsets", "cam02=0.05")
