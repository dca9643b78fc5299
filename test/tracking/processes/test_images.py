"""Images in shared memory: copied once, found again, refused where there is no room."""

import mmap

import numpy as np

from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking.processes.images import get, put, set_bytes

RIG = ring_rig(2, (50, 30))


def images(seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "cam01": rng.integers(0, 256, (30, 50, 3)).astype(np.uint8),
        "cam02": rng.integers(0, 256, (30, 50)).astype(np.uint8),
    }


def test_images_are_found_where_they_were_put() -> None:
    memory = mmap.mmap(-1, 2 * set_bytes(RIG))
    for half in range(2):
        places = put(memory, images(half), half * set_bytes(RIG), (half + 1) * set_bytes(RIG))
        assert places is not None
        for name, image in images(half).items():
            np.testing.assert_array_equal(get(memory, places[name]), image)
    # The second set did not disturb the first.
    first = put(memory, images(0), 0, set_bytes(RIG))
    assert first is not None
    np.testing.assert_array_equal(get(memory, first["cam02"]), images(0)["cam02"])


def test_images_that_lie_there_stay_where_they_are() -> None:
    memory = mmap.mmap(-1, 2 * set_bytes(RIG))
    places = put(memory, images(1), set_bytes(RIG), 2 * set_bytes(RIG))
    assert places is not None
    there = {name: get(memory, place) for name, place in places.items()}
    assert put(memory, there, 0, 0) == places


def test_without_room_nothing_is_put() -> None:
    memory = mmap.mmap(-1, set_bytes(RIG))
    before = bytes(memory)
    large = {"cam01": np.ones((90, 50, 3), np.uint8)}
    assert put(memory, large, 0, set_bytes(RIG)) is None
    assert bytes(memory) == before
