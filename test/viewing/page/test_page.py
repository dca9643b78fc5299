"""The page: self-contained, whole, and true to the result."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import read_trc
from markerless_tracker.results.gait import Event, Gait
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.page.charts import Level
from markerless_tracker.viewing.page.embedded import embedded_film
from markerless_tracker.viewing.page.page import page
from markerless_tracker.viewing.page.report import make_report

VOID = {"meta", "link", "img", "path"}


class Reader(HTMLParser):
    """Checks that elements close in order; keeps texts and addresses."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [v or "" for k, v in attrs if k in ("src", "href", "poster", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert not reader.open
    return reader


def test_everything_is_in_the_page(make_result, walk: Path) -> None:
    pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    result = read_result(make_result(source=walk, lost=(3,)))
    film = embedded_film(result, ResultImages(result))
    assert film.frames == 6 and film.still[:2] == b"\xff\xd8"
    truth = read_trc(walk / "ground_truth.trc")
    report = make_report("walk <1>", result, reference=truth, film=film)
    text = page([report], levels=[Level("paper", 38.0)])
    reader = read(text)
    assert all(address.startswith("data:") for address in reader.addresses)
    assert len(reader.addresses) == 3 and not re.search(r"url\(|@import|<script", text)
    assert {"video", "svg", "table", "details"} <= set(reader.tags)
    assert reader.texts.count("walk <1>") >= 2, "title and heading"
    words = " ".join(reader.texts)
    assert "tracked in 5 of 6 frames (0.2 s at 30/s), 1 frame lost, cam02 fits worst" in words
    assert "paper" in words and "mean error, mm 0.0" in words.replace("  ", " ")
    for name in ("LKnee", "balan31", "numpy, version", "refine.truncation_m", "overlap, cam02"):
        assert name in reader.texts
    assert str(walk) in reader.texts, "the source"
    assert "arm flexion" in words and "arm_flex" not in words and "arm flex " not in words
    assert "nobody walks for a complete stride" in words


def test_several_results_stand_beside_each_other(make_result, walk: Path) -> None:
    truth = read_trc(walk / "ground_truth.trc")
    results = [read_result(make_result(name)) for name in ("one", "two")]
    moved = results[1].with_arrays(positions_m=results[1].positions_m + np.array([0.03, 0.0, 0.04]))
    reports = [
        make_report("one", results[0], reference=truth, why_no_film="no images"),
        make_report("two", moved, reference=truth, why_no_film="no images"),
    ]
    reader = read(page(reports))
    assert reader.tags.count("article") == 2 and "one, two" in reader.texts
    assert "one: 0.0 mm" in reader.texts and "two: 50.0 mm" in reader.texts
    at = reader.texts.index("mean error, mm")
    assert reader.texts[at + 1 : at + 3] == ["0.0", "50.0"]
    assert sum("No film: no images" in text for text in reader.texts) == 2


def test_a_run_that_found_nobody_and_one_without_frames(make_result) -> None:
    result = read_result(make_result(lost=tuple(range(6))))
    reader = read(page([make_report("nobody", result)]))
    assert "No person was found in 6 frames (0.2 s)." in reader.texts
    reader = read(page([make_report("empty", result.rows(slice(0, 0)))]))
    assert "The result has no frame." in reader.texts


def test_doubts_of_the_verdict_are_shown(make_result) -> None:
    verdict = {"doubts": ["cam01 & cam02 exchanged"], "worst_limb": "r_arm", "worst_limb_lost": 2}
    result = read_result(make_result(notes={"verdict": verdict}))
    reader = read(page([make_report("a", result)]))
    assert "cam01 & cam02 exchanged" in reader.texts
    assert any("the right arm was lost in 2 frames" in text for text in reader.texts)


@pytest.mark.parametrize(
    ("overlap", "words"),
    [
        ((0.94, 0.89, 0.94, 0.89), "the overlap of the cameras is 0.89 to 0.94,"),
        ((0.90, 0.91, 0.90, 0.90), "all cameras fit alike (overlap 0.90),"),
        ((0.90, 0.81, 0.92, 0.91), "cam02 fits worst (overlap 0.81),"),
        ((0.96,), "the overlap of the only camera is 0.96,"),
    ],
)
def test_cameras_fit_alike_only_where_their_overlap_is_alike(
    make_result, overlap: tuple[float, ...], words: str
) -> None:
    result = read_result(make_result())
    named = tuple(f"cam{number:02d}" for number in range(1, len(overlap) + 1))
    same = np.tile(overlap, (len(result), 1))
    report = make_report("a", result.with_arrays(overlap=same, camera_names=named))
    assert words in report.sentence()


def test_lines_break_where_rows_are_missing(make_result) -> None:
    rows = np.array([0, 1, 3, 4, 6, 7, 20, 21])
    result = read_result(make_result(frames=22)).rows(rows)
    text = page([make_report("a", result)])
    lines = re.findall(r'class="line [^"]*" d="([^"]*)"', text)
    assert len(lines) > 20
    for line in lines:
        # Single sets that the node skips break no line.
        assert line.count("M") == 2 and line.count("L") == len(rows) - 2


def test_the_duration_is_that_of_the_stamps(make_result) -> None:
    result = read_result(make_result(frames=22)).rows(np.array([0, 1, 2, 20]))
    assert "tracked in 4 of 4 frames (0.7 s at 30/s)" in make_report("a", result).sentence()


@pytest.mark.parametrize(("strikes", "said"), [(60, "Dotted: foot"), (700, "700 foot strikes")])
def test_a_long_walk_keeps_the_page_small(make_result, strikes: int, said: str) -> None:
    events = tuple(Event("left", True, k / 1e4, (0.0, 0.0, 0.0)) for k in range(strikes))
    report = make_report("a", read_result(make_result()))
    text = page([replace(report, gait=Gait(events, (), ()))])
    # One path in each chart of an angle, none in that of the overlap.
    charts = text.count("<svg") - 1
    assert said in text and text.count('class="mark left"') == (charts if strikes == 60 else 0)
    assert f"0.00, and {strikes - 50} more." in text
