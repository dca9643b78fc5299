"""The demo: download, learn backgrounds, convert to a bag, replay it live twice, report."""

import argparse
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import fmean

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from markerless_tracker.bags import write_bag
from markerless_tracker.body import load_body, read_subject
from markerless_tracker.cli.demo.pictures import draw_pictures, mean_overlap, read_outcome
from markerless_tracker.cli.demo.scene import Scene, made_up_scene, real_scene
from markerless_tracker.cli.replay.replay import Replay, replay
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.errors import DatasetError, TrackerError
from markerless_tracker.node.ros.process import require_ros


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo; returns the exit status."""
    parser = argparse.ArgumentParser(prog="make demo", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("demo"), help="folder for all files")
    parser.add_argument(
        "--made-up", action="store_true", help="track a synthetic person, download nothing"
    )
    args = parser.parse_args(argv)
    console = Console(highlight=False)
    try:
        _demo(args.folder, console, made_up=args.made_up)
    except KeyboardInterrupt:
        return 130
    except (TrackerError, OSError) as error:
        print(f"demo: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    return 0


def _demo(folder: Path, console: Console, *, made_up: bool) -> None:
    require_ros()
    started_s = time.monotonic()
    scene = _scene(folder, console, made_up=made_up)
    bag = folder / "bag"
    sets, fps = _convert(scene, bag, console)
    every, live = _replays(scene, bag, folder, console, sets=sets, fps=fps)
    outcome = read_outcome(every.result)
    overlaps = [mean_overlap(outcome.frames), _overlap(live.result)]
    with _bar(console, "drawing", None):
        body = load_body(
            outcome.body, read_subject(every.result.with_name(every.result.name + ".subject.yaml"))
        )
        sheets = draw_pictures(bag, outcome.frames, body, folder / "result" / "overlays")
    _report(console, scene, (every, live), overlaps, sheets)
    console.print(f"The demo took {time.monotonic() - started_s:.0f} s.")


def _scene(folder: Path, console: Console, *, made_up: bool) -> Scene:
    if made_up:
        return made_up_scene(folder, "chosen with --made-up")
    try:
        with _bar(console, "downloading the recording", None):
            return real_scene(folder)
    except DatasetError as error:
        console.print(
            f"{error}\nThe demo uses a synthetic person instead.", markup=False, soft_wrap=True
        )
        return made_up_scene(folder, str(error))


def _convert(scene: Scene, bag: Path, console: Console) -> tuple[int, float]:
    """Write the bag; returns its number of sets and rate (1/s)."""
    recording = open_recording(scene.recording, scale=scene.scale)
    with _bar(console, "learning the backgrounds", None):
        backgrounds = backgrounds_of(recording)
    shutil.rmtree(bag, ignore_errors=True)
    with _bar(console, "writing the bag", recording.frame_count) as advance:
        summary = write_bag(
            recording, bag, backgrounds=backgrounds, progress=lambda done, _: advance("", done)
        )
    for warning in recording.warnings:
        console.print(f"  {warning}", markup=False, style="dim", soft_wrap=True)
    return summary.sets, recording.fps


def _replays(
    scene: Scene, bag: Path, folder: Path, console: Console, *, sets: int, fps: float
) -> tuple[Replay, Replay]:
    """One replay in lockstep, which skips no set, and one in real time."""
    tracker: dict[str, object] = {
        "calibration_file": bag / "calibration.toml",
        "background_dir": bag / "background",
        **({"body": scene.body} if scene.body else {}),
    }

    def run(rate: float | None, name: str, title: str) -> Replay:
        with _bar(console, title, sets) as advance:
            return replay(
                bag,
                sets=sets,
                rate=rate,
                fps=fps,
                tracker=tracker,
                result=folder / "result" / name,
                log_dir=folder / "log",
                report=advance,
            )

    every = run(None, "every_frame", "tracking every set, in lockstep")
    live = run(1.0, "real_time", "tracking in real time")
    for warning in (*every.warnings, *live.warnings):
        console.print(f"  player: {warning}", markup=False, style="dim", soft_wrap=True)
    return every, live


def _overlap(result: Path) -> dict[str, float]:
    """Overlaps of a result; empty if the person was tracked in no frame."""
    try:
        return mean_overlap(read_outcome(result).frames)
    except DatasetError:
        return {}


@contextmanager
def _bar(console: Console, title: str, total: int | None) -> Iterator[Callable[[str, int], None]]:
    """A progress bar; yields a function of the current activity and the number of sets done."""
    columns = [TextColumn("{task.description:<42}"), BarColumn(), TimeElapsedColumn()]
    if total is not None:
        columns.insert(2, MofNCompleteColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(title, total=total)

        def advance(doing: str, done: int) -> None:
            text = f"{title}: {doing}" if doing and not done else title
            progress.update(task, description=text, completed=done)

        yield advance
        progress.update(task, description=title, total=total or 1, completed=total or 1)


def _pace(run: Replay) -> str:
    return "every set" if run.rate is None else f"{run.rate:g} x"


def _report(
    console: Console,
    scene: Scene,
    replays: Sequence[Replay],
    overlaps: Sequence[dict[str, float]],
    sheets: Sequence[Path],
) -> None:
    table = Table(title=f"Tracked live: {scene.title}")
    headings = ("rate", "sets", "tracked", "skipped", "fps", "latency median", "p95", "overlap")
    for heading in headings:
        table.add_column(heading, justify="right")
    for run, overlap in zip(replays, overlaps, strict=True):
        table.add_row(
            _pace(run),
            str(run.sets),
            str(run.tracked),
            f"{run.skipped}" + (f" + {run.lost} lost" if run.lost else ""),
            f"{run.fps:.1f}",
            f"{run.latency_median_ms:.0f} ms",
            f"{run.latency_p95_ms:.0f} ms",
            f"{fmean(overlap.values()):.3f}" if overlap else "-",
        )
    console.print(table)
    console.print(
        "Overlap (IoU) of silhouette and body, every set: "
        + ", ".join(f"{name} {value:.3f}" for name, value in overlaps[0].items()),
        soft_wrap=True,
    )
    console.print("Markers:  " + ", ".join(f"{run.result}.trc" for run in replays), soft_wrap=True)
    console.print("Overlays: " + ", ".join(map(str, sheets)), soft_wrap=True)
    if scene.note:
        console.print(f"Not the real recording: {scene.note}", markup=False, soft_wrap=True)


if __name__ == "__main__":
    sys.exit(main())
