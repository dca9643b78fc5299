"""Which other places of limbs are remembered, and until when."""

import numpy as np
import pytest

from markerless_tracker.tracking.limbs.rivals import Rival

PACKAGE = "markerless_tracker.tracking.limbs"
APART_NS = 100_000_000
"""Time between frames so far apart that all limbs are searched."""


@pytest.fixture
def watching(stander, monkeypatch):
    """A watch, a function that searches the next frame, and the rivals that searches find."""
    watch, body = stander.watch, stander.body
    found: dict[str, Rival] = {}
    stamps_ns = iter(range(0, 10**12, APART_NS))

    def not_taken(search, limb, *_):
        name = next(n for n in body.limbs if np.array_equal(body.subspaces[n], limb))
        search.rival = found.get(name)
        return False

    monkeypatch.setattr(f"{PACKAGE}.search.LimbSearch.take_drawn", not_taken)
    for due in ("facing.FacingWatch.take_due", "exchange.PairExchange.take_due"):
        monkeypatch.setattr(f"{PACKAGE}.{due}", lambda *_: None)

    def frame():
        return stander.recover(next(stamps_ns), badly=True)

    return watch, frame, found, stander.pose


def rival(size):
    return Rival(0.5, np.zeros(size), np.zeros((15, 3)))


def test_a_rival_is_remembered_until_the_limb_is_searched_again(watching) -> None:
    watch, frame, found, pose = watching
    arm, leg = rival(pose.size), rival(pose.size)
    found.update(l_arm=arm, r_leg=leg)
    frame()
    assert watch.rivals == {"l_arm": arm, "r_leg": leg}
    later = rival(pose.size)
    found.clear()
    found.update(l_arm=later)
    frame()
    assert watch.rivals == {"l_arm": later}


def test_another_person_has_no_rivals(watching) -> None:
    watch, frame, found, pose = watching
    found.update(l_arm=rival(pose.size))
    frame()
    watch.reset()
    assert watch.rivals == {}


def test_after_a_rotation_limbs_have_no_rivals(watching, monkeypatch) -> None:
    watch, frame, found, pose = watching
    found.update(l_arm=rival(pose.size))
    frame()
    monkeypatch.setattr(f"{PACKAGE}.facing.FacingWatch.take_due", lambda *_: True)
    monkeypatch.setattr(f"{PACKAGE}.facing.FacingWatch.compare", lambda *_: pose)
    assert frame().rotated
    assert watch.rivals == {}
