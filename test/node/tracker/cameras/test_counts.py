import pytest

from markerless_tracker.node.tracker.cameras.counts import WINDOW, CameraCounter, CameraCounts


def test_views_are_counted_by_camera() -> None:
    counter = CameraCounter(("a", "b"))
    assert counter.counts() == {"a": CameraCounts(), "b": CameraCounts()}
    for camera in "aab":
        counter.note("received", camera)
    counter.note("dropped", "a")
    counter.complete({"a": 10, "b": 10}, late=False)
    counter.complete({"b": 5}, late=True)
    assert counter.counts() == {
        "a": CameraCounts(2, 1, 0, 1, 0.0),
        "b": CameraCounts(1, 1, 1, 0, 0.0),
    }
    counter.reset()
    assert counter.counts()["b"] == CameraCounts()


def test_the_offset_is_the_median_of_the_latest_sets() -> None:
    counter = CameraCounter(("a", "b", "c"))
    for _ in range(3 * WINDOW):
        counter.complete({"a": 0, "b": 0, "c": 5_000_000}, late=False)
    for number in range(WINDOW):
        late = 40_000_000 if number % 10 == 0 else 2_000_000
        counter.complete({"a": -500_000, "b": 0, "c": late}, late=False)
    offsets = {name: counts.offset_ms for name, counts in counter.counts().items()}
    assert offsets == pytest.approx({"a": -0.5, "b": 0.0, "c": 2.0})
