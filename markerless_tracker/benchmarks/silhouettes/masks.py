"""Quality of silhouettes against exact masks, or against the body at the reference pose.

Undecided pixels are measured separately; the scores are those of the decided pixels. They are given
after imaging alone, and after the body at the reference pose has decided the undecided pixels near
it, as the predicted body does in tracking.

OpenCV's background subtractors MOG2 and KNN are measured on the same frames. They learn from the
same empty-scene images only, remove shadows by their own rule, and need the same morphological
cleaning afterwards (`imaging.segmentation.clean_mask`). Each method uses one thread. Times run from
the image to the cleaned silhouette, without the edge map.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.benchmarks.silhouettes.scene import ImageSet, SilhouetteScene
from markerless_tracker.body import BodyModel
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import Image, ImagingSettings, Segmenter, learn_background
from markerless_tracker.imaging.segmentation import clean_mask
from markerless_tracker.records import Observation
from markerless_tracker.results.result import versions
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.selection import (
    body_lines,
    explained_part,
    place_cones,
)
from markerless_tracker.tracking.evidence.undecided import decide

LEAK_PX = 5
"""False positives further than this from the exact mask count as leaked shadow."""

Mask = NDArray[np.bool_]
Segmentation = Callable[[Image], tuple[Mask, Mask | None]]
"""Returns masks (h, w) of person and undecided pixels; the second is None with two classes."""
Picture = Callable[[str, int, Image], None]


@dataclass(frozen=True)
class MaskScores:
    """Agreement of a mask with the exact one; all in 0..1, only `shadow_leak` may exceed 1.

    Attributes:
        iou, precision, recall, shadow_leak: of the decided pixels.
        undecided_share: fraction of the person's pixels that are undecided.
    """

    iou: float
    precision: float
    recall: float
    shadow_leak: float
    undecided_share: float = 0.0


def mask_scores(mask: Mask, exact: Mask, undecided: Mask | None = None) -> MaskScores:
    """Compare two masks (h, w); a share of nothing is 1, a leak beside nothing is 0."""
    person, share = int(exact.sum()), 0.0
    if undecided is not None:
        share = int((exact & undecided).sum()) / person if person else 0.0
        mask, exact = mask & ~undecided, exact & ~undecided
    both = int((mask & exact).sum())
    either = int((mask | exact).sum())
    found, true = int(mask.sum()), int(exact.sum())
    leak = 0.0
    # The distance to an empty mask is undefined.
    if true:
        away = cv2.distanceTransform((~exact).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        leak = int((mask & (np.asarray(away) > LEAK_PX)).sum()) / true
    return MaskScores(
        iou=both / either if either else 1.0,
        precision=both / found if found else 1.0,
        recall=both / true if true else 1.0,
        shadow_leak=leak,
        undecided_share=share,
    )


@dataclass
class _Tally:
    """Scores and times of one method, by camera."""

    rows: dict[str, list[MaskScores]] = field(default_factory=dict)
    imaging: dict[str, list[MaskScores]] = field(default_factory=dict)
    selected: dict[str, list[float]] = field(default_factory=dict)
    ms: dict[str, list[float]] = field(default_factory=dict)

    def mean(self, camera: str, key: str) -> float:
        return _mean(self.rows[camera], key)

    @property
    def iou_mean(self) -> float:
        return _over_cameras(self.rows, "iou")

    @property
    def median_ms(self) -> float:
        return float(np.median([value for values in self.ms.values() for value in values]))


def _mean(rows: list[MaskScores], key: str) -> float:
    return float(np.mean([getattr(row, key) for row in rows]))


def _over_cameras(rows: Mapping[str, list[MaskScores]], key: str) -> float:
    return float(np.mean([_mean(of, key) for of in rows.values()]))


def measure(
    scene: SilhouetteScene,
    config: TrackerConfig | None = None,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    picture: Picture | None = None,
) -> dict[str, Any]:
    """Measure silhouettes; keys as `benchmark silhouettes --json` prints them.

    With exact masks, `cameras` holds iou, precision, recall, shadow_leak and ms; `iou_mean` and
    `undecided_share` summarise them. These figures are those after the body at the reference pose
    has decided undecided pixels near it; `imaging` has those before. Without a reference pose both
    are the same.

    Without exact masks, `cameras` holds ms, `overlap` (IoU of the silhouette with the body at the
    reference pose) and `overlap_selected` (the same for the components that this body explains).
    `body` holds the body's name and radii; `undecided_share` is that of imaging alone. All are
    means over the frames, ms is their median.

    Args:
        scene: the scene.
        config: settings of the imaging and of the choice of components; defaults if None.
        progress: called with the number of frames done and their total.
        picture: called with camera, frame and a picture of every silhouette: false positives red,
            false negatives blue, undecided yellow, the rest of the silhouette green.

    Raises:
        ConfigError: `background.follow_s` is set.
        TrackerError: the recording cannot be read, or its images do not fit its background.
    """
    config = config or TrackerConfig()
    if config.background.follow_s > 0.0:
        raise ConfigError(
            f"background.follow_s is {config.background.follow_s:g}, expected 0: silhouettes are "
            "measured in single frames, which no background follows"
        )
    methods = {name: _methods(name, frames, config) for name, frames in scene.empty.items()}
    tallies = {method: _Tally() for method in ("own", "mog2", "knn")}
    with _one_thread():
        for count, views in enumerate(scene.frames()):
            masks = views.masks(scene.rig)
            own = {name: _timed(methods[name]["own"], views.images[name]) for name in masks}
            decided = _decided({name: found for name, (found, _) in own.items()}, scene, views)
            for camera, exact in masks.items():
                image = views.images[camera]
                for method, tally in tallies.items():
                    if method == "own":
                        (mask, undecided), ms = own[camera]
                    else:
                        (mask, undecided), ms = _timed(methods[camera][method], image)
                    tally.ms.setdefault(camera, []).append(ms)
                    if method == "own":
                        before = mask_scores(mask, exact, undecided)
                        tally.imaging.setdefault(camera, []).append(before)
                        if not views.exact:
                            selected = _selected(mask, undecided, scene, views, camera, config)
                            tally.selected.setdefault(camera, []).append(
                                mask_scores(selected[0], exact, selected[1]).iou
                            )
                        else:
                            mask, undecided = decided[camera]
                        if picture is not None:
                            drawn = draw_mask_errors(image, mask, exact, undecided)
                            picture(camera, views.index, drawn)
                    tally.rows.setdefault(camera, []).append(mask_scores(mask, exact, undecided))
            progress(count + 1, scene.frame_count)
    return _figures(scene, tallies)


def _figures(scene: SilhouetteScene, tallies: Mapping[str, _Tally]) -> dict[str, Any]:
    own = tallies["own"]
    cameras: dict[str, dict[str, float]] = {}
    for camera in own.rows:
        ms = {"ms": float(np.median(own.ms[camera]))}
        if scene.exact:
            keys = ("iou", "precision", "recall", "shadow_leak")
            cameras[camera] = {key: own.mean(camera, key) for key in keys} | ms
        else:
            cameras[camera] = {
                "overlap": own.mean(camera, "iou"),
                "overlap_selected": float(np.mean(own.selected[camera])),
            } | ms
    mean = "iou_mean" if scene.exact else "overlap_mean"
    figures: dict[str, Any] = {
        "recording": scene.name,
        "machine": machine(),
        "versions": versions(),
        "image_size": list(scene.rig.cameras[0].size_px),
        "frames": list(scene.indices),
        "exact": scene.exact,
        "cameras": cameras,
        mean: own.iou_mean,
        "undecided_share": _over_cameras(own.rows, "undecided_share"),
        "ms": own.median_ms,
        "opencv": {
            name: {mean: tallies[name].iou_mean, "ms": tallies[name].median_ms}
            for name in ("mog2", "knn")
        },
    }
    if scene.exact:
        figures["imaging"] = {
            "iou_mean": _over_cameras(own.imaging, "iou"),
            "undecided_share": _over_cameras(own.imaging, "undecided_share"),
        }
    else:
        figures["overlap_selected_mean"] = float(
            np.mean([values["overlap_selected"] for values in cameras.values()])
        )
        figures["body"] = {"name": scene.body.name, "radii_mm": radii_mm(scene.body)}
    return figures


def radii_mm(body: BodyModel) -> dict[str, list[float]]:
    """Half axes of each cone's two ends in mm: x and y of the base, x and y of the tip."""
    return {
        name: [round(float(value) * 1000.0, 1) for value in shape[:, :2].ravel()]
        for name, shape in zip(body.cone_names, body.cone_shape, strict=True)
    }


def draw_mask_errors(image: Image, mask: Mask, exact: Mask, undecided: Mask | None = None) -> Image:
    """The image (h, w, 3), darkened: silhouette green, false positives red, false negatives blue.

    All undecided pixels are yellow.
    """
    colour = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    out = np.asarray(colour // 2, dtype=np.uint8)
    out[mask & exact, 1] += np.uint8(90)
    out[mask & ~exact] = (0, 0, 255)
    out[exact & ~mask] = (255, 80, 0)
    if undecided is not None:
        out[undecided] = (0, 200, 200)
    return out


def _methods(camera: str, empty: list[Image], settings: ImagingSettings) -> dict[str, Segmentation]:
    segmenter = Segmenter(camera, learn_background(empty, settings, camera=camera), settings)

    def own(image: Image) -> tuple[Mask, Mask | None]:
        mask, undecided = segmenter.classes(image)
        return mask > 0, None if undecided is None else undecided > 0

    methods: dict[str, Segmentation] = {"own": own}
    for name, make in (
        ("mog2", cv2.createBackgroundSubtractorMOG2),
        ("knn", cv2.createBackgroundSubtractorKNN),
    ):
        methods[name] = _subtractor(make(history=max(len(empty), 2), detectShadows=True), empty,
                                   settings)  # fmt: skip
    # The first use compiles kernels and fills caches.
    for method in methods.values():
        method(empty[0])
    return methods


def _subtractor(model: Any, empty: list[Image], settings: ImagingSettings) -> Segmentation:
    # A model with a memory of many frames learns too little from one image.
    for image in empty * max(1, -(-10 // len(empty))):
        model.apply(image)

    def method(image: Image) -> tuple[Mask, Mask | None]:
        labels = model.apply(image, learningRate=0.0)
        mask = np.asarray(cv2.threshold(labels, 127, 255, cv2.THRESH_BINARY)[1], dtype=np.uint8)
        return clean_mask(mask, settings) > 0, None

    return method


def _selected(
    mask: Mask,
    undecided: Mask | None,
    scene: SilhouetteScene,
    views: ImageSet,
    camera: str,
    config: TrackerConfig,
) -> tuple[Mask, Mask | None]:
    """Person and undecided pixels of the components that the body at the reference explains."""
    assert views.pose is not None
    seen = _observation(camera, mask, undecided)
    margin_px = config.region.component_margin_px
    lines = body_lines(scene.rig[camera], place_cones(scene.body, views.pose))
    part = explained_part(seen, lines, margin_px)[0]
    return part.mask, part.undecided


def _decided(
    found: Mapping[str, tuple[Mask, Mask | None]], scene: SilhouetteScene, views: ImageSet
) -> Mapping[str, tuple[Mask, Mask | None]]:
    """Person and undecided pixels after the decision by the body at the reference, if known."""
    if views.pose is None or not views.exact:
        return found
    seen = {name: _observation(name, *of) for name, of in found.items()}
    cameras = {name: scene.rig[name] for name in found}
    decided = decide(seen, cameras, views.body, views.pose)
    return {name: (of.mask, of.undecided) for name, of in decided.items()}


def _observation(camera: str, mask: Mask, undecided: Mask | None) -> Observation:
    nothing = np.zeros(mask.shape, dtype=np.uint8)
    return Observation.from_mask(camera, 0, mask, nothing, undecided=undecided)


def _timed(method: Segmentation, image: Image) -> tuple[tuple[Mask, Mask | None], float]:
    """The classes, and the shorter of two times, since the first run has cold caches."""
    times = []
    for _ in range(2):
        start = time.perf_counter()
        found = method(image)
        times.append((time.perf_counter() - start) * 1e3)
    return found, min(times)


@contextmanager
def _one_thread() -> Iterator[None]:
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
