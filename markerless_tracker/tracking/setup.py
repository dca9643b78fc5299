"""Builds a tracker from files and settings, for the node and the offline verbs alike."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from markerless_tracker.body import (
    MARKER_NAMES,
    Subject,
    load_description,
    pose_from_markers,
    read_pose,
    read_subject,
    subject_from_markers,
    subject_from_stature,
)
from markerless_tracker.body.build import build_body
from markerless_tracker.body.description import BodyDescription
from markerless_tracker.body.sizes import MEAN_STATURE_M, Sizes
from markerless_tracker.body.subject import complete_markers, is_subject_file, measured_lengths
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.first_frame import StartMarkers, start_noise_m
from markerless_tracker.tracking.start.required import require_parts_of_a_start
from markerless_tracker.tracking.tracker import Tracker

_START_SUFFIXES = (".trc", ".yaml", ".yml")


@dataclass(frozen=True)
class TrackerSetup:
    """A tracker, and how it was set up.

    Attributes:
        tracker: the tracker.
        make: makes another tracker with the same initial state; can be pickled.
        start_stamp_ns: time of the start pose; None = the first frame that comes.
        person: what is known of a person whose lengths were not measured; None if they were.
    """

    tracker: Tracker
    make: Callable[[], Tracker]
    start_stamp_ns: int | None
    person: Unmeasured | None = None


@dataclass(frozen=True)
class _MarkerRow:
    """The first row of a marker file with any marker."""

    stamp_ns: int
    markers_m: Mapping[str, FloatArray]


def build_tracker(
    rig: CameraRig,
    config: TrackerConfig,
    *,
    backgrounds: Mapping[str, BackgroundModel] | None = None,
    start_file: Path | None = None,
    subject_file: Path | None = None,
    subject_from: Path | None = None,
    stature: float | None = None,
) -> TrackerSetup:
    """Build a tracker with or without a start pose, and with or without a subject.

    At most one of the last three arguments names the subject. If none does, the lengths are
    measured on the first row of a TRC start; noisy lengths are corrected in the first frame.
    Without a start the tracker finds the person, and the stature, automatically.

    Args:
        rig: the cameras.
        config: every setting.
        backgrounds: the empty scene per camera, as `Tracker` takes it.
        start_file: start pose: a TRC, whose first row is used, or a YAML.
        subject_file: the person's lengths.
        subject_from: a TRC; the lengths are measured on its first row.
        stature: the person's height, m; the lengths are those of a generic person.

    Raises:
        ConfigError: more than one subject, or none and the start is no TRC; or a body that cannot
            be found automatically, without a start pose or with `search_again`.
        TrackerError: a file cannot be read or does not fit.
    """
    given = {"subject_file": subject_file, "subject_from": subject_from, "stature": stature}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise ConfigError(f"{' and '.join(named)} both name a subject, expected one")
    description = load_description(config.body)
    start = (
        first_row(start_file)
        if start_file is not None and start_file.suffix.lower() == ".trc"
        else None
    )
    if start_file is not None and start_file.suffix.lower() not in _START_SUFFIXES:
        raise ConfigError(
            f"{start_file}: no start pose, expected the markers (.trc) or a pose (.yaml)"
        )
    if start_file is not None and start is None and is_subject_file(start_file):
        raise ConfigError(f"{start_file}: a subject, no start pose; expected it as the subject")
    if start_file is not None and start is None and not named:
        raise ConfigError(
            f"{start_file} gives a pose but no subject: name one "
            "(--subject, --subject-from or --stature)"
        )
    measured = start if subject_from is None else first_row(subject_from)
    subject, person = _subject(description, subject_file, stature, measured)
    body = build_body(description, subject)
    pose: FloatArray | None = None
    if start is not None:
        pose = pose_from_markers(body, start.markers_m, limits=joint_limits(body, config))
    elif start_file is not None:
        pose = read_pose(start_file, body)
    if pose is None or config.search_again:
        require_parts_of_a_start(body)
    make = partial(
        Tracker,
        rig,
        body,
        config,
        start_pose=pose,
        backgrounds=backgrounds,
        shape_known=bool(subject.cones_m),
        start_markers=(None if named or start is None else _start_markers(description, start)),
        person=person,
    )
    return TrackerSetup(make(), make, None if start is None else start.stamp_ns, person)


def _subject(
    description: BodyDescription,
    subject_file: Path | None,
    stature_m: float | None,
    measured: _MarkerRow | None,
) -> tuple[Subject, Unmeasured | None]:
    """The subject, and what is known of a person whose lengths were not measured.

    The subject is that of the file, else of the stature, else of the markers, else of mean stature.
    """
    if subject_file is not None:
        return read_subject(subject_file), None
    if stature_m is None and measured is not None:
        return subject_from_markers(description, measured.markers_m), None
    known = MEAN_STATURE_M if stature_m is None else stature_m
    return subject_from_stature(description, known), Unmeasured(Sizes(description), stature_m)


def first_row(path: Path) -> _MarkerRow:
    """Named markers (3,) of the first row of a TRC with any marker.

    Raises:
        DatasetError: the file cannot be read.
        ConfigError: it holds no marker at all.
    """
    track = read_trc(path)
    rows = np.flatnonzero(track.tracked)
    if rows.size == 0:
        raise ConfigError(f"{path}: holds no marker in any row")
    row = int(rows[0])
    named = dict(zip(track.names, track.positions_m[row], strict=True))
    return _MarkerRow(int(track.stamps_ns[row]), named)


def _start_markers(description: BodyDescription, start: _MarkerRow) -> StartMarkers:
    missing = np.full(3, np.nan)
    known = complete_markers(start.markers_m)
    return StartMarkers(
        np.array([known.get(name, missing) for name in MARKER_NAMES]),
        start_noise_m(measured_lengths(description, start.markers_m)),
        Sizes(description),
    )
