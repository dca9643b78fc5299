import numpy as np
import pytest

from markerless_tracker.benchmarks.silhouettes.masks import (
    LEAK_PX,
    draw_mask_errors,
    mask_scores,
    measure,
    radii_mm,
)
from markerless_tracker.benchmarks.silhouettes.scene import made_up_scene, recorded_scene
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import MarkerTrack, write_trc
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.tracking import TrackerConfig


def square(left: int, right: int) -> np.ndarray:
    mask = np.zeros((40, 60), dtype=bool)
    mask[10:30, left:right] = True
    return mask


def test_shares_by_hand() -> None:
    scores = mask_scores(square(15, 35), square(10, 30))
    assert scores.iou == pytest.approx(15 / 25)
    assert scores.precision == scores.recall == pytest.approx(15 / 20)
    assert scores.shadow_leak == 0.0


def test_a_leak_begins_beyond_the_margin() -> None:
    exact = square(10, 30)
    near = exact.copy()
    near[20, 30 : 30 + LEAK_PX] = True
    assert mask_scores(near, exact).shadow_leak == 0.0
    near[20, 30 + LEAK_PX + 1] = True
    assert mask_scores(near, exact).shadow_leak == pytest.approx(1 / exact.sum())


def test_nothing_there() -> None:
    nothing, something = np.zeros((40, 60), dtype=bool), square(10, 30)
    assert mask_scores(nothing, nothing).iou == 1.0
    scores = mask_scores(nothing, something)
    assert (scores.iou, scores.precision, scores.recall) == (0.0, 1.0, 0.0)
    scores = mask_scores(something, nothing)
    assert (scores.iou, scores.precision, scores.recall) == (0.0, 0.0, 1.0)


def test_undecided_pixels_count_neither_way() -> None:
    exact, undecided = square(10, 30), np.zeros((40, 60), dtype=bool)
    undecided[10:30, 25:40] = True
    found = mask_scores(square(10, 35) & ~undecided, exact, undecided)
    assert (found.iou, found.precision, found.recall, found.shadow_leak) == (1.0, 1.0, 1.0, 0.0)
    assert found.undecided_share == pytest.approx(5 / 20)
    found = mask_scores(square(12, 20), exact, undecided)
    assert found.iou == found.recall == pytest.approx(8 / 15)
    everything = np.ones((40, 60), dtype=bool)
    assert mask_scores(~everything, exact, everything).undecided_share == 1.0
    assert mask_scores(~everything, ~everything, everything).undecided_share == 0.0


def test_a_picture_shows_what_is_wrong() -> None:
    picture = draw_mask_errors(np.full((40, 60), 100, np.uint8), square(15, 35), square(10, 30))
    assert tuple(picture[20, 32]) == (0, 0, 255)
    assert tuple(picture[20, 12]) == (255, 80, 0)
    assert tuple(picture[20, 20]) == (50, 140, 50)
    assert tuple(picture[2, 2]) == (50, 50, 50)
    undecided = square(40, 50)
    picture = draw_mask_errors(picture, square(15, 35), square(10, 30), undecided)
    assert (picture[undecided] == (0, 200, 200)).all() and tuple(picture[20, 32]) == (0, 0, 255)


def test_the_same_masks_every_time_and_better_than_nothing() -> None:
    scene = made_up_scene(frames=2, size_px=(200, 152))
    seen: list[tuple[str, int]] = []
    first = measure(scene, picture=lambda camera, frame, image: seen.append((camera, frame)))
    again = measure(scene)
    assert first["iou_mean"] > 0.85
    assert set(seen) == {(name, frame) for name in scene.rig.names for frame in (0, 6)}
    for name in scene.rig.names:
        row, other = first["cameras"][name], again["cameras"][name]
        assert {"iou", "precision", "recall", "shadow_leak", "ms"} == set(row)
        assert [row[k] for k in row if k != "ms"] == [other[k] for k in row if k != "ms"]
    assert set(first["imaging"]) == {"iou_mean", "undecided_share"}
    assert first["imaging"] == again["imaging"]
    assert set(first["opencv"]) == {"mog2", "knn"}
    assert set(first["opencv"]["knn"]) == {"iou_mean", "ms"}


def test_the_body_decides_most_of_what_imaging_left_undecided() -> None:
    """A grey scene: without colour much of the person is as dark as a shadow."""
    scene = made_up_scene(frames=1, size_px=(328, 245), grey=True)
    figures = measure(scene)
    before = figures["imaging"]
    assert before["undecided_share"] > 2.0 * figures["undecided_share"] + 0.01
    # The outline of a generic body is a pixel off in places.
    assert figures["iou_mean"] > before["iou_mean"] - 0.005 and before["iou_mean"] > 0.85
    two = measure(scene, TrackerConfig.from_mapping({"shadow.undecided": False}))
    assert two["undecided_share"] == two["imaging"]["undecided_share"] == 0.0
    assert two["imaging"]["iou_mean"] == two["iou_mean"]


def test_without_exact_masks_the_body_stands_in(balance_real) -> None:
    scene = recorded_scene(balance_real, scale=0.25, frames=1)
    assert not scene.exact and scene.frame_count == 1
    scores = measure(scene)
    assert set(scores["cameras"]) == set(scene.rig.names)
    for row in scores["cameras"].values():
        assert 0.5 < row["overlap"] <= row["overlap_selected"] + 0.05
    assert scores["body"] == {"name": "person31", "radii_mm": radii_mm(scene.body)}
    assert scores["body"]["radii_mm"]


def test_exact_masks_are_found_scaled(render_walk) -> None:
    scene = recorded_scene(render_walk, scale=0.25, frames=2)
    assert scene.exact and scene.indices == (0, 200)
    (first, *_) = scene.frames()
    width, height = scene.rig.cameras[0].size_px
    assert first.masks(scene.rig)["cam01"].shape == (height, width)
    # The reference pose is known as well, and decides undecided pixels.
    assert first.pose is not None and set(first.exact) == set(first.masks(scene.rig))


def test_a_background_that_follows_is_refused() -> None:
    follows = TrackerConfig.from_mapping({"background.follow_s": 5.0})
    scene = made_up_scene(frames=1, size_px=(64, 48))
    with pytest.raises(ConfigError, match="background.follow_s is 5, expected 0"):
        measure(scene, follows)


@pytest.mark.parametrize("names", [("Neck",), ("LHip", "Pelvis"), ("LHip", "RHip", "Pelvis")])
def test_markers_that_a_pose_needs_are_named(make_recording, names) -> None:
    left = tuple(name for name in MARKER_NAMES if name not in names)
    truth = MarkerTrack(left, np.arange(3) * 16_666_667, np.zeros((3, len(left), 3)))
    folder = make_recording()
    write_trc(folder / "ground_truth.trc", truth, 60.0)
    missing = ", ".join(name for name in ("LHip", "RHip", "Neck") if name in names)
    with pytest.raises(DatasetError, match=f"ground_truth.trc: no marker {missing}, expected LHip"):
        recorded_scene(folder)


def test_a_recording_without_any_truth_is_an_error(make_recording) -> None:
    with pytest.raises(DatasetError, match="neither masks/ nor ground_truth.trc"):
        recorded_scene(make_recording())
