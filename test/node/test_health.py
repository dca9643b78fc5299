"""Level and reason of the diagnostics, from what is known at one moment."""

from typing import Any

import pytest

from markerless_tracker.node.health import QUIET_S, Facts, Level, assess
from markerless_tracker.records import TrackState

CAMERAS = ("cam01", "cam02", "cam03")
LONG = QUIET_S + 1.0


def facts(**changes: Any) -> Facts:
    """A tracker that works."""
    fine = {
        "ready": True,
        "activity": "processing images",
        "state": TrackState.TRACKING,
        "cameras": CAMERAS,
        "ready_age_s": 60.0,
        "set_age_s": 0.1,
        "result_age_s": 0.1,
    }
    return Facts(**{**fine, **changes})


@pytest.mark.parametrize(
    ("changes", "level", "message"),
    [
        ({}, Level.OK, "TRACKING"),
        ({"skipped": 0.49}, Level.OK, "TRACKING"),
        (
            {"skipped": 0.714}, Level.OK,
            "TRACKING: 71 % of the sets are skipped: they come faster than this machine tracks "
            "them",
        ),
        ({"skipped": 0.9, "doubts": ("low",)}, Level.WARN, "TRACKING: doubt: low"),
        ({"state": TrackState.LOST}, Level.WARN, "LOST: person lost"),
        ({"doubts": ("too small", "too low")}, Level.WARN, "TRACKING: doubt: too small"),
        (
            {"doubts": ("too small",), "state": TrackState.LOST}, Level.WARN, "LOST: person lost",
        ),
        (
            {"state": TrackState.SEARCHING, "activity": "waiting for learn_background"},
            Level.WARN,
            "SEARCHING: waiting for learn_background",
        ),
        (
            {"ready": False, "activity": "compiling", "state": TrackState.SEARCHING},
            Level.WARN,
            "SEARCHING: compiling",
        ),
        (
            {"silent": CAMERAS, "set_age_s": LONG, "result_age_s": LONG},
            Level.STALE,
            "TRACKING: no image from any camera",
        ),
        (
            {
                "silent": CAMERAS, "set_age_s": None, "result_age_s": None, "ready_age_s": 1.0,
                "activity": "waiting for images", "state": TrackState.SEARCHING,
            },
            Level.WARN,
            "SEARCHING: waiting for images",
        ),
        (
            {"silent": ("cam02",), "set_age_s": LONG, "result_age_s": LONG},
            Level.WARN,
            "TRACKING: no complete set of images: none from cam02",
        ),
        (
            {
                "set_age_s": None, "result_age_s": None, "tolerance_s": 0.001,
                "offsets_ns": {"cam01": 0, "cam02": 2_000_001, "cam03": 0},
            },
            Level.WARN,
            "TRACKING: no complete set of images: stamps differ, cam02 by +2 ms; sync_tolerance "
            "is 0.001 s",
        ),
        (
            {
                "silent": CAMERAS, "set_age_s": LONG, "result_age_s": LONG,
                "refusals": {"cam01": "cam01/image_raw: an image of 16x4 px came"},
            },
            Level.WARN,
            "TRACKING: no complete set of images: cam01/image_raw: an image of 16x4 px came",
        ),
        (
            {"silent": CAMERAS, "set_age_s": LONG, "result_age_s": LONG, "repeating": True},
            Level.WARN,
            "TRACKING: no new set of images: the images repeat their stamps",
        ),
        (
            {"result_age_s": LONG, "last_error": "cam01: too dark"},
            Level.WARN,
            "TRACKING: no result for 2 s: cam01: too dark",
        ),
        (
            {"result_age_s": None, "activity": "waiting for the start frame"},
            Level.WARN,
            "TRACKING: waiting for the start frame",
        ),
        (
            {"left_out": ("cam03",), "silent": ("cam03",)},
            Level.WARN,
            "TRACKING: tracking without cam03: no image of cam03",
        ),
        (
            {"clock_missing": True},
            Level.WARN,
            "TRACKING; use_sim_time is set and no /clock is received",
        ),
    ],
)  # fmt: skip
def test_level_and_reason(changes: dict[str, Any], level: Level, message: str) -> None:
    health = assess(facts(**changes))
    assert (health.level, health.message) == (level, message)
    assert (health.trouble or "") in message
    waits = changes.get("activity") is not None
    assert bool(health.trouble) == ("result_age_s" in changes and not waits)
