"""Recovery: frames until the person is tracked again after views were missing or black."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.with_truth import (
    Report,
    error_mm,
    no_report,
    open_with_truth,
)
from markerless_tracker.errors import DatasetError
from markerless_tracker.observation import no_edges
from markerless_tracker.records import Observation, pack_mask
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.tracker import Tracker

WITHIN_FRAMES = 15
"""A run has recovered if it is back within this many frames."""
TOLERANCE_MM = 20.0
"""A run is back if its error exceeds that of the undisturbed run by at most this."""
SETTLED_S = 0.5
"""Time at the beginning of the undisturbed run that its mean error leaves out."""
STABLE_FRAMES = 5
"""The error must stay low for this many frames with a reference."""
_FIRST_S, _LATER_S = 0.6, 0.15
"""Start of the disturbance with the first seed, and the delay from one seed to the next."""

Views = Mapping[str, Observation]
Frames = Sequence[tuple[int, Views]]


@dataclass(frozen=True)
class Disturbance:
    """A temporary disturbance of the views.

    Attributes:
        name: name in tables.
        seconds: duration.
        blind: number of cameras with black images; None = all.
        keep_hz: rate of the frames that arrive, None = all of them.
        stopped: number of cameras without any image.
    """

    name: str
    seconds: float
    blind: int | None = 0
    keep_hz: float | None = None
    stopped: int = 0


DISTURBANCES = (
    Disturbance("all views black, 0.5 s", 0.5, None),
    Disturbance("all views black, 2 s", 2.0, None),
    Disturbance("two cameras black, 1 s", 1.0, 2),
    Disturbance("one camera stops, 1 s", 1.0, stopped=1),
    Disturbance("10 frames/s, 1 s", 1.0, 0, 10.0),
)


def measure_recovery(
    source: Path,
    config: TrackerConfig,
    *,
    stature_m: float | None,
    scale: float = 1.0,
    seeds: int = 5,
    report: Report = no_report,
) -> dict[str, Any]:
    """Track a recording with a `ground_truth.trc` from an automatic start, with disturbances.

    Each seed disturbs at another time, beginning with another camera. Disturbances for which the
    recording is too short, and lower rates that it does not exceed, are left out.

    Args:
        source: the recording.
        config: every setting; the seed is replaced.
        stature_m: stature given to the start, m; None = unknown.
        scale: factor for the images.
        seeds: seeds 0 .. seeds - 1.
        report: receives progress.

    Returns:
        `recording`, `scale`, `undisturbed_mm` (mean error of the undisturbed run per seed), and
        `runs`: one entry per disturbance and seed with `frames_until_back` (frames after the
        disturbance until the error is at most the undisturbed one + `TOLERANCE_MM` for
        `STABLE_FRAMES` frames; None if it never is), `back` (whether that is within
        `WITHIN_FRAMES`), `meanwhile_mm` (mean error of the disturbed frames with a pose, None
        without any) and `worst_mm` (largest frame error afterwards).

    Raises:
        DatasetError: the recording is too short for every disturbance.
        TrackerError: the recording cannot be read, has no truth, or the person was not found.
    """
    runs: list[dict[str, Any]] = []
    undisturbed: list[float] = []
    with open_with_truth(source, config, scale=scale, report=report) as recording:
        truth, fps = recording.truth_m, recording.fps
        frames = list(recording.evidence.frames(every=1))
        part = f"runs on {recording.name}"
        known = np.asarray(np.isfinite(truth).any(axis=(1, 2)))
        chosen = [d for d in DISTURBANCES if d.keep_hz is None or d.keep_hz < fps]
        if all(_last(known, _times(one, fps, 0)[1]) is None for one in chosen):
            needed = min(_times(one, fps, 0)[1] for one in chosen) + WITHIN_FRAMES
            raise DatasetError(
                f"{source}: {len(frames)} frames, expected {STABLE_FRAMES} or more with a truth "
                f"after the first {needed}, for the shortest disturbance"
            )
        per_seed = 1 + len(chosen)
        for seed in range(seeds):
            seeded = replace(config, seed=seed)
            tracker = build_tracker(recording.evidence.rig, seeded, stature=stature_m).tracker
            tracker.warm_up()
            errors = _errors(tracker, frames, truth)
            settled = min(round(SETTLED_S * fps), len(errors) // 2)
            mean_mm = _mean(errors[settled:])
            if mean_mm is None:
                raise DatasetError(
                    f"{source}: the person was not found with seed {seed}, expected a track that "
                    "can be disturbed"
                )
            undisturbed.append(mean_mm)
            report(part, seed * per_seed + 1, seeds * per_seed)
            for number, disturbance in enumerate(chosen):
                begins, ends = _times(disturbance, fps, seed)
                last = _last(known, ends)
                if last is None:
                    continue
                seen = disturbed(frames[:last], begins, ends, disturbance, fps, first=seed)
                errors = _errors(tracker, seen, truth)
                until = frames_until(errors[ends:], mean_mm + TOLERANCE_MM)
                runs.append(
                    {
                        "disturbance": disturbance.name,
                        "seed": seed,
                        "begins": begins,
                        "frames_until_back": until,
                        "back": until is not None and until <= WITHIN_FRAMES,
                        "meanwhile_mm": _mean(errors[begins:ends]),
                        "worst_mm": _worst(errors[ends:]),
                    }
                )
                report(part, seed * per_seed + 2 + number, seeds * per_seed)
    return {
        "recording": recording.name,
        "scale": scale,
        "undisturbed_mm": undisturbed,
        "runs": runs,
    }


def _times(disturbance: Disturbance, fps: float, seed: int) -> tuple[int, int]:
    """Index of the first frame that a disturbance affects, and of the first one after it."""
    begins = round((_FIRST_S + _LATER_S * seed) * fps)
    return begins, begins + round(disturbance.seconds * fps)


def _last(known: NDArray[np.bool_], ends: int) -> int | None:
    """Number of frames to track to see whether the person is tracked again.

    Args:
        known: (n,) whether a frame has a reference.
        ends: index of the first frame after the disturbance.

    Returns:
        The number; None if too few frames with a reference follow.
    """
    after = ends + WITHIN_FRAMES + np.flatnonzero(known[ends + WITHIN_FRAMES :])
    return int(after[STABLE_FRAMES - 1]) + 1 if len(after) >= STABLE_FRAMES else None


def disturbed(
    frames: Frames, begins: int, ends: int, disturbance: Disturbance, fps: float, *, first: int = 0
) -> list[tuple[int, Views] | None]:
    """The frames with a disturbance from index `begins` up to `ends`; None = no frame arrives.

    The disturbed cameras are counted cyclically from camera number `first` on.
    """
    share = 1.0 if disturbance.keep_hz is None else min(1.0, disturbance.keep_hz / fps)
    out: list[tuple[int, Views] | None] = []
    for index, (stamp_ns, views) in enumerate(frames):
        if not begins <= index < ends:
            out.append((stamp_ns, views))
        elif _arrived(index - begins + 1, share) == _arrived(index - begins, share):
            out.append(None)
        else:
            names = [*views][first % len(views) :] + [*views][: first % len(views)]
            blind, gone = names[: disturbance.blind], names[: disturbance.stopped]
            kept = {
                name: _black(view) if name in blind else view
                for name, view in views.items()
                if name not in gone
            }
            out.append((stamp_ns, kept))
    return out


def _arrived(count: int, share: float) -> int:
    """Number of frames that arrive, of the first `count`, if a share of them does."""
    # Whole numbers are not missed by rounding.
    return int(count * share + 1e-6)


def frames_until(errors_mm: NDArray[np.float64], limit_mm: float) -> int | None:
    """Number (from 1) of the first of `STABLE_FRAMES` frames in a row with errors (n,) within a
    limit; None if there is none.

    Frames without a reference (NaN) are skipped; those without a pose (inf) exceed every limit.
    """
    rows = np.flatnonzero(~np.isnan(errors_mm))
    good = errors_mm[rows] <= limit_mm
    for first in range(len(good) - STABLE_FRAMES + 1):
        if good[first : first + STABLE_FRAMES].all():
            return int(rows[first]) + 1
    return None


def _mean(errors_mm: NDArray[np.float64]) -> float | None:
    known = errors_mm[np.isfinite(errors_mm)]
    return float(known.mean()) if known.size else None


def _worst(errors_mm: NDArray[np.float64]) -> float | None:
    known = errors_mm[np.isfinite(errors_mm)]
    return float(known.max()) if known.size else None


def _black(view: Observation) -> Observation:
    """The observation of a black image: every pixel differs from the background."""
    everywhere = pack_mask(np.ones((view.height, view.width), dtype=np.uint8))
    edges = no_edges((view.height, view.width))
    return replace(view, mask_words=everywhere, undecided_words=None, edges=edges)


def _errors(
    tracker: Tracker,
    frames: Sequence[tuple[int, Views] | None],
    truth: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean error (n,) of each frame, mm; inf without a pose, NaN without a frame or reference."""
    tracker.reset()
    errors = np.full(len(frames), np.nan)
    for index, frame in enumerate(frames):
        if frame is not None:
            result = tracker.step(frame[1], frame[0])
            value = error_mm(result, truth[index])
            without = np.inf if result.markers_m is None else np.nan
            errors[index] = without if value is None else value
    return errors
