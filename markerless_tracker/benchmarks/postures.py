"""Automatic starts on generated people in postures: squat, bent, seated, arms raised or crossed.

Their bodies differ from the tracker's cones. Rooms, clothes and cameras vary between starts.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from markerless_tracker.benchmarks.silhouettes.generated import SETS
from markerless_tracker.benchmarks.starts import StartPlan, one_start, summarise
from markerless_tracker.benchmarks.with_truth import Report, no_report
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.records import Observation
from markerless_tracker.synthesis.scenes import GeneratedScene
from markerless_tracker.tracking import TrackerConfig, build_tracker

POSTURES = ("squat", "bent", "seated", "raised", "crossed")
"""Postures of the generated people, in rotation."""
_EMPTY_IMAGES = 10


def posture_of(number: int, which: str = "development") -> tuple[int, str]:
    """Seed of the scene and posture of a start; the first 200 differ.

    Args:
        number: of the start, from 0.
        which: one of `SETS`: the development or the test scenes.
    """
    seeds = SETS[which]
    return (
        seeds[number % len(seeds)],
        POSTURES[(number + number // len(seeds)) % len(POSTURES)],
    )


def measure_postures(
    plan: StartPlan,
    count: int,
    *,
    which: str = "development",
    exact: bool = False,
    report: Report = no_report,
) -> dict[str, Any]:
    """Start automatically on generated people in postures, without stature or start pose.

    Args:
        plan: settings, and frames of each start; `every` and `seeds` are ignored.
        count: number of starts.
        which: one of `SETS`; no setting may be chosen by the test scenes.
        exact: exact silhouettes instead of images, which measures the start alone.
        report: receives progress.

    Returns:
        Figures as of `starts.measure_starts`; `starts` holds `seed` and `posture` of each, and
        `postures` the fraction that succeeded by posture.

    Raises:
        ConfigError: there is no such set.
    """
    if which not in SETS:
        raise ConfigError(f"set of scenes is {which!r}, expected one of {', '.join(SETS)}")
    starts: list[dict[str, Any]] = []
    for number in range(count):
        seed, posture = posture_of(number, which)
        scene = GeneratedScene(seed, motion=posture)
        frames = _observed(scene, plan.config, plan.frames, exact=exact)
        truth = np.array([scene.markers(i) for i in range(plan.frames)])
        tracker = build_tracker(scene.rig, plan.config).tracker
        if number == 0:
            tracker.warm_up()
        starts.append(
            {"frame": 0, "seed": seed, "posture": posture, **one_start(tracker, frames, truth)}
        )
        report("starts in postures", number + 1, count)
    return {
        "recording": f"postures, {which}{', exact silhouettes' if exact else ''}",
        "source": "generated",
        "scale": 1.0,
        "stature_m": None,
        "cameras": len(scene.rig),
        **summarise(starts),
        "postures": {
            name: summarise(these)["succeeded"]
            for name in POSTURES
            if (these := [start for start in starts if start["posture"] == name])
        },
        "starts": starts,
    }


def _observed(
    scene: GeneratedScene, config: TrackerConfig, frames: int, *, exact: bool
) -> list[tuple[int, Mapping[str, Observation]]]:
    """Stamp (ns) and evidence of the scene's first frames."""
    segmenters: dict[str, Segmenter] = {}
    if not exact:
        segmenters = {
            name: Segmenter(name, learn_background(empty, config, camera=name), config)
            for name, empty in scene.backgrounds(_EMPTY_IMAGES).items()
        }
    taken: list[tuple[int, Mapping[str, Observation]]] = []
    for index in range(frames):
        images, masks, _ = scene.frame(index)
        stamp_ns = scene.stamp_ns(index)
        if exact:
            views = {
                name: Observation.from_mask(name, stamp_ns, mask, np.zeros(mask.shape, np.uint8))
                for name, mask in masks.items()
            }
        else:
            views = {name: segmenters[name].observe(images[name], stamp_ns) for name in images}
        taken.append((stamp_ns, views))
    return taken
