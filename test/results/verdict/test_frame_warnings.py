"""Kinds of warning in the frames of a run."""

from markerless_tracker.results.verdict.frame_warnings import FrameWarnings


def test_each_kind_is_reported_once_and_counted_in_every_frame() -> None:
    warnings = FrameWarnings()
    texts = ["cam01: 12 px left out", "cam02: 5 px left out", "cam01: 3 px left out"]
    new = warnings.add(7, texts)
    assert [kind.text for kind in new] == ["cam01: 12 px left out", "cam02: 5 px left out"]
    assert warnings.add(8, []) == []
    assert warnings.add(9, ["cam01: 400 px left out"]) == []
    assert [kind.text for kind in warnings.add(10, ["cam01: left out, off by -3.5 px"])] == [
        "cam01: left out, off by -3.5 px"
    ]
    assert warnings.frames == 3
    assert warnings.as_list() == [
        {"text": "cam01: 12 px left out", "first_frame": 7, "frames": 2},
        {"text": "cam02: 5 px left out", "first_frame": 7, "frames": 1},
        {"text": "cam01: left out, off by -3.5 px", "first_frame": 10, "frames": 1},
    ]


def test_cameras_named_by_numbers_stay_apart() -> None:
    warnings = FrameWarnings()
    assert len(warnings.add(0, ["1: left out", "2: left out"])) == 2
