"""Results while a run goes on: what is on disk after every frame, and after any end."""

import json
import os
import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body
from markerless_tracker.datasets import MarkerTrack, format_trc, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.results.journal import read_summary
from markerless_tracker.results.read import read_result
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.results.stored_result import result_names
from markerless_tracker.tracking import TrackerConfig

FRAME_NS = 16_666_667


@pytest.fixture(scope="module")
def body():
    return load_body("balan31", 1.7)


@pytest.fixture(scope="module")
def config():
    return TrackerConfig.from_mapping({"preset": "paper"})


def result(stamp_ns: int, value: float | None = 0.5, warnings: tuple[str, ...] = ()) -> TrackResult:
    """A frame whose every coordinate is `value`, or that has no estimate."""
    return TrackResult(
        stamp_ns=stamp_ns,
        state=TrackState.LOST if value is None else TrackState.TRACKING,
        pose=None if value is None else np.full(31, value),
        markers_m=None if value is None else np.full((15, 3), value),
        fitness=1.5,
        iou={},
        evaluations=10,
        warnings=warnings,
    )


def frames_of(path: Path) -> int:
    """NumFrames of a marker file's header."""
    return int(path.read_text().splitlines()[2].split("\t")[2])


@contextmanager
def disk_space(bytes_per_file: int) -> Iterator[None]:
    """Writes beyond that size of a file fail, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_per_file, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_every_frame_is_on_disk_at_once(tmp_path, body, config):
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    for number in range(1, 4):
        writer.add(result(number * FRAME_NS, warnings=(f"warning {number}",)))
        track = read_trc(tmp_path / "out.trc")
        assert len(track) == number and frames_of(tmp_path / "out.trc") == number
        summary = read_summary(tmp_path / "out")
        assert [frame["warnings"] for frame in summary["frames"]][-1] == [f"warning {number}"]
    assert not (tmp_path / "out.json").exists()
    writer.close()
    assert not (tmp_path / "out.jsonl").exists() and not list(tmp_path.glob("*.tmp"))
    assert read_summary(tmp_path / "out") == json.loads((tmp_path / "out.json").read_text())


def test_a_complete_file_has_the_bytes_of_a_file_written_at_once(tmp_path, body, config):
    stamps = [number * FRAME_NS for number in range(12)]
    values = [None if number in (0, 5) else number / 7.0 for number in range(12)]
    with ResultWriter(tmp_path / "out", body, config, fps=59.94) as writer:
        for stamp, value in zip(stamps, values, strict=True):
            writer.add(result(stamp, value))
    positions = [np.full((15, 3), np.nan if value is None else value) for value in values]
    track = MarkerTrack(MARKER_NAMES, np.array(stamps), np.array(positions))
    assert (tmp_path / "out.trc").read_text() == format_trc(track, 59.94, "out.trc")


def test_a_killed_process_leaves_all_it_had_written(tmp_path, body, config, project_root):
    code = (
        "import sys, pathlib, test_streaming as t\n"
        "from markerless_tracker.body import load_body\n"
        "name = pathlib.Path(sys.argv[1])\n"
        "writer = t.ResultWriter(name, load_body('balan31', 1.7), t.TrackerConfig(), fps=60.0)\n"
        "for number in range(30):\n"
        "    writer.add(t.result(number * t.FRAME_NS))\n"
        "print('written', flush=True)\n"
        "sys.stdin.read()\n"
    )
    paths = os.pathsep.join([str(project_root), str(Path(__file__).parent)])
    child = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "out")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert child.stdout is not None and child.stdin is not None
    assert child.stdout.readline() == b"written\n"
    child.send_signal(signal.SIGKILL)
    child.communicate()
    assert len(read_trc(tmp_path / "out.trc")) == 30 and frames_of(tmp_path / "out.trc") == 30
    summary = read_summary(tmp_path / "out")
    assert [frame["stamp_ns"] for frame in summary["frames"]] == [n * FRAME_NS for n in range(30)]
    assert "seed" in summary["settings"] and summary["body"]["name"] == "balan31"


def test_a_line_cut_by_the_end_of_the_process_is_left_out(tmp_path, body, config):
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    writer.add(result(0))
    writer.add(result(1))
    journal = tmp_path / "out.jsonl"
    journal.write_bytes(journal.read_bytes()[:-20])
    assert [frame["stamp_ns"] for frame in read_summary(tmp_path / "out")["frames"]] == [0]


@pytest.mark.parametrize("missing", [3, 60, 2000])
def test_a_result_that_was_cut_off_is_refused(tmp_path, body, config, missing):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        for number in range(20):
            writer.add(result(number))
    summary = tmp_path / "out.json"
    assert len(read_summary(tmp_path / "out")["frames"]) == 20
    summary.write_bytes(summary.read_bytes()[:-missing])
    with pytest.raises(DatasetError, match=r"out\.json: no result of a tracker \(.*cut off"):
        read_summary(tmp_path / "out")


def test_time_that_runs_backwards_begins_a_new_segment(tmp_path, body, config):
    stamps = [10, 20, 30, 20, 40, 40, 50]
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        for value, stamp in enumerate(stamps):
            writer.add(result(stamp, float(value)))
    tracks = [read_trc(tmp_path / f"out{part}.trc") for part in ("", ".2", ".3")]
    assert [track.stamps_ns.tolist() for track in tracks] == [[10, 20, 30], [20, 40], [40, 50]]
    np.testing.assert_array_equal(
        np.concatenate([track.positions_m[:, 0, 0] for track in tracks]), np.arange(7.0)
    )
    frames = json.loads((tmp_path / "out.json").read_text())["frames"]
    assert [frame["stamp_ns"] for frame in frames] == stamps
    assert [frame.get("segment", 1) for frame in frames] == [1, 1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize("suffix", [".trc", ".json"])
def test_an_interrupted_end_leaves_the_frames_and_no_temporary_file(
    tmp_path, body, config, monkeypatch, suffix
):
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        if Path(target).suffix == suffix:
            raise KeyboardInterrupt
        replace(source, target)

    monkeypatch.setattr(os, "replace", interrupted)
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    writer.add(result(10))
    with pytest.raises(KeyboardInterrupt):
        writer.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.jsonl", "out.trc"]
    assert len(read_trc(tmp_path / "out.trc")) == 1
    assert len(read_summary(tmp_path / "out")["frames"]) == 1


def test_an_earlier_result_stays_until_the_first_row(tmp_path, body, config):
    with ResultWriter(tmp_path / "out", body, config, fps=60.0) as writer:
        for stamp in (5, 1):
            writer.add(result(stamp, 1.0))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert "out.2.trc" in before
    ResultWriter(tmp_path / "out", body, config, fps=60.0).close()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    writer.add(result(7))
    assert read_trc(tmp_path / "out.trc").stamps_ns.tolist() == [7]
    # What is left of the earlier result must not be taken for this one's.
    assert [f["stamp_ns"] for f in read_summary(tmp_path / "out")["frames"]] == [7]
    assert not (tmp_path / "out.2.trc").exists()


@pytest.mark.parametrize("suffix", ["trc", "json", "jsonl", "subject.yaml"])
def test_an_earlier_result_is_not_replaced_unasked(tmp_path, body, config, suffix):
    (tmp_path / f"out.{suffix}").write_text("earlier")
    with pytest.raises(DatasetError, match=rf"out.{suffix}: exists already"):
        ResultWriter(tmp_path / "out", body, config, fps=60.0, overwrite=False)
    assert (tmp_path / f"out.{suffix}").read_text() == "earlier"


def test_a_full_disk_is_named_and_the_files_are_whole_up_to_there(tmp_path, body, config):
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    refused: list[DatasetError] = []
    with disk_space(40_000):
        for number in range(100):
            try:
                writer.add(result(number, 1.0 / 3.0))
            except DatasetError as error:
                refused.append(error)
        rows = len(read_trc(tmp_path / "out.trc"))
        assert 0 < rows == 100 - len(refused) == frames_of(tmp_path / "out.trc")
        assert len(read_summary(tmp_path / "out")["frames"]) == rows
        assert f"{tmp_path / 'out.jsonl'}: cannot be written: File too large" in str(refused[0])
        with pytest.raises(DatasetError, match=r"out\.jsonl: cannot be written"):
            writer.close()
    # There is room again: the next frame is written, and the summary says what is missing.
    assert len(read_summary(tmp_path / "out")["frames"]) == rows


def test_frames_after_a_full_disk_are_written_again(tmp_path, body, config):
    writer = ResultWriter(tmp_path / "out", body, config, fps=60.0)
    writer.add(result(0))
    with disk_space(100), pytest.raises(DatasetError, match="cannot be written"):
        writer.add(result(1))
    writer.add(result(2))
    writer.close()
    summary = read_summary(tmp_path / "out")
    assert [frame["stamp_ns"] for frame in summary["frames"]] == [0, 2]
    assert summary["not_written"] == 1
    assert read_trc(tmp_path / "out.trc").stamps_ns.tolist() == [0, 2]


def test_memory_does_not_grow_with_the_frames(tmp_path, body, config):
    writer = ResultWriter(tmp_path / "out", body, config, fps=None)
    for stamp in range(1500):
        writer.add(result(stamp))
    tracemalloc.start()
    try:
        held = tracemalloc.get_traced_memory()[0]
        for stamp in range(1500, 3500):
            writer.add(result(stamp))
        grown = tracemalloc.get_traced_memory()[0] - held
        tracemalloc.reset_peak()
        writer.close()
        peak = tracemalloc.get_traced_memory()[1] - held
    finally:
        tracemalloc.stop()
    assert (tmp_path / "out.json").stat().st_size > 1_000_000
    assert grown < 200_000 and peak < 300_000


@pytest.mark.parametrize(
    ("steps_ns", "fps"), [([], "60"), ([FRAME_NS] * 4 + [5 * FRAME_NS], "60"), ([40_000_000], "25")]
)
def test_a_live_rate_is_what_the_stamps_show(tmp_path, body, config, steps_ns, fps):
    with ResultWriter(tmp_path / "out", body, config, fps=None) as writer:
        for stamp in np.cumsum([0, *steps_ns]).tolist():
            writer.add(result(stamp))
    assert (tmp_path / "out.trc").read_text().splitlines()[2].startswith(f"{fps}\t{fps}\t")


def test_neither_summary_nor_journal(tmp_path):
    with pytest.raises(DatasetError, match=r"out\.json: no result of a tracker"):
        read_summary(tmp_path / "out")
    (tmp_path / "out.json").write_text("[]")
    with pytest.raises(DatasetError, match=r"out\.json: no result of a tracker"):
        read_summary(tmp_path / "out")


@pytest.mark.parametrize("earlier", [False, True])
def test_other_results_keep_their_files(tmp_path, body, config, earlier):
    """Someone names the takes walk, walk.2 and walk.4."""
    if earlier:
        with ResultWriter(tmp_path / "walk", body, config, fps=60.0) as writer:
            for stamp in (2, 1):
                writer.add(result(stamp))
        assert (tmp_path / "walk.2.trc").exists()
        (tmp_path / "walk.2.trc").unlink()
    others = [tmp_path / f"walk.{number}" for number in (2, 4)]
    for name in others:
        with ResultWriter(name, body, config, fps=60.0) as writer:
            writer.add(result(10))
    before = {path.name: path.read_bytes() for path in tmp_path.glob("walk.[24].*")}
    assert len(before) == 6
    ResultWriter(tmp_path / "walk", body, config, fps=60.0).close()
    with ResultWriter(tmp_path / "walk", body, config, fps=60.0) as writer:
        for stamp in (10, 20, 5, 15, 3):
            writer.add(result(stamp))
    assert {path.name: path.read_bytes() for path in tmp_path.glob("walk.[24].*")} == before
    # Their numbers are passed over.
    parts = [tmp_path / f"walk{part}.trc" for part in ("", ".3", ".5")]
    assert [read_trc(part).stamps_ns.tolist() for part in parts] == [[10, 20], [5, 15], [3]]
    assert [path.name for path in result_names(tmp_path / "walk")] == ["walk", "walk.3", "walk.5"]
    frames = read_summary(tmp_path / "walk")["frames"]
    assert [frame.get("segment", 1) for frame in frames] == [1, 1, 3, 3, 5]
    assert [len(read_result(part).stamps_ns) for part in parts] == [2, 2, 1]


def test_a_marker_file_that_is_no_part_of_a_result_is_kept(tmp_path, body, config):
    (tmp_path / "walk.2.trc").write_text("reference")
    with ResultWriter(tmp_path / "walk", body, config, fps=60.0) as writer:
        writer.add(result(10))
    assert (tmp_path / "walk.2.trc").read_text() == "reference"


def test_a_subject_file_beside_a_result_without_frames_is_kept(tmp_path, body, config):
    ResultWriter(tmp_path / "out", body, config, fps=60.0).close()
    (tmp_path / "out.subject.yaml").write_text("mine")
    with pytest.raises(DatasetError, match=r"out\.subject\.yaml: exists already"):
        ResultWriter(tmp_path / "out", body, config, fps=60.0, overwrite=False)
    assert (tmp_path / "out.subject.yaml").read_text() == "mine"


def test_a_result_without_frames_does_not_block_the_next_run(tmp_path, body, config):
    """A node that was stopped before the first image is started again."""
    name = tmp_path / "out"
    ResultWriter(name, body, config, fps=60.0, overwrite=False).close()
    with ResultWriter(name, body, config, fps=60.0, overwrite=False) as writer:
        writer.add(result(10))
    with pytest.raises(DatasetError, match="exists already"):
        ResultWriter(name, body, config, fps=60.0, overwrite=False)
