"""The verb `batch`: every recording once, whatever happens on the way."""

import csv
import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from markerless_tracker.cli.main import main

GOOD = ["a/one", "a/two", "b/three"]


def call(*words: object) -> int:
    return main(["batch", *map(str, words)])


def test_results_and_table_of_every_recording(trials, options, walk, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    assert call(trials, "-o", out, *options, "--jobs", 2) == 1
    text, err = capsys.readouterr()
    assert "4 recordings: 3 done (0 of them earlier), a person found in 3, 1 failed" in text
    assert "1 of 4 recordings failed, the first: b/broken: " in err and "cam02.mkv" in err
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["a/one", "a/two", "b/broken", "b/three"]
    assert rows["b/broken"]["status"] == "failed" and rows["b/broken"]["found"] == ""
    for name in GOOD:
        assert (rows[name]["found"], rows[name]["tracked"]) == ("True", "6")
        assert float(rows[name]["overlap"]) > 0.5 and rows[name]["disagree"] == ""
        assert (
            main(["evaluate", "--json", f"{out / name}.trc", str(walk / "ground_truth.trc")]) == 0
        )
        error_mm = json.loads(capsys.readouterr().out)["mean_mm"]
        assert float(rows[name]["mean_mm"]) == pytest.approx(error_mm, abs=0.006)
        assert f"{error_mm:.1f}" in text and rows[name]["reference_problem"] == ""
    assert "error mm" in text and rows["b/broken"]["mean_mm"] == ""
    assert sorted(p.name for p in (out / "b").iterdir()) == [
        "three.json", "three.subject.yaml", "three.trc",
    ]  # fmt: skip

    # As `track` does it.
    words = ["track", str(walk), "-o", str(tmp_path / "single"), *options[:2]]
    assert main([*words, "--start", str(walk / "ground_truth.trc")]) == 0
    alone, among = (
        path.read_text(encoding="utf-8").splitlines()[1:]
        for path in (tmp_path / "single.trc", out / "a" / "two.trc")
    )
    assert alone == among

    # Again: only the repaired recording is done.
    before = {name: (out / f"{name}.trc").stat().st_mtime_ns for name in GOOD}
    shutil.copy(walk / "cam02.mkv", trials / "b" / "broken")
    capsys.readouterr()
    assert call(trials, "-o", out, *options, "--jobs", 1, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["totals"] == {
        "recordings": 4, "done": 4, "found": 4, "earlier": 3, "failed": 0,
    }  # fmt: skip
    assert before == {name: (out / f"{name}.trc").stat().st_mtime_ns for name in GOOD}

    # Other settings replace nothing by themselves.
    assert call(trials, "-o", out, *options, "--seed", 9) == 1
    assert "one.trc: exists already and is of other settings" in capsys.readouterr().err
    assert before == {name: (out / f"{name}.trc").stat().st_mtime_ns for name in GOOD}
    assert not list((out / ".batch").glob(".partial-*"))


def test_errors_need_reference_markers(trials, options, walk, tmp_path, capsys) -> None:
    shutil.rmtree(trials / "b")
    (trials / "a" / "one" / "ground_truth.trc").unlink()
    words = [trials, "-o", tmp_path / "out", *options[:2], "--start", walk / "ground_truth.trc"]
    shutil.move(trials / "a" / "two", tmp_path / "two")
    assert call(*words) == 0
    assert "error mm" not in capsys.readouterr().out

    shutil.move(tmp_path / "two", trials / "a" / "two")
    (trials / "a" / "two" / "ground_truth.trc").write_text("broken", encoding="utf-8")
    assert call(*words, "--json", "--force") == 0
    out, err = capsys.readouterr()
    rows = {row["name"]: row for row in json.loads(out)["trials"]}
    assert rows["a/two"]["status"] == "done" and rows["a/two"]["tracked"] == 6
    assert rows["a/two"]["mean_mm"] is None
    assert "ground_truth.trc: " in rows["a/two"]["reference_problem"]
    assert "a/two: no error in mm: " in err


def test_a_batch_that_is_killed_goes_on_where_it_was(trials, options, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    shutil.rmtree(trials / "b" / "broken")
    words = ["batch", str(trials), "-o", str(out), *options, "--jobs", "1"]
    batch = subprocess.Popen(
        [sys.executable, "-m", "markerless_tracker", *words], stderr=subprocess.DEVNULL
    )
    record = out / ".batch" / "a" / "one.json"
    try:
        while not (record.exists() and "row" in record.read_text(encoding="utf-8")):
            assert batch.poll() is None
            time.sleep(0.01)
    finally:
        batch.send_signal(signal.SIGKILL)
        batch.wait()
    first = record.stat().st_mtime_ns
    capsys.readouterr()
    # The process that tracked ends with the batch; until then it holds nothing.
    assert main([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in summary["trials"]] == GOOD
    assert summary["trials"][0]["earlier"] and summary["totals"]["done"] == 3
    assert record.stat().st_mtime_ns == first
    # A result whose files are gone is not done.
    for file in (out / "a").glob("one.*"):
        file.unlink()
    assert main([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [row["earlier"] for row in summary["trials"]] == [False, True, True]
    assert {p.name for p in (out / "a").iterdir()} == {
        f"{name}.{suffix}" for name in ("one", "two") for suffix in ("trc", "json", "subject.yaml")
    }


def test_nobody_in_all_recordings(trials, options, tmp_path, capsys) -> None:
    shutil.rmtree(trials / "a")
    shutil.rmtree(trials / "b" / "broken")
    # Without the person: the empty scene as the masks.
    masks = tmp_path / "masks"
    from markerless_tracker.datasets import open_recording, write_image

    recording = open_recording(trials / "b" / "three")
    for camera in recording.rig:
        for index in range(6):
            empty = next(recording.frames()).images[camera.name][..., 0] * 0
            write_image(masks / camera.name / f"{index:06d}.png", empty)
    words = [trials, "-o", tmp_path / "out", *options[:2], "--masks", masks, "--jobs", 1]
    assert call(*words) == 3
    assert "no person was found in 1 of 1 recordings" in capsys.readouterr().err


def test_two_batches_do_not_write_to_one_folder(trials, options, tmp_path, capsys) -> None:
    records = tmp_path / "out" / ".batch"
    records.mkdir(parents=True)
    with (records / "lock").open("w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert call(trials, "-o", tmp_path / "out", *options) == 1
    assert "out: another batch is writing there" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--debug-images", "see"], "--debug-images see: is the same for all recordings"),
        (["--refine-calibration", "new.toml"], "--refine-calibration new.toml: is the same for"),
        (["--optimizer", "nonsense"], "nonsense"),
        (["--scheduler", "nonsense://x"], "scheduler nonsense://x: no answer"),
    ],
)
def test_mistakes_cost_no_time(trials, options, tmp_path, capsys, extra, message) -> None:
    if "--scheduler" in extra:
        pytest.importorskip("distributed", reason="distributed is not installed (extra [cluster])")
    assert call(trials, "-o", tmp_path / "out", *options, *extra) == 1
    err = capsys.readouterr().err
    assert message in err and err.splitlines()[-1].startswith("markerless_tracker: error: ")


@pytest.mark.parametrize("ending", ["trc", "json", "jsonl", "subject.yaml"])
def test_a_result_of_somebody_else_is_not_replaced(
    trials, options, tmp_path, capsys, ending: str
) -> None:
    (tmp_path / "out" / "a").mkdir(parents=True)
    mine = tmp_path / "out" / "a" / f"one.{ending}"
    mine.write_text("{}", encoding="utf-8")
    assert call(trials, "-o", tmp_path / "out", *options) == 1
    assert f"one.{ending}: exists already" in capsys.readouterr().err
    assert mine.read_text(encoding="utf-8") == "{}"
    assert os.listdir(tmp_path / "out" / "a") == [mine.name]


def test_a_calibration_of_somebody_else_is_not_replaced(trials, options, tmp_path, capsys) -> None:
    mine = tmp_path / "one.toml"
    mine.write_text("# mine", encoding="utf-8")
    words = ["-o", tmp_path / "out", *options, "--refine-calibration"]
    words.append(tmp_path / "{name}.toml")
    shutil.rmtree(trials / "b")
    shutil.rmtree(trials / "a" / "two")
    shutil.move(trials / "a" / "one", trials / "one")
    assert call(trials, *words) == 1
    assert "one.toml: exists already, expected a new name or --force" in capsys.readouterr().err
    assert mine.read_text(encoding="utf-8") == "# mine"


def test_a_refused_refinement_of_the_calibration_is_reported(
    trials, options, tmp_path, capsys
) -> None:
    shutil.rmtree(trials / "b")
    shutil.rmtree(trials / "a" / "two")
    shutil.move(trials / "a" / "one", trials / "one")
    words = [*options, "--refine-calibration", tmp_path / "{name}.toml", "--json"]
    assert call(trials, "-o", trials / "out", *words) == 0
    out, err = capsys.readouterr()
    (row,) = json.loads(out)["trials"]
    assert row["status"] == "done" and row["calibration_problem"].startswith("the person hardly")
    assert "one.toml: not written: the person hardly moves" in err
    assert not (tmp_path / "one.toml").exists()
