"""Marker files: axes, units, times, blanks, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from markerless_tracker.datasets import MarkerTrack, format_trc, read_trc, write_trc
from markerless_tracker.errors import DatasetError

HEADER = (
    "PathFileType\t4\t(X/Y/Z)\tany.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
    "\tOrigNumFrames\n"
    "60\t60\t2\t2\tm\t60\t0\t2\n"
    "Frame#\tTime\tLHip\t\t\tRHip\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
)


def saved(folder: Path, text: str) -> Path:
    path = folder / "markers.trc"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_file_is_y_up_and_the_world_z_up(tmp_path: Path) -> None:
    path = saved(tmp_path, HEADER + "1\t0.0166666666666666\t1\t2\t3\t4\t5\t6\n")
    track = read_trc(path)
    assert track.names == ("LHip", "RHip")
    assert track.stamps_ns.tolist() == [16666667]
    assert track.positions_m.tolist() == [[[3.0, 1.0, 2.0], [6.0, 4.0, 5.0]]]


@pytest.mark.parametrize(
    ("unit", "factor"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), (" M ", 1.0), ("MM", 0.001)]
)
def test_units(tmp_path: Path, unit: str, factor: float) -> None:
    text = HEADER.replace("\tm\t", f"\t{unit}\t") + "1\t0\t1000\t2000\t3000\t0\t0\t0\n"
    position = read_trc(saved(tmp_path, text)).positions_m[0, 0]
    np.testing.assert_allclose(position, np.array([3000, 1000, 2000]) * factor)
    padded = text.replace("Units", "Units ")
    np.testing.assert_allclose(read_trc(saved(tmp_path, padded)).positions_m[0, 0], position)


@pytest.mark.parametrize("row", ["1\t0\t\t\t\t4\t5\t6", "1\t0\t1\tnan\t3\t4\t5\t6\t"])
def test_blank_cells_are_missing_markers(tmp_path: Path, row: str) -> None:
    positions = read_trc(saved(tmp_path, HEADER + row + "\r\n\n")).positions_m
    assert np.isnan(positions[0, 0]).all() and np.isfinite(positions[0, 1]).all()


@pytest.mark.parametrize("row", ["1\t0", "1\t0\t\t\t\t\t\t", "1\t0\t\t\t"])
def test_a_blank_row_is_kept(tmp_path: Path, row: str) -> None:
    track = read_trc(saved(tmp_path, HEADER + row + "\n2\t0.1\t1\t2\t3\t4\t5\t6\n"))
    assert len(track) == 2 and track.tracked.tolist() == [False, True]


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("", "line 1"),
        ("hello\n" + HEADER, "no TRC marker file: line 1 begins with 'hello'"),
        ("\n".join(HEADER.splitlines()[:3]), "ends after line 3"),
        (HEADER.replace("\tm\t", "\tfurlong\t"), "line 3.*furlong"),
        (HEADER.replace("Frame#", "Number"), "line 4"),
        (HEADER.replace("RHip", "LHip"), "line 4.*LHip"),
        (HEADER.replace("LHip\t\t\tRHip", "LHip\t\tRHip\t"), "line 4"),
        (HEADER + "1\t0\t1\t2\t3\t4\t5\t6\t7\n", "line 6.*columns"),
        (HEADER + "1\n", "line 6.*columns"),
        (HEADER + "1\t0\t1\t2\t3\t4\t5\tsix\n", "line 6.*'six'"),
        (HEADER + "1\tsoon\t1\t2\t3\t4\t5\t6\n", "line 6.*Time"),
        (HEADER + "1\tinf\t1\t2\t3\t4\t5\t6\n", "line 6.*Time"),
        (HEADER + "1\t1e99\t1\t2\t3\t4\t5\t6\n", "line 6.*Time"),
        (HEADER + "1\t1\t\n2\t0.5\t\n", "line 7.*is not later than"),
        (HEADER + "1\t1\t\n2\t1\t\n", "line 7.*is not later than"),
        (HEADER + "1\t1\t1\t2\t3\t4\t0.5", "line 6: ends after 7 of 8 columns, the file is cut"),
        (HEADER + "1\t1\t1\t2\t3.", "line 6: ends after 5 of 8 columns, the file is cut"),
    ],
)
def test_malformed_files_are_refused_by_line(tmp_path: Path, text: str, reported: str) -> None:
    path = saved(tmp_path, text)
    with pytest.raises(DatasetError, match=reported) as error:
        read_trc(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="none.trc: cannot be read"):
        read_trc(tmp_path / "none.trc")
    track = MarkerTrack(("A",), np.array([0]), np.zeros((1, 1, 3)))
    with pytest.raises(DatasetError, match="cannot be written"):
        write_trc(tmp_path / "no" / "where.trc", track, 60.0)


def test_the_header_and_the_blanks_of_a_written_file() -> None:
    positions = np.array([[[1.0, 2.0, 3.0], [np.nan] * 3], [[-1e-9, 0.5, 0.0], [4.0, 5.0, 6.0]]])
    track = MarkerTrack(("LHip", "RHip"), np.array([0, 33366667]), positions)
    lines = format_trc(track, 30000 / 1001, "walk.trc").splitlines()
    assert lines[2].split("\t") == ["29.97002997"] * 2 + ["2", "2", "m", "29.97002997", "1", "2"]
    assert lines[3].split("\t")[2::3] == ["LHip", "RHip", ""]
    assert lines[5] == "1\t0.000000000\t2.000000\t3.000000\t1.000000\t\t\t\t"
    assert lines[6].startswith("2\t0.033366667\t0.500000\t0.000000\t0.000000\t5.000000")


def test_line_1_names_the_file_and_nothing_depends_on_its_folder(tmp_path: Path) -> None:
    track = MarkerTrack(("A",), np.array([5]), np.ones((1, 1, 3)))
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "a.trc", tmp_path / "folder" / "a.trc", tmp_path / "b.trc"):
        write_trc(path, track, 60.0)
    first = (tmp_path / "a.trc").read_bytes()
    assert first.split(b"\n")[0] == b"PathFileType\t4\t(X/Y/Z)\ta.trc"
    assert (tmp_path / "folder" / "a.trc").read_bytes() == first
    assert (tmp_path / "b.trc").read_bytes() == first.replace(b"a.trc", b"b.trc")


@pytest.mark.parametrize("name", ["a\tb.trc", "a\nb.trc", "\udcff.trc", "a\u2028b.trc", ""])
def test_a_file_name_cannot_break_the_header(name: str) -> None:
    text = format_trc(MarkerTrack(("A",), np.array([0]), np.ones((1, 1, 3))), 60.0, name)
    assert len(text.encode("utf-8").decode("utf-8").splitlines()) == 6
    assert text.splitlines()[0].count("\t") == 3


def opensim_cells(line: str) -> list[str]:
    """The cells that OpenSim's TRC reader sees: an empty last one counts only if a tab ends it."""
    cells = line.split("\t")
    return cells if cells[-1] else cells[:-1]


@pytest.mark.parametrize("missing", [[], [0], [2], [0, 1, 2]])
def test_opensim_counts_every_cell_of_a_row_with_missing_markers(missing: list[int]) -> None:
    positions = np.ones((2, 3, 3))
    positions[1, missing] = np.nan
    track = MarkerTrack(("A", "B", "C"), np.array([0, 5]), positions)
    rows = format_trc(track, 60.0, "a.trc").splitlines()[5:]
    assert [len(opensim_cells(row)) for row in rows] == [2 + 3 * 3] * 2


@pytest.mark.parametrize("name", ["", "a\tb", "a\nb", " a"])
def test_names_that_would_break_the_file_are_refused(name: str) -> None:
    with pytest.raises(DatasetError, match="name"):
        format_trc(MarkerTrack((name,), np.array([0]), np.zeros((1, 1, 3))), 60.0, "a.trc")


names = st.lists(
    st.text(st.characters(codec="ascii", categories=["L", "N", "P"]), min_size=1, max_size=8),
    min_size=1,
    max_size=5,
    unique=True,
)
stamps = st.lists(st.integers(-(10**12), 9 * 10**18), max_size=6, unique=True).map(sorted)


@settings(max_examples=60)
@given(names, stamps, st.data())
def test_round_trip(tmp_path_factory, names, stamps, data) -> None:
    cells = st.one_of(st.floats(-1e4, 1e4), st.just(np.nan))
    shape = (len(stamps), len(names), 3)
    positions = data.draw(hnp.arrays(np.float64, shape, elements=cells))
    track = MarkerTrack(tuple(names), np.array(stamps, dtype=np.int64), positions)
    path = tmp_path_factory.mktemp("trc") / "round.trc"
    write_trc(path, track, 59.94)
    read = read_trc(path)
    assert read.names == track.names
    assert read.stamps_ns.tolist() == stamps
    np.testing.assert_allclose(read.positions_m, track.positions_m, atol=5.1e-7)
    again = path.with_name("again") / path.name
    again.parent.mkdir()
    write_trc(again, read, 59.94)
    assert again.read_bytes() == path.read_bytes()


@settings(max_examples=100)
@given(st.text(max_size=200))
def test_arbitrary_text_raises_only_our_errors(tmp_path_factory, tail: str) -> None:
    path = saved(tmp_path_factory.mktemp("hostile"), HEADER + tail)
    try:
        read_trc(path)
    except DatasetError as error:
        assert "\n" not in str(error)


def test_shared_references(balance_real: Path, render_walk: Path) -> None:
    balance = read_trc(balance_real / "ground_truth.trc")
    assert len(balance) == 100 and balance.stamps_ns[0] == 16666667 and len(balance.names) == 21
    walk = read_trc(render_walk / "ground_truth.trc")
    head = walk.positions_m[:, walk.names.index("Head"), 2]
    assert len(walk) == 220 and walk.stamps_ns[0] == 0 and (1.5 < head).all() and (head < 1.9).all()
