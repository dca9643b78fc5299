import cv2
import numpy as np
import pytest

from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.imaging.edges import edge_map


def twin(image: np.ndarray, mask: np.ndarray, options: ImagingSettings) -> np.ndarray:
    """The published form over the whole frame, in floating point."""
    grey = (image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)).astype(float)
    padded = np.pad(grey, 1, mode="edge")
    kernel = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], float)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    across, down = (windows * kernel).sum(axis=(2, 3)), (windows * kernel.T).sum(axis=(2, 3))
    gradient = np.hypot(across, down) / 8.0
    if options.edges.form == "published":
        strength = (gradient**2 >= options.edges.gradient**2).astype(float)
    else:
        low = 0.5 * options.edges.gradient
        strength = np.clip((gradient - low) / (3.0 * low), 0.0, 1.0)
    side = 2 * options.edges.margin_px + 1
    strength *= cv2.dilate(mask, np.ones((side, side), np.uint8)) > 0
    size = options.edges.blur_px
    return cv2.GaussianBlur(strength, (size, size), 0.0, borderType=cv2.BORDER_REPLICATE)


def picture(*, colour: bool) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 256, (60, 80, 3) if colour else (60, 80), dtype=np.uint8)
    image = cv2.GaussianBlur(noise, (9, 9), 0)
    mask = np.zeros((60, 80), np.uint8)
    mask[15:50, 50:80] = 255  # touches the right border
    return image, mask


@pytest.mark.parametrize("colour", [True, False])
@pytest.mark.parametrize("form", ["published", "soft"])
@pytest.mark.parametrize("margin", [0, 6])
def test_the_window_agrees_with_the_whole_frame(colour: bool, form: str, margin: int) -> None:
    options = ImagingSettings.from_mapping({"edges.form": form, "edges.margin_px": margin})
    image, mask = picture(colour=colour)
    edges = edge_map(image, mask, options)
    expected = 255.0 * twin(image, mask, options)
    assert edges.dtype == np.uint8 and edges.max() > 50
    assert np.abs(edges - expected).max() < 3.0


def test_an_empty_mask_gives_an_empty_map() -> None:
    image, mask = picture(colour=True)
    assert not edge_map(image, np.zeros_like(mask), ImagingSettings()).any()


def test_a_step_is_strongest_where_it_is_and_far_edges_do_not_count() -> None:
    image = np.zeros((50, 100), np.uint8)
    image[:, 30:] = 120
    image[:, 80:] = 255
    mask = np.zeros((50, 100), np.uint8)
    mask[10:40, 25:36] = 255
    edges = edge_map(image, mask, ImagingSettings())
    assert edges[25].argmax() in (29, 30)
    assert not edges[:, 60:].any()
