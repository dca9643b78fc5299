"""Results read back from their files."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.errors import BodyModelError, DatasetError
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.journal import open_summary
from markerless_tracker.results.read import ResultReader, read_result
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.results.stored_result import stored_body, velocities
from markerless_tracker.tracking import TrackerConfig

BODY = load_body("person31", 1.81)
POSES = BODY.neutral + 0.2 * np.random.default_rng(3).normal(size=(8, BODY.size))
PERIOD_NS = 20_000_000


def frame(index: int, state: TrackState = TrackState.TRACKING) -> TrackResult:
    return TrackResult(
        stamp_ns=index * PERIOD_NS,
        state=state,
        pose=POSES[index],
        markers_m=markers(BODY, POSES[index]),
        fitness=1.25,
        iou={"cam01": 0.75},
        evaluations=1000,
        confidence=Confidence(np.full(BODY.size, 0.1), np.full((15, 3), 0.02), np.eye(6)),
    )


def write(name: Path, lost: tuple[int, ...] = (), **options: bool) -> Path:
    config = TrackerConfig.from_mapping({"body": "person31"})
    with ResultWriter(name, BODY, config, fps=50.0, source="walk", **options) as writer:
        for index in range(8):
            writer.add(frame(index, TrackState.LOST if index in lost else TrackState.TRACKING))
    return name


def test_everything_comes_back(tmp_path: Path) -> None:
    result = read_result(write(tmp_path / "a.walk", lost=(3,)))
    assert (len(result), result.source, result.fps) == (8, "walk", 50.0)
    assert result.marker_names == MARKER_NAMES
    assert result.parameter_names == BODY.parameter_names
    np.testing.assert_array_equal(result.tracked, np.arange(8) != 3)
    np.testing.assert_allclose(result.times_s, np.arange(8) * 0.02)
    held = result.tracked
    np.testing.assert_array_equal(result.parameters[held], POSES[held])
    truth = np.array([markers(BODY, pose) for pose in POSES])
    np.testing.assert_allclose(result.positions_m[held], truth[held], atol=1e-6)
    np.testing.assert_allclose(result.position("LKnee")[0], truth[0, 10], atol=1e-6)
    np.testing.assert_allclose(result.sd("LKnee")[held], 0.02)
    assert result.camera_names == ("cam01",)
    np.testing.assert_array_equal(result.overlap[:, 0], np.where(held, 0.75, np.nan))
    np.testing.assert_array_equal(result.parameter("l_knee"), result.parameters[:, 9])
    for values in (result.positions_m, result.positions_sd_m, result.parameters):
        assert np.isnan(values[3]).all()
    np.testing.assert_allclose(markers(result.body(), POSES[0]), truth[0], atol=1e-12)
    for wrong in (result.position, result.sd, result.parameter, result.angle):
        with pytest.raises(DatasetError, match="no .* 'Nose', expected one of"):
            wrong("Nose")


def test_rows_of_lost_frames_are_blank_unless_kept(tmp_path: Path) -> None:
    assert np.isnan(read_result(write(tmp_path / "a", (3,)), keep_lost=True).positions_m[3]).all()
    kept = write(tmp_path / "b", (3,), keep_lost=True)
    assert np.isfinite(read_result(kept, keep_lost=True).positions_m[3]).all()
    assert np.isnan(read_result(kept).positions_m[3]).all()


def test_a_run_without_end_is_read_from_its_journal(tmp_path: Path) -> None:
    config = TrackerConfig.from_mapping({"body": "person31"})
    writer = ResultWriter(tmp_path / "out", BODY, config, fps=50.0)
    for index in range(5):
        writer.add(frame(index))
    result = read_result(tmp_path / "out")
    np.testing.assert_array_equal(result.parameters, POSES[:5])
    assert np.isfinite(result.positions_m).all()


def test_chunks_join_to_the_whole(tmp_path: Path) -> None:
    reader = ResultReader(write(tmp_path / "out", (3,)))
    parts = list(reader.chunks(3))
    assert [len(part) for part in parts] == [3, 3, 2]
    whole = read_result(tmp_path / "out.trc")
    joined = np.concatenate([part.positions_m for part in parts])
    np.testing.assert_array_equal(joined, whole.positions_m)


def test_a_summary_that_was_laid_out_anew_reads_the_same(tmp_path: Path) -> None:
    name = write(tmp_path / "out")
    path = name.with_suffix(".json")
    head, frames = open_summary(name)
    kept = list(frames)
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8"))), encoding="utf-8")
    again, more = open_summary(name)
    assert again == head and list(more) == kept and len(kept) == 8


def test_a_table_for_pandas(tmp_path: Path, monkeypatch) -> None:
    result = read_result(write(tmp_path / "out", (3,)))
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(DatasetError, match="pip install pandas"):
        result.to_pandas()
    monkeypatch.undo()
    pytest.importorskip("pandas", reason="pandas is not installed")
    table = result.to_pandas()
    assert list(table) == ["time", "joint", "x", "y", "z", "sd", "state", "filled"]
    knee = table[table.joint == "LKnee"]
    np.testing.assert_array_equal(knee[["x", "y", "z"]], result.position("LKnee"))
    assert knee.state.tolist() == result.states.tolist()


def test_velocities_follow_the_true_times() -> None:
    stamps = np.array([0, 20, 40, 100, 120]) * 1_000_000
    values = 3.0 * stamps[:, None] / 1e9
    found = velocities(stamps, values, 50.0)
    np.testing.assert_allclose(found[:, 0], 3.0)
    lone = velocities(stamps[[0, 3]], values[[0, 3]], 50.0)
    assert np.isnan(lone).all()
    values[1] = np.nan
    assert np.isnan(velocities(stamps, values, 50.0)[:2]).all()


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"none\.json: no such file"):
        read_result(tmp_path / "none")
    name = write(tmp_path / "out")
    text = name.with_suffix(".json").read_text(encoding="utf-8")
    broken = text.replace('"stamp_ns": 20000000', '"stamp_ns": "x"')
    name.with_suffix(".json").write_text(broken, encoding="utf-8")
    with pytest.raises(DatasetError, match="no `stamp_ns`"):
        read_result(name)


def changed(name: Path, change) -> Path:
    """The result with a changed summary."""
    path = name.with_suffix(".json")
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    return name


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda c: c["frames"].insert(0, 1), "frame 0: no `stamp_ns`"),
        (
            lambda c: c["frames"][2].update(parameters=[1.0, 2.0]),
            "frame at 40000000 ns is malformed: `parameters` has 2 values, expected 31",
        ),
        (lambda c: c["frames"][0].update(angles=3), "`angles` of the frame at 0 ns is 3, expected"),
        (lambda c: c["frames"][0].update(iou=5), "`iou` of the frame at 0 ns is 5, expected a map"),
        (lambda c: c["frames"][3].update(iou=[5]), r"`iou` of the frame at 60000000 ns is \[5\]"),
        (lambda c: c["frames"][3].update(markers_sd_mm=[5]), "`markers_sd_mm` of the frame at 6"),
        (lambda c: c["frames"][3].update(fitness=10**400), "frame at 60000000 ns is malformed: "),
        (lambda c: c["frames"][7].update(stamp_ns=10**30), "frame 7: `stamp_ns` is 10{30}, expect"),
        (lambda c: c.update(verdict={"overlap": 5}), "`verdict.overlap` is 5, expected a mapping"),
        (lambda c: c.update(verdict={"overlap": [[1]]}), r"`verdict.overlap` is \[\[1\]\], expect"),
    ],
)
def test_a_malformed_entry_is_named(tmp_path: Path, change, expected: str) -> None:
    expected = rf"out\.json: .*{expected}"
    with pytest.raises(DatasetError, match=expected):
        read_result(changed(write(tmp_path / "out"), change))


@pytest.mark.parametrize(("suffix", "text"), [(".json", '{"frames": '), (".jsonl", "")])
def test_a_file_nested_too_deep_is_named(tmp_path: Path, suffix: str, text: str) -> None:
    path = tmp_path / f"out{suffix}"
    path.write_text(text + "[" * 100_000 + "\n", encoding="utf-8")
    with pytest.raises(DatasetError, match=rf"out\{suffix}: no result of a tracker"):
        open_summary(tmp_path / "out")


def test_a_malformed_journal_is_named(tmp_path: Path) -> None:
    config = TrackerConfig.from_mapping({"body": "person31"})
    writer = ResultWriter(tmp_path / "out", BODY, config, fps=50.0)
    writer.add(frame(0))
    with (tmp_path / "out.jsonl").open("a", encoding="utf-8") as journal:
        journal.write("[1]\n")
    with pytest.raises(DatasetError, match=r"out\.jsonl: no result .*expected a JSON object"):
        read_result(tmp_path / "out")


def test_a_marker_file_without_a_rate(tmp_path: Path) -> None:
    path = write(tmp_path / "out").with_suffix(".trc")
    path.write_text(
        path.read_text(encoding="utf-8").replace("50\t50", "0\t50", 1), encoding="utf-8"
    )
    with pytest.raises(DatasetError, match=r"out\.trc: DataRate is 0.*, expected .* above 0"):
        read_result(tmp_path / "out")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda b: b["parameters"].pop(), "`body.parameters` has 30 names, expected the 31 of the"),
        (lambda b: b.pop("lengths_m"), "no `body.lengths_m`, expected the sizes"),
        (lambda b: b.update(lengths_m=[1.0]), r"`body.lengths_m` is \[1.0\], expected a mapping"),
        (lambda b: b.update(cones_m=3), "`body.cones_m` is 3, expected a mapping"),
        (lambda b: b.update(cones_m={"torso": "wide"}), "`body.cones_m` or `body.parameters` is"),
        (lambda b: b.update(cones_m={"torso": [[1], [2, 3]]}), "`body.cones_m` or `body.param"),
        (lambda b: b.update(cones_m={"torso": [[10**400] * 4] * 2}), "`body.cones_m` or `body."),
        (lambda b: b["lengths_m"].update(l_thigh=10**20), "subject walk: length l_thigh is 10{20}"),
    ],
)
def test_a_body_that_is_not_the_results(tmp_path: Path, change, expected: str) -> None:
    name = changed(write(tmp_path / "out"), lambda c: change(c["body"]))
    summary, _ = open_summary(name)
    with pytest.raises((BodyModelError, DatasetError), match=f"^result: {expected}"):
        stored_body(summary)
    with pytest.raises((BodyModelError, DatasetError), match=rf"^here: {expected}"):
        stored_body(summary, "here")


@pytest.mark.parametrize(
    ("settings", "expected"),
    [(5, "`settings` is 5, expected a mapping"), ({"body": "tail"}, "body 'tail' is unknown")],
)
def test_an_error_about_the_body_names_the_result(tmp_path: Path, settings, expected: str) -> None:
    name = changed(write(tmp_path / "out"), lambda c: c.update(settings=settings))
    expected = f"^{name.with_suffix('.json')}: {expected}"
    for found in (ResultReader(name), read_result(name).rows(slice(2))):
        with pytest.raises((BodyModelError, DatasetError), match=expected):
            found.body()


def test_closing_twice_leaves_the_files_as_they_are(tmp_path: Path) -> None:
    config = TrackerConfig.from_mapping({"body": "person31"})
    with ResultWriter(tmp_path / "out", BODY, config, fps=50.0) as writer:
        for index in range(3):
            writer.add(frame(index))
        writer.close()
        once = (tmp_path / "out.trc").read_bytes(), (tmp_path / "out.json").read_bytes()
    assert once == ((tmp_path / "out.trc").read_bytes(), (tmp_path / "out.json").read_bytes())
    assert len(read_result(tmp_path / "out")) == 3
