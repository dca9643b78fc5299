"""From files and settings to a tracker, for the node and the offline verbs alike."""

from collections.abc import Mapping
from dataclasses import dataclass
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
from markerless_tracker.body.subject import complete_markers, measured_lengths
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.first_frame import StartMarkers, start_noise_m
from markerless_tracker.tracking.tracker import Tracker


@dataclass(frozen=True)
class TrackerSetup:
    """A tracker and the time its start pose is meant for; None = the first frame that comes.

    `person`: what is known of a person whose lengths were not measured; None if they were.
    """

    tracker: Tracker
    start_stamp_ns: int | None
    person: Unmeasured | None = None


@dataclass(frozen=True)
class _MarkerRow:
    """The first row of a marker file that holds anything."""

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
    """Build a tracker from a start (TRC or YAML) and a subject, from either or from neither.

    The subject is the file's, or measured on the first row of a TRC (`subject_from`), or a generic
    person of a stature, or, when none is named, measured on the start's first row; if that row's
    markers are noisy, the lengths measured on it are corrected in the first frame. Without a start
    the tracker finds the person automatically, without a subject the stature, too.

    Raises:
        ConfigError: more than one subject, or none and the start is no TRC.
        TrackerError: a file cannot be read or does not fit.
    """
    named = [
        name
        for name, value in (
            ("subject_file", subject_file),
            ("subject_from", subject_from),
            ("stature", stature),
        )
        if value is not None
    ]
    if len(named) > 1:
        raise ConfigError(f"{' and '.join(named)} both name a subject, expected one")
    description = load_description(config.body)
    start = (
        first_row(start_file)
        if start_file is not None and start_file.suffix.lower() == ".trc"
        else None
    )
    person: Unmeasured | None = None
    if subject_file is not None:
        subject = read_subject(subject_file)
    elif stature is not None:
        subject = subject_from_stature(description, stature)
        person = Unmeasured(Sizes(description), stature)
    elif subject_from is not None:
        subject = subject_from_markers(description, first_row(subject_from).markers_m)
    elif start is not None:
        subject = subject_from_markers(description, start.markers_m)
    elif start_file is None:
        subject = subject_from_stature(description, MEAN_STATURE_M)
        person = Unmeasured(Sizes(description), None)
    else:
        raise ConfigError(
            f"{start_file} gives a pose but no subject: name one "
            "(--subject, --subject-from or --stature)"
        )
    body = build_body(description, subject)
    pose: FloatArray | None = None
    if start is not None:
        pose = pose_from_markers(body, start.markers_m, limits=joint_limits(body, config))
    elif start_file is not None:
        pose = read_pose(start_file, body)
    tracker = Tracker(
        rig,
        body,
        config,
        start_pose=pose,
        backgrounds=backgrounds,
        shape_known=bool(subject.cones_m),
        start_markers=(
            None if named or start is None else _start_markers(description, subject, start)
        ),
        person=person,
    )
    return TrackerSetup(tracker, None if start is None else start.stamp_ns, person)


def first_row(path: Path) -> _MarkerRow:
    """Named markers (3,) of the first row of a TRC that holds any.

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


def _start_markers(
    description: BodyDescription, subject: Subject, start: _MarkerRow
) -> StartMarkers:
    missing = np.full(3, np.nan)
    known = complete_markers(start.markers_m)

    return StartMarkers(
        np.array([known.get(name, missing) for name in MARKER_NAMES]),
        start_noise_m(measured_lengths(description, start.markers_m)),
        Sizes(description),
    )
