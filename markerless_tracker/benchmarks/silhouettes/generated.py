"""Quality of silhouettes on generated scenes with sampled rooms and clothes.

The sampled motion of every scene is measured, then its sampled posture. No threshold may be chosen
on the test scenes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from markerless_tracker.benchmarks.silhouettes.masks import Picture, measure
from markerless_tracker.benchmarks.silhouettes.scene import BODY, ImageSet, SilhouetteScene
from markerless_tracker.body import MARKER_NAMES, load_description, pose_from_markers
from markerless_tracker.body.build import build_body
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis.scenes import (
    DEVELOPMENT_SEEDS,
    TEST_SEEDS,
    GeneratedScene,
    sample_scene,
)
from markerless_tracker.tracking import TrackerConfig

SETS: Mapping[str, tuple[int, ...]] = {"development": DEVELOPMENT_SEEDS, "test": TEST_SEEDS}
"""Seeds by the name of the set."""
FRAMES = 3
"""Number of frames measured of each motion; a posture has one."""
_APART = 40
_EMPTY_IMAGES = 10
_MEANS = ("cameras", "iou_mean", "undecided_share", "imaging", "ms", "opencv")


def generated_scene(seed: int, *, posture: bool = False, frames: int = FRAMES) -> SilhouetteScene:
    """A generated scene with exact masks.

    Args:
        seed: of the scene.
        posture: show its posture instead of its motion.
        frames: number of frames, 40 apart.
    """
    spec = sample_scene(seed)
    scene = GeneratedScene(spec, motion=spec.posture if posture else spec.motion)
    indices = tuple(_APART * i for i in range(frames))
    # The tracker's body, whose cross-sections differ from the person's.
    body = build_body(load_description(BODY), scene.subject())

    def make() -> Iterator[ImageSet]:
        for index in indices:
            images, masks, _ = scene.frame(index)
            truth = dict(zip(MARKER_NAMES, scene.markers(index), strict=True))
            yield ImageSet(index, images, masks, body, pose_from_markers(body, truth))

    empty = scene.backgrounds(_EMPTY_IMAGES)
    name = f"scene {seed} {scene.motion.kind}"
    return SilhouetteScene(name, scene.rig, empty, indices, True, body, make)


def measure_generated(
    which: str,
    config: TrackerConfig | None = None,
    *,
    scenes: int | None = None,
    frames: int = FRAMES,
    progress: Callable[[int, int], None] = lambda done, total: None,
    picture: Callable[[str], Picture] | None = None,
) -> dict[str, Any]:
    """Measure silhouettes on a set of generated scenes; keys as in `measure`.

    The figures of `measure` are means over the scenes. In addition, `scenes` holds those of each
    scene with its `seed`, `motion` and `posture`; `iou_median`, `iou_worst` and `worst_seed`
    summarise them.

    Args:
        which: one of `SETS`.
        config: settings; defaults if None.
        scenes: measure only the first `scenes` ones; None = all.
        frames: frames of each motion.
        progress: called with the number of scenes done and their total.
        picture: returns the receiver of pictures for a scene's name; see `measure`.

    Raises:
        ConfigError: there is no such set.
    """
    if which not in SETS:
        raise ConfigError(f"set of scenes is {which!r}, expected one of {', '.join(SETS)}")
    seeds = SETS[which][:scenes]
    rows: list[dict[str, Any]] = []
    last: Mapping[str, Any] = {}
    for seed in seeds:
        parts = []
        for posture, count in ((False, frames), (True, 1)):
            scene = generated_scene(seed, posture=posture, frames=count)
            receiver = None if picture is None else picture(scene.name)
            parts.append(measure(scene, config, picture=receiver))
        spec = sample_scene(seed)
        weights = (frames, 1)
        row = {"seed": seed, "motion": spec.motion, "posture": spec.posture}
        row |= {"motion_iou": parts[0]["iou_mean"], "posture_iou": parts[1]["iou_mean"]}
        row |= {key: _mean([p[key] for p in parts], weights) for key in _MEANS if key in parts[0]}
        rows.append(row)
        last = parts[0]
        progress(len(rows), len(seeds))
    worst = min(rows, key=lambda row: float(row["iou_mean"]))
    equal = (1,) * len(rows)
    alike = {key: last[key] for key in ("machine", "versions", "image_size", "exact")}
    return {
        "recording": f"generated {which}",
        **alike,
        "frames": [_APART * i for i in range(frames)],
        **{key: _mean([row[key] for row in rows], equal) for key in _MEANS if key in worst},
        "iou_median": float(np.median([row["iou_mean"] for row in rows])),
        "iou_worst": worst["iou_mean"],
        "worst_seed": worst["seed"],
        "scenes": rows,
    }


def _mean(values: Sequence[Any], weights: Sequence[int]) -> Any:
    """The weighted mean of numbers, or of dictionaries of numbers with the same keys."""
    if isinstance(values[0], Mapping):
        return {key: _mean([value[key] for value in values], weights) for key in values[0]}
    return float(np.average(values, weights=weights))
