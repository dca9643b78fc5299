"""The process that segments gives what this one would, and its end is no trouble."""

import os
import signal
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.compiled import compilation
from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import BackgroundModel, Region, Segmenter, learn_background
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.gather import EvidenceMaker
from markerless_tracker.tracking.evidence.observer import Observer
from markerless_tracker.tracking.evidence.prepared import Outlook
from markerless_tracker.tracking.evidence.segmenting import SegmentingProcess
from markerless_tracker.tracking.evidence.views import ViewWatch
from markerless_tracker.tracking.motion import MotionModel

WIDTH, HEIGHT = 96, 80
CONFIG = TrackerConfig.from_mapping({"threads": 2})
# Has fewer kernels.
FEW_KERNELS = TrackerConfig.from_mapping({"threads": 2, "preset": "paper"})
REGION = Region(20, 10, 80, 70)


def empty(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(60, 190, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def camera(name: str) -> CameraModel:
    matrix = np.array([[90.0, 0.0, WIDTH / 2], [0.0, 90.0, HEIGHT / 2], [0.0, 0.0, 1.0]])
    away = np.eye(4)
    away[2, 3] = 3.0
    return CameraModel(
        name=name, size_px=(WIDTH, HEIGHT), matrix=matrix, distortion=np.zeros(5), T_cam_world=away
    )


RIG = CameraRig((camera("left"), camera("right")))


@pytest.fixture(scope="module")
def backgrounds() -> dict[str, BackgroundModel]:
    return {
        name: learn_background([empty(seed)] * 3) for seed, name in enumerate(("left", "right"))
    }


@pytest.fixture(scope="module")
def images() -> dict[str, np.ndarray]:
    made = {}
    for seed, name in enumerate(("left", "right")):
        image = empty(seed)
        image[15:65, 35:60] = (20, 30, 230 - 100 * seed)
        made[name] = image
    return made


@pytest.fixture(scope="module")
def here(backgrounds) -> EvidenceMaker:
    maker = EvidenceMaker(RIG, CONFIG, backgrounds, map)
    maker.finish_compiling()
    return maker


@pytest.fixture
def process(here, backgrounds) -> Iterator[SegmentingProcess]:
    started = SegmentingProcess(RIG)
    started.use(CONFIG, backgrounds)
    yield started
    started.close()


def test_observations_are_the_same_bytes(process, here, images) -> None:
    for stamp_ns, region in enumerate((None, REGION)):
        regions = dict.fromkeys(images, region)
        there = process.segment(images, stamp_ns, regions)
        expected = here.segment_regions(images, stamp_ns, regions)
        assert there is not None
        assert list(there) == list(expected)
        for name, view in there.items():
            one, other = view.observation, expected[name].observation
            assert one.mask.any()
            assert (one.camera, one.stamp_ns, one.size_px, one.offset_px) == (
                other.camera, other.stamp_ns, other.size_px, other.offset_px,
            )  # fmt: skip
            for part in ("mask", "not_background", "edges"):
                np.testing.assert_array_equal(getattr(one, part), getattr(other, part))
            assert view.image is images[name]
            assert (view.region, view.exposure) == (region, expected[name].exposure)
    assert process.cpu_s > 0.0


def test_an_image_that_does_not_fit_is_refused_and_the_next_is_segmented(process, images) -> None:
    small = {"left": images["left"][:-2]}
    with pytest.raises(ImageError, match="left"):
        process.segment(small, 0, {"left": None})
    assert process.segment(images, 0, dict.fromkeys(images)) is not None


def test_a_process_that_was_killed_segments_nothing(process, images) -> None:
    assert process.segment(images, 0, dict.fromkeys(images)) is not None
    os.kill(process.pid, signal.SIGKILL)
    assert process.segment(images, 1, dict.fromkeys(images)) is None
    assert process.segment(images, 2, dict.fromkeys(images)) is None
    assert process.take_fault() == "the segmenting process has ended"
    assert process.take_fault() is None


def test_its_end_is_told_once_with_a_frame(here, backgrounds, images) -> None:
    maker = EvidenceMaker(RIG, CONFIG, backgrounds, map)
    maker.start_process()
    maker.start_compiling()
    maker.finish_compiling()
    process = maker._process
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    assert process.segment(images, 1, dict.fromkeys(images)) is None
    observer, body = Observer(maker, ViewWatch(RIG)), load_body("person32")
    segmented = here.segment_regions(images, 1, dict.fromkeys(images))
    told = "the segmenting process has ended; images are segmented in the tracker's own process"
    assert observer.whole(segmented, 1, body).notes == (told,)
    assert observer.whole(segmented, 2, body).notes == ()
    maker.close()


def test_a_step_segments_its_images_on_several_threads(here, images, monkeypatch) -> None:
    both_at_work, observe = threading.Barrier(2, timeout=300), Segmenter.observe

    def together(*args):
        both_at_work.wait()
        return observe(*args)

    monkeypatch.setattr(Segmenter, "observe", together)
    body = load_body("person32")
    motion = MotionModel(body.neutral, CONFIG)
    outlook = Outlook(0, RIG, body, motion, body.limits, searching=True)
    assert list(here.segment(images, 0, outlook)) == list(RIG.names)


def test_views_are_in_the_order_of_the_cameras(here, images) -> None:
    """Sums over them are the same whatever the caller's order is."""
    backwards = dict(reversed(images.items()))
    body = load_body("person32")
    motion = MotionModel(body.neutral, CONFIG)
    outlook = Outlook(0, RIG, body, motion, body.limits, searching=True)
    assert list(here.segment(backwards, 0, outlook)) == list(RIG.names)


def test_it_starts_when_the_backgrounds_come(backgrounds, images) -> None:
    """As in a tracker that learns them when it runs."""
    maker = EvidenceMaker(RIG, CONFIG, {}, map)
    maker.start_process()
    assert maker._process is None
    maker.take_backgrounds(backgrounds)
    maker.start_compiling()
    maker.finish_compiling()
    assert maker._process is not None
    assert maker._process.segment(images, 0, dict.fromkeys(images)) is not None
    maker.close()


def test_without_backgrounds_nothing_is_segmented_there(images) -> None:
    process = SegmentingProcess(RIG)
    assert process.segment(images, 0, dict.fromkeys(images)) is None
    process.close()


def test_what_it_has_compiled_counts_here(backgrounds, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    with compilation(lambda *_: None) as kernels:
        process = SegmentingProcess(RIG)
        process.use(FEW_KERNELS, backgrounds)
        process.wait()
        process.close()
    assert kernels.done > 10
