import cv2
import numpy as np

from markerless_tracker.imaging.background.align import align_exposure, align_geometry


def scene(width: int, height: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    image = np.zeros((height, width, 3), np.float32)
    for cells in (6, 20, 60):
        grid = rng.uniform(0, 255, (cells * height // width + 2, cells, 3)).astype(np.float32)
        image += cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.clip(image / 3.0, 0, 255).astype(np.uint8)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    inner = (slice(20, -20), slice(20, -20))
    return float(np.abs(a[inner].astype(float) - b[inner]).mean())


def test_a_moved_and_stretched_picture_is_aligned() -> None:
    reference = scene(360, 480)
    there = np.array([[1.0, 0.0, 1.5], [0.0, 1.009, -3.0]])
    moved = cv2.warpAffine(reference, there, (360, 480), borderMode=cv2.BORDER_REPLICATE)
    cv2.rectangle(moved, (150, 150), (200, 300), (0, 0, 255), -1)  # a person stands there
    aligned = align_geometry(moved, reference)
    outside = np.ones((480, 360), bool)
    outside[140:310, 140:210] = False
    before = np.abs(moved.astype(float) - reference)[outside].mean()
    after = np.abs(aligned.astype(float) - reference)[outside].mean()
    assert before > 4.0 and after < 1.5


def test_an_aligned_picture_keeps_its_bytes() -> None:
    reference = scene(200, 150)
    assert (align_geometry(reference, reference) == reference).all()


def test_another_size_is_resized() -> None:
    reference = scene(360, 240)
    larger = cv2.resize(reference, (544, 360), interpolation=cv2.INTER_CUBIC)
    aligned = align_geometry(larger, reference)
    assert aligned.shape == reference.shape and apart(aligned, reference) < 3.0


def test_images_without_structure_are_only_resized() -> None:
    flat = np.full((90, 120, 3), 100, np.uint8)
    assert (align_geometry(flat, flat[:60, :80]) == flat[:60, :80]).all()


def test_exposure_and_white_balance_are_fitted_around_people() -> None:
    reference = scene(360, 240).astype(np.float32)
    gain, offset = np.array([0.9, 1.05, 1.1]), np.array([4.0, -6.0, 3.0])
    still = np.clip(reference * gain + offset, 0, 255).astype(np.float32)
    still[60:160, 100:160] = (0, 0, 250)
    fitted = align_exposure(still, reference)
    outside = np.ones((240, 360), bool)
    outside[40:180, 80:180] = False
    assert np.abs(fitted - reference)[outside].mean() < 1.0
    assert np.abs(fitted - reference)[80:140, 110:150].mean() > 40.0
