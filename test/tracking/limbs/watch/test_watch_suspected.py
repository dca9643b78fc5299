"""Which limbs the watch suspects after its searches, and for how long."""

import numpy as np
import pytest

from markerless_tracker.tracking.limbs.round_robin import PER_LIMB_NS
from markerless_tracker.tracking.limbs.unexplained import Unexplained

LIMBS = "markerless_tracker.tracking.limbs"


@pytest.fixture
def searched(stander, monkeypatch):
    """A watch, and its searches of a frame in which areas of silhouette are unexplained."""
    watch, body = stander.watch, stander.body
    stamps = iter(range(0, 100 * PER_LIMB_NS, PER_LIMB_NS))

    def search(areas_m2, found=()):
        limbs = [body.subspaces[name] for name in found]
        monkeypatch.setattr(f"{LIMBS}.watch.find_unexplained", lambda *_: Unexplained(areas_m2, {}))
        monkeypatch.setattr(
            f"{LIMBS}.search.LimbSearch.take_drawn",
            lambda _, limb, *__: any(np.array_equal(limb, one) for one in limbs),
        )
        stander.recover(next(stamps))

    return watch, search


def test_the_two_likeliest_limbs_are_suspected_with_the_size_of_the_silhouette(searched) -> None:
    watch, search = searched
    assert watch.suspected_m == {}
    search({"r_leg": 0.04, "l_leg": 0.01, "l_arm": 0.004})
    # Of the mean area in one of the four views.
    assert watch.suspected_m == pytest.approx({"r_leg": 0.1, "l_leg": 0.05})


def test_limbs_are_suspected_until_the_silhouette_is_explained(searched) -> None:
    watch, search = searched
    search({"l_arm": 0.04})
    search({})
    assert watch.suspected_m == {}
    search({"l_arm": 0.04})
    watch.reset()
    assert watch.suspected_m == {}


def test_no_limb_is_suspected_once_one_was_found(searched) -> None:
    """The silhouette that it left is explained."""
    watch, search = searched
    search({"l_arm": 0.04, "r_arm": 0.02}, found=["l_arm"])
    assert watch.suspected_m == {}
    search({"r_arm": 0.02})
    assert list(watch.suspected_m) == ["r_arm"]
