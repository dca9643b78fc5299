"""Mocap of HumanEva: joints of a C3D or a marker file at the times of the images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.formats.numbers import read_numbers
from markerless_tracker.datasets.markers.c3d import read_markers
from markerless_tracker.datasets.markers.sets import MARKER_SETS, renamed
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError

_SEGMENTS = {
    "Hip": "FEP", "Knee": "FEO", "Ankle": "TIO", "Shoulder": "CLO", "Elbow": "HUO", "Wrist": "RAO",
}  # fmt: skip
"""Joint -> point of a segment's frame that is its centre, after L or R."""


@dataclass(frozen=True)
class Sync:
    """Which frame of the mocap belongs to an image; both count from 1.

    Attributes:
        image: number of an image.
        mocap: number of its frame of mocap.
        scale: frames of mocap per image.
    """

    image: float
    mocap: float
    scale: float

    def __str__(self) -> str:
        return f"{self.image:g} {self.mocap:g} {self.scale:g}"

    def agrees(self, other: "Sync") -> bool:
        """Whether both give the same frame of mocap for all images, within half an image."""
        there = other.mocap + (self.image - other.image) * other.scale
        same = abs(self.scale - other.scale) < 1e-4 * other.scale
        return same and abs(self.mocap - there) < 0.5 * other.scale

    def stamps_ns(self, frames: int, fps: float) -> NDArray[np.int64]:
        """(n,) times of the frames of mocap in the video, whose image 1 is at 0; ns."""
        images = self.image + (np.arange(1, frames + 1) - self.mocap) / self.scale
        return np.asarray(np.rint((images - 1.0) * (1e9 / fps)), dtype=np.int64)


def read_sync(path: Path) -> Sync:
    """Read an `.ofs`: number of an image, number of its frame of mocap, frames per image.

    Raises:
        DatasetError: the file cannot be read or is malformed.
    """
    image, mocap, scale = read_numbers(path, "im_st mc_st mc_sc", 3).tolist()
    if scale <= 0.0:
        raise DatasetError(f"{path}: mc_sc is {scale:g}, expected above 0")
    return Sync(image, mocap, scale)


def read_mocap(path: Path, sync: Sync, fps: float) -> MarkerTrack:
    """The limb joints of a C3D, or the markers of a `.trc` under HumanEva's names or ours.

    Of a C3D the centres of hips, knees, ankles, shoulders, elbows and wrists are read, which are
    points of its segments; HumanEva's own points of torso and head need the subject's sizes. Frames
    before the first image are left out. A frame in which a point is missing lacks that joint.

    Args:
        path: the file; frame 1 is its first row.
        sync: of the images.
        fps: rate of the images, 1/s.

    Raises:
        DatasetError: the file cannot be read, or lacks a joint.
    """
    track = read_markers(path)
    if path.suffix.lower() == ".c3d":
        track = _joints(path, track)
    else:
        known = any(name.endswith(("Proximal", "Distal")) for name in track.names)
        track = renamed(track, MARKER_SETS["humaneva"]) if known else track
    stamps = sync.stamps_ns(len(track), fps)
    inside = stamps >= 0
    return MarkerTrack(track.names, stamps[inside], track.positions_m[inside])


def _joints(path: Path, track: MarkerTrack) -> MarkerTrack:
    names, columns = [], []
    for joint, point in _SEGMENTS.items():
        for side in "LR":
            label = f"{side}{point}"
            # Labels may begin with the subject's name.
            found = [name for name in track.names if name.endswith(label)]
            if not found:
                raise DatasetError(
                    f"{path}: no label {label}, expected the points of the segments; got "
                    f"{', '.join(track.names[:8])}, ..."
                )
            names.append(f"{side}{joint}")
            columns.append(track.names.index(found[0]))
    return MarkerTrack(tuple(names), track.stamps_ns, track.positions_m[:, columns])
