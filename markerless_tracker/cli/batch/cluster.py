"""Trials on the workers of a Dask cluster.

The workers need the recordings and the folder of the results at the same paths.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from markerless_tracker.benchmarks.cluster import check_same, code_and_versions, submitted
from markerless_tracker.cli.batch.trial import Trial, do_trial, failed
from markerless_tracker.errors import SearchError


def on_cluster(trials: Sequence[Trial], scheduler: str) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Trials and their rows, in order of completion.

    If a worker dies, Dask gives its trial to another one.

    Args:
        trials: the trials.
        scheduler: address, such as tcp://host:8786.

    Raises:
        ConfigError: Dask is not installed, the scheduler does not answer or has no worker, or a
            worker has other code or versions.
    """
    same = code_and_versions()
    with submitted(scheduler, do_there, [(trial, same) for trial in trials]) as answers:
        for number, answer in answers:
            try:
                row = answer()
            except SearchError as error:
                row = failed(trials[number], str(error))
            yield trials[number], row


def do_there(trial: Trial, same: Mapping[str, str]) -> dict[str, Any]:
    """Run a trial on a worker: see `do_trial`.

    Raises:
        ConfigError: the worker has other code or versions than `same` (`code_and_versions`).
    """
    check_same(same)
    return do_trial(trial)
