"""Verb `report`."""

import json
import shutil
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.cli.report import _levels
from markerless_tracker.viewing.page.charts import Level


def test_a_page_from_the_results_own_source(tracked, walk: Path, tmp_path, capsys) -> None:
    pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    page = tmp_path / "new" / "page.html"
    words = ["report", f"{tracked}.trc", "-o", page, "--reference", walk / "ground_truth.trc"]
    capsys.readouterr()
    assert main([str(word) for word in [*words, "--json"]]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["page"] == str(page) and summary["bytes"] == page.stat().st_size < 5_000_000
    (found,) = summary["results"]
    assert found["film_frames"] == 6 and 0.0 < found["mean_mm"] < 60.0
    assert found["verdict"].startswith("One person was found and tracked in 6 of 6 frames")
    text = page.read_text(encoding="utf-8")
    assert "data:video/webm;base64," in text and "SPPSO, Lee walk: 38 mm" in text
    before = page.read_bytes()
    assert main([str(word) for word in words]) == 1
    assert "exists already, expected a new name or --force" in capsys.readouterr().err
    assert main([str(word) for word in [*words, "--force", "--no-film"]]) == 0
    assert capsys.readouterr().out.startswith(f"{page}: ")
    assert len(page.read_bytes()) < len(before)


def test_without_images_there_is_a_page_and_a_warning(tracked, walk, tmp_path, capsys) -> None:
    for ending in (".trc", ".json"):
        (tmp_path / f"moved{ending}").write_bytes(Path(f"{tracked}{ending}").read_bytes())
    data = json.loads((tmp_path / "moved.json").read_text(encoding="utf-8"))
    data["source"] = "/nowhere/walk"
    (tmp_path / "moved.json").write_text(json.dumps(data), encoding="utf-8")
    moved, page = str(tmp_path / "moved"), str(tmp_path / "page.html")
    assert main(["report", moved, str(tracked), "-o", page]) == 0
    assert "no film: /nowhere/walk: the images of the result" in capsys.readouterr().err
    assert "No film: /nowhere/walk" in Path(page).read_text(encoding="utf-8")


def test_what_cannot_be_reported_fails_in_one_line(tracked, walk, tmp_path, capsys) -> None:
    page = ["-o", str(tmp_path / "page.html")]
    for words, said in (
        ([str(tmp_path / "none")], "none.json"),
        ([str(tracked), "--source", str(tmp_path / "none")], "are not there"),
        ([str(tracked), "--no-film", "--source", "none"], "--source is given with --no-film"),
        ([str(tracked), "--markers", "pig"], "--markers is given without --reference"),
        ([str(tracked), *["--reference", "a.trc"] * 2], "--reference: got 2, expected one for all"),
        ([str(tracked), "--no-film", "--reference", str(tmp_path / "no.trc")], "no.trc"),
    ):
        capsys.readouterr()
        assert main(["report", *words, *page]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and said in err
    assert not (tmp_path / "page.html").exists()


def test_the_papers_levels() -> None:
    assert _levels() == [
        Level("SPPSO, Lee walk: 38 mm", 38.0),
        Level("H-MCPSO, S2 walk: 48 mm", 48),
    ]


def test_frames_after_the_time_was_set_back_are_named(tracked, tmp_path, capsys) -> None:
    later = tracked.with_name(f"{tracked.name}.2.trc")
    shutil.copy(tracked.with_name(f"{tracked.name}.trc"), later)
    try:
        assert main(["report", str(tracked), "--no-film", "-o", str(tmp_path / "page.html")]) == 0
        err = " ".join(capsys.readouterr().err.split())
        assert "the time was set back during the run" in err and f"{tracked.name}.2" in err
    finally:
        later.unlink()
