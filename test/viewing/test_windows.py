"""The part of an image in which the person moves."""

from pathlib import Path

import numpy as np

from markerless_tracker.camera import project_camera
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.overlays import Overlays
from markerless_tracker.viewing.windows import LEAST, Window, windows


def test_every_marker_is_in_the_window(make_result, seen) -> None:
    result = read_result(make_result())
    found = windows(result, seen.rig)
    for camera in seen.rig:
        window = found[camera.name]
        pixels = project_camera(result.positions_m.reshape(-1, 3), camera) / camera.size_px
        inside = (pixels - (window.left, window.top)) / window.size
        assert (inside > 0.0).all() and (inside < 1.0).all()
        assert LEAST <= window.size <= 1.0
        assert 0.0 <= min(window.left, window.top)
        assert max(window.left, window.top) + window.size <= 1.0 + 1e-9
    assert min(window.size for window in found.values()) < 0.8, "they are smaller than the images"


def test_without_a_marker_in_view_it_is_the_whole_image(make_result, seen) -> None:
    nobody = read_result(make_result(lost=tuple(range(6))))
    assert set(windows(nobody, seen.rig).values()) == {Window()}
    result = read_result(make_result("far"))
    far = result.with_arrays(positions_m=result.positions_m + 1000.0)
    assert windows(far, seen.rig)["cam01"] == Window()


def test_a_part_keeps_the_aspect_ratio() -> None:
    image = np.arange(60 * 80 * 3, dtype=np.uint8).reshape(60, 80, 3)
    assert Window().of(image).shape == image.shape
    part = Window(0.25, 0.5, 0.4).of(image)
    np.testing.assert_array_equal(part, image[30:54, 20:52])


def test_pictures_of_windows_show_the_person_larger(make_result, walk: Path) -> None:
    result = read_result(make_result(source=walk))
    shares = []
    for whole in (True, False):
        images = ResultImages(result, width_px=96, whole=whole)
        (_, sheet), *_ = Overlays(result, images).sheets([0], width_px=200)
        assert sheet.shape[1] <= 200
        yellow = (sheet[..., 0] < 120) & (sheet[..., 1] > 180) & (sheet[..., 2] > 180)
        shares.append(yellow.mean())
    assert shares[1] > 1.2 * shares[0]
