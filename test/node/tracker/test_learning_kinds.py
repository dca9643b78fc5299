"""A background that does not fit any more, of a camera that sends other images, is learned anew."""

from typing import Any

import pytest

from markerless_tracker.errors import ImageError

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from .test_worker import Bench, learn, offer_one_by_one


@pytest.fixture
def bench() -> Any:
    bench = Bench()
    yield bench
    assert bench.worker.stop(60)


def test_images_that_do_not_fit_the_old_background_are_learned(bench: Bench) -> None:
    bench.worker.start()
    bench.until(lambda: bench.status.ready)
    bench.tracker.error = ImageError("a: got a grey image, its background is colour")
    learning = learn(bench, 3)

    def used(backgrounds: Any) -> None:
        bench.tracker.backgrounds, bench.tracker.error = dict(backgrounds), None

    bench.tracker.take_backgrounds = used  # type: ignore[method-assign]
    offer_one_by_one(bench, 1, 2, 3)
    bench.until(lambda: learning.answered)
    assert learning.success and set(bench.tracker.backgrounds) == {"a", "b"}
    offer_one_by_one(bench, 4)
    bench.until(lambda: [stamp for stamp, _ in bench.tracker.seen] == [4])
