"""How soon the tracker is back after it saw nothing, or less, for a while."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.starts import error_mm, true_markers
from markerless_tracker.benchmarks.tables.accuracy import TRUTH
from markerless_tracker.benchmarks.tables.evidence import make_evidence
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Observation, pack_mask
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.tracker import Tracker

WITHIN_FRAMES = 15
OVER_USUAL_MM = 20.0
SETTLED_S = 0.5
"""The usual error is that of an undisturbed run, without as much at its beginning."""
_STAYS = 5
_FIRST_S, _LATER_S = 0.6, 0.15

Views = Mapping[str, Observation]
Frames = Sequence[tuple[int, Views]]


@dataclass(frozen=True)
class Disturbance:
    """What happens to the views for a while.

    Attributes:
        name: for tables.
        seconds: how long.
        blind: how many cameras see black; None = all.
        keep_hz: rate of the frames that come, None = all of them.
        stopped: how many cameras send nothing.
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
    progress: Callable[[str, int, int | None], None] | None = None,
) -> dict[str, Any]:
    """Disturb runs on a recording with a `ground_truth.trc`, which only judges.

    Each seed is disturbed at another moment, from another camera on. What a recording is too short
    for is left out.

    Returns:
        `recording`, `usual_mm` (per seed), and `runs`: one entry per disturbance and seed with
        `frames_until_back` (frames seen again until the error is at most the usual one +
        `OVER_USUAL_MM` and stays so; None if it never is) and `back` (whether that is within
        `WITHIN_FRAMES`); `meanwhile_mm`, `worst_mm`: mean error of the disturbed frames that have
        a pose (None if none has), and greatest frame error afterwards.

    Raises:
        TrackerError: the recording cannot be read or has no truth.
    """
    report = progress or (lambda part, done, total: None)
    recording = open_recording(source, scale=scale)
    path = (source if source.is_dir() else source.parent) / TRUTH
    if not path.is_file():
        raise DatasetError(f"{source}: no {TRUTH}, expected one to judge by")
    reference = read_trc(path).with_pelvis()
    runs: list[dict[str, Any]] = []
    usual: list[float] = []
    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
        evidence = make_evidence(
            recording,
            config,
            Path(folder),
            progress=lambda n: report(f"evidence of {recording.name}", n, recording.frame_count),
        )
        truth = true_markers(evidence, reference)
        frames = list(evidence.frames(every=1))
        total = seeds * (1 + len(DISTURBANCES))
        for seed in range(seeds):
            seeded = replace(config, seed=seed)
            tracker = build_tracker(evidence.rig, seeded, stature=stature_m).tracker
            tracker.warm_up()
            begins = round((_FIRST_S + _LATER_S * seed) * recording.fps)
            calm = _errors(tracker, frames, truth)
            settled = min(round(SETTLED_S * recording.fps), len(calm) // 2)
            if not np.isfinite(calm[settled:]).any():
                raise DatasetError(f"{source}: nobody was tracked, seed {seed}: nothing to disturb")
            usual.append(float(np.nanmean(calm[settled:])))
            report(f"runs on {recording.name}", seed * (1 + len(DISTURBANCES)) + 1, total)
            for number, disturbance in enumerate(DISTURBANCES):
                ends = begins + round(disturbance.seconds * recording.fps)
                last = ends + WITHIN_FRAMES + _STAYS
                if last > len(frames):
                    continue
                seen = disturbed(
                    frames[:last], begins, ends, disturbance, recording.fps, first=seed
                )
                errors = _errors(tracker, seen, truth)
                until = frames_until(errors[ends:], usual[-1] + OVER_USUAL_MM)
                runs.append(
                    {
                        "disturbance": disturbance.name,
                        "seed": seed,
                        "begins": begins,
                        "frames_until_back": until,
                        "back": until is not None and until <= WITHIN_FRAMES,
                        "meanwhile_mm": _mean(errors[begins:ends]),
                        "worst_mm": float(np.nanmax(errors[ends:], initial=0.0)),
                    }
                )
                report(f"runs on {recording.name}", seed * (1 + len(DISTURBANCES)) + 2 + number,
                       total)  # fmt: skip
    return {"recording": recording.name, "scale": scale, "usual_mm": usual, "runs": runs}


def disturbed(
    frames: Frames, begins: int, ends: int, disturbance: Disturbance, fps: float, *, first: int = 0
) -> list[tuple[int, Views] | None]:
    """The frames with a disturbance from one index up to another; None where no frame comes.

    Cameras are disturbed from the `first` one on, in a circle.
    """
    every = 1 if disturbance.keep_hz is None else max(1, round(fps / disturbance.keep_hz))
    out: list[tuple[int, Views] | None] = []
    for index, (stamp_ns, views) in enumerate(frames):
        if not begins <= index < ends:
            out.append((stamp_ns, views))
        elif (index - begins + 1) % every:
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


def frames_until(errors_mm: NDArray[np.float64], limit_mm: float) -> int | None:
    """Frames (from 1) until the errors (n,) are within a limit and stay so for some frames."""
    good = errors_mm <= limit_mm
    for first in range(len(good) - _STAYS + 1):
        if good[first : first + _STAYS].all():
            return first + 1
    return None


def _mean(errors_mm: NDArray[np.float64]) -> float | None:
    known = errors_mm[np.isfinite(errors_mm)]
    return float(known.mean()) if known.size else None


def _black(view: Observation) -> Observation:
    """What the imaging makes of a black image: everything differs from the background."""
    everywhere = pack_mask(np.ones((view.height, view.width), dtype=np.uint8))
    return replace(view, mask_words=everywhere)


def _errors(
    tracker: Tracker,
    frames: Sequence[tuple[int, Views] | None],
    truth: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean error (n,) of each frame, mm; NaN without a frame, pose or truth."""
    tracker.reset()
    errors = np.full(len(frames), np.nan)
    for index, frame in enumerate(frames):
        if frame is not None:
            value = error_mm(tracker.step(frame[1], frame[0]), truth[index])
            errors[index] = np.nan if value is None else value
    return errors
