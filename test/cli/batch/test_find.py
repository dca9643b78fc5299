"""Which recordings a folder or a list holds, and their names."""

from pathlib import Path

import pytest

from markerless_tracker.cli.batch.find import find_recordings
from markerless_tracker.errors import DatasetError


def folder(path: Path) -> Path:
    """What is recognised as a recording folder."""
    path.mkdir(parents=True)
    (path / "calibration.toml").write_text("", encoding="utf-8")
    return path


def bag(path: Path, *names: str, described: bool = True) -> Path:
    """What is recognised as a bag."""
    path.mkdir(parents=True)
    if described:
        (path / "metadata.yaml").write_text("", encoding="utf-8")
    for name in names:
        (path / name).write_bytes(b"")
    return path


def test_a_folder_is_searched_to_any_depth(tmp_path: Path) -> None:
    walk, run = folder(tmp_path / "a" / "walk"), bag(tmp_path / "a" / "b" / "run", "run.mcap")
    folder(walk / "inside")
    folder(tmp_path / ".hidden" / "x")
    (tmp_path / "a" / "notes.txt").write_text("", encoding="utf-8")
    (tmp_path / "again").symlink_to(tmp_path / "a")
    assert find_recordings(tmp_path) == {"a/b/run": run, "a/walk": walk}
    assert find_recordings(walk) == {"walk": walk}


def test_the_folder_of_the_results_is_not_searched(tmp_path: Path) -> None:
    walk = folder(tmp_path / "walk")
    other = folder(tmp_path / "out" / "walk")
    assert find_recordings(tmp_path, without=tmp_path / "out") == {"walk": walk}
    found = find_recordings(tmp_path / "out", without=tmp_path / "out")
    assert found == {"walk": other}


def test_loose_bag_files_are_recordings_of_their_own(tmp_path: Path) -> None:
    loose = bag(tmp_path / "day", "one.mcap", "two.mcap", described=False)
    one, two = loose / "one.mcap", loose / "two.mcap"
    assert find_recordings(tmp_path) == {"day/one": one, "day/two": two}
    folder(loose / "one")
    assert list(find_recordings(tmp_path)) == ["day/one", "day/one.mcap", "day/two"]
    assert find_recordings(one) == {"one": one}


def test_a_list_names_recordings_relative_to_itself(tmp_path: Path) -> None:
    walk = folder(tmp_path / "data" / "s1" / "walk")
    other = folder(tmp_path / "data" / "s2" / "walk")
    text = f"# mine\ndata/s1/walk\n\n{other}\ndata/../data/s2/walk\ndata/s2/lost\n"
    (tmp_path / "list.txt").write_text(text, encoding="utf-8")
    assert find_recordings(tmp_path / "list.txt") == {
        "s1/walk": walk,
        "s2/walk": other,
        "s2/lost": tmp_path / "data" / "s2" / "lost",
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "No such file"), (b"\xff\xfe\x00", "not a text"), (b"# none\n", "no recording")],
)
def test_what_holds_no_recording(tmp_path: Path, content, message) -> None:
    path = tmp_path / "list.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DatasetError, match=f"list.txt: {message}"):
        find_recordings(path)
    with pytest.raises(DatasetError, match="no recording, expected some"):
        find_recordings(tmp_path)


def test_trials_of_a_session_share_its_calibration(tmp_path: Path) -> None:
    session = tmp_path / "session"
    for name in ("calibration", "Trial_1/videos", "Trial_2/videos"):
        (session / name).mkdir(parents=True)
    assert find_recordings(session) == {name: session / name for name in ("Trial_1", "Trial_2")}


def test_each_trial_of_a_subject_is_found(tmp_path: Path) -> None:
    subject = tmp_path / "HumanEva_2" / "S2"
    (subject / "Calibration_Data").mkdir(parents=True)
    for trial in ("Combo_1", "Walking_1"):
        for camera in ("C1", "C2"):
            images = subject / "Image_Data" / f"{trial}_({camera})"
            images.mkdir(parents=True)
            (images / "0001.png").write_bytes(b"")
    images = subject / "Image_Data"
    assert find_recordings(tmp_path) == {
        f"HumanEva_2/S2/Image_Data/{trial}_(C1)": images / f"{trial}_(C1)"
        for trial in ("Combo_1", "Walking_1")
    }
    videos = tmp_path / "h36m" / "S1" / "Videos"
    videos.mkdir(parents=True)
    (tmp_path / "h36m" / "metadata.xml").write_bytes(b"")
    (videos / "Eating.54138969.mp4").write_bytes(b"")
    assert find_recordings(tmp_path / "h36m") == {"S1": videos.parent}
    (videos / "Eating 1.54138969.mp4").write_bytes(b"")
    assert list(find_recordings(tmp_path / "h36m")) == [
        "S1/Videos/Eating 1.54138969", "S1/Videos/Eating.54138969",
    ]  # fmt: skip
