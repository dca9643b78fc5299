"""Fits of a body that follow the first one: when they begin, and what they find."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from markerless_tracker.body import load_description
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.model import BodyModel
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.person import estimate as estimate_module
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.estimate import PIECES, BodyEstimate
from markerless_tracker.tracking.person.later_fits import FIRST, MOST_KNOWN, LaterFits
from markerless_tracker.tracking.search import FrameSearch, make_searcher

SIZES = Sizes(load_description("person31"))
GENERIC = SIZES.of_stature(1.70)
RIG = ring_rig(4, (328, 245))
CONFIG = TrackerConfig.from_mapping({"threads": 1})
PERSON = Unmeasured(SIZES, None)

Kept = Callable[[np.ndarray], FrameSearch]


def kneeling(amount: float) -> np.ndarray:
    """A person (p,) who bends knees and elbows, the more the larger the amount."""
    bend = {"hip_y": amount, "knee": 2.0 * amount, "elbow": 1.5 * amount}
    pose = posture(GENERIC, {f"{s}_{n}": a for s in "lr" for n, a in bend.items()})
    pose[GENERIC.index("pelvis_tz")] = 0.95 - 0.1 * amount
    return pose


def long_legs() -> BodyModel:
    lengths = SIZES.of(SIZES.of_stature(1.76))
    lengths[SIZES.names.index("thigh")] *= 1.06
    return SIZES.body(lengths)


def found(pose: np.ndarray) -> FrameSearch:
    """A frame in which a pose was found, without evidence."""
    search = SimpleNamespace(
        searcher=SimpleNamespace(body=GENERIC), stamp_ns=0, pose=pose, observations={}
    )
    return search  # type: ignore[return-value]


@pytest.fixture
def tracked() -> Kept:
    """Frames of the person with long legs, tracked with the generic body."""
    searcher, seen = make_searcher(GENERIC, rig=RIG, config=CONFIG, threads=1), {}

    def frame(pose: np.ndarray) -> FrameSearch:
        if pose.tobytes() not in seen:
            for camera in RIG:
                mask = silhouette(long_legs(), pose, camera).astype(np.uint8)
                seen.setdefault(pose.tobytes(), {})[camera.name] = Observation.from_mask(
                    camera.name, 0, mask, np.zeros_like(mask)
                )
        return searcher.frame(seen[pose.tobytes()], 0, pose)

    return frame


def test_a_person_who_stands_still_teaches_nothing() -> None:
    fits = LaterFits(PERSON)
    for number in range(3 * FIRST):
        fits.keep(found(kneeling(0.01 * (number % 5))))
        assert not fits.due()


def test_each_fit_waits_for_twice_as_many_frames_and_another_posture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fits, due = LaterFits(PERSON), []
    monkeypatch.setattr(fits._frames, "fitting", lambda *_: None)
    for number in range(1, 5 * FIRST):
        fits.keep(found(kneeling(0.5 if number > 5 else 0.0)))
        if number == 3 * FIRST:
            fits.keep(found(kneeling(1.2)))
        if fits.due():
            due.append(number)
            fits.fit(found(kneeling(0.0)))
    assert due == [FIRST, 3 * FIRST]


def test_what_is_known_is_bounded() -> None:
    fits, rng = LaterFits(PERSON), np.random.default_rng(0)
    for _ in range(2 * MOST_KNOWN):
        fits.keep(found(rng.uniform(*np.clip(GENERIC.limits, -3.0, 3.0))))
    assert len(fits._known) == MOST_KNOWN


def test_bent_legs_show_their_lengths(tracked: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimate_module, "_agrees", lambda _: True)
    estimate = BodyEstimate(GENERIC, CONFIG, person=PERSON)
    estimate.take_found(GENERIC, settled=True)
    estimate._lengths = None  # The first fit is over.
    bodies = []
    for number in range(2 * FIRST):
        estimate.fit_tracked_frame(tracked(kneeling(0.25 * (number % 5))))
        bodies.append(estimate.body)
    first = next(i for i, body in enumerate(bodies) if body is not GENERIC)
    # In pieces, beginning with the first frame that is due.
    assert first > FIRST and bodies[first] is not bodies[first - 1]
    assert first - FIRST >= 50 // PIECES
    thigh = SIZES.names.index("thigh")
    off = [abs(np.log(SIZES.of(b) / SIZES.of(long_legs())))[thigh] for b in (GENERIC, bodies[-1])]
    assert off[1] < 0.6 * off[0]


def test_frames_with_a_limb_in_a_wrong_place_are_forgotten(
    tracked: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimate_module, "_agrees", lambda _: True)
    estimate = BodyEstimate(GENERIC, CONFIG, person=PERSON)
    estimate.take_found(GENERIC, settled=True)
    estimate._lengths, estimate._since_fit = None, 1000
    for number in range(FIRST + 1):
        estimate.fit_tracked_frame(tracked(kneeling(0.5 * (number % 2))))
    assert estimate._revision is not None
    estimate.fit_tracked_frame(tracked(kneeling(0.0)), recovered=True)
    assert estimate._revision is None and estimate.body is GENERIC


def test_a_measured_body_is_not_fitted_again(
    tracked: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimate_module, "_agrees", lambda _: True)
    estimate = BodyEstimate(GENERIC, CONFIG)
    estimate.take_found(GENERIC, settled=True)
    for number in range(2 * FIRST):
        estimate.fit_tracked_frame(tracked(kneeling(0.5 * (number % 2))))
    assert estimate.body is GENERIC
