"""Replaying a bag to a running tracker, each in its own process."""

import math
import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from markerless_tracker.cli.replay.processes import NodeError, NodeProcess
from markerless_tracker.node.ros.profile import apply_profile
from markerless_tracker.node.watch import StateWatch

READY_S = 900.0
"""Timeout for the tracker's start. The first start compiles, for minutes on a busy machine."""

STUCK_S = 600.0
"""Timeout of a replay: without progress in lockstep, beyond the bag's duration in real time."""

_QUIET_S = 5.0
_LOOK_S = 0.2
_PLAYED = re.compile(r"played \d+ sets in ([\d.]+) s, ([\d.]+) ms of CPU time a set")

Report = Callable[[str, int], None]
"""Called with the current activity and the number of sets that the tracker has finished."""


@dataclass(frozen=True)
class Replay:
    """Counts and times of one replay.

    Attributes:
        rate: playback rate, 1 = real time; None = lockstep.
        sets: sets of images in the bag.
        tracked: sets that were tracked.
        skipped: complete sets replaced by newer ones before they were tracked.
        lost: sets that were never complete.
        fps: frames tracked per second at this rate.
        latency_median_ms, latency_p95_ms: from the arrival of a set's last image to its
            publication.
        first_pose_s: from the arrival of the first set that was tracked to the first pose; NaN
            without a pose.
        playing_s: time in which the player sent the sets.
        player_cpu_ms: CPU time of the player per set.
        tracker_cpu_s: CPU time of the tracker, from when it is ready to the end.
        result: the result files' path without suffix.
        warnings: the warnings of the player.
    """

    rate: float | None
    sets: int
    tracked: int
    skipped: int
    lost: int
    fps: float
    latency_median_ms: float
    latency_p95_ms: float
    first_pose_s: float
    playing_s: float
    player_cpu_ms: float
    tracker_cpu_s: float
    result: Path
    warnings: Sequence[str]


def replay(
    bag: Path,
    *,
    sets: int,
    rate: float | None,
    fps: float,
    tracker: Mapping[str, object],
    result: Path,
    log_dir: Path,
    report: Report,
) -> Replay:
    """Start a tracker and a player, wait for the end of the bag, stop the tracker.

    Args:
        bag: the bag's folder.
        sets: sets of images in it.
        rate: playback rate, 1 = real time; None = lockstep, every set as fast as it is tracked.
        fps: the recording's rate, 1/s.
        tracker: the tracker's parameters.
        result: path of the result files without suffix.
        log_dir: folder for the output of the processes.
        report: called with the progress.

    Raises:
        NodeError: a process failed, or the tracker was not ready in time.
        RosMissingError: ROS 2 is not installed.
    """
    domain_id = own_domain()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    apply_profile()
    node = NodeProcess(
        "markerless_tracker.node.tracker.executable",
        {**tracker, "result_file": result, "overwrite": True},
        log=log_dir / f"tracker_{result.name}.log",
        domain_id=domain_id,
    )
    with node, StateWatch(domain_id) as watch:
        _until_ready(node, watch, report)
        pace = {"lockstep": True} if rate is None else {"rate": float(rate)}
        player = NodeProcess(
            "markerless_tracker.node.player.executable",
            {"bag": bag, "wait_for_subscribers": True, **pace},
            log=log_dir / f"player_{result.name}.log",
            domain_id=domain_id,
        )
        with player:
            lasts_s = None if rate is None else sets / fps / rate
            values = _until_through(node, player, watch, sets, lasts_s, report)
            warnings = player.warnings()
            playing_s, player_cpu_ms = _played(player.output())
        node.check()
    counted = {key: int(values.get(key, "0")) for key in ("tracked", "skipped")}
    return Replay(
        rate=rate,
        sets=sets,
        lost=max(0, sets - _dealt_with(values)),
        fps=float(values.get("fps", "nan")),
        latency_median_ms=float(values.get("latency_median_ms", "nan")),
        latency_p95_ms=float(values.get("latency_p95_ms", "nan")),
        first_pose_s=float(values.get("first_pose_s", "nan")),
        playing_s=playing_s,
        player_cpu_ms=player_cpu_ms,
        tracker_cpu_s=float(values.get("cpu_s", "nan")),
        result=result,
        warnings=warnings,
        **counted,
    )


def own_domain() -> int:
    """ROS domain of the environment, else one derived from the process id."""
    chosen = os.environ.get("ROS_DOMAIN_ID", "")
    return int(chosen) if chosen.isdecimal() else 1 + os.getpid() % 101


def _until_ready(node: NodeProcess, watch: StateWatch, report: Report) -> None:
    deadline_s = time.monotonic() + READY_S
    while True:
        values = watch.listen(0.2)
        if values.get("ready") == "true":
            return
        node.check()
        if not node.running or time.monotonic() > deadline_s:
            raise NodeError(f"tracker: not ready within {READY_S:g} s")
        report(values.get("activity", "starting"), 0)


def _until_through(
    node: NodeProcess,
    player: NodeProcess,
    watch: StateWatch,
    sets: int,
    lasts_s: float | None,
    report: Report,
) -> Mapping[str, str]:
    """Wait until the player has ended and the tracker has finished all sets it received.

    Args:
        node, player: the processes.
        watch: subscriber of the tracker's `state`.
        sets: sets of images in the bag.
        lasts_s: time the bag takes; None = as long as sets are tracked.
        report: called with the progress.

    Raises:
        NodeError: a process failed, or it takes too long.
    """
    began_s = time.monotonic()
    changed_s, seen = time.monotonic(), -1
    # The rate falls once the last set is tracked.
    latest: Mapping[str, str] = {}
    while True:
        values = watch.listen(0.1)
        # Results arrive far more often. On two cores, receiving each one would slow the tracker.
        time.sleep(_LOOK_S)
        done = _dealt_with(values)
        now_s = time.monotonic()
        if done != seen:
            changed_s, seen, latest = now_s, done, values
        report("tracking", min(done, sets))
        node.check()
        player.check()
        if not player.running and (done >= sets or now_s - changed_s > _QUIET_S):
            return latest
        limit_s = changed_s + STUCK_S if lasts_s is None else began_s + lasts_s + STUCK_S
        if now_s > limit_s:
            raise NodeError(
                f"{'player' if player.running else 'tracker'}: not through {sets} sets after "
                f"{now_s - began_s:.0f} s, {done} were dealt with"
            )


def _played(output: str) -> tuple[float, float]:
    """Duration (s) and CPU time per set (ms) printed by the player; NaN if it was interrupted."""
    found = _PLAYED.search(output)
    return (float(found[1]), float(found[2])) if found else (math.nan, math.nan)


def _dealt_with(values: Mapping[str, str]) -> int:
    keys = ("tracked", "skipped", "late", "dropped_before_start", "dropped_on_error")
    return sum(int(values.get(key, "0")) for key in keys)
