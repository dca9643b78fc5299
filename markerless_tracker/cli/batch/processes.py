"""Trials in parallel processes of this machine; the trial of a process that dies is repeated."""

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from markerless_tracker.cli.batch.trial import Trial, do_trial, failed

ATTEMPTS = 3
"""Largest number of attempts at a trial whose process dies."""

Do = Callable[[Trial], dict[str, Any]]


def on_processes(
    trials: Sequence[Trial], jobs: int, do: Do = do_trial
) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Trials and their rows, in order of completion.

    Each process runs many trials, one at a time. If it dies, another process replaces it and its
    trial is tried again, `ATTEMPTS` times in all.

    Args:
        trials: the trials.
        jobs: number of processes.
        do: runs a trial; a module-level function, so that it can be pickled.
    """
    waiting = deque(trials)
    deaths: Counter[str] = Counter()
    workers: list[_Worker] = []
    try:
        while waiting or any(worker.trial for worker in workers):
            while waiting and len(workers) < jobs:
                workers.append(_Worker(do))
            for worker in workers:
                if worker.trial is None and waiting:
                    worker.begin(waiting.popleft())
            busy = {worker.pipe: worker for worker in workers if worker.trial is not None}
            for pipe in wait(list(busy)):
                worker = busy[pipe]  # type: ignore[index]
                trial = worker.trial
                assert trial is not None
                row = worker.row()
                if row is not None:
                    yield trial, row
                    continue
                worker.end()
                workers.remove(worker)
                deaths[trial.name] += 1
                if deaths[trial.name] < ATTEMPTS:
                    waiting.appendleft(trial)
                else:
                    died = f"its process died {ATTEMPTS} times: killed, or out of memory"
                    yield trial, failed(trial, died)
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process and the trial that it runs."""

    def __init__(self, do: Do) -> None:
        # Forked children would inherit threads' locks in an unknown state.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, do), daemon=True)
        self._process.start()
        # If the other end were open here, the death of the process would go unnoticed.
        theirs.close()
        self.trial: Trial | None = None

    def begin(self, trial: Trial) -> None:
        self.trial = trial
        try:
            self.pipe.send(trial)
        except OSError:
            # The process is dead; reading from the pipe will show it.
            pass

    def row(self) -> dict[str, Any] | None:
        """The trial's row, None if the process died."""
        try:
            row: dict[str, Any] = self.pipe.recv()
        except (EOFError, OSError):
            return None
        self.trial = None
        return row

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _serve(pipe: Connection, do: Do) -> None:
    """Run trials until the pipe is closed."""
    # The parent process handles interrupts.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            trial = pipe.recv()
        except EOFError:
            return
        pipe.send(do(trial))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        # Without its parent, a trial that continued could be run twice.
        os._exit(1)
