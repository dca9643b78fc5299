from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import (
    BackgroundModel,
    ImagingSettings,
    Segmenter,
    learn_background,
)


def room(seed: int = 0, *, grey: bool = False) -> np.ndarray:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(80, 200, (12, 16, 3)).astype(np.uint8)
    image = cv2.resize(coarse, (160, 120), interpolation=cv2.INTER_CUBIC)
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if grey else image


def with_noise(image: np.ndarray, seed: int, sigma: float = 2.0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def model(empty: np.ndarray) -> BackgroundModel:
    return learn_background([with_noise(empty, seed) for seed in range(12)])


def person(empty: np.ndarray, colour: object) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros(empty.shape[:2], np.uint8)
    cv2.ellipse(mask, (80, 55), (16, 42), 5, 0, 360, 255, -1)
    image = empty.copy()
    image[mask > 0] = colour
    return image, mask


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a > 0, b > 0
    return float((a & b).sum() / (a | b).sum())


TWO_CLASSES = ImagingSettings.from_mapping({"shadow.undecided": False})


def shaded(image: np.ndarray, factor: float) -> np.ndarray:
    """A cast shadow on the floor left of the person."""
    where = np.zeros(image.shape[:2], np.uint8)
    cv2.ellipse(where, (40, 100), (36, 12), 0, 0, 360, 255, -1)
    dark = image.copy()
    dark[where > 0] = np.rint(image[where > 0] * factor).astype(np.uint8)
    return dark


def test_a_person_is_found_and_a_shadow_is_not() -> None:
    empty = room()
    image, mask = person(shaded(empty, 0.65), (200, 60, 20))
    for settings in (ImagingSettings(), TWO_CLASSES):
        segmenter = Segmenter("cam01", model(empty), settings)
        observation = segmenter.observe(with_noise(image, 99), 123)
        assert overlap(observation.mask, mask) > 0.95
        assert observation.camera == "cam01" and observation.stamp_ns == 123
        assert observation.size_px == (160, 120) and observation.offset_px == (0, 0)
        assert observation.edges.max() > 100
        if settings.shadow.undecided:
            assert (
                observation.undecided is not None
                and observation.undecided[95:105, 15:55].mean() > 0.95
            )
            assert (observation.undecided & (mask > 0)).sum() < 0.02 * (mask > 0).sum()
        else:
            assert observation.undecided is None and not observation.edges[:, :20].any()
    left = Segmenter("cam01", model(empty), ImagingSettings.from_mapping({"shadow.removal": False}))
    assert left.observe(with_noise(image, 99), 0).mask[100, 30]


@pytest.mark.parametrize("channels", [1, 3])
def test_grey_cameras_in_one_or_three_channels(channels: int) -> None:
    empty = room(grey=True)
    # As dark as a deep shadow would be, without the wall's pattern.
    _, mask = person(empty, 0)
    image = shaded(empty, 0.85)
    image[mask > 0] = np.rint(0.62 * empty[mask > 0].mean()).astype(np.uint8)
    frames = [with_noise(empty, seed) for seed in range(12)]
    image = with_noise(image, 99)
    if channels == 3:
        frames = [np.repeat(frame[:, :, None], 3, axis=2) for frame in frames]
        image = np.repeat(image[:, :, None], 3, axis=2)
    background = learn_background(frames)
    observation = Segmenter("cam01", background, TWO_CLASSES).observe(image, 0)
    assert overlap(observation.mask, mask) > 0.95
    # Where the wall is bright, so dark a pixel may be shadow or body.
    observation = Segmenter("cam01", background).observe(image, 0)
    undecided, exact = observation.undecided, mask > 0
    assert undecided is not None and undecided[95:105, 15:55].mean() > 0.95
    assert overlap(observation.mask & ~undecided, exact & ~undecided) > 0.95
    assert (exact & ~observation.not_background).sum() < 0.01 * exact.sum()


def test_labels_separate_body_shadow_and_room() -> None:
    empty = room()
    image, mask = person(shaded(empty, 0.65), (200, 60, 20))
    segmenter = Segmenter("cam01", model(empty))
    labels = segmenter.labels(with_noise(image, 99))
    assert labels[55, 80] == 255 and labels[100, 30] == 127 and labels[20, 140] == 0
    assert (labels[mask > 0] == 255).mean() > 0.9
    segmenter.observe(empty, 0)
    assert labels[55, 80] == 255


def test_an_empty_room_gives_an_empty_silhouette() -> None:
    empty = room()
    observation = Segmenter("cam01", model(empty)).observe(with_noise(empty, 99), 0)
    assert not observation.mask.any() and not observation.edges.any()


def test_observations_do_not_change_when_the_next_image_comes() -> None:
    empty = room()
    image, _ = person(empty, (200, 60, 20))
    segmenter = Segmenter("cam01", model(empty))
    first = segmenter.observe(image, 0)
    before = first.mask.copy(), first.edges.copy()
    segmenter.observe(empty, 1)
    assert (first.mask == before[0]).all() and (first.edges == before[1]).all()


def test_cameras_in_threads_give_what_they_give_alone() -> None:
    rooms = [room(seed) for seed in range(4)]
    images = [person(empty, (200, 60, 20))[0] for empty in rooms]
    segmenters = [Segmenter(f"cam{i}", model(empty)) for i, empty in enumerate(rooms)]
    alone = [s.observe(image, 0) for s, image in zip(segmenters, images, strict=True)]
    with ThreadPoolExecutor(4) as pool:
        for _ in range(5):
            jobs = zip(segmenters, images, strict=True)
            together = list(pool.map(lambda job: job[0].observe(job[1], 0), jobs))
            for one, other in zip(alone, together, strict=True):
                assert (one.mask_words == other.mask_words).all()
                assert (one.edges == other.edges).all()


def test_no_background_is_an_error_that_names_the_camera() -> None:
    with pytest.raises(ImageError, match="cam09: no background"):
        Segmenter("cam09", None)


@pytest.mark.parametrize(
    ("image", "what"),
    [
        (np.zeros((120, 160), np.uint8), "grey image, its background is colour"),
        (np.zeros((121, 160, 3), np.uint8), "160x121 px, expected 160x120 px"),
        (np.zeros((120, 160, 3), np.uint16), "uint16"),
        (np.zeros((120, 160, 4), np.uint8), r"\(120, 160, 4\)"),
        (None, "NoneType"),
    ],
)
def test_wrong_images_are_refused(image: object, what: str) -> None:
    segmenter = Segmenter("cam09", model(room()))
    with pytest.raises(ImageError, match=f"^cam09: .*{what}") as caught:
        segmenter.observe(image, 0)
    assert "\n" not in str(caught.value)


def test_a_colour_image_for_a_grey_background_is_refused() -> None:
    segmenter = Segmenter("cam09", model(room(grey=True)))
    with pytest.raises(ImageError, match="cam09: got a colour image, its background is grey"):
        segmenter.observe(room(), 0)


def frames_of(path: Path, wanted: set[int] | None = None) -> list[np.ndarray]:
    video = cv2.VideoCapture(str(path))
    frames, index = [], 0
    while True:
        there, frame = video.read()
        if not there or (wanted and index > max(wanted)):
            return frames
        if wanted is None or index in wanted:
            frames.append(frame)
        index += 1


@pytest.mark.parametrize(("grey", "least"), [(False, 0.95), (True, 0.85)])
def test_exact_masks_of_a_rendered_walk(render_walk: Path, grey: bool, least: float) -> None:
    """Two lights cast shadows; grey images leave only brightness to separate them from trousers."""
    overlaps, leaks = [], []
    for camera in ("cam01", "cam02"):
        empty = frames_of(render_walk / "background" / f"{camera}.mp4")
        images = frames_of(render_walk / f"{camera}.mp4", {0, 50, 100})
        if grey:
            empty = [cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) for frame in empty]
            images = [cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) for frame in images]
        segmenter = Segmenter(camera, learn_background(empty), TWO_CLASSES)
        for index, image in zip((0, 50, 100), images[::1], strict=True):
            name = render_walk / "masks" / camera / f"{index:06d}.png"
            exact = cv2.imread(str(name), cv2.IMREAD_GRAYSCALE) > 127
            mask = segmenter.observe(image, 0).mask
            overlaps.append(overlap(mask, exact))
            near = cv2.dilate(exact.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0
            leaks.append((mask & ~near).sum() / exact.sum())
    assert np.mean(overlaps) >= least and np.mean(leaks) <= 0.02
