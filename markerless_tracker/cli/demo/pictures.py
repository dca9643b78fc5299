"""The body of a result drawn over the images of all views, and its overlap with the person."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.datasets import open_recording
from markerless_tracker.drawing import draw_overlay, overlay_sheet
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackState
from markerless_tracker.results.journal import read_summary

Frame = Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """The result of a tracker, as far as the demo shows it.

    Attributes:
        body: name or file of the tracked body.
        frames: entries of the frames in which the person was tracked.
    """

    body: str
    frames: Sequence[Frame]


def read_outcome(result: Path) -> Outcome:
    """Read `result`.json, or the journal of a run that did not end.

    Raises:
        DatasetError: the file is missing, not a result, or has no tracked frame.
    """
    path = result.with_name(result.name + ".json")
    content = read_summary(result)
    try:
        body, frames = content["settings"]["body"], content["frames"]
    except KeyError as error:
        raise DatasetError(f"{path}: no result of a tracker ({error})") from error
    tracked = [frame for frame in frames if frame["state"] == TrackState.TRACKING.value]
    if not tracked:
        raise DatasetError(f"{path}: the person was tracked in none of {len(frames)} frames")
    return Outcome(body, tracked)


def mean_overlap(frames: Sequence[Frame]) -> dict[str, float]:
    """Camera -> overlap (IoU) of silhouette and projected body, mean over frames."""
    values: dict[str, list[float]] = {}
    for frame in frames:
        for camera, overlap in frame["iou"].items():
            values.setdefault(camera, []).append(overlap)
    return {camera: float(np.mean(found)) for camera, found in values.items()}


def draw_pictures(bag: Path, frames: Sequence[Frame], body: BodyModel, folder: Path) -> list[Path]:
    """Draw the body over all views of the first, middle and last tracked frame.

    Args:
        bag: the bag with the images.
        frames: the frames of an `Outcome`.
        body: the tracked body.
        folder: gets `NAME_FFFFFF.png` of each view and `all_FFFFFF.png` of all views.

    Returns:
        The sheets of all views.
    """
    recording = open_recording(bag)
    chosen = {frames[i]["stamp_ns"]: frames[i] for i in (0, len(frames) // 2, len(frames) - 1)}
    folder.mkdir(parents=True, exist_ok=True)
    sheets = []
    for shown in recording.frames():
        frame = chosen.get(shown.stamp_ns)
        if frame is None:
            continue
        pose = np.array(frame["parameters"], dtype=np.float64)
        views = {
            camera.name: draw_overlay(shown.images[camera.name], camera, body, pose)
            for camera in recording.rig
        }
        for name, picture in views.items():
            _write(folder / f"{name}_{shown.index:06d}.png", picture)
        sheets.append(folder / f"all_{shown.index:06d}.png")
        _write(sheets[-1], overlay_sheet(views))
    return sheets


def _write(path: Path, picture: Any) -> None:
    if not cv2.imwrite(str(path), picture):
        raise DatasetError(f"{path}: the picture cannot be written")
