"""The trials of a batch: the arguments of each, and the key of its result's dependencies."""

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markerless_tracker.benchmarks.tables.fingerprint import file_key, recording_key, run_key
from markerless_tracker.cli.batch.table import JSON
from markerless_tracker.cli.batch.trial import Trial
from markerless_tracker.cli.track import given_settings, read_config
from markerless_tracker.errors import ConfigError

NOT_OF_TRACK = ("source", "out", "json", "force", "jobs", "scheduler")
"""Arguments of `batch` that `track` lacks, or that differ between trials."""
_OUTPUTS = {"debug_images": "--debug-images", "refine_calibration": "--refine-calibration"}
_MAYBE_FILES = ("body", "time_offsets")


def plan(args: argparse.Namespace, found: Mapping[str, Path], *, threads: int) -> list[Trial]:
    """The trials of the given recordings.

    Args:
        args: parsed arguments of `batch`.
        found: name -> absolute path of every recording.
        threads: threads of each trial, unless the arguments set them.

    Raises:
        ConfigError: a setting is impossible, an output of all trials would be one file, or a
            result would have the name of the table.
    """
    taken = Path(JSON).stem
    if taken in found:
        raise ConfigError(
            f"{found[taken]}: a recording of the name {taken}, expected another name: {JSON} "
            "in OUT is the table of the batch"
        )
    config = read_config(args.config, given_settings(args))
    options = {key: value for key, value in vars(args).items() if key not in NOT_OF_TRACK}
    for key, option in _OUTPUTS.items():
        if options[key] is not None and "{name}" not in str(options[key]):
            raise ConfigError(
                f"{option} {options[key]}: is the same for all recordings, expected {{name}} in it"
            )
    # Results do not depend on the number of threads.
    settings = {key: value for key, value in config.as_mapping().items() if key != "threads"}
    if not config.threads:
        options["threads"] = threads
    out = Path(os.path.abspath(args.out))
    return [_trial(name, source, out, options, settings) for name, source in found.items()]


def _trial(
    name: str, source: Path, out: Path, options: Mapping[str, Any], settings: Mapping[str, Any]
) -> Trial:
    own = {key: _filled(key, value, name, source) for key, value in options.items()}
    # The key has the settings in place of their options, and the content of files that are read,
    # not their names.
    files = {
        key: str(value) if key in _OUTPUTS else _content(key, value)
        for key, value in own.items()
        if key not in settings and key not in ("config", "threads")
    }
    parts = {
        "settings": settings,
        "options": files,
        "body": file_key(Path(own["body"] or settings["body"])),
        "recording": _recording(source, out),
    }
    return Trial(name, source, out, run_key(parts), own)


def _filled(option: str, value: Any, name: str, source: Path) -> Any:
    """An argument with this trial's name and source; paths become absolute, for other processes."""
    if not isinstance(value, str | Path):
        return value
    text = str(value).replace("{source}", str(source)).replace("{name}", name)
    if isinstance(value, Path):
        return Path(os.path.abspath(text))
    return os.path.abspath(text) if option in _MAYBE_FILES and os.path.isfile(text) else text


def _content(option: str, value: Any) -> Any:
    if option in _MAYBE_FILES and isinstance(value, str) and os.path.isfile(value):
        return file_key(Path(value))
    if isinstance(value, Path):
        return recording_key(value) if value.is_dir() else file_key(value)
    return value


def _recording(source: Path, out: Path) -> str:
    """Key of a recording; the results may lie in its folder."""
    try:
        return recording_key(source, without=out)
    except OSError:
        # Its trial will report the error.
        return str(source)
