"""Builds the tracker from the arguments of `track`, after the first pass if there are two."""

import argparse
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from markerless_tracker.body import Subject, write_subject
from markerless_tracker.cli.terminal.notices import COMPILING, Notices
from markerless_tracker.compiled import compilation
from markerless_tracker.datasets import Recording
from markerless_tracker.errors import ConfigError
from markerless_tracker.results.run import (
    frames_to_track,
    recording_backgrounds,
    track_recording,
)
from markerless_tracker.tracking import TrackerConfig, TrackerSetup, build_tracker
from markerless_tracker.tracking.person.whole import WholeRecording


def set_up(
    args: argparse.Namespace, recording: Recording, config: TrackerConfig, notices: Notices
) -> TrackerSetup:
    """The tracker of the last pass; if there are two passes, the first one is run before.

    Raises:
        ConfigError: two passes, and the person is known already.
        TrackerError: as `build_tracker`.
    """
    setup = _built(args, recording, config, None)
    if args.passes == 1:
        return setup
    if setup.person is None:
        raise ConfigError(
            "--passes 2 fits the body in the first pass: neither a start nor a subject may be given"
        )
    with _subject_of_first_pass(args, recording, config, setup, notices) as subject:
        return _built(args, recording, config, subject)


@contextmanager
def _subject_of_first_pass(
    args: argparse.Namespace,
    recording: Recording,
    config: TrackerConfig,
    setup: TrackerSetup,
    notices: Notices,
) -> Iterator[Path | None]:
    """The subject file of the body that fits the whole recording; None if nobody was tracked."""
    tracker, person, whole = setup.tracker, setup.person, WholeRecording()
    assert person is not None
    with closing(tracker.evidence) as evidence:
        evidence.start_process()
        notices.begin(COMPILING)
        with compilation(lambda _, done, most: notices.step(done, most)):
            tracker.warm_up()
        notices.begin("first pass", frames_to_track(recording, setup, args.fps))
        for done, tracked in enumerate(track_recording(recording, setup, fps=args.fps), 1):
            whole.add(tracked.result)
            notices.pose(tracked.result.state, tracked.result.iou.values())
            notices.step(done)
    body = tracker.body
    if not whole.chosen(body):
        yield None
        return
    body = replace(whole.fitted(tracker.rig, body, config, person), measured=False)
    cones = dict(zip(body.cone_names, body.cone_shape, strict=True))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "fitted.yaml"
        write_subject(path, Subject("fitted", dict(body.lengths_m), cones, measured=False))
        yield path


def _built(
    args: argparse.Namespace, recording: Recording, config: TrackerConfig, subject: Path | None
) -> TrackerSetup:
    return build_tracker(
        recording.rig,
        config,
        backgrounds=(
            recording_backgrounds(recording, config, args.background)
            if args.masks is None
            else None
        ),
        start_file=args.start,
        subject_file=args.subject if subject is None else subject,
        subject_from=args.subject_from,
        stature=args.stature if subject is None else None,
    )
